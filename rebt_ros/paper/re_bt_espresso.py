"""RE:BT-Espresso (paper, Algorithm 1) and its baseline BT-Espresso, made of the same steps.

Differences from the printed algorithm, which change no behavior:

- A Selector or Sequence with a single child is left out: the child stands in its place.
- The root can be a memoryless Selector.  The paper allows for it; unlike a Parallel, which fails
  as soon as one child fails, it can be executed when actions take longer than a tick.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.errors import OptionError
from rebt_ros.logic import factoring, float_reduction, inverses, minimize
from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.factoring import Factored
from rebt_ros.paper.rules import FactoredRule, Rule, dt_to_rules, dt_to_rules_psa


def re_bt_espresso(
    dt: DecisionTree, *, delta: float | None = 0.3, root: Root = Root.PARALLEL
) -> nodes.Node:
    """Algorithm 1: converts a decision tree into a behavior tree.

    Args:
        dt: The decision tree.
        delta: Threshold of δ-close actions, in [0, 1] (paper: 0.3); None to trigger the most
            probable action alone, and so to have no PSA nodes, which the paper offers as SAES.
        root: Kind of the root node (paper: Parallel).

    Returns:
        The main tree: a root over one subtree per rule, each of which triggers its action, or its
        PSA node, exactly where the decision tree's leaf does.
    """
    rules = dt_to_rules(dt) if delta is None else dt_to_rules_psa(dt, delta)  # line 2
    inv_set = build_inv_set(rules)  # line 3
    rules = logic_minimizer(rules)  # line 4
    rules = reduce_floats(rules)  # line 5
    factored = pullout_common(rules)  # line 6
    return with_root(root, [rule_tree(rule, inv_set) for rule in factored])  # lines 7 to 28


def bt_espresso(dt: DecisionTree, *, root: Root = Root.PARALLEL) -> nodes.Node:
    """The baseline: most probable actions, no Inverters, no reductions (French et al., 2019)."""
    rules = dt_to_rules(dt)
    rules = logic_minimizer(rules)
    unfactored = [FactoredRule(rule.actions, factoring.unfactored(rule.dnf)) for rule in rules]
    return with_root(root, [rule_tree(rule, frozenset()) for rule in unfactored])


def build_inv_set(rules: Iterable[Rule]) -> frozenset[Literal]:
    """BUILD_INV_SET: literals to be shown as the inverse of another one."""
    return inverses.build_inv_set(rule.dnf for rule in rules)


def logic_minimizer(rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """LOGIC_MINIMIZER: the rules with espresso's DNFs."""
    return tuple(Rule(one.actions, minimize.minimize(one.dnf), one.support) for one in rules)


def reduce_floats(rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """FLOAT_REDUCTION: the rules without subsumed thresholds."""
    return tuple(
        Rule(one.actions, float_reduction.float_reduction(one.dnf), one.support) for one in rules
    )


def pullout_common(rules: Iterable[Rule]) -> tuple[FactoredRule, ...]:
    """PULLOUT_COMMON: the rules with the literals that all their conjunctions share in front."""
    return tuple(FactoredRule(one.actions, factoring.pull_out_common(one.dnf)) for one in rules)


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
