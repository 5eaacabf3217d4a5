"""Lets something drive fresh episodes, several of them side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from driving.task import State, Task
from driving.tasks import task_named

#: Where seeds of fresh episodes begin, and of those that a learner is corrected in.
FRESH, TRAINING = 5_000_000, 7_000_000


class Driver(Protocol):
    """What was learned, driving."""

    def reset(self, episodes: int) -> None:
        """Begins so many episodes, without any history."""

    def act_many(self, states: Sequence[State], episodes: Sequence[int]) -> Sequence[str | None]:
        """What to do in some of the episodes; None for nothing, so that the last action holds."""


@dataclass(frozen=True, slots=True)
class Driven:
    """An episode that has ended."""

    success: bool
    actions: tuple[str, ...]


class Worlds:
    """Episodes of a task side by side; they are made once, which takes long."""

    def __init__(self, task: str) -> None:
        self._task = task
        self._worlds: list[Task] = []

    def first(self, count: int) -> Sequence[Task]:
        """So many."""
        while len(self._worlds) < count:
            self._worlds.append(task_named(self._task))
        return self._worlds[:count]


def drive(worlds: Worlds, driver: Driver, seeds: Sequence[int]) -> tuple[Driven, ...]:
    """Drives an episode for each seed."""
    driver.reset(len(seeds))
    tasks = worlds.first(len(seeds))
    states = [task.reset(seed) for task, seed in zip(tasks, seeds, strict=True)]
    done: list[list[str]] = [[] for _ in seeds]
    going = [place for place, task in enumerate(tasks) if not task.over]
    while going:
        chosen = driver.act_many([states[place] for place in going], going)
        for place, action in zip(going, chosen, strict=True):
            task, actions = tasks[place], done[place]
            holding = actions[-1] if actions else task.actions[0]
            actions.append(holding if action is None else action)
            states[place] = task.step(actions[-1])
        going = [place for place in going if not tasks[place].over]
    return tuple(
        Driven(task.success, tuple(actions)) for task, actions in zip(tasks, done, strict=True)
    )


def fresh(episodes: int) -> range:
    """Seeds of the episodes that methods are judged on."""
    return range(FRESH, FRESH + episodes)


class Expert:
    """The expert as a driver."""

    def __init__(self, worlds: Worlds) -> None:
        self._worlds = worlds

    def reset(self, episodes: int) -> None:
        self._tasks = self._worlds.first(episodes)

    def act_many(self, states: Sequence[State], episodes: Sequence[int]) -> Sequence[str | None]:
        return [self._tasks[place].expert() for place in episodes]
