"""RE:BT-Espresso (paper, Algorithm 1) and its baseline BT-Espresso, built from the same steps.

Differences from the printed algorithm, which change no behavior:

- A Selector or Sequence with a single child is replaced by the child.
- LAT trees are returned beside the main tree, not under its root: "an end user is needed to
  manually edit and add the subtrees" (paper, III-B); `learning.suggestions.attach` adds them.

By default, the package runs neither: `beyond_the_paper.priority_root` makes a smaller tree with the
same behavior from the same rules.  `LearnOptions.paper()` asks for Algorithm 1.
"""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.logic import factoring
from rebt_ros.paper.lat_occurrences import Runs
from rebt_ros.paper.lat_trees import LatTrees, gen_lat_trees
from rebt_ros.paper.rule_trees import (
    FactoredRule,
    build_inv_set,
    logic_minimizer,
    pullout_common,
    reduce_floats,
    rule_tree,
    with_root,
)
from rebt_ros.paper.rules import dt_to_rules, dt_to_rules_psa


@dataclass(frozen=True, slots=True)
class MainAndLatTrees:
    """The result of Algorithm 1."""

    main: nodes.Node
    """A Parallel over one subtree per rule, each of which triggers its action, or its PSA node,
    exactly where the decision tree's leaf does."""
    lat: LatTrees
    """What the paper adds to the root, and offers to the user as SAES."""


def re_bt_espresso(dt: DecisionTree, shown: Runs = (), *, delta: float = 0.3) -> MainAndLatTrees:
    """Algorithm 1: converts a decision tree into a behavior tree.

    Args:
        dt: The decision tree.
        shown: The actions of each demonstration, which rank the LAT trees; the paper has only the
            rules.
        delta: Threshold of δ-close actions, in [0, 1] (paper: 0.3).
    """
    rules = dt_to_rules_psa(dt, delta)  # line 2
    inv_set = build_inv_set(rules)  # line 3
    rule_dnfs = logic_minimizer(rules)  # line 4
    rule_dnfs = reduce_floats(rule_dnfs)  # line 5
    factored = pullout_common(rule_dnfs)  # line 6
    root = with_root(Root.PARALLEL, [rule_tree(dnf, inv_set) for dnf in factored])  # lines 7 to 28
    lat_trees = gen_lat_trees(rule_dnfs, shown, inv_set=inv_set)  # line 29
    return MainAndLatTrees(root, lat_trees)  # lines 30 to 33


def bt_espresso(dt: DecisionTree) -> nodes.Node:
    """The baseline: most probable actions, no Inverters, no reductions (French et al., 2019)."""
    rules = logic_minimizer(dt_to_rules(dt))
    unfactored = [FactoredRule(rule.actions, factoring.unfactored(rule.dnf)) for rule in rules]
    return with_root(Root.PARALLEL, [rule_tree(rule, frozenset()) for rule in unfactored])
