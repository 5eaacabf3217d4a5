"""Beyond the paper: smaller trees with the same behavior.

Infeasible combinations of conditions are don't-cares, factoring is repeated, the children of a
Selector root are in priority order, and two thresholds become one interval.

Under the paper's root, each rule must hold in exactly its own states.  Under a Selector, a child is
reached only if all earlier ones failed, so the states that these take are don't-cares of its
minimization.  The last child is reached only in its own states and needs no condition.  The result
chooses what the decision tree predicts, in every state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.beyond_the_paper.reductions import (
    ALL_REDUCTIONS,
    MOST_LEAVES_IN_BEST_ORDER,
    MOST_LEAVES_MINIMIZED,
    Reductions,
)
from rebt_ros.logic.conditions import deciding
from rebt_ros.logic.dnf import Dnf, conditions_of
from rebt_ros.logic.domain import infeasible, spelled_out
from rebt_ros.logic.factoring import Factored, FactoredCodes, factored, named, pulled_out
from rebt_ros.logic.float_reduction import implied_literals, reduced
from rebt_ros.logic.intervals import enclosing_literals, intervals_among, with_intervals
from rebt_ros.logic.literal_codes import Codes, Numbering
from rebt_ros.logic.minimize import cubes, minimized_cover
from rebt_ros.paper.rule_trees import FactoredRule, rule_tree, with_root
from rebt_ros.paper.rules import Rule

#: Up to this many rules, the best order is found; up to the second number, a greedy one; beyond it,
#: rules are ordered by their number of leaves, since a search takes a minimization per pair.
_MOST_RULES_IN_ANY_ORDER, _MOST_RULES_STEP_BY_STEP = 6, 16

#: Minimum number of nodes of a rule with a condition: a Sequence, the condition and an action.
_LEAST_COST = 3


def reduced_tree(
    rules: Sequence[Rule],
    reductions: Reductions = ALL_REDUCTIONS,
    root: Root = Root.SELECTOR,
) -> nodes.Node:
    """The rules as a tree, with the requested reductions.

    Args:
        rules: From `leaf_rules`: no two share a state, and together they cover all states.
        reductions: What to do, as far as the tree's size allows (see `Reductions.made_in`);
            priority is only for Selectors.
        root: Kind of the root node.
    """
    leaves = sum(len(rule.dnf) for rule in rules)
    numbering = Numbering(conditions_of(_union(rule.dnf for rule in rules)))
    implied = implied_literals(numbering.conditions)
    covers = [numbering.cover(rule.dnf) for rule in rules]
    is_minimized = leaves <= MOST_LEAVES_MINIMIZED
    width = len(numbering.conditions)
    inside = [cubes(cover, width) for cover in covers] if is_minimized else []
    impossible = cubes((), width)
    outside = inside
    if reductions.made_in(leaves).domain:
        impossible = cubes(numbering.cover(infeasible(numbering.conditions)), width)
        spelled = (spelled_out(rule.dnf, numbering.conditions) for rule in rules)
        outside = [cubes(numbering.cover(one), width) for one in spelled]

    @cache
    def condition(rule: int, earlier: frozenset[int]) -> FactoredCodes:
        minimized: Sequence[Codes] = covers[rule]
        if is_minimized:
            later = [one for one in range(len(rules)) if one != rule and one not in earlier]
            minimized = minimized_cover(
                inside[rule],
                dont_care=[*(inside[one] for one in sorted(earlier)), impossible],
                off=[outside[one] for one in later],
            )
        return (factored if reductions.repeated_factoring else pulled_out)(
            reduced(minimized, implied)
        )

    def cost(rule: int, earlier: frozenset[int]) -> int:
        return size_of(condition(rule, earlier), len(rules[rule].actions), enclosing)

    enclosing = enclosing_literals(numbering.conditions) if reductions.intervals else None
    order: Sequence[int] = range(len(rules))
    by_priority = reductions.priority and root is Root.SELECTOR
    if by_priority:
        order = (
            _best_order(len(rules), cost)
            if len(rules) <= _MOST_RULES_STEP_BY_STEP and leaves <= MOST_LEAVES_IN_BEST_ORDER
            else sorted(order, key=lambda rule: len(rules[rule].dnf))
        )
    trees = []
    for place, rule in enumerate(order):
        found = condition(rule, frozenset(order[:place]) if by_priority else frozenset())
        trees.append(_child(rules[rule].actions, named(found, numbering), reductions))
    return with_root(root, trees)


def size_of(condition: FactoredCodes, actions: int, enclosing: Sequence[int] | None) -> int:
    """Number of nodes of a rule's tree, without building it.

    Args:
        condition: Condition of the rule; float-reduced.
        actions: Number of actions that it triggers.
        enclosing: From `enclosing_literals`; None if thresholds do not become intervals.
    """
    children, found = _extent(condition, enclosing)
    return _under_one(children + 1, found + actions + (actions > 1))


def _extent(condition: FactoredCodes, enclosing: Sequence[int] | None) -> tuple[int, int]:
    """Number of trees of a condition, and of their nodes in total."""
    children = len(condition.common)
    if enclosing is not None:
        children -= intervals_among(condition.common, enclosing)
    if not condition.alternatives:
        return children, children
    below = sum(
        _under_one(*_extent(alternative, enclosing)) for alternative in condition.alternatives
    )
    return children + 1, children + 1 + below


def _under_one(children: int, found: int) -> int:
    """The number of nodes with a Sequence over them, which a single child does not need."""
    return found if children == 1 else found + 1


def _cheapest(
    left: Sequence[int], earlier: frozenset[int], cost: Callable[[int, frozenset[int]], int]
) -> int:
    """The cheapest of the rules that are left; of equals, the first."""
    costs: dict[int, int] = {}
    for rule in left:
        costs[rule] = cost(rule, earlier)
        if costs[rule] == _LEAST_COST:
            break
    return min(costs, key=costs.__getitem__)


def _child(
    actions: tuple[nodes.Action, ...], condition: Factored, reductions: Reductions
) -> nodes.Node:
    if reductions.intervals:
        condition = with_intervals(condition)
    labels = tuple(action.label for action in actions)
    return rule_tree(FactoredRule(actions, _meant_by(labels, condition)), frozenset())


def _best_order(rules: int, cost: Callable[[int, frozenset[int]], int]) -> tuple[int, ...]:
    """The order with the lowest total cost, or a good one if there are many rules.

    Args:
        rules: Number of rules.
        cost: Cost of a rule after the set of those before it.
    """
    if rules > _MOST_RULES_IN_ANY_ORDER:
        order: tuple[int, ...] = ()
        while len(order) < rules:
            earlier = frozenset(order)
            left = [rule for rule in range(rules) if rule not in earlier]
            order = (*order, _cheapest(left, earlier, cost))
        return order
    # The cost after a set of rules does not depend on their order: dynamic programming over sets.
    best: dict[frozenset[int], tuple[int, tuple[int, ...]]] = {frozenset(): (0, ())}
    for _ in range(rules):
        longer: dict[frozenset[int], tuple[int, tuple[int, ...]]] = {}
        for earlier, (total, order) in best.items():
            for rule in range(rules):
                if rule not in earlier:
                    extended = (total + cost(rule, earlier), (*order, rule))
                    key = earlier | {rule}
                    longer[key] = min(longer.get(key, extended), extended)
        best = longer
    return best[frozenset(range(rules))][1]


def _union(dnfs: Iterable[Dnf]) -> Dnf:
    return Dnf(tuple(conjunction for dnf in dnfs for conjunction in dnf))


def _meant_by(actions: tuple[str, ...], condition: Factored) -> Factored:
    """The condition as a rule for these actions means it."""
    return Factored(
        tuple(deciding(literal, actions) for literal in condition.common),
        tuple(_meant_by(actions, alternative) for alternative in condition.alternatives),
    )
