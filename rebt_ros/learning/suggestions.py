"""Suggested alternate expressive subtrees (SAES): what to offer, and how to accept it.

Suggestions overlap with the main tree, so that nothing is attached until the user asks for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import Enum

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root, Suggestion, SuggestionKind
from rebt_ros.beyond_the_paper.routines.finding import FoundRoutine
from rebt_ros.errors import OptionError
from rebt_ros.logic.conditions import Literal
from rebt_ros.logic.factoring import pull_out_common
from rebt_ros.paper.lat_trees import LatTree
from rebt_ros.paper.rule_trees import rule_tree, with_root
from rebt_ros.paper.rules import FactoredRule, Rule

#: Stands for the ids of all suggestions.
ALL = "all"


class PsaChoice(Enum):
    """What a PSA node is turned into."""

    SELECTOR = "selector"
    """Its actions are alternatives, the best supported first."""
    PARALLEL = "parallel"
    """Its actions are run together."""


def psa_suggestions(
    rules: Iterable[Rule], inv_set: frozenset[Literal] = frozenset()
) -> tuple[Suggestion, ...]:
    """The tree of each rule with several δ-close actions, the best supported first.

    Args:
        rules: Minimized and float-reduced; their support is in training rows.
        inv_set: Literals to be shown as Inverters (Algorithm 1, line 3).
    """
    groups = sorted((one for one in rules if len(one.actions) > 1), key=lambda one: -one.support)
    return _numbered(
        (
            SuggestionKind.PSA,
            one.support,
            rule_tree(FactoredRule(one.actions, pull_out_common(one.dnf)), inv_set),
        )
        for one in groups
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
    """Routines in their order."""
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


def mark(suggestions: Iterable[Suggestion], ids: Iterable[str]) -> tuple[Suggestion, ...]:
    """The suggestions, those with the given ids (or all, for `ALL`) said to be attached.

    Raises:
        OptionError: There is no suggestion with such an id.
    """
    suggestions, wanted = tuple(suggestions), set(ids)
    unknown = sorted(wanted - {one.id for one in suggestions} - {ALL})
    if unknown:
        known = ", ".join(one.id for one in suggestions)
        raise OptionError(
            f"there is no suggestion {unknown[0]!r} to attach: "
            + (f"choose of {known}, or {ALL}." if known else "nothing was suggested.")
        )
    return tuple(
        replace(one, attached=one.attached or one.id in wanted or ALL in wanted)
        for one in suggestions
    )


def attach(
    tree: nodes.Node,
    suggestions: Iterable[Suggestion],
    ids: Iterable[str] = (ALL,),
    *,
    root: Root = Root.SELECTOR,
    in_front: bool = False,
) -> nodes.Node:
    """The main tree with suggested subtrees under its root (Algorithm 1, lines 29 to 32).

    Args:
        tree: The main tree.
        suggestions: What there is; those that are marked as attached are in the tree already.
        ids: Which of them to attach, whatever the order; `ALL` for all.
        root: Kind of the root to put over a main tree that is a single rule.
        in_front: Whether they come before the rules instead of behind them, as in the paper.
            Under a Selector root the rules cover every state, so that what stands behind them is
            reached only when an action fails.

    Raises:
        OptionError: There is no suggestion with such an id.
    """
    suggestions = tuple(suggestions)
    subtrees = tuple(
        after.subtree
        for before, after in zip(suggestions, mark(suggestions, ids), strict=True)
        if after.attached and not before.attached
    )
    match tree:
        case nodes.Parallel(children=rules) | nodes.Selector(children=rules):
            return replace(tree, children=(*subtrees, *rules) if in_front else (*rules, *subtrees))
        case _:
            return with_root(root, (*subtrees, tree) if in_front else (tree, *subtrees))


def resolve(tree: nodes.Node, choice: PsaChoice) -> nodes.Node:
    """The tree with every PSA node turned into what the user chose."""
    children = tuple(resolve(child, choice) for child in nodes.children(tree))
    match tree:
        case nodes.ParallelSelector():
            selects = choice is PsaChoice.SELECTOR
            return nodes.Selector(children) if selects else nodes.Parallel(children)
        case _:
            return _with_children(tree, children)


def going_on_after_loops(tree: nodes.Node) -> nodes.Node:
    """The tree in which a Sequence goes on when a Repeater in it has ended.

    A Repeater ends by failing, and with it fails the Sequence around it (paper, III-B), so that the
    steps behind the Repeater are never reached.  Here an Inverter stands over each Repeater that
    something follows in a Sequence, or in the next pass of another Repeater.  A loop whose first
    condition fails at once then counts as ended, too.
    """
    children = tuple(going_on_after_loops(child) for child in nodes.children(tree))
    match tree:
        case nodes.Sequence():
            *followed, last = children
            return replace(tree, children=(*map(_succeeding, followed), last))
        case nodes.Repeater():
            return replace(tree, children=tuple(map(_succeeding, children)))
        case _:
            return _with_children(tree, children)


def _succeeding(step: nodes.Node) -> nodes.Node:
    return nodes.Inverter(step) if isinstance(step, nodes.Repeater) else step


def _with_children(tree: nodes.Node, children: Sequence[nodes.Node]) -> nodes.Node:
    match tree:
        case nodes.Condition() | nodes.Action():
            return tree
        case nodes.Inverter():
            return nodes.Inverter(*children)
        case _:
            return replace(tree, children=tuple(children))


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
