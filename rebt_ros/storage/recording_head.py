"""The first line of a recording: what its columns are and where they come from.

It is the mark `# rebt_ros recording`, and JSON.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any, BinaryIO, Final

from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.reading import robot_file_of
from rebt_ros.robot_file.robot_file import RobotFile

VERSION: Final = 2
#: The same by a robot file: values may be missing, and features hold categories or texts.
ROBOT_VERSION: Final = 3

#: What every recording begins with.
MARK: Final = b"# rebt_ros recording "

#: Longer first lines are refused, so that a file that is no recording is not read as a whole.
LONGEST_LINE: Final = 1 << 24

#: The rows begin at a multiple of this many bytes.
_ALIGNMENT: Final = 64

#: Kind of a feature whose values are numbers of texts.
_TEXT_KIND: Final = "text"

#: Sample rates beyond are none (rows per second).
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
            values = json.loads(text)
        except RecursionError as err:
            raise ValueError("its JSON is nested too deeply") from err
        if not isinstance(values, dict):
            raise ValueError("its JSON is not an object")
        version, features, channels = (
            values.get(one) for one in ("version", "features", "channels")
        )
        if type(version) is not int or version not in (VERSION, ROBOT_VERSION):
            raise ValueError(f"its version is {version!r}, not {VERSION} or {ROBOT_VERSION}")
        if not isinstance(features, list) or not isinstance(channels, list):
            raise ValueError("it lists no features or no channels")
        if not all(isinstance(channel, str) for channel in channels):
            raise ValueError("a channel is not text")
        if len(set(channels)) < len(channels):
            raise ValueError("two channels have the same name")
        read = tuple(map(_parse_feature, features))
        if len({feature.name for feature in read}) < len(read):
            raise ValueError("two features have the same name")
        sample_rate = _parse_sample_rate(values.get("sample_rate"))
        origin = _parse_origin(values.get("origin", Origin.DEMONSTRATION.value))
        head = cls(read, tuple(channels), sample_rate, origin)
        if version < ROBOT_VERSION:
            return head
        texts = frozenset(
            place for place, one in enumerate(features) if one.get("kind") == _TEXT_KIND
        )
        return replace(head, texts=texts, robot=_parse_robot(values.get("robot")))


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
    description: dict[str, Any] = {
        "version": VERSION if robot is None else ROBOT_VERSION,
        "sample_rate": sample_rate,
        "origin": origin.value,
        "features": [
            {"name": feature.name, "topic": feature.topic, "index": feature.index}
            for feature in features
        ],
        "channels": list(channels),
    }
    if robot is not None:
        description["robot"] = robot.content
        for place, (feature, its) in enumerate(zip(features, description["features"], strict=True)):
            if place in texts:
                its["kind"] = _TEXT_KIND
            elif feature.kind is not FeatureKind.NUMERIC:
                its["kind"] = feature.kind.value
            if feature.categories:
                its["categories"] = list(feature.categories)
    line = MARK + json.dumps(description).encode()
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


def _parse_sample_rate(value: object) -> float | None:
    if value is None:
        return None
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        # Python's JSON also knows NaN and Infinity.
        or not 0 < value <= _LARGEST_RATE
    ):
        raise ValueError(f"its sample rate is {value!r}, not null or a positive number")
    return float(value)


def _parse_origin(value: object) -> Origin:
    for one in Origin:
        if value == one.value:
            return one
    raise ValueError(f"its origin is {value!r}, not {', '.join(one.value for one in Origin)}")


def _parse_feature(value: object) -> Feature:
    if not isinstance(value, dict):
        raise ValueError(f"{value!r} is not a feature")
    name, topic, index = value.get("name"), value.get("topic"), value.get("index")
    if not (
        isinstance(name, str)
        and isinstance(topic, str | None)
        and isinstance(index, int | None)
        and not isinstance(index, bool)
    ):
        raise ValueError(f"{value!r} is not a feature")
    kind, categories = value.get("kind", "numeric"), value.get("categories", [])
    if kind == _TEXT_KIND:
        return Feature(name, topic=topic, index=index)
    kinds = {one.value: one for one in FeatureKind}
    if not (
        isinstance(kind, str)
        and kind in kinds
        and isinstance(categories, list)
        and all(isinstance(category, str) for category in categories)
        and len(set(categories)) == len(categories)
    ):
        raise ValueError(f"{value!r} is not a feature")
    return Feature(name, kinds[kind], tuple(categories), topic, index)


def _parse_robot(value: object) -> RobotFile:
    try:
        return robot_file_of(value, "its robot file")
    except RobotFileError as err:
        raise ValueError(str(err).rstrip(".")) from err
