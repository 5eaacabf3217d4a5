"""What the recorder holds and what it costs, measured: kills, load, CPU per message, reading.

    PYTHONPATH=.:test python test/benchmarks/recorder.py [--kills N] [--seconds S] [--rounds N]
        [--rows N] [--only kills,load,freezes,relearn,cpu,read]

Prints tables and writes bench-results/recorder.json.  `pandas.read_csv` is a peer in reading where
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
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from harness import (
    CHECKOUT,
    Figure,
    Spread,
    alternate,
    compared,
    in_a_process,
    peak_memory,
    table,
    timed,
    write,
)
from recorder_trials import (
    WIDTH,
    Load,
    cpu_seconds,
    kill_recorders,
    large_recording,
    load_recorder,
    relearn_meanwhile,
)
from ros_processes import NodeProcess, own_domain, wait_until

from rebt_ros.demonstration.table import tabulate
from rebt_ros.storage.recording import read_recording
from rebt_ros.storage.recording_rows import LABEL, record_type


def kills(count: int, directory: Path) -> list[Figure]:
    """kill -9 at random moments under 1 kHz states and 50 Hz actions."""
    result = kill_recorders(count, directory, random.Random())
    detail = ", ".join(f"{name} {value}" for name, value in asdict(result).items())
    return [
        Figure(f"acknowledged rows lost in {count} kills", result.lost, 0, detail=detail),
        Figure("gaps within the recordings", result.gaps, 0),
        Figure("torn tails not noticed", result.torn - result.noticed, 0),
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
        Figure(
            f"rows lost in {seconds:g} s of load", result.actions - result.rows, 0, detail=detail
        ),
        Figure("messages dropped", sent - result.messages, 0),
        Figure("growth of memory (MB)", max(settled) - settled[0], 10),
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
        Figure(f"rows lost {name}", result.actions - result.rows, 0, detail=detail),
        Figure(f"rows with another state {name}", result.misplaced, 0),
    ]


def relearn(seconds: float, directory: Path) -> list[Figure]:
    """1 kHz states, 100 Hz actions and ticks, half of the time during a relearn of many rows."""
    learned_from = directory / "table"
    learned_from.mkdir()
    large_recording(1_000_000, learned_from)
    result = relearn_meanwhile(seconds, directory, learned_from)

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
        Figure(
            "jitter of ticks during a relearn - at rest (p99, ms)",
            learning - resting,
            5,
            detail=detail,
        ),
        Figure("rows lost", result.actions - result.rows, 0),
        Figure("rows with another state", result.misplaced, 0),
        Figure("commands missed or doubled", result.ticks_without_command + result.missed, 0),
    ]


def cpu(rounds: int, directory: Path) -> list[Figure]:
    """CPU seconds per message at 1 kHz, of the recorder and of empty subscribers in turn."""
    found = alternate(
        {
            subject: partial(_cost, subject, directory)
            for subject in ("recorder", "single", "events")
        },
        rounds,
    )
    best, other = sorted(("single", "events"), key=lambda one: found[one].least)
    name = f"recorder, CPU per message at 1 kHz / empty subscriber ({best} executor)"
    detail = f"with the {other} executor: {found[other].least:.0f} µs"
    return [compared(name, {"ours": found["recorder"], "limit": found[best]}, 1.2, "µs", detail)]


def _cost(subject: str, directory: Path) -> float:
    """Microseconds of CPU per message."""
    own = Path(tempfile.mkdtemp(dir=directory))
    with own_domain() as domain, _subject(subject, domain, own) as process:
        before = cpu_seconds(process.pid)
        with Load(domain, 1000, 50, WIDTH, 5.0) as publisher:
            sent = wait_until(publisher.sent, what="the end of the load")
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
    count = min(rows, 1_000_000)
    small = large_recording(count, directory)
    peers = {
        "ours": _per_million(lambda: read_recording(small), count),
        "numpy": _per_million(lambda: _numpy_alone(small), count),
    }
    if importlib.util.find_spec("pandas"):
        import pandas

        fewer = min(rows, 200_000)
        text = as_csv(small, fewer)
        peers["pandas.read_csv"] = _per_million(lambda: pandas.read_csv(text), fewer)
    found = alternate(peers, rounds)
    ours = found.pop("ours")
    figures = [
        compared(f"recording -> table, a million rows / {name}", {"ours": ours, "limit": peer}, 1.2)
        for name, peer in found.items()
    ]
    large = large_recording(rows, directory)
    memory = [in_a_process(Path(__file__), "--memory", str(large)) for _ in range(rounds)]
    return [*figures, *(_peak(what, memory) for what in ("reading", "reading and tabulating"))]


def _per_million(subject: Callable[[], object], rows: int) -> Callable[[], float]:
    measure = timed(subject)
    return lambda: measure() / rows * 1e6


def _peak(what: str, found: list[dict[str, float]]) -> Figure:
    peaks = Spread(tuple(one[what] for one in found))
    detail = f"{found[0]['rows']:,} rows x {WIDTH} in {min(one['seconds'] for one in found):.1f} s"
    return Figure(f"peak memory of {what} / table", peaks.most, 4, peaks, None, "x", detail)


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


def report_memory(path: Path) -> None:
    """Prints peaks as multiples of the table, and seconds; in a process of its own."""
    before = peak_memory()
    start = time.perf_counter()
    demonstration = read_recording(path).demonstration
    seconds = time.perf_counter() - start
    size = demonstration.states.nbytes
    found = {"rows": len(demonstration.states), "seconds": seconds}
    found["reading"] = (peak_memory() - before) / size
    tabulate([demonstration])
    found["reading and tabulating"] = (peak_memory() - before) / size
    print(json.dumps(found))


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
        print(table(found))
        for one in found:
            if one.detail:
                print(f"    {one.name}: {one.detail}", flush=True)
        figures += found
    write(CHECKOUT / "bench-results" / "recorder.json", figures)
    return 0 if all(one.met for one in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
