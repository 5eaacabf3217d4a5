"""The file beside tree.json from which a `Learning` comes back without learning again."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.errors import InputError
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.saved import Saved, restored, saved
from rebt_ros.storage.array_file import read_arrays, write_arrays

NAME = "learning.npz"


def write_learning(directory: Path, learning: Learning) -> tuple[str, ...]:
    """Writes learning.npz, or takes an older one away where the table is too large for it.

    Returns:
        Notes; no full stops.

    Raises:
        StorageError: It cannot be written.
    """
    path = directory / NAME
    kept = saved(learning)
    if kept is None:
        path.unlink(missing_ok=True)
        return (f"there is no {NAME}, as the table is too large for it",)
    write_arrays(path, kept.words, kept.arrays)
    return ()


def load_learning(path: str | Path) -> Learning:
    """A learned policy as it was when it was written, without learning again.

    Args:
        path: learning.npz, or the directory that `learn` wrote it to.

    Raises:
        InputError: There is no such file, or it cannot be used.
    """
    path = Path(path)
    if path.is_dir():
        path = path / NAME
    words, arrays = read_arrays(path)
    try:
        return restored(Saved(words, arrays))
    except InputError as err:
        raise InputError(f"{path} cannot be used: {err}") from err
