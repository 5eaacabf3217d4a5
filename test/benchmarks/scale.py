"""Many bags: read once, beside a bare rosbags loop, killed and gone on with, by any workers.

    PYTHONPATH=.:test:test/benchmarks python test/benchmarks/scale.py [--bags 100,1000,10000]

Prints the figures of docs/scale.md and writes each to bench-results/scale.json as it comes.  The
largest fleet takes 250 kB of disk for each bag while it is measured, in the directory that TMPDIR
names, or /tmp.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from bag_fleet import ROWS, TYPES, BagFleet
from harness import CHECKOUT
from rosbags.rosbag2 import Reader

import rebt_ros
from rebt_ros.storage.input_options import InputOptions, ReadingPlan
from rebt_ros.storage.inputs import load

#: Bags that are new when all are read the second time.
NEW = 10
#: What grows with the bags is fitted to figures of these.
_GROWING: Final = ("bare rosbags loop", "read, kept", "again with 10 new", "learned, all kept")


def bare_loop(directory: Path) -> int:
    """Deserialises every message of every bag that can be opened, and drops it."""
    count = 0
    for path in sorted(directory.iterdir()):
        with contextlib.suppress(Exception), Reader(path) as reader:
            for connection, _, data in reader.messages():
                TYPES.deserialize_cdr(data, connection.msgtype)
                count += 1
    return count


def ours(directory: Path, **plan: Any) -> tuple[str, float]:
    """Reads all bags; a digest of what was read, and what the process then holds (MB)."""
    found = load([directory], InputOptions(plan=ReadingPlan(strict=False, **plan)))
    digest = hashlib.sha256(repr((found.notes, found.accounts, found.aside)).encode())
    held = _own_memory()
    for one in found.demonstrations:
        digest.update(repr((one.name, one.features, one.actions, one.channels)).encode())
        for column in (one.states, one.stamps, one.chosen, one.channel):
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest(), held


def tree(directory: Path, out: Path, **plan: Any) -> tuple[str, float]:
    """Learns from all bags; a digest of the tree, and the memory that the process holds (MB)."""
    rebt_ros.learn(directory, out=out, reading=InputOptions(plan=ReadingPlan(strict=False, **plan)))
    return hashlib.sha256((out / "tree.json").read_bytes()).hexdigest(), _own_memory()


def _own_memory() -> float:
    """What this process holds of its own, without mapped files (MB)."""
    return _memory("RssAnon")


def _memory(name: str) -> float:
    """What the kernel calls so of this process (MB)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{name}:")[1].split()[0]) / 1024


def _child(arguments: list[str]) -> None:
    """Does one thing in a process of its own, and prints how long it took."""
    what, directory, *rest = arguments
    plan = json.loads(rest[0]) if rest else {}
    if "cache" in plan:
        plan["cache"] = Path(plan["cache"])
    began = time.perf_counter()
    own = 0.0
    if what == "bare":
        answer: Any = bare_loop(Path(directory))
    elif what == "tree":
        answer, own = tree(Path(directory), Path(plan.pop("out")), **plan)
    else:
        answer, own = ours(Path(directory), **plan)
    seconds = time.perf_counter() - began
    peak = _memory("VmHWM")
    print(json.dumps({"answer": answer, "s": seconds, "own_mb": own, "peak_mb": peak}))


def _started(what: str, directory: Path, plan: dict[str, Any]) -> subprocess.Popen[str]:
    command = [sys.executable, __file__, "--child", what, str(directory), json.dumps(plan)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _run(what: str, directory: Path, **plan: Any) -> dict[str, Any]:
    """What a process of its own answers, and its processor time (s)."""
    process = _started(what, directory, plan)
    assert process.stdout is not None
    found: dict[str, Any] = json.loads(process.stdout.read())
    process.stdout.close()
    # With those of its processes, which have ended with it.
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return found | {"cpu_s": used.ru_utime + used.ru_stime}


def _killed(directory: Path, cache: Path, kills: int, seconds: float) -> dict[str, Any]:
    """Reads into an empty cache, is killed over and over, and then let be."""
    randomly = random.Random(0)
    for _ in range(kills):
        process = _started("ours", directory, {"cache": str(cache), "jobs": 2})
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(randomly.uniform(1, 4 + seconds / kills * 2))
        process.kill()
        process.communicate()
    kept = len(list(cache.rglob("*.columns")))
    return _run("ours", directory, cache=str(cache), jobs=2) | {"kept": kept}


def _cluster() -> Iterator[str]:
    import distributed

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        yield cluster.scheduler_address


class _Figures:
    """Figures of a number of bags, which are told and written as they come."""

    def __init__(self, bags: int, file: Path, earlier: Sequence[dict[str, Any]]) -> None:
        self.found: dict[str, Any] = {"bags": bags, "rows": bags * ROWS}
        self._file = file
        self._earlier = earlier

    def note(self, name: str, found: dict[str, Any]) -> dict[str, Any]:
        """A run and what it took."""
        memory = f"{found['peak_mb']:.0f} MB at most, {found['own_mb']:.0f} MB of its own"
        self.say(name, found, f"{found['s']:.1f} s, CPU {found['cpu_s']:.1f} s, {memory}")
        return found

    def say(self, name: str, value: Any, text: str = "") -> None:
        """Anything else."""
        self.found[name] = value
        print(f"{self.found['bags']} bags, {name}: {text or value}", flush=True)
        _write(self._file, [*self._earlier, self.found])


def _write(file: Path, sizes: Sequence[dict[str, Any]]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"sizes": sizes, "growth": growth(sizes)}, indent=2) + "\n")


def growth(sizes: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """With which power of the bags times and memory grow beyond what Python takes alone.

    Fitted by least squares to the logarithms of processor time and memory, minus those that none
    takes, from 100 bags on.
    """
    fitted = {}
    for name in _GROWING:
        runs = [(one["bags"], one[name]) for one in sizes if name in one]
        for value in ("cpu_s", "peak_mb", "own_mb"):
            points = [(bags, run[value] - _ALONE[value]) for bags, run in runs if run[value]]
            points = [(bags, more) for bags, more in points if bags >= 100 and more > 0]
            if len(points) > 1:
                bags, more = np.log(np.array(points)).T
                power = np.polyfit(bags, more, 1)[0]
                fitted.setdefault(name, {})[value] = round(float(power), 3)
    return fitted


#: What a process takes that reads nothing (s, MB, MB).
_ALONE: dict[str, float] = {"cpu_s": 0.0, "peak_mb": 0.0, "own_mb": 0.0}


def measure(
    bags: int,
    kills: int,
    directory: Path,
    figures: _Figures,
    *,
    is_brief: bool,
    trees: bool,
) -> None:
    """Measures all of a number of bags."""
    fleet, new, cache = (directory / name for name in ("fleet", "new", "cache"))
    fleet.mkdir(parents=True)
    new.mkdir()
    writer = BagFleet(directory)
    for number in range(bags + NEW):
        path = (fleet if number < bags else new) / f"run_{number:06}"
        writer.write(path, number)
    note = figures.note
    bare = [note("bare rosbags loop", _run("bare", fleet))]
    first = note("read, kept", _run("ours", fleet, cache=str(cache)))
    same = {first["answer"]}
    if not is_brief:
        plain = note("read, nothing kept", _run("ours", fleet))
        bare.append(note("bare rosbags loop again", _run("bare", fleet)))
        same.add(plain["answer"])
    least = min(one["cpu_s"] for one in bare)
    figures.say("ratio", first["cpu_s"] / least)
    for bag in new.iterdir():
        shutil.move(bag, fleet)
    second = note("again with 10 new", _run("ours", fleet, cache=str(cache)))
    figures.say("second / first", second["cpu_s"] / first["cpu_s"])
    learned = note(
        "learned, all kept", _run("tree", fleet, out=str(directory / "out"), cache=str(cache))
    )
    # The first run reads what the second one has, and learns as much.
    learning = learned["cpu_s"] - second["cpu_s"]
    figures.say("second / first, with learning", learned["cpu_s"] / (first["cpu_s"] + learning))
    spoilt = directory / "killed"
    killed = note(f"after {kills} kills", _killed(fleet, spoilt, kills, first["s"] / 2))
    figures.say("kept when killed", killed["kept"])
    figures.say("equal", len(same) == len({second["answer"], killed["answer"]}) == 1)
    shutil.rmtree(spoilt)
    if trees:
        _trees(fleet, directory, figures)


def _trees(fleet: Path, directory: Path, figures: _Figures) -> None:
    """Learns by workers of all kinds, each of which reads everything."""
    digests = {}
    for jobs in (1, 2, 4):
        out, kept = directory / f"tree-{jobs}", directory / f"cache-{jobs}"
        found = _run("tree", fleet, out=str(out), cache=str(kept), jobs=jobs)
        digests[f"{jobs} workers"] = figures.note(f"tree, {jobs} workers", found)["answer"]
        shutil.rmtree(kept)
    for address in _cluster():
        out, kept = directory / "tree-dask", directory / "cache-dask"
        found = _run("tree", fleet, out=str(out), cache=str(kept), scheduler=address)
        digests["Dask"] = figures.note("tree, Dask", found)["answer"]
    figures.say("same tree", len(set(digests.values())) == 1)


def _counts(text: str) -> list[int]:
    return [int(one) for one in text.split(",")]


def main() -> None:
    """Measures, prints and writes the figures."""
    if sys.argv[1:2] == ["--child"]:
        _child(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bags", type=_counts, default=[100, 1000], help="numbers of bags")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument(
        "--brief",
        type=int,
        default=1000,
        help="above so many bags, nothing is read without the cache, and no workers are compared",
    )
    parser.add_argument("--results", type=Path, default=CHECKOUT / "bench-results" / "scale.json")
    options = parser.parse_args()
    done: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="bench-scale-") as directory:
        _ALONE.update(_run("ours", _nearly_nothing(Path(directory))))
        for bags in options.bags:
            beside = Path(directory) / str(bags)
            figures = _Figures(bags, options.results, done)
            is_brief = bags > options.brief
            measure(bags, options.kills, beside, figures, is_brief=is_brief, trees=not is_brief)
            shutil.rmtree(beside)
            done.append(figures.found)


def _nearly_nothing(directory: Path) -> Path:
    """A directory with one bag."""
    one = directory / "one"
    one.mkdir()
    BagFleet(directory).write(one / "run_0", 0)
    return one


if __name__ == "__main__":
    main()
