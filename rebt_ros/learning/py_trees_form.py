"""A learned tree as a py_trees tree of one's own behaviours, to be a part of any program."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping

import py_trees
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.errors import OptionError
from rebt_ros.learning.named_states import Encoding, State


def to_py_trees(
    learned: LearnedTree,
    behaviours: Mapping[str, Callable[[], py_trees.behaviour.Behaviour]],
    state: Callable[[], State],
) -> py_trees.trees.BehaviourTree:
    """A learned tree as a py_trees tree, whose actions are behaviours of yours.

    Tick it, or add its root to a tree of your own.  It remembers what was done before, where the
    tree tests that, and what lagged features were some ticks before.

    Args:
        learned: The tree.
        behaviours: By label, what makes a behaviour that carries out the action; called once for
            each place that the action has in the tree.
        state: What is measured now; called once per tick.

    Raises:
        OptionError: An action of the tree has no behaviour.
    """
    missing = [
        action.label for action in nodes.actions(learned.tree) if action.label not in behaviours
    ]
    if missing:
        raise OptionError(
            f"the action {missing[0]!r} has no behaviour: give one for each label that the tree "
            "takes."
        )
    tree = executable(learned.tree)
    runtime = TreeRuntime(learned, tree=tree, carry_out=lambda one: behaviours[one.label]())
    return py_trees.trees.BehaviourTree(_Learned(runtime, state))


class _Learned(py_trees.decorators.Decorator):
    """Reads the state before a learned tree is ticked, and notes afterwards what it did."""

    def __init__(self, runtime: TreeRuntime, state: Callable[[], State]) -> None:
        super().__init__(name="learned", child=runtime.root)
        features = runtime.learned.features
        self._runtime = runtime
        self._read = state
        self._encoding = Encoding(features)
        self._past: deque[list[float]] = deque(
            maxlen=max((feature.lag for feature in features), default=0)
        )

    def tick(self) -> Iterator[py_trees.behaviour.Behaviour]:
        now = self._encoding.present(self._read())
        self._runtime.begin(self._encoding.row(now, self._past))
        self._past.appendleft(now)
        yield from super().tick()

    def update(self) -> Status:
        self._runtime.finish()
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID:
            self._runtime.interrupted()
