"""Lines 7 to 28 of Algorithm 1: rules as trees, and a root over them."""

from __future__ import annotations

from collections.abc import Sequence

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.errors import OptionError
from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.factoring import Factored
from rebt_ros.paper.rules import FactoredRule


def rule_tree(rule: FactoredRule, inv_set: frozenset[Literal]) -> nodes.Node:
    """Lines 9 to 26: a Sequence of the rule's condition and its action."""
    return sequence([*condition_trees(rule.condition, inv_set), action_tree(rule.actions)])


def action_tree(actions: tuple[nodes.Action, ...]) -> nodes.Node:
    """Line 10: the action, or the PSA node over several."""
    return actions[0] if len(actions) == 1 else nodes.ParallelSelector(actions)


def with_root(root: Root, children: Sequence[nodes.Node]) -> nodes.Node:
    """Line 7: the rule trees under the root.

    Raises:
        OptionError: A Sequence over several rules, no two of which ever hold in the same state.
    """
    if len(children) == 1:
        return children[0]
    match root:
        case Root.PARALLEL:
            return nodes.Parallel(tuple(children))
        case Root.SELECTOR:
            return nodes.Selector(tuple(children))
        case Root.SEQUENCE:
            raise OptionError(
                f"a Sequence root would fail in every state, as no two of the {len(children)} "
                "rules hold in the same one: choose selector or parallel."
            )


def condition_trees(condition: Factored, inv_set: frozenset[Literal]) -> list[nodes.Node]:
    """Lines 14 to 26: what must succeed, one after the other, before the action."""
    trees: list[nodes.Node] = [_literal_tree(literal, inv_set) for literal in condition.common]
    if condition.alternatives:
        alternatives = [sequence(condition_trees(one, inv_set)) for one in condition.alternatives]
        trees.append(nodes.Selector(tuple(alternatives)))
    return trees


def _literal_tree(literal: Literal, inv_set: frozenset[Literal]) -> nodes.Node:
    """Lines 17 to 23."""
    if inv_set and literal in inv_set:
        return nodes.Inverter(nodes.Condition(~literal))
    return nodes.Condition(literal)


def sequence(children: Sequence[nodes.Node]) -> nodes.Node:
    """A Sequence of the children, or the only child itself."""
    return children[0] if len(children) == 1 else nodes.Sequence(tuple(children))
