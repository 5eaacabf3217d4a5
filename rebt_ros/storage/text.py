"""Text files, read as a whole."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable
from pathlib import Path

from rebt_ros.errors import InputError

#: Encodings by the byte order mark that a file begins with; that of UTF-16 begins UTF-32's.
_MARKED = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)

#: Encodings without a mark, by which bytes of a pair are 0 in plain words.
_UNMARKED = ((1, "utf-16-le"), (0, "utf-16-be"))

#: So many bytes tell.
_TELLING = 64

_NOT_ASCII = re.compile(r"[^\x00-\x7f]+")
#: What stands together within words of languages with Latin letters, or by itself.
_LETTERS = re.compile(r"[À-ÖØ-öø-ÿŠšŽžŒœŸß]{1,2}")
_SIGNS = re.compile(r"[°µ²³±€£§·«»¼½¾×÷¿¡ª\u00a0\u2013\u2014\u2018\u2019\u201c\u201d\u2026]{1,2}")


#: Files that are no text have a zero byte among so many, as a rule.
_BINARY = 1024
#: What DOS puts behind a text.
_END_OF_FILE = "\x1a"


def read_text(path: Path, otherwise: Callable[[bytes], str | None] = lambda _: None) -> str:
    """The text of a file of UTF-8, UTF-16 or UTF-32, without its byte order mark.

    Line ends are left as they are.

    Args:
        path: The file.
        otherwise: Reads text in another encoding; None where it is not in that one either.

    Raises:
        InputError: There is no such file, or it cannot be read as text.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise unreadable(path, err) from err
    except ValueError as err:
        raise InputError(f"{str(path)!r} is no name of a file: check it.") from err
    encoding = _encoding(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as err:
        if encoding.startswith(("utf-16", "utf-32")) and err.end == len(data):
            raise InputError(
                f"{path} ends inside of a character, as where its copy was cut off: copy it again."
            ) from err
        if b"\0" in data[:_BINARY]:
            raise _no_text(path) from err
        other = otherwise(data)
        if other is not None:
            return other
        line = data.count(b"\n", 0, err.start) + 1
        raise InputError(f"{path}, line {line}: this is not UTF-8 text: save it as UTF-8.") from err
    if "\0" not in text:
        return text.removesuffix(_END_OF_FILE)
    filled = text.rstrip("\0")
    if "\0" in filled or "\n" not in filled:
        raise _no_text(path)
    raise InputError(
        f"{path} ends in zero bytes, as where a machine lost power while it was written: "
        "remove them with `tr -d '\\0' < FILE > COPY`."
    )


def windows_text(data: bytes) -> str | None:
    """Text of Windows-1252, which spreadsheets write where most of it is in Latin letters.

    None where it is not likely to be that, but for example Japanese.

    >>> windows_text("Höhe in °C".encode("cp1252"))
    'Höhe in °C'
    >>> windows_text("Привет".encode("cp1251")) is None
    True
    """
    try:
        text = data.decode("cp1252")
    except UnicodeDecodeError:
        return None
    return text if all(_is_likely(found) for found in _NOT_ASCII.finditer(text)) else None


def _is_likely(found: re.Match[str]) -> bool:
    """Whether what is not ASCII is part of a word with plain letters, or a sign."""
    begin, end, text = found.start(), found.end(), found.string
    beside = text[max(0, begin - 1) : begin] + text[end : end + 1]
    return _SIGNS.fullmatch(found.group()) is not None or (
        _LETTERS.fullmatch(found.group()) is not None and any(map(str.isalpha, beside))
    )


def _no_text(path: Path) -> InputError:
    return InputError(f"{path} is not a text file: name a file of another kind.")


def _encoding(data: bytes) -> str:
    for mark, encoding in _MARKED:
        if data.startswith(mark):
            return encoding
    begin = data[:_TELLING]
    for place, encoding in _UNMARKED:
        if begin[place::2] and not any(begin[place::2]) and all(begin[1 - place :: 2]):
            return encoding
    return "utf-8-sig"


def unreadable(path: Path, err: OSError) -> InputError:
    """What to tell a user whose file could not be opened or read."""
    if isinstance(err, FileNotFoundError):
        return InputError(f"{path} does not exist: check its name.")
    if isinstance(err, IsADirectoryError):
        return InputError(f"{path} is a directory: name a file in it.")
    if isinstance(err, NotADirectoryError):
        place = next((one for one in [path, *path.parents] if one.is_file()), path)
        return InputError(f"{place} is a file, not a directory: check its name.")
    return InputError(f"{path} cannot be read ({err.strerror or err}): check its permissions.")
