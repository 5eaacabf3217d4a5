"""Which weighted sums of features a tree may test: ``angle + 0.4 × spin > 0.02``.

Weighing one measurement against another, as in braking by distance and speed or in balancing, draws
a slanted line through the states.  A tree that compares one feature at a time follows it in steps,
which take many splits and many rows.  So lines are searched for in the parts of a tree that have
many leaves.  Each separates two actions, by as few features as pay for themselves.  It is then
refitted to the rows close to it, which best determine its position, and offered if it shortens the
description of the rows (see `description_length`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.decision_tree.description_length import shortest_description
from rebt_ros.decision_tree.encoding import Number, Vocabulary
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Difference, WeightedSum

#: Number of sums offered, and of sums tried for each.
_MOST_SUMS, _MOST_TRIED = 4, 5
#: Share of the description that a plain sum saves at least: there are many of them.
_LEAST_SAVED = 0.1
#: Fewer distinct values are counts, or positions on a grid, which nobody weighs.
_LEAST_VALUES = 20
#: Only this many features, the first ones, make sums.
_MOST_FEATURES = 24
#: Number of parts of a tree that are searched for lines, and leaves of a part.
_MOST_PARTS, _LEAST_LEAVES = 4, 4
#: Lines separate the most frequent actions of a part: their number, and minimum rows of each.
_MOST_ACTIONS, _LEAST_ROWS = 4, 8
#: Maximum number of rows of an action that are used.
_MOST_ROWS = 500
#: Significant digits of weights to try, and of weights during the search for a line.
_DIGITS, _USUAL = (2, 3), 2
#: Prior variance of the weights of scaled states, during the search for a line, and when it is
#: refitted to the rows close to it.
_LOOSE, _LOOSER = 1e2, 1e6
#: With more features than this, several are left out at a time.
_FEW = 8
#: Maximum number of steps of Newton's method (a dozen are usual), and the gain that ends it.
_MOST_STEPS, _CLOSE = 30, 1e-6


def likely_sums(
    table: DemonstrationTable, fitted: FittedTree, options: FitOptions
) -> tuple[WeightedSum, ...]:
    """The sums with which a tree describes the rows in the fewest bits.

    Args:
        table: What the tree was fitted to.
        fitted: The tree without these sums.
        options: How it was fitted.

    Returns:
        At most four; none if they do not shorten the description.
    """
    measured = _measured(table)
    if len(measured) < 2:
        return ()
    describing = _Describing(table, options, len(measured))
    best = _Described(fitted, (), shortest_description(fitted).bits)
    plain = _plain(options.vocabulary, [table.features[place].name for place in measured])
    while len(best.sums) < _MOST_SUMS:
        lines = tuple(dict.fromkeys(_lines(table, best.fitted, measured)))
        tried = [
            *describing.shorter(best, plain, (1 - _LEAST_SAVED) * best.bits, most=0),
            *describing.shorter(best, lines, best.bits),
        ]
        if not tried:
            break
        best = min(tried, key=lambda one: one.bits)
    return best.sums


@dataclass(frozen=True, eq=False, slots=True)
class _Described:
    """A tree that may test some sums."""

    fitted: FittedTree
    sums: tuple[WeightedSum, ...]
    bits: float
    """Bits that describe the rows and its sums."""


class _Describing:
    """Describes the rows of a table by trees.

    Args:
        table: What is described.
        options: How trees are fitted.
        features: Number of features that sums can have.
    """

    def __init__(self, table: DemonstrationTable, options: FitOptions, features: int) -> None:
        self._table, self._options = table, options
        self._features = features

    def by(self, sums: tuple[WeightedSum, ...]) -> _Described:
        """Describes the rows by the tree that may test these sums."""
        fitted = self._fitted(sums)
        stating = sum(
            _term_bits(self._features, _digits(weight)) for one in sums for _, weight in one.terms
        )
        return _Described(fitted, sums, shortest_description(fitted).bits + stating)

    def shorter(
        self, best: _Described, found: Sequence[WeightedSum], bits: float, most: int = _MOST_TRIED
    ) -> Iterator[_Described]:
        """Descriptions with one more sum that take fewer bits than this.

        Of more than `most` sums, those that a tree with all of them uses most are tried; none if
        not even this tree has a shorter description.
        """
        further = [one for one in found if one not in best.sums]
        if len(further) > most:
            fitted = self._fitted((*best.sums, *further))
            if shortest_description(fitted).bits >= bits:
                return
            gains = dict(zip(fitted.asked, fitted.gains.tolist(), strict=True))
            further.sort(key=lambda one: -gains[Number(one)])
        for one in further[:_MOST_TRIED]:
            described = self.by((*best.sums, one))
            if described.bits < bits:
                yield described

    def _fitted(self, sums: tuple[WeightedSum, ...]) -> FittedTree:
        vocabulary = self._options.vocabulary.with_more(sums)
        return fit(self._table, replace(self._options, vocabulary=vocabulary))


def _plain(vocabulary: Vocabulary, measured: Collection[str]) -> tuple[WeightedSum, ...]:
    """The sums of features whose differences are tested.

    Whoever goes along the longer of two ways goes by ``x − y`` and ``x + y``: no line separates
    what they do to the left from what they do ahead.
    """
    return tuple(
        WeightedSum(((one.minuend, 1.0), (one.subtrahend, 1.0)))
        for one in vocabulary.combinations
        if isinstance(one, Difference) and {one.minuend, one.subtrahend} <= set(measured)
    )


def _term_bits(features: int, digits: int = _USUAL) -> float:
    """Bits of a feature and its signed weight."""
    return math.log2(features) + 1 + math.log2(9 * 10 ** (digits - 1))


def _digits(weight: float) -> int:
    """Number of significant digits of a weight, of those tried."""
    return next((few for few in _DIGITS if float(f"{weight:.{few}g}") == weight), _DIGITS[-1])


def _measured(table: DemonstrationTable) -> list[int]:
    """Positions of the features that sums can have."""
    places: list[int] = []
    for place, feature in enumerate(table.features):
        if feature.kind is FeatureKind.NUMERIC and not feature.lag and len(places) < _MOST_FEATURES:
            column = table.states[:, place]
            if len(np.unique(column[~np.isnan(column)])) >= _LEAST_VALUES:
                places.append(place)
    return places


def _lines(
    table: DemonstrationTable, fitted: FittedTree, measured: Sequence[int]
) -> Iterator[WeightedSum]:
    """Sums that separate two actions in a part of a tree."""
    states = table.states[:, measured]
    names = [table.features[place].name for place in measured]
    known = ~np.isnan(states).any(axis=1)
    for part in _parts(table, fitted):
        rows = np.flatnonzero(part & known)
        chosen = table.chosen[rows]
        counts = np.bincount(chosen, minlength=len(table.actions))
        frequent = np.argsort(-counts, kind="stable")[:_MOST_ACTIONS]
        for pair in combinations(frequent[counts[frequent] >= _LEAST_ROWS].tolist(), 2):
            either = rows[np.isin(chosen, pair)]
            yield from _line(states[either], table.chosen[either] == pair[1], names)


def _parts(table: DemonstrationTable, fitted: FittedTree) -> Iterator[BoolArray]:
    """Which rows reach the parts of a tree that have the most leaves, shape (rows,) each."""
    standing, parents = fitted.standing_explained, fitted.path.parents
    leaves = np.zeros(len(parents), dtype=np.int64)
    leaves[np.unique(standing[fitted.grown.left < 0])] = 1
    # Parents come before their children.
    for node in range(len(parents) - 1, 0, -1):
        leaves[parents[node]] += leaves[node]
    reached = standing[fitted.reached(table)]
    largest = np.argsort(-leaves, kind="stable")[:_MOST_PARTS]
    for top in largest[leaves[largest] >= _LEAST_LEAVES].tolist():
        below = np.zeros(len(parents), dtype=bool)
        below[top] = True
        for node in range(top + 1, len(parents)):
            below[node] = below[parents[node]]
        yield below[reached]


def _some(is_second: BoolArray) -> IntArray:
    """Evenly spread rows of each action, at most `_MOST_ROWS`."""
    of_each = (np.flatnonzero(is_second == which) for which in (False, True))
    return np.concatenate([rows[:: -(-len(rows) // _MOST_ROWS)] for rows in of_each])


def _line(states: FloatArray, is_second: BoolArray, names: Sequence[str]) -> Iterator[WeightedSum]:
    """The sum that separates two actions in the fewest bits, with few digits and with more.

    None if a single feature is enough.

    Features are left out one by one, the least important first; of many, several at a time.
    """
    low, high = np.percentile(states, (5, 95), axis=0)
    spread = np.where(high > low, high - low, np.ptp(states, axis=0))
    use = np.flatnonzero(spread > 0)
    scaled = (states - np.median(states, axis=0)) / np.where(spread > 0, spread, 1.0)
    some = _some(is_second)
    exception_bits, term_bits = math.log2(len(some)), _term_bits(max(len(use), 1))
    least, best, at = math.inf, np.zeros(len(names)), 0.0
    while len(use):
        weights, offset = _drawn(scaled[some], is_second[some], use, _LOOSE)
        exceptions = _exceptions(scaled[some], is_second[some], weights, offset)
        bits = exceptions * exception_bits + len(use) * term_bits
        if bits <= least:
            least, best, at = bits, weights, offset
        ranked = np.argsort(np.abs(weights[use]), kind="stable")
        use = np.delete(use, ranked[: max(1, len(use) // _FEW)])
    if np.count_nonzero(best) < 2:
        return
    close = _closest(np.abs(scaled @ best + at), is_second)
    weights, offset = _drawn(scaled[close], is_second[close], np.flatnonzero(best), _LOOSER)
    before, after = (
        _exceptions(scaled, is_second, *line) for line in ((best, at), (weights, offset))
    )
    best = weights if after < before else best
    largest = np.abs(states).max(axis=0)
    for digits in _DIGITS:
        found = _as_sum(best, np.where(spread > 0, spread, 1.0), largest, names, digits)
        if found is not None:
            yield found


def _closest(distances: FloatArray, is_second: BoolArray) -> IntArray:
    """The rows of each action closest to a line, at most `_MOST_ROWS`."""
    ranked = np.argsort(distances, kind="stable")
    of_each = (ranked[is_second[ranked] == which] for which in (False, True))
    return np.concatenate([rows[:_MOST_ROWS] for rows in of_each])


def _drawn(
    scaled: FloatArray, is_second: BoolArray, use: IntArray, variance: float
) -> tuple[FloatArray, float]:
    """A line in some of the features: weights of all features, and the offset."""
    weights = np.zeros(scaled.shape[1])
    *weights[use], offset = _logistic_regression(scaled[:, use], is_second, variance)
    return weights, float(offset)


def _exceptions(
    scaled: FloatArray, is_second: BoolArray, weights: FloatArray, offset: float
) -> int:
    """Number of rows on the wrong side of a line."""
    return int(np.count_nonzero((scaled @ weights + offset > 0) != is_second))


def _as_sum(
    scaled: FloatArray,
    spread: FloatArray,
    largest: FloatArray,
    names: Sequence[str],
    digits: int,
) -> WeightedSum | None:
    """The sum of the unscaled features, the most important first.

    One feature has a weight of 1, chosen such that rounding costs the other weights least:
    ``v + 4 × spin + 10 × angle`` is ``angle + 0.1 × v + 0.4 × spin``.
    """
    order = [place for place in np.argsort(-np.abs(scaled), kind="stable") if scaled[place]]
    own = scaled / spread

    def rounded(base: int) -> list[float]:
        return [float(f"{own[place] / own[base]:.{digits}g}") for place in order]

    def lost(base: int) -> float:
        off = np.array(rounded(base)) * own[base] - own[order]
        return float(np.abs(off * spread[order]).sum())

    weights = rounded(min(order, key=lost))
    reach = sum(abs(weight) * largest[place] for weight, place in zip(weights, order, strict=True))
    if not all(weights) or not reach <= LARGEST_VALUE or weights == [1.0, -1.0]:
        return None
    return WeightedSum(
        tuple((names[place], weight) for place, weight in zip(order, weights, strict=True))
    )


def _logistic_regression(scaled: FloatArray, is_second: BoolArray, variance: float) -> FloatArray:
    """A line between two actions that count the same, however many rows they have.

    Uses Newton's method, and halves steps that go too far.  With so few rows, scikit-learn's solver
    takes many times as long, most of it before it starts.

    Args:
        scaled: Shape (rows, features).
        is_second: Shape (rows,).
        variance: Prior variance of the weights.

    Returns:
        Weights of the features, followed by the offset, shape (features + 1,).
    """
    matrix = np.column_stack([scaled, np.ones(len(scaled))])
    sign = np.where(is_second, 1.0, -1.0)
    share = np.where(is_second, 0.5 / is_second.sum(), 0.5 / (~is_second).sum()) * len(scaled)
    ridge = np.full(matrix.shape[1], 1 / variance)
    ridge[-1] = 1e-9

    def loss(solution: FloatArray) -> float:
        likelihood = share @ np.logaddexp(0.0, -sign * (matrix @ solution))
        return float(likelihood + ridge @ solution**2 / 2)

    solution = np.zeros(matrix.shape[1])
    least = loss(solution)
    for _ in range(_MOST_STEPS):
        wrong = 1 / (1 + np.exp(np.clip(sign * (matrix @ solution), -500.0, 500.0)))
        gradient = ridge * solution - matrix.T @ (share * sign * wrong)
        curved = matrix * (share * wrong * (1 - wrong))[:, np.newaxis]
        step = np.linalg.solve(np.diag(ridge) + matrix.T @ curved, gradient)
        while (now := loss(solution - step)) > least and np.abs(step).max() > _CLOSE:
            step = step / 2
        if least - now <= _CLOSE * least:
            break
        solution, least = solution - step, now
    return solution
