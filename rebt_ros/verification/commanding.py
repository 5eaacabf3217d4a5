"""What a tree commands in single states, asked of other programs than the proofs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.condition_tests import holds_after
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.prediction import Plan, States
from rebt_ros.behavior_tree.runtime import AlwaysRunning, SucceedAtOnce, TreeRuntime, executable
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.logic.conditions import HistoryCondition
from rebt_ros.verification.states import Point
from rebt_ros.verification.sweep import Results


class Commands:
    """What a tree commands on a channel in a first tick.

    Args:
        learned: The tree.
        channel: The channel.
        tree: That of the channel, as it is executed; None: none, which does nothing.
        results: How actions end.
    """

    def __init__(
        self, learned: LearnedTree, channel: str, tree: nodes.Node | None, results: Results
    ) -> None:
        self._learned = learned
        self._channel = channel
        self._tree = tree
        self._results = results

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
        if repeats or self._results is Results.REPORTED:
            return None
        return Plan(self._tree, self._learned.features)

    def _ticked(self, point: Point) -> nodes.Action | None:
        runtime = TreeRuntime(
            self._learned,
            AlwaysRunning() if self._results is Results.REPORTED else SucceedAtOnce(),
            executable(self._learned.tree),
            {self._channel: _history(point)},
        )
        commands = runtime.tick(point.values).commands
        return next((command for command in commands if command.channel == self._channel), None)


def _history(point: Point) -> ActionHistory:
    return ActionHistory() if point.before is None else point.before.history()
