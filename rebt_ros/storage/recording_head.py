"""The first line of a recording: what its columns are and where they come from.

It is the mark `# rebt_ros recording`, and JSON.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Annotated, BinaryIO, Final

from rebt_ros.codec.bounds import Bounds
from rebt_ros.codec.containers import Array
from rebt_ros.codec.form import MisfitError
from rebt_ros.codec.hints import record
from rebt_ros.codec.record import Field, Record
from rebt_ros.codec.text import parsed
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.reading import CarriedRobotFile
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.recording_files import LONGEST_LINE, MARK

VERSION: Final = 2
#: The same by a robot file: values may be missing, and features hold categories or texts.
ROBOT_VERSION: Final = 3

#: The rows begin at a multiple of this many bytes.
_ALIGNMENT: Final = 64

#: Sample rates beyond, or below its reciprocal, are none (rows per second).
_LARGEST_RATE: Final = 1e9


class Origin(Enum):
    """Why a demonstration was shown."""

    DEMONSTRATION = "demonstration"
    """Of a person's own accord; also where nothing is said, as in older recordings."""
    TAKEOVER = "takeover"
    """A person took over from the executor: the rest of an episode that it had begun."""
    FAILED = "failed"
    """The executor had failed: the same again, as it should have been done."""


@dataclass(frozen=True, slots=True)
class Head:
    """What the first line says."""

    features: tuple[Feature, ...]
    channels: tuple[str, ...]
    sample_rate: float | None = None
    """Rows per second and channel; None for a row per action message."""
    origin: Origin = Origin.DEMONSTRATION
    texts: frozenset[int] = frozenset()
    """Places of features whose values are numbers of texts (see `recording_rows`)."""
    robot: RobotFile | None = None

    @property
    def may_miss(self) -> bool:
        """Whether values may be missing, as NaN."""
        return self.robot is not None

    @property
    def row_kind(self) -> RowKind:
        """What a row is."""
        return RowKind.EVENT if self.sample_rate is None else RowKind.SAMPLE

    @classmethod
    def parse(cls, text: str) -> Head:
        """Reads the JSON of the first line.

        Raises:
            ValueError: It is malformed; the message says how.
        """
        try:
            line = _decoded(text)
        except RecursionError as err:
            raise ValueError("its JSON is nested too deeply") from err
        except MisfitError as err:
            raise ValueError(err.sentence("its head").rstrip(".")) from err
        except RobotFileError as err:
            raise ValueError(str(err).rstrip(".")) from err
        if len(set(line.channels)) < len(line.channels):
            raise ValueError("two channels have the same name")
        if len({column.name for column in line.features}) < len(line.features):
            raise ValueError("two features have the same name")
        head = cls(
            tuple(map(_feature, line.features)), line.channels, line.sample_rate, line.origin
        )
        if line.version < ROBOT_VERSION:
            return head
        texts = frozenset(
            place for place, column in enumerate(line.features) if column.kind is _ColumnKind.TEXT
        )
        return replace(head, texts=texts, robot=line.robot)


class _ColumnKind(Enum):
    """What the values of a column are; the first three are a `FeatureKind`."""

    NUMERIC = "numeric"
    BINARY = "binary"
    CATEGORICAL = "categorical"
    TEXT = "text"
    """Numbers of texts."""


@dataclass(frozen=True, slots=True)
class _Column:
    """A feature, as the first line has it."""

    name: str
    topic: str | None = None
    index: int | None = None
    kind: _ColumnKind = _ColumnKind.NUMERIC
    categories: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _FirstLine:
    """A head, as the first line has it."""

    version: int
    sample_rate: Annotated[float, Bounds(1 / _LARGEST_RATE, _LARGEST_RATE)] | None = None
    origin: Origin = Origin.DEMONSTRATION
    features: tuple[_Column, ...]
    channels: tuple[str, ...]
    robot: RobotFile | None = None


_COLUMN: Final = record(
    _Column,
    "name",
    "topic",
    "index",
    Field("kind", omitted=True),
    Field("categories", omitted=True),
    tolerant=True,
)


def _first_line(*further: Field[_FirstLine]) -> Record[_FirstLine]:
    return record(
        _FirstLine,
        "version",
        "sample_rate",
        "origin",
        Field("features", Array(_COLUMN)),
        "channels",
        *further,
        tolerant=True,
    )


_FIRST_LINES: Final[Mapping[int, Record[_FirstLine]]] = {
    VERSION: _first_line(),
    ROBOT_VERSION: _first_line(Field("robot", CarriedRobotFile("its robot file"))),
}


def head_line(
    features: Sequence[Feature],
    channels: Sequence[str],
    sample_rate: float | None,
    origin: Origin = Origin.DEMONSTRATION,
    *,
    texts: Collection[int] = (),
    robot: RobotFile | None = None,
) -> bytes:
    """The first line of a recording; see `Head`."""
    columns = [_Column(feature.name, feature.topic, feature.index) for feature in features]
    if robot is not None:
        columns = [
            replace(
                column,
                kind=_ColumnKind.TEXT if place in texts else _ColumnKind(feature.kind.value),
                categories=feature.categories,
            )
            for place, (column, feature) in enumerate(zip(columns, features, strict=True))
        ]
    first_line = _FirstLine(
        version=VERSION if robot is None else ROBOT_VERSION,
        sample_rate=sample_rate,
        origin=origin,
        features=tuple(columns),
        channels=tuple(channels),
        robot=robot,
    )
    line = MARK + json.dumps(_FIRST_LINES[first_line.version].encode(first_line)).encode()
    return line + b" " * (-(len(line) + 1) % _ALIGNMENT) + b"\n"


def read_head(path: Path, file: BinaryIO) -> Head:
    """Reads the first line.

    Raises:
        InputError: It is not that of a recording, or of one that this version can read.
    """
    line = file.readline(LONGEST_LINE)
    if not line.startswith(MARK) or not line.endswith(b"\n"):
        raise InputError(f"{path} is not a recording: name one that the recorder wrote.")
    try:
        return Head.parse(line.removeprefix(MARK).decode())
    except ValueError as err:
        raise InputError(
            f"{path} is a recording that cannot be read, because {err}: "
            "use the version of rebt_ros that wrote it."
        ) from err


def _decoded(text: str) -> _FirstLine:
    value = parsed(text)
    version = value.get("version") if isinstance(value, dict) else None
    if type(version) is not int or version not in _FIRST_LINES:
        raise ValueError(f"its version is {version!r}, not {VERSION} or {ROBOT_VERSION}")
    return _FIRST_LINES[version].decode(value)


def _feature(column: _Column) -> Feature:
    if len(set(column.categories)) < len(column.categories):
        raise ValueError(f"feature {column.name!r} has two categories of the same name")
    if column.kind is _ColumnKind.TEXT:
        return Feature(column.name, topic=column.topic, index=column.index)
    kind = FeatureKind(column.kind.value)
    return Feature(column.name, kind, column.categories, column.topic, column.index)
