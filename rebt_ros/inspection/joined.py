"""All demonstrations as one table, whatever their channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL, Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate

#: Rows that tell the usual range of a feature, evenly spaced.
_ROWS_THAT_TELL = 100_000
#: The usual range of a feature and its middle, in per cent of its values.
_USUAL = (5.0, 50.0, 95.0)
#: Further away, values do not differ (usual ranges).
_FAR = 1e6


@dataclass(frozen=True, eq=False, slots=True)
class Usual:
    """How features usually vary, by 100,000 evenly spaced rows at most."""

    middle: FloatArray
    """The median, shape (features,)."""
    width: FloatArray
    """From the 5 % to the 95 % quantile, shape (features,).  Where that is nothing, from the least
    to the largest value; 1 where there is one value only, and of what is no number, where every
    difference counts."""


@dataclass(frozen=True, eq=False, slots=True)
class Joined:
    """The rows of all demonstrations, demonstration after demonstration."""

    table: DemonstrationTable
    """Its actions are pairs of a channel and an action, by their positions in `actions`."""
    actions: tuple[tuple[str, str], ...]
    """Channels and labels, sorted."""
    starts: IntArray
    """Where the rows of each demonstration begin, and the number of all rows at the end."""
    usual: Usual
    """How features usually vary."""

    @property
    def number(self) -> IntArray:
        """The demonstration of each row, shape (rows,); those without rows are counted."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))

    def scaled(self, rows: IntArray | slice) -> FloatArray:
        """How far states are from the middle, in usual ranges; what is missing is far from all.

        Args:
            rows: Some rows, shape (some,).

        Returns:
            Shape (some, features).
        """
        with np.errstate(over="ignore"):
            away = (self.table.states[rows] - self.usual.middle) / self.usual.width
        scaled = np.clip(away, -_FAR, _FAR)
        return np.where(np.isnan(scaled), 2 * _FAR, scaled)

    @property
    def channel(self) -> IntArray:
        """The channel of each of `actions`, as a number."""
        channels = sorted({channel for channel, _ in self.actions})
        return np.array([channels.index(channel) for channel, _ in self.actions], dtype=np.int64)

    def rows_of(self, number: int) -> slice:
        """The rows of a demonstration."""
        return slice(int(self.starts[number]), int(self.starts[number + 1]))


def joined(demonstrations: Sequence[Demonstration]) -> Joined:
    """The rows of all demonstrations.

    Args:
        demonstrations: At least one with a row, with the same features in the same order.

    Raises:
        InputError: There are no rows, or features or kinds of rows differ.
    """
    pairs = sorted(
        {
            (one.channels[channel], one.actions[action])
            for one in demonstrations
            for channel, action in _pairs(one)
        }
    )
    place = {pair: f"{code:09d}" for code, pair in enumerate(pairs)}
    (table,) = tabulate([_on_one_channel(one, place) for one in demonstrations])
    counts = [len(one) for one in demonstrations]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return Joined(table, tuple(pairs), starts, usual(table))


def _pairs(demonstration: Demonstration) -> list[list[int]]:
    """Which actions occur on which channels, as positions."""
    several = len(demonstration.actions)
    codes = np.unique(demonstration.channel * max(several, 1) + demonstration.chosen)
    return [list(divmod(code, several)) for code in codes.tolist()]


def _on_one_channel(
    demonstration: Demonstration, place: dict[tuple[str, str], str]
) -> Demonstration:
    """The demonstration with one channel, whose actions sort as pairs of channels and actions."""
    pairs = _pairs(demonstration)
    names = [
        place[demonstration.channels[channel], demonstration.actions[action]]
        for channel, action in pairs
    ]
    # Positions of pairs ascend as the pairs of sorted names do.
    codes = np.zeros((max(len(demonstration.channels), 1), max(len(demonstration.actions), 1)), int)
    for code, (channel, action) in enumerate(pairs):
        codes[channel, action] = code
    return replace(
        demonstration,
        actions=tuple(names),
        chosen=codes[demonstration.channel, demonstration.chosen],
        channels=(DEFAULT_CHANNEL,),
        channel=np.zeros(len(demonstration), dtype=np.int64),
        before={},
    )


def usual(table: DemonstrationTable) -> Usual:
    """How the features of a table usually vary."""
    step = -(-len(table) // _ROWS_THAT_TELL)
    found = np.array(
        [
            _usual(table.states[:, place], step) if feature.kind is FeatureKind.NUMERIC else (0, 1)
            for place, feature in enumerate(table.features)
        ]
    )
    return Usual(*found.T)


def _usual(column: FloatArray, step: int) -> tuple[float, float]:
    """The middle and the width of a feature of numbers."""
    some = column[::step]
    some = some[~np.isnan(some)]
    known = column[~np.isnan(column)]
    if not len(known):
        return 0.0, 1.0
    low, middle, high = np.percentile(some if len(some) else known, _USUAL).tolist()
    return middle, (high - low) or float(np.ptp(known)) or 1.0


def constant(states: FloatArray) -> BoolArray:
    """Which features have one known value at most, shape (features,).

    Args:
        states: Shape (rows, features).
    """
    if not len(states):
        return np.ones(states.shape[1], dtype=bool)
    # These leave out what is missing, unless all is.
    low, high = np.fmin.reduce(states, axis=0), np.fmax.reduce(states, axis=0)
    return np.asarray((low == high) | np.isnan(low))
