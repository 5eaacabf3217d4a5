"""States that lie in a box, the nearest to what was shown."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, WordArray
from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import Combination, Quantity, WeightedSum, features_in
from rebt_ros.verification.grid import (
    ANOTHER_ACTION,
    BITS,
    LARGEST,
    Boxes,
    Field,
    Grid,
    HistoryCell,
)
from rebt_ros.verification.linear_bounds import Bound, numbers_within
from rebt_ros.verification.reference import Reference

#: Most choices of ranges of features and combinations that are tried in a box.
_MOST_COMBINATIONS: Final = 2_000
#: ... where some are weighted sums, which take a linear program for each choice.
_MOST_WEIGHED: Final = 20
#: Most boxes of which it is tried to find a state.
_MOST_TRIED: Final = 2_000
#: How far inside of a range a value is chosen, as a share of all that was shown.
_INSIDE: Final = 0.01
#: Boxes times rows that are compared at a time.
_COMPARED_AT_A_TIME: Final = 2_000_000


@dataclass(frozen=True, slots=True)
class Point:
    """A state, and what was done before."""

    values: tuple[float, ...]
    """In the order of the features of the tree."""
    before: HistoryCell | None
    """None where that does not matter."""


@dataclass(frozen=True, slots=True)
class Near:
    """A point, and the row that is nearest to it."""

    point: Point
    row: int | None
    """Its place in the reference; None where there is none."""
    distance: float
    """From there: the sum over the features, each in shares of all that was shown of it."""


@dataclass(frozen=True, slots=True)
class _Range:
    """Values ``above < x <= at_most`` of neighboring cells; of missing ones, both are NaN."""

    above: float
    at_most: float

    @property
    def missing(self) -> bool:
        return math.isnan(self.at_most)

    @property
    def least(self) -> float:
        """The least number in it."""
        return math.nextafter(self.above, math.inf)

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends, infinite where there is none."""
        return self.above, self.at_most if self.at_most < LARGEST else math.inf


@dataclass(frozen=True, eq=False, slots=True)
class _Row:
    """What was shown in a row."""

    values: list[float]
    """Of all features."""
    words: IntArray
    """Of each field of the grid the word with the cell of its value, shape (fields,)."""
    bits: WordArray
    """... and its bit there, shape (fields,)."""
    usable: BoolArray
    """Which fields are features with a value that can be kept, shape (fields,)."""

    def lie_in(self, box: Boxes) -> BoolArray:
        """Of which fields the value can be kept in a box, shape (fields,)."""
        there: BoolArray = (box[self.words] >> self.bits) & np.uint64(1) != 0
        return self.usable & there


class Unsettled(Exception):  # noqa: N818 - an answer rather than an error
    """Whether a box has a state could not be found out."""


def nearest(
    boxes: Boxes,
    grid: Grid,
    features: Sequence[Feature],
    shown: Reference,
    movable: str | None = None,
) -> Near | None:
    """The state in some boxes that lies nearest to what was shown.

    Args:
        boxes: Any number of them.
        grid: Theirs.
        features: All features of the tree.
        shown: What was shown; without rows, any state is as near as any other one.
        movable: If given, the only feature whose value may differ from what was shown.

    Returns:
        None where the boxes have no state.

    Raises:
        Unsettled: Some boxes could not be settled, and no other one has a state.
    """
    return StateFinder(grid, features, shown, movable).nearest(boxes)


def possible_boxes(
    boxes: Boxes, grid: Grid, features: Sequence[Feature], shown: Reference
) -> tuple[Boxes, bool]:
    """The boxes without those whose combinations of features no numbers have.

    Returns:
        The boxes, and whether it is known of all of them that there are such states.
    """
    if not grid.combinations or not boxes.shape[1]:
        return boxes, True
    finder = StateFinder(grid, features, shown)
    kept = np.ones(boxes.shape[1], dtype=bool)
    settled = boxes.shape[1] <= _MOST_TRIED
    for place in range(min(boxes.shape[1], _MOST_TRIED)):
        try:
            kept[place] = finder.point(boxes[:, place], None) is not None
        except Unsettled:
            settled = False
    return boxes[:, kept], settled


class StateFinder:
    """Finds states in the boxes of one grid.

    Args:
        grid: The grid.
        features: All features of the tree.
        shown: What was shown.
        movable: If given, the only feature whose value may differ from what was shown.
    """

    def __init__(
        self,
        grid: Grid,
        features: Sequence[Feature],
        shown: Reference,
        movable: str | None = None,
    ) -> None:
        self._movable = movable
        self._tables: dict[Quantity | None, FloatArray] = {}
        self._all_cells = grid.everything()
        self._known: dict[int | None, _Row] = {}
        self._grid = grid
        self._features = features
        self._shown = shown
        self._place = {feature.name: place for place, feature in enumerate(features)}
        tests = StateTests(features)
        self._readings = [(field, tests.reading(one)) for field, one in grid.combinations]

    @property
    def no_boxes(self) -> Boxes:
        """None, of the grid."""
        return self._all_cells[:, :0]

    def nearest(self, boxes: Boxes) -> Near | None:
        """As the function of this name."""
        return self.first(boxes, *self.closest(boxes))

    def first(self, boxes: Boxes, distances: FloatArray, rows: IntArray) -> Near | None:
        """The state in some boxes that is nearest to its row.

        Args:
            boxes: Any number of them.
            distances: From `closest`.
            rows: From `closest`.

        Raises:
            Unsettled: Some boxes could not be settled, and no other one has a state.
        """
        unsettled = False
        for place in np.argsort(distances, kind="stable").tolist():
            row = int(rows[place]) if rows[place] >= 0 else None
            try:
                point = self.point(boxes[:, place], row)
            except Unsettled:
                unsettled = True
                continue
            if point is not None:
                return Near(point, row, float(distances[place]))
        if unsettled:
            raise Unsettled
        return None

    def beside(
        self, regions: Sequence[Boxes], at_a_time: Sequence[int]
    ) -> list[Iterator[list[Near]]]:
        """States in some regions, each the nearest to a row, those first that are closest to it.

        Args:
            regions: Boxes of each; of many, only the row that is nearest to each is looked at.
            at_a_time: How many states to look for, one time after the other.

        Returns:
            Of each region, what is found each time.
        """
        count = max(1, len(self._shown))
        few = [0 < one.shape[1] * len(self._shown) <= _COMPARED_AT_A_TIME for one in regions]
        together = [one for one, its in zip(regions, few, strict=True) if its]
        # All at once: what numpy does once per call then does not matter.
        compared = iter(self._distances_of(together))
        found = []
        for boxes, its in zip(regions, few, strict=True):
            if its:
                distances = next(compared).reshape(-1)
                box, row = np.divmod(np.arange(len(distances)), count)
            else:
                distances, row = self.closest(boxes)
                box = np.arange(boxes.shape[1])
            found.append(self._in_order(boxes, distances, box, row, at_a_time))
        return found

    def _distances_of(self, regions: Sequence[Boxes]) -> Iterator[FloatArray]:
        """As `_distances`, of each region."""
        start = 0
        while start < len(regions):
            size, end = 0, start
            while end < len(regions) and (
                end == start
                or (size + regions[end].shape[1]) * len(self._shown) <= _COMPARED_AT_A_TIME
            ):
                size += regions[end].shape[1]
                end += 1
            some = regions[start:end]
            ends = np.cumsum([one.shape[1] for one in some])[:-1]
            yield from np.split(self._distances(np.concatenate(some, axis=1)), ends)
            start = end

    def _in_order(
        self,
        boxes: Boxes,
        distances: FloatArray,
        box: IntArray,
        row: IntArray,
        at_a_time: Sequence[int],
    ) -> Iterator[list[Near]]:
        """See `beside`."""
        most = sum(at_a_time)
        if len(distances) > most:
            # All others are farther away, and those that are as far stand behind.
            limit = np.partition(distances, most - 1)[most - 1]
            nearest = np.flatnonzero(distances <= limit)
            order = nearest[np.argsort(distances[nearest], kind="stable")]
        else:
            order = np.argsort(distances, kind="stable")
        start = 0
        for size in at_a_time:
            places = order[start : start + size]
            start += size
            yield [
                near
                for one in places
                if (near := self.near_row(boxes[:, box[one]], int(row[one]), float(distances[one])))
            ]

    def near_row(self, box: Boxes, row: int, distance: float) -> Near | None:
        """A state in a box near a row, -1 for none; None where there is none as far as is known."""
        beside = row if row >= 0 else None
        with contextlib.suppress(Unsettled):
            point = self.point(box, beside)
            return None if point is None else Near(point, beside, distance)
        return None

    def near(self, boxes: Boxes, limits: FloatArray) -> StateFinder | None:
        """The same with nothing but the rows that are nearer to some box than a limit.

        Args:
            boxes: Any number of them.
            limits: Of each box.

        Returns:
            None if there are no such rows.
        """
        kept = np.zeros(len(self._shown), dtype=bool)
        for part in self._parts(boxes.shape[1]):
            kept |= (self._distances(boxes[:, part]) < limits[part, np.newaxis]).any(axis=0)
        if not kept.any():
            return None
        rows = Reference(self._shown.low[kept], self._shown.high[kept], self._shown.scale, None)
        return StateFinder(self._grid, self._features, rows, self._movable)

    def _parts(self, boxes: int) -> Iterator[slice]:
        """Boxes that can be compared with all rows at a time."""
        at_a_time = max(1, _COMPARED_AT_A_TIME // max(1, len(self._shown)))
        for start in range(0, boxes, at_a_time):
            yield slice(start, start + at_a_time)

    def closest(self, boxes: Boxes) -> tuple[FloatArray, IntArray]:
        """How far each box is from the row that is nearest to it, and which row that is.

        Returns:
            Distances, shape (boxes,), and rows, -1 where there are none, shape (boxes,).
        """
        count = boxes.shape[1]
        if not len(self._shown):
            return np.zeros(count), np.full(count, -1)
        distances, rows = np.empty(count), np.empty(count, dtype=np.int64)
        for part in self._parts(count):
            all_of = self._distances(boxes[:, part])
            rows[part] = np.argmin(all_of, axis=1)
            distances[part] = np.min(all_of, axis=1)
        return distances, rows

    def _distances(self, boxes: Boxes) -> FloatArray:
        """How far boxes are from rows; combinations of features do not count.

        Returns:
            Shape (boxes, rows).
        """
        total = np.zeros((boxes.shape[1], len(self._shown)))
        for field in self._grid.fields:
            if not isinstance(field.quantity, str):
                continue
            words = boxes[field.words]
            if (words == self._all_cells[field.words]).all():
                continue
            # Many boxes have the same cells of a field.
            if len(words) == 1:
                # Numbers are sorted much faster than columns.
                different, which = np.unique(words[0], return_inverse=True)
                different = different[np.newaxis]
            else:
                different, which = np.unique(words, axis=1, return_inverse=True)
            away = self._away(field)
            cells = field.cells_of_words(different)
            least = np.array([away[:, its].min(axis=1, initial=np.inf) for its in cells])
            total += least[np.asarray(which).reshape(-1)]
        return total

    def _away(self, field: Field) -> FloatArray:
        """How far each row is from each cell, shape (rows, cells)."""
        if field.quantity not in self._tables:
            self._tables[field.quantity] = self._table(field)
        return self._tables[field.quantity]

    def _table(self, field: Field) -> FloatArray:
        assert isinstance(field.quantity, str)
        column = self._place[field.quantity]
        low, high = (its[:, column, np.newaxis] for its in (self._shown.low, self._shown.high))
        missing = np.isnan(low)
        # A missing value is as far from all others as the largest from the smallest.
        if field.feature is not None and field.feature.kind is FeatureKind.CATEGORICAL:
            known = np.where((low == field.ends[:-1]) | np.isinf(low), 0.0, 1.0)
        else:
            ends = field.ends[:-1]
            below = np.concatenate([[-np.inf], ends[:-1]])
            known = np.fmax(np.fmax(below - high, low - ends), 0.0) / self._shown.scale[column]
            # On the lower end, which is not part of the cell, it is just outside.
            known = np.where((known == 0) & (high <= below), 1e-12, known)
        known = np.where(missing, 1.0, known)
        return np.concatenate([known, np.where(missing, 0.0, 1.0)], axis=1)

    def point(self, box: Boxes, row: int | None) -> Point | None:
        """A state in the box, near to a row; None if there is none.

        Raises:
            Unsettled: It could not be found out.
        """
        if row not in self._known:
            self._known[row] = self._row(row)
        known = self._known[row]
        values = [*known.values]
        before: HistoryCell | None = None
        for place in np.flatnonzero(~known.lie_in(box)).tolist():
            field = self._grid.fields[place]
            if field.quantity is None:
                before = self._before(field, field.cells_of(box[:, np.newaxis])[0], row)
            elif isinstance(field.quantity, str):
                cells = field.cells_of(box[:, np.newaxis])[0]
                column = self._place[field.quantity]
                values[column] = self._value(field, cells, column, values[column])
        if not self._fits(box, values):
            moved = self._moved(box, values)
            if moved is None:
                return None
            values = moved
        return Point(tuple(values), before)

    def _row(self, row: int | None) -> _Row:
        """A row, made ready to be compared with boxes."""
        values = [self._shown_value(column, row) for column in range(len(self._features))]
        words, bits = [], []
        usable = np.zeros(len(self._grid.fields), dtype=bool)
        for place, field in enumerate(self._grid.fields):
            cell = 0
            if isinstance(field.quantity, str):
                value = values[self._place[field.quantity]]
                cell, usable[place] = field.cell(value), self._is_value(field, value)
            word, bit = divmod(cell, BITS)
            words.append(field.words.start + word)
            bits.append(bit)
        return _Row(
            values, np.array(words, dtype=np.int64), np.array(bits, dtype=np.uint64), usable
        )

    def _shown_value(self, column: int, row: int | None) -> float:
        if row is None:
            return 0.0
        low, high = float(self._shown.low[row, column]), float(self._shown.high[row, column])
        if math.isinf(low):
            return 0.0
        return low if low == high or math.isnan(low) else (low + high) / 2

    def _before(self, field: Field, cells: BoolArray, row: int | None) -> HistoryCell:
        allowed = [field.histories[place] for place in np.flatnonzero(cells)]
        table = self._shown.table
        if row is not None and table is not None:
            code = int(table.previous[row])
            previous = table.actions[code] if code >= 0 else None
            allowed.sort(key=lambda one: one.previous != previous)
        # What an action is called says more than that it is another one.
        return min(allowed, key=lambda one: ANOTHER_ACTION in one.taken)

    def _value(self, field: Field, cells: BoolArray, column: int, value: float) -> float:
        """The value in some cells that is nearest to another one, which is in none of them."""
        if field.feature is not None and field.feature.kind is FeatureKind.CATEGORICAL:
            codes = np.flatnonzero(cells)
            return float(field.ends[codes[0]])
        if field.feature is not None and field.feature.kind is FeatureKind.BINARY:
            for truth in sorted((0.0, 1.0), key=lambda one: abs(one - value)):
                if cells[field.cell(truth)]:
                    return truth
        best, least = math.nan, math.inf
        for one in _ranges(field, cells):
            if not one.missing:
                inside = _inside(one, value, float(self._shown.scale[column]))
                away = abs(inside - value) if not math.isnan(value) else 0.0
                if away < least:
                    best, least = inside, away
        return best

    def _is_value(self, field: Field, value: float) -> bool:
        kind = field.feature.kind if field.feature is not None else FeatureKind.NUMERIC
        return kind is not FeatureKind.CATEGORICAL or math.isnan(value) or value in field.ends

    def _fits(self, box: Boxes, values: Sequence[float]) -> bool:
        for field, read in self._readings:
            cells = field.cells_of(box[:, np.newaxis])[0]
            if not cells[field.cell(read(values))]:
                return False
        return True

    def _moved(self, box: Boxes, values: list[float]) -> list[float] | None:
        """The values with some moved so that combinations fit the box; None if that cannot be.

        Raises:
            Unsettled: It could not be found out.
        """
        restricted = [
            (quantity, field, cells)
            for field, quantity in self._grid.combinations
            if not (cells := field.cells_of(box[:, np.newaxis])[0]).all()
        ]
        names = dict.fromkeys(
            name for quantity, _, _ in restricted for name in features_in(quantity)
        )
        weighed = any(isinstance(quantity, WeightedSum) for quantity, _, _ in restricted)
        solve = self._weighed if weighed else _solved
        choices = [
            _choices(self._grid.field(name), box)
            if self._movable in (None, name)
            else [_only(values[self._place[name]])]
            for name in names
        ]
        choices += [_ranges(field, cells) for _, field, cells in restricted]
        if math.prod(map(len, choices)) > _MOST_COMBINATIONS:
            raise Unsettled
        settled = True
        tried = 0
        for chosen in product(*choices):
            ranges = dict(zip(names, chosen, strict=False))
            between = chosen[len(names) :]
            wanted = [
                (quantity, its) for (quantity, _, _), its in zip(restricted, between, strict=True)
            ]
            if not all(_within_reach(quantity, its, ranges) for quantity, its in wanted):
                continue
            tried += 1
            if weighed and tried > _MOST_WEIGHED:
                raise Unsettled
            solutions, possible = solve(ranges, wanted)
            for found in solutions:
                moved = list(values)
                for name, value in found.items():
                    moved[self._place[name]] = value
                if self._fits(box, moved) and self._in_cells(box, moved, names):
                    return moved
            settled = settled and not possible
        if not settled:
            raise Unsettled
        return None

    def _weighed(
        self, ranges: dict[str, _Range], wanted: Sequence[tuple[Combination, _Range]]
    ) -> tuple[list[dict[str, float]], bool]:
        """As `_solved`, where there are weighted sums."""
        known = [name for name, its in ranges.items() if not its.missing]
        bounds: list[Bound] = []
        for quantity, its in wanted:
            if its.missing == all(name in known for name, _ in quantity.terms):
                return [], False
            if not its.missing:
                weights = dict(quantity.terms)
                bounds.append(Bound(tuple(weights.get(name, 0.0) for name in known), *its.ends))
        scales = [float(self._shown.scale[self._place[name]]) for name in known]
        found = numbers_within([ranges[name].ends for name in known], scales, bounds)
        if found is None:
            return [], False
        missing = {name: math.nan for name, its in ranges.items() if its.missing}
        return [missing | dict(zip(known, found, strict=True))], True

    def _in_cells(self, box: Boxes, values: Sequence[float], names: Iterable[str]) -> bool:
        for name in names:
            field = self._grid.field(name)
            assert field is not None
            cells = field.cells_of(box[:, np.newaxis])[0]
            if not cells[field.cell(values[self._place[name]])]:
                return False
        return True


def _solved(
    ranges: dict[str, _Range], differences: Sequence[tuple[Combination, _Range]]
) -> tuple[list[dict[str, float]], bool]:
    """Numbers that should lie in all ranges, and whether there can be any.

    Rounding may have moved them a little, so the first ones lie amid all that are possible.
    """
    known = {name: its for name, its in ranges.items() if not its.missing}
    exact: list[_Edge] = []
    loose: list[_Edge] = []
    for quantity, its in differences:
        minuend, subtrahend = features_in(quantity)
        both = minuend in known and subtrahend in known
        if its.missing == both:
            return [], False
        if not its.missing:
            narrow, wide = _difference_edges(minuend, subtrahend, its)
            exact += narrow
            loose += wide
    bounds = [edge for name, its in known.items() for edge in _bounds(name, its)]
    highest = _potentials([*known], [*bounds, *exact])
    if highest is None:
        return [], _potentials([*known], [*bounds, *loose]) is not None
    turned = _potentials([*known], [(y, x, most) for x, y, most in (*bounds, *exact)])
    assert turned is not None
    lowest = {name: -value for name, value in turned.items()}
    amid = {name: (value + lowest[name]) / 2 for name, value in highest.items()}
    missing = {name: math.nan for name, its in ranges.items() if its.missing}
    return [
        missing | {name: float(value) for name, value in one.items()}
        for one in (amid, highest, lowest)
    ], True


def _within_reach(quantity: Combination, its: _Range, ranges: dict[str, _Range]) -> bool:
    """Whether a combination can come to lie in a range, were each feature bound by its own alone.

    It rises or falls with each feature, also as it is rounded.  So its least and its largest value
    are those of the ends of the ranges, computed as the runtime does, and "no" is exact.
    """
    of = [(ranges[name], weight) for name, weight in quantity.terms]
    if any(one.missing for one, _ in of):
        return its.missing
    if its.missing:
        return False
    lowest = _total((one.least if weight > 0 else one.at_most, weight) for one, weight in of)
    highest = _total((one.at_most if weight > 0 else one.least, weight) for one, weight in of)
    # Where both are too large for a number, their sum is none, and nothing is known.
    return not (lowest > its.at_most or highest <= its.above)


def _total(terms: Iterable[tuple[float, float]]) -> float:
    """A combination of finite numbers, from left to right."""
    total = 0.0
    for value, weight in terms:
        total += weight * value
    return total


def _choices(field: Field | None, box: Boxes) -> list[_Range]:
    assert field is not None
    return _ranges(field, field.cells_of(box[:, np.newaxis])[0])


def _only(value: float) -> _Range:
    """The range of nothing but one value."""
    return _Range(math.nextafter(value, -math.inf), value)


def _ranges(field: Field, cells: BoolArray) -> list[_Range]:
    """The values of some cells, neighboring ones together; the missing value comes last."""
    numbers = np.concatenate([[False], cells[:-1], [False]])
    borders = np.flatnonzero(numbers[1:] != numbers[:-1])
    ranges = [
        _Range(field.below(int(first)), float(field.ends[last - 1]))
        for first, last in zip(borders[::2], borders[1::2], strict=True)
    ]
    return [*ranges, _Range(math.nan, math.nan)] if cells[-1] else ranges


def _inside(one: _Range, value: float, scale: float) -> float:
    """A number in a range that is near to a value, and reads well."""
    low, high = max(one.above, -LARGEST), one.at_most
    width = high - low
    step = min(_INSIDE * scale, width / 2) if math.isfinite(width) else _INSIDE * scale
    if math.isnan(value):
        value = low + step if one.above > -math.inf else high - step
    wanted = min(max(value, low + step), high - step if high < LARGEST else high)
    for digits in range(1, 17):
        rounded = float(f"{wanted:.{digits}g}")
        if one.above < rounded <= high and abs(rounded - wanted) <= step / 2:
            return rounded
    return wanted if one.above < wanted <= high else high


#: ``x - y <= c`` as (x, y, c).
_Edge: TypeAlias = tuple[str, str, Fraction]
#: The point that bounds of single features are counted from; no feature is called that.
_ZERO: Final = "\0"


def _bounds(name: str, its: _Range) -> Iterator[_Edge]:
    if its.at_most < LARGEST:
        yield name, _ZERO, Fraction(its.at_most)
    if its.above > -math.inf:
        yield _ZERO, name, -Fraction(math.nextafter(its.above, math.inf))


def _difference_edges(
    minuend: str, subtrahend: str, its: _Range
) -> tuple[list[_Edge], list[_Edge]]:
    """The bounds of a difference: within its range, and such that it may be rounded into it."""
    exact: list[_Edge] = []
    loose: list[_Edge] = []
    if its.at_most < LARGEST:
        after = math.nextafter(its.at_most, math.inf)
        exact.append((minuend, subtrahend, Fraction(its.at_most)))
        loose.append((minuend, subtrahend, (Fraction(its.at_most) + Fraction(after)) / 2))
    if its.above > -math.inf:
        least = math.nextafter(its.above, math.inf)
        exact.append((subtrahend, minuend, -Fraction(least)))
        loose.append((subtrahend, minuend, -(Fraction(its.above) + Fraction(least)) / 2))
    return exact, loose


def _potentials(names: Sequence[str], edges: Sequence[_Edge]) -> dict[str, Fraction] | None:
    """Numbers with ``x - y <= c`` for all edges (Bellman and Ford); None if there are none."""
    value = dict.fromkeys((*names, _ZERO), Fraction(0))
    for _ in range(len(value)):
        changed = False
        for x, y, most in edges:
            if value[x] > value[y] + most:
                value[x] = value[y] + most
                changed = True
        if not changed:
            return {name: value[name] - value[_ZERO] for name in names}
    return None
