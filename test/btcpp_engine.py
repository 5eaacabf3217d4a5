"""An exported tree in the real engine, beside our runtime: what both do, tick by tick."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.export.blackboard import Variable, variables
from rebt_ros.export.btcpp import _Export

#: How an action ends in one tick, by label.
Outcomes = Mapping[str, Status]


@dataclass
class Log:
    """What one tick did."""

    ticked: list[nodes.Action] = field(default_factory=list)
    halted: Counter[nodes.Action] = field(default_factory=Counter)


class Ours:
    """The tree in our runtime."""

    def __init__(self, learned: LearnedTree) -> None:
        self.runtime = TreeRuntime(learned, self, executable(learned.tree))

    def tick(self, state: Sequence[float], outcomes: Outcomes) -> tuple[Log, str]:
        self.log, self._outcomes = Log(), outcomes
        return self.log, self.runtime.tick(state).status.name

    def interrupt(self) -> Log:
        self.log = Log()
        self.runtime.halt()
        return self.log

    def update(self, action: nodes.Action) -> Status:
        self.log.ticked.append(action)
        return self._outcomes[action.label]

    def halt(self, action: nodes.Action) -> None:
        self.log.halted[action] += 1


class Engine:
    """The tree in BehaviorTree.CPP."""

    def __init__(self, learned: LearnedTree, text: str | None = None) -> None:
        import behaviortreepy

        self._statuses = behaviortreepy.NodeStatus
        self._variables = variables(learned, executable(learned.tree))
        self._features = learned.features
        export = _Export(learned)
        factory = behaviortreepy.BehaviorTreeFactory()
        for action, name in export._ids.items():
            tick = partial(self._update, action)
            factory.register_simple_stateful_action(name, tick, tick, partial(self._halt, action))
        self._tree = factory.create_tree_from_text(export.text() if text is None else text)

    def tick(self, state: Sequence[float], outcomes: Outcomes) -> tuple[Log, str]:
        self.log, self._outcomes = Log(), outcomes
        board = self._tree.root_blackboard()
        for feature, value in zip(self._features, state, strict=True):
            variable = self._variables.get(feature.name)
            if variable is None:
                continue
            if feature.categories:
                board.set_string(variable.name, _text(variable, value))
            else:
                board.set_double(variable.name, value)
        return self.log, self._tree.tick_exactly_once().name

    def interrupt(self) -> Log:
        self.log = Log()
        self._tree.halt_tree()
        return self.log

    def _update(self, action: nodes.Action, node: Any) -> Any:
        self.log.ticked.append(action)
        return getattr(self._statuses, self._outcomes[action.label].name)

    def _halt(self, action: nodes.Action, node: Any) -> None:
        self.log.halted[action] += 1


def _text(variable: Variable, value: float) -> str:
    """What a program writes to the variable of a feature that has categories."""
    if math.isnan(value):
        return ""
    category = variable.feature.categories[int(value)]
    # Categories that are not tested may hold any other text.
    return variable.categories.get(category, "none of them")
