"""The ways to make trees that are compared, and which subtrees they offer at a pruning level.

All modes share one decision tree, as in the paper: with LAT, of depth 5, from all rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.attaching import accept
from rebt_ros.learning.options import ALL, DEFAULTS, LearnOptions
from rebt_ros.learning.suggesting import suggest
from rebt_ros.paper.lat_occurrences import Occurrences
from rebt_ros.study.mode import Mode
from rebt_ros.study.settings import MAX_DEPTH, MOST_SUGGESTIONS


@dataclass(frozen=True, slots=True)
class Offer:
    """What a mode offers at one pruning level."""

    subtrees: tuple[nodes.Node, ...]
    """The generated subtrees: those under the root, then the suggestions, best supported first."""
    suggestions: int
    """How many of them are suggestions."""


def offer(
    mode: Mode,
    table: DemonstrationTable,
    trained: TrainedTree,
    main: nodes.Node,
    ccp_alpha: float,
    routines: Sequence[FoundRoutine],
    occurrences: Occurrences,
) -> Offer:
    """The generated subtrees of a pruning level.

    Args:
        mode: Which way.
        table: What was learned from.
        trained: The decision tree, pruned.
        main: What `main_tree` made of it.
        ccp_alpha: How far it is pruned.
        routines: What was found in the table, for the default.
        occurrences: In the table.
    """
    if mode is Mode.BASELINE:
        return Offer(under_root(main), 0)
    if mode is Mode.PAPER:
        options = replace(LearnOptions.paper(), attach=(ALL,))
        suggestions, _ = suggest(table, trained, ccp_alpha, options, occurrences=occurrences)
        attached, _ = accept(main, suggestions, options)
        # A single rule gets a root once something is attached.
        return Offer(under_root(attached), len(suggestions))
    options = replace(DEFAULTS, max_depth=MAX_DEPTH)
    suggestions, _ = suggest(table, trained, ccp_alpha, options, routines, occurrences)
    if len(suggestions) > MOST_SUGGESTIONS:
        raise AssertionError(f"{len(suggestions)} suggestions by default")
    subtrees = tuple(suggestion.subtree for suggestion in suggestions)
    return Offer((*under_root(main), *subtrees), len(suggestions))


def under_root(tree: nodes.Node) -> tuple[nodes.Node, ...]:
    """The subtrees of a learned tree: one for each rule.

    A tree of a single rule has no root of its own and is its only subtree.
    """
    match tree:
        case nodes.Parallel(children=children) | nodes.Selector(children=children):
            return children
        case _:
            return (tree,)
