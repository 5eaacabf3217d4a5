"""The recorder, as a process, over real DDS."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from ros_processes import LATCHED, NodeProcess, Peer, own_domain, values_of
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, String

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.last_action import last_actions
from rebt_ros.storage.recording import read_recording
from rebt_ros.storage.recording_files import is_recording, recordings
from rebt_ros.storage.recording_head import Origin, read_head

#: The tests' robots do not send states all the time: their last actions would wait for the next.
PROMPT: dict[str, object] = {"state_wait": 0.2}


def _recorded(directory: Path) -> list[Demonstration]:
    return [read_recording(path).demonstration for path in recordings(directory)]


def _actions(demonstration: Demonstration) -> list[str]:
    return [demonstration.actions[code] for code in demonstration.chosen]


def _lat(demonstration: Demonstration) -> list[str | None]:
    codes = last_actions(demonstration.chosen, np.zeros(len(demonstration), dtype=np.int64))
    return [demonstration.actions[code] if code >= 0 else None for code in codes]


def test_an_action_in_a_burst_gets_the_state_that_held(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        peer.state(0.0, labels=["x"])
        peer.action("start")
        for burst in range(1, 40):
            for step in range(5):
                peer.state(burst + step / 10)
            peer.action("go" if burst % 2 else "turn")
        answer = peer.call("/recorder/record", False)
        assert answer.success, answer.message
        assert "recorded 40 rows in " in answer.message
    (demonstration,) = _recorded(tmp_path / "demonstrations")
    assert [feature.name for feature in demonstration.features] == ["x"]
    assert demonstration.states[:, 0].tolist() == [0.0] + [n + 0.4 for n in range(1, 40)]
    assert _actions(demonstration)[:4] == ["start", "go", "turn", "go"]
    assert np.all(np.diff(demonstration.stamps) > 0)


def test_bad_messages_are_counted_and_left_out(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.action("too early")
        peer.state(1.0, 2.0)
        peer.state(1.0, 2.0, 3.0)
        peer.state(float("nan"), 2.0)
        peer.state(float("inf"), 2.0)
        peer.state()
        peer.action("bad\nlabel")
        peer.action("good")
        status = peer.wait_until(
            lambda: (
                (one := peer.diagnostics.get("recorder: recording"))
                and values_of(one)["rows"] == "1"
                and one
            )
        )
        counts = values_of(status)
        assert counts["value that is not finite"] == "2"
        assert counts["unexpected length"] == "1"
        assert counts["empty message"] == "1"
        assert counts["unusable action label"] == "1"
        assert counts["action before the first state"] == "1"
        assert int.from_bytes(status.level, "big") == 1
        recorder.says("sent 3 values where 2 were expected")
        assert recorder.stderr.count("not finite") <= 1
        assert recorder.stop() == 0
    (demonstration,) = _recorded(tmp_path / "demonstrations")
    assert demonstration.states.tolist() == [[1.0, 2.0]]
    assert _actions(demonstration) == ["good"]


def test_a_new_demonstration_begins_without_a_last_action_but_with_the_state(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        peer.state(1.0)
        for label in ("go", "turn", "turn"):
            peer.action(label)
        answer = peer.call("/recorder/new_demonstration")
        assert answer.success
        assert "recorded 3 rows in " in answer.message
        for label in ("go", "turn"):
            peer.action(label)
        assert "recorded 2 rows in " in peer.call("/recorder/record", False).message
    first, second = _recorded(tmp_path / "demonstrations")
    assert _lat(first) == [None, "go", "go"]
    assert _lat(second) == [None, "go"]
    assert second.states.tolist() == [[1.0], [1.0]]


def test_a_discarded_demonstration_leaves_no_file(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        peer.state(1.0)
        peer.action("wrong")
        answer = peer.call("/recorder/discard_demonstration")
        assert answer.success
        assert "discarded 1 row " in answer.message
        peer.action("right")
        assert "recorded 1 row " in peer.call("/recorder/new_demonstration").message
        peer.action("wrong again")
        assert "recorded 1 row " in peer.call("/recorder/new_demonstration").message
        assert "discarded 1 row " in peer.call("/recorder/discard_demonstration").message
        assert "no row to discard" in peer.call("/recorder/discard_demonstration").message
        assert "1 row in all" in peer.call("/recorder/record", False).message
        assert not peer.call("/recorder/discard_demonstration").success
        assert not peer.call("/recorder/new_demonstration").success
    (demonstration,) = _recorded(tmp_path / "demonstrations")
    assert _actions(demonstration) == ["right"]


def test_what_failed_is_shown_next_and_a_takeover_of_it_is_set_aside(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    def counted(**values: str) -> None:
        wanted = {key.replace("_", " "): value for key, value in values.items()}
        peer.wait_until(
            lambda: (
                (one := peer.diagnostics.get("recorder: recording"))
                and wanted.items() <= values_of(one).items()
            ),
            what=str(wanted),
        )

    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        peer.state(1.0)
        peer.connect(Bool, "executor/driving", LATCHED)
        peer.publish(Bool(data=True), "executor/driving")
        peer.publish(String(data="turn"), "command")
        peer.action("stop")
        counted(takeovers="1", rows="1", origin_of_the_demonstration="takeover")
        answer = peer.call("/recorder/failed")
        assert answer.success
        assert answer.message.startswith("the takeover did not help and is set aside: 1 row in ")
        assert answer.message.endswith(
            "Now disable the executor, put the robot back to where the episode began, or leave it "
            "where it is, and show how it is done, to the end; then call ~/new_demonstration."
        )
        peer.action("go")
        peer.action("go")
        counted(takeovers="1", failed_episodes="1", rows="3", origin_of_the_demonstration="failed")
        assert "recorded 2 rows in " in peer.call("/recorder/record", False).message
    (demonstration,) = _recorded(tmp_path / "demonstrations")
    assert _actions(demonstration) == ["go", "go"]
    assert demonstration.before == {}
    (path,) = recordings(tmp_path / "demonstrations")
    with path.open("rb") as file:
        assert read_head(path, file).origin is Origin.FAILED
    (aside,) = tmp_path.glob("demonstrations/*.rec.failed")
    assert _actions(read_recording(aside).demonstration) == ["stop"]


def test_nothing_is_recorded_until_asked_for(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT | {"recording": False}):
        peer.state(1.0)
        peer.action("before")
        assert peer.call("/recorder/record", True).success
        peer.action("during")
        assert "recorded 1 row " in peer.call("/recorder/record", False).message
        peer.action("after")
        assert "already" in peer.call("/recorder/record", False).message
    (demonstration,) = _recorded(tmp_path / "demonstrations")
    assert _actions(demonstration) == ["during"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_file_in_order(
    domain: int, peer: Peer, tmp_path: Path, number: signal.Signals
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.state(1.0)
        peer.action("go")
        peer.wait_until(lambda: list(tmp_path.glob("demonstrations/*.rec")))
        assert recorder.stop(number) == 0
        assert "Traceback" not in recorder.stderr
        assert "recorded 1 row in " in recorder.stderr
    assert _actions(_recorded(tmp_path / "demonstrations")[0]) == ["go"]


@pytest.mark.parametrize("delay", [0, 10, 100, 300, 1000, 3000])
def test_a_signal_while_starting_ends_the_node_quietly(tmp_path: Path, delay: int) -> None:
    with (
        own_domain() as domain,
        NodeProcess("recorder_node", domain, tmp_path, {"reorder_window": 0.0}) as recorder,
    ):
        recorder.catches(signal.SIGTERM)
        for _ in range(delay):
            recorder.catches(signal.SIGTERM)
        assert recorder.stop(signal.SIGTERM) == 0
        assert "Traceback" not in recorder.stderr


def test_fields_are_named_by_parameter_and_channels_kept_apart(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {
        "state_topics": ["pose", "battery"],
        "action_topics": ["base", "arm"],
        "state_fields": ["pose:x,y"],
        "state_qos": "sensor_data",
    }
    with NodeProcess(
        "recorder_node", domain, tmp_path, PROMPT | parameters, ["-r", "__ns:=/robot"]
    ):

        def both_heard() -> bool:
            peer.state(1.0, 2.0, topic="/robot/pose")
            peer.state(0.5, topic="/robot/battery")
            status = peer.diagnostics.get("robot/recorder: recording")
            rates = {} if status is None else values_of(status)
            return all(
                float(rates.get(f"rate of {topic} (Hz)", 0.0)) for topic in ("pose", "battery")
            )

        peer.wait_until(both_heard)
        peer.action("go", topic="/robot/base")
        peer.action("wave", topic="/robot/arm")
        peer.action("stop", topic="/robot/base")
        assert peer.call("/robot/recorder/record", False).success
    (demonstration,) = _recorded(tmp_path / "demonstrations" / "robot")
    assert [one.name for one in demonstration.features] == ["x", "y", "battery[0]"]
    assert [one.topic for one in demonstration.features] == ["pose", "pose", "battery"]
    channels = [demonstration.channels[code] for code in demonstration.channel]
    assert channels == ["base", "arm", "base"]


def test_a_held_action_is_sampled_at_the_rate_asked_for(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, {"sample_rate": 100.0}):
        peer.state(0.0)
        peer.action("go")
        peer.wait_until(
            lambda: (
                peer.state(1.0)
                and (one := peer.diagnostics.get("recorder: recording"))
                and int(values_of(one)["rows"]) > 20
            )
        )
        assert peer.call("/recorder/record", False).success
    (demonstration,) = _recorded(tmp_path / "demonstrations")
    assert set(_actions(demonstration)) == {"go"}
    assert np.diff(demonstration.stamps)[:20].tolist() == [10_000_000] * 20


def test_rows_carry_simulated_time_where_it_is_in_use(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT | {"use_sim_time": True}):
        peer.state(1.0)

        def stamped() -> bool:
            peer.publish(Clock(clock=Time(sec=5)), "/clock")
            peer.action("go")
            files = tmp_path.glob("demonstrations/*.rec")
            return any(
                5_000_000_000 in read_recording(one).demonstration.stamps
                for one in files
                if is_recording(one)
            )

        peer.wait_until(stamped)


def test_recording_goes_on_once_there_is_room_again(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    blocked = tmp_path / "demonstrations"
    blocked.write_text("a file where the directory should be")
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.state(1.0)
        peer.action("lost")
        recorder.says("[ERROR]")
        status = peer.wait_until(
            lambda: (
                (one := peer.diagnostics.get("recorder: recording"))
                and int.from_bytes(one.level, "big") == 2
                and one
            )
        )
        assert str(blocked.name) in status.message
        blocked.unlink()

        def kept() -> bool:
            peer.action("kept")
            peer.spin_once()
            return any(os.stat(one).st_size for one in blocked.glob("*.rec"))

        peer.wait_until(kept)
        assert recorder.stop() == 0
    (demonstration,) = _recorded(blocked)
    assert set(_actions(demonstration)) == {"kept"}
    assert set(_lat(demonstration)) == {None}


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"sample_rate": -1.0}, "parameter 'sample_rate' must be in [0, 1000], not -1.0."),
        ({"sample_rate": "fast"}, "parameter 'sample_rate' must be a number"),
        ({"state_qos": "best"}, "must be one of: reliable, sensor_data, not 'best'."),
        ({"state_topics": ["state", "/state"]}, "name twice"),
        ({"action_topics": ["state"]}, "must differ from each other"),
        ({"state_fields": ["state"]}, "write it as 'topic:field,field'"),
        ({"demonstrations": ""}, "parameter 'demonstrations' is empty"),
        ({"state_topics": ["a topic"]}, "Invalid topic name"),
    ],
)
def test_a_wrong_parameter_is_one_sentence_and_exit_code_1(
    tmp_path: Path, parameters: dict[str, object], sentence: str
) -> None:
    with (
        own_domain() as domain,
        NodeProcess("recorder_node", domain, tmp_path, parameters) as recorder,
    ):
        assert recorder.wait() == 1
        assert sentence in recorder.stderr
        assert "Traceback" not in recorder.stderr
        assert len(recorder.stderr.splitlines()) == 1
