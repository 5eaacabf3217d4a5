"""The decision tree as a standalone SVG picture."""

from __future__ import annotations

from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.drawing.decision_tree_picture import decision_tree_page
from rebt_ros.drawing.svg import svg


def render_decision_tree_svg(tree: DecisionTree) -> str:
    """Conditions and the actions that they lead to; tooltips tell all shares of a leaf."""
    return svg(decision_tree_page(tree))
