"""Suggested alternate expressive subtrees (SAES): what is offered.

Suggestions overlap with the main tree, so nothing is attached until the user asks for it.
"""

from __future__ import annotations

from collections.abc import Iterable

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Suggestion, SuggestionKind
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.factoring import pull_out_common
from rebt_ros.paper.lat_trees import LatTree
from rebt_ros.paper.rule_trees import FactoredRule, rule_tree
from rebt_ros.paper.rules import Rule


def psa_suggestions(
    rules: Iterable[Rule], inv_set: frozenset[Literal] = frozenset()
) -> tuple[Suggestion, ...]:
    """The tree of each rule with several δ-close actions, the best supported first.

    Args:
        rules: Minimized and float-reduced; their support is in training rows.
        inv_set: Literals to show as Inverters (Algorithm 1, line 3).
    """
    groups = sorted((rule for rule in rules if len(rule.actions) > 1), key=lambda one: -one.support)
    return _numbered(
        (
            SuggestionKind.PSA,
            group.support,
            rule_tree(FactoredRule(group.actions, pull_out_common(group.dnf)), inv_set),
        )
        for group in groups
    )


def lat_suggestions(trees: Iterable[LatTree]) -> tuple[Suggestion, ...]:
    """LAT Sequences and Repeaters in the order of the trees; a path of one cycle is a Repeater."""
    return _numbered(
        (
            SuggestionKind.LAT_REPEATER
            if isinstance(tree.subtree, nodes.Repeater)
            else SuggestionKind.LAT_SEQUENCE,
            tree.support,
            tree.subtree,
        )
        for tree in trees
    )


def routine_suggestions(found: Iterable[FoundRoutine]) -> tuple[Suggestion, ...]:
    """Suggestions of routines, in the order of the routines."""
    return _numbered(
        (
            SuggestionKind.REPEATER
            if isinstance(one.subtree, nodes.Repeater)
            else SuggestionKind.SEQUENCE,
            one.support,
            one.subtree,
        )
        for one in found
    )


def _numbered(
    offered: Iterable[tuple[SuggestionKind, int, nodes.Node]],
) -> tuple[Suggestion, ...]:
    """Suggestions with ids such as ``lat-sequence-1``, counted by kind."""
    counted = dict.fromkeys(SuggestionKind, 0)
    suggestions = []
    for kind, support, subtree in offered:
        counted[kind] += 1
        name = f"{kind.value.replace('_', '-')}-{counted[kind]}"
        suggestions.append(Suggestion(name, kind, support, subtree))
    return tuple(suggestions)
