"""Trials of the recorder under load and faults: short for tests, long for figures."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from executor_examples import READS_X
from load_publisher import ACTIONS
from ros_processes import CHECKOUT, PATIENCE, NodeProcess, Peer, own_domain, values_of
from std_msgs.msg import String

from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.storage.recording import RecordingWriter, read_recording
from rebt_ros.storage.recording_files import is_recording
from rebt_ros.storage.recording_rows import record_type
from rebt_ros.storage.tree_file import write_tree

RECORDER = "recorder: recording"

#: Values of a state.
WIDTH = 24


class Load:
    """`load_publisher` as a process.

    Args:
        domain: ROS domain id.
        state_rate: States per second.
        action_rate: Actions per second.
        width: Values of a state.
        seconds: How long it publishes; 0 for until it is stopped.
        subscribers: How many the states must have before it begins.
    """

    def __init__(
        self,
        domain: int,
        state_rate: int,
        action_rate: int,
        width: int,
        seconds: float = 0,
        subscribers: int = 1,
    ) -> None:
        self.every = state_rate // action_rate
        numbers = map(str, (state_rate, action_rate, width, seconds, subscribers))
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
    gaps: int = 0
    """Rows whose action is not the one that follows that of the row before."""
    torn: int = 0
    """Tails that were torn, by the kill or by us after it."""
    noticed: int = 0
    """Torn tails that were left out with a note."""
    files: int = 0


def kill_recorders(kills: int, directory: Path, chance: random.Random) -> Killing:
    """Kills one recorder after another at random moments, every fourth one while it starts.

    Each one begins in the directory that the others left.  Every second tail is torn further, by
    a part of a row as a loss of power leaves it.

    Args:
        kills: How many.
        directory: Working directory.
        chance: Chooses the moments.
    """
    result = Killing()
    demonstrations = directory / "demonstrations"
    with own_domain() as domain, Peer(domain) as peer, Load(domain, 1000, 50, 24):
        for number in range(kills):
            peer.diagnostics.clear()
            seen = set(demonstrations.glob("*"))
            with NodeProcess("recorder_node", domain, directory) as recorder:
                if number % 4 < 3:
                    peer.wait_until(lambda: _acknowledged(peer), what="a row on /diagnostics")
                _pass(peer, chance.uniform(0, 2.5))
                recorder.stop(signal.SIGKILL)
                _pass(peer, 0.2)
            acknowledged = _acknowledged(peer)
            files = [one for one in set(demonstrations.glob("*")) - seen if is_recording(one)]
            result.kills += 1
            result.before_a_row += not acknowledged
            result.acknowledged += acknowledged
            _examine(files, acknowledged, bool(number % 2), result)
    return result


def _acknowledged(peer: Peer) -> int:
    """Rows that the recorder has counted on /diagnostics."""
    status = peer.diagnostics.get(RECORDER)
    return int(values_of(status)["rows"]) if status else 0


def _examine(files: list[Path], acknowledged: int, tear: bool, result: Killing) -> None:
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
        result.gaps += gaps(read.demonstration)
        result.files += 1
        readable += len(read.demonstration)
    result.readable += readable
    result.lost += max(0, acknowledged - readable)


def gaps(demonstration: Demonstration) -> int:
    """How often a row's action is not the one that was sent after that of the row before."""
    place = {label: number for number, label in enumerate(ACTIONS)}
    turn = np.array([place[label] for label in demonstration.actions])[demonstration.chosen]
    return int((np.diff(turn) % len(ACTIONS) != 1).sum())


def misplaced(demonstration: Demonstration, every: int) -> int:
    """How many rows do not have the state that was sent just before their action."""
    expected = every * np.arange(len(demonstration))
    return int((demonstration.states[:, 0] != expected).sum())


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
    gaps: int
    misplaced: int
    """Rows without the state that was sent just before their action."""
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
    freezes: Sequence[float] = (),
    parameters: Mapping[str, object] | None = None,
) -> Loading:
    """Lets a recorder record at a high rate, and compares what was sent with what was written.

    Args:
        seconds: How long the load lasts.
        directory: Working directory.
        state_rate: States per second.
        action_rate: Actions per second.
        width: Values of a state.
        freezes: How long the recorder's process stands still, again and again (seconds).  Where
            more is sent meanwhile than the transport has room for (512 messages), that drops some.
        parameters: Of the recorder.
    """
    with (
        own_domain() as domain,
        Peer(domain) as peer,
        NodeProcess("recorder_node", domain, directory, parameters) as recorder,
    ):
        recorder.says("recording ")
        memory: list[float] = []
        with Load(domain, state_rate, action_rate, width, seconds) as load:
            for freeze in freezes:
                before = _acknowledged(peer)
                peer.wait_until(lambda before=before: _acknowledged(peer) > before, what="rows")
                recorder.process.send_signal(signal.SIGSTOP)
                _pass(peer, freeze)
                recorder.process.send_signal(signal.SIGCONT)
            last: list[object] = [None]

            def ended() -> dict[str, int] | None:
                status = peer.diagnostics.get(RECORDER)
                if status is not last[0]:
                    last[0] = status
                    memory.append(resident(recorder.process.pid))
                return load.sent()

            sent = peer.wait_until(ended, seconds * 3 + PATIENCE, "the end of the load")
            report = peer.anew(RECORDER)

            def complete() -> dict[str, str] | None:
                said = values_of(status) if (status := report()) else {}
                # What is lost is not waited for.
                whole = int(said.get("rows", 0)) >= sent["actions"]
                return said if whole or int(said.get("messages lost", 0)) else None

            values = peer.wait_until(complete, what="the last row")
            cpu = cpu_seconds(recorder.process.pid) / seconds
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
            gaps(demonstration),
            misplaced(demonstration, load.every),
            int(values["messages lost"]),
            [f"{name}: {values[name]}" for name in known if values.get(name, "0") != "0"],
            memory,
            cpu,
        )


def large_recording(rows: int, directory: Path) -> Path:
    """A recording of many rows, made of copies of some; its actions have no rule."""
    features = tuple(Feature(f"f{index}", topic="state", index=index) for index in range(WIDTH))
    block = min(rows, 10_000)
    states = np.random.default_rng(0).normal(size=(block, WIDTH))
    with RecordingWriter(directory, features, ["action"]) as writer:
        for number, state in enumerate(states.tolist()):
            action = ACTIONS[number * 7 % len(ACTIONS)]
            writer.write(Row(number * 10**7, "action", action, None, tuple(state)))
    # The later half of the rows, before which all labels were introduced.
    content = writer.path.read_bytes()[-(block // 2) * record_type(WIDTH).itemsize :]
    with writer.path.open("ab") as file:
        for _ in range((rows - block) // (block // 2)):
            file.write(content)
    return writer.path


@dataclass
class Relearning:
    """What recorder and executor did while the learner learned, and while it rested."""

    states: int
    """Sent."""
    actions: int
    """Sent."""
    rows: int
    misplaced: int
    """Rows without the state that was sent just before their action."""
    ticks_without_command: int
    """By the executor's own count."""
    commands: int
    """Heard by another process."""
    missed: int
    """Commands that it did not hear, or twice."""
    lost_messages: int
    """States and actions that the recorder never got, by its own count."""
    resting: list[float]
    """Times between a tick's command and the next one while nothing was learned (ms)."""
    learning: list[float]
    """The same during a relearn."""


def relearn_meanwhile(
    seconds: float, directory: Path, table: Path, state_rate: int = 1000, rate: int = 100
) -> Relearning:
    """Lets a recorder record and an executor tick, half of the time during a relearn.

    Args:
        seconds: How long the load lasts.
        directory: Working directory.
        table: A directory of recordings that take longer than that to learn from.
        state_rate: States per second.
        rate: Actions, and ticks, per second.
    """
    write_tree(directory / "tree.json", READS_X)
    parameters: dict[str, dict[str, object]] = {
        "learner": {"demonstrations": table},
        "recorder": {"command_topic": "", "driving_topic": ""},
        "executor": {
            **{"tree_file": directory / "tree.json", "rate": float(rate), "enabled": True},
            "takeover_topics": ["takeover"],
        },
    }
    sent_at: list[int] = []
    numbers: list[int] = []
    phases: list[tuple[int, bool]] = []
    with own_domain() as domain, Peer(domain) as peer, ExitStack() as stack:

        def start(name: str) -> NodeProcess:
            return stack.enter_context(
                NodeProcess(f"{name}_node", domain, directory, parameters[name])
            )

        recorder = start("recorder")
        recorder.says("recording ")

        def heard(_: String, info: dict[str, int]) -> None:
            sent_at.append(info["source_timestamp"])
            numbers.append(info["publication_sequence_number"])

        peer.node.create_subscription(String, "command", heard, 5000)
        start("executor")
        start("learner")
        peer.wait_until(lambda: _stage(peer) == "idle", what="the learner")
        # Recorder and executor.
        load = stack.enter_context(Load(domain, state_rate, rate, WIDTH, seconds, 2))
        peer.wait_until(lambda: len(sent_at) > rate, what="commands")
        for learning in (False, True, False, True):
            if learning:
                call = peer.begin("/learner/relearn")
                peer.wait_until(lambda: _stage(peer) not in ("idle", ""), what="a relearn")
            phases.append((time.time_ns(), learning))
            _pass(peer, seconds / 6)
            phases.append((time.time_ns(), False))
            if learning:
                assert not call.done(), call.result().message
                peer.call("/learner/cancel")
        sent = peer.wait_until(load.sent, seconds * 3 + 30, "the end of the load")
        # Rows that never come are a figure.
        with suppress(TimeoutError):
            peer.wait_until(lambda: _acknowledged(peer) >= sent["actions"], 30)
        lost = int(values_of(peer.diagnostics[RECORDER])["messages lost"])
        peer.call("/executor/enable", False)
        executor = "executor: execution"
        peer.diagnostics.pop(executor, None)
        peer.wait_until(lambda: executor in peer.diagnostics, what="a report")
        counts = values_of(peer.diagnostics[executor])
        assert recorder.stop() == 0
    (path,) = (directory / "demonstrations").iterdir()
    demonstration = read_recording(path).demonstration
    found: dict[bool, list[float]] = {False: [], True: []}
    for (begin, learning), (end, _) in zip(phases[::2], phases[1::2], strict=True):
        within = [one for one in sorted(sent_at) if begin <= one < end]
        found[learning] += (np.diff(within) / 1e6).tolist()
    return Relearning(
        sent["states"],
        sent["actions"],
        len(demonstration),
        misplaced(demonstration, load.every),
        int(counts["ticks"]) - int(counts["commands"]),
        len(numbers),
        abs(numbers[-1] - numbers[0] + 1 - len(numbers)) + len(numbers) - len(set(numbers)),
        lost,
        found[False],
        found[True],
    )


def _stage(peer: Peer) -> str:
    status = peer.diagnostics.get("learner: learning")
    return values_of(status).get("stage", "") if status else ""


def _pass(peer: Peer, seconds: float) -> None:
    """Takes messages for so long; the moment is the trial, not a wait for something."""
    try:
        peer.wait_until(lambda: False, seconds)
    except TimeoutError:
        return


def resident(pid: int) -> float:
    """Memory that a process holds (MB)."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def cpu_seconds(pid: int) -> float:
    ticks = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
