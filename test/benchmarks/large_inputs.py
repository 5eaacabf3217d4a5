"""Reads two large real kinds of input: a bag of 700 topics, and a directory of 300 bags.

    make setup && PYTHONPATH=.:test .venv/bin/python test/benchmarks/large_inputs.py

Prints seconds and the peak of memory of a process that only reads.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fuzz import corpus
from rosbags.rosbag2 import StoragePlugin

from rebt_ros.storage.inputs import load

TOPICS, PUBLISHERS, BAGS = 700, 40, 300
#: As rosbag2 writes the QoS of one publisher.
QOS = (
    "- history: keep_last",
    "  depth: 10",
    "  reliability: reliable",
    "  durability: volatile",
    "  deadline:",
    "    sec: 9223372036",
    "    nsec: 854775807",
    "  lifespan:",
    "    sec: 9223372036",
    "    nsec: 854775807",
    "  liveliness: automatic",
    "  liveliness_lease_duration:",
    "    sec: 9223372036",
    "    nsec: 854775807",
    "  avoid_ros_namespace_conventions: false",
)


def many_topics(path: Path, storage: StoragePlugin) -> Path:
    """A bag like that of a large robot: many topics, and many nodes that log."""
    corpus.bag(path, storage, None)
    metadata = path / "metadata.yaml"
    text = metadata.read_text()
    begin = text.index("  - message_count", text.index("topics_with_message_count"))
    end = text.index("\n  - message_count", begin)
    state = text[begin:end]
    others = [state.replace("/state", f"/topic_{number}") for number in range(TOPICS)]
    profile = "".join(f"      {line}\n" for line in QOS)
    listed = "offered_qos_profiles:\n" + profile.rstrip("\n")
    others = [one.replace("offered_qos_profiles: []", listed) for one in others]
    listed = "offered_qos_profiles:\n" + (profile * PUBLISHERS).rstrip("\n")
    rosout = state.replace("/state", "/rosout").replace("offered_qos_profiles: []", listed)
    metadata.write_text(text[:begin] + "\n".join([*others, rosout, text[begin:]]))
    return path


def _measure(path: Path) -> str:
    began = time.perf_counter()
    loaded = load([path])
    seconds = time.perf_counter() - began
    rows = sum(map(len, loaded.demonstrations))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"{len(loaded.demonstrations)} demonstrations, {rows} rows: {seconds:.2f} s, {peak:.0f} MB"
    )


def main() -> None:
    """Makes both and reads each in a process of its own."""
    if len(sys.argv) > 1:
        print(_measure(Path(sys.argv[1])))
        return
    with tempfile.TemporaryDirectory() as directory:
        inputs = {
            f"{TOPICS} topics, {PUBLISHERS} publishers of one": many_topics(
                Path(directory, "many"), StoragePlugin.MCAP
            )
        }
        for number in range(BAGS):
            bag = Path(directory, "bags", f"{number:03}")
            bag.parent.mkdir(exist_ok=True)
            corpus.bag(bag, StoragePlugin.MCAP, None)
        inputs[f"{BAGS} bags"] = Path(directory, "bags")
        for name, path in inputs.items():
            done = subprocess.run(
                [sys.executable, __file__, str(path)], capture_output=True, text=True, check=True
            )
            print(f"{name}: {done.stdout.strip()}")


if __name__ == "__main__":
    main()
