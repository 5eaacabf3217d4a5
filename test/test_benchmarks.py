"""The benchmarks run, in sizes that tell nothing about speed: nothing is said of times here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
BENCHMARKS = CHECKOUT / "test" / "benchmarks"


def test_the_benchmarks_print_a_table_that_lines_up_and_write_their_figures(
    tmp_path: Path,
) -> None:
    results = tmp_path / "results" / "bench.json"
    # What is tested comes first: the installed package, if that is.
    path = [*sys.path, str(CHECKOUT), str(CHECKOUT / "test"), str(BENCHMARKS)]
    done = subprocess.run(
        [
            sys.executable,
            str(BENCHMARKS / "bench.py"),
            *("--quick", "--rounds", "1", "--only", "tick,bag,rules"),
            *("--results", str(results)),
        ],
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, path))),
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    figures = json.loads(results.read_text())
    assert len(figures) >= 4
    for one in figures:
        assert {"name", "ratio", "goal", "met"} <= set(one)
        assert one["met"] is (one["ratio"] <= one["goal"])
    _, header, *lines = done.stdout.splitlines()
    assert [line.split("  ")[0] for line in lines] == [one["name"] for one in figures]
    goal = header.index("goal") + len("goal")
    assert all(line[:goal].split("<= ")[1] for line in lines)
