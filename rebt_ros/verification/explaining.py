"""Why a tree does in a state what it does, and what would have to change for something else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import LastActionIs, PreviousActionIs, features_in, features_of
from rebt_ros.verification.acting import (
    Outcome,
    Step,
    acting_leaves,
    commanding,
    recorded,
    trace,
)
from rebt_ros.verification.errors import TooManyPartsError
from rebt_ros.verification.grid import Boxes, Field, Grid
from rebt_ros.verification.proof import grid_of, policies_of
from rebt_ros.verification.reference import Reference, of_table, of_tree
from rebt_ros.verification.states import Point, Unsettled, nearest
from rebt_ros.verification.support import Support, support_of
from rebt_ros.verification.sweep import Results, Sweep, Ticks, sweep


@dataclass(frozen=True, slots=True)
class Flip:
    """A change of the state that makes the tree do something else."""

    feature: str | None
    """What changes; None if several features, or what was done before, have to."""
    point: Point
    """The changed state."""
    action: nodes.Action | None
    """What is done there; None: nothing."""
    distance: float
    """A sum over the features, in shares of all that was shown of each."""


@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """Why one channel does what it does."""

    channel: str
    trace: Step
    action: nodes.Action | None
    """What is commanded; None: nothing."""
    support: Support | None
    """None where rows are not at hand, or nothing is commanded."""
    flips: tuple[Flip, ...] | None
    """The least change of each feature that suffices by itself, the smallest first; where there is
    none, the least change of several; None where they were not looked for."""
    grid: Grid


def explain(
    learned: LearnedTree,
    values: Sequence[float],
    histories: Mapping[str, ActionHistory] | None = None,
    tables: Sequence[DemonstrationTable] = (),
    *,
    changes: bool = True,
) -> tuple[Explanation, ...]:
    """Why a tree does in a state what it does, channel by channel.

    Args:
        learned: The tree.
        values: One for each of its features.
        histories: What was done before, by channel; nothing by default.
        tables: What was shown, with the features of the tree.
        changes: Whether to look for the least changes that lead to something else, which takes
            most of the time.

    Raises:
        RuleError: The tree cannot be explained.
    """
    of_channel = {table.channel: table for table in tables}
    return tuple(
        _explained(
            learned,
            channel,
            tree,
            tuple(values),
            (histories or {}).get(channel, ActionHistory()),
            of_channel.get(channel),
            changes,
        )
        for channel, tree in policies_of(learned).items()
    )


def explain_tick(learned: LearnedTree, outcomes: Mapping[int, Outcome]) -> tuple[Explanation, ...]:
    """Why a tree did in a tick what it did, channel by channel, whatever it remembered.

    Args:
        learned: The tree.
        outcomes: What came of the nodes that were ticked, by their places in its executable form.

    Raises:
        RuleError: The tree cannot be explained.
    """
    policies = policies_of(learned)
    # Several channels are side by side under a root of their own.
    place = 0 if len(policies) < 2 else 1
    found = []
    for channel, tree in policies.items():
        traced = recorded(tree, outcomes, place)
        place += nodes.size(tree)
        if traced is not None:
            acting = commanding(traced, tree)
            grid = grid_of(learned, [tree])
            found.append(Explanation(channel, traced, _action_of(acting), None, None, grid))
    return tuple(found)


def _action_of(acting: Step | None) -> nodes.Action | None:
    return acting.node if acting is not None and isinstance(acting.node, nodes.Action) else None


def _explained(
    learned: LearnedTree,
    channel: str,
    tree: nodes.Node,
    values: tuple[float, ...],
    history: ActionHistory,
    table: DemonstrationTable | None,
    changes: bool,
) -> Explanation:
    traced = trace(tree, learned.features, values, history)
    acting = commanding(traced, tree)
    action = _action_of(acting)
    grid = grid_of(learned, [tree])
    flips: tuple[Flip, ...] | None = None
    if changes:
        try:
            done = sweep(tree, grid, Results.AT_ONCE, Ticks.FIRST)
        except TooManyPartsError:
            # Changes of a single feature can still be looked at.
            start = _one_free(grid, learned, values, history)
            done = sweep(tree, grid, Results.AT_ONCE, Ticks.FIRST, start)
        shown = of_tree(learned, channel) if table is None else of_table(table)
        flips = tuple(_flips(learned, grid, done, values, history, action, shown))
    support = None
    if table is not None and acting is not None:
        rows = np.flatnonzero(acting_leaves(tree, table) == acting.leaf)
        support = support_of(table, rows)
    return Explanation(channel, traced, action, support, flips, grid)


def _flips(
    learned: LearnedTree,
    grid: Grid,
    done: Sweep,
    values: tuple[float, ...],
    history: ActionHistory,
    action: nodes.Action | None,
    shown: Reference,
) -> Iterator[Flip]:
    here = np.array([values])
    origin = Reference(here, here, shown.scale, None)
    differs = ~done.commands(action) if action is not None else done.commanding >= 0
    boxes = done.boxes[:, differs]
    now = _cells_of(grid, learned, values, history)
    kept = _same(grid, boxes, now)
    single = []
    for feature in learned.features:
        if grid.field(feature.name) is None:
            continue
        others = [
            place for place, field in enumerate(grid.fields) if not _concerns(field, feature.name)
        ]
        there = _pinned(grid, boxes[:, kept[others].all(axis=0)], now, others)
        flip = _flip(learned, grid, done, there, origin, feature.name)
        if flip is not None:
            single.append(flip)
    yield from sorted(single, key=lambda one: one.distance)
    if not single:
        flip = _flip(learned, grid, done, boxes, origin, None)
        if flip is not None:
            yield flip


def _one_free(
    grid: Grid, learned: LearnedTree, values: Sequence[float], history: ActionHistory
) -> Boxes:
    """For each feature, the states that differ from one in nothing but that feature."""
    now = _cells_of(grid, learned, values, history)
    everything = grid.everything()
    free = [everything[:, :0]]
    for feature in learned.features:
        if grid.field(feature.name) is not None:
            others = [
                place
                for place, field in enumerate(grid.fields)
                if not _concerns(field, feature.name)
            ]
            free.append(_pinned(grid, everything, now, others))
    return np.concatenate(free, axis=1)


def _cells_of(
    grid: Grid, learned: LearnedTree, values: Sequence[float], history: ActionHistory
) -> list[int]:
    """The cell of a state in each field."""
    tests = StateTests(learned.features)
    cells = []
    for field in grid.fields:
        if field.quantity is None:
            cells.append(grid.cell_of(history))
        else:
            cells.append(field.cell(tests.reading(field.quantity)(values)))
    return cells


def _same(grid: Grid, boxes: Boxes, now: Sequence[int]) -> BoolArray:
    """Which boxes have the cell of a state, shape (fields, boxes)."""
    return np.array(
        [field.cells_of(boxes)[:, cell] for field, cell in zip(grid.fields, now, strict=True)],
        dtype=bool,
    ).reshape(len(grid.fields), boxes.shape[1])


def _pinned(grid: Grid, boxes: Boxes, now: Sequence[int], fields: Sequence[int]) -> Boxes:
    """The boxes with nothing but the cell of a state in some fields."""
    pinned = boxes.copy()
    for place in fields:
        field = grid.fields[place]
        only = np.zeros(field.cells, dtype=bool)
        only[now[place]] = True
        pinned[field.words] = field.chosen(only)[:, np.newaxis]
    return pinned


def _concerns(field: Field, feature: str) -> bool:
    return field.quantity is not None and feature in features_in(field.quantity)


def _flip(
    learned: LearnedTree,
    grid: Grid,
    done: Sweep,
    boxes: Boxes,
    origin: Reference,
    feature: str | None,
) -> Flip | None:
    try:
        near = nearest(boxes, grid, learned.features, origin, feature)
    except Unsettled:
        return None
    if near is None:
        return None
    point = near.point
    history = ActionHistory() if point.before is None else point.before.history()
    cells = _cells_of(grid, learned, point.values, history)
    there = np.flatnonzero(_same(grid, done.boxes, cells).all(axis=0))
    action = done.command(int(there[0])) if len(there) else None
    return Flip(feature, point, action, near.distance)


def failing(step: Step) -> Iterator[nodes.Condition]:
    """The conditions that kept a branch from acting."""
    if isinstance(step.node, nodes.Condition):
        yield step.node
        return
    decided = step.children
    if isinstance(step.node, nodes.Sequence | nodes.Repeater):
        # The last one that was ticked is the one that failed.
        decided = step.children[-1:]
    for child in decided:
        yield from failing(child)


def values_read(condition: nodes.Condition) -> tuple[str, ...]:
    """The features whose values stand beside a condition."""
    tested = condition.literal.condition
    if isinstance(tested, PreviousActionIs | LastActionIs):
        return ()
    return features_of(tested)
