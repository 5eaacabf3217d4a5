"""The ways to make trees that are compared, and which subtrees they offer at a pruning level.

All modes share one decision tree, as in the paper: with LAT, of depth 5, from all rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.routines.finding import FoundRoutine
from rebt_ros.decision_tree.training import TrainedTree
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.choice import convert
from rebt_ros.learning.options import DEFAULTS, LearnOptions
from rebt_ros.learning.suggesting import accept, suggest
from rebt_ros.learning.suggestions import ALL
from rebt_ros.paper import re_bt_espresso
from rebt_ros.paper.lat_occurrences import Occurrences
from rebt_ros.paper.rules import dt_to_rules_psa
from rebt_ros.study.settings import MAX_DEPTH, MOST_SUGGESTIONS


class Mode(Enum):
    """A way from a decision tree to generated subtrees."""

    BASELINE = "baseline"
    """BT-Espresso."""
    PAPER = "paper"
    """RE:BT-Espresso as printed, all suggestions attached to the root."""
    DEFAULT = "default"
    """What is learned without options: at most twelve suggestions beside the main tree."""


@dataclass(frozen=True, slots=True)
class Offer:
    """What a mode offers at one pruning level."""

    subtrees: tuple[nodes.Node, ...]
    """The generated subtrees: those under the root, then the suggestions, best supported first."""
    suggestions: int
    """How many of them are suggestions."""


def main_tree(mode: Mode, trained: TrainedTree) -> nodes.Node:
    """The behavior tree of a decision tree, without suggestions."""
    match mode:
        case Mode.BASELINE:
            return re_bt_espresso.bt_espresso(trained.tree)
        case Mode.PAPER:
            return convert(trained, LearnOptions.paper(), psa=True)
        case Mode.DEFAULT:
            # PSA nodes are suggested; in the main tree they are only where they raise agreement.
            return convert(trained, DEFAULTS, psa=False)


def plain_tree(mode: Mode, tree: DecisionTree, main: nodes.Node) -> nodes.Node:
    """The main tree without any SAES, as its size is compared (paper, IV-B).

    Args:
        mode: Which way.
        tree: The decision tree.
        main: What `main_tree` made of it.
    """
    if mode is Mode.PAPER:
        return re_bt_espresso.main_tree(dt_to_rules_psa(tree, 0.0))
    return main


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
    subtrees = tuple(one.subtree for one in suggestions)
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
