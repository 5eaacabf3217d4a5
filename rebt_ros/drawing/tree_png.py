"""The behavior tree and the decision tree as PNG files."""

from __future__ import annotations

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.drawing.decision_tree_picture import decision_tree_page
from rebt_ros.drawing.png import render_page_png
from rebt_ros.drawing.tree_picture import behavior_tree_page


def render_png(learned: LearnedTree) -> bytes:
    """The picture that `rebt_ros.drawing.svg.render_svg` shows.

    Raises:
        PictureError: There is no matplotlib, or the file would be huge.
    """
    return render_page_png(behavior_tree_page(learned))


def render_decision_tree_png(tree: DecisionTree) -> bytes:
    """The picture that `rebt_ros.drawing.decision_tree_svg.render_decision_tree_svg` shows.

    Raises:
        PictureError: There is no matplotlib, or the file would be huge.
    """
    return render_page_png(decision_tree_page(tree))
