"""Tells whether a state lies outside what was demonstrated, and by how much."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.shown import ShownChannel, Span
from rebt_ros.demonstration.schema import Feature, Source, codes_of, sources

#: Rounding of single precision, in which sensors often measure, is no departure.
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Departure:
    """How a state differs from the nearest leaf that was shown."""

    feature: str
    """The feature that differs most, in shares of all that was shown of it."""
    value: float
    """What it is."""
    shown: Span | None
    """What it was in the rows of that leaf; None of a category that they do not have."""

    @property
    def beyond(self) -> float:
        """How far the value is from what was shown, in the feature's unit; inf of categories."""
        if self.shown is None:
            return math.inf
        return max(self.shown.low - self.value, self.value - self.shown.high)

    def __str__(self) -> str:
        if self.shown is None:
            return f"{self.feature} is {self.value:g}, which was not shown in such a state"
        side = "below" if self.value < self.shown.low else "above"
        return (
            f"{self.feature} is {self.value:.4g}, {self.beyond:.4g} {side} the "
            f"{self.shown.low:.4g} to {self.shown.high:.4g} that was shown in such a state"
        )


class NoveltyDetector:
    """Compares states with what was shown to a learned tree.

    A state was shown where, on every channel, it lies in the ranges of one leaf, widened at both
    ends by a margin.  As the leaves share out all states, that is the leaf that decides there; LAT
    is not asked.  Features that the tree does not test are compared as well, because one that
    never changed while it was demonstrated is tested by no tree.

    Args:
        learned: The tree; one without ranges, as of an older document, makes nothing novel.
        topics: The topics that are read; features of other ones are not compared.
        default_topic: Topic of features that came from a table, in their order there.
        margin: Widens each range, in shares of all that was shown of the feature.
    """

    def __init__(
        self,
        learned: LearnedTree,
        topics: Collection[str],
        default_topic: str,
        margin: float,
    ) -> None:
        self._columns = tuple(
            _Column(place, feature, source, coded=learned.robot is not None)
            for place, (feature, source) in enumerate(
                zip(learned.features, sources(learned.features, default_topic), strict=True)
            )
            if not feature.lag and source.topic in topics
        )
        # A tree that reads nothing has nothing to compare.
        shown = learned.shown if self._columns else ()
        self._channels = tuple(_Ranges(one, self._columns, margin) for one in shown if one.leaves)

    def departure(self, latest: Mapping[str, Sequence[float]]) -> Departure | None:
        """How the state differs from what was shown; None where it does not.

        Args:
            latest: The newest message of every topic.  What it does not hold, or holds as NaN, is
                not compared.
        """
        if not self._channels:
            return None
        values = np.array([column.value(latest) for column in self._columns])
        for ranges in self._channels:
            differing = ranges.nearest(values)
            if differing is not None:
                place, span = differing
                return Departure(self._columns[place].name, float(values[place]), span)
        return None


class _Column:
    """A feature that is compared.

    Args:
        place: Its place among the features of the tree.
        feature: The feature.
        source: Where messages carry it.
        coded: Whether messages hold positions of categories, not their numbers.
    """

    def __init__(self, place: int, feature: Feature, source: Source, *, coded: bool) -> None:
        self.place = place
        self.name = feature.name
        self.categories = feature.categories
        self._source = source
        self._codes = codes_of(feature, coded=coded)

    def value(self, latest: Mapping[str, Sequence[float]]) -> float:
        """NaN where it is not known."""
        values, index = latest.get(self._source.topic, ()), self._source.index
        return float(values[index]) if index < len(values) else math.nan

    def code(self, value: float) -> int:
        """Of a category: its place, or the number of all of them where it is none of them."""
        return self._codes.get(value, len(self.categories))


class _Ranges:
    """The ranges of one channel: a row for each leaf, a column for each feature."""

    def __init__(self, shown: ShownChannel, columns: Sequence[_Column], margin: float) -> None:
        values = [[leaf.values[column.place] for column in columns] for leaf in shown.leaves]
        bounds = np.array(
            [
                [(one.low, one.high) if isinstance(one, Span) else (-np.inf, np.inf) for one in row]
                for row in values
            ]
        )
        self._low, self._high = bounds[..., 0], bounds[..., 1]
        self._columns = columns
        self._allowed = {
            place: np.array([_allowed(row[place], column.categories) for row in values])
            for place, column in enumerate(columns)
            if column.categories
        }
        """By the place of a categorical column: which codes each leaf has."""
        spread = _spread(self._low, self._high)
        size = np.fmax(_magnitude(self._low), _magnitude(self._high))
        # Of what never changed, its size says what a small difference is.
        scale = np.where(spread > 0, spread, np.max(size, axis=0))
        slack = margin * scale + _ROUNDING * size
        self._least, self._most = self._low - slack, self._high + slack
        self._scale = np.where(scale > 0, scale, 1.0)

    def nearest(self, values: FloatArray) -> tuple[int, Span | None] | None:
        """Of the nearest leaf, the place that differs most, and its range; None within a leaf."""
        inside = self._inside(values)
        if np.any(np.all(inside, axis=1)):
            return None
        beyond = np.fmax(self._low - values, values - self._high) / self._scale
        # A category that was not shown differs as much as the largest number from the smallest.
        beyond[:, list(self._allowed)] = 1.0
        beyond[inside] = 0.0
        leaf = int(np.argmin(np.max(beyond, axis=1)))
        place = int(np.argmax(beyond[leaf]))
        if place in self._allowed:
            return place, None
        return place, Span(float(self._low[leaf, place]), float(self._high[leaf, place]))

    def _inside(self, values: FloatArray) -> BoolArray:
        # Neither holds of NaN, which is not compared.
        inside = ~((values < self._least) | (values > self._most))
        for place, allowed in self._allowed.items():
            if not math.isnan(values[place]):
                inside[:, place] = allowed[:, self._columns[place].code(float(values[place]))]
        return np.asarray(inside)


def _allowed(values: object, categories: Sequence[str]) -> list[bool]:
    """Which codes a leaf has; the last one stands for all categories that are unknown."""
    if not isinstance(values, tuple):
        return [True] * (len(categories) + 1)
    return [*(category in values for category in categories), False]


def _spread(low: FloatArray, high: FloatArray) -> FloatArray:
    """How far the values of each column lie apart; 0 where nothing is known of it."""
    known = np.isfinite(low)
    smallest = np.min(np.where(known, low, np.inf), axis=0)
    largest = np.max(np.where(known, high, -np.inf), axis=0)
    return np.where(known.any(axis=0), largest - smallest, 0.0)


def _magnitude(bound: FloatArray) -> FloatArray:
    return np.where(np.isfinite(bound), np.abs(bound), 0.0)
