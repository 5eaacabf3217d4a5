"""How soon a learner does as well as the expert if its failures are corrected.

It starts from two demonstrations and drives training episodes.  At each failure it gets one more
demonstration and learns again, until it succeeds in the fresh episodes nearly as often as the
expert.  What is shown at a failure:

failed
    The whole episode that failed, from its start.
takeover
    Its rest: the expert takes over as late as the episode can still be saved, in a number of steps
    before its end that is doubled until it can.  Where that is before its start, all is shown.
whole
    The set's next demonstration, which has nothing to do with the failure.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from driving.cells import Origin, read_json, write_json
from driving.demonstrating import PERFECT, Shown, show, show_rest, successes
from driving.episodes import TRAINING, Driven, Driver, Expert, Worlds, drive
from driving.methods import METHODS
from driving.processes import spread
from driving.results import ENOUGH
from driving.running import success_of
from driving.task import Task
from driving.tasks import task_named

#: Demonstrations to begin with.
FIRST = 2
#: How late the expert takes over at first, in steps before the failure.
_STEPS_BEFORE = 10
#: Training episodes driven at a time, of which all after the first failure are forgotten; how many
#: a set has; and after how many without a failure nobody goes on.
_AT_A_TIME, _EPISODES, _PATIENCE = 10, 10_000, 200


class Mode(Enum):
    """What is shown at a failure."""

    FAILED = "failed"
    TAKEOVER = "takeover"
    WHOLE = "whole"


@dataclass(frozen=True, slots=True)
class Stage:
    """What was learned after some corrections."""

    demonstrations: int
    rows: int
    """Of all demonstrations."""
    episodes: int
    """Training episodes so far."""
    success: float
    """Share of the fresh episodes."""


@dataclass(frozen=True, slots=True)
class Course:
    """A learner from its first demonstrations to the last correction."""

    task: str
    number: int
    """Of the set."""
    mode: Mode
    stages: tuple[Stage, ...]
    """At least one."""
    reached: bool
    """Whether it does as well as the expert in the end."""

    @property
    def last(self) -> Stage:
        return self.stages[-1]

    def as_json(self) -> dict[str, object]:
        """As an object."""
        return {
            "task": self.task,
            "set": self.number,
            "mode": self.mode.value,
            "reached": self.reached,
            "stages": [asdict(one) for one in self.stages],
        }

    def after(self, corrections: int) -> Stage:
        """After so many corrections, or after the last one if there were fewer."""
        return self.stages[min(corrections, len(self.stages) - 1)]


@dataclass(frozen=True, slots=True)
class Job:
    """One course, and where it is kept."""

    task: str
    number: int
    mode: Mode
    method: str
    most: int
    """Corrections."""
    episodes: int
    """Fresh ones."""
    directory: Path
    origin: Origin

    @property
    def path(self) -> Path:
        return self.directory / self.task / f"{self.number}-{self.mode.value}-{self.method}.json"

    @property
    def made_by(self) -> str:
        return f"{self.origin.text(ours=True)}; {self.most} corrections"


def run(jobs: Sequence[Job], workers: int, tell: Callable[[str], None]) -> tuple[Course, ...]:
    """Makes the courses that are missing, and returns all."""
    missing = [job for job in jobs if read_json(job.path, job.made_by) is None]
    for done, job in enumerate(spread(_work, missing, workers), start=1):
        tell(f"{done} of {len(missing)}  {job.task}, set {job.number}, {job.mode.value}")
    return tuple(_course(job, read_json(job.path, job.made_by) or {}) for job in jobs)


def _work(job: Job) -> Job:
    course = correct(job)
    write_json(job.path, course.as_json() | {"made_by": job.made_by})
    return job


def _course(job: Job, data: dict[str, Any]) -> Course:
    stages = tuple(Stage(**one) for one in data["stages"])
    return Course(job.task, job.number, job.mode, stages, data["reached"])


def correct(job: Job) -> Course:
    """Lets a learner drive and corrects it."""
    task, worlds = task_named(job.task), Worlds(job.task)
    enough = ENOUGH * success_of(worlds, Expert(worlds), job.episodes)
    further = successes(task, job.number)
    shown = [next(further) for _ in range(FIRST)]
    training = _Training(worlds, TRAINING + _EPISODES * job.number)
    stages: list[Stage] = []
    while True:
        driver = METHODS[job.method](task, shown).driver
        success = success_of(worlds, driver, job.episodes)
        stages.append(Stage(len(shown), sum(map(len, shown)), training.driven, success))
        if success >= enough or len(stages) > job.most:
            break
        correction = _correction(job.mode, task, training.failures(driver), further)
        if correction is None:
            break
        shown.append(correction)
    return Course(job.task, job.number, job.mode, tuple(stages), success >= enough)


class _Training:
    """Training episodes, one after the other."""

    def __init__(self, worlds: Worlds, first: int) -> None:
        self._worlds = worlds
        self._first = self._next = first

    @property
    def driven(self) -> int:
        """How many so far."""
        return self._next - self._first

    def failures(self, driver: Driver) -> Iterator[tuple[int, Driven]]:
        """Seeds and episodes that fail, until none has for long."""
        patience = _PATIENCE
        while patience > 0:
            seeds = range(self._next, self._next + _AT_A_TIME)
            for seed, episode in zip(seeds, drive(self._worlds, driver, seeds), strict=True):
                # Those after a failure that is corrected are driven again, by a better driver.
                self._next = seed + 1
                patience -= 1
                if not episode.success:
                    patience = _PATIENCE
                    yield seed, episode


def _correction(
    mode: Mode, task: Task, failures: Iterator[tuple[int, Driven]], further: Iterator[Shown]
) -> Shown | None:
    """What is shown at the first failure of which the expert does better; None without one."""
    for seed, episode in failures:
        shown = _shown_at(mode, task, seed, episode, further)
        if shown is not None:
            return shown
    return None


def _shown_at(
    mode: Mode, task: Task, seed: int, episode: Driven, further: Iterator[Shown]
) -> Shown | None:
    """What is shown at a failure; None where the expert cannot do it either."""
    match mode:
        case Mode.WHOLE:
            return next(further)
        case Mode.FAILED:
            return show(task, seed)
        case Mode.TAKEOVER:
            return taken_over(task, seed, episode.actions)


def taken_over(task: Task, seed: int, done: Sequence[str]) -> Shown | None:
    """The rest of an episode that failed, from as late as it can still be saved.

    Args:
        task: What was driven.
        seed: Of the episode.
        done: What was done in it.

    Returns:
        None where the expert fails from its start, too.
    """
    before = _STEPS_BEFORE
    while before < len(done):
        state = task.reset(seed)
        for action in done[:-before]:
            state = task.step(action)
        rest = show_rest(task, state, PERFECT, random.Random(seed))
        if rest is not None:
            return rest
        before *= 2
    return show(task, seed)
