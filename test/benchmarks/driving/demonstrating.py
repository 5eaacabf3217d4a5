"""Demonstrations of experts who may be late and err, as people do.

late
    Steps that pass until a decision is acted on; until the first one is, it is acted on already.
wrong
    Share of the steps in which any action is taken instead.
"""

from __future__ import annotations

import csv
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from driving.task import State, Task
from rebt_ros.errors import OptionError

#: Seconds between two rows of a table.
PERIOD = 0.05
#: Where seeds of demonstrations begin, and how many each set has; other episodes have larger ones.
_FIRST_SEED, _SEEDS = 100_000, 10_000
#: Number of the last set.
MOST_SETS = 399
#: A demonstrator who fails so often in a row is no use.
_MOST_FAILURES = 500


@dataclass(frozen=True, slots=True)
class Demonstrator:
    """How much of a human a demonstrator is.

    Raises:
        OptionError: A value out of its range.
    """

    late: int = 0
    wrong: float = 0.0

    def __post_init__(self) -> None:
        if self.late < 0:
            raise OptionError(f"late is a number of steps from 0 on, not {self.late}.")
        if not 0 <= self.wrong < 1:
            raise OptionError(f"wrong is a share from 0 to less than 1, not {self.wrong:g}.")


PERFECT = Demonstrator()


@dataclass(frozen=True, slots=True)
class Shown:
    """A demonstration: states, and what was done in each."""

    states: tuple[State, ...]
    actions: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.actions)


class UselessDemonstratorError(Exception):
    """A demonstrator hardly ever succeeds."""


def demonstrations(
    task: Task, number: int, count: int, demonstrator: Demonstrator = PERFECT
) -> tuple[Shown, ...]:
    """The first demonstrations of a set.

    Args:
        task: What is shown.
        number: Of the set.
        count: How many demonstrations.
        demonstrator: Who shows it.

    Raises:
        UselessDemonstratorError: It fails all the time.
    """
    return tuple(islice(successes(task, number, demonstrator), count))


def successes(task: Task, number: int, demonstrator: Demonstrator = PERFECT) -> Iterator[Shown]:
    """The demonstrations of a set, one after the other; see `demonstrations`."""
    failures = 0
    for place in range(_SEEDS):
        shown = show(task, _FIRST_SEED + _SEEDS * number + place, demonstrator)
        failures = 0 if shown else failures + 1
        if shown:
            yield shown
        if failures == _MOST_FAILURES:
            raise UselessDemonstratorError(
                f"{task.name}: {failures} failures in a row of a demonstrator who is late by "
                f"{demonstrator.late} steps and errs in {demonstrator.wrong:.0%} of them"
            )


def show(task: Task, seed: int, demonstrator: Demonstrator = PERFECT) -> Shown | None:
    """Shows an episode from its start; None where the demonstrator fails."""
    state = task.reset(seed)
    return show_rest(task, state, demonstrator, random.Random(seed))


def show_rest(
    task: Task, state: State, demonstrator: Demonstrator, chance: random.Random
) -> Shown | None:
    """Shows the rest of an episode that is under way.

    Args:
        task: At some step of an episode.
        state: The present one.
        demonstrator: Who takes over.
        chance: Decides about errors.

    Returns:
        From the present state on; None where the demonstrator fails.
    """
    states: list[State] = []
    actions: list[str] = []
    decided: list[str] = []
    while not task.over:
        decided.append(task.expert())
        action = decided[max(len(decided) - 1 - demonstrator.late, 0)]
        if demonstrator.wrong and chance.random() < demonstrator.wrong:
            action = chance.choice(task.actions)
        states.append(state)
        actions.append(action)
        state = task.step(action)
    return Shown(tuple(states), tuple(actions)) if task.success else None


def write_tables(
    directory: Path, features: Sequence[str], shown: Sequence[Shown]
) -> tuple[Path, ...]:
    """A CSV table of each demonstration, as `rebt_ros.learn` reads them."""
    paths = []
    for place, one in enumerate(shown):
        path = directory / f"{place:04}.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["stamp", *features, "action"])
            for row, (state, action) in enumerate(zip(one.states, one.actions, strict=True)):
                writer.writerow([round(row * PERIOD * 1e9), *state, action])
        paths.append(path)
    return tuple(paths)
