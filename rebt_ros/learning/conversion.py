"""From a decision tree to the behavior tree that the options ask for, and to its choices."""

from __future__ import annotations

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning import evaluation
from rebt_ros.learning.options import LearnOptions
from rebt_ros.paper.rule_trees import main_tree
from rebt_ros.paper.rules import delta_close, dt_to_rules, dt_to_rules_psa, leaf_rules


def convert(trained: TrainedTree, options: LearnOptions, *, psa: bool) -> nodes.Node:
    """The behavior tree of a decision tree.

    Raises:
        OptionError: The root asked for makes no sense.
    """
    dt, delta = trained.tree, options.delta
    if options.reductions is None:
        return main_tree(dt_to_rules_psa(dt, delta) if psa else dt_to_rules(dt), options.root)
    rules = leaf_rules(dt, lambda leaf: delta_close(leaf, delta) if psa else (leaf.most_probable,))
    return reduced_tree(rules, options.reductions, options.root)


def own_history_choices(
    trained: TrainedTree, table: DemonstrationTable, options: LearnOptions, *, psa: bool
) -> IntArray:
    """What the behavior tree of a decision tree chooses after its own choices.

    It need not be made, which takes long, unless LAT or PSA nodes come with a history: it chooses
    what the leaf of the decision tree does, or the best supported one of the leaf's PSA group.
    """
    history = trained.vocabulary.history
    if history is History.LAST or (psa and history is not History.NONE):
        return evaluation.own_history_choices(convert(trained, options, psa=psa), table)
    if not psa:
        return evaluation.decision_tree_choices(trained.predict, trained.vocabulary.history, table)
    rules = leaf_rules(trained.tree, lambda leaf: delta_close(leaf, options.delta))
    place = {action: position for position, action in enumerate(trained.tree.actions)}
    first = {
        frozenset(place[one] for one in rule.actions): place[rule.actions[0]] for rule in rules
    }
    leaves, of_row = trained.deciding(table)
    chosen = [first[frozenset(delta_close(leaf, options.delta))] for leaf in leaves]
    return np.array(chosen, dtype=np.int64)[of_row]
