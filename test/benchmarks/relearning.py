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
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from executor_examples import READS_X
from fleet import ROWS, WIDTH, write_recordings
from harness import Figure, Settings, Spread, compared
from recorder_trials import RECORDER, Load, cpu_seconds
from ros_processes import NodeProcess, Peer, own_domain, values_of

import rebt_ros
from rebt_ros.live.learning_process import LearningProcess, Request
from rebt_ros.storage.tree_file import write_tree

#: Recordings of the limit's relearn, and of ours before one more is shown.
_FEW, _MANY = 100, 1000
#: States and actions per second that a recorder and an executor take meanwhile.
_STATES, _ACTIONS = 100, 10
#: The longest relearn, on a loaded machine (seconds).
_LONGEST: Final = 3600.0
#: Of the size of the table, what a process may hold in memory of its own.
_HELD: Final = 0.8
#: Rows of a recording of the very large table.
_LONG: Final = 10_000


def one_more(settings: Settings) -> list[Figure]:
    """The running learner's process: a million rows and a thousand new ones, or 100,000 rows."""
    few, many = settings.size(_FEW, 2), settings.size(_MANY, 4)
    directories = _recorded(settings.directory, few, many)
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
    return [compared(_named("relearn", few, many), spreads, 2)]


def among_nodes(settings: Settings) -> list[Figure]:
    """The same on running learners, while a recorder records and an executor ticks.

    Both learners are there all the time, and learn in turn.
    """
    few, many = settings.size(_FEW, 2), settings.size(_MANY, 4)
    directory = settings.directory
    directories = _recorded(directory, few, many)
    write_tree(directory / "tree.json", READS_X)
    seconds: dict[str, list[float]] = {name: [] for name in directories}
    used: dict[str, list[float]] = {name: [] for name in directories}
    with own_domain() as domain, Peer(domain) as peer, ExitStack() as stack:

        def start(node: str, parameters: dict[str, object], name: str = "") -> NodeProcess:
            words = ["-r", f"__node:={name}"] if name else []
            return stack.enter_context(
                NodeProcess(f"{node}_node", domain, directory, parameters, words)
            )

        recorder = start("recorder", {"command_topic": "", "driving_topic": ""})
        recorder.says("recording ")
        start("executor", {"tree_file": directory / "tree.json", "rate": 10.0, "enabled": True})
        learners = {
            name: start(
                "learner", {"demonstrations": recorded, "output": directory / f"of_{name}"}, name
            )
            for name, recorded in directories.items()
        }
        stack.enter_context(Load(domain, _STATES, _ACTIONS, WIDTH, 0, 2))
        for name in (RECORDER, *(f"{name}: learning" for name in learners)):
            peer.wait_until(lambda name=name: name in peer.diagnostics, what=name)

        def ask(name: str) -> tuple[float, float]:
            process = _learning_process(learners[name].process.pid)
            start, before = time.perf_counter(), cpu_seconds(process)
            call = peer.begin(f"/{name}/relearn")
            peer.wait_until(call.done, _LONGEST, "a relearn")
            assert call.result().success, call.result().message
            took = time.perf_counter() - start, cpu_seconds(process) - before
            written = f"summary and pictures of the tree are in {directory / f'of_{name}'}"
            count = len(seconds[name]) + 1
            # Else the next one would wait for the files of this one.
            peer.wait_until(
                lambda: learners[name].stderr.count(written) >= count, _LONGEST, "its files"
            )
            return took

        for number in range(settings.rounds + 1):
            if number:
                write_recordings(directories["ours"], many + number - 1, 1)
            for name in directories:
                wall, cpu = ask(name)
                seconds[name].append(wall)
                used[name].append(cpu)
        values = values_of(peer.diagnostics[RECORDER])
    name = _named("relearn beside a recorder and an executor", few, many)
    # The first one reads everything.
    found = [
        {name: Spread(tuple(spent[1:])) for name, spent in times.items()}
        for times in (seconds, used)
    ]
    first = " s, ".join(f"{name} {times[0]:.1f}" for name, times in seconds.items())
    detail = (
        f"the first one: {first} s; meanwhile {values['rows']} rows were recorded, and "
        f"{values['messages lost']} messages lost"
    )
    return [
        compared(name, found[0], 2, detail=detail),
        compared(f"CPU of its process: {name}", found[1], 2),
    ]


def _recorded(directory: Path, few: int, many: int) -> dict[str, Path]:
    """Directories of few recordings and of many."""
    directories = {"limit": directory / "few", "ours": directory / "many"}
    write_recordings(directories["limit"], 0, few)
    write_recordings(directories["ours"], 0, many)
    return directories


def _named(what: str, few: int, many: int) -> str:
    return f"{what}, {many * ROWS:,} rows x {WIDTH} and {ROWS:,} new ones / {few * ROWS:,} rows"


def _learning_process(node: int) -> int:
    """The process in which a learner learns."""
    threads = Path(f"/proc/{node}/task").iterdir()
    children = [child for one in threads for child in (one / "children").read_text().split()]
    (process,) = children
    return int(process)


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
