"""What all benchmarks share: runs in alternation, their spread, the table and the JSON file.

limit
    What cannot be beaten by much, or a peer that does the same, measured in the same run.
ratio
    Our least measurement by the limit's least one: the runs that other work on the machine
    disturbed least.  Where a row is no comparison, it is the measurement itself: of peak memory
    and of worst cases the largest one.
"""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True)
class Settings:
    """How much to measure."""

    rounds: int
    """Alternating runs of every row."""
    quick: bool
    """Whether sizes are so small that the figures mean nothing: it shows that all rows work."""
    directory: Path
    """For files; empty at the start."""

    def size(self, full: int, quick: int) -> int:
        return quick if self.quick else full


@dataclass(frozen=True, slots=True)
class Spread:
    """Measurements of one subject."""

    measured: tuple[float, ...]

    @property
    def least(self) -> float:
        return min(self.measured)

    @property
    def most(self) -> float:
        return max(self.measured)

    @property
    def three(self) -> tuple[float, float, float]:
        """Minimum, median and maximum."""
        return self.least, median(self.measured), self.most


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of the table."""

    name: str
    ratio: float
    goal: float | None
    """At most so much; None where the figure is for information."""
    ours: Spread | None = None
    limit: Spread | None = None
    unit: str = ""
    """Of `ours` and `limit`."""
    detail: str = ""

    @property
    def met(self) -> bool:
        return self.goal is None or self.ratio <= self.goal


def compared(
    name: str,
    spreads: Mapping[str, Spread],
    goal: float | None,
    unit: str = "s",
    detail: str = "",
) -> Figure:
    """Our time by the limit's; `spreads` has "ours" and "limit"."""
    ours, limit = spreads["ours"], spreads["limit"]
    return Figure(name, ours.least / limit.least, goal, ours, limit, unit, detail)


def alternate(subjects: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, Spread]:
    """Lets the subjects measure themselves in turn, so many times each."""
    measured: dict[str, list[float]] = {name: [] for name in subjects}
    for number in range(rounds):
        # Each goes first in every other round: what is cached or warm favours none.
        names = list(subjects) if number % 2 == 0 else list(reversed(subjects))
        for name in names:
            measured[name].append(subjects[name]())
    return {name: Spread(tuple(one)) for name, one in measured.items()}


def timed(subject: Callable[[], object], times: int = 1) -> Callable[[], float]:
    """Seconds of wall time of one call, on average over `times` calls in a row."""

    def measure() -> float:
        gc.collect()
        start = time.perf_counter()
        for _ in range(times):
            subject()
        return (time.perf_counter() - start) / times

    return measure


def in_a_process(script: Path, *arguments: str, timeout: float | None = None) -> dict[str, Any]:
    """What a script prints as JSON, in a process of its own.

    Raises:
        subprocess.TimeoutExpired: It took longer than `timeout` (seconds), and was killed.
    """
    answer = subprocess.run(
        [sys.executable, str(script), *arguments],
        check=True,
        stdout=subprocess.PIPE,
        timeout=timeout,
    )
    found: dict[str, Any] = json.loads(answer.stdout)
    return found


def peak_memory() -> int:
    """The most memory that this process has held since `forget_peak` (bytes)."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def forget_peak() -> None:
    """Lets the peak begin at what is held now."""
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")


_COLUMNS = ("limit: min", "median", "max", "ours: min", "median", "max", "", "ratio", "goal", "")


def table(figures: Iterable[Figure]) -> str:
    """The figures as a table with aligned columns."""
    lines = [("what", *_COLUMNS), *map(_cells, figures)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    left = {0, 7, 10}
    return "\n".join(
        "  ".join(
            cell.ljust(width) if column in left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def _cells(figure: Figure) -> tuple[str, ...]:
    goal = "" if figure.goal is None else f"<= {figure.goal:g}"
    met = "" if figure.goal is None else "met" if figure.met else "MISSED"
    unit = figure.unit if figure.ours else ""
    spreads = (*_numbers(figure.limit), *_numbers(figure.ours))
    return (figure.name, *spreads, unit, _short(figure.ratio), goal, met)


def _numbers(spread: Spread | None) -> Sequence[str]:
    return ("", "", "") if spread is None else tuple(map(_short, spread.three))


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 1000 else f"{number:.3g}"


def write(path: Path, figures: Iterable[Figure]) -> None:
    """Writes the figures as a list of objects."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(list(map(_as_json, figures)), indent=2) + "\n")


def _as_json(figure: Figure) -> dict[str, object]:
    spreads = {
        name: list(spread.three)
        for name, spread in (("ours", figure.ours), ("limit", figure.limit))
        if spread is not None
    }
    return {
        "name": figure.name,
        "ratio": round(figure.ratio, 4),
        "goal": figure.goal,
        "met": figure.met,
        "unit": figure.unit,
        "detail": figure.detail,
        **spreads,
    }


def latencies(
    label: str, ours: Sequence[Sequence[float]], limit: Sequence[Sequence[float]]
) -> list[Figure]:
    """A figure for the median and one for the 99th percentile of durations.

    Args:
        label: What they are of, with a place for the name of the percentile.
        ours: Milliseconds, round by round.
        limit: The same of what ours is compared with.
    """
    figures = []
    for name, place in (("p50", 49), ("p99", 98)):
        one, other = (
            Spread(tuple(quantiles(trips, n=100)[place] for trips in rounds))
            for rounds in (ours, limit)
        )
        figures.append(Figure(label.format(name), one.least / other.least, 1.3, one, other, "ms"))
    return figures
