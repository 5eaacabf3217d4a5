"""Mutated documents for an executor that runs: a real process, over real DDS."""

from __future__ import annotations

import itertools
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Final

from rclpy.serialization import serialize_message
from ros_processes import LATCHED, NodeProcess, Peer, own_domain, values_of
from std_msgs.msg import Float64MultiArray, String

from fuzz import corpus
from fuzz.campaign import LARGEST_GROWTH, LONGEST, Outcome, generator
from fuzz.mutation import TEXTS, mutated_bytes, mutated_json, mutated_text
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.errors import DocumentError
from rebt_ros.storage.tree_file import write_tree

#: Ticks per second of the executor.
RATE: Final = 100.0
#: How often the state is published (Hz).
_STATE_RATE: Final = 50.0
#: Share of documents that must have been read; on a busy machine one may replace another unseen,
#: while a document that is taken for a tree is found by what the executor commands then.
_LEAST_HEARD: Final = 0.5

TARGET: Final = "executor"


@dataclass(frozen=True, slots=True)
class Sent:
    """A message for the executor."""

    data: bytes | str
    """The document, or all bytes of a message that was mutated as such."""
    valid: bool
    """Whether the executor may take it, because it can be read or nobody knows."""


def message(random: Random) -> Sent:
    """A mutated document; now and then a mutated message, or a document that can be read."""
    kind = random.random()
    text = random.choice(corpus.documents())
    if kind < 0.05:
        return Sent(mutated_bytes(random, serialize_message(String(data=text))), True)
    if kind < 0.15:
        text = _with_odd_names(random)
    elif kind < 0.4:
        text = mutated_text(random, text)
    else:
        text = mutated_json(random, text)
    # What a publisher could not send.
    text = text.encode("utf-8", "replace").decode().replace("\0", "")
    try:
        loads(text)
    except DocumentError:
        return Sent(text, False)
    return Sent(text, True)


def _with_odd_names(random: Random) -> str:
    """A document that can be read, with a name in it that means something to ROS."""
    document = json.loads(dumps(corpus.simple()))
    odd = random.choice(TEXTS)
    if random.random() < 0.5:
        document["features"][0]["topic"] = odd
    else:
        tree, actions = document["tree"], document["actions"]
        actions[0]["channel"] = tree["children"][0]["children"][1]["channel"] = odd
    return json.dumps(document)


class Campaign:
    """An executor under fire.

    Args:
        peer: What sends to it.
        executor: Its process.
    """

    def __init__(self, peer: Peer, executor: NodeProcess) -> None:
        self._peer = peer
        self._executor = executor
        self._restored = 0
        self._documents = peer.connect(String, "behavior_tree", LATCHED)
        self._state = peer.connect(Float64MultiArray, "state")
        self._next_state = 0.0
        self._commands: list[float] = []
        """When each was heard."""
        self._latest = ""
        peer.node.create_subscription(String, "command", self._on_command, 1000)

    def _on_command(self, message: String) -> None:
        self._commands.append(time.monotonic())
        self._latest = message.data

    def _meanwhile(self) -> None:
        now = time.monotonic()
        if now >= self._next_state:
            self._state.publish(Float64MultiArray(data=[0.25]))
            self._next_state = now + 1 / _STATE_RATE
        self._peer.spin_once()

    def until(self, condition: Any, patience: float = 30.0) -> bool:
        """Keeps the state fresh until the condition holds; false if it does not in time."""
        end = time.monotonic() + patience
        while not condition():
            if time.monotonic() > end or self._executor.process.poll() is not None:
                return False
            self._meanwhile()
        return True

    def commanded(self, count: int = 1) -> bool:
        """Waits for so many further commands."""
        seen = len(self._commands)
        return self.until(lambda: len(self._commands) >= seen + count)

    def restore(self) -> bool:
        """Gives it a good tree again, and waits until it obeys that one."""
        self._restored += 1
        label = f"go {self._restored}"
        self._documents.publish(String(data=dumps(corpus.simple(label))))
        return self.until(lambda: self._latest == label)

    def send(self, sent: Sent) -> None:
        """Sends a message as it is."""
        data = sent.data
        self._documents.publish(String(data=data) if isinstance(data, str) else data)

    def handled(self) -> int:
        """How many documents it has refused, as its next report says."""
        self._peer.diagnostics.clear()
        if not self.until(lambda: "executor: execution" in self._peer.diagnostics):
            return 0
        return int(values_of(self._peer.diagnostics["executor: execution"])["refused trees"])

    def longest_gap(self, since: int) -> float:
        """The longest time without a command, from one of them on (seconds)."""
        times = self._commands[since:]
        return max((after - before for before, after in itertools.pairwise(times)), default=0.0)

    @property
    def heard(self) -> int:
        """How many commands were heard."""
        return len(self._commands)

    @property
    def seconds(self) -> float:
        """Time of the processor that the executor has used."""
        stat = Path(f"/proc/{self._executor.process.pid}/stat").read_text()
        user, system = stat.rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    @property
    def resident(self) -> int:
        """Resident memory of the executor, bytes."""
        status = Path(f"/proc/{self._executor.process.pid}/status").read_text()
        line = next(one for one in status.splitlines() if one.startswith("VmHWM"))
        return int(line.split()[1]) << 10


@contextmanager
def campaign(directory: Path) -> Iterator[tuple[Campaign, NodeProcess]]:
    """An executor that commands at `RATE`."""
    write_tree(directory / "tree.json", corpus.simple())
    parameters = {
        "tree_file": directory / "tree.json",
        "enabled": True,
        "rate": RATE,
        "state_timeout": 5.0,
    }
    with (
        own_domain() as domain,
        Peer(domain) as peer,
        NodeProcess("executor_node", domain, directory, parameters) as executor,
    ):
        under_fire = Campaign(peer, executor)
        assert under_fire.commanded(10), executor.stderr
        yield under_fire, executor


def run(directory: Path, seed: int, numbers: range) -> Outcome:
    """Sends mutated documents; its tree must go on commanding, whatever it is sent.

    After each message it waits for commands: of documents that came at once, a queue of depth 1
    would keep the last one only.
    """
    outcome = Outcome(TARGET, seed)
    with campaign(directory) as (executor, process):
        before = executor.resident
        expected = 0
        for number in numbers:
            sent = message(generator(TARGET, seed, number))
            heard, busy = executor.heard, executor.seconds
            executor.send(sent)
            alive = executor.commanded(3) if not sent.valid else executor.restore()
            outcome.inputs += 1
            outcome.accepted += sent.valid
            if process.process.poll() is not None or not alive:
                outcome.fail(number, f"the executor ended or fell silent: {process.stderr[-2000:]}")
                break
            # A tree that was taken may wait for a state that nobody publishes.
            gap = 0.0 if sent.valid else executor.longest_gap(heard)
            outcome.slowest = max(outcome.slowest, gap)
            # Where it did not compute meanwhile, it was the machine that had no time for it.
            if gap > LONGEST and executor.seconds - busy > LONGEST / 2:
                outcome.fail(number, f"no command for {gap:.1f} s")
            expected += not sent.valid
        outcome.refused = executor.handled() if process.process.poll() is None else 0
        outcome.growth = max(0, executor.resident - before) if outcome.passed else 0
        if outcome.passed:
            _judge(outcome, expected, process)
    return outcome


def _judge(outcome: Outcome, expected: int, process: NodeProcess) -> None:
    """What is to be said at the end."""
    if outcome.refused < _LEAST_HEARD * expected:
        outcome.fail(outcome.inputs, f"only {outcome.refused} of {expected} documents were refused")
    if outcome.growth > LARGEST_GROWTH:
        outcome.fail(outcome.inputs, f"{outcome.growth >> 20} MB more memory")
    if process.stop() != 0 or "Traceback" in process.stderr:
        outcome.fail(outcome.inputs, f"it did not end well: {process.stderr[-2000:]}")
