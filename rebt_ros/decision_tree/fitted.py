"""Fitted decision trees: pruned to any level, run over tables, and turned into plain data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, in_parts
from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.behavior_tree.prediction import history_columns
from rebt_ros.decision_tree.encoding import (
    Indicator,
    Number,
    Vocabulary,
    columns,
    encode,
)
from rebt_ros.decision_tree.grown import GrownTree
from rebt_ros.decision_tree.pruning import PruningPath
from rebt_ros.decision_tree.readable_thresholds import shared_thresholds
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import (
    KNOWN,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)


@dataclass(frozen=True, eq=False, slots=True)
class TrainedTree:
    """A decision tree as data, with the grown tree that it must equal."""

    tree: DecisionTree
    vocabulary: Vocabulary
    """What it may test besides features."""
    grown: GrownTree
    """Not pruned."""
    standing: IntArray
    """The node that decides for each grown node: itself, or what it is pruned to."""
    thresholds: FloatArray | None = None
    """What each node compares with in double precision, shape (nodes,); None for the thresholds of
    the grown tree, in single precision."""
    notes: tuple[str, ...] = ()
    """What a person should know about the rows that it was fitted to; no full stops."""

    def predict(self, table: DemonstrationTable) -> IntArray:
        """What it chooses: positions in ``table.actions``, shape (rows,).

        This is scikit-learn's own prediction, unless thresholds were moved.
        """
        return np.asarray(self.grown.majority[self.leaves(table)])

    def deciding(self, table: DemonstrationTable) -> tuple[tuple[Leaf, ...], IntArray]:
        """The leaves that decide for the rows, and the position among them for each row."""
        nodes, position = np.unique(self.leaves(table), return_inverse=True)
        counts = self.grown.counts[nodes].tolist()
        return tuple(Leaf(tuple(rows)) for rows in counts), position

    def leaves(self, table: DemonstrationTable) -> IntArray:
        """The node that decides for each row, shape (rows,)."""
        if self.thresholds is None:
            reached = _reached(self.grown, table, self.vocabulary)
        else:
            reached = _compared(self.grown, table, self.vocabulary, self.thresholds)
        return np.asarray(self.standing[reached])


@dataclass(frozen=True, eq=False, slots=True)
class FittedTree:
    """A fit with all its pruning levels."""

    grown: GrownTree
    path: PruningPath
    actions: tuple[Action, ...]
    asked: tuple[Number | Indicator, ...]
    """What each column of the encoded table asks."""
    vocabulary: Vocabulary
    """What it may test besides features."""
    max_depth: int | None
    random_state: int
    notes: tuple[str, ...] = ()
    """What a person should know about the rows that it was fitted to; no full stops."""

    @property
    def leaves(self) -> int:
        """Leaves of the unpruned tree."""
        return int(np.count_nonzero(self.grown.left < 0))

    @property
    def comparisons(self) -> int:
        """Splits of the unpruned tree that compare a number, instead of asking yes or no."""
        split = self.grown.column[self.grown.left >= 0].tolist()
        return sum(isinstance(self.asked[column], Number) for column in split)

    @property
    def explanation(self) -> int:
        """The size of the explanation of the rows that it was fitted to: leaves and exceptions.

        Exceptions are the rows that a tree gets wrong.  The number is the minimum over all ways to
        prune this tree, so mistakes of demonstrators count as exceptions.
        """
        return self._explaining()[0]

    def explained(self, table: DemonstrationTable) -> IntArray:
        """What the tree of the explanation chooses in each row of a table, shape (rows,).

        Of equally small explanations, the one with the fewest leaves counts.
        """
        return np.asarray(self.grown.majority[self.standing_explained[self.reached(table)]])

    @property
    def explaining_leaves(self) -> int:
        """Leaves of the tree of the explanation; the rest of its size are exceptions."""
        return len(np.unique(self.standing_explained[self.grown.left < 0]))

    @property
    def standing_explained(self) -> IntArray:
        """The deciding node of each grown node in the tree of the explanation, shape (nodes,)."""
        return self.path.standing(self._explaining()[1])

    @property
    def gains(self) -> FloatArray:
        """Impurity decrease by the splits of each column, shape (columns,)."""
        grown = self.grown
        split = np.flatnonzero(grown.left >= 0)
        gains = grown.risk[split] - grown.risk[grown.left[split]] - grown.risk[grown.right[split]]
        return np.bincount(grown.column[split], gains, len(self.asked)).astype(np.float64)

    def reached(self, table: DemonstrationTable) -> IntArray:
        """The grown leaf that each row reaches, shape (rows,)."""
        return _reached(self.grown, table, self.vocabulary)

    def _explaining(self) -> tuple[int, BoolArray]:
        """The size of the explanation, and the nodes that are (or would be) its leaves."""
        sizes = self._sizes()
        least, is_leaf = self.grown.cheapest(sizes, np.zeros_like(sizes))
        return int(least), is_leaf

    @property
    def explanations(self) -> IntArray:
        """Leaves and exceptions of the tree at each pruning level, shape (levels,)."""
        return self.path.sums(self._sizes())

    def _sizes(self) -> IntArray:
        """What each node adds to an explanation if it is a leaf, shape (nodes,)."""
        counts = self.grown.counts
        return np.asarray(1 + counts.sum(axis=1) - counts.max(axis=1))

    def right(self, table: DemonstrationTable) -> int:
        """How many rows the unpruned tree predicts."""
        return int(self.hits(table, np.zeros(1)).sum())

    def path_lengths(self, table: DemonstrationTable) -> IntArray:
        """Splits between the root and the leaf that each row reaches, shape (rows,)."""
        depth = np.zeros(len(self.path.parents), dtype=np.int64)
        # Parents come before their children.
        for node in range(1, len(depth)):
            depth[node] = depth[self.path.parents[node]] + 1
        return np.asarray(depth[self.reached(table)])

    def at(self, ccp_alpha: float) -> TrainedTree:
        """The tree as pruned at `ccp_alpha`; equal to scikit-learn's own fit with it."""
        is_leaf = self.path.leaves_at(ccp_alpha)
        return self._trained(is_leaf, None)

    def readable_at(self, ccp_alpha: float, table: DemonstrationTable) -> TrainedTree:
        """The tree as pruned at `ccp_alpha`, with round and shared thresholds.

        Each threshold lies in the gap between the rows of its node, so every row of the table
        reaches the same leaf.

        Args:
            ccp_alpha: The pruning level.
            table: What the tree was fitted to, without made-up rows.
        """
        return self._readable(self.path.leaves_at(ccp_alpha), table)

    def readable_explained(self, table: DemonstrationTable) -> TrainedTree:
        """The tree of the explanation, with round and shared thresholds.

        Args:
            table: What the tree was fitted to, without made-up rows.
        """
        return self._readable(self._explaining()[1], table)

    def _readable(self, is_leaf: BoolArray, table: DemonstrationTable) -> TrainedTree:
        exact = self._exact_thresholds()
        low, high, largest = _gaps(self.grown, table, self.vocabulary, exact)
        of_quantity: dict[int, list[int]] = {}
        for node in np.flatnonzero(~is_leaf & np.isfinite(low) & (exact != KNOWN)).tolist():
            column = int(self.grown.column[node])
            if isinstance(self.asked[column], Number):
                of_quantity.setdefault(column, []).append(node)
        for column, split in of_quantity.items():
            gaps = [(float(low[node]), float(high[node])) for node in split]
            exact[split] = shared_thresholds(gaps, largest[column])
        return self._trained(is_leaf, exact)

    def _trained(self, is_leaf: BoolArray, thresholds: FloatArray | None) -> TrainedTree:
        root = _as_data(self.grown, self.asked, is_leaf, thresholds)
        return TrainedTree(
            DecisionTree(self.actions, root),
            self.vocabulary,
            self.grown,
            self.path.standing(is_leaf),
            thresholds,
            self.notes,
        )

    def _exact_thresholds(self) -> FloatArray:
        """Thresholds in double precision that decide as scikit-learn does."""
        grown = self.grown
        thresholds = grown.threshold.copy()
        for node in np.flatnonzero(grown.left >= 0).tolist():
            match self.asked[grown.column[node]].at_most(float(thresholds[node])).condition:
                case Threshold(value=value):
                    thresholds[node] = value
        return thresholds

    def hits(self, table: DemonstrationTable, ccp_alphas: FloatArray) -> IntArray:
        """The weighted number of a table's rows of each action that each pruning level predicts.

        A node decides at the levels from its own ``collapse`` up to its parent's.  A level predicts
        the rows that reach its deciding nodes and have their majority action.  So one pass over
        the nodes counts them for all levels.

        Args:
            table: At least one row, with the actions that the tree was fitted to.
            ccp_alphas: The levels, ascending, shape (levels,).

        Returns:
            Shape (levels, actions), in the order of the table's actions.
        """
        count = len(self.grown)
        reached = self.reached(table)
        actions = len(table.actions)
        counts = table.counts(reached * actions + table.chosen, count * actions)
        counts = self.path.passed(counts.reshape(count, actions))
        majority = self.grown.majority
        predicted = counts[np.arange(count), majority]
        first, end = self.path.levels_decided(ccp_alphas)
        change = np.zeros((len(ccp_alphas) + 1, actions), dtype=np.int64)
        np.add.at(change, (first, majority), predicted)
        np.add.at(change, (end, majority), -predicted)
        return np.asarray(np.cumsum(change, axis=0)[:-1])


def _reached(grown: GrownTree, table: DemonstrationTable, vocabulary: Vocabulary) -> IntArray:
    """The grown leaf that each row reaches, shape (rows,)."""
    reached = np.empty(len(table), dtype=np.int64)
    for rows in in_parts(len(table)):
        reached[rows] = grown.apply(encode(table, vocabulary, rows))
    return reached


def _compared(
    grown: GrownTree,
    table: DemonstrationTable,
    vocabulary: Vocabulary,
    thresholds: FloatArray,
) -> IntArray:
    """The leaf that each row reaches with thresholds in double precision, shape (rows,)."""
    reached = np.empty(len(table), dtype=np.int64)
    for rows in in_parts(len(table)):
        values = _Values(grown, table, vocabulary, rows)
        for node, here, at_split in values.passed(thresholds):
            if at_split is None:
                reached[rows.start + here] = node
    return reached


def _gaps(
    grown: GrownTree,
    table: DemonstrationTable,
    vocabulary: Vocabulary,
    thresholds: FloatArray,
) -> tuple[FloatArray, FloatArray, dict[int, float]]:
    """The largest known value that goes left at each split, and the smallest that goes right.

    Returns:
        Two arrays of shape (nodes,), with -inf and inf for none, and the largest absolute value of
        each column that is compared.
    """
    low, high = np.full(len(grown), -np.inf), np.full(len(grown), np.inf)
    largest: dict[int, float] = {}
    for rows in in_parts(len(table)):
        values = _Values(grown, table, vocabulary, rows)
        for column, its in values.largest():
            largest[column] = max(largest.get(column, 0.0), its)
        for node, _, at_split in values.passed(thresholds):
            if at_split is not None:
                left, right = at_split
                low[node] = np.max(left, initial=low[node])
                high[node] = np.min(right, initial=high[node])
    return low, high, largest


class _Values:
    """Values of a tree's columns in some rows, as doubles; missing values are infinite."""

    def __init__(
        self, grown: GrownTree, table: DemonstrationTable, vocabulary: Vocabulary, rows: slice
    ) -> None:
        self._grown = grown
        self._rows = rows.stop - rows.start
        self._columns = {}
        split = set(grown.column.tolist())
        for place, asked in enumerate(columns(table, vocabulary)):
            if place in split:
                values = _asked(asked, table, rows)
                self._columns[place] = np.where(np.isnan(values), np.inf, values)

    def largest(self) -> Iterator[tuple[int, float]]:
        """The largest absolute value of each column."""
        for place, its in self._columns.items():
            yield place, float(np.max(np.abs(its), initial=0.0, where=np.isfinite(its)))

    def passed(
        self, thresholds: FloatArray
    ) -> Iterator[tuple[int, IntArray, tuple[FloatArray, FloatArray] | None]]:
        """The nodes that some rows reach.

        Args:
            thresholds: What each node compares with, shape (nodes,).

        Yields:
            A node, the rows that reach it, and at a split, their values: of those that go left, and
            of those that go right.
        """
        grown, under_way = self._grown, [(0, np.arange(self._rows))]
        while under_way:
            node, here = under_way.pop()
            if not len(here):
                continue
            if grown.left[node] < 0:
                yield node, here, None
                continue
            values = self._columns[int(grown.column[node])][here]
            left = values <= thresholds[node]
            yield node, here, (values[left], values[~left])
            under_way += [
                (int(grown.left[node]), here[left]),
                (int(grown.right[node]), here[~left]),
            ]


def _asked(asked: Number | Indicator, table: DemonstrationTable, rows: slice) -> FloatArray:
    """The answer of some rows to a column, in double precision: a number, or 1 for yes; (rows,)."""
    states = table.states[rows].T
    if isinstance(asked, Number):
        return StateTests(table.features).reading(asked.quantity)(states)
    condition = asked.condition
    if isinstance(condition, PreviousActionIs | LastActionIs):
        holds = history_columns(table.actions, table.previous[rows], table.last[rows])(condition)
    else:
        holds = StateTests(table.features).of(condition)(states)
    return np.asarray(holds, dtype=np.float64)


def _as_data(
    grown: GrownTree,
    asked: tuple[Number | Indicator, ...],
    is_leaf: BoolArray,
    thresholds: FloatArray | None,
) -> DecisionNode:
    data: dict[int, DecisionNode] = {}
    # Children come after their parents.
    for node in range(len(grown) - 1, -1, -1):
        if is_leaf[node]:
            data[node] = Leaf(tuple(grown.counts[node].tolist()))
            continue
        left, right = int(grown.left[node]), int(grown.right[node])
        column = asked[grown.column[node]]
        if isinstance(column, Number) and thresholds is not None:
            literal = Literal(Threshold(column.quantity, float(thresholds[node])))
        else:
            literal = column.at_most(float(grown.threshold[node]))
        holds, fails = (left, right) if literal.positive else (right, left)
        data[node] = Split(literal.condition, data[holds], data[fails])
    return data[0]
