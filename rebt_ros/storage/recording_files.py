"""Which files are recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError
from rebt_ros.storage.text import unreadable

SUFFIX: Final = ".rec"

#: What every recording begins with.
MARK: Final = b"# rebt_ros recording "

#: Longer first lines are refused, so that a file that is no recording is not read as a whole.
LONGEST_LINE: Final = 1 << 24


def recordings(directory: Path) -> tuple[Path, ...]:
    """The recordings in a directory, oldest first; other files are passed over.

    Raises:
        InputError: There is no such directory, or there is no recording in it.
    """
    try:
        files = sorted(
            path for path in directory.iterdir() if path.suffix == SUFFIX and path.is_file()
        )
    except NotADirectoryError as err:
        raise InputError(f"{directory} is not a directory: name one with recordings.") from err
    except OSError as err:
        raise unreadable(directory, err) from err
    found = tuple(file for file in files if is_recording(file))
    if not found:
        raise InputError(f"{directory} holds no recordings: record a demonstration first.")
    return found


def is_recording(path: Path) -> bool:
    """Whether a file begins like a recording.

    One whose recorder was killed before it had written what comes before the rows does not.
    """
    try:
        with path.open("rb") as file:
            return file.read(len(MARK)) == MARK and file.readline(LONGEST_LINE).endswith(b"\n")
    except OSError:
        return False
