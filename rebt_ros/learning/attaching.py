"""Accepting suggestions: attaching subtrees, and resolving PSA nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root, Suggestion
from rebt_ros.errors import OptionError
from rebt_ros.learning.options import ALL, LearnOptions, PsaChoice
from rebt_ros.paper.rule_trees import with_root


def accept(
    tree: nodes.Node, suggestions: tuple[Suggestion, ...], options: LearnOptions
) -> tuple[nodes.Node, tuple[Suggestion, ...]]:
    """The tree with the subtrees that the user attaches, and PSA nodes resolved as requested.

    In the paper's mode, subtrees are attached as printed.  Otherwise they come before the rules,
    which cover every state, and a Sequence continues after a loop in it has ended.

    Raises:
        OptionError: There is no suggestion with this id.
    """
    if options.attach:
        printed = options.is_paper
        runnable = tuple(
            suggestion
            if printed
            else replace(suggestion, subtree=going_on_after_loops(suggestion.subtree))
            for suggestion in suggestions
        )
        tree = attach(tree, runnable, options.attach, root=options.root, in_front=not printed)
    if options.psa_choice is not None:
        tree = resolve(tree, options.psa_choice)
    return tree, mark(suggestions, options.attach)


def mark(suggestions: Iterable[Suggestion], ids: Iterable[str]) -> tuple[Suggestion, ...]:
    """The suggestions; those with the given ids (all, for `ALL`) are marked as attached.

    Raises:
        OptionError: There is no suggestion with this id.
    """
    suggestions, wanted = tuple(suggestions), set(ids)
    unknown = sorted(wanted - {suggestion.id for suggestion in suggestions} - {ALL})
    if unknown:
        known = ", ".join(suggestion.id for suggestion in suggestions)
        raise OptionError(
            f"there is no suggestion {unknown[0]!r} to attach: "
            + (f"choose one of {known}, or {ALL}." if known else "nothing was suggested.")
        )
    return tuple(
        replace(
            suggestion, attached=suggestion.attached or suggestion.id in wanted or ALL in wanted
        )
        for suggestion in suggestions
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
        suggestions: All suggestions; those marked as attached are already in the tree.
        ids: Which of them to attach, in any order; `ALL` for all.
        root: Kind of the root that a main tree of a single rule gets.
        in_front: Whether they come before the rules, instead of after them as in the paper.  Under
            a Selector root the rules cover every state, so what follows them is reached only when
            an action fails.

    Raises:
        OptionError: There is no suggestion with this id.
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
    """The tree with every PSA node turned into the node that the user chose."""
    children = tuple(resolve(child, choice) for child in nodes.children(tree))
    match tree:
        case nodes.ParallelSelector():
            selects = choice is PsaChoice.SELECTOR
            return nodes.Selector(children) if selects else nodes.Parallel(children)
        case _:
            return _with_children(tree, children)


def going_on_after_loops(tree: nodes.Node) -> nodes.Node:
    """The tree, with Sequences that continue after a Repeater in them has ended.

    A Repeater ends by failing, and so does the Sequence around it (paper, III-B): the steps after
    the Repeater are never reached.  So each Repeater that is followed by something, in a Sequence
    or in the next pass of another Repeater, gets an Inverter.  A loop whose first condition fails
    at once then counts as ended too.
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
