"""LAT trees made by hand, and run."""

from __future__ import annotations

import strategies as some
from lat_examples import LABELS
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import Literal

CONDITIONS = tuple(Feature(f"C_{number}", FeatureKind.BINARY) for number in range(10))


def steps(*children: Literal | str | nodes.Node) -> tuple[nodes.Node, ...]:
    """Conditions by their literals and actions by their labels."""
    return tuple(
        nodes.Condition(child)
        if isinstance(child, Literal)
        else some.action(child)
        if isinstance(child, str)
        else child
        for child in children
    )


def sequence(*children: Literal | str | nodes.Node) -> nodes.Sequence:
    return nodes.Sequence(steps(*children), memory=True)


def repeater(*children: Literal | str | nodes.Node) -> nodes.Repeater:
    return nodes.Repeater(steps(*children))


class Script:
    """A commander whose actions succeed on the tick after the one on which they began."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.halted: list[str] = []
        self._running: str | None = None

    def update(self, action: nodes.Action) -> Status:
        if self._running == action.label:
            self._running = None
            return Status.SUCCESS
        self.begun.append(action.label)
        self._running = action.label
        return Status.RUNNING

    def halt(self, action: nodes.Action) -> None:
        self.halted.append(action.label)
        self._running = None


def run(tree: nodes.Node, *states: set[int]) -> tuple[Script, list[Status]]:
    """Ticks the tree once per state; a state is the numbers of the conditions that hold."""
    actions = tuple(dict.fromkeys((*map(some.action, LABELS), *nodes.actions(tree))))
    learned = LearnedTree(CONDITIONS, actions, tree, some.PROVENANCE)
    script = Script()
    runtime = TreeRuntime(learned, script)
    return script, [
        runtime.tick([float(number in state) for number in range(10)]).status for state in states
    ]
