"""Makes results: demonstrations, learning, driving; several sets at a time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from driving.cells import Store
from driving.demonstrating import (
    PERFECT,
    Demonstrator,
    Shown,
    UselessDemonstratorError,
    demonstrations,
)
from driving.episodes import Driver, Expert, Worlds, drive, fresh
from driving.methods import METHODS
from driving.processes import spread
from driving.results import EXPERT, Cell, Result
from driving.task import Task
from driving.tasks import task_named
from rebt_ros.errors import RebtError


@dataclass(frozen=True, slots=True)
class Plan:
    """What is measured."""

    tasks: tuple[str, ...]
    counts: tuple[int, ...]
    """Numbers of demonstrations."""
    sets: tuple[int, ...]
    """Numbers of demonstration sets."""
    methods: tuple[str, ...]
    episodes: int = 50
    """Fresh ones for each cell."""
    demonstrator: Demonstrator = PERFECT

    @property
    def cells(self) -> Iterator[Cell]:
        """All, task by task, each after its expert."""
        for task in self.tasks:
            yield Cell(task, 0, 0, EXPERT)
            for number in self.sets:
                for n in self.counts:
                    yield from (Cell(task, number, n, method) for method in self.methods)

    @property
    def settings(self) -> str:
        """What the results depend on beside their cells."""
        who = self.demonstrator
        return f"{self.episodes} episodes, late {who.late}, wrong {who.wrong:g}"


@dataclass(frozen=True, slots=True)
class Job:
    """The cells of one set, which share demonstrations and worlds."""

    task: str
    number: int
    cells: tuple[Cell, ...]
    episodes: int
    demonstrator: Demonstrator
    store: Store


def run(plan: Plan, store: Store, workers: int, tell: Callable[[str], None]) -> None:
    """Makes the results that are missing.

    Args:
        plan: What is measured.
        store: Where results are kept.
        workers: Processes.
        tell: Is told what was done, line by line.
    """
    jobs = _jobs(plan, store)
    done, count = 0, sum(len(job.cells) for job in jobs)
    start = time.monotonic()
    for job, note in spread(work, jobs, workers):
        done += len(job.cells)
        seconds = time.monotonic() - start
        what = f"{job.task}, set {job.number}"
        tell(f"{seconds:6.0f} s  {done} of {count}  {what}{f': {note}' if note else ''}")


def _jobs(plan: Plan, store: Store) -> tuple[Job, ...]:
    by_set: dict[tuple[int, str], list[Cell]] = {}
    for cell in store.missing(plan.cells):
        by_set.setdefault((cell.number, cell.task), []).append(cell)
    # Set by set, so that an interrupted run has some of every task.
    return tuple(
        Job(task, number, tuple(its), plan.episodes, plan.demonstrator, store)
        for (number, task), its in sorted(by_set.items(), key=lambda item: item[0][0])
    )


def work(job: Job) -> tuple[Job, str]:
    """Does a job; returns it with what is to be said about it."""
    task, worlds = task_named(job.task), Worlds(job.task)
    most = max(cell.n for cell in job.cells)
    try:
        shown = demonstrations(task, job.number, most, job.demonstrator)
    except UselessDemonstratorError as error:
        return job, str(error)
    for cell in job.cells:
        if cell.method == EXPERT:
            success = success_of(worlds, Expert(worlds), job.episodes)
            job.store.write(Result(cell, success))
        else:
            job.store.write(measured(cell, task, shown[: cell.n], worlds, job.episodes))
    return job, ""


def measured(
    cell: Cell, task: Task, shown: Sequence[Shown], worlds: Worlds, episodes: int
) -> Result:
    """What a method makes of demonstrations, and how that drives."""
    rows = sum(map(len, shown))
    try:
        made = METHODS[cell.method](task, shown)
    except RebtError as error:
        # Who refuses to learn drives nowhere.
        return Result(cell, 0.0, rows=rows, refusal=str(error))
    success = success_of(worlds, made.driver, episodes)
    return Result(cell, success, made.nodes, rows, made.seconds, about=made.about)


def success_of(worlds: Worlds, driver: Driver, episodes: int) -> float:
    """Share of the fresh episodes."""
    return share(one.success for one in drive(worlds, driver, fresh(episodes)))


def share(outcomes: Iterable[bool]) -> float:
    """Of those that are true; there is one at least."""
    known = tuple(outcomes)
    return sum(known) / len(known)
