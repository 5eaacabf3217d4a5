"""The table as a matrix for scikit-learn, and what each of its columns asks.

vocabulary
    What a tree may test besides features: combinations of several features, and a history.

A numeric or binary feature and a combination are one column each.  A categorical feature has one
column for each category, and the history one for each action (one-hot).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import Float32Array, FloatArray, IntArray
from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import (
    KNOWN,
    Combination,
    Condition,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
)

#: Stands for a missing number: larger than all others, since ``missing <= x`` is false.
MISSING = float(np.finfo(np.float32).max)
#: Limit for values of combinations, which stay on the same side of all thresholds.
_FARTHEST = 0.3 * MISSING


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """What a decision tree may test besides features."""

    history: History = History.NONE
    combinations: tuple[Combination, ...] = ()

    def with_more(self, combinations: Iterable[Combination]) -> Vocabulary:
        """The vocabulary with more combinations after the existing ones."""
        return Vocabulary(self.history, (*self.combinations, *combinations))


FEATURES_ALONE = Vocabulary()


@dataclass(frozen=True, slots=True)
class Number:
    """Column of a quantity."""

    quantity: Quantity

    def at_most(self, threshold: float) -> Literal:
        """The literal that holds where the column is at most `threshold`."""
        # No value lies between the largest accepted one (1e38) and the missing ones.
        beyond = threshold > MISSING / 3
        return Literal(Threshold(self.quantity, KNOWN if beyond else exact_threshold(threshold)))


@dataclass(frozen=True, slots=True)
class Indicator:
    """Column that is 1 where a condition holds, and 0 elsewhere."""

    condition: Condition

    def at_most(self, threshold: float) -> Literal:
        """The literal that holds where the column is at most `threshold`, which is about 0.5."""
        return ~Literal(self.condition)


def columns(table: DemonstrationTable, vocabulary: Vocabulary) -> tuple[Number | Indicator, ...]:
    """What each column of the encoded table asks."""
    asked: list[Number | Indicator] = []
    for feature in table.features:
        if feature.kind is FeatureKind.NUMERIC:
            asked.append(Number(feature.name))
        elif feature.kind is FeatureKind.BINARY:
            asked.append(Indicator(IsTrue(feature.name)))
        else:
            asked += [
                Indicator(HasCategory(feature.name, category)) for category in feature.categories
            ]
    asked += map(Number, vocabulary.combinations)
    match vocabulary.history:
        case History.PREVIOUS:
            asked += [Indicator(PreviousActionIs(action)) for action in table.actions]
        case History.LAST:
            asked += [Indicator(LastActionIs(action)) for action in table.actions]
        case History.NONE:
            pass
    return tuple(asked)


def encode(
    table: DemonstrationTable, vocabulary: Vocabulary, rows: slice = slice(None), spare: int = 0
) -> Float32Array:
    """The matrix to train on and predict from, shape (rows, columns), of all rows or a stretch.

    Spare rows may follow its rows; they are zero.

    Without anything to learn from, it has one constant column, because scikit-learn needs at least
    one.
    """
    widths = [
        len(one.categories) if one.kind is FeatureKind.CATEGORICAL else 1 for one in table.features
    ]
    history = history_of(table, vocabulary)
    width = sum(widths) + len(vocabulary.combinations)
    width += 0 if history is None else len(table.actions)
    # Filled in place, to hold large tables once, and by columns, in the order of fitting.
    states = table.states[rows]
    whole = np.zeros((len(states) + spare, max(width, 1)), dtype=np.float32, order="F")
    matrix = whole[: len(states)]
    end = 0
    for index, (feature, its) in enumerate(zip(table.features, widths, strict=True)):
        values = states[:, index]
        start, end = end, end + its
        if feature.kind is FeatureKind.NUMERIC:
            _number(values, matrix[:, start])
        elif feature.kind is FeatureKind.BINARY:
            matrix[:, start] = values == 1
        else:
            _one_hot(values, matrix[:, start:end])
    tests = StateTests(table.features)
    for place, combination in enumerate(vocabulary.combinations, start=end):
        computed = tests.reading(combination)(states.T)
        _number(np.clip(computed, -_FARTHEST, _FARTHEST), matrix[:, place])
    if history is not None:
        encode_history(matrix, history[rows], len(table.actions))
    return whole


def history_of(table: DemonstrationTable, vocabulary: Vocabulary) -> IntArray | None:
    """What was done before each row, in terms of the vocabulary, shape (rows,)."""
    match vocabulary.history:
        case History.NONE:
            return None
        case History.PREVIOUS:
            return table.previous
        case History.LAST:
            return table.last


def encode_history(matrix: Float32Array, history: IntArray, actions: int) -> None:
    """Writes a history to a matrix with one: positions of actions, shape (rows,)."""
    _one_hot(history, matrix[:, matrix.shape[1] - actions :])


def exact_threshold(threshold: float) -> float:
    """The double-precision threshold that decides as scikit-learn does.

    scikit-learn asks ``float32(x) <= threshold``.  The result t has ``x <= t`` in exactly the same
    cases for every double-precision x: it is the largest double that rounds to a single-precision
    number not above `threshold`.

    >>> float(np.float32(0.1)) <= 0.1, 0.1 <= exact_threshold(0.1)
    (False, False)
    """
    with np.errstate(over="ignore"):
        below = np.float32(threshold)
        if float(below) > threshold:
            below = np.nextafter(below, np.float32(-np.inf))
        above = np.nextafter(below, np.float32(np.inf))
    # Both neighbors have 24 significant bits, so their middle is exact in double precision.
    # A tie is rounded to the neighbor whose last bit is even.
    middle = (float(below) + float(above)) / 2
    tie_goes_down = int(below.view(np.uint32)) % 2 == 0
    return middle if tie_goes_down else float(np.nextafter(middle, -np.inf))


def _number(values: FloatArray, column: Float32Array) -> None:
    column[:] = values
    column[np.isnan(values)] = MISSING


def _one_hot(codes: FloatArray | IntArray, block: Float32Array) -> None:
    for code in range(block.shape[1]):
        block[:, code] = codes == code
