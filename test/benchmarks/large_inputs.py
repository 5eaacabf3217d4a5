"""Reads two large real kinds of input: bags of 700 topics, and a directory of 300 bags.

    make setup && PYTHONPATH=.:test .venv/bin/python test/benchmarks/large_inputs.py

Prints sizes, seconds and the peak of memory of a process that only reads.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

import numpy as np
from fuzz import corpus
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.storage.inputs import load

TOPICS, PUBLISHERS, BAGS = 700, 40, 300
#: Of the robot's recording (seconds); states and actions come at 20 Hz, all else at 5 Hz.
SECONDS: Final = 60
#: Of messages on the other topics (bytes): joint states, poses, diagnostics.
SIZE: Final = 200
SECOND: Final = 1_000_000_000

_LOG: Final = "rcl_interfaces/msg/Log"
#: As rosbag2 writes the QoS of one publisher.
_FOREVER: Final = QosTime(9223372036, 854775807)
_QOS: Final = Qos(
    QosHistory.KEEP_LAST,
    10,
    QosReliability.RELIABLE,
    QosDurability.VOLATILE,
    _FOREVER,
    _FOREVER,
    QosLiveliness.AUTOMATIC,
    _FOREVER,
    avoid_ros_namespace_conventions=False,
)


def many_topics(
    path: Path,
    storage: StoragePlugin,
    topics: int = TOPICS,
    publishers: int = PUBLISHERS,
    seconds: int = SECONDS,
) -> Path:
    """A bag like that of a large robot: messages on many topics, and many nodes that log."""
    types = get_typestore(Stores.ROS2_JAZZY)
    made = types.types
    with Writer(path, version=9, storage_plugin=storage) as writer:

        def topic(name: str, kind: str, qos: int = 1) -> object:
            return writer.add_connection(
                name, kind, typestore=types, offered_qos_profiles=[_QOS] * qos
            )

        state, action = topic("/state", corpus.STATE), topic("/action", corpus.ACTION)
        others = [
            topic(f"/robot/part_{number}/data", "std_msgs/msg/UInt8MultiArray")
            for number in range(topics - 3)
        ]
        log = topic("/rosout", _LOG, publishers)
        layout = made["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        other = types.serialize_cdr(
            made["std_msgs/msg/UInt8MultiArray"](
                layout=layout, data=np.arange(SIZE, dtype=np.uint8)
            ),
            "std_msgs/msg/UInt8MultiArray",
        )
        line = types.serialize_cdr(
            made[_LOG](
                stamp=made["builtin_interfaces/msg/Time"](sec=1, nanosec=0),
                level=20,
                name="node",
                msg="still here",
                file="node.cpp",
                function="spin",
                line=1,
            ),
            _LOG,
        )
        for number in range(20 * seconds):
            now = number * SECOND // 20
            values = np.array([number / 3, -number, 1e9])
            message = made[corpus.STATE](layout=layout, data=values)
            writer.write(state, now, types.serialize_cdr(message, corpus.STATE))
            label = made[corpus.ACTION](data=("go", "turn", "wait")[number % 3])
            writer.write(action, now + 1, types.serialize_cdr(label, corpus.ACTION))
            if number % 4 == 0:
                for one in others:
                    writer.write(one, now + 2, other)
                for _ in range(publishers):
                    writer.write(log, now + 3, line)
    return path


def _measure(path: Path) -> str:
    began, used = time.perf_counter(), time.process_time()
    loaded = load([path])
    seconds, used = time.perf_counter() - began, time.process_time() - used
    rows = sum(map(len, loaded.demonstrations))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    notes = f", {len(loaded.notes)} notes" if loaded.notes else ""
    return (
        f"{len(loaded.demonstrations)} demonstrations, {rows} rows{notes}: {seconds:.2f} s, "
        f"{used:.2f} s of the processor, {peak:.0f} MB"
    )


def _size(path: Path) -> float:
    """In MB."""
    return sum(one.stat().st_size for one in path.rglob("*") if one.is_file()) / 1e6


def main() -> None:
    """Makes all and reads each in a process of its own."""
    if len(sys.argv) > 1:
        print(_measure(Path(sys.argv[1])))
        return
    with tempfile.TemporaryDirectory() as directory:
        inputs = {
            f"{TOPICS} topics, {PUBLISHERS} publishers of /rosout, {one.name}": many_topics(
                Path(directory, one.name), one
            )
            for one in (StoragePlugin.MCAP, StoragePlugin.SQLITE3)
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
            print(f"{name} ({_size(path):.0f} MB): {done.stdout.strip()}", flush=True)


if __name__ == "__main__":
    main()
