"""Which files are recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError, listing
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
    found = tuple(file for file in _named_so(directory) if is_recording(file))
    if not found:
        why = "".join(f" ({note})" for note in no_recordings(directory) or _others(directory))
        raise InputError(f"{directory} holds no recordings{why}: record a demonstration first.")
    return found


def no_recordings(directory: Path) -> tuple[str, ...]:
    """Which files in a directory are called like recordings and are none, in a sentence if any.

    No full stop.

    Raises:
        InputError: There is no such directory.
    """
    others = [file.name for file in _named_so(directory) if not is_recording(file)]
    if not others:
        return ()
    if len(others) == 1:
        return (f"{others[0]} does not begin like a recording and is left out",)
    count = len(others)
    return (f"{count} files do not begin like recordings and are left out: {listing(others)}",)


def _others(directory: Path) -> tuple[str, ...]:
    """What there is instead of recordings, in words if there is any."""
    others = sorted(one.name for one in directory.iterdir() if not one.name.startswith("."))
    if not others:
        return ()
    return (f"{listing(others)} is none; the command `learn` reads tables and bags",)


def is_named_so(path: Path) -> bool:
    """Whether a file is called like a recording, in capitals or not."""
    return path.suffix.lower() == SUFFIX and path.is_file()


def _named_so(directory: Path) -> list[Path]:
    try:
        return sorted(filter(is_named_so, directory.iterdir()))
    except NotADirectoryError as err:
        raise InputError(f"{directory} is not a directory: name one with recordings.") from err
    except OSError as err:
        raise unreadable(directory, err) from err


def is_recording(path: Path) -> bool:
    """Whether a file begins like a recording.

    One whose recorder was killed before it had written what comes before the rows does not.  What
    is read from a pipe is gone, so that nobody looks into one.
    """
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return file.read(len(MARK)) == MARK and file.readline(LONGEST_LINE).endswith(b"\n")
    except OSError:
        return False
