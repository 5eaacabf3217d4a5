"""Unpacking of what recorders pack: zstd and lz4, by the libraries that rosbags brings."""

from __future__ import annotations

import importlib
import shutil
import sys
from pathlib import Path
from typing import Any

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def unzstd(data: bytes) -> bytes:
    """Unpacks zstd data."""
    unpacked: bytes = _zstd().decompress(data)
    return unpacked


def unzstd_file(packed: Path, unpacked: Path) -> None:
    """Unpacks a file."""
    with _zstd().open(packed, "rb") as source, unpacked.open("wb") as target:
        shutil.copyfileobj(source, target)


def unlz4(data: bytes) -> bytes:
    """Unpacks an lz4 frame."""
    unpacked: bytes = importlib.import_module("lz4.frame").decompress(data)
    return unpacked


def _zstd() -> Any:
    name = "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"
    return importlib.import_module(name)
