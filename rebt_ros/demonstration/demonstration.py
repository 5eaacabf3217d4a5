"""A demonstration: one uninterrupted recording of states and the actions taken in them."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.schema import Feature

#: Channel of actions without a topic, as in a CSV table.
DEFAULT_CHANNEL = "action"

#: Stamps closer to each other than this are row numbers (nanoseconds).
NO_TIME = 1_000


class RowKind(Enum):
    """What a row stands for, which decides what was done "before" it."""

    EVENT = "event"
    """A whole action, from beginning to end; before it is the action that ended last."""
    SAMPLE = "sample"
    """An instant of a held action; before it is what was done an instant earlier."""


class Row(NamedTuple):
    """An action with the state that held at that moment."""

    stamp: int
    """Nanoseconds."""
    channel: str
    """Its action topic."""
    action: str
    last_action: str | None
    """LAT of its channel; None until a second action was taken."""
    state: tuple[float, ...]
    """In the order of the demonstration's features; NaN where missing."""


@dataclass(frozen=True, eq=False, slots=True)
class Demonstration:
    """The rows of one demonstration, by column.

    LAT is not among them: it follows from the actions (see `last_action`) and from `before`.
    """

    name: str
    """Its source, for messages."""
    features: tuple[Feature, ...]
    states: FloatArray
    """Shape (rows, features)."""
    stamps: IntArray
    """Nanoseconds, shape (rows,)."""
    actions: tuple[str, ...]
    """Labels that occur, sorted."""
    chosen: IntArray
    """Position in `actions` of each row's action, shape (rows,)."""
    channels: tuple[str, ...]
    """Channels that occur, sorted."""
    channel: IntArray
    """Position in `channels` of each row's channel, shape (rows,)."""
    before: Mapping[str, str] = field(default_factory=dict)
    """LAT of the first row of a channel, if something was done before that was not recorded: a
    correction begins in the middle of what the robot did by itself.  It is not the previous action,
    which a first row does not have."""
    row_kind: RowKind = RowKind.EVENT

    def __post_init__(self) -> None:
        rows = len(self.chosen)
        if self.states.shape != (rows, len(self.features)):
            raise ValueError(
                f"{rows} actions and {len(self.features)} features need states of shape "
                f"({rows}, {len(self.features)}), not {self.states.shape}"
            )
        if len(self.stamps) != rows or len(self.channel) != rows:
            raise ValueError(
                f"{rows} actions, {len(self.stamps)} stamps and {len(self.channel)} channels"
            )

    def __len__(self) -> int:
        return len(self.chosen)

    def lacks(self, feature: int) -> bool:
        """Whether a feature has no value in any row, by its position."""
        values = self.states[:, feature]
        # The first row almost always tells, many times as fast.
        return not len(values) or (math.isnan(values[0]) and bool(np.isnan(values).all()))

    def part(self, name: str, rows: slice) -> Demonstration:
        """Some of its rows that follow each other, as a demonstration of their own."""
        actions, chosen = _occurring(self.actions, self.chosen[rows])
        channels, channel = _occurring(self.channels, self.channel[rows])
        return replace(
            self,
            name=name,
            states=self.states[rows],
            stamps=self.stamps[rows],
            actions=actions,
            chosen=chosen,
            channels=channels,
            channel=channel,
        )

    @classmethod
    def from_rows(
        cls,
        name: str,
        features: tuple[Feature, ...],
        rows: Iterable[Row],
        row_kind: RowKind = RowKind.EVENT,
        values: Numbers | None = None,
    ) -> Demonstration:
        """Gathers rows into columns, without keeping the rows.

        Args:
            name: Name of the demonstration.
            features: Features of its states.
            rows: Its rows.
            row_kind: What they stand for.
            values: An empty array for the states; None for one in memory.

        Raises:
            InputError: There is no room for them.
        """
        stamps = array("q")
        if values is None:
            values = _InMemory()
        actions = _Codes()
        channels = _Codes()
        for row in rows:
            stamps.append(row.stamp)
            values.extend(row.state)
            actions.append(row.action)
            channels.append(row.channel)
        return cls(
            name,
            features,
            values.values().reshape(len(stamps), len(features)),
            np.frombuffer(stamps, dtype=np.int64),
            *actions.sorted(),
            *channels.sorted(),
            row_kind=row_kind,
        )


class Numbers(Protocol):
    """Collects numbers that arrive one after another."""

    def extend(self, values: Iterable[float], /) -> None:
        """Adds numbers."""

    def values(self) -> FloatArray:
        """All numbers, shape (numbers,); nothing can be added after that."""


class _InMemory:
    """Collects numbers in memory."""

    def __init__(self) -> None:
        self._values = array("d")
        self.extend = self._values.extend

    def values(self) -> FloatArray:
        return np.frombuffer(self._values)


class _Codes:
    """A column of strings as integers, growing row by row."""

    def __init__(self) -> None:
        self._code: dict[str, int] = {}
        self._column = array("q")

    def append(self, label: str) -> None:
        self._column.append(self._code.setdefault(label, len(self._code)))

    def sorted(self) -> tuple[tuple[str, ...], IntArray]:
        return in_sorted_order(tuple(self._code), np.frombuffer(self._column, dtype=np.int64))


def _occurring(labels: tuple[str, ...], codes: IntArray) -> tuple[tuple[str, ...], IntArray]:
    """The same column of strings with only the labels that occur."""
    occurring, positions = np.unique(codes, return_inverse=True)
    return tuple(labels[code] for code in occurring.tolist()), positions.astype(np.int64)


def in_sorted_order(labels: tuple[str, ...], codes: IntArray) -> tuple[tuple[str, ...], IntArray]:
    """The same column of strings with its labels sorted.

    >>> in_sorted_order(("turn", "go"), np.array([0, 1, 1]))
    (('go', 'turn'), array([1, 0, 0]))
    """
    order = sorted(range(len(labels)), key=labels.__getitem__)
    position = np.empty(len(labels), dtype=np.int64)
    position[order] = np.arange(len(labels))
    return tuple(labels[one] for one in order), position[codes]
