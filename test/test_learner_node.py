"""The learner, as a process, over real DDS."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros_processes import LATCHED, NodeProcess, Peer, values_of, wait_until
from std_msgs.msg import String

from rebt_ros.behavior_tree.document import loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.storage.tree_file import read_tree

FEATURES = (Feature("x", topic="state", index=0), Feature("y", topic="state", index=1))


def _record(directory: Path, rows: int = 60, actions: tuple[str, ...] = ("go", "turn")) -> None:
    """A demonstration in which x decides between two actions."""
    with RecordingWriter(directory, FEATURES, ["action"]) as writer:
        for step in range(rows):
            x = float(step % 10)
            action = actions[x > 4 and len(actions) > 1]
            writer.write(Row(step, "action", action, None, (x, float(step % 7))))


def _set(peer: Peer, **values: object) -> list[Any]:
    client = peer.node.create_client(SetParameters, "learner/set_parameters")
    peer.wait_until(client.service_is_ready, what="the parameter service")
    request = SetParameters.Request(
        parameters=[
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
    )
    future = client.call_async(request)
    peer.wait_until(future.done, what="the answer of the parameter service")
    return list(future.result().results)


def _latest(peer: Peer, heard: list[String], count: int) -> LearnedTree:
    peer.wait_until(lambda: len(heard) >= count, what=f"tree number {count}")
    return loads(heard[-1].data)


def _status(peer: Peer, what: str) -> Any:
    return peer.wait_until(
        lambda: (one := peer.diagnostics.get("learner: learning")) and what in one.message and one,
        what=f"{what!r} on /diagnostics",
    )


def _is_alive(process: int) -> bool:
    """Whether it runs; one whose parent has not asked for its exit code yet does not."""
    directory = Path(f"/proc/{process}")
    try:
        state = directory.joinpath("stat").read_text().rpartition(")")[2].split()[0]
        # A thread may end later than the process that it belongs to.
        return state != "Z" or len(list(directory.joinpath("task").iterdir())) > 1
    except FileNotFoundError:
        return False


def _child(peer: Peer) -> int:
    return int(values_of(_status(peer, ""))["learning process"])


def test_relearn_publishes_writes_and_answers(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        trees = peer.listen(String, "behavior_tree", LATCHED)
        answer = peer.call("/learner/relearn")
        assert answer.success, answer.message
        for part in ("120 rows", "2 demonstrations", "2 actions", "nodes", "agree", "tree.json"):
            assert part in answer.message
        published = _latest(peer, trees, 1)
        assert published == read_tree(tmp_path / "learned" / "tree.json")
        assert [feature.topic for feature in published.features] == ["state", "state"]
        status = _status(peer, "Learned")
        assert values_of(status)["rows"] == "120"
        assert learner.stop() == 0
        assert "Traceback" not in learner.stderr


def test_the_tree_on_disk_is_published_again(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        assert peer.call("/learner/relearn").success
        assert learner.stop(signal.SIGTERM) == 0
    with NodeProcess("learner_node", domain, tmp_path):
        trees = peer.listen(String, "behavior_tree", LATCHED)
        assert _latest(peer, trees, 1) == read_tree(tmp_path / "learned" / "tree.json")


def test_a_broken_tree_on_disk_is_reported_and_not_published(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    (tmp_path / "learned").mkdir()
    (tmp_path / "learned" / "tree.json").write_text("{")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        learner.says("the tree on disk is not published")
        trees = peer.listen(String, "behavior_tree", LATCHED)
        assert peer.call("/learner/relearn").success
        _latest(peer, trees, 1)
        assert len(trees) == 1


def test_bad_demonstrations_keep_the_tree_before(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("learner_node", domain, tmp_path):
        trees = peer.listen(String, "behavior_tree", LATCHED)
        absent = peer.call("/learner/relearn")
        assert (absent.success, "demonstrations" in absent.message) == (False, True)
        (tmp_path / "demonstrations").mkdir()
        empty = peer.call("/learner/relearn")
        assert (empty.success, "holds no recordings" in empty.message) == (False, True)
        _record(tmp_path / "one", actions=("go",))
        assert all(one.successful for one in _set(peer, demonstrations=str(tmp_path / "one")))
        one = peer.call("/learner/relearn")
        assert (one.success, "one action only" in one.message) == (False, True)
        _record(tmp_path / "good")
        _set(peer, demonstrations=str(tmp_path / "good"))
        assert peer.call("/learner/relearn").success
        good = _latest(peer, trees, 1)
        with RecordingWriter(tmp_path / "good", FEATURES, ["arm"]) as writer:
            writer.write(Row(0, "arm", "wave", None, (0.0, 0.0)))
        several = peer.call("/learner/relearn")
        assert (several.success, "'arm'" in several.message) == (False, True)
        _status(peer, "'arm'")
        assert read_tree(tmp_path / "learned" / "tree.json") == good
        assert len(trees) == 1


def test_options_are_read_at_each_call(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        trees = peer.listen(String, "behavior_tree", LATCHED)
        assert peer.call("/learner/relearn").success
        _set(peer, root="parallel", max_depth=3, ccp_alpha=0.0, categorical_features=["y"], lags=2)
        assert peer.call("/learner/relearn").success
        learned = _latest(peer, trees, 2)
        assert learned.provenance.root.value == "parallel"
        assert learned.provenance.max_depth == 3
        assert learned.features[1].categories == ("0", "1", "2", "3", "4", "5", "6")
        assert [feature.lag for feature in learned.features] == [0, 0, 1, 1, 2, 2]
        _set(peer, categorical_features=["z"])
        answer = peer.call("/learner/relearn")
        assert (answer.success, "no feature 'z'" in answer.message) == (False, True)
        refused = _set(peer, root="tree")[0]
        assert (refused.successful, "must be one of" in refused.reason) == (False, True)


def test_a_second_call_is_refused_while_one_is_under_way(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        child = _child(peer)
        os.kill(child, signal.SIGSTOP)
        first = peer.begin("/learner/relearn")
        _status(peer, "learning since")
        second = peer.call("/learner/relearn")
        assert (second.success, "busy" in second.message) == (False, True)
        assert not first.done()
        os.kill(child, signal.SIGCONT)
        peer.wait_until(first.done, what="the first answer")
        assert first.result().success
        assert peer.call("/learner/relearn").success


def test_a_learning_process_that_dies_is_replaced(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        child = _child(peer)
        os.kill(child, signal.SIGSTOP)
        call = peer.begin("/learner/relearn")
        _status(peer, "learning since")
        os.kill(child, signal.SIGKILL)
        peer.wait_until(call.done, what="the answer")
        assert (call.result().success, "was killed" in call.result().message) == (False, True)
        assert peer.call("/learner/relearn").success
        # Also when it dies while it has nothing to do.
        peer.wait_until(lambda: _child(peer) != child, what="another learning process")
        idle = _child(peer)
        os.kill(idle, signal.SIGKILL)
        wait_until(lambda: not _is_alive(idle), what="its death")
        assert peer.call("/learner/relearn").success


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_learning_ends_node_and_child(
    domain: int, peer: Peer, tmp_path: Path, number: signal.Signals
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        child = _child(peer)
        os.kill(child, signal.SIGSTOP)
        peer.begin("/learner/relearn")
        _status(peer, "learning since")
        assert learner.stop(number) == 0
        assert not _is_alive(child)
        assert "Traceback" not in learner.stderr
        assert "never retrieved" not in learner.stderr


def test_the_learning_process_does_not_outlive_a_killed_node(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        child = _child(peer)
        assert _is_alive(child)
        learner.stop(signal.SIGKILL)
        wait_until(lambda: not _is_alive(child), what="the end of the learning process")


def test_a_tree_that_cannot_be_written_is_not_published(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    (tmp_path / "blocked").write_text("a file where the directory should be")
    with NodeProcess("learner_node", domain, tmp_path, {"output": tmp_path / "blocked"}):
        trees = peer.listen(String, "behavior_tree", LATCHED)
        answer = peer.call("/learner/relearn")
        assert (answer.success, "cannot be written" in answer.message) == (False, True)
        _set(peer, output=str(tmp_path / "learned"))
        assert peer.call("/learner/relearn").success
        assert json.loads((tmp_path / "learned" / "tree.json").read_text())["version"]
        _latest(peer, trees, 1)
        assert len(trees) == 1
