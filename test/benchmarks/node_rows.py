"""Benchmarks of nodes: memory at rest, start-up, CPU per message, and from state to command."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import recorder
from executor_examples import READS_X
from harness import Figure, Settings, Spread, latencies
from recorder_trials import resident
from ros_processes import NodeProcess, Peer, own_domain
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.behavior_tree.document import dumps

_BARE = Path(__file__).with_name("bare_node.py")
#: What each node logs once it is ready.
_READY = {"bare": "ready", "recorder": "recording ", "executor": "disabled until"}


@contextmanager
def started(kind: str, domain: int, directory: Path, **parameters: object) -> Iterator[NodeProcess]:
    command = [sys.executable, str(_BARE)] if kind == "bare" else None
    with NodeProcess(f"{kind}_node", domain, directory, parameters, command=command) as node:
        node.says(_READY[kind] if not parameters else "enabled: ")
        yield node


def rest(settings: Settings) -> list[Figure]:
    """Memory and start-up of the nodes that run on the robot, beyond those of a bare node."""
    with own_domain() as domain:

        def measure(kind: str) -> tuple[float, float]:
            start = time.perf_counter()
            with started(kind, domain, settings.directory) as node:
                seconds = time.perf_counter() - start
                return seconds, resident(node.process.pid)

        measured: dict[str, list[tuple[float, float]]] = {name: [] for name in _READY}
        for _ in range(settings.rounds):
            for name, found in measured.items():
                found.append(measure(name))
    figures = []
    for name in ("recorder", "executor"):
        for place, (what, unit, goal) in enumerate(
            (("start-up of the", "s", 0.3), ("memory at rest of the", "MB", 60.0))
        ):
            ours, bare = (
                Spread(tuple(one[place] for one in measured[kind])) for kind in (name, "bare")
            )
            label = f"{what} {name} - that of a bare rclpy node ({unit})"
            figures.append(Figure(label, ours.least - bare.least, goal, ours, bare, unit))
    return figures


def recorder_cpu(settings: Settings) -> list[Figure]:
    """CPU per message of the recorder; a row of recorder.py."""
    return recorder.cpu(1 if settings.quick else settings.rounds, settings.directory)


def latency(settings: Settings) -> list[Figure]:
    """From a state to the command that it leads to, at 100 Hz.

    The executor ticks on states that arrive, as one would have it where that time matters.
    """
    states = settings.size(500, 30)
    tree = settings.directory / "tree.json"
    tree.write_text(dumps(READS_X))
    parameters = {"executor": {"tree_file": str(tree), "enabled": True, "tick_on": "state"}}

    def measure(kind: str) -> list[float]:
        with (
            own_domain() as domain,
            started(kind, domain, settings.directory, **parameters.get(kind, {})),
            Peer(domain) as peer,
        ):
            return _round_trips(peer, states)

    found: dict[str, list[list[float]]] = {"bare": [], "executor": []}
    for _ in range(settings.rounds):
        for kind, trips in found.items():
            trips.append(measure(kind))
    label = "state -> command, {}, at 100 Hz / a bare node that answers"
    return latencies(label, found["executor"], found["bare"])


def _round_trips(peer: Peer, states: int) -> list[float]:
    """Milliseconds from each state, which asks for another command than the one before."""
    heard: list[tuple[float, str]] = []
    peer.node.create_subscription(
        String, "command", lambda message: heard.append((time.perf_counter(), message.data)), 10
    )
    publisher: Any = peer.connect(Float64MultiArray, "state")
    peer.wait_until(lambda: peer.node.count_publishers("command"))
    message = Float64MultiArray(data=[0.0, 0.0])

    def answered() -> list[tuple[float, str]]:
        publisher.publish(message)
        return heard

    # Until both have found each other, states or commands can get lost.
    peer.wait_until(answered)
    trips = []
    for number in range(states + 20):
        wanted = number % 2
        # Both read one value: the bare node the first, the tree x, the second.
        message.data[0] = message.data[1] = float(wanted)
        heard.clear()
        sent = time.perf_counter()
        publisher.publish(message)
        answer = ("go", "turn")[wanted]
        peer.wait_until(lambda answer=answer: any(one == answer for _, one in heard))
        took = next(when for when, one in heard if one == answer) - sent
        if number >= 20:
            trips.append(1e3 * took)
        while time.perf_counter() < sent + 0.01:
            peer.node.executor.spin_once(timeout_sec=0.001)
    return trips
