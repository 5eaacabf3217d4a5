"""Training of decision trees (paper, IV-A): CART with Gini impurity, from scikit-learn."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import TypeAlias

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.encoding import Indicator, Number, columns, encode, encode_last
from rebt_ros.decision_tree.pruning import PruningPath, pruning_path
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.decision_tree.upsampling import Upsampled, Upsampling, svm_smote
from rebt_ros.demonstration.table import DemonstrationTable

#: Tables and trees that are in the making at the same time, whatever the number of cores.
_MOST_AT_A_TIME = 4
#: Rows that are predicted at a time.
_ROWS_AT_A_TIME = 65_536


@dataclass(frozen=True, eq=False, slots=True)
class TrainedTree:
    """A decision tree as data, beside the classifier that it must equal."""

    tree: DecisionTree
    uses_last_action: bool
    """Whether LAT was among the columns."""
    classifier: DecisionTreeClassifier
    """Fitted, not pruned."""
    standing: IntArray
    """The node that decides for each node of the classifier: itself, or what it is pruned to."""
    notes: tuple[str, ...] = ()
    """What a person should know about the rows that it was fitted to; no full stops."""

    def predict(self, table: DemonstrationTable) -> IntArray:
        """scikit-learn's own prediction: positions in ``table.actions``, shape (rows,)."""
        majority = np.argmax(self.classifier.tree_.value[:, 0, :], axis=1)
        return np.asarray(self.classifier.classes_[majority[self.leaves(table)]], dtype=np.int64)

    def deciding(self, table: DemonstrationTable) -> tuple[tuple[Leaf, ...], IntArray]:
        """The leaves that decide for the rows, and the position of each row's one among them."""
        nodes, position = np.unique(self.leaves(table), return_inverse=True)
        distributions = _distributions(self.classifier, len(self.tree.actions))[nodes]
        return tuple(Leaf(tuple(one)) for one in distributions.tolist()), position

    def leaves(self, table: DemonstrationTable) -> IntArray:
        """The node of the classifier that decides for each row, shape (rows,)."""
        return np.asarray(self.standing[_reached(self.classifier, table, self.uses_last_action)])


@dataclass(frozen=True, eq=False, slots=True)
class FittedTree:
    """One fit with all its pruning levels."""

    classifier: DecisionTreeClassifier
    path: PruningPath
    actions: tuple[Action, ...]
    asked: tuple[Number | Indicator, ...]
    """What each column of the encoded table asks."""
    uses_last_action: bool
    notes: tuple[str, ...] = ()
    """What a person should know about the rows that it was fitted to; no full stops."""

    def at(self, ccp_alpha: float) -> TrainedTree:
        """The tree as pruned at `ccp_alpha`; equal to scikit-learn's own fit with it."""
        is_leaf = self.path.leaves_at(ccp_alpha)
        return TrainedTree(
            DecisionTree(
                self.actions, _as_data(self.classifier, self.asked, self.actions, is_leaf)
            ),
            self.uses_last_action,
            self.classifier,
            self.path.standing(is_leaf),
            self.notes,
        )

    def agreements(self, table: DemonstrationTable, ccp_alphas: FloatArray) -> FloatArray:
        """Share of a table's rows that each pruning level predicts, shape (levels,).

        A node decides at the levels from its own ``collapse`` up to its parent's.  So the rows that
        a level predicts are those that reach its deciding nodes with their majority action, and
        one pass over the nodes counts them for all levels.

        Args:
            table: At least one row, with the actions that the tree was fitted to.
            ccp_alphas: The levels, ascending, shape (levels,).
        """
        tree = self.classifier.tree_
        reached = _reached(self.classifier, table, self.uses_last_action)
        actions = len(table.actions)
        counts = np.bincount(reached * actions + table.chosen, minlength=tree.node_count * actions)
        counts = counts.reshape(tree.node_count, actions)
        # Rows that reach a node reach its parent; parents come before their children.
        for node in range(tree.node_count - 1, 0, -1):
            counts[self.path.parents[node]] += counts[node]
        majority = self.classifier.classes_[np.argmax(tree.value[:, 0, :], axis=1)]
        predicted = counts[np.arange(tree.node_count), majority]
        first, end = self.path.levels_decided(ccp_alphas)
        change = np.zeros(len(ccp_alphas) + 1)
        np.add.at(change, first, predicted)
        np.add.at(change, end, -predicted)
        return np.asarray(np.cumsum(change)[:-1] / len(table))


def fit(
    table: DemonstrationTable,
    *,
    last_action: bool,
    max_depth: int | None = None,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> FittedTree:
    """Fits a decision tree.

    Args:
        table: At least one row.
        last_action: Whether the tree may test LAT.
        max_depth: Splits on the longest path; None for no limit.
        random_state: Decides between equally good splits, and which rows are made up.
        upsample: Rows to fit the tree to beside those of the table; its leaves count them, too.

    Raises:
        OptionError: Upsampling needs a package that is not installed.
    """
    options = _FitOptions(last_action, max_depth, random_state, upsample)
    with _quiet():
        return _fitted(table, options)


def fit_parts(
    table: DemonstrationTable,
    parts: Sequence[BoolArray],
    *,
    last_action: bool,
    max_depth: int | None = None,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> Iterator[FittedTree]:
    """Fits a decision tree to the table and one to each part, on several cores; see `fit`.

    Args:
        table: All rows.
        parts: Rows of each part, shape (rows,); as in `DemonstrationTable.where`.
        last_action: As for `fit`, like all that follow.
        max_depth: Splits on the longest path.
        random_state: Of each fit.
        upsample: Of each part.

    Yields:
        The tree of the table, then those of the parts.
    """
    options = _FitOptions(last_action, max_depth, random_state, upsample)
    if upsample is not Upsampling.NONE:
        # The library that upsampling is done with is not known to stand threads.
        yield fit(table, **asdict(options))
        for part in parts:
            yield fit(table.where(part), **asdict(options))
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
        changed = [_changed(table, part) if options.last_action else _NO_ROWS for part in parts]
        again, last = (np.concatenate(one) for one in zip(_NO_ROWS, *changed, strict=True))
        self._matrix = encode(table, options.last_action, spare=len(again))
        if len(again):
            appended = self._matrix[len(table) :]
            appended[:] = self._matrix[again]
            encode_last(appended, last, len(table.actions))
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
    last_action: bool
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
    last_action, random_state = options.last_action, options.random_state
    matrix, chosen = encode(table, last_action), table.chosen
    notes: tuple[str, ...] = ()
    if options.upsample is Upsampling.SVM_SMOTE:
        more = svm_smote(matrix, chosen, columns(table, last_action), random_state)
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
        columns(table, options.last_action),
        options.last_action,
        notes,
    )


def train(
    table: DemonstrationTable,
    *,
    last_action: bool,
    max_depth: int | None = None,
    ccp_alpha: float = 0.0,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> TrainedTree:
    """Fits a decision tree and prunes it at `ccp_alpha`; see `fit`."""
    fitted = fit(
        table,
        last_action=last_action,
        max_depth=max_depth,
        random_state=random_state,
        upsample=upsample,
    )
    return fitted.at(ccp_alpha)


def _reached(
    classifier: DecisionTreeClassifier, table: DemonstrationTable, last_action: bool
) -> IntArray:
    """The leaf of the classifier that each row reaches, shape (rows,)."""
    reached = np.empty(len(table), dtype=np.int64)
    # In parts, so that a large table is not held a second time.
    for start in range(0, len(table), _ROWS_AT_A_TIME):
        rows = slice(start, start + _ROWS_AT_A_TIME)
        reached[rows] = classifier.apply(encode(table, last_action, rows))
    return reached


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
        literal = asked[fitted.feature[node]].at_most(float(fitted.threshold[node]))
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
