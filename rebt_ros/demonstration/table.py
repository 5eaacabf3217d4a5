"""The table to learn from: all rows of one channel, with what was done before each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.demonstration.large_arrays import roomy, rows_of
from rebt_ros.demonstration.last_action import (
    NO_ACTION,
    ActionHistory,
    last_actions,
    previous_actions,
)
from rebt_ros.demonstration.schema import TRUTH, Feature, FeatureKind
from rebt_ros.demonstration.weights import whole_weights
from rebt_ros.errors import InputError, OptionError, listing

#: How many rows are checked before all of them are.
_FIRST_ROWS = 1000
#: Number of features that a sentence names.
_LISTED = 5


@dataclass(frozen=True, eq=False, slots=True)
class DemonstrationTable:
    """Rows in the order in which they were shown, one demonstration after another."""

    channel: str
    features: tuple[Feature, ...]
    states: FloatArray
    """Shape (rows, features): numbers, 0 or 1, positions in a feature's categories, or NaN."""
    actions: tuple[str, ...]
    """Labels that occur, sorted."""
    chosen: IntArray
    """Position in `actions` of each row's action, shape (rows,)."""
    demonstrations: tuple[str, ...]
    """Names of the demonstrations."""
    demonstration: IntArray
    """Position in `demonstrations` of each row's demonstration, ascending, shape (rows,)."""
    stamps: IntArray
    """Nanoseconds, shape (rows,)."""
    last: IntArray = field(init=False)
    """Position in `actions` of each row's LAT, `NO_ACTION` for none, shape (rows,)."""
    before: IntArray | None = None
    """LAT of each demonstration's first row, as in `last`, shape (demonstrations,), or None."""
    previous: IntArray = None  # type: ignore[assignment]
    """Position in `actions` of the previous row's action, `NO_ACTION` in the first row of a
    demonstration, shape (rows,); None to derive it from `chosen`."""
    row_kind: RowKind = RowKind.EVENT
    weights: IntArray | None = None
    """How often the rows of each demonstration count, shape (demonstrations,); None for once."""
    robot: object = None
    """The `RobotFile` that its rows were read with, for trees to carry; None without one."""

    def __post_init__(self) -> None:
        if self.previous is None:
            previous = previous_actions(self.chosen, self.demonstration)
            object.__setattr__(self, "previous", previous)
        last = last_actions(self.chosen, self.demonstration, self.before)
        object.__setattr__(self, "last", last)

    @property
    def begins(self) -> IntArray:
        """The first row of each demonstration that has rows, shape (shown,)."""
        numbers = self.demonstration
        after = np.flatnonzero(numbers[1:] != numbers[:-1]) + 1
        return np.concatenate([np.zeros(min(len(self), 1), dtype=np.int64), after])

    def __len__(self) -> int:
        return len(self.chosen)

    @property
    def row_weights(self) -> IntArray | None:
        """How often each row counts, shape (rows,); None for once."""
        return None if self.weights is None else self.weights[self.demonstration]

    def counts(
        self, codes: IntArray, least: int, rows: BoolArray | slice = slice(None)
    ) -> IntArray:
        """The weighted number of rows with each code, shape (codes,).

        Args:
            codes: Codes of some rows, shape (some,).
            least: Minimum number of codes.
            rows: Which rows these are.
        """
        weights = self.row_weights
        if weights is None:
            return np.bincount(codes, minlength=least)
        return np.bincount(codes, weights[rows], least).astype(np.int64)

    def where(self, rows: BoolArray) -> DemonstrationTable:
        """The table of some of the rows.

        Previous actions are those of the whole table.  LAT is derived again: a part that begins in
        the middle of a demonstration begins without one.
        """
        # Contiguous rows are not copied, since tables can be large.
        part = _stretch(rows)
        return replace(
            self,
            states=self.states[part] if isinstance(part, slice) else rows_of(self.states, part),
            chosen=self.chosen[part],
            demonstration=self.demonstration[part],
            stamps=self.stamps[part],
            before=self._before_parts(rows),
            previous=self.previous[part],
        )

    def last_where(self, rows: BoolArray) -> IntArray:
        """LAT in the table of some rows (see `where`), without making that table."""
        return last_actions(self.chosen[rows], self.demonstration[rows], self._before_parts(rows))

    def _before_parts(self, rows: BoolArray) -> IntArray | None:
        if self.before is None:
            return None
        first = self.begins
        before = self.before.copy()
        before[self.demonstration[first[~rows[first]]]] = NO_ACTION
        return before

    def held_out(self, fraction: float) -> BoolArray:
        """Which rows to test on instead of learning from them, shape (rows,).

        These are the last rows of a single demonstration, or the last ones of several
        demonstrations as a whole: no row is tested whose neighbors were learned from.

        Args:
            fraction: Share of the rows to hold out, in [0, 1), as nearly as whole demonstrations
                allow; at least one row, or demonstration, if above 0.
        """
        if fraction == 0 or len(self) < 2:
            return np.zeros(len(self), dtype=bool)
        # Where each demonstration but the first begins, the last one first.
        begins = self.begins[:0:-1]
        if not len(begins):
            return np.arange(len(self)) >= _share_kept(len(self), fraction)
        nearest = np.argmin(np.abs(len(self) - begins - fraction * len(self)))
        return np.arange(len(self)) >= int(begins[nearest])


def _stretch(rows: BoolArray) -> BoolArray | slice:
    """The rows as a slice, if they are contiguous."""
    chosen = int(np.count_nonzero(rows))
    first = int(np.argmax(rows)) if chosen else 0
    return slice(first, first + chosen) if rows[first : first + chosen].all() else rows


def _share_kept(count: int, fraction: float) -> int:
    # The tolerance keeps the rounding of, say, 100 * 0.07 from adding a row.
    return min(max(count - math.ceil(count * fraction - 1e-9), 1), count - 1)


def history_at(table: DemonstrationTable, row: int) -> ActionHistory:
    """What was done before a row in its demonstration."""

    def label(code: int) -> str | None:
        return None if code == NO_ACTION else table.actions[code]

    number = int(table.demonstration[row])
    start = int(np.searchsorted(table.demonstration, number))
    history = ActionHistory()
    before = None if table.before is None else label(int(table.before[number]))
    if before is not None:
        history.begin(before)
    for code in table.chosen[start:row].tolist():
        history.begin(table.actions[code])
    history.previous = label(int(table.previous[row]))
    return history


def part_of(table: DemonstrationTable, rows: int) -> DemonstrationTable:
    """About this many rows: whole demonstrations, evenly spread, or the first rows of the only one.

    All rows if there are no more.
    """
    if len(table) <= rows:
        return table
    begins = table.begins
    shown = len(begins)
    if shown == 1:
        return table.where(np.arange(len(table)) < rows)
    kept = max(2, shown * rows // len(table))
    inside = np.zeros(shown, dtype=bool)
    inside[np.arange(kept) * shown // kept] = True
    return table.where(np.repeat(inside, np.diff(begins, append=len(table))))


def tabulate(
    demonstrations: Sequence[Demonstration],
    declared: Mapping[str, FeatureKind] | None = None,
    weights: Sequence[Fraction] = (),
) -> tuple[DemonstrationTable, ...]:
    """Joins demonstrations into one table per channel.

    Args:
        demonstrations: At least one; all with the same features in the same order.
        declared: Kinds of features by name.  A feature that is not declared is binary if its values
            are 0 and 1, and both occur; otherwise it keeps its kind.
        weights: How much each demonstration counts, above 0; empty if all count the same.

    Raises:
        InputError: There are no rows, or features or kinds of rows differ among demonstrations.
        OptionError: A declared feature does not exist or holds other values, or weights are too
            large (see `whole_weights`).
    """
    whole = whole_weights(
        [weight for weight, one in zip(weights, demonstrations, strict=True) if len(one)]
        if weights
        else []
    )
    demonstrations = [demonstration for demonstration in demonstrations if len(demonstration)]
    if not demonstrations:
        raise InputError(
            "there are no demonstration rows: record actions together with states first."
        )
    features, states = _joined_states(demonstrations)
    features, states = _with_kinds(features, states, declared or {})
    channels = sorted(
        {channel for demonstration in demonstrations for channel in demonstration.channels}
    )
    row_kind = _common_row_kind(demonstrations)
    return tuple(
        replace(
            _channel_table(channel, demonstrations, features, states),
            row_kind=row_kind,
            weights=whole,
        )
        for channel in channels
    )


def _common_row_kind(demonstrations: Sequence[Demonstration]) -> RowKind:
    first = demonstrations[0]
    for other in demonstrations[1:]:
        if other.row_kind is not first.row_kind:
            raise InputError(
                f"the rows of {first.name} are {first.row_kind.value}s and those of {other.name} "
                f"are {other.row_kind.value}s, so that what was done before a row means different "
                "things: record all with the same sample_rate, or none."
            )
    return first.row_kind


def _channel_table(
    channel: str,
    demonstrations: Sequence[Demonstration],
    features: tuple[Feature, ...],
    states: FloatArray,
) -> DemonstrationTable:
    rows = [_rows_of(channel, demonstration) for demonstration in demonstrations]
    codes = [
        demonstration.chosen[its] for demonstration, its in zip(demonstrations, rows, strict=True)
    ]
    actions, chosen = _joined_labels(
        [demonstration.actions for demonstration in demonstrations], codes
    )
    everywhere = np.concatenate(rows)
    return DemonstrationTable(
        channel,
        features,
        # The only copy is the one made when states were joined.
        states if everywhere.all() else rows_of(states, everywhere),
        actions,
        chosen,
        tuple(demonstration.name for demonstration in demonstrations),
        np.repeat(np.arange(len(demonstrations)), [len(code) for code in codes]),
        np.concatenate([demonstration.stamps for demonstration in demonstrations])[everywhere],
        _before(channel, demonstrations, actions),
    )


def _rows_of(channel: str, demonstration: Demonstration) -> BoolArray:
    if channel not in demonstration.channels:
        return np.zeros(len(demonstration), dtype=bool)
    return np.equal(demonstration.channel, demonstration.channels.index(channel))


def _joined_labels(
    labels: Sequence[tuple[str, ...]], codes: Sequence[IntArray]
) -> tuple[tuple[str, ...], IntArray]:
    """Joined columns of strings, with only the labels that occur, sorted.

    >>> _joined_labels([("b", "c"), ("a", "b")], [np.array([0, 0]), np.array([1, 0])])
    (('a', 'b'), array([1, 1, 1, 0]))
    """
    counts = [
        np.bincount(its, minlength=len(known)) for known, its in zip(labels, codes, strict=True)
    ]
    occurring = {
        label
        for known, its in zip(labels, counts, strict=True)
        for label, count in zip(known, its.tolist(), strict=True)
        if count
    }
    place = {label: position for position, label in enumerate(sorted(occurring))}
    joined = [
        np.array([place.get(label, NO_ACTION) for label in known], dtype=np.int64)[its]
        for known, its in zip(labels, codes, strict=True)
    ]
    return tuple(place), np.concatenate(joined)


def _before(
    channel: str, demonstrations: Sequence[Demonstration], actions: Sequence[str]
) -> IntArray | None:
    """LAT of each demonstration's first row; none if it is an action that nobody showed."""
    known = {action: code for code, action in enumerate(actions)}
    codes = [
        known.get(demonstration.before.get(channel, ""), NO_ACTION)
        for demonstration in demonstrations
    ]
    return (
        np.array(codes, dtype=np.int64)
        if any(demonstration.before for demonstration in demonstrations)
        else None
    )


def _joined_states(
    demonstrations: Sequence[Demonstration],
) -> tuple[tuple[Feature, ...], FloatArray]:
    first = demonstrations[0]
    for other in demonstrations[1:]:
        mine, its = [one.name for one in first.features], [one.name for one in other.features]
        if mine != its:
            differing = sorted(set(mine) ^ set(its))
            if not differing:
                raise InputError(
                    f"{first.name} and {other.name} have the same features in different orders "
                    f"({listing(mine, _LISTED)}; {listing(its, _LISTED)}): record them in one "
                    "order, or learn from those of one order."
                )
            raise InputError(
                f"{first.name} and {other.name} have different features "
                f"({', '.join(differing[:3])}): learn from demonstrations of one robot and set-up."
            )
    features = tuple(
        _unified(*_telling(place, demonstrations)) for place in range(len(first.features))
    )
    rows = sum(map(len, demonstrations))
    states = np.concatenate(
        [demonstration.states for demonstration in demonstrations],
        out=roomy((rows, len(features))),
    )
    end = 0
    for demonstration in demonstrations:
        start, end = end, end + len(demonstration)
        for index, (feature, unified) in enumerate(
            zip(demonstration.features, features, strict=True)
        ):
            if feature.categories != unified.categories:
                states[start:end, index] = _recoded(
                    demonstration.states[:, index], feature, unified
                )
    return features, states


def _telling(place: int, demonstrations: Sequence[Demonstration]) -> tuple[Feature, ...]:
    """The feature as in the demonstrations in which it has values; at least one."""
    found = [
        demonstration.features[place]
        for demonstration in demonstrations
        if not demonstration.lacks(place)
    ]
    return tuple(found or (demonstrations[0].features[place],))


def _unified(first: Feature, *others: Feature) -> Feature:
    """A feature that holds the values of the same feature in several demonstrations."""
    kinds = {one.kind for one in (first, *others)}
    if FeatureKind.CATEGORICAL not in kinds:
        return first if kinds == {first.kind} else replace(first, kind=FeatureKind.NUMERIC)
    categories = {name for one in (first, *others) for name in one.categories}
    if kinds == {FeatureKind.BINARY, FeatureKind.CATEGORICAL} and categories <= TRUTH.keys():
        # Both are truth values, with gaps in one of the demonstrations.
        return replace(first, kind=FeatureKind.CATEGORICAL, categories=tuple(TRUTH))
    if kinds != {FeatureKind.CATEGORICAL}:
        raise InputError(
            f"feature {first.name!r} holds text in one demonstration and numbers in another: "
            "give it one kind of values."
        )
    return replace(first, categories=tuple(sorted(categories)))


def _recoded(column: FloatArray, mine: Feature, unified: Feature) -> FloatArray:
    if mine.categories == unified.categories or mine.kind is FeatureKind.BINARY:
        # 0 and 1 are also the positions of false and true.
        return column
    position = np.array([unified.categories.index(name) for name in mine.categories], dtype=float)
    known = ~np.isnan(column)
    recoded = np.full_like(column, np.nan)
    recoded[known] = position[column[known].astype(np.int64)]
    return recoded


def _with_kinds(
    features: tuple[Feature, ...], states: FloatArray, declared: Mapping[str, FeatureKind]
) -> tuple[tuple[Feature, ...], FloatArray]:
    """The features with their kinds, and the states with categories as positions."""
    unknown = sorted(set(declared) - {feature.name for feature in features})
    if unknown:
        raise OptionError(
            f"there is no feature {unknown[0]!r}: "
            f"the features are {', '.join(feature.name for feature in features)}."
        )
    typed: list[Feature] = []
    for index, feature in enumerate(features):
        column = states[:, index]
        if feature.kind is FeatureKind.NUMERIC and feature.name not in declared:
            binary = _is_binary(column)
            typed.append(replace(feature, kind=FeatureKind.BINARY) if binary else feature)
            continue
        values = np.unique(column)
        values = values[~np.isnan(values)]
        kind = declared.get(feature.name, feature.kind)
        _check_kind(feature, kind, values)
        if kind is feature.kind:
            typed.append(feature)
        elif kind is FeatureKind.CATEGORICAL:
            typed.append(
                replace(feature, kind=kind, categories=tuple(category(value) for value in values))
            )
            known = ~np.isnan(column)
            column[known] = np.searchsorted(values, column[known])
        else:
            typed.append(replace(feature, kind=kind))
    return tuple(typed), states


def _is_binary(column: FloatArray) -> bool:
    """Whether all known values are 0 or 1, and both occur."""
    # The first rows almost always tell.
    for rows in (column[:_FIRST_ROWS], column):
        truth = (rows == 0) | (rows == 1)
        if not (truth | np.isnan(rows)).all():
            return False
    return bool((column == 0).any() and (column == 1).any())


def _check_kind(feature: Feature, kind: FeatureKind, values: FloatArray) -> None:
    text_as_numbers = feature.kind is FeatureKind.CATEGORICAL and kind is not feature.kind
    not_binary = kind is FeatureKind.BINARY and not np.isin(values, (0.0, 1.0)).all()
    uncounted = kind is FeatureKind.CATEGORICAL and kind is not feature.kind and not len(values)
    if text_as_numbers or not_binary or uncounted:
        numbers = [category(value) for value in values[:3]] + ["…"] * (len(values) > 3)
        held = "text" if text_as_numbers else ", ".join(numbers) or "nothing"
        raise OptionError(f"feature {feature.name!r} cannot be {kind.value}: it holds {held}.")


def category(value: float) -> str:
    """The name of a category that is a number.

    >>> category(3.0), category(0.5)
    ('3', '0.5')
    """
    return str(int(value)) if math.isfinite(value) and value == int(value) else repr(float(value))
