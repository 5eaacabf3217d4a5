"""What was read of an input, as columns that numpy takes as they are.

A file is a line of marks (see `_HEAD`), JSON that says what the columns are, and the columns, each
at a place that is a multiple of 8: little-endian numbers in the fewest bytes that hold them, the
states as 64-bit floats row by row.  A checksum tells whether all is there.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rebt_ros.arrays import IntArray, in_parts
from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.storage.account import Account
from rebt_ros.storage.read import Part, Read

_MAGIC: Final = b"rebtcol1"
#: Mark, checksum of all that follows, and length of the JSON.
_HEAD: Final = struct.Struct("<8sII")
_ALIGNED: Final = 8
#: Smaller files are read, larger ones mapped (bytes): so a process maps some thousands at most.
_MAPPED: Final = 1 << 22


class NoColumnFileError(Exception):
    """The bytes are not those of a whole column file."""


def packed(read: Read, words: Mapping[str, Any] | None = None) -> Iterator[bytes]:
    """The bytes of a column file, part by part: states that are on disk stay there.

    Args:
        read: What was read; its robot file is left out, and only that there is one is noted.
        words: More to say, as JSON has it.
    """
    shown = read.demonstration
    columns: dict[str, NDArray[Any]] = {
        "states": shown.states,
        "stamps": np.ascontiguousarray(shown.stamps, dtype="<i8"),
        "chosen": _narrow(shown.chosen, len(shown.actions)),
        "channel": _narrow(shown.channel, len(shown.channels)),
    }
    place, places = 0, {}
    for name, column in columns.items():
        places[name] = [place, "<f8" if name == "states" else column.dtype.str]
        place += column.nbytes + -column.nbytes % _ALIGNED
    said = {
        "name": shown.name,
        "features": [_feature_json(feature) for feature in shown.features],
        "actions": shown.actions,
        "channels": shown.channels,
        "before": dict(shown.before),
        "row_kind": shown.row_kind.value,
        "rows": len(shown),
        "notes": read.notes,
        "account": read.account.as_json() if read.account else None,
        "no_features": sorted(read.no_features),
        "has_robot": read.robot is not None,
        "parts": read.parts,
        "columns": places,
        "words": dict(words or {}),
    }
    text = json.dumps(said, ensure_ascii=False).encode("utf-8", "surrogatepass")
    text += b" " * (-(_HEAD.size + len(text)) % _ALIGNED)
    check = zlib.crc32(text)
    for part in _content(columns.values()):
        check = zlib.crc32(part, check)
    yield _HEAD.pack(_MAGIC, check, len(text)) + text
    yield from _content(columns.values())


def _content(columns: Iterable[NDArray[Any]]) -> Iterator[bytes]:
    """The bytes of columns, each filled up to where the next one may begin."""
    for column in columns:
        for part in in_parts(len(column)):
            values = column[part]
            yield (values.astype("<f8", copy=False) if values.ndim > 1 else values).tobytes()
        yield bytes(-column.nbytes % _ALIGNED)


def unpacked_read(content: bytes | mmap.mmap) -> tuple[Read, dict[str, Any], bool]:
    """What a column file holds: what was read, the words, and whether it had a robot file.

    The states are those of the file, not a copy.

    Raises:
        NoColumnFileError: It is no whole column file.
    """
    try:
        magic, check, length = _HEAD.unpack_from(content)
        view = memoryview(content)[_HEAD.size :]
        if magic != _MAGIC or length > len(view) or zlib.crc32(view) != check:
            raise NoColumnFileError
        said = json.loads(bytes(view[:length]).decode("utf-8", "surrogatepass"))
        return _read_of(said, view[length:])
    except (struct.error, ValueError, KeyError, TypeError, RecursionError) as err:
        raise NoColumnFileError from err


def read_columns(path: Path) -> tuple[Read, dict[str, Any], bool]:
    """Reads a column file; a large one is mapped.  See `unpacked_read`.

    Raises:
        NoColumnFileError: It is no whole column file.
        OSError: It is not there, or cannot be read.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        if size >= _MAPPED:
            # Each mapping has a descriptor of its own, of which there may be too few.
            with contextlib.suppress(OSError):
                return unpacked_read(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        return unpacked_read(file.read())


def _read_of(said: dict[str, Any], content: memoryview) -> tuple[Read, dict[str, Any], bool]:
    rows, features = int(said["rows"]), tuple(map(_feature_of, said["features"]))

    def column(name: str, width: int = 1) -> NDArray[Any]:
        place, kind = said["columns"][name]
        return np.frombuffer(content, dtype=np.dtype(kind), count=rows * width, offset=place)

    def codes(name: str, labels: tuple[str, ...]) -> IntArray:
        found: IntArray = column(name).astype(np.int64)
        if rows and not 0 <= found.min() <= found.max() < len(labels):
            raise NoColumnFileError
        return found

    actions, channels = tuple(said["actions"]), tuple(said["channels"])
    shown = Demonstration(
        said["name"],
        features,
        column("states", len(features)).reshape(rows, len(features)),
        column("stamps"),
        actions,
        codes("chosen", actions),
        channels,
        codes("channel", channels),
        said["before"],
        RowKind(said["row_kind"]),
    )
    account = said["account"] and Account(**said["account"])
    parts = tuple(Part(str(name), int(rows)) for name, rows in said["parts"])
    no_features = frozenset(said["no_features"])
    read = Read(shown, tuple(said["notes"]), account, no_features, parts=parts)
    return read, said["words"], bool(said["has_robot"])


def _narrow(codes: IntArray, count: int) -> NDArray[Any]:
    """Positions among so many labels, in the fewest bytes that hold them."""
    kind = np.min_scalar_type(max(count - 1, 0)).newbyteorder("<")
    narrow: NDArray[Any] = codes.astype(kind)
    return narrow


def _feature_json(feature: Feature) -> list[Any]:
    kind, categories = feature.kind.value, feature.categories
    return [feature.name, kind, categories, feature.topic, feature.index, feature.lag]


def _feature_of(said: list[Any]) -> Feature:
    name, kind, categories, topic, index, lag = said
    return Feature(name, FeatureKind(kind), tuple(categories), topic, index, lag)
