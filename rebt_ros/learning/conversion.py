"""From a decision tree to the requested behavior tree, and to its choices."""

from __future__ import annotations

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.beyond_the_paper.needless_conditions import without_needless_conditions
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning import evaluation
from rebt_ros.learning.options import LearnOptions
from rebt_ros.paper.rule_trees import main_tree
from rebt_ros.paper.rules import delta_close, dt_to_rules, dt_to_rules_psa, leaf_rules


def convert(trained: TrainedTree, options: LearnOptions, *, psa: bool) -> nodes.Node:
    """The behavior tree that does what a decision tree does, in every state.

    Raises:
        OptionError: The requested root makes no sense.
    """
    dt, delta = trained.tree, options.delta
    if options.reductions is None:
        return main_tree(dt_to_rules_psa(dt, delta) if psa else dt_to_rules(dt), options.root)
    rules = leaf_rules(dt, lambda leaf: delta_close(leaf, delta) if psa else (leaf.most_probable,))
    return reduced_tree(rules, options.reductions, options.root)


def leaves_out_conditions(trained: TrainedTree, options: LearnOptions) -> bool:
    """Whether conditions that no shown row needs are left out of a tree.

    The meaning of a condition on LAT depends on the rule that tests it, which rows do not tell.
    """
    reductions = options.reductions
    by_priority = reductions is not None and reductions.priority and options.root is Root.SELECTOR
    lat = trained.vocabulary.history is History.LAST
    return options.leave_out_conditions and by_priority and not lat


def convert_shown(
    trained: TrainedTree, options: LearnOptions, shown: DemonstrationTable, *, psa: bool
) -> nodes.Node:
    """The behavior tree of a decision tree, without conditions that no shown row needs.

    Args:
        trained: The decision tree.
        options: Whether such conditions are left out.
        shown: The rows that it was learned from.
        psa: Whether it has PSA nodes.
    """
    tree = convert(trained, options, psa=psa)
    if not leaves_out_conditions(trained, options):
        return tree
    return without_needless_conditions(tree, shown, kept_rows(trained, shown, psa=psa))


def kept_rows(trained: TrainedTree, shown: DemonstrationTable, *, psa: bool) -> BoolArray:
    """Rows in which leaving out conditions changes nothing, shape (rows,).

    A row that the decision tree gets wrong is no reason to keep a condition.
    """
    if psa:
        return np.ones(len(shown), dtype=bool)
    return np.asarray(trained.predict(shown) == shown.chosen)


def own_history_choices(
    trained: TrainedTree, table: DemonstrationTable, options: LearnOptions, *, psa: bool
) -> IntArray:
    """What the behavior tree of a decision tree chooses after its own choices.

    Making the behavior tree takes long, and is needed only for LAT, or for PSA nodes with a
    history.  Otherwise it chooses what the decision tree's leaf does, or the best supported action
    of the leaf's PSA group.
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
