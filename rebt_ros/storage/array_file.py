"""Files of plain arrays and words: numpy's .npz with a member of JSON, never with pickles."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.format import read_array

from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import write_bytes_atomically
from rebt_ros.storage.text import unreadable

_WORDS = "words"

#: Bytes of all arrays together, unpacked.  The largest that is written has a quarter of them.
MOST_BYTES = 256_000_000

#: What zip files and arrays that were damaged, or made by others, raise.
_MALFORMED = (
    zipfile.BadZipFile,
    zlib.error,
    NotImplementedError,
    KeyError,
    ValueError,
    EOFError,
    RecursionError,
    RuntimeError,
    MemoryError,
)


def write_arrays(path: Path, words: dict[str, Any], arrays: dict[str, npt.NDArray[Any]]) -> None:
    """Writes a file, packed.

    Raises:
        StorageError: It cannot be written.
    """
    text = json.dumps(words, ensure_ascii=False).encode()
    packed = io.BytesIO()
    members: dict[str, Any] = {**arrays, _WORDS: np.frombuffer(text, dtype=np.uint8)}
    np.savez_compressed(packed, **members)
    write_bytes_atomically(path, packed.getvalue())


def read_arrays(path: Path) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Reads a file that `write_arrays` wrote.

    Raises:
        InputError: It cannot be read, is no such file, or is larger than `MOST_BYTES` unpacked.
    """
    try:
        with zipfile.ZipFile(path) as packed:
            members = packed.infolist()
            size = sum(member.file_size for member in members)
            if size > MOST_BYTES:
                raise InputError(
                    f"{path} takes {size / 1e6:.0f} MB unpacked, more than the "
                    f"{MOST_BYTES / 1e6:.0f} that are read: learn again."
                )
            arrays = {}
            for member in members:
                with packed.open(member) as file:
                    name = member.filename.removesuffix(".npy")
                    arrays[name] = read_array(file, allow_pickle=False)
        words = json.loads(arrays.pop(_WORDS).tobytes())
    except OSError as err:
        raise unreadable(path, err) from err
    except _MALFORMED as err:
        raise _no_file_of_ours(path) from err
    if not isinstance(words, dict):
        raise _no_file_of_ours(path)
    return words, arrays


def _no_file_of_ours(path: Path) -> InputError:
    return InputError(f"{path} is no file of a learned policy: learn again, or name another.")
