"""A task that needs memory is learned from three demonstrations, and then done."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from functools import cache

import numpy as np
import pytest

from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn
from rebt_ros.learning.policy import Decision, Policy

#: What is measured: where it is, and something that does not matter.
FEATURES = (Feature("place", topic="state", index=0), Feature("noise", topic="state", index=1))
LEFT, RIGHT = 0.0, 10.0
#: From end to end takes about 20 steps.
SPEED, MOST_STEPS, LEGS = 0.5, 120, 4
FRESH = range(100, 125)

State = tuple[float, float]
Driver = Callable[[State], Decision]


class Shuttle:
    """Something that has to go to and fro between two ends, and measures its place with noise."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self.place = self._random.uniform(3.0, 7.0)
        self.legs = 0
        self._wanted = RIGHT

    @property
    def state(self) -> State:
        return self.place + self._random.gauss(0, 0.02), self._random.uniform(0, 10)

    def step(self, action: Decision) -> None:
        self.place += {"left": -SPEED, "right": SPEED}.get(str(action), 0.0)
        if abs(self.place - self._wanted) < 2 * SPEED:
            self.legs += 1
            self._wanted = LEFT if self._wanted == RIGHT else RIGHT


class Demonstrator:
    """Goes on until it is at an end, then turns round."""

    def __init__(self) -> None:
        self._action = "right"

    def __call__(self, state: State) -> str:
        if state[0] > RIGHT - SPEED:
            self._action = "left"
        elif state[0] < LEFT + SPEED:
            self._action = "right"
        return self._action


def drive(seed: int, driver: Driver) -> bool:
    """Whether the legs were driven in time."""
    world = Shuttle(seed)
    for _ in range(MOST_STEPS):
        world.step(driver(world.state))
        if world.legs >= LEGS:
            return True
    return False


def demonstration(seed: int) -> Demonstration:
    rows: list[Row] = []
    decide = Demonstrator()

    def watched(state: State) -> str:
        action = decide(state)
        rows.append(Row(100_000_000 * len(rows), "action", action, None, state))
        return action

    assert drive(seed, watched)
    return Demonstration.from_rows(f"demonstration {seed}", FEATURES, rows, RowKind.SAMPLE)


@cache
def learned(history: History | None = None) -> LearnedTree:
    return learn([demonstration(seed) for seed in range(3)], LearnOptions(history=history))


def success(drivers: Iterable[Driver]) -> float:
    return float(np.mean([drive(seed, one) for seed, one in zip(FRESH, drivers, strict=True)]))


def test_the_demonstrator_can_do_it() -> None:
    assert success(Demonstrator() for _ in FRESH) == 1.0


def test_three_demonstrations_are_enough_with_default_options() -> None:
    tree = learned()
    assert tree.provenance.history is History.PREVIOUS
    assert tree.row_kind is RowKind.SAMPLE
    assert success(Policy(tree).act for _ in FRESH) == 1.0


def test_the_tree_that_the_executor_reads_and_ticks_does_it_as_well() -> None:
    tree = loads(dumps(learned()))

    def ticked() -> Driver:
        runtime = TreeRuntime(tree, tree=executable(tree.tree))
        return lambda state: runtime.tick(state).actions[0].label

    assert success(ticked() for _ in FRESH) == 1.0


@pytest.mark.parametrize("history", [History.NONE, History.LAST])
def test_without_the_previous_action_it_is_not_done(history: History) -> None:
    # Where it is tells nothing of where it has to go, and LAT of two actions is the other one.
    assert success(Policy(learned(history)).act for _ in FRESH) == 0.0
