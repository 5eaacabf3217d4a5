"""Where two trees do different things."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification.acting import acting_leaves
from rebt_ros.verification.branches import Branch, branches_of, where_some_act
from rebt_ros.verification.errors import RuleError, TooManyPartsError
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.proof import grid_of, policies_of
from rebt_ros.verification.reference import of_tree
from rebt_ros.verification.states import possible_boxes
from rebt_ros.verification.sweep import Results, Ticks, remembers, sweep

#: How many boxes may be split to find where a tree does something, of trees with more parts than
#: can be looked at.
_MOST_SPLIT: Final = 500

#: What two trees command; None: nothing.
_Pair: TypeAlias = tuple[nodes.Action | None, nodes.Action | None]


@dataclass(frozen=True, eq=False, slots=True)
class Divergence:
    """States in which one tree commands this, and the other one that."""

    mine: nodes.Action | None
    """None: nothing."""
    other: nodes.Action | None
    boxes: Boxes
    """None may be known, where rows that were shown lie there: see `Comparison.complete`."""
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
    complete: bool = True
    """Whether these are all states in which they differ.  Otherwise branches overlap in too many
    ways to look at all of them; rows that were shown are all counted."""


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
    rows = _rows(mine, other, table)
    complete = True
    try:
        pairs = _all_differing(mine, other, grid)
    except TooManyPartsError:
        if not (_is_list(mine) and _is_list(other)):
            raise
        pairs, complete = _some_differing(mine, other, grid)
        # Rows tell of differences that were not found.
        for pair in rows or {}:
            if pair[0] != pair[1]:
                pairs.setdefault(pair, grid.everything()[:, :0])
    shown = of_tree(learned, channel)
    exact = True
    found = []
    for pair, differing in pairs.items():
        boxes, known = possible_boxes(differing, grid, learned.features, shown)
        exact = exact and known
        count = None if rows is None else rows.get(pair, 0)
        if boxes.shape[1] or (count and not complete):
            found.append(Divergence(*pair, boxes, count))
    return Comparison(
        channel,
        grid,
        tuple(sorted(found, key=lambda its: (-(its.rows or 0), -its.boxes.shape[1]))),
        exact,
        remembers(mine, Results.AT_ONCE) or remembers(other, Results.AT_ONCE),
        complete,
    )


def _all_differing(
    mine: nodes.Node | None, other: nodes.Node | None, grid: Grid
) -> dict[_Pair, Boxes]:
    """Where two trees command this and that.

    Raises:
        TooManyPartsError: There are too many parts to look at.
    """
    first = sweep(mine, grid, Results.AT_ONCE, Ticks.FIRST)
    second = sweep(other, grid, Results.AT_ONCE, Ticks.FIRST, first.boxes)
    pairs: dict[_Pair, list[int]] = {}
    for place, origin in enumerate(second.origin.tolist()):
        pair = first.command(origin), second.command(place)
        if pair[0] != pair[1]:
            pairs.setdefault(pair, []).append(place)
    return {pair: second.boxes[:, places] for pair, places in pairs.items()}


def _is_list(tree: nodes.Node | None) -> bool:
    return tree is None or branches_of(tree) is not None


def _some_differing(
    mine: nodes.Node | None, other: nodes.Node | None, grid: Grid
) -> tuple[dict[_Pair, Boxes], bool]:
    """The same of lists of branches, as far as it is found in bounded time, and whether all was."""
    first, second = _Branches(mine), _Branches(other)
    pairs: dict[_Pair, Boxes] = {}
    complete = True
    for command in first.commands:
        parts, is_all = first.where(command, grid.everything(), grid)
        complete = complete and is_all
        for another in second.commands if parts.shape[1] else ():
            if another != command:
                boxes, is_all = second.where(another, parts, grid)
                complete = complete and is_all
                if boxes.shape[1]:
                    pairs[command, another] = boxes
    return pairs, complete


class _Branches:
    """A list of branches; nothing for no tree."""

    def __init__(self, tree: nodes.Node | None) -> None:
        found = branches_of(tree) if tree else ()
        assert found is not None
        self._branches: tuple[Branch, ...] = found
        self._leaves = [] if tree is None else _leaves(tree)
        self.commands = tuple(dict.fromkeys([*self._leaves, None]))
        """All that it may command."""

    def where(self, command: nodes.Action | None, start: Boxes, grid: Grid) -> tuple[Boxes, bool]:
        """The parts of boxes in which this is commanded, or some of them, and whether all are."""
        takes = np.array([one == command for one in (*self._leaves, None)], dtype=bool)
        wanted = np.tile(takes, (start.shape[1], 1))
        found = [start[:, :0]]
        try:
            for parts, _ in where_some_act(self._branches, grid.mask, start, wanted, _MOST_SPLIT):
                found.append(parts)
        except TooManyPartsError:
            return np.concatenate(found, axis=1), False
        return np.concatenate(found, axis=1), True


def _rows(
    mine: nodes.Node | None, other: nodes.Node | None, table: DemonstrationTable | None
) -> dict[_Pair, int] | None:
    """How many rows each pair of actions has; None where rows are not at hand."""
    if table is None:
        return None
    commands = [_commands(tree, table) for tree in (mine, other)]
    return dict(Counter(zip(*commands, strict=True)))


def _commands(tree: nodes.Node | None, table: DemonstrationTable) -> list[nodes.Action | None]:
    """What is commanded in each row."""
    if tree is None:
        return [None] * len(table)
    leaves = [*_leaves(tree), None]
    # The place behind the last one is -1, for none.
    return [leaves[place] for place in acting_leaves(tree, table).tolist()]


def _leaves(tree: nodes.Node) -> list[nodes.Action]:
    return [node for node in nodes.walk(tree) if isinstance(node, nodes.Action)]
