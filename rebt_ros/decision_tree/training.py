"""Training of decision trees (paper, IV-A): CART with Gini impurity, from scikit-learn."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.encoding import (
    FEATURES_ALONE,
    Vocabulary,
    columns,
    encode,
    encode_history,
)
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.grown import GrownTree
from rebt_ros.decision_tree.pruning import pruning_path
from rebt_ros.decision_tree.svm_smote import Upsampled, svm_smote
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable

if TYPE_CHECKING:
    from sklearn.tree import DecisionTreeClassifier

#: Maximum number of tables and trees in the making at a time, whatever the number of cores.
_MOST_AT_A_TIME = 4


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How to fit a decision tree."""

    vocabulary: Vocabulary = FEATURES_ALONE
    """What the tree may test besides features."""
    max_depth: int | None = None
    """Splits on the longest path; None for no limit."""
    random_state: int = 0
    """Breaks ties between equally good splits, and decides which rows are made up."""
    upsample: Upsampling = Upsampling.NONE
    """Additional rows to fit the tree to; its leaves count them too."""

    def classifier(self, among: int | None = None) -> DecisionTreeClassifier:
        """What is fitted; each of its splits is chosen from so many columns, or from all."""
        # Importing it takes longer than everything else that shows a learned tree.
        from sklearn.tree import DecisionTreeClassifier

        return DecisionTreeClassifier(
            criterion="gini",
            max_depth=self.max_depth,
            max_features=among,
            random_state=self.random_state,
        )


#: How a tree is fitted by default.
PLAIN = FitOptions()


def fit(table: DemonstrationTable, options: FitOptions = PLAIN) -> FittedTree:
    """Fits a decision tree.

    Args:
        table: At least one row.
        options: How.

    Raises:
        OptionError: Upsampling needs a package that is not installed.
    """
    with _quiet():
        return _fitted(table, options)


def fit_again(table: DemonstrationTable, fitted: FittedTree, number: int, among: int) -> FittedTree:
    """Another tree for the same rows, whose splits are chosen from random columns.

    Args:
        table: What a tree was fitted to, without made-up rows.
        fitted: That tree, whose options apply.
        number: Number of the draw.
        among: Number of the columns that a split is chosen from, at least 1.
    """
    from sklearn import config_context

    options = FitOptions(
        fitted.vocabulary, fitted.max_depth, fitted.random_state + number, Upsampling.NONE
    )
    classifier = options.classifier(among)
    # For few rows, checks of what is known to be right take longer than all else.
    with _quiet(), config_context(skip_parameter_validation=True):
        matrix = encode(table, fitted.vocabulary)
        weights = table.row_weights
        classifier.fit(matrix, table.chosen, sample_weight=weights, check_input=False)
    grown = _grown(classifier, len(fitted.actions))
    return replace(fitted, grown=grown, path=pruning_path(grown))


def fit_parts(
    table: DemonstrationTable, parts: Sequence[BoolArray], options: FitOptions = PLAIN
) -> Iterator[FittedTree]:
    """Fits a decision tree to the table and one to each part, on several cores; see `fit`.

    Args:
        table: All rows.
        parts: Rows of each part, shape (rows,); as in `DemonstrationTable.where`.
        options: Options of each fit.

    Yields:
        The tree of the table, then those of the parts.
    """
    if options.upsample is not Upsampling.NONE:
        # The upsampling library may not be thread-safe.
        for rows in (np.ones(len(table), dtype=bool), *parts):
            with _quiet():
                yield _fitted(table.where(rows), options)
        return
    # Threads are enough: scikit-learn releases Python's lock while it grows a tree.
    workers = min(_MOST_AT_A_TIME, os.cpu_count() or 1)
    with _quiet(), ThreadPoolExecutor(workers) as pool:
        yield from pool.map(_Parts(table, parts, options).fitted, range(len(parts) + 1))


class _Parts:
    """Parts of a table that share one matrix, in which rows outside a part have no weight.

    scikit-learn ignores such rows, so each tree is the one that a separate matrix would give: only
    sums of whole numbers decide it, whatever their order.
    """

    def __init__(
        self, table: DemonstrationTable, parts: Sequence[BoolArray], options: FitOptions
    ) -> None:
        self._table, self._parts, self._options = table, parts, options
        # LAT of a part differs after rows that it lacks: the rows that differ are appended.
        with_lat = options.vocabulary.history is History.LAST
        changed = [_changed(table, part) if with_lat else _NO_ROWS for part in parts]
        again, last = (np.concatenate(one) for one in zip(_NO_ROWS, *changed, strict=True))
        self._matrix = encode(table, options.vocabulary, spare=len(again))
        if len(again):
            appended = self._matrix[len(table) :]
            appended[:] = self._matrix[again]
            encode_history(appended, last, len(table.actions))
        # Small integers: scikit-learn sorts them, and copies them several times.
        kind = np.min_scalar_type(len(table.actions))
        self._chosen = np.append(table.chosen, table.chosen[again]).astype(kind)
        its = table.row_weights
        self._weights = np.ones(len(table)) if its is None else its.astype(np.float64)
        ends = np.cumsum([len(table), *(len(rows) for rows, _ in changed)])
        self._instead = [
            (rows, slice(start, end))
            for (rows, _), start, end in zip(changed, ends[:-1], ends[1:], strict=True)
        ]

    def fitted(self, number: int) -> FittedTree:
        """The tree of the table, for 0, or of a part."""
        weights = np.zeros(len(self._matrix))
        if number:
            weights[: len(self._table)] = self._parts[number - 1] * self._weights
            instead, appended = self._instead[number - 1]
            weights[instead] = 0
            weights[appended] = self._weights[instead]
        else:
            weights[: len(self._table)] = self._weights
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


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppresses a warning that mistakes codes of actions for a regression's numbers.

    Warnings are switched for the whole process, so this is used around threads, not in them.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The number of unique classes")
        yield


def _fitted(table: DemonstrationTable, options: FitOptions) -> FittedTree:
    vocabulary, random_state = options.vocabulary, options.random_state
    matrix, chosen, weights = encode(table, vocabulary), table.chosen, table.row_weights
    notes: tuple[str, ...] = ()
    if options.upsample is Upsampling.SVM_SMOTE:
        more = svm_smote(matrix, chosen, columns(table, vocabulary), random_state)
        notes = tuple(_notes(table, more))
        matrix, chosen, weights = more.matrix, more.chosen, None
    classifier = options.classifier()
    classifier.fit(matrix, chosen, sample_weight=weights)
    return _as_fitted(table, classifier, options, notes)


def _as_fitted(
    table: DemonstrationTable,
    classifier: DecisionTreeClassifier,
    options: FitOptions,
    notes: tuple[str, ...] = (),
) -> FittedTree:
    grown = _grown(classifier, len(table.actions))
    return FittedTree(
        grown,
        pruning_path(grown),
        tuple(Action(label, table.channel) for label in table.actions),
        columns(table, options.vocabulary),
        options.vocabulary,
        options.max_depth,
        options.random_state,
        notes,
    )


def _grown(classifier: DecisionTreeClassifier, actions: int) -> GrownTree:
    tree = classifier.tree_
    weights = tree.weighted_n_node_samples
    # Shares of rows, scaled back to whole rows: this keeps ties exact.
    rows = np.rint(tree.value[:, 0, :] * weights[:, np.newaxis]).astype(np.int64)
    counts = np.zeros((tree.node_count, actions), dtype=np.int64)
    counts[:, classifier.classes_] = rows
    return GrownTree(
        tree.children_left.astype(np.int64),
        tree.children_right.astype(np.int64),
        tree.feature.astype(np.int64),
        tree.threshold.astype(np.float64),
        counts,
        tree.impurity * weights / weights[0],
        tree.apply,
    )


def _notes(table: DemonstrationTable, more: Upsampled) -> Iterator[str]:
    added = len(more.chosen) - len(table)
    yield f"the decision tree was fitted to {added} made-up rows beside the {len(table)} shown"
    if more.left:
        names = ", ".join(repr(table.actions[action]) for action in more.left)
        yield f"too few rows resemble each other to upsample {names}"
