"""Trials of the recorder under load and faults, in a short form for tests and a long one for figures."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from load_publisher import ACTIONS
from ros_processes import CHECKOUT, NodeProcess, Peer, own_domain, values_of, wait_until

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.storage.recording import is_recording, read_recording

RECORDER = "recorder: recording"


class Load:
    """`load_publisher` as a process.

    Args:
        domain: ROS domain id.
        state_rate: States per second.
        action_rate: Actions per second.
        width: Values of a state.
        seconds: How long it publishes; 0 for until it is stopped.
    """

    def __init__(
        self, domain: int, state_rate: int, action_rate: int, width: int, seconds: float = 0
    ) -> None:
        self.every = state_rate // action_rate
        numbers = map(str, (state_rate, action_rate, width, seconds))
        self.process = subprocess.Popen(
            [sys.executable, str(CHECKOUT / "test" / "load_publisher.py"), *numbers],
            env=dict(
                os.environ, ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST"
            ),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def sent(self) -> dict[str, int] | None:
        """How many states and actions it sent, once it has ended."""
        assert self.process.stdout is not None
        if not select.select([self.process.stdout], [], [], 0)[0]:
            return None
        counts: dict[str, int] = json.loads(self.process.stdout.readline())
        return counts

    def __enter__(self) -> Load:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()


@dataclass
class Killing:
    """What a series of kills showed."""

    kills: int = 0
    before_a_row: int = 0
    """Kills before the recorder had counted a row."""
    acknowledged: int = 0
    """Rows that the recorders had counted on /diagnostics."""
    readable: int = 0
    """Rows that were read afterwards."""
    lost: int = 0
    """Acknowledged rows that could not be read."""
    wrong: int = 0
    """Rows that were not in sequence, or not with the state that held."""
    torn: int = 0
    """Tails that were torn, by the kill or by us after it."""
    noticed: int = 0
    """Torn tails that were left out with a note."""
    files: int = 0


def kill_recorders(
    kills: int, directory: Path, chance: random.Random, longest: float = 7.0
) -> Killing:
    """Kills one recorder after another, each at a random moment of its life.

    Each one begins in the directory that the others left.  Every second tail is torn further, by
    a part of a row as a loss of power leaves it.

    Args:
        kills: How many.
        directory: Working directory.
        chance: Chooses the moments.
        longest: Longest life (seconds).
    """
    result = Killing()
    demonstrations = directory / "demonstrations"
    with own_domain() as domain, Peer(domain) as peer, Load(domain, 1000, 50, 24) as load:
        for number in range(kills):
            peer.diagnostics.clear()
            seen = set(demonstrations.glob("*"))
            with NodeProcess("recorder_node", domain, directory) as recorder:
                _pass(peer, chance.uniform(0, longest))
                recorder.stop(signal.SIGKILL)
                _pass(peer, 0.2)
            status = peer.diagnostics.get(RECORDER)
            acknowledged = int(values_of(status)["rows"]) if status else 0
            files = [one for one in set(demonstrations.glob("*")) - seen if is_recording(one)]
            result.kills += 1
            result.before_a_row += not acknowledged
            result.acknowledged += acknowledged
            _examine(files, acknowledged, load.every, bool(number % 2), result)
    return result


def _examine(
    files: list[Path], acknowledged: int, every: int, tear: bool, result: Killing
) -> None:
    readable = 0
    for path in files:
        whole = read_recording(path)
        if tear:
            with path.open("ab") as file:
                file.write(path.read_bytes()[-100:])
        read = read_recording(path)
        torn = tear or bool(whole.notes)
        result.torn += torn
        result.noticed += torn and "its last row is incomplete and left out" in read.notes
        result.wrong += wrong_rows(read.demonstration, every)
        result.files += 1
        readable += len(read.demonstration)
    result.readable += readable
    result.lost += max(0, acknowledged - readable)


def wrong_rows(demonstration: Demonstration, every: int) -> int:
    """Rows that do not follow the row before, or that are not with the state that held."""
    count = demonstration.states[:, 0]
    in_turn = np.array([ACTIONS.index(demonstration.actions[code]) for code in demonstration.chosen])
    expected = (count // every) % len(ACTIONS)
    wrong = (count % every != 0) | (in_turn != expected)
    wrong[1:] |= np.diff(count) != every
    return int(wrong.sum())


@dataclass
class Loading:
    """What a recorder did under load."""

    seconds: float
    states: int
    """Sent."""
    actions: int
    """Sent."""
    messages: int
    """Received."""
    rows: int
    wrong: int
    lost_messages: int
    faults: list[str]
    memory: list[float] = field(default_factory=list)
    """Resident memory at each second (MB)."""
    cpu: float = 0.0
    """Share of one core."""


def load_recorder(
    seconds: float,
    directory: Path,
    state_rate: int = 2000,
    action_rate: int = 100,
    width: int = 24,
) -> Loading:
    """Lets a recorder record at a high rate, and compares what was sent with what was written."""
    with (
        own_domain() as domain,
        Peer(domain) as peer,
        NodeProcess("recorder_node", domain, directory) as recorder,
    ):
        recorder.says("recording ")
        memory: list[float] = []
        with Load(domain, state_rate, action_rate, width, seconds) as load:
            last: list[object] = [None]

            def ended() -> dict[str, int] | None:
                status = peer.diagnostics.get(RECORDER)
                if status is not last[0]:
                    last[0] = status
                    memory.append(_resident(recorder.process.pid))
                return load.sent()

            sent = peer.wait_until(ended, seconds * 3 + 30, "the end of the load")
            peer.wait_until(
                lambda: (
                    int(values_of(peer.diagnostics[RECORDER])["rows"]) >= sent["actions"]
                    and peer.diagnostics[RECORDER] is not last[0]
                ),
                10,
                "the last row",
            )
            values = values_of(peer.diagnostics[RECORDER])
            cpu = _cpu(recorder.process.pid) / seconds
        assert recorder.stop() == 0
        known = ("rows lost", "messages lost", "message lost", "write error")
        (path,) = (directory / "demonstrations").iterdir()
        demonstration = read_recording(path).demonstration
        return Loading(
            seconds,
            sent["states"],
            sent["actions"],
            int(values["messages"]),
            len(demonstration),
            wrong_rows(demonstration, load.every),
            int(values["messages lost"]),
            [f"{name}: {values[name]}" for name in known if values.get(name, "0") != "0"],
            memory,
            cpu,
        )


def _pass(peer: Peer, seconds: float) -> None:
    """Takes messages for so long; the moment is the trial, not a wait for something."""
    try:
        peer.wait_until(lambda: False, seconds)
    except TimeoutError:
        return


def _resident(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _cpu(pid: int) -> float:
    ticks = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
