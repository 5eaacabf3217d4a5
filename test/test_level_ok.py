"""Level OK means that the job is being done: whatever keeps a node from it is said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from executor_examples import READS_X
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_processes import LATCHED, NodeProcess, Peer
from std_msgs.msg import Bool, Float64MultiArray, Int32, String

from rebt_ros.behavior_tree.document import dumps

PROMPT = {"reorder_window": 0.0}
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
WARN = b"\x01"


def _warns(peer: Peer, source: str, *texts: str) -> None:
    """Waits until the node warns of something with all these texts."""

    def said() -> bool:
        reports = [one for name, one in peer.diagnostics.items() if name.startswith(f"{source}: ")]
        return any(
            one.level == WARN and all(text in one.message for text in texts) for one in reports
        )

    peer.wait_until(said, what=f"a warning of {texts}")


def test_a_recorder_says_whose_qos_does_not_fit(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.state(0.0)
        peer.node.create_publisher(String, "action", BEST_EFFORT)
        _warns(peer, "recorder", "/test_peer offers incompatible QoS on /action", "reliable")
        recorder.says("offers incompatible QoS on /action")
        answer = peer.call("/recorder/new_demonstration")
        assert not answer.success
        assert "Not heard so far: action" in answer.message


def test_a_recorder_says_who_publishes_another_type(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        peer.node.create_publisher(Int32, "state", 10)
        _warns(peer, "recorder", "/test_peer publishes std_msgs/msg/Int32 on /state")
        recorder.says("not std_msgs/msg/Float64MultiArray")


@pytest.mark.parametrize("sample_rate", [0.0, 10.0])
def test_a_recorder_says_that_simulated_time_does_not_come(
    domain: int, peer: Peer, tmp_path: Path, sample_rate: float
) -> None:
    parameters = PROMPT | {"use_sim_time": True, "sample_rate": sample_rate}
    with NodeProcess("recorder_node", domain, tmp_path, parameters) as recorder:
        peer.state(0.0)
        peer.action("go")
        _warns(peer, "recorder", "waiting for /clock")
        recorder.says("waiting for /clock")


def test_a_recorder_says_once_that_nobody_publishes_and_what_was_not_recorded(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT) as recorder:
        _warns(peer, "recorder", "nobody publishes on /state", "nobody publishes on /action")
        recorder.says("nobody publishes on /action.")
        answer = peer.call("/recorder/record", False)
        assert not answer.success
        assert "no rows were recorded" in answer.message
    assert recorder.stderr.count("nobody publishes on /action.") == 1


def test_a_recorder_is_ready_once_it_has_heard_every_topic(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("recorder_node", domain, tmp_path, PROMPT):
        said = peer.listen(Bool, "recorder/ready", LATCHED)
        peer.wait_until(lambda: [one.data for one in said] == [False])
        peer.connect(String, "action")
        peer.connect(Float64MultiArray, "state")
        assert [one.data for one in said] == [False]
        peer.state(0.0)
        peer.wait_until(lambda: [one.data for one in said] == [False, True])


def test_with_two_learners_all_who_are_concerned_say_so(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    names = []
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}) as executor:
        nodes = []
        try:
            for name in ("one", "two"):
                directory = tmp_path / name
                directory.mkdir()
                tree = directory / "tree.json"
                tree.write_text(dumps(READS_X))
                rename = ["-r", f"__node:={name}"]
                nodes.append(
                    NodeProcess("learner_node", domain, directory, {"output": directory}, rename)
                )
                names.append(name)
            _warns(peer, "executor", "2 nodes publish trees on behavior_tree (/one, /two)")
            executor.says("2 nodes publish trees on behavior_tree")
            for name in names:
                _warns(peer, name, "2 nodes publish trees on behavior_tree")
        finally:
            for one in nodes:
                one.stop()


def test_an_executor_says_that_nobody_obeys_it(domain: int, peer: Peer, tmp_path: Path) -> None:
    path = tmp_path / "tree.json"
    path.write_text(dumps(READS_X))
    parameters: dict[str, Any] = {"tree_file": path, "enabled": True}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        peer.connect(Float64MultiArray, "state")
        _warns(peer, "executor", "nobody listens to /command")


@pytest.mark.parametrize("node", ["executor", "recorder"])
def test_an_empty_list_means_none_or_is_refused_in_a_sentence(
    node: str, domain: int, peer: Peer, tmp_path: Path
) -> None:
    if node == "executor":
        arguments = ["-p", "takeover_topics:=[]"]
        with NodeProcess("executor_node", domain, tmp_path, {}, arguments) as process:
            process.says("disabled until ~/enable is called.")
            assert "not initialized" not in process.stderr
    else:
        with NodeProcess("recorder_node", domain, tmp_path, {}, ["-p", "rate:=[]"]) as process:
            process.says("recording action with state")


def test_a_tree_that_tests_texts_is_refused_with_the_feature(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    table = tmp_path / "table.csv"
    rows = "".join(
        f"{color},{'stop' if color == 'red' else 'go'}\n" for color in ("red", "blue") * 20
    )
    table.write_text("color,action\n" + rows)
    import rebt_ros

    result = rebt_ros.learn(table, out=tmp_path / "out")
    assert any("'color', which holds texts (blue, red)" in note for note in result.notes)
    document = json.loads((tmp_path / "out" / "tree.json").read_text())
    assert document
    path = tmp_path / "out" / "tree.json"
    with NodeProcess("executor_node", domain, tmp_path, {"tree_file": path}) as executor:
        assert executor.wait() == 1
    assert "the tree tests 'color' for texts (blue, red)" in executor.stderr
    assert "Traceback" not in executor.stderr
