"""Where two trees do different things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification.acting import acting_leaves
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.proof import grid_of, policies_of
from rebt_ros.verification.reference import of_tree
from rebt_ros.verification.states import possible_boxes
from rebt_ros.verification.sweep import Results, Sweep, Ticks, remembers, sweep


@dataclass(frozen=True, eq=False, slots=True)
class Divergence:
    """States in which one tree commands this, and the other one that."""

    mine: nodes.Action | None
    """None: nothing."""
    other: nodes.Action | None
    boxes: Boxes
    rows: int | None
    """How many rows that were shown lie there; None where rows are not at hand."""


@dataclass(frozen=True, eq=False, slots=True)
class Comparison:
    """Where two trees differ in a first tick, on one channel."""

    channel: str
    grid: Grid
    divergences: tuple[Divergence, ...]
    """Those in which most rows lie come first."""
    exact: bool
    """Whether all of these states exist: differences of features that no numbers have are left out,
    as far as it could be found out."""
    remembers: bool
    """Whether a tree remembers, so that later ticks may differ elsewhere as well."""


def compare(
    mine: LearnedTree, other: LearnedTree, tables: Sequence[DemonstrationTable] = ()
) -> tuple[Comparison, ...]:
    """Where two trees differ, channel by channel.

    Args:
        mine: A tree.
        other: Another one, of the same robot.
        tables: What was shown, with the features of the first tree.

    Raises:
        RuleError: They have different features, or cannot be checked.
    """
    _check_same_features(mine, other)
    of_channel = {table.channel: table for table in tables}
    first, second = policies_of(mine), policies_of(other)
    return tuple(
        _compared(mine, channel, first.get(channel), second.get(channel), of_channel.get(channel))
        for channel in dict.fromkeys((*first, *second))
    )


def _check_same_features(mine: LearnedTree, other: LearnedTree) -> None:
    known = {feature.name: feature for feature in mine.features}
    for name in sorted(nodes.features(other.tree)):
        feature = next(one for one in other.features if one.name == name)
        there = known.get(name)
        if there is None:
            raise RuleError(
                f"the other tree tests {name!r}, which the first one does not know: compare trees "
                "of one robot."
            )
        if (there.kind, there.categories) != (feature.kind, feature.categories):
            raise RuleError(
                f"{name!r} is not the same in both trees ({there.kind.value} with "
                f"{len(there.categories)} categories, {feature.kind.value} with "
                f"{len(feature.categories)}): compare trees of one robot."
            )


def _compared(
    learned: LearnedTree,
    channel: str,
    mine: nodes.Node | None,
    other: nodes.Node | None,
    table: DemonstrationTable | None,
) -> Comparison:
    grid = grid_of(learned, [mine, other])
    first = sweep(mine, grid, Results.AT_ONCE, Ticks.FIRST)
    second = sweep(other, grid, Results.AT_ONCE, Ticks.FIRST, first.boxes)
    pairs: dict[tuple[nodes.Action | None, nodes.Action | None], list[int]] = {}
    for place, origin in enumerate(second.origin.tolist()):
        pair = first.command(origin), second.command(place)
        if pair[0] != pair[1]:
            pairs.setdefault(pair, []).append(place)
    rows = _rows(mine, other, first, second, table)
    shown = of_tree(learned, channel)
    exact = True
    found = []
    for pair, places in pairs.items():
        boxes, known = possible_boxes(second.boxes[:, places], grid, learned.features, shown)
        exact = exact and known
        if boxes.shape[1]:
            count = None if rows is None else rows.get(pair, 0)
            found.append(Divergence(*pair, boxes, count))
    return Comparison(
        channel,
        grid,
        tuple(sorted(found, key=lambda its: (-(its.rows or 0), -its.boxes.shape[1]))),
        exact,
        remembers(mine, Results.AT_ONCE) or remembers(other, Results.AT_ONCE),
    )


def _leaf(done: Sweep, place: int) -> nodes.Action | None:
    return done.leaves[place] if place >= 0 else None


def _rows(
    mine: nodes.Node | None,
    other: nodes.Node | None,
    first: Sweep,
    second: Sweep,
    table: DemonstrationTable | None,
) -> dict[tuple[nodes.Action | None, nodes.Action | None], int] | None:
    """How many rows each pair of actions has; None where rows are not at hand."""
    if table is None:
        return None
    nothing = np.full(len(table), NO_ACTION)
    leaves = [nothing if tree is None else acting_leaves(tree, table) for tree in (mine, other)]
    counts: dict[tuple[nodes.Action | None, nodes.Action | None], int] = {}
    for one, another in zip(*(its.tolist() for its in leaves), strict=True):
        pair = _leaf(first, one), _leaf(second, another)
        counts[pair] = counts.get(pair, 0) + 1
    return counts
