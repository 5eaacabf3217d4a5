"""Whether a tree keeps its rules, in every state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.condition_tests import holds_after
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.prediction import Plan, States, history_columns
from rebt_ros.behavior_tree.runtime import AlwaysRunning, SucceedAtOnce, TreeRuntime, executable
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Condition, HistoryCondition, Literal
from rebt_ros.verification.branches import branches_of
from rebt_ros.verification.errors import RuleError, TooManyPartsError
from rebt_ros.verification.formulas import AllOf, Formula, conditions_of
from rebt_ros.verification.grid import Boxes, Grid
from rebt_ros.verification.reference import Reference, of_table, of_tree
from rebt_ros.verification.rules import Demand
from rebt_ros.verification.searching import Broken, found_in, searched
from rebt_ros.verification.states import Near, Point, StateFinder, Unsettled
from rebt_ros.verification.sweep import Results, Sweep, Ticks, remembers, sweep
from rebt_ros.verification.verdict import Answer, ChannelProof, Coverage, ShownRow, Verdict, Witness


def check(
    learned: LearnedTree,
    demands: Sequence[Demand],
    tables: Iterable[DemonstrationTable] = (),
    results: Results = Results.AT_ONCE,
) -> tuple[ChannelProof, ...]:
    """Proves or refutes the rules of a tree.

    Args:
        learned: The tree.
        demands: Its rules.
        tables: What was shown, with the features of the tree; a tree knows the ranges itself.
        results: How actions end.

    Returns:
        One for each channel, its rules in the order of `demands`.

    Raises:
        RuleError: The rules, or the tree, are too large.
    """
    shown = {table.channel: of_table(table) for table in tables}
    policies = policies_of(learned)
    channels = dict.fromkeys((*policies, *(action.channel for action in learned.actions)))
    return tuple(
        _ChannelCheck(
            learned,
            channel,
            policies.get(channel),
            shown[channel] if channel in shown else of_tree(learned, channel),
            results,
        ).proof([demand for demand in demands if demand.action.channel == channel])
        for channel in channels
    )


def policies_of(learned: LearnedTree) -> dict[str, nodes.Node]:
    """The tree of each channel, as it is executed.

    Raises:
        RuleError: Channels share a tree.
    """
    policies = nodes.policies(executable(learned.tree))
    mixed = {action.channel for action in nodes.actions(learned.tree)} - policies.keys()
    if mixed:
        raise RuleError(
            f"the tree mixes the channel {min(mixed)!r} with others in one policy: put the "
            "policies of several channels side by side under a Parallel."
        )
    return policies


def grid_of(
    learned: LearnedTree, trees: Iterable[nodes.Node | None], formulas: Iterable[Formula] = ()
) -> Grid:
    """The grid of the conditions of some trees and formulas."""
    asked: list[Condition] = [
        node.literal.condition for tree in trees if tree for node in nodes.conditions(tree)
    ]
    asked += [condition for formula in formulas for condition in conditions_of(formula)]
    return Grid(learned.features, asked)


#: Into how many parts a list of branches may divide the states for all to be looked at, also per
#: node: more than branches do that hardly overlap.
_MOST_PARTS: Final = 2_000
_MOST_PER_NODE: Final = 2


@dataclass(frozen=True, slots=True)
class _ChannelCheck:
    learned: LearnedTree
    channel: str
    tree: nodes.Node | None
    shown: Reference
    results: Results

    def proof(self, demands: Sequence[Demand]) -> ChannelProof:
        grid = grid_of(self.learned, [self.tree], [one.region for one in demands])
        finder = StateFinder(grid, self.learned.features, self.shown)
        commands = _Commands(
            self.learned, self.channel, self.tree, run=self.results is Results.REPORTED
        )
        broken = self._broken(demands, grid, finder, commands)
        any_tick = (
            sweep(self.tree, grid, self.results, Ticks.ANY)
            if demands and remembers(self.tree, self.results)
            else None
        )
        witnessed = iter(
            commands.of([one.nearest.point for one in broken if isinstance(one.nearest, Near)])
        )
        found = []
        for demand, its in zip(demands, broken, strict=True):
            coverage = self._coverage(demand)
            if isinstance(its.nearest, Near):
                witness = self._witness(demand, its.nearest, next(witnessed))
                found.append(Verdict(demand, Answer.BROKEN, witness, its.region, coverage=coverage))
                continue
            why = its.nearest or ""
            if any_tick is not None and not why:
                why = self._why_unknown(demand, grid, any_tick, finder)
            answer = Answer.UNKNOWN if why else Answer.PROVEN
            found.append(Verdict(demand, answer, why=why, coverage=coverage))
        return ChannelProof(self.channel, grid, tuple(found))

    def _broken(
        self, demands: Sequence[Demand], grid: Grid, finder: StateFinder, commands: _Commands
    ) -> list[Broken]:
        """Where a first tick breaks each rule."""
        size = 0 if self.tree is None else nodes.size(self.tree)
        most = _MOST_PARTS + _MOST_PER_NODE * size
        try:
            first = sweep(self.tree, grid, self.results, Ticks.FIRST, most=most)
        except TooManyPartsError:
            assert self.tree is not None
            branches = branches_of(self.tree)
            if branches is None:
                raise
            leaves = [node for node in nodes.walk(self.tree) if isinstance(node, nodes.Action)]
            return searched(demands, branches, leaves, grid, finder, commands.of)
        return found_in([breaking(one, grid, first) for one in demands], finder)

    def _why_unknown(self, demand: Demand, grid: Grid, any_tick: Sweep, finder: StateFinder) -> str:
        try:
            if finder.nearest(breaking(demand, grid, any_tick)) is None:
                return ""
        except Unsettled:
            pass
        return (
            "it depends on what the tree remembers, or on how its actions end: a first tick keeps "
            "it, a later one may not"
        )

    def _witness(self, demand: Demand, near: Near, command: nodes.Action | None) -> Witness:
        assert (command == demand.action) is (demand.forbids is not None), (demand, near, command)
        table = self.shown.table
        row = None
        if table is not None and near.row is not None:
            number = int(table.demonstration[near.row])
            begin = int(np.searchsorted(table.demonstration, number))
            label = table.actions[int(table.chosen[near.row])]
            row = ShownRow(table.demonstrations[number], near.row - begin, label)
        return Witness(near.point, command, row, near.distance)

    def _coverage(self, demand: Demand) -> Coverage | None:
        table = self.shown.table
        if table is None:
            return None
        about = _holds(demand.region, table)
        label = demand.action.label
        code = table.actions.index(label) if label in table.actions else -1
        done = table.chosen == code
        breaking_rows = about & (done if demand.forbids is not None else ~done)
        return Coverage(int(about.sum()), len(table), int(breaking_rows.sum()))


class _Commands:
    """What a tree commands in a first tick, asked of other programs than the proof.

    Args:
        learned: The tree.
        channel: The channel.
        tree: That of the channel, as it is executed; None: none, which does nothing.
        run: Whether actions go on after the tick, rather than succeed at once.
    """

    def __init__(
        self, learned: LearnedTree, channel: str, tree: nodes.Node | None, *, run: bool
    ) -> None:
        self._learned = learned
        self._channel = channel
        self._tree = tree
        self._run = run

    def of(self, points: Sequence[Point]) -> list[nodes.Action | None]:
        """The command in each of some states; None: nothing."""
        if self._tree is None or not points:
            return [None] * len(points)
        if self._plan is None:
            return [self._ticked(point) for point in points]
        histories = [_history(point) for point in points]

        def holds(condition: HistoryCondition) -> BoolArray:
            return np.array([holds_after(history, condition) for history in histories], dtype=bool)

        values = np.array([point.values for point in points]).reshape(len(points), -1)
        actions = self._plan.actions
        chosen = self._plan.choose(actions, States(self._learned.features, values, holds))
        return [actions[code] if code >= 0 else None for code in chosen.tolist()]

    @cached_property
    def _plan(self) -> Plan | None:
        """Evaluates many states together; None where that does not do what a tick does."""
        assert self._tree is not None
        repeats = any(isinstance(node, nodes.Repeater) for node in nodes.walk(self._tree))
        if repeats or self._run:
            return None
        return Plan(self._tree, self._learned.features)

    def _ticked(self, point: Point) -> nodes.Action | None:
        runtime = TreeRuntime(
            self._learned,
            AlwaysRunning() if self._run else SucceedAtOnce(),
            executable(self._learned.tree),
            {self._channel: _history(point)},
        )
        commands = runtime.tick(point.values).commands
        return next((command for command in commands if command.channel == self._channel), None)


def _history(point: Point) -> ActionHistory:
    return ActionHistory() if point.before is None else point.before.history()


def breaking(demand: Demand, grid: Grid, done: Sweep) -> Boxes:
    """The boxes in which a tree breaks a rule."""
    forbidden = demand.forbids
    if forbidden is not None:
        return grid.within(done.boxes[:, done.commands(demand.action)], forbidden)
    return grid.within(done.boxes[:, ~done.commands(demand.action)], demand.when)


def _holds(formula: Formula, table: DemonstrationTable) -> BoolArray:
    """In which rows a formula holds, shape (rows,)."""
    columns = history_columns(table.actions, table.previous, table.last)
    states = States(table.features, table.states, columns)

    def holds(one: Formula) -> BoolArray:
        if isinstance(one, Literal):
            return states.satisfy(one)
        parts = [holds(part) for part in one.parts]
        if isinstance(one, AllOf):
            return reduce(np.logical_and, parts, np.ones(len(table), dtype=bool))
        return reduce(np.logical_or, parts, np.zeros(len(table), dtype=bool))

    return holds(formula)
