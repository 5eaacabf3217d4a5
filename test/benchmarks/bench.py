"""As fast as the limit allows: what we take and what cannot be beaten, measured in turn.

    PYTHONPATH=.:test python test/benchmarks/bench.py [--only tick,predict] [--rounds N] [--quick]

Prints one table and writes bench-results/bench.json.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import checking
import learning
import node_rows
import reading
import relearning
import robot_nodes
import robot_reading
import running
import studio_rows
from harness import CHECKOUT, Figure, Settings, table, write

ROWS: dict[str, Callable[[Settings], list[Figure]]] = {
    "tick": running.tick,
    "predict": running.predict,
    "check": checking.check_rules,
    "bag": reading.bag,
    "robot-bag": robot_reading.robot_bag,
    "recording": reading.recording,
    "rules": learning.rules,
    "relearn": learning.relearn,
    "relearn-large": learning.relearn_large,
    "relearn-again": relearning.one_more,
    "relearn-live": relearning.among_nodes,
    "rest": node_rows.rest,
    "recorder": node_rows.recorder_cpu,
    "latency": node_rows.latency,
    "studio-start": studio_rows.start,
    "studio-ticks": studio_rows.ticks,
    "robot-recorder": robot_nodes.recorder_cpu,
    "robot-latency": robot_nodes.latency,
    "growth": learning.growth,
    "worst": learning.worst,
}


def measure(names: list[str], settings: Settings) -> list[Figure]:
    """All figures of some rows, each of which is told when it begins and what it found."""
    figures: list[Figure] = []
    for name in names:
        start = time.perf_counter()
        print(f"{name} ...", file=sys.stderr, flush=True)
        directory = Path(tempfile.mkdtemp(prefix=f"bench-{name}-", dir=settings.directory))
        try:
            found = ROWS[name](Settings(settings.rounds, settings.quick, directory))
        finally:
            shutil.rmtree(directory)
        for one in found:
            print(f"  {one.name}: {one.ratio:.3g} {one.detail}", file=sys.stderr)
        print(f"  {time.perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
        figures += found
    return figures


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default=",".join(ROWS), help="rows, with commas between")
    parser.add_argument("--rounds", type=int, default=5, help="alternating runs")
    parser.add_argument("--quick", action="store_true", help="small sizes, meaningless figures")
    parser.add_argument("--results", type=Path, default=CHECKOUT / "bench-results" / "bench.json")
    options = parser.parse_args(arguments)
    names = options.only.split(",")
    unknown = sorted(set(names) - set(ROWS))
    if unknown:
        parser.error(f"there is no row {unknown[0]!r}: choose of {', '.join(ROWS)}.")
    directory = Path(tempfile.mkdtemp(prefix="bench-"))
    try:
        figures = measure(names, Settings(options.rounds, options.quick, directory))
    finally:
        shutil.rmtree(directory)
    python = f"{platform.python_implementation()} {platform.python_version()}"
    print(f"{platform.machine()}, {os.cpu_count()} cores, {python}, {options.rounds} rounds")
    print(table(figures))
    write(options.results, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
