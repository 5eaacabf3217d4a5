"""What is noticeable about a tree without any rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification.acting import acting_leaves
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.proof import grid_of, policies_of
from rebt_ros.verification.reference import of_tree
from rebt_ros.verification.states import possible_boxes
from rebt_ros.verification.sweep import Results, Sweep, Ticks, Visits, remembers, sweep


@dataclass(frozen=True, eq=False, slots=True)
class Findings:
    """What is noticeable about the tree of one channel."""

    channel: str
    grid: Grid
    dead: tuple[nodes.Node, ...]
    """Nodes that no tick can reach, without those below them."""
    pointless: tuple[nodes.Condition, ...]
    """Conditions that always succeed, or always fail, where they are reached."""
    idle: Boxes
    """The states in which a first tick commands nothing."""
    never_chosen: tuple[nodes.Action, ...]
    """Actions that were shown and that no tick can command."""
    never_shown: tuple[tuple[nodes.Action, Boxes], ...]
    """Action leaves that act in no row that was shown, with the states in which they do; empty
    where rows are not at hand."""


def find(
    learned: LearnedTree,
    tables: Sequence[DemonstrationTable] = (),
    results: Results = Results.AT_ONCE,
) -> tuple[Findings, ...]:
    """What is noticeable about a tree, channel by channel.

    Args:
        learned: The tree.
        tables: What was shown, with the features of the tree.
        results: How actions end.

    Raises:
        RuleError: The tree cannot be checked.
    """
    of_channel = {table.channel: table for table in tables}
    return tuple(
        _findings(learned, channel, tree, of_channel.get(channel), results)
        for channel, tree in policies_of(learned).items()
    )


def _findings(
    learned: LearnedTree,
    channel: str,
    tree: nodes.Node,
    table: DemonstrationTable | None,
    results: Results,
) -> Findings:
    grid = grid_of(learned, [tree])
    first = sweep(tree, grid, results, Ticks.FIRST, visits=True)
    # What can happen at all; a first tick is one of the ticks.
    possible = (
        sweep(tree, grid, results, Ticks.ANY, visits=True) if remembers(tree, results) else first
    )
    taken = {possible.leaves[leaf] for leaf in set(possible.commanding.tolist()) if leaf >= 0}
    shown = [action for action in learned.actions if action.channel == channel]
    idle = first.boxes[:, first.commanding < 0]
    return Findings(
        channel,
        grid,
        tuple(_dead(tree, possible.visits)),
        tuple(_pointless(tree, possible.visits)),
        possible_boxes(idle, grid, learned.features, of_tree(learned, channel))[0],
        tuple(one for one in shown if one not in taken),
        () if table is None else _never_shown(tree, first, table),
    )


def _dead(tree: nodes.Node, visits: Sequence[Visits]) -> list[nodes.Node]:
    in_order = list(nodes.walk(tree))
    dead: list[nodes.Node] = []
    place = 0
    while place < len(in_order):
        if visits[place].reached:
            place += 1
        else:
            dead.append(in_order[place])
            place += nodes.size(in_order[place])
    return dead


def _pointless(tree: nodes.Node, visits: Sequence[Visits]) -> list[nodes.Condition]:
    return [
        node
        for node, visit in zip(nodes.walk(tree), visits, strict=True)
        if isinstance(node, nodes.Condition)
        and visit.reached
        and not (visit.succeeded and visit.failed)
    ]


def _never_shown(
    tree: nodes.Node, first: Sweep, table: DemonstrationTable
) -> tuple[tuple[nodes.Action, Boxes], ...]:
    acting = set(acting_leaves(tree, table).tolist())
    return tuple(
        (leaf, first.boxes[:, first.commanding == place])
        for place, leaf in enumerate(first.leaves)
        if place not in acting and (first.commanding == place).any()
    )
