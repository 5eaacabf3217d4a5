"""From a decision tree to rules, one for each action (Algorithm 1, line 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.tree import DecisionTree, Leaf
from rebt_ros.logic.conditions import deciding
from rebt_ros.logic.dnf import Conjunction, Dnf


@dataclass(frozen=True, slots=True)
class Rule:
    """A DNF with the action, or the set of δ-close actions (PSA), that it triggers."""

    actions: tuple[Action, ...]
    """One action, or those of a PSA group, the best supported first."""
    dnf: Dnf
    support: int
    """Training rows in its leaves."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the actions."""
        return tuple(action.label for action in self.actions)


def dt_to_rules(tree: DecisionTree) -> tuple[Rule, ...]:
    """BT-Espresso's rules: each leaf triggers its most probable action.

    Returns:
        As for `dt_to_rules_psa`.
    """
    return tuple(map(in_its_own_words, leaf_rules(tree, lambda leaf: (leaf.most_probable,))))


def dt_to_rules_psa(tree: DecisionTree, delta: float) -> tuple[Rule, ...]:
    """RE:BT-Espresso's rules: each leaf triggers all its δ-close actions together.

    Args:
        tree: The decision tree.
        delta: In [0, 1]; a leaf's actions with a share of at least ``(1 - delta)`` of its largest
            share are δ-close (paper, III-B).  0 keeps exact ties only.

    Returns:
        Rules that together cover every state, each leaf in one of them; the best supported first.
        Their LAT conditions are relative to their own actions.
    """
    return tuple(map(in_its_own_words, leaf_rules(tree, lambda leaf: delta_close(leaf, delta))))


def delta_close(leaf: Leaf, delta: float) -> tuple[int, ...]:
    """Positions of the leaf's δ-close actions, ascending.

    >>> delta_close(Leaf((7, 10, 0)), 0.3)
    (0, 1)
    """
    # The tolerance is for the rounding of 1 - delta; counts are whole numbers.
    least = (1 - delta) * max(leaf.distribution) - 1e-9
    return tuple(
        action for action, rows in enumerate(leaf.distribution) if rows > 0 and rows >= least
    )


def leaf_rules(
    tree: DecisionTree, triggered: Callable[[Leaf], tuple[int, ...]]
) -> tuple[Rule, ...]:
    """The rules of a decision tree whose leaves trigger what `triggered` says.

    LAT is still the decision tree's column, one variable for all rules.
    """
    leaves: dict[tuple[int, ...], list[tuple[Conjunction, Leaf]]] = {}
    for conjunction, leaf in tree.paths():
        leaves.setdefault(triggered(leaf), []).append((conjunction, leaf))
    rules = [_rule(tree, group, paths) for group, paths in leaves.items()]
    return tuple(sorted(rules, key=lambda rule: -rule.support))


def _rule(
    tree: DecisionTree, group: tuple[int, ...], paths: list[tuple[Conjunction, Leaf]]
) -> Rule:
    support = [sum(leaf.distribution[one] for _, leaf in paths) for one in group]
    # sorted() is stable: of equally supported actions, the one that the decision tree itself
    # would choose comes first.
    ranked = sorted(zip(support, group, strict=True), key=lambda pair: -pair[0])
    actions = tuple(tree.actions[one] for _, one in ranked)
    rows = sum(sum(leaf.distribution) for _, leaf in paths)
    return Rule(actions, Dnf(tuple(conjunction for conjunction, _ in paths)), rows)


def in_its_own_words(rule: Rule) -> Rule:
    """The rule with LAT relative to its own actions: the last action that is none of them."""
    return Rule(
        rule.actions,
        Dnf(
            tuple(
                Conjunction(tuple(deciding(literal, rule.labels) for literal in conjunction))
                for conjunction in rule.dnf
            )
        ),
        rule.support,
    )
