"""The main trees of the modes, without suggestions."""

from __future__ import annotations

from rebt_ros.behavior_tree import nodes
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.learning.conversion import convert
from rebt_ros.learning.options import DEFAULTS, LearnOptions
from rebt_ros.paper import re_bt_espresso, rule_trees
from rebt_ros.paper.rules import dt_to_rules_psa
from rebt_ros.study.mode import Mode


def main_tree(mode: Mode, trained: TrainedTree) -> nodes.Node:
    """The behavior tree of a decision tree, without suggestions."""
    match mode:
        case Mode.BASELINE:
            return re_bt_espresso.bt_espresso(trained.tree)
        case Mode.PAPER:
            return convert(trained, LearnOptions.paper(), psa=True)
        case Mode.DEFAULT:
            # PSA nodes are suggested; in the main tree they are only where they raise agreement.
            return convert(trained, DEFAULTS, psa=False)


def plain_tree(mode: Mode, tree: DecisionTree, main: nodes.Node) -> nodes.Node:
    """The main tree without any SAES, as its size is compared (paper, IV-B).

    Args:
        mode: Which way.
        tree: The decision tree.
        main: What `main_tree` made of it.
    """
    if mode is Mode.PAPER:
        return rule_trees.main_tree(dt_to_rules_psa(tree, 0.0))
    return main
