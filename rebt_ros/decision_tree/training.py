"""Training of decision trees (paper, IV-A): CART with Gini impurity, from scikit-learn."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from sklearn.base import clone
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.encoding import (
    FEATURES_ALONE,
    Indicator,
    Number,
    Vocabulary,
    columns,
    difference_of,
    encode,
    encode_history,
)
from rebt_ros.decision_tree.pruning import PruningPath, pruning_path
from rebt_ros.decision_tree.readable_thresholds import shared_thresholds
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.decision_tree.upsampling import Upsampled, Upsampling, svm_smote
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import (
    KNOWN,
    Difference,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)

#: Tables and trees that are in the making at the same time, whatever the number of cores.
_MOST_AT_A_TIME = 4
#: Rows that are predicted at a time.
_ROWS_AT_A_TIME = 65_536


@dataclass(frozen=True, eq=False, slots=True)
class TrainedTree:
    """A decision tree as data, beside the classifier that it must equal."""

    tree: DecisionTree
    vocabulary: Vocabulary
    """What it may test beside the features."""
    classifier: DecisionTreeClassifier
    """Fitted, not pruned."""
    standing: IntArray
    """The node that decides for each node of the classifier: itself, or what it is pruned to."""
    thresholds: FloatArray | None = None
    """What each node of the classifier compares with in double precision, shape (nodes,); None
    where thresholds are the classifier's own, in single precision."""
    notes: tuple[str, ...] = ()
    """What a person should know about the rows that it was fitted to; no full stops."""

    def predict(self, table: DemonstrationTable) -> IntArray:
        """What it chooses, without going through `tree`: positions in ``table.actions``.

        That is scikit-learn's own prediction, unless thresholds were moved.  Shape (rows,).
        """
        majority = np.argmax(self.classifier.tree_.value[:, 0, :], axis=1)
        return np.asarray(self.classifier.classes_[majority[self.leaves(table)]], dtype=np.int64)

    def deciding(self, table: DemonstrationTable) -> tuple[tuple[Leaf, ...], IntArray]:
        """The leaves that decide for the rows, and the position of each row's one among them."""
        nodes, position = np.unique(self.leaves(table), return_inverse=True)
        distributions = _distributions(self.classifier, len(self.tree.actions))[nodes]
        return tuple(Leaf(tuple(one)) for one in distributions.tolist()), position

    def leaves(self, table: DemonstrationTable) -> IntArray:
        """The node of the classifier that decides for each row, shape (rows,)."""
        if self.thresholds is None:
            reached = _reached(self.classifier, table, self.vocabulary)
        else:
            reached = _compared(self.classifier, table, self.vocabulary, self.thresholds)
        return np.asarray(self.standing[reached])


@dataclass(frozen=True, eq=False, slots=True)
class FittedTree:
    """One fit with all its pruning levels."""

    classifier: DecisionTreeClassifier
    path: PruningPath
    actions: tuple[Action, ...]
    asked: tuple[Number | Indicator, ...]
    """What each column of the encoded table asks."""
    vocabulary: Vocabulary
    """What it may test beside the features."""
    notes: tuple[str, ...] = ()
    """What a person should know about the rows that it was fitted to; no full stops."""

    @property
    def leaves(self) -> int:
        """Leaves of the tree before it is pruned."""
        return int(self.classifier.get_n_leaves())

    @property
    def explanation(self) -> int:
        """How much it takes to explain the rows that it was fitted to: leaves and exceptions.

        Exceptions are the rows that a tree gets wrong.  Of all ways to prune this one it is the
        least number, so that what demonstrators do by mistake counts as that.
        """
        tree = self.classifier.tree_
        shares = tree.value[:, 0, :]
        right = np.max(shares, axis=1) / np.sum(shares, axis=1)
        sizes = (1 + np.rint(tree.n_node_samples * (1 - right)).astype(np.int64)).tolist()
        left, other = tree.children_left.tolist(), tree.children_right.tolist()
        # Children come after their parents.
        for node in range(tree.node_count - 1, -1, -1):
            if left[node] >= 0:
                sizes[node] = min(sizes[node], sizes[left[node]] + sizes[other[node]])
        return int(sizes[0])

    def right(self, table: DemonstrationTable) -> int:
        """How many rows the tree predicts before it is pruned."""
        return int(self.hits(table, np.zeros(1)).sum())

    def path_lengths(self, table: DemonstrationTable) -> IntArray:
        """Splits between the root and the leaf that each row reaches, shape (rows,)."""
        depth = np.zeros(len(self.path.parents), dtype=np.int64)
        # Parents come before their children.
        for node in range(1, len(depth)):
            depth[node] = depth[self.path.parents[node]] + 1
        return np.asarray(depth[_reached(self.classifier, table, self.vocabulary)])

    def at(self, ccp_alpha: float) -> TrainedTree:
        """The tree as pruned at `ccp_alpha`; equal to scikit-learn's own fit with it."""
        is_leaf = self.path.leaves_at(ccp_alpha)
        return self._trained(is_leaf, None)

    def readable_at(self, ccp_alpha: float, table: DemonstrationTable) -> TrainedTree:
        """The tree as pruned at `ccp_alpha`, with thresholds that are round and shared.

        Each threshold lies in the gap between the rows of its node, so that no row of the table
        reaches another leaf.

        Args:
            ccp_alpha: The pruning level.
            table: What the tree was fitted to, without made-up rows.
        """
        is_leaf = self.path.leaves_at(ccp_alpha)
        exact = self._exact_thresholds()
        low, high = _gaps(self.classifier, table, self.vocabulary, exact)
        of_quantity: dict[int, list[int]] = {}
        for node in np.flatnonzero(~is_leaf & np.isfinite(low) & (exact != KNOWN)).tolist():
            column = int(self.classifier.tree_.feature[node])
            if isinstance(self.asked[column], Number):
                of_quantity.setdefault(column, []).append(node)
        for split in of_quantity.values():
            gaps = [(float(low[node]), float(high[node])) for node in split]
            exact[split] = shared_thresholds(gaps)
        return self._trained(is_leaf, exact)

    def _trained(self, is_leaf: BoolArray, thresholds: FloatArray | None) -> TrainedTree:
        root = _as_data(self.classifier, self.asked, self.actions, is_leaf, thresholds)
        return TrainedTree(
            DecisionTree(self.actions, root),
            self.vocabulary,
            self.classifier,
            self.path.standing(is_leaf),
            thresholds,
            self.notes,
        )

    def _exact_thresholds(self) -> FloatArray:
        """What the nodes compare with in double precision, deciding as scikit-learn does."""
        tree = self.classifier.tree_
        thresholds = np.array(tree.threshold, dtype=np.float64)
        for node in np.flatnonzero(tree.children_left >= 0).tolist():
            match self.asked[tree.feature[node]].at_most(float(thresholds[node])).condition:
                case Threshold(value=value):
                    thresholds[node] = value
        return thresholds

    def hits(self, table: DemonstrationTable, ccp_alphas: FloatArray) -> IntArray:
        """How many of a table's rows of each action each pruning level predicts.

        A node decides at the levels from its own ``collapse`` up to its parent's.  So the rows that
        a level predicts are those that reach its deciding nodes with their majority action, and
        one pass over the nodes counts them for all levels.

        Args:
            table: At least one row, with the actions that the tree was fitted to.
            ccp_alphas: The levels, ascending, shape (levels,).

        Returns:
            Shape (levels, actions), in the order of the table's actions.
        """
        tree = self.classifier.tree_
        reached = _reached(self.classifier, table, self.vocabulary)
        actions = len(table.actions)
        counts = np.bincount(reached * actions + table.chosen, minlength=tree.node_count * actions)
        counts = counts.reshape(tree.node_count, actions)
        # Rows that reach a node reach its parent; parents come before their children.
        for node in range(tree.node_count - 1, 0, -1):
            counts[self.path.parents[node]] += counts[node]
        majority = self.classifier.classes_[np.argmax(tree.value[:, 0, :], axis=1)]
        predicted = counts[np.arange(tree.node_count), majority]
        first, end = self.path.levels_decided(ccp_alphas)
        change = np.zeros((len(ccp_alphas) + 1, actions), dtype=np.int64)
        np.add.at(change, (first, majority), predicted)
        np.add.at(change, (end, majority), -predicted)
        return np.asarray(np.cumsum(change, axis=0)[:-1])


def fit(
    table: DemonstrationTable,
    *,
    vocabulary: Vocabulary = FEATURES_ALONE,
    max_depth: int | None = None,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> FittedTree:
    """Fits a decision tree.

    Args:
        table: At least one row.
        vocabulary: What the tree may test beside the features.
        max_depth: Splits on the longest path; None for no limit.
        random_state: Decides between equally good splits, and which rows are made up.
        upsample: Rows to fit the tree to beside those of the table; its leaves count them, too.

    Raises:
        OptionError: Upsampling needs a package that is not installed.
    """
    options = _FitOptions(vocabulary, max_depth, random_state, upsample)
    with _quiet():
        return _fitted(table, options)


def fit_again(
    table: DemonstrationTable, fitted: FittedTree, number: int, share: float
) -> FittedTree:
    """Another tree of the same rows, whose splits are chosen from random columns.

    Args:
        table: What a tree was fitted to, without made-up rows.
        fitted: That tree, whose options are kept.
        number: Number of the draw.
        share: Of the columns that a split is chosen from, in (0, 1].
    """
    classifier = clone(fitted.classifier).set_params(
        max_features=share, random_state=fitted.classifier.random_state + number
    )
    with _quiet():
        classifier.fit(encode(table, fitted.vocabulary), table.chosen)
    return replace(fitted, classifier=classifier, path=pruning_path(classifier))


def fit_parts(
    table: DemonstrationTable,
    parts: Sequence[BoolArray],
    *,
    vocabulary: Vocabulary = FEATURES_ALONE,
    max_depth: int | None = None,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> Iterator[FittedTree]:
    """Fits a decision tree to the table and one to each part, on several cores; see `fit`.

    Args:
        table: All rows.
        parts: Rows of each part, shape (rows,); as in `DemonstrationTable.where`.
        vocabulary: As for `fit`, like all that follow.
        max_depth: Splits on the longest path.
        random_state: Of each fit.
        upsample: Of each part.

    Yields:
        The tree of the table, then those of the parts.
    """
    options = _FitOptions(vocabulary, max_depth, random_state, upsample)
    if upsample is not Upsampling.NONE:
        # The library that upsampling is done with is not known to stand threads.
        for rows in (np.ones(len(table), dtype=bool), *parts):
            with _quiet():
                yield _fitted(table.where(rows), options)
        return
    # Threads are enough: scikit-learn lets go of Python's lock while it grows a tree.
    workers = min(_MOST_AT_A_TIME, os.cpu_count() or 1)
    with _quiet(), ThreadPoolExecutor(workers) as pool:
        yield from pool.map(_Parts(table, parts, options).fitted, range(len(parts) + 1))


class _Parts:
    """Parts of a table that share one matrix, in which the rows outside a part weigh nothing.

    scikit-learn leaves such rows out, so that each tree is the one that a matrix of its own would
    give: only sums of whole numbers decide about it, whatever their order.
    """

    def __init__(
        self, table: DemonstrationTable, parts: Sequence[BoolArray], options: _FitOptions
    ) -> None:
        self._table, self._parts, self._options = table, parts, options
        # LAT of a part differs where rows before are missing: those rows are appended.
        with_lat = options.vocabulary.history is History.LAST
        changed = [_changed(table, part) if with_lat else _NO_ROWS for part in parts]
        again, last = (np.concatenate(one) for one in zip(_NO_ROWS, *changed, strict=True))
        self._matrix = encode(table, options.vocabulary, spare=len(again))
        if len(again):
            appended = self._matrix[len(table) :]
            appended[:] = self._matrix[again]
            encode_history(appended, last, len(table.actions))
        # Small numbers: scikit-learn sorts them, and copies them more than once.
        kind = np.min_scalar_type(len(table.actions))
        self._chosen = np.append(table.chosen, table.chosen[again]).astype(kind)
        ends = np.cumsum([len(table), *(len(rows) for rows, _ in changed)])
        self._instead = [
            (rows, slice(start, end))
            for (rows, _), start, end in zip(changed, ends[:-1], ends[1:], strict=True)
        ]

    def fitted(self, number: int) -> FittedTree:
        """The tree of the table, for 0, or of a part."""
        weights = np.zeros(len(self._matrix))
        if number:
            weights[: len(self._table)] = self._parts[number - 1]
            instead, appended = self._instead[number - 1]
            weights[instead] = 0
            weights[appended] = 1
        else:
            weights[: len(self._table)] = 1
        classifier = self._options.classifier()
        classifier.fit(self._matrix, self._chosen, sample_weight=weights)
        return _as_fitted(self._table, classifier, self._options)


#: Rows whose LAT differs in a part, and that LAT.
_Changed: TypeAlias = tuple[IntArray, IntArray]
_NO_ROWS: _Changed = (np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))


def _changed(table: DemonstrationTable, part: BoolArray) -> _Changed:
    last = table.last_where(part)
    rows = np.flatnonzero(part)
    differing = last != table.last[rows]
    return rows[differing], last[differing]


@dataclass(frozen=True, slots=True)
class _FitOptions:
    vocabulary: Vocabulary
    max_depth: int | None
    random_state: int
    upsample: Upsampling

    def classifier(self) -> DecisionTreeClassifier:
        return DecisionTreeClassifier(
            criterion="gini", max_depth=self.max_depth, random_state=self.random_state
        )


@contextmanager
def _quiet() -> Iterator[None]:
    """Without a warning that takes actions, which are codes here, for a regression's numbers.

    Warnings are switched for the whole process, so this stands around threads, not in them.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The number of unique classes")
        yield


def _fitted(table: DemonstrationTable, options: _FitOptions) -> FittedTree:
    vocabulary, random_state = options.vocabulary, options.random_state
    matrix, chosen = encode(table, vocabulary), table.chosen
    notes: tuple[str, ...] = ()
    if options.upsample is Upsampling.SVM_SMOTE:
        more = svm_smote(matrix, chosen, columns(table, vocabulary), random_state)
        notes = tuple(_notes(table, more))
        matrix, chosen = more.matrix, more.chosen
    classifier = options.classifier()
    classifier.fit(matrix, chosen)
    return _as_fitted(table, classifier, options, notes)


def _as_fitted(
    table: DemonstrationTable,
    classifier: DecisionTreeClassifier,
    options: _FitOptions,
    notes: tuple[str, ...] = (),
) -> FittedTree:
    actions = tuple(Action(label, table.channel) for label in table.actions)
    return FittedTree(
        classifier,
        pruning_path(classifier),
        actions,
        columns(table, options.vocabulary),
        options.vocabulary,
        notes,
    )


def train(
    table: DemonstrationTable,
    *,
    vocabulary: Vocabulary = FEATURES_ALONE,
    max_depth: int | None = None,
    ccp_alpha: float = 0.0,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> TrainedTree:
    """Fits a decision tree and prunes it at `ccp_alpha`; see `fit`."""
    fitted = fit(
        table,
        vocabulary=vocabulary,
        max_depth=max_depth,
        random_state=random_state,
        upsample=upsample,
    )
    return fitted.at(ccp_alpha)


def _reached(
    classifier: DecisionTreeClassifier, table: DemonstrationTable, vocabulary: Vocabulary
) -> IntArray:
    """The leaf of the classifier that each row reaches, shape (rows,)."""
    reached = np.empty(len(table), dtype=np.int64)
    # In parts, so that a large table is not held a second time.
    for start in range(0, len(table), _ROWS_AT_A_TIME):
        rows = slice(start, start + _ROWS_AT_A_TIME)
        reached[rows] = classifier.apply(encode(table, vocabulary, rows))
    return reached


def _compared(
    classifier: DecisionTreeClassifier,
    table: DemonstrationTable,
    vocabulary: Vocabulary,
    thresholds: FloatArray,
) -> IntArray:
    """The leaf that each row reaches with thresholds in double precision, shape (rows,)."""
    tree, values = classifier.tree_, _Values(classifier, table, vocabulary)
    node = np.zeros(len(table), dtype=np.int64)
    under_way = np.arange(len(table))
    while (under_way := under_way[tree.children_left[node[under_way]] >= 0]).size:
        at = node[under_way]
        left = values.of(under_way, tree.feature[at]) <= thresholds[at]
        node[under_way] = np.where(left, tree.children_left[at], tree.children_right[at])
    return node


def _gaps(
    classifier: DecisionTreeClassifier,
    table: DemonstrationTable,
    vocabulary: Vocabulary,
    thresholds: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """The largest known value that goes left at each split, and the smallest that goes right.

    Returns:
        Two of shape (nodes,): -inf and inf where there is none.
    """
    tree, values = classifier.tree_, _Values(classifier, table, vocabulary)
    low, high = np.full(tree.node_count, -np.inf), np.full(tree.node_count, np.inf)
    node = np.zeros(len(table), dtype=np.int64)
    under_way = np.arange(len(table))
    while (under_way := under_way[tree.children_left[node[under_way]] >= 0]).size:
        at = node[under_way]
        value = values.of(under_way, tree.feature[at])
        left = value <= thresholds[at]
        np.maximum.at(low, at[left], value[left])
        np.minimum.at(high, at[~left], value[~left])
        node[under_way] = np.where(left, tree.children_left[at], tree.children_right[at])
    return low, high


class _Values:
    """What a classifier's columns hold in double precision; infinite where it is missing."""

    def __init__(
        self, classifier: DecisionTreeClassifier, table: DemonstrationTable, vocabulary: Vocabulary
    ) -> None:
        self._columns = {}
        for place, asked in enumerate(columns(table, vocabulary)):
            if place in classifier.tree_.feature:
                values = _asked(asked, table, vocabulary)
                self._columns[place] = np.where(np.isnan(values), np.inf, values)

    def of(self, rows: IntArray, column: IntArray) -> FloatArray:
        """The value of one column in each of the rows, shape (rows,)."""
        values = np.empty(len(rows))
        for place, its in self._columns.items():
            here = column == place
            values[here] = its[rows[here]]
        return values


def _asked(
    asked: Number | Indicator, table: DemonstrationTable, vocabulary: Vocabulary
) -> FloatArray:
    place = {feature.name: index for index, feature in enumerate(table.features)}
    match asked:
        case Number(quantity=Difference() as difference):
            return difference_of(table, difference, table.states)
        case Number(quantity=str(name)):
            return table.states[:, place[name]]
        case Indicator(condition=IsTrue(feature=name)):
            holds = table.states[:, place[name]] == 1
        case Indicator(condition=HasCategory(feature=name, category=category)):
            code = table.features[place[name]].categories.index(category)
            holds = table.states[:, place[name]] == code
        case Indicator(condition=PreviousActionIs(action=action)):
            holds = table.previous == table.actions.index(action)
        case Indicator(condition=LastActionIs(action=action)):
            holds = table.last == table.actions.index(action)
        case _:
            raise AssertionError(asked)
    return np.asarray(holds, dtype=np.float64)


def _notes(table: DemonstrationTable, more: Upsampled) -> Iterator[str]:
    added = len(more.chosen) - len(table)
    yield f"the decision tree was fitted to {added} made-up rows beside the {len(table)} shown"
    if more.left:
        names = ", ".join(repr(table.actions[action]) for action in more.left)
        yield f"too few rows resemble each other to upsample {names}"


def _as_data(
    classifier: DecisionTreeClassifier,
    asked: tuple[Number | Indicator, ...],
    actions: tuple[Action, ...],
    is_leaf: BoolArray,
    thresholds: FloatArray | None,
) -> DecisionNode:
    fitted = classifier.tree_
    distributions = _distributions(classifier, len(actions))
    data: dict[int, DecisionNode] = {}
    # scikit-learn numbers children after their parents.
    for node in range(fitted.node_count - 1, -1, -1):
        if is_leaf[node]:
            data[node] = Leaf(tuple(distributions[node].tolist()))
            continue
        left, right = int(fitted.children_left[node]), int(fitted.children_right[node])
        column = asked[fitted.feature[node]]
        if isinstance(column, Number) and thresholds is not None:
            literal = Literal(Threshold(column.quantity, float(thresholds[node])))
        else:
            literal = column.at_most(float(fitted.threshold[node]))
        holds, fails = (left, right) if literal.positive else (right, left)
        data[node] = Split(literal.condition, data[holds], data[fails])
    return data[0]


def _distributions(classifier: DecisionTreeClassifier, actions: int) -> IntArray:
    """Rows of each action in each node, shape (nodes, actions)."""
    fitted = classifier.tree_
    # Shares of rows; scaled back to whole rows, which keeps ties exact.
    rows = np.rint(fitted.value[:, 0, :] * fitted.n_node_samples[:, np.newaxis]).astype(np.int64)
    distributions = np.zeros((fitted.node_count, actions), dtype=np.int64)
    distributions[:, classifier.classes_] = rows
    return distributions
