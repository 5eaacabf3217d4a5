"""Files that are something else than what their user took them for: what they are, what helps."""

from __future__ import annotations

import contextlib
import re
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError
from rebt_ros.storage.packing import ZSTD_MAGIC

_ZIP: Final = b"PK\x03\x04"

#: What zip archives are, and what helps.
_SHEET: Final = "is a spreadsheet: save the table as CSV"
_ARRAYS: Final = "is an archive of NumPy arrays: write the table as CSV, with a line of names"
#: By their suffixes.
_ZIPPED: Final = {**dict.fromkeys((".xlsx", ".xlsm", ".ods"), _SHEET), ".npz": _ARRAYS}
#: What has such a file in it, whatever it is called.
_SHEETS: Final = frozenset({"xl/workbook.xml", "content.xml"})

#: What packs a single file, by how its data begin, and what unpacks it.
_PACKED: Final = {
    b"\x1f\x8b": ("gzip", "gunzip"),
    b"BZh": ("bzip2", "bunzip2"),
    b"\xfd7zXZ": ("xz", "unxz"),
    ZSTD_MAGIC: ("zstd", "unzstd"),
}
#: What tar writes, and where.
_TAR: Final = b"ustar"
_AT: Final = 257
#: Names of archives that are packed as a whole, in lower case.
PACKED_ARCHIVES: Final = (
    *(f".tar.{suffix}" for suffix in ("gz", "bz2", "xz", "zst", "zstd")),
    *(".tgz", ".tbz", ".tbz2", ".txz"),
)
_UNTAR: Final = "unpack it with `tar -xf`"

_ARFF: Final = re.compile(rb"(?:\s|%[^\n]*\n)*@relation\s", re.IGNORECASE)

#: How files begin that are no files of messages, what they are, and what helps.
_STRANGERS: Final[Sequence[tuple[bytes, str]]] = (
    (
        b"version https://git-lfs",
        "is a pointer of Git LFS, not the file itself: run `git lfs pull`",
    ),
    (
        b"#ROSBAG V",
        "is a bag of ROS 1: convert it with `rosbags-convert --src FILE --dst DIRECTORY`",
    ),
    (b"PAR1", "is a Parquet file: write it as CSV, with pandas for example"),
    (b"ARROW1", "is an Arrow file: write it as CSV, with pandas for example"),
    (b"\x89HDF", "is an HDF5 file: write it as CSV, with pandas for example"),
    (b"\x93NUMPY", "is an array of NumPy: write it as CSV, with a line of column names"),
    (b"\x80\x04\x95", "is a pickle of Python: write the table as CSV, with a line of column names"),
    (b"\xd0\xcf\x11\xe0", "is a file of an old Excel or Word: save the table as CSV"),
    (b"{\\rtf", "is a rich text document: save the table as CSV"),
    (b"%PDF", "is a PDF file: name the file that it was made of"),
    (b"7z\xbc\xaf", "is an archive of 7-Zip: unpack it with `7z x`"),
    (b"Rar!", "is an archive of RAR: unpack it with `unrar x`"),
    (b"<!DOCTYPE", "is a page of HTML, as a failed download leaves it: download the file itself"),
    (b"<html", "is a page of HTML, as a failed download leaves it: download the file itself"),
)


def refuse_strangers(path: Path) -> None:
    """Refuses a file that is something else than what its user took it for.

    Raises:
        InputError: It says what the file is and what helps.
    """
    if not path.is_file():
        # What is read from a pipe is gone.
        return
    with contextlib.suppress(OSError):
        with path.open("rb") as file:
            begin = file.read(_AT + len(_TAR))
        if what := _what_it_is(path, begin):
            raise InputError(f"{path} {what}.")


def _what_it_is(path: Path, begin: bytes) -> str:
    """What a file is that begins so, and what helps; empty where it may be what it should be."""
    if begin.startswith(_ZIP):
        return _what_is_zipped(path)
    if begin[_AT:] == _TAR:
        return f"is a tar archive: {_UNTAR}"
    for magic, (how, unpack) in _PACKED.items():
        if begin.startswith(magic):
            if path.name.lower().endswith(PACKED_ARCHIVES):
                return f"is a packed tar archive: {_UNTAR}"
            return f"is packed with {how}: unpack it with `{unpack}`"
    if _ARFF.match(begin):
        return (
            "is an ARFF file of Weka: write it as CSV, or keep the lines behind @data, below a "
            "line of names"
        )
    return next((what for magic, what in _STRANGERS if begin.startswith(magic)), "")


def _what_is_zipped(path: Path) -> str:
    if known := _ZIPPED.get(path.suffix.lower()):
        return known
    with contextlib.suppress(Exception), zipfile.ZipFile(path) as archive:  # whatever it holds
        names = archive.namelist()
        if not _SHEETS.isdisjoint(names):
            return _SHEET
        if names and all(name.endswith(".npy") for name in names):
            return _ARRAYS
    return "is a zip archive: unpack it with `unzip`"
