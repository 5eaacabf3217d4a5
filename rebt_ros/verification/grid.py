"""The cells into which conditions divide all states, and sets of states as bits.

Conditions tell two values of a feature apart only where one of their thresholds lies between them.
So a feature has finitely many *cells*: the intervals between its thresholds, its categories, and
the missing value.  A *box* is a set of cells of each feature, and stands for the states whose
values all lie in its cells.  Boxes are columns of bits: an array of shape (words, boxes).

What was done before is one more feature, whose cells are all histories that the conditions can tell
apart.  So is the difference of two features, as if it could change by itself; whether numbers exist
that have such a difference, `states` finds out.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import permutations
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, WordArray
from rebt_ros.behavior_tree.condition_tests import StateTests, holds_after
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import (
    Combination,
    Condition,
    Difference,
    HasCategory,
    HistoryCondition,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    StateCondition,
    Threshold,
    WeightedSum,
    combination,
    features_of,
)
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.formulas import AllOf, AnyOf, Formula

#: Boxes: bits of cells, shape (words, boxes).
Boxes: TypeAlias = WordArray

#: The largest number, which is the upper end of the last cell.
LARGEST: Final = sys.float_info.max
#: Stands for every action that no condition names.
ANOTHER_ACTION: Final = "another action"

#: Cells in a word.
BITS: Final = 64
#: Most histories that are told apart.
_MOST_HISTORIES: Final = 100_000
#: Most boxes of the condition of a rule.
_MOST_BOXES: Final = 5_000

#: Stands for whatever a threshold or an interval compares.
_QUANTITY: Final = Feature("quantity")


@dataclass(frozen=True, slots=True)
class HistoryCell:
    """What was done before, one of those that the conditions can tell apart."""

    taken: tuple[str, ...]
    """The distinct actions, the most recent one last."""
    previous: str | None

    def history(self) -> ActionHistory:
        """A history of this kind."""
        history = ActionHistory(self.taken)
        history.previous = self.previous
        return history


@dataclass(frozen=True, eq=False, slots=True)
class Field:
    """A feature, or the difference of two, or what was done before, in a grid."""

    quantity: Quantity | None
    """None: what was done before."""
    feature: Feature | None
    """Of a feature."""
    ends: FloatArray
    """Of each cell the upper end, which is part of it, or its category; NaN: missing, the last."""
    histories: tuple[HistoryCell, ...]
    """The cells of what was done before."""
    words: slice
    """Its words in a box."""

    @property
    def cells(self) -> int:
        """How many there are."""
        return len(self.histories) if self.quantity is None else len(self.ends)

    def chosen(self, cells: BoolArray) -> Boxes:
        """The words of some of its cells, shape (words,)."""
        bits = np.zeros((self.words.stop - self.words.start) * BITS, dtype=bool)
        bits[: self.cells] = cells
        return np.packbits(bits, bitorder="little").view(np.uint64)

    def cells_of(self, boxes: Boxes) -> BoolArray:
        """Which of its cells each box has, shape (boxes, cells)."""
        return self.cells_of_words(boxes[self.words])

    def cells_of_words(self, words: Boxes) -> BoolArray:
        """The same, given nothing but its words of each box, shape (words, boxes)."""
        words = np.ascontiguousarray(words.T)
        bits = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little")
        return bits[:, : self.cells].view(np.bool_)

    def cell(self, value: float) -> int:
        """The cell of a number, category or missing value."""
        if math.isnan(value):
            return len(self.ends) - 1
        return int(np.searchsorted(self.ends[:-1], value))

    def below(self, cell: int) -> float:
        """The lower end of a cell of numbers, which is not part of it."""
        return float(self.ends[cell - 1]) if cell else -math.inf


class Grid:
    """The cells of some features, as far as some conditions tell their values apart.

    Args:
        features: All features of the tree.
        conditions: Those that are asked.

    Raises:
        RuleError: They tell too many histories apart.
    """

    def __init__(self, features: Sequence[Feature], conditions: Iterable[Condition]) -> None:
        self._by_name = {feature.name: feature for feature in features}
        asked = tuple(dict.fromkeys(conditions))
        history = [one for one in asked if isinstance(one, PreviousActionIs | LastActionIs)]
        points = _points(asked)
        self.history = tuple(history)
        """The conditions on what was done before."""
        fields: list[Field] = []
        start = 0
        for quantity, its in points.items():
            fields.append(self._field(quantity, its, start))
            start = fields[-1].words.stop
        if history:
            cells = _histories(history)
            words = slice(start, start + _words(len(cells)))
            fields.append(Field(None, None, np.empty(0), cells, words))
            start = words.stop
        self.fields = tuple(fields)
        """All fields: features and combinations as they first occur, then what was done before."""
        self.words = start
        """Of a box."""
        self._of = {field.quantity: field for field in fields}
        self._masks: dict[Condition, tuple[slice, Boxes]] = {}

    def _field(self, quantity: Quantity, points: set[float], start: int) -> Field:
        feature = self._by_name[quantity] if isinstance(quantity, str) else None
        if feature is not None and feature.kind is FeatureKind.CATEGORICAL:
            ends = [*map(float, range(len(feature.categories))), math.nan]
        else:
            ends = [*sorted(points | {LARGEST}), math.nan]
        words = slice(start, start + _words(len(ends)))
        return Field(quantity, feature, np.array(ends), (), words)

    def field(self, quantity: Quantity | None) -> Field | None:
        """The field of a feature or a combination; of what was done before for None."""
        return self._of.get(quantity)

    @property
    def combinations(self) -> tuple[tuple[Field, Combination], ...]:
        """The fields that are computed from several features."""
        return tuple(
            (field, field.quantity)
            for field in self.fields
            if isinstance(field.quantity, Difference | WeightedSum)
        )

    def everything(self) -> Boxes:
        """One box with all cells."""
        words = [field.chosen(np.ones(field.cells, dtype=bool)) for field in self.fields]
        return np.concatenate([np.empty(0, dtype=np.uint64), *words])[:, np.newaxis]

    def cell_of(self, history: ActionHistory) -> int:
        """The cell of what was done before; there must be such conditions."""
        wanted = [holds_after(history, one) for one in self.history]
        for place, cell in enumerate(self._of[None].histories):
            if [holds_after(cell.history(), one) for one in self.history] == wanted:
                return place
        raise AssertionError(history.taken)

    def mask(self, condition: Condition) -> tuple[slice, Boxes]:
        """Where a condition holds: the words that it is about, and their bits."""
        if condition not in self._masks:
            self._masks[condition] = self._mask(condition)
        return self._masks[condition]

    def _mask(self, condition: Condition) -> tuple[slice, Boxes]:
        if isinstance(condition, PreviousActionIs | LastActionIs):
            field = self._of[None]
            holds = [holds_after(cell.history(), condition) for cell in field.histories]
            return field.words, field.chosen(np.array(holds, dtype=bool))
        quantity = _quantity(condition)
        field = self._of[quantity]
        return field.words, field.chosen(self._holds(condition, field.ends))

    def _holds(self, condition: StateCondition, ends: FloatArray) -> BoolArray:
        match condition:
            case Threshold(quantity=quantity) | Interval(quantity=quantity):
                # A combination stands in the grid as one value.
                about_it = replace(condition, quantity=_QUANTITY.name)
                return StateTests((_QUANTITY,)).of(about_it)(_signed(quantity, ends)[np.newaxis])
            case IsTrue(feature=name) | HasCategory(feature=name):
                return StateTests((self._by_name[name],)).of(condition)(ends[np.newaxis])

    def boxes(self, formula: Formula) -> Boxes:
        """Boxes that share out where a formula holds; they may overlap.

        Raises:
            RuleError: There would be too many.
        """
        return self.within(self.everything(), formula)

    def within(self, boxes: Boxes, formula: Formula) -> Boxes:
        """The part of some boxes where a formula holds."""
        match formula:
            case Literal(condition=condition, positive=positive):
                words, mask = self.mask(condition)
                return restricted(boxes, words, mask if positive else ~mask)
            case AllOf(parts=parts):
                return reduce(self.within, parts, boxes)
            case AnyOf(parts=parts):
                found = [self.within(boxes, part) for part in parts]
                count = sum(one.shape[1] for one in found)
                if count > _MOST_BOXES:
                    raise RuleError(
                        f"a condition has more than {_MOST_BOXES} alternatives: split its rule."
                    )
                return np.concatenate([boxes[:, :0], *found], axis=1)


def restricted(boxes: Boxes, words: slice, mask: Boxes) -> Boxes:
    """The part of some boxes that has these cells of one field; boxes without any are left out."""
    part = boxes[words] & mask[:, np.newaxis]
    there = part.any(axis=0)
    found = boxes[:, there]
    found[words] = part[:, there]
    return found


def canonical(quantity: Quantity) -> Quantity:
    """The same quantity, a combination with the signs with which a grid has it.

    With the other signs, it is the same number with the other sign, to the last bit.
    """
    match quantity:
        case Difference(minuend=minuend, subtrahend=subtrahend) if minuend > subtrahend:
            return Difference(subtrahend, minuend)
        case WeightedSum(terms=((_, first), *_)) if first < 0:
            opposite = combination(tuple((name, -weight) for name, weight in quantity.terms))
            return opposite if isinstance(opposite, WeightedSum) else quantity
    return quantity


def _signed(quantity: Quantity, ends: FloatArray) -> FloatArray:
    return ends if canonical(quantity) == quantity else -ends


def _quantity(condition: StateCondition) -> Quantity:
    match condition:
        case Threshold(quantity=quantity) | Interval(quantity=quantity):
            return canonical(quantity)
        case IsTrue(feature=name) | HasCategory(feature=name):
            return name


def _points(conditions: Iterable[Condition]) -> dict[Quantity, set[float]]:
    """Of each quantity, the numbers up to which the truth of a condition stays the same."""
    points: dict[Quantity, set[float]] = {}
    for condition in conditions:
        if isinstance(condition, PreviousActionIs | LastActionIs):
            continue
        for name in features_of(condition):
            points.setdefault(name, set())
        its = points.setdefault(_quantity(condition), set())
        match condition:
            case Threshold(quantity=quantity, value=value):
                its.update(_last_up_to(quantity, (value,)))
            case Interval(quantity=quantity, above=above, at_most=at_most):
                its.update(_last_up_to(quantity, (above, at_most)))
            case IsTrue():
                its.update((_before(1.0), 1.0))
            case HasCategory():
                pass
    return points


def _last_up_to(quantity: Quantity, values: tuple[float, ...]) -> Iterator[float]:
    for value in values:
        point = value if canonical(quantity) == quantity else _before(-value)
        if math.isfinite(point):
            yield point


def _before(value: float) -> float:
    return math.nextafter(value, -math.inf)


def _words(cells: int) -> int:
    return max(1, -(-cells // BITS))


def _histories(conditions: Sequence[HistoryCondition]) -> tuple[HistoryCell, ...]:
    """All histories that the conditions can tell apart, each once."""
    labels = {condition.action for condition in conditions}
    looking_back = [condition for condition in conditions if isinstance(condition, LastActionIs)]
    labels.update(label for one in looking_back for label in one.deciding)
    known = (*sorted(labels), ANOTHER_ACTION)
    # What is the most recent action outside of n ones, the latest n + 1 tell.
    deepest = max((len(set(one.deciding)) + 1 for one in looking_back), default=0)
    deepest = min(deepest, len(known))
    count = sum(math.perm(len(known), length) for length in range(deepest + 1)) * (len(known) + 1)
    if count > _MOST_HISTORIES:
        raise RuleError(
            f"the tree and the rules tell {count} histories of actions apart, too many to be "
            "checked: learn the tree with --history previous."
        )
    found: dict[tuple[bool, ...], HistoryCell] = {}
    for length in range(deepest + 1):
        for recent in permutations(known, length):
            # Of a history that is longer than what is looked at, the previous action may be older.
            for previous in (None, *(known if length == deepest else recent)):
                older = (previous,) if previous is not None and previous not in recent else ()
                cell = HistoryCell((*older, *reversed(recent)), previous)
                history = cell.history()
                found.setdefault(
                    tuple(holds_after(history, condition) for condition in conditions), cell
                )
    return tuple(found.values())
