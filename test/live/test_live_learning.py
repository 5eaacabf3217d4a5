"""From a live demonstration to a tree that commands: recorder, learner and executor together."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import serialize_message
from ros_processes import LATCHED, NodeProcess, Peer, values_of
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

from rebt_ros.behavior_tree.document import loads
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.inputs import load

FIELDS = ("distance", "bearing", "battery")

#: Without LAT the decision tree's prediction follows from the state alone.
OPTIONS = LearnOptions(history=History.NONE, psa=Use.NEVER, max_depth=6, ccp_alpha=0.0, refit=True)
PARAMETERS = {"history": "none", "psa": "never", "max_depth": 6, "ccp_alpha": 0.0}


def _state(chance: random.Random) -> tuple[float, ...]:
    return (
        round(chance.uniform(0.0, 3.0), 2),
        round(chance.uniform(-math.pi, math.pi), 2),
        float(chance.random() < 0.8),
    )


def _decide(state: tuple[float, ...]) -> str:
    distance, bearing, battery = state
    if battery < 0.5:
        return "charge"
    if distance < 0.4:
        return "stop"
    return "go" if abs(bearing) < 0.7 else "turn left" if bearing > 0 else "turn right"


def _learning(table: DemonstrationTable) -> Learning:
    return learn_from(table, OPTIONS)


def _table(demonstrations: tuple[Demonstration, ...]) -> DemonstrationTable:
    return tabulate(demonstrations)[0]


def _predictions(learning: Learning, states: list[tuple[float, ...]]) -> list[str]:
    """What scikit-learn's decision tree predicts."""
    count = len(states)
    table = replace(
        learning.table,
        states=np.array(states),
        chosen=np.zeros(count, dtype=np.int64),
        demonstration=np.zeros(count, dtype=np.int64),
        stamps=np.arange(count),
    )
    return [learning.table.actions[code] for code in learning.decision_tree.predict(table)]


class BagWriter:
    """Writes what is published to a bag, in the order in which it is published."""

    def __init__(self, path: Path) -> None:
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        types = get_typestore(Stores.ROS2_JAZZY)
        self._connections = {
            kind: self._writer.add_connection(topic, name, typestore=types)
            for kind, topic, name in (
                (Float64MultiArray, "/state", "std_msgs/msg/Float64MultiArray"),
                (String, "/action", "std_msgs/msg/String"),
            )
        }

    def write(self, message: Any) -> None:
        self._writer.write(
            self._connections[type(message)], time.time_ns(), serialize_message(message)
        )

    def close(self) -> None:
        self._writer.close()


def _state_message(state: tuple[float, ...]) -> Float64MultiArray:
    message = Float64MultiArray(data=list(state))
    message.layout.dim = [MultiArrayDimension(label=field) for field in FIELDS]
    return message


def test_a_bag_and_a_recording_of_the_same_messages_give_the_same_table_and_tree(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    chance = random.Random(2)
    bag = BagWriter(tmp_path / "bag")
    # Bags know topics by their full names.
    parameters = {"state_topics": ["/state"], "action_topics": ["/action"]}
    with NodeProcess("recorder_node", domain, tmp_path, parameters) as recorder:
        for step in range(150):
            # Bursts of states, several actions in one state, and repeated actions.
            states = [_state(chance) for _ in range(1 + step % 4)]
            messages: list[Any] = [_state_message(state) for state in states]
            messages += [String(data=_decide(states[-1]))] * (1 + step % 3 // 2)
            for message in messages:
                bag.write(message)
                topic = "state" if isinstance(message, Float64MultiArray) else "action"
                peer.publish(message, topic)
            if step % 10 == 0:
                peer.spin_once()
        assert peer.call("/recorder/record", False).success
        assert recorder.stop() == 0
    bag.close()
    recorded = load([tmp_path / "demonstrations"]).demonstrations
    bagged = read_bag(tmp_path / "bag").demonstration
    live, offline = _table(recorded), _table((bagged,))
    assert len(live) == 200
    assert live.features == offline.features
    assert [feature.name for feature in live.features] == list(FIELDS)
    assert live.channel == offline.channel
    assert live.actions == offline.actions
    for column in ("states", "chosen", "last"):
        np.testing.assert_array_equal(getattr(live, column), getattr(offline, column))
    assert _learning(live).learned == _learning(offline).learned


def _demonstrate(peer: Peer, chance: random.Random, demonstrations: int, rows: int) -> None:
    """Shows what `_decide` says, and ends the recording."""
    for left in reversed(range(demonstrations)):
        for _ in range(rows):
            state = _state(chance)
            peer.state(*state, labels=FIELDS)
            peer.action(_decide(state))
            peer.spin_once()
        if left:
            answer = peer.call("/recorder/new_demonstration")
        else:
            answer = peer.call("/recorder/record", False)
        assert f"recorded {rows} rows" in answer.message


class Commanded:
    """What the executor commands in one state after another."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._commands = peer.listen(String, "command")

    def first(self, state: tuple[float, ...], wanted: Callable[[str], bool]) -> str:
        """The first command from now on, while the state is sent, that is one of the wanted."""

        def heard() -> str | None:
            self._peer.state(*state)
            return next((one.data for one in self._commands if wanted(one.data)), None)

        self._commands.clear()
        return str(self._peer.wait_until(heard, what=f"a command in {state}"))

    def in_all(self, states: list[tuple[float, ...]], expected: list[str]) -> list[str]:
        """What it commands in each state, where something is expected that is not always the same.

        First another action is commanded in another state: what comes next that is not this action
        answers to the state in question, however late it comes.
        """
        got = []
        for state, label in zip(states, expected, strict=True):
            other = next(place for place, one in enumerate(expected) if one != label)
            between = expected[other]
            self.first(states[other], lambda one, between=between: one == between)
            got.append(self.first(state, lambda one, between=between: one != between))
        return got


def test_what_was_shown_is_learned_and_commanded(domain: int, peer: Peer, tmp_path: Path) -> None:
    with (
        NodeProcess("recorder_node", domain, tmp_path) as recorder,
        NodeProcess("learner_node", domain, tmp_path, PARAMETERS) as learner,
        NodeProcess("executor_node", domain, tmp_path, {"rate": 200.0}) as executor,
    ):
        # The executor listens to persons, and may be heard of before the recorder.
        peer.connect(String, "action", subscribers=2)
        chance = random.Random(1)
        _demonstrate(peer, chance, demonstrations=4, rows=100)

        trees = peer.listen(String, "behavior_tree", LATCHED)
        answer = peer.call("/learner/relearn")
        assert answer.success, answer.message
        assert "400 rows of 4 demonstrations" in answer.message
        peer.wait_until(lambda: trees)

        learning = _learning(_table(load([tmp_path / "demonstrations"]).demonstrations))
        assert loads(trees[0].data) == learning.learned
        states = [_state(chance) for _ in range(200)]
        expected = _predictions(learning, states)
        assert set(expected) == {"charge", "stop", "go", "turn left", "turn right"}

        commanded = Commanded(peer)
        peer.wait_until(
            lambda: (
                (one := peer.diagnostics.get("executor: execution"))
                and values_of(one)["condition"] == "disabled"
            )
        )
        assert peer.call("/executor/enable", True).success

        assert commanded.in_all(states, expected) == expected

        # A malformed document changes nothing.
        peer.connect(String, "behavior_tree", LATCHED).publish(String(data='{"format": '))
        executor.says("a behavior tree was refused (the tree before it stays)")
        label = expected[0]
        assert commanded.first(states[0], lambda one: one == label) == label

        for node in (recorder, learner, executor):
            assert node.stop() == 0
            assert "Traceback" not in node.stderr
