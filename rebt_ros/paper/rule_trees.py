"""The steps of Algorithm 1: from rules to a tree (lines 3 to 28)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.errors import OptionError
from rebt_ros.logic import factoring, float_reduction, inverses, minimize
from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.factoring import Factored
from rebt_ros.paper.rules import Rule


@dataclass(frozen=True, slots=True)
class FactoredRule:
    """A rule whose DNF has been factored."""

    actions: tuple[nodes.Action, ...]
    condition: Factored


def main_tree(rules: Iterable[Rule], root: Root = Root.PARALLEL) -> nodes.Node:
    """Lines 3 to 28: the tree of rules, which may be those of single actions, under any root.

    A memoryless Selector root, which the paper allows, can be executed even if actions take longer
    than a tick.  A Parallel root cannot: it fails as soon as one child fails.

    Args:
        rules: From `dt_to_rules_psa`, or from `dt_to_rules` where PSA nodes are offered as SAES.
        root: Kind of the root node.
    """
    rules = tuple(rules)
    inv_set = build_inv_set(rules)
    factored = pullout_common(reduce_floats(logic_minimizer(rules)))
    return with_root(root, [rule_tree(rule, inv_set) for rule in factored])


def build_inv_set(rules: Iterable[Rule]) -> frozenset[Literal]:
    """BUILD_INV_SET: literals to show as the inverse of another one."""
    return inverses.build_inv_set(rule.dnf for rule in rules)


def logic_minimizer(rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """LOGIC_MINIMIZER: the rules with espresso's DNFs."""
    return tuple(Rule(rule.actions, minimize.minimize(rule.dnf), rule.support) for rule in rules)


def reduce_floats(rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """FLOAT_REDUCTION: the rules without subsumed thresholds."""
    return tuple(
        Rule(rule.actions, float_reduction.float_reduction(rule.dnf), rule.support)
        for rule in rules
    )


def pullout_common(rules: Iterable[Rule]) -> tuple[FactoredRule, ...]:
    """PULLOUT_COMMON: the rules, with literals that all their conjunctions share in front."""
    return tuple(FactoredRule(rule.actions, factoring.pull_out_common(rule.dnf)) for rule in rules)


def rule_tree(rule: FactoredRule, inv_set: frozenset[Literal]) -> nodes.Node:
    """Lines 9 to 26: a Sequence of the rule's condition and its action."""
    return sequence([*condition_trees(rule.condition, inv_set), action_tree(rule.actions)])


def action_tree(actions: tuple[nodes.Action, ...]) -> nodes.Node:
    """Line 10: the action, or the PSA node over several."""
    return actions[0] if len(actions) == 1 else nodes.ParallelSelector(actions)


def with_root(root: Root, children: Sequence[nodes.Node]) -> nodes.Node:
    """Line 7: the rule trees under the root.

    Raises:
        OptionError: The root is a Sequence over several rules, which never hold in the same state.
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
    """Lines 14 to 26: what must succeed, one after another, before the action."""
    trees: list[nodes.Node] = [_literal_tree(literal, inv_set) for literal in condition.common]
    if condition.alternatives:
        alternatives = [
            sequence(condition_trees(alternative, inv_set))
            for alternative in condition.alternatives
        ]
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
