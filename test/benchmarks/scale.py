"""Many bags: read once, beside a bare rosbags loop, killed and gone on with, by any workers.

    PYTHONPATH=.:test:test/benchmarks python test/benchmarks/scale.py [--bags 1000] [--kills 20]

Prints the figures of docs/scale.md and writes bench-results/scale.json.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from harness import CHECKOUT
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import rebt_ros
from rebt_ros.demonstration.fields import dimension_labels_of
from rebt_ros.storage.bag import ACTION_TYPE, STATE_TYPE
from rebt_ros.storage.input_options import InputOptions, ReadingPlan
from rebt_ros.storage.inputs import load

_TYPES: Final = get_typestore(Stores.ROS2_JAZZY)
#: Rows of a bag, values of a state, and one bag of so many is broken.
ROWS, WIDTH, BROKEN = 1000, 8, 50
#: Bags that are new when all are read the second time.
NEW = 10
_LABELS: Final = ("go", "turn", "wait", "lift")


def write_bag(path: Path, seed: int) -> None:
    """A bag of 1,000 states, each followed by what is done in it; some are cut or no bags."""
    values = np.random.default_rng(seed).random((ROWS, WIDTH))
    kinds = _TYPES.types
    dimensions = [
        kinds["std_msgs/msg/MultiArrayDimension"](label=label, size=WIDTH, stride=WIDTH)
        for label in dimension_labels_of([f"x{number}" for number in range(WIDTH)])
    ]
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=dimensions, data_offset=0)
    empty = kinds[STATE_TYPE](layout=layout, data=np.zeros(WIDTH))
    head = bytes(_TYPES.serialize_cdr(empty, STATE_TYPE))[: -8 * WIDTH]
    actions = [
        bytes(_TYPES.serialize_cdr(kinds[ACTION_TYPE](data=label), ACTION_TYPE))
        for label in _LABELS
    ]
    chosen = 2 * (values[:, 0] > 0.5) + (values[:, 1] > 0.3)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        to_state = writer.add_connection("/state", STATE_TYPE, typestore=_TYPES)
        to_action = writer.add_connection("/action", ACTION_TYPE, typestore=_TYPES)
        for row in range(ROWS):
            writer.write(to_state, row * 10**7, head + values[row].tobytes())
            writer.write(to_action, row * 10**7 + 1, actions[chosen[row]])
    if seed % BROKEN == BROKEN // 2:
        (file,) = path.glob("*.mcap")
        file.write_bytes(b"\0" * 1000)


def bare_loop(directory: Path) -> int:
    """Deserialises every message of every bag that can be opened, and drops it."""
    count = 0
    for path in sorted(directory.iterdir()):
        with contextlib.suppress(Exception), Reader(path) as reader:
            for connection, _, data in reader.messages():
                _TYPES.deserialize_cdr(data, connection.msgtype)
                count += 1
    return count


def ours(directory: Path, **plan: Any) -> str:
    """Reads all bags; a digest of what was read."""
    found = load([directory], InputOptions(plan=ReadingPlan(strict=False, **plan)))
    digest = hashlib.sha256(repr((found.notes, found.accounts, found.aside)).encode())
    for one in found.demonstrations:
        digest.update(repr((one.name, one.features, one.actions, one.channels)).encode())
        for column in (one.states, one.stamps, one.chosen, one.channel):
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def tree(directory: Path, out: Path, **plan: Any) -> str:
    """Learns from all bags; a digest of the tree."""
    rebt_ros.learn(directory, out=out, reading=InputOptions(plan=ReadingPlan(strict=False, **plan)))
    return hashlib.sha256((out / "tree.json").read_bytes()).hexdigest()


def _child(arguments: list[str]) -> None:
    """Does one thing in a process of its own, and prints what it took."""
    what, directory, *rest = arguments
    plan = json.loads(rest[0]) if rest else {}
    if "cache" in plan:
        plan["cache"] = Path(plan["cache"])
    began = time.perf_counter()
    if what == "bare":
        answer: Any = bare_loop(Path(directory))
    elif what == "tree":
        answer = tree(Path(directory), Path(plan.pop("out")), **plan)
    else:
        answer = ours(Path(directory), **plan)
    seconds = time.perf_counter() - began
    own = resource.getrusage(resource.RUSAGE_SELF)
    workers = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = own.ru_utime + own.ru_stime + workers.ru_utime + workers.ru_stime
    peak = own.ru_maxrss / 1024
    print(json.dumps({"answer": answer, "s": seconds, "cpu_s": used, "peak_mb": peak}))


def _started(what: str, directory: Path, plan: dict[str, Any]) -> subprocess.Popen[str]:
    command = [sys.executable, __file__, "--child", what, str(directory), json.dumps(plan)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _run(what: str, directory: Path, **plan: Any) -> dict[str, Any]:
    output, _ = _started(what, directory, plan).communicate()
    found: dict[str, Any] = json.loads(output)
    return found


def _killed(directory: Path, cache: Path, kills: int, seconds: float) -> dict[str, Any]:
    """Reads into an empty cache, is killed over and over, and then let be."""
    randomly = random.Random(0)
    for _ in range(kills):
        process = _started("ours", directory, {"cache": str(cache), "jobs": 2})
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(randomly.uniform(1, 1 + seconds / kills * 3))
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


def measure(
    bags: int, kills: int, directory: Path, tell: Callable[[str], None], *, trees: bool
) -> dict[str, Any]:
    """All figures, which are told as they come."""
    fleet, new = directory / "fleet", directory / "new"
    fleet.mkdir()
    new.mkdir()
    for number in range(bags + NEW):
        write_bag((fleet if number < bags else new) / f"run_{number:06}", number)
    cache = directory / "cache"
    figures: dict[str, Any] = {"bags": bags, "rows": bags * ROWS}

    def note(name: str, found: dict[str, Any]) -> dict[str, Any]:
        figures[name] = found
        cost = f"{found['s']:.1f} s, CPU {found['cpu_s']:.1f} s, {found['peak_mb']:.0f} MB"
        tell(f"{name}: {cost}")
        return found

    bare = note("bare rosbags loop", _run("bare", fleet))
    plain = note("read, nothing kept", _run("ours", fleet))
    first = note("read, kept", _run("ours", fleet, cache=str(cache)))
    again = note("bare rosbags loop again", _run("bare", fleet))
    least = min(bare["cpu_s"], again["cpu_s"])
    figures["ratio"] = first["cpu_s"] / least
    figures["ratio, nothing kept"] = plain["cpu_s"] / least
    tell(f"ratio (CPU): {figures['ratio']:.2f}, nothing kept {figures['ratio, nothing kept']:.2f}")
    same = {first["answer"], plain["answer"]}
    for bag in new.iterdir():
        shutil.move(bag, fleet)
    second = note(f"again with {NEW} new", _run("ours", fleet, cache=str(cache)))
    figures["second / first"] = second["cpu_s"] / first["cpu_s"]
    tell(f"second / first (CPU): {figures['second / first']:.3f}")
    two = note("two processes, nothing kept", _run("ours", fleet, jobs=2))
    spoilt = directory / "killed"
    killed = note(f"after {kills} kills", _killed(fleet, spoilt, kills, two["s"]))
    after = {second["answer"], two["answer"], killed["answer"]}
    figures["equal"] = len(same) == len(after) == 1
    tell(f"kept when killed: {killed['kept']}; equal: {figures['equal']}")
    if trees:
        digests = {}
        for jobs in (1, 2, 4):
            out, kept = directory / f"tree-{jobs}", directory / f"cache-{jobs}"
            found = _run("tree", fleet, out=str(out), cache=str(kept), jobs=jobs)
            digests[f"{jobs} workers"] = note(f"tree, {jobs} workers", found)["answer"]
        for address in _cluster():
            out, kept = directory / "tree-dask", directory / "cache-dask"
            found = _run("tree", fleet, out=str(out), cache=str(kept), scheduler=address)
            digests["Dask"] = note("tree, Dask", found)["answer"]
        figures["same tree"] = len(set(digests.values())) == 1
        tell(f"same tree: {figures['same tree']}")
    return figures


def main() -> None:
    """Measures, prints and writes the figures."""
    if sys.argv[1:2] == ["--child"]:
        _child(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bags", type=int, default=1000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--no-trees", dest="trees", action="store_false")
    parser.add_argument("--results", type=Path, default=CHECKOUT / "bench-results" / "scale.json")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="bench-scale-") as directory:
        figures = measure(
            options.bags,
            options.kills,
            Path(directory),
            lambda line: print(line, flush=True),
            trees=options.trees,
        )
    options.results.parent.mkdir(parents=True, exist_ok=True)
    options.results.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
