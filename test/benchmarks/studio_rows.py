"""Benchmarks of the studio: how soon its page is there, and what it costs a running executor."""

from __future__ import annotations

import threading
import time
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from executor_examples import READS_X
from harness import Figure, Settings, Spread, latencies
from node_rows import started
from ros_processes import NodeProcess, Peer, own_domain
from std_msgs.msg import Float64MultiArray, String
from studio_client import StudioClient, url_of

from rebt_ros.behavior_tree.document import dumps

#: Ticks of the executor (Hz).
_RATE = 50.0


def start(settings: Settings) -> list[Figure]:
    """From the start of the process to the page in a browser's hands."""

    def page() -> float:
        begun = time.perf_counter()
        with (
            own_domain() as domain,
            NodeProcess("studio", domain, settings.directory, {"port": 0}) as studio,
        ):
            with urllib.request.urlopen(url_of(studio), timeout=60.0) as answer:
                assert b"<title>Robot studio" in answer.read()
            return time.perf_counter() - begun

    def bare() -> float:
        begun = time.perf_counter()
        with own_domain() as domain, started("bare", domain, settings.directory):
            return time.perf_counter() - begun

    # Its bytecode is compiled once.
    page()
    found: dict[str, list[float]] = {"studio": [], "bare": []}
    for _ in range(settings.rounds):
        found["studio"].append(page())
        found["bare"].append(bare())
    ours, limit = (Spread(tuple(one)) for one in found.values())
    detail = f"{ours.least / limit.least:.2f} of a bare node's start"
    name = "studio, from its start to its page (s)"
    return [Figure(name, ours.least, 1.5, ours, limit, "s", detail)]


def ticks(settings: Settings) -> list[Figure]:
    """How far ticks of a running executor are from where they should be, beside a studio or not.

    The studio has a browser, which is told everything.  Both are measured in turn, on one executor.
    """
    tree = settings.directory / "tree.json"
    tree.write_text(dumps(READS_X))
    parameters = {"tree_file": str(tree), "enabled": True, "rate": _RATE, "state_timeout": 60.0}
    found: dict[str, list[list[float]]] = {"without": [], "with": []}
    with (
        own_domain() as domain,
        started("executor", domain, settings.directory, **parameters),
        Peer(domain) as peer,
    ):
        stamps: list[int] = []

        def note(_: String, info: Mapping[str, Any]) -> None:
            # When it was sent: how busy this process is must not count.
            stamps.append(info["source_timestamp"])

        peer.node.create_subscription(String, "command", note, 1000)
        publisher = peer.connect(Float64MultiArray, "state")
        for _ in range(settings.rounds):
            found["without"].append(_off(peer, publisher, stamps, settings.size(500, 20)))
            with (
                NodeProcess("studio", domain, settings.directory, {"port": 0}) as studio,
                _watching(url_of(studio)),
            ):
                found["with"].append(_off(peer, publisher, stamps, settings.size(500, 20)))
    label = f"executor at {_RATE:.0f} Hz, ticks off their time by, {{}}, with / without the studio"
    return latencies(label, found["with"], found["without"])


def _off(peer: Peer, publisher: Any, stamps: list[int], count: int) -> list[float]:
    """By how many milliseconds the time between two ticks is not the period."""
    # The first ones after a start are those of discovery.
    for wanted in (20, count):
        stamps.clear()
        due, value = time.monotonic(), 0.0
        while len(stamps) < wanted:
            if time.monotonic() >= due:
                due, value = due + 1 / _RATE, 1.0 - value
                publisher.publish(Float64MultiArray(data=[value, value]))
            peer.spin_once()
    return [abs((after - before) / 1e6 - 1e3 / _RATE) for before, after in pairwise(stamps)]


@contextmanager
def _watching(url: str) -> Iterator[None]:
    """A browser that shows the page."""
    over = threading.Event()

    def show() -> None:
        with StudioClient(url) as client:
            while not over.is_set():
                client.listen()

    thread = threading.Thread(target=show)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
