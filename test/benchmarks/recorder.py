"""What the recorder holds and what it costs, measured: kills, load, CPU per message, reading.

    PYTHONPATH=.:test python test/benchmarks/recorder.py [--kills N] [--seconds S] [--rounds N]
        [--rows N] [--only kills,load,freezes,relearn,cpu,read]

Prints a table and writes bench-results/recorder.json.  `pandas.read_csv` is a peer in reading where
it is installed.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

import numpy as np
from recorder_trials import (
    WIDTH,
    Load,
    cpu_seconds,
    kill_recorders,
    large_recording,
    load_recorder,
    relearn_meanwhile,
)
from ros_processes import NodeProcess, own_domain

from rebt_ros.demonstration.table import tabulate
from rebt_ros.storage.recording import read_recording
from rebt_ros.storage.recording_rows import LABEL, record_type

CHECKOUT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Figure:
    """One line of the table."""

    name: str
    ratio: float
    """What was measured; a ratio of medians where the name says "/", else a number."""
    goal: float
    """At most so much."""
    met: bool
    detail: str = ""


def figure(name: str, value: float, goal: float, detail: str = "") -> Figure:
    return Figure(name, round(value, 3), goal, value <= goal, detail)


def kills(count: int, directory: Path) -> list[Figure]:
    """kill -9 at random moments under 1 kHz states and 50 Hz actions."""
    result = kill_recorders(count, directory, random.Random())
    detail = ", ".join(f"{name} {value}" for name, value in asdict(result).items())
    return [
        figure(f"acknowledged rows lost in {count} kills", result.lost, 0, detail),
        figure("gaps within the recordings", result.gaps, 0),
        figure("torn tails not noticed", result.torn - result.noticed, 0),
    ]


def load(seconds: float, directory: Path) -> list[Figure]:
    """2 kHz states of 24 values and 100 Hz actions."""
    result = load_recorder(seconds, directory)
    settled = result.memory[min(10, len(result.memory) // 3) :]
    detail = (
        f"{result.states} states and {result.actions} actions sent, {result.messages} messages "
        f"taken, {result.rows} rows, {result.misplaced} with another state than at sending; "
        f"{result.cpu:.2f} of a core; {settled[-1]:.0f} MB at the end; {result.faults}"
    )
    sent = result.states + result.actions
    return [
        figure(f"rows lost in {seconds:g} s of load", result.actions - result.rows, 0, detail),
        figure("messages dropped", sent - result.messages, 0),
        figure("growth of memory (MB)", max(settled) - settled[0], 10),
    ]


def freezes(seconds: float, directory: Path) -> list[Figure]:
    """1 kHz states, and the recorder stands still again and again.

    What the transport drops is sent again after 3 s; the publisher keeps its last 5000 messages.
    """
    count = max(1, round(seconds / 10))
    result = load_recorder(seconds, directory, state_rate=1000, freezes=[0.7] * count)
    name = f"while it stood still {count} times for 0.7 s"
    detail = (
        f"{result.states} states and {result.actions} actions sent, {result.rows} rows, "
        f"{result.lost_messages} messages lost"
    )
    return [
        figure(f"rows lost {name}", result.actions - result.rows, 0, detail),
        figure(f"rows with another state {name}", result.misplaced, 0),
    ]


def relearn(seconds: float, directory: Path) -> list[Figure]:
    """1 kHz states, 100 Hz actions and ticks, half of the time during a relearn of many rows."""
    table = directory / "table"
    table.mkdir()
    large_recording(1_000_000, table)
    result = relearn_meanwhile(seconds, directory, table)

    def spread(intervals: list[float]) -> str:
        off = np.abs(np.array(intervals) - 10.0)
        p50, p99 = np.percentile(off, (50, 99))
        return f"{p50:.2f} / {p99:.2f} / {off.max():.1f} ms"

    resting, learning = (
        float(np.percentile(np.abs(np.array(one) - 10.0), 99))
        for one in (result.resting, result.learning)
    )
    detail = (
        f"off 10 ms, p50 / p99 / max: {spread(result.resting)} of {len(result.resting)} ticks at "
        f"rest, {spread(result.learning)} of {len(result.learning)} during a relearn; "
        f"{result.lost_messages} messages lost by the recorder"
    )
    return [
        figure(
            "jitter of ticks during a relearn - at rest (p99, ms)", learning - resting, 5, detail
        ),
        figure("rows lost", result.actions - result.rows, 0),
        figure("rows with another state", result.misplaced, 0),
        figure("commands missed or doubled", result.ticks_without_command + result.missed, 0),
    ]


def cpu(rounds: int, directory: Path) -> list[Figure]:
    """CPU seconds per message at 1 kHz, of the recorder and of empty subscribers in turn."""
    measured: dict[str, list[float]] = {"single": [], "events": [], "recorder": []}
    for _ in range(rounds):
        for subject, costs in measured.items():
            costs.append(_cost(subject, Path(tempfile.mkdtemp(dir=directory))))
    best = min(("single", "events"), key=lambda one: median(measured[one]))
    detail = "; ".join(
        f"{subject} {min(costs):.0f} / {median(costs):.0f} / {max(costs):.0f} µs"
        for subject, costs in measured.items()
    )
    ratio = median(measured["recorder"]) / median(measured[best])
    return [figure(f"CPU per message / empty subscriber ({best} executor)", ratio, 1.2, detail)]


def _cost(subject: str, directory: Path) -> float:
    """Microseconds of CPU per message."""
    with own_domain() as domain, _subject(subject, domain, directory) as process:
        before = cpu_seconds(process.pid)
        with Load(domain, 1000, 50, WIDTH, 5.0) as publisher:
            while not (sent := publisher.sent()):
                time.sleep(0.1)
        return (cpu_seconds(process.pid) - before) / sum(sent.values()) * 1e6


@contextmanager
def _subject(subject: str, domain: int, directory: Path) -> Iterator[subprocess.Popen[bytes]]:
    if subject == "recorder":
        with NodeProcess("recorder_node", domain, directory) as recorder:
            recorder.says("recording ")
            yield recorder.process
        return
    script = CHECKOUT / "test" / "benchmarks" / "empty_subscriber.py"
    environment = dict(
        os.environ, ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST"
    )
    with subprocess.Popen(
        [sys.executable, str(script), subject], env=environment, stdout=subprocess.PIPE
    ) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process
        finally:
            process.kill()


def read(rows: int, rounds: int, directory: Path) -> list[Figure]:
    """Reading a recording, against numpy alone, and pandas reading the same table as CSV."""
    small = large_recording(min(rows, 1_000_000), directory)
    peers: dict[str, Callable[[], object]] = {
        "read_recording": lambda: read_recording(small),
        "numpy": lambda: _numpy_alone(small),
    }
    if importlib.util.find_spec("pandas"):
        import pandas

        table = as_csv(small, min(rows, 200_000))
        peers["pandas"] = lambda: pandas.read_csv(table)
    measured: dict[str, list[float]] = {name: [] for name in peers}
    for _ in range(rounds):
        for name, peer in peers.items():
            start = time.perf_counter()
            peer()
            count = min(rows, 200_000) if name == "pandas" else min(rows, 1_000_000)
            measured[name].append((time.perf_counter() - start) / count * 1e6)
    detail = "; ".join(
        f"{name} {min(one):.2f} / {median(one):.2f} / {max(one):.2f} s per million rows"
        for name, one in measured.items()
    )
    ours = median(measured["read_recording"])
    figures = [figure("reading / numpy alone", ours / median(measured["numpy"]), 1.2, detail)]
    if "pandas" in measured:
        figures.append(figure("reading / pandas.read_csv", ours / median(measured["pandas"]), 1.2))
    large = large_recording(rows, directory)
    seconds, reading, joining = _peak_memory(large)
    detail = f"{rows} rows x {WIDTH} in {seconds:.1f} s"
    return [
        *figures,
        figure("peak memory of reading / table", reading, 4, detail),
        figure("peak memory of reading and tabulating / table", joining, 4),
    ]


def as_csv(path: Path, rows: int) -> Path:
    demonstration = read_recording(path).demonstration
    names = [feature.name for feature in demonstration.features]
    with path.with_suffix(".table").open("w") as file:
        print("stamp", "channel", "action", *names, sep=",", file=file)
        for row in range(rows):
            action = demonstration.actions[demonstration.chosen[row]]
            values = map(repr, demonstration.states[row].tolist())
            print(demonstration.stamps[row], "action", action, *values, sep=",", file=file)
    return path.with_suffix(".table")


def _numpy_alone(path: Path) -> tuple[object, ...]:
    """The columns that make a table, read as docs/formats.md shows."""
    with path.open("rb") as file:
        file.readline()
        records = np.fromfile(file, record_type(WIDTH))
    rows = records[records["channel"] != LABEL]
    codes = (rows[name].astype(np.int64) for name in ("action", "channel"))
    return rows["stamp"].copy(), *codes, np.ascontiguousarray(rows["state"])


def _peak_memory(path: Path) -> tuple[float, float, float]:
    """Seconds of reading; peaks of reading and of tabulating too, as multiples of the table."""
    answer = subprocess.run(
        [sys.executable, __file__, "--memory", str(path)], check=True, stdout=subprocess.PIPE
    )
    seconds, reading, joining = json.loads(answer.stdout)
    return seconds, reading, joining


def report_memory(path: Path) -> None:
    """Prints what `_peak_memory` returns; in a process of its own."""

    def peak() -> int:
        status = Path("/proc/self/status").read_text()
        return 1024 * int(status.split("VmHWM:")[1].split()[0])

    before = peak()
    start = time.perf_counter()
    demonstration = read_recording(path).demonstration
    seconds = time.perf_counter() - start
    table = demonstration.states.nbytes
    reading = (peak() - before) / table
    tabulate([demonstration])
    print(json.dumps([seconds, reading, (peak() - before) / table]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--rows", type=int, default=5_000_000)
    parser.add_argument("--only", default="kills,load,freezes,relearn,cpu,read")
    parser.add_argument("--memory", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.memory:
        report_memory(options.memory)
        return 0
    trials: dict[str, Callable[[Path], list[Figure]]] = {
        "kills": lambda directory: kills(options.kills, directory),
        "load": lambda directory: load(options.seconds, directory),
        "freezes": lambda directory: freezes(options.seconds, directory),
        "relearn": lambda directory: relearn(options.seconds, directory),
        "cpu": lambda directory: cpu(options.rounds, directory),
        "read": lambda directory: read(options.rows, options.rounds, directory),
    }
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    figures: list[Figure] = []
    for name in options.only.split(","):
        directory = Path(tempfile.mkdtemp(prefix=f"bench-{name}-"))
        try:
            found = trials[name](directory)
        finally:
            shutil.rmtree(directory)
        for one in found:
            print(
                f"{one.name:60} {one.ratio:10g}  <= {one.goal:<6g} {'met' if one.met else 'MISSED'}"
            )
            if one.detail:
                print(f"    {one.detail}", flush=True)
        figures += found
    results = CHECKOUT / "bench-results" / "recorder.json"
    results.parent.mkdir(exist_ok=True)
    results.write_text(json.dumps([asdict(one) for one in figures], indent=2) + "\n")
    return 0 if all(one.met for one in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
