"""Text files, read as a whole."""

from __future__ import annotations

import codecs
from pathlib import Path

from rebt_ros.errors import InputError

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, or of a UTF-16 one with a byte order mark, line ends untouched.

    Raises:
        InputError: There is no such file, or it cannot be read as text.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise unreadable(path, err) from err
    except ValueError as err:
        raise InputError(f"{str(path)!r} is no name of a file: check it.") from err
    try:
        text = data.decode("utf-16" if data.startswith(_UTF_16) else "utf-8-sig")
    except UnicodeDecodeError as err:
        line = data.count(b"\n", 0, err.start) + 1
        raise InputError(f"{path}, line {line}: this is not UTF-8 text: save it as UTF-8.") from err
    if "\0" in text:
        raise InputError(f"{path} is not a text file: name a file of another kind.")
    return text


def unreadable(path: Path, err: OSError) -> InputError:
    """What to tell a user whose file could not be opened or read."""
    if isinstance(err, FileNotFoundError):
        return InputError(f"{path} does not exist: check its name.")
    if isinstance(err, IsADirectoryError):
        return InputError(f"{path} is a directory: name a file in it.")
    return InputError(f"{path} cannot be read ({err.strerror or err}): check its permissions.")
