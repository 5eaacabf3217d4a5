"""A simulated tree as a py_trees tree, to be run, watched or drawn by py_trees' own tools."""

from __future__ import annotations

from collections.abc import Iterator

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
)
from rebt_ros.study.simulator.ticking import Body, Outcome

_STATUS = {
    Outcome.SUCCESS: Status.SUCCESS,
    Outcome.FAILURE: Status.FAILURE,
    Outcome.RUNNING: Status.RUNNING,
}


def py_trees_form(node: SimulatedNode, body: Body, repeats: int) -> Behaviour:
    """The tree that does, tick by tick, what `ticker` does with the same arguments."""
    match node:
        case Check():
            return _CheckBehaviour(node, body)
        case Act():
            return _ActBehaviour(node, body)
        case Inverted(child=child):
            inverted = py_trees_form(child, body, repeats)
            return py_trees.decorators.Inverter(name="Inverter", child=inverted)
        case Group(kind=kind, children=children):
            behaviours = [py_trees_form(child, body, repeats) for child in children]
            match kind:
                case GroupKind.SEQUENCE:
                    return py_trees.composites.Sequence("Sequence", True, behaviours)
                case GroupKind.SELECTOR:
                    return py_trees.composites.Selector("Selector", False, behaviours)
                case GroupKind.PARALLEL:
                    return _parallel("Parallel", behaviours)
                case GroupKind.PARALLEL_SELECTOR:
                    return _parallel("Parallel/Selector", behaviours)
                case GroupKind.REPEATER:
                    sequence = py_trees.composites.Sequence("Sequence", True, behaviours)
                    return _RepeatWithinTick("Repeater", sequence, repeats)


def _parallel(name: str, children: list[Behaviour]) -> Behaviour:
    policy = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=True)
    return py_trees.composites.Parallel(name, policy, children)


class _CheckBehaviour(Behaviour):
    def __init__(self, check: Check, body: Body) -> None:
        super().__init__(check.variable)
        self._check = check
        self._body = body

    def update(self) -> Status:
        return Status.SUCCESS if self._body.sense(self._check) else Status.FAILURE


class _ActBehaviour(Behaviour):
    def __init__(self, act: Act, body: Body) -> None:
        super().__init__(act.label)
        self._act = act
        self._body = body

    def update(self) -> Status:
        return _STATUS[self._body.attempt(self._act)]


class _RepeatWithinTick(py_trees.decorators.Decorator):
    """Repeats its child until it has succeeded often enough or failed.

    py_trees' own Repeat waits for the next tick before each round.
    """

    def __init__(self, name: str, child: Behaviour, repeats: int) -> None:
        super().__init__(name=name, child=child)
        self._repeats = repeats
        self._succeeded = 0

    def initialise(self) -> None:
        self._succeeded = 0

    def tick(self) -> Iterator[Behaviour]:
        if self.status != Status.RUNNING:
            self.initialise()
        while self._succeeded < self._repeats:
            yield from self.decorated.tick()
            if self.decorated.status != Status.SUCCESS:
                break
            self._succeeded += 1
        self.status = self.decorated.status
        if self.status != Status.RUNNING:
            self.stop(self.status)
        yield self

    def update(self) -> Status:
        return self.decorated.status
