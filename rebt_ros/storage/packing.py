"""Unpacking of what recorders pack: zstd and lz4, by the libraries that rosbags brings."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any, Final

ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"
LZ4_MAGIC: Final = b"\x04\x22\x4d\x18"
#: Suffixes of files that are packed as a whole, in lower case.
PACKED: Final = (".zstd", ".zst", ".lz4")

#: Files are unpacked in parts of this size (bytes).
_PART: Final = 1 << 16


def without_packing(name: str) -> str:
    """The name that a file has once it is unpacked.

    >>> without_packing("run_0.mcap.zstd"), without_packing("run_0.mcap")
    ('run_0.mcap', 'run_0.mcap')
    """
    suffix = next((one for one in PACKED if name.lower().endswith(one)), "")
    return name[: len(name) - len(suffix)]


def unzstd(data: bytes) -> bytes:
    """Unpacks zstd data."""
    unpacked: bytes = _zstd().decompress(data)
    return unpacked


def unpack_file(packed: Path, unpacked: Path) -> str:
    """Unpacks a file of zstd or lz4 data, as far as it goes.

    Returns:
        Why there may be more in it than was unpacked; empty where that is all.

    Raises:
        ValueError: It is neither, or nothing can be unpacked.
    """
    with packed.open("rb") as file:
        magic = file.read(4)
    if magic not in (ZSTD_MAGIC, LZ4_MAGIC):
        raise ValueError(f"{packed.name} does not begin like packed data")
    library = _zstd() if magic == ZSTD_MAGIC else _lz4()
    with library.open(packed, "rb") as source, unpacked.open("wb") as target:
        try:
            while part := source.read(_PART):
                target.write(part)
        except OSError:
            raise
        except Exception as err:  # of zstd or lz4: whatever the bytes provoke
            if not target.tell():
                raise ValueError(f"{packed.name} cannot be unpacked: {err}") from err
            return str(err)
    return ""


def unlz4(data: bytes) -> bytes:
    """Unpacks an lz4 frame."""
    unpacked: bytes = _lz4().decompress(data)
    return unpacked


def _lz4() -> Any:
    return importlib.import_module("lz4.frame")


def _zstd() -> Any:
    name = "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"
    return importlib.import_module(name)
