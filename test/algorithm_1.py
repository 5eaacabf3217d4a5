"""The main tree of Algorithm 1, with or without PSA nodes, under any root."""

from __future__ import annotations

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.paper.rule_trees import main_tree
from rebt_ros.paper.rules import dt_to_rules, dt_to_rules_psa


def algorithm_1(
    dt: DecisionTree, *, delta: float | None = 0.3, root: Root = Root.PARALLEL
) -> nodes.Node:
    """The tree over the rules of a decision tree; those of single actions if delta is None."""
    return main_tree(dt_to_rules(dt) if delta is None else dt_to_rules_psa(dt, delta), root)
