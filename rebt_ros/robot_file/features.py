"""Reading features from messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any, Final, TypeAlias

from rebt_ros.demonstration.builder import LARGEST_VALUE, StateTopic
from rebt_ros.demonstration.categories import Categories
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.message_path.compiling import Getter, attribute_of, getter
from rebt_ros.message_path.definition import Primitive
from rebt_ros.robot_file.binding import BoundFeature, BoundTopic
from rebt_ros.robot_file.robot_file import RobotFile

#: So many values are remembered that are none of the categories.
_MOST_UNNAMED: Final = 10

#: Turns what a path gives into what a row holds, NaN for what is missing.
_Encoder: TypeAlias = Callable[[float | str], float]


class FeatureReader:
    """Reads the features of one topic from its messages, one after the other.

    Args:
        topic: The topic.
        categories: Those of features; such as are not there are added.
    """

    def __init__(self, topic: BoundTopic, categories: dict[str, Categories]) -> None:
        self.names = tuple(one.name for one in topic.features)
        """The names of the features, in the order of the values."""
        self.unnamed: dict[str, dict[str, None]] = {}
        """The first values that are none of the categories and so are missing, by feature."""
        plain: list[tuple[int, str]] = []
        self._others: list[tuple[int, Getter, _Encoder]] = []
        for place, feature in enumerate(topic.features):
            attribute = attribute_of(feature.path)
            if attribute and feature.kind is FeatureKind.NUMERIC:
                plain.append((place, attribute))
            else:
                encode = _encoder(feature, categories, self.unnamed)
                self._others.append((place, getter(feature.path), encode))
        self._places = [place for place, _ in plain]
        self._plain = attrgetter(*(attribute for _, attribute in plain)) if plain else None
        self._missing = [math.nan] * len(topic.features)

    def read(self, message: Any, stamp: int) -> Sequence[float]:
        """The values of the features, NaN where one is missing.

        Args:
            message: A message of the topic.
            stamp: When it is from, nanoseconds.
        """
        values = self._missing.copy()
        if self._plain is not None:
            found: Any = self._plain(message)
            if len(self._places) == 1:
                values[self._places[0]] = found
            else:
                for place, value in zip(self._places, found, strict=True):
                    values[place] = value
        for place, get, encode in self._others:
            value = get(message, stamp)
            if value is not None:
                values[place] = encode(value)
        # One sum tells of most messages that all is well.
        if not abs(sum(values)) < LARGEST_VALUE:
            values = [one if abs(one) <= LARGEST_VALUE else math.nan for one in values]
        return values


def state_topics_of(robot: RobotFile) -> tuple[StateTopic, ...]:
    """The topics of the state with the names of their features."""
    return tuple(
        StateTopic(
            topic,
            tuple(one.name for one in robot.state if one.path.topic == topic),
            may_miss=True,
        )
        for topic in robot.state_topics
    )


def _encoder(
    feature: BoundFeature,
    categories: dict[str, Categories],
    unnamed: dict[str, dict[str, None]],
) -> _Encoder:
    if feature.kind is FeatureKind.NUMERIC:
        return float
    if feature.kind is FeatureKind.BINARY:
        return lambda value: float(value) if value in (0.0, 1.0) else math.nan
    known = categories.setdefault(
        feature.name, Categories(tuple(dict.fromkeys(feature.categories.values())))
    )
    names = feature.categories
    as_text = _text_of(feature)
    if not names:
        return lambda value: known.code(as_text(value))

    def encoded(value: float | str) -> float:
        text = as_text(value)
        if text not in names and text:
            others = unnamed.setdefault(feature.name, {})
            if len(others) < _MOST_UNNAMED:
                others[text] = None
        return known.code(names.get(text, ""))

    return encoded


def _text_of(feature: BoundFeature) -> Callable[[float | str], str]:
    """How a value is written as a category."""
    if feature.path.kind is Primitive.TEXT:
        return str
    if feature.path.kind is Primitive.TRUTH:
        return lambda value: "true" if value else "false"
    return lambda value: str(int(value))


def described(
    features: Sequence[Feature],
    topics: Iterable[BoundTopic],
    categories: Mapping[str, Categories],
) -> tuple[Feature, ...]:
    """Features of rows with their kinds, and the categories that were seen.

    One that has no category yet is numeric.
    """
    kinds = {one.name: one.kind for topic in topics for one in topic.features}
    found = []
    for feature in features:
        kind = kinds.get(feature.name, FeatureKind.NUMERIC)
        names = tuple(categories[feature.name].names) if feature.name in categories else ()
        if kind is FeatureKind.CATEGORICAL and not names:
            kind = FeatureKind.NUMERIC
        found.append(replace(feature, kind=kind, categories=names))
    return tuple(found)
