"""Training of decision trees (paper, IV-A): CART with Gini impurity, from scikit-learn."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.encoding import Indicator, Number, columns, encode
from rebt_ros.decision_tree.pruning import PruningPath, pruning_path
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.decision_tree.upsampling import Upsampled, Upsampling, svm_smote
from rebt_ros.demonstration.table import DemonstrationTable


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

    def leaves(self, table: DemonstrationTable) -> IntArray:
        """The node of the classifier that decides for each row, shape (rows,)."""
        reached = self.classifier.apply(encode(table, self.uses_last_action))
        return np.asarray(self.standing[reached], dtype=np.int64)


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
        reached = self.classifier.decision_path(encode(table, self.uses_last_action)).tocsc()
        majority = self.classifier.classes_[np.argmax(tree.value[:, 0, :], axis=1)]
        node_of_entry = np.repeat(np.arange(tree.node_count), np.diff(reached.indptr))
        right = table.chosen[reached.indices] == majority[node_of_entry]
        predicted = np.bincount(node_of_entry[right], minlength=tree.node_count)
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
    asked = columns(table, last_action)
    matrix, chosen = encode(table, last_action), table.chosen
    notes: tuple[str, ...] = ()
    if upsample is Upsampling.SVM_SMOTE:
        more = svm_smote(matrix, chosen, asked, random_state)
        notes = tuple(_notes(table, more))
        matrix, chosen = more.matrix, more.chosen
    classifier = DecisionTreeClassifier(
        criterion="gini", max_depth=max_depth, random_state=random_state
    )
    with warnings.catch_warnings():
        # Actions are codes here; that there are many does not make this a regression.
        warnings.filterwarnings("ignore", message="The number of unique classes")
        classifier.fit(matrix, chosen)
    actions = tuple(Action(label, table.channel) for label in table.actions)
    path = pruning_path(classifier)
    return FittedTree(classifier, path, actions, asked, last_action, notes)


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
    # Shares of rows; scaled back to whole rows, which keeps ties exact.
    rows = np.rint(fitted.value[:, 0, :] * fitted.n_node_samples[:, np.newaxis]).astype(np.int64)
    distributions = np.zeros((fitted.node_count, len(actions)), dtype=np.int64)
    distributions[:, classifier.classes_] = rows
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
