"""Benchmarks of many rows: a relearn after one more demonstration, and tables beyond the memory.

    PYTHONPATH=.:test:test/benchmarks python test/benchmarks/relearning.py [--rows 20000000]

Learns from so many rows in a process that may hold less data than the table has, and prints what
that took as JSON.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import threading
import time
from pathlib import Path
from typing import Final

from fleet import ROWS, WIDTH, write_recordings
from harness import Figure, Settings, Spread, compared

import rebt_ros
from rebt_ros.live.learning_process import LearningProcess, Request

#: Recordings of the limit's relearn, and of ours before one more is shown.
_FEW, _MANY = 100, 1000
#: Of the size of the table, what a process may hold in memory of its own.
_HELD: Final = 0.8
#: Rows of a recording of the very large table.
_LONG: Final = 10_000


def one_more(settings: Settings) -> list[Figure]:
    """The running learner's process: a million rows and a thousand new ones, or 100,000 rows."""
    few, many = settings.size(_FEW, 2), settings.size(_MANY, 4)
    directories = {"limit": settings.directory / "few", "ours": settings.directory / "many"}
    write_recordings(directories["limit"], 0, few)
    write_recordings(directories["ours"], 0, many)
    processes = {name: LearningProcess() for name in directories}
    measured: dict[str, list[float]] = {name: [] for name in directories}

    def ask(name: str) -> float:
        start = time.perf_counter()
        request = Request(str(directories[name]), {})
        processes[name].ask(request, cancelled=threading.Event())
        return time.perf_counter() - start

    try:
        for name in directories:
            ask(name)
        for number in range(settings.rounds):
            write_recordings(directories["ours"], many + number, 1)
            for name, seconds in measured.items():
                seconds.append(ask(name))
    finally:
        for process in processes.values():
            process.close()
    spreads = {name: Spread(tuple(seconds)) for name, seconds in measured.items()}
    name = f"relearn, {many * ROWS:,} rows x {WIDTH} and {ROWS:,} new ones / {few * ROWS:,} rows"
    return [compared(name, spreads, 2)]


def beyond_memory(rows: int, directory: Path) -> dict[str, object]:
    """Learns from more rows than the process may hold, and tells what it held."""
    write_recordings(directory, 0, rows // _LONG, _LONG)
    table = 8 * rows * WIDTH
    limit = int(_HELD * table)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    held, over = [0], threading.Event()

    def watch() -> None:
        while not over.wait(0.1):
            status = Path("/proc/self/status").read_text()
            held[0] = max(held[0], 1024 * int(status.split("RssAnon:")[1].split()[0]))

    watcher = threading.Thread(target=watch)
    watcher.start()
    start, used = time.perf_counter(), time.process_time()
    try:
        found = rebt_ros.learn(directory, options=rebt_ros.LearnOptions(max_depth=10))
    finally:
        over.set()
        watcher.join()
    sample = found.learnings[0].report.sample
    return {
        "rows": rows,
        "table_gb": table / 1e9,
        "limit_gb": limit / 1e9,
        "peak_gb": held[0] / 1e9,
        "s": time.perf_counter() - start,
        "cpu_s": time.process_time() - used,
        "agreement": found.learned.provenance.figures.own_history_agreement,
        "sample": None if sample is None else sample.as_json(),
    }


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=20_000_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="relearning-") as directory:
        print(json.dumps(beyond_memory(options.rows, Path(directory)), indent=2))


if __name__ == "__main__":
    main()
