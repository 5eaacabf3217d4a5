"""Looks at demonstrations before anything is learned from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.demonstration.alike import alike
from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.errors import OptionError
from rebt_ros.inspection import duplicates, outliers
from rebt_ros.inspection.contradictions import MOST_LISTED, Contradicting, contradicting
from rebt_ros.inspection.idle import IDLE_SECONDS, idle
from rebt_ros.inspection.inspection import (
    ActionCount,
    Contradiction,
    Contradictions,
    Inspected,
    Inspection,
    Outlier,
    Timing,
)
from rebt_ros.inspection.joined import Joined, constant, joined
from rebt_ros.inspection.timing import Clock, clock

#: The longest time for which nothing happens that can be asked for (seconds).
_LONGEST_IDLE: Final = 86_400.0


def inspect(
    demonstrations: Sequence[Demonstration],
    paths: Sequence[str] = (),
    *,
    idle_seconds: float = IDLE_SECONDS,
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> Inspection:
    """Looks at demonstrations.

    Args:
        demonstrations: With names that differ, and the same features in the same order.
        paths: Of their files; by default their names.
        idle_seconds: For how long nothing has to change in an idle stretch, above 0.
        progress: Told what is being done and which share of the work is behind.

    Returns:
        Deterministic, and in the order of the demonstrations.

    Raises:
        InputError: There are no rows, or features or kinds of rows differ.
        OptionError: `idle_seconds` makes no sense.
    """
    if not 0 < idle_seconds <= _LONGEST_IDLE:
        raise OptionError(
            f"the time of an idle stretch must be above 0 and at most {_LONGEST_IDLE:.0f} seconds, "
            f"not {idle_seconds:g}."
        )
    progress("joining", 0.0)
    rows = joined(demonstrations)
    clocks = [clock(one.stamps) for one in demonstrations]
    timings = [one.timing() for one in clocks]
    counts = _counts(rows)
    progress("looking for contradictions", 0.2)
    against = contradicting(rows)
    progress("looking for outliers", 0.4)
    far = outliers.outliers(rows, counts, timings)
    progress("looking for near-duplicates", 0.5)
    seconds = [None if one is None else one.seconds for one in timings]
    near = duplicates.near_duplicates(rows, seconds)
    names = tuple(one.name for one in demonstrations)
    found = _Found(rows, names, clocks, timings, counts, against, far, near)
    inspected = []
    for number, one in enumerate(demonstrations):
        progress("looking at each", 0.7 + 0.3 * number / len(demonstrations))
        path = paths[number] if paths else one.name
        inspected.append(found.of(number, one, path, idle_seconds))
    progress("done", 1.0)
    return Inspection(
        rows.table.row_kind.value,
        len(rows.table),
        tuple(feature.name for feature in rows.table.features),
        _named(rows, constant(rows.table.states)),
        _actions(rows, counts.sum(axis=0)),
        len(against.rows),
        tuple(inspected),
        (*_notes(rows), *alike(demonstrations)),
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Found:
    """What was found by looking at all demonstrations together; sequences have an item for each."""

    rows: Joined
    names: tuple[str, ...]
    clocks: Sequence[Clock]
    timings: Sequence[Timing | None]
    counts: IntArray
    against: Contradicting
    far: Sequence[tuple[Outlier, ...]]
    near: Mapping[int, tuple[int, float]]

    def of(self, number: int, one: Demonstration, path: str, idle_seconds: float) -> Inspected:
        """What there is to say of a demonstration."""
        part = self.rows.rows_of(number)
        states = self.rows.table.states[part]
        time = self.clocks[number]
        still = None
        if one.row_kind is RowKind.SAMPLE:
            chosen = self.rows.table.chosen[part]
            still = idle(self.rows.scaled(part), chosen, time, idle_seconds)
        return Inspected(
            name=one.name,
            path=path,
            rows=len(one),
            timing=self.timings[number],
            actions=_actions(self.rows, self.counts[number]),
            gaps=time.gaps(),
            idle=still,
            constant=_named(self.rows, constant(states)),
            missing=int(np.count_nonzero(np.isnan(states))),
            near_duplicate=duplicates.as_duplicate(self.near.get(number), self.names),
            contradicting=_contradictions(self.rows, number, self.against, self.clocks, self.names),
            outliers=self.far[number],
        )


def _counts(rows: Joined) -> IntArray:
    """Rows of each action, shape (demonstrations, actions)."""
    numbers, actions = len(rows.starts) - 1, len(rows.actions)
    both = rows.number * actions + rows.table.chosen
    return np.bincount(both, minlength=numbers * actions).reshape(numbers, actions)


def _actions(rows: Joined, counts: IntArray) -> tuple[ActionCount, ...]:
    return tuple(
        ActionCount(channel, label, count)
        for count, (channel, label) in sorted(
            zip(counts.tolist(), rows.actions, strict=True), key=lambda pair: (-pair[0], pair[1])
        )
        if count
    )


def _named(rows: Joined, which: BoolArray) -> tuple[str, ...]:
    return tuple(rows.table.features[place].name for place in np.flatnonzero(which).tolist())


def _contradictions(
    rows: Joined,
    number: int,
    against: Contradicting,
    clocks: Sequence[Clock],
    names: Sequence[str],
) -> Contradictions:
    """What of the contradicting rows is in a demonstration."""
    part = rows.rows_of(number)
    first, end = np.searchsorted(against.rows, (part.start, part.stop)).tolist()
    outvoted = against.outvoted[first:end]
    listed = first + np.argsort(~outvoted, kind="stable")[:MOST_LISTED]
    examples = []
    for place in listed.tolist():
        row, other = int(against.rows[place]), int(against.other_row[place])
        where = int(np.searchsorted(rows.starts, other, side="right")) - 1
        channel, action = rows.actions[rows.table.chosen[row]]
        examples.append(
            Contradiction(
                row - part.start,
                clocks[number].at(row - part.start),
                channel,
                action,
                rows.actions[rows.table.chosen[other]][1],
                names[where],
                other - int(rows.starts[where]),
            )
        )
    return Contradictions(
        end - first,
        int(np.count_nonzero(against.with_others[first:end])),
        int(np.count_nonzero(outvoted)),
        tuple(examples),
    )


def _notes(rows: Joined) -> Iterator[str]:
    """What was not looked for."""
    count = len(rows.starts) - 1
    if count < outliers.FEWEST:
        yield f"outliers are told among {outliers.FEWEST} or more demonstrations only"
    if count > duplicates.MOST_DEMONSTRATIONS:
        yield (
            f"near-duplicates are not looked for among more than {duplicates.MOST_DEMONSTRATIONS} "
            "demonstrations"
        )
