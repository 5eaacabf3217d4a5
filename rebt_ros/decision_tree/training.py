"""Training of decision trees (paper, IV-A): CART with Gini impurity, from scikit-learn.

The only module that knows scikit-learn.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.arrays import IntArray
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.encoding import Indicator, Number, columns, encode
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.demonstration.table import DemonstrationTable


@dataclass(frozen=True, eq=False, slots=True)
class TrainedTree:
    """A decision tree as data, beside the classifier that it must equal."""

    tree: DecisionTree
    uses_last_action: bool
    """Whether LAT was among the columns."""
    classifier: DecisionTreeClassifier

    def predict(self, table: DemonstrationTable) -> IntArray:
        """scikit-learn's own prediction: positions in ``table.actions``, shape (rows,)."""
        predicted = self.classifier.predict(encode(table, self.uses_last_action))
        return np.asarray(predicted, dtype=np.int64)


def train(
    table: DemonstrationTable,
    *,
    last_action: bool,
    max_depth: int | None = None,
    ccp_alpha: float = 0.0,
    random_state: int = 0,
) -> TrainedTree:
    """Trains one decision tree.

    Args:
        table: At least one row.
        last_action: Whether the tree may test LAT.
        max_depth: Splits on the longest path; None for no limit.
        ccp_alpha: Complexity parameter of minimal cost-complexity pruning; 0 prunes nothing.
        random_state: Decides between equally good splits.
    """
    classifier = DecisionTreeClassifier(
        criterion="gini", max_depth=max_depth, ccp_alpha=ccp_alpha, random_state=random_state
    )
    with warnings.catch_warnings():
        # Actions are codes here; that there are many does not make this a regression.
        warnings.filterwarnings("ignore", message="The number of unique classes")
        classifier.fit(encode(table, last_action), table.chosen)
    actions = tuple(Action(label, table.channel) for label in table.actions)
    root = _as_data(classifier, columns(table, last_action), len(actions))
    return TrainedTree(DecisionTree(actions, root), last_action, classifier)


def _as_data(
    classifier: DecisionTreeClassifier, asked: tuple[Number | Indicator, ...], actions: int
) -> DecisionNode:
    fitted = classifier.tree_
    # Shares of rows; scaled back to whole rows, which keeps ties exact.
    rows = np.rint(fitted.value[:, 0, :] * fitted.n_node_samples[:, np.newaxis]).astype(np.int64)
    distributions = np.zeros((fitted.node_count, actions), dtype=np.int64)
    distributions[:, classifier.classes_] = rows
    data: dict[int, DecisionNode] = {}
    # scikit-learn numbers children after their parents.
    for node in range(fitted.node_count - 1, -1, -1):
        left, right = int(fitted.children_left[node]), int(fitted.children_right[node])
        if left == right:
            data[node] = Leaf(tuple(distributions[node].tolist()))
            continue
        literal = asked[fitted.feature[node]].at_most(float(fitted.threshold[node]))
        holds, fails = (left, right) if literal.positive else (right, left)
        data[node] = Split(literal.condition, data.pop(holds), data.pop(fails))
    return data[0]
