"""The learner, as a process, over real DDS."""

from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import shutil
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros_processes import LATCHED, NodeProcess, Peer, values_of, wait_until
from std_msgs.msg import String

import rebt_ros
from rebt_ros.behavior_tree.document import loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.drawing.svg import render_svg
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.storage.tree_file import read_tree

FEATURES = (Feature("x", topic="state", index=0), Feature("y", topic="state", index=1))


def _record(
    directory: Path,
    rows: int = 60,
    actions: tuple[str, ...] = ("go", "turn"),
    features: tuple[Feature, ...] = FEATURES,
) -> None:
    """A demonstration in which x decides between two actions."""
    with RecordingWriter(directory, features, ["action"]) as writer:
        for step in range(rows):
            x = float(step % 10)
            action = actions[x > 4 and len(actions) > 1]
            writer.write(Row(step, "action", action, None, (x, float(step % 7))))


def _set(peer: Peer, **values: object) -> list[Any]:
    parameters = [Parameter(name, value=one).to_parameter_msg() for name, one in values.items()]
    request = SetParameters.Request(parameters=parameters)
    return list(peer.ask(SetParameters, "learner/set_parameters", request).results)


def _latest(peer: Peer, heard: list[String], count: int) -> LearnedTree:
    peer.wait_until(lambda: len(heard) >= count, what=f"tree number {count}")
    return loads(heard[-1].data)


def _status(peer: Peer, what: str) -> Any:
    return peer.wait_until(
        lambda: (one := peer.diagnostics.get("learner: learning")) and what in one.message and one,
        what=f"{what!r} on /diagnostics",
    )


def _files(directory: Path) -> dict[str, object]:
    """All in a directory, by their names in it; where it is from is not compared."""
    files: dict[str, object] = {
        str(one.relative_to(directory)): one.read_bytes()
        for one in directory.rglob("*")
        if one.is_file()
    }
    summary = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    assert len(summary.pop("inputs")) == 1
    return files | {"summary.json": summary}


def _is_alive(process: int) -> bool:
    """Whether it runs; one whose parent has not asked for its exit code yet does not."""
    try:
        # A thread may end later than the process that it belongs to.
        return _state(process) != "Z" or len(list(Path(f"/proc/{process}/task").iterdir())) > 1
    except FileNotFoundError:
        return False


def _state(process: int) -> str:
    """The letter that proc(5) has for it."""
    return _stat(process)[0]


def _stat(process: int) -> list[str]:
    """What stands behind the name of the program: state, parent, ..."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()


def _children(parent: int) -> set[int]:
    """The processes that a process has started and not yet buried."""
    found = set()
    for directory in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if _stat(int(directory.name))[1] == str(parent):
                found.add(int(directory.name))
    return found


def _child(peer: Peer) -> int:
    return int(values_of(_status(peer, ""))["learning process"])


def _ask_in_vain(peer: Peer) -> tuple[int, Any]:
    """The learning process, stopped before it is to learn, and the future of the answer."""
    child = _child(peer)
    os.kill(child, signal.SIGSTOP)
    return child, peer.begin("/learner/relearn")


def _stuck(peer: Peer) -> tuple[int, Any]:
    """The same once it should learn, where there is no limit to that."""
    child, call = _ask_in_vain(peer)
    _status(peer, "learning since")
    return child, call


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
        learner.says("summary and pictures of the tree are in")
        rebt_ros.learn(tmp_path / "demonstrations", out=tmp_path / "offline")
        live, offline = (_files(tmp_path / name) for name in ("learned", "offline"))
        assert live.pop("trees/000001.json") == live["tree.json"]
        assert live == offline
        assert {"tree.png", "decision_tree.svg", "tree.txt"} <= live.keys()
        status = _status(peer, "Learned")
        assert values_of(status)["rows"] == "120"
        assert learner.stop() == 0
        assert "Traceback" not in learner.stderr


def test_after_a_restart_the_tree_on_disk_is_published_again_also_to_a_later_executor(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        assert peer.call("/learner/relearn").success
        learner.stop(signal.SIGKILL)
    learned = read_tree(tmp_path / "learned" / "tree.json")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        trees = peer.listen(String, "behavior_tree", LATCHED)
        assert _latest(peer, trees, 1) == learned
        with NodeProcess("executor_node", domain, tmp_path):
            status = peer.wait_until(
                lambda: (
                    (one := peer.diagnostics.get("executor: execution"))
                    and "nodes" in values_of(one)
                    and one
                ),
                what="an executor with a tree",
            )
            assert values_of(status)["rows"] == str(learned.provenance.rows)


def test_a_broken_tree_on_disk_is_reported_and_left_alone(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    tree = tmp_path / "learned" / "tree.json"
    tree.parent.mkdir()
    tree.write_text('{"format": "rebt_ros/behavior_tree", "ver')
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        learner.says("the tree on disk is not published")
        trees = peer.listen(String, "behavior_tree", LATCHED)
        assert _status(peer, "is not JSON").level == DiagnosticStatus.WARN
        assert tree.read_text() == '{"format": "rebt_ros/behavior_tree", "ver'
        assert peer.call("/learner/relearn").success
        assert _latest(peer, trees, 1) == read_tree(tree)
        assert len(trees) == 1


def test_a_pipe_in_place_of_the_tree_does_not_hold_up_the_node(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "learned").mkdir()
    os.mkfifo(tmp_path / "learned" / "tree.json")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        learner.says("is no regular file")
        assert learner.stop() == 0


def test_bad_demonstrations_keep_the_tree_before(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("learner_node", domain, tmp_path):
        trees = peer.listen(String, "behavior_tree", LATCHED)
        absent = peer.call("/learner/relearn")
        assert (absent.success, str(tmp_path / "demonstrations") in absent.message) == (
            False,
            True,
        )
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


def test_it_learns_without_a_call_once_enough_demonstrations_have_ended(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path, {"relearn_after": 2}) as learner:
        heard = peer.listen(String, "behavior_tree", LATCHED)
        learner.says("there is no tree")
        for _ in range(2):
            _record(tmp_path / "demonstrations")
        assert _latest(peer, heard, 1).provenance.demonstrations == 3
        learner.says("new demonstrations have ended (2): learning from all.")


def test_a_second_call_is_refused_while_one_is_under_way(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        child, first = _stuck(peer)
        second = peer.call("/learner/relearn")
        assert (second.success, "busy" in second.message) == (False, True)
        assert not first.done()
        os.kill(child, signal.SIGCONT)
        peer.wait_until(first.done, what="the first answer")
        assert first.result().success
        assert peer.call("/learner/relearn").success


def test_learning_can_be_cancelled_and_the_tree_before_stays(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        idle = peer.call("/learner/cancel")
        assert (idle.success, "nothing to cancel" in idle.message) == (False, True)
        trees = peer.listen(String, "behavior_tree", LATCHED)
        assert peer.call("/learner/relearn").success
        before = _latest(peer, trees, 1)
        # Those that are still being written would be cancelled, too, and missed.
        learner.says("summary and pictures of the tree are in")
        _record(tmp_path / "demonstrations")
        child, call = _stuck(peer)
        assert _children(learner.process.pid) == {child}
        answer = peer.call("/learner/cancel")
        assert (answer.success, "was cancelled" in answer.message) == (True, True)
        assert _children(learner.process.pid) == set()
        peer.wait_until(call.done, what="the answer of what was cancelled")
        assert (call.result().success, "was cancelled" in call.result().message) == (False, True)
        assert _status(peer, "was cancelled").level == DiagnosticStatus.OK
        assert read_tree(tmp_path / "learned" / "tree.json") == before
        assert "nothing to cancel" in peer.call("/learner/cancel").message
        again = peer.call("/learner/relearn")
        assert "2 demonstrations" in again.message
        assert _latest(peer, trees, 2).provenance.demonstrations == 2
        assert len(trees) == 2
        assert learner.stop() == 0
        assert "Traceback" not in learner.stderr


def test_learning_that_takes_too_long_is_stopped(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path, {"relearn_timeout": 1.5}) as learner:
        _, call = _ask_in_vain(peer)
        peer.wait_until(call.done, what="the answer")
        answer = call.result()
        assert (answer.success, "relearn_timeout (1.5 s)" in answer.message) == (False, True)
        assert _children(learner.process.pid) == set()
        assert _status(peer, "relearn_timeout").level == DiagnosticStatus.WARN
        _set(peer, relearn_timeout=0.0)
        assert peer.call("/learner/relearn").success


def test_progress_is_on_diagnostics(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        assert values_of(_status(peer, ""))["stage"] == "idle"
        heard = peer.listen(DiagnosticArray, "/diagnostics")
        assert peer.call("/learner/relearn").success
        peer.wait_until(lambda: heard and "Learned" in heard[-1].status[0].message)
    said = [values_of(one) for message in heard for one in message.status]
    shares = {one["stage"]: int(one["progress (%)"]) for one in said if "progress (%)" in one}
    stages = [stage for stage in shares if stage != "starting"]
    assert stages[:3] == ["reading", "choosing", "judging"]
    percents = [shares[stage] for stage in stages]
    assert percents == sorted(percents)
    assert percents[0] == 0 < percents[1] < percents[2] < 100


def test_notes_of_the_learning_are_in_the_answer_and_in_the_log(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with RecordingWriter(tmp_path / "demonstrations", FEATURES, ["action"]) as writer:
        for step in range(60):
            x = float(step % 10)
            row = Row(step * step, "action", "go" if x > 4 else "turn", None, (x, x))
            writer.write(row)
    with NodeProcess("learner_node", domain, tmp_path, {"lags": 1}) as learner:
        answer = peer.call("/learner/relearn")
        assert answer.success, answer.message
        assert "Note: the rows of channel 'action' are not evenly spaced" in answer.message
        learner.says("[WARN]")
        learner.says("are not evenly spaced, so one row back")


def test_a_refusal_has_the_notes_on_what_was_read(domain: int, peer: Peer, tmp_path: Path) -> None:
    directory = tmp_path / "demonstrations"
    _record(directory, actions=("go",))
    [recording] = directory.iterdir()
    recording.write_bytes(recording.read_bytes()[:-3])
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        answer = peer.call("/learner/relearn")
        assert not answer.success
        assert "one action only" in answer.message
        assert f"Note: {recording.name}: " in answer.message
        learner.says("[WARN]")
        learner.says(f"{recording.name}: ")


def test_a_learning_process_that_dies_is_replaced(domain: int, peer: Peer, tmp_path: Path) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        child, call = _stuck(peer)
        os.kill(child, signal.SIGKILL)
        peer.wait_until(call.done, what="the answer")
        assert (call.result().success, "was killed" in call.result().message) == (False, True)
        assert peer.call("/learner/relearn").success
        # Also when it dies while it has nothing to do.
        idle = int(values_of(_status(peer, "Learned"))["learning process"])
        assert idle != child
        os.kill(idle, signal.SIGKILL)
        wait_until(lambda: not _is_alive(idle), what="its death")
        assert peer.call("/learner/relearn").success


def test_the_node_outlives_a_lack_of_memory(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        child = _child(peer)
        # An answer means that it has loaded what it needs.
        assert not peer.call("/learner/relearn").success
        in_use = int(Path(f"/proc/{child}/statm").read_text().split()[0]) * resource.getpagesize()
        room = in_use + 2_000_000
        resource.prlimit(child, resource.RLIMIT_AS, (room, room))
        _record(tmp_path / "demonstrations", rows=20_000)
        answer = peer.call("/learner/relearn")
        assert (answer.success, "memory" in answer.message) == (False, True)
        assert learner.process.poll() is None
        os.kill(child, signal.SIGKILL)
        wait_until(lambda: not _is_alive(child), what="its death")
        _set(peer, max_depth=2, ccp_alpha=0.0)
        assert peer.call("/learner/relearn").success


def test_an_error_that_nobody_expected_ends_the_call_only(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    # Python's pathlib has an exception of its own for a link to itself.
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with NodeProcess("learner_node", domain, tmp_path, {"output": tmp_path / "loop"}) as learner:
        assert not peer.call("/learner/relearn").success
        _set(peer, output="~of nobody/learned")
        assert "there is no such home" in peer.call("/learner/relearn").message
        _set(peer, output=str(tmp_path / "learned"))
        assert peer.call("/learner/relearn").success
        assert learner.stop() == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_learning_ends_node_and_child(
    domain: int, peer: Peer, tmp_path: Path, number: signal.Signals
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        child, _ = _stuck(peer)
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


def test_a_learning_process_that_is_stuck_in_a_library_ends_with_the_node(
    domain: int, peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As sum() does not let other threads run, this process cannot hear that its input has ended.
    (tmp_path / "sklearn.py").write_text("open('stuck', 'w')\nsum(range(10**15))\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        wait_until((tmp_path / "stuck").exists, what="a process that is stuck")
        child = _child(peer)
        learner.stop(signal.SIGKILL)
        wait_until(lambda: not _is_alive(child), what="the end of the learning process")


def test_the_learning_process_stands_back_for_the_nodes(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        child, node = _child(peer), learner.process.pid

        def sacrificed(process: int) -> int:
            return int(Path(f"/proc/{process}/oom_score_adj").read_text())

        wait_until(lambda: sacrificed(child) > sacrificed(node))
        nicer = os.getpriority(os.PRIO_PROCESS, child) - os.getpriority(os.PRIO_PROCESS, node)
        assert nicer > 0
        # Where there are such groups, the processor is shared out among sessions before all else.
        session = Path(f"/proc/{child}/autogroup")
        if session.exists() and Path("/proc/sys/kernel/sched_autogroup_enabled").exists():
            assert os.getsid(child) != os.getsid(node)
            assert int(session.read_text().split()[-1]) > 0


def test_a_tree_that_cannot_be_written_is_not_published(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    (tmp_path / "blocked").write_text("a file where the directory should be")
    with NodeProcess("learner_node", domain, tmp_path, {"output": tmp_path / "blocked"}):
        trees = peer.listen(String, "behavior_tree", LATCHED)
        answer = peer.call("/learner/relearn")
        assert (answer.success, "nothing can be written to" in answer.message) == (False, True)
        _set(peer, output=str(tmp_path / "learned"))
        assert peer.call("/learner/relearn").success
        assert json.loads((tmp_path / "learned" / "tree.json").read_text())["version"]
        _latest(peer, trees, 1)
        assert len(trees) == 1


def test_the_tree_before_is_published_again_on_request(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        heard = peer.listen(String, "behavior_tree", LATCHED)
        assert not peer.call("/learner/rollback").success
        assert peer.call("/learner/relearn").success
        _latest(peer, heard, 1)
        _record(tmp_path / "demonstrations", 80, ("go", "stop"))
        assert peer.call("/learner/relearn").success
        _latest(peer, heard, 2)
        assert heard[0].data != heard[1].data
        answer = peer.call("/learner/rollback")
        assert answer.success, answer.message
        _latest(peer, heard, 3)
        assert heard[2].data == heard[0].data
        assert (tmp_path / "learned" / "tree.json").read_text() == heard[0].data
        learner.says("are of the published tree")
        drawn = (tmp_path / "learned" / "tree.svg").read_text(encoding="utf-8")
        assert drawn == render_svg(loads(heard[0].data))
        assert not peer.call("/learner/rollback").success


def test_what_is_no_recording_is_named_and_a_tree_that_was_removed_is_missed(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    (tmp_path / "demonstrations").mkdir()
    (tmp_path / "demonstrations" / "table.csv").write_text("x,label\n1,go\n2,stop\n")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        answer = peer.call("/learner/relearn")
        assert not answer.success
        assert "table.csv is none; the command `learn` reads tables and bags" in answer.message
        _record(tmp_path / "demonstrations")
        answer = peer.call("/learner/relearn")
        assert answer.success
        assert "table.csv" in answer.message
        assert _status(peer, "It is published").level == DiagnosticStatus.OK
        # What is still being written would be there again.
        learner.says("summary and pictures of the tree are in")
        shutil.rmtree(tmp_path / "learned")
        missed = _status(peer, f"is not in {tmp_path / 'learned' / 'tree.json'}, and is gone once")
        assert missed.level == DiagnosticStatus.WARN


def test_a_full_disk_publishes_nothing_and_is_told_of(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        heard = peer.listen(String, "behavior_tree", LATCHED)
        for rows in (60, 80):
            _record(tmp_path / "demonstrations", rows, ("go", "stop"))
            assert peer.call("/learner/relearn").success
        _latest(peer, heard, 2)
        pid = learner.process.pid
        _, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (100, most))
        for service in ("relearn", "rollback"):
            answer = peer.call(f"/learner/{service}")
            assert not answer.success
            assert (
                "tree.json cannot be written" in answer.message or "000003.json" in answer.message
            )
            status = peer.wait_until(peer.anew("learner: learning"))
            assert (status.level, answer.message in status.message) == (
                DiagnosticStatus.WARN,
                True,
            )
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (most, most))
        assert peer.call("/learner/rollback").success
        _latest(peer, heard, 3)
        assert heard[2].data == heard[0].data


@pytest.mark.parametrize("broken", ["{", None])
def test_the_newest_tree_is_published_again_where_the_one_on_disk_is_broken_or_gone(
    broken: str | None, domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    tree = tmp_path / "learned" / "tree.json"
    with NodeProcess("learner_node", domain, tmp_path, {"min_agreement": 1.0}) as learner:
        assert peer.call("/learner/relearn").success
        assert learner.stop() == 0
    document = tree.read_text()
    tree.unlink()
    if broken is not None:
        tree.write_text(broken)
    with NodeProcess("learner_node", domain, tmp_path) as learner:
        learner.says("~/rollback")
        heard = peer.listen(String, "behavior_tree", LATCHED)
        answer = peer.call("/learner/rollback")
        assert answer.success, answer.message
        assert "published the newest tree that was kept" in answer.message
        _latest(peer, heard, 1)
        assert heard[0].data == document == tree.read_text()
        assert not peer.call("/learner/rollback").success


def test_without_a_tree_before_nothing_is_said_to_stay(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations", 6)
    with NodeProcess("learner_node", domain, tmp_path, {"min_agreement": 1.0}):
        answer = peer.call("/learner/relearn")
        assert not answer.success
        assert "it is not published, and there is no tree yet." in answer.message


def test_a_tree_that_agrees_too_little_is_held_back_with_the_reason(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path, {"keep_if_better": True}):
        heard = peer.listen(String, "behavior_tree", LATCHED)
        assert peer.call("/learner/relearn").success
        _latest(peer, heard, 1)
        assert peer.call("/learner/relearn").success
        _latest(peer, heard, 2)
        _set(peer, min_agreement=1.0)
        _record(tmp_path / "demonstrations", 60, ("turn", "go"))
        answer = peer.call("/learner/relearn")
        assert not answer.success
        assert "min_agreement is 100.0%: it is not published" in answer.message
        assert "the tree before it stays" in answer.message
        _status(peer, "min_agreement")
        assert len(heard) == 2
        # What a tree of other features would do in these rows, nobody can tell.
        renamed = tuple(replace(feature, name=f"other {feature.name}") for feature in FEATURES)
        _record(tmp_path / "others", features=renamed)
        _set(peer, min_agreement=0.0, demonstrations=str(tmp_path / "others"))
        answer = peer.call("/learner/relearn")
        assert answer.success, answer.message
        assert "keep_if_better had no say" in answer.message


def _warning(peer: Peer, what: str) -> None:
    peer.wait_until(
        lambda: (
            (one := peer.diagnostics.get("learner: learning"))
            and one.level == DiagnosticStatus.WARN
            and what in one.message
        ),
        what=f"a warning of {what!r}",
    )


def test_a_tree_that_is_worse_or_of_far_fewer_rows_is_published_with_a_warning(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations", 200)
    noise = random.Random(2)
    with RecordingWriter(tmp_path / "noise", FEATURES, ["action"]) as writer:
        for step in range(60):
            action = "turn" if noise.random() < 0.4 else "go"
            writer.write(Row(step, "action", action, None, (noise.random(), noise.random())))
    with NodeProcess("learner_node", domain, tmp_path, {}) as learner:
        heard = peer.listen(String, "behavior_tree", LATCHED)
        assert peer.call("/learner/relearn").success
        _latest(peer, heard, 1)
        _set(peer, demonstrations=str(tmp_path / "noise"))
        answer = peer.call("/learner/relearn")
        assert answer.success, answer.message
        _latest(peer, heard, 2)
        fewer = "it was learned from 60 rows, and the tree before it from 200"
        assert fewer in answer.message
        learner.says(fewer)
        _warning(peer, fewer)
        # Learned again from the same, it is none of fewer rows, but still of no use.
        answer = peer.call("/learner/relearn")
        assert "learned from 60 rows, and the tree" not in answer.message
        doubt = "that always taking the most frequent action would reach"
        assert doubt in answer.message
        _warning(peer, doubt)


def test_a_relearn_writes_what_learn_writes_and_a_robot_in_a_namespace_has_its_own_directories(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations" / "one")
    arguments = ["-r", "__ns:=/one"]
    with NodeProcess("learner_node", domain, tmp_path, {}, arguments) as learner:
        learner.says(f"to learn one from {tmp_path / 'demonstrations' / 'one'}")
        answer = peer.call("/one/learner/relearn")
        assert answer.success, answer.message
        learner.says("summary and pictures of the tree are in")
    written = {one.name for one in (tmp_path / "learned" / "one").iterdir()}
    assert {"tree.json", "tree.txt", "tree.svg", "tree.dot", "summary.json", "trees"} <= written
    summary = json.loads((tmp_path / "learned" / "one" / "summary.json").read_text())
    assert summary["rows"] == 60
    assert summary["reasons"]


def test_a_tree_that_breaks_a_rule_is_not_published_unless_it_is_mended(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules:\n- never: go\n  when: x < 2\n- never: turn\n  when: x < 1\n")
    with NodeProcess("learner_node", domain, tmp_path, {"rules_file": str(rules)}):
        heard = peer.listen(String, "behavior_tree", LATCHED)
        answer = peer.call("/learner/relearn")
        assert not answer.success
        assert "is not published, and the tree before it stays" in answer.message
        assert "it breaks 'never go when x < 2': where x = " in answer.message
        assert not (tmp_path / "learned" / "tree.json").exists()
        _set(peer, repair=True, rules_file=str(tmp_path / "none.yaml"))
        _status(peer, "none.yaml is not there, so that no tree is published")
        _set(peer, rules_file=str(rules))
        answer = peer.call("/learner/relearn")
        assert answer.success, answer.message
        assert "Guards make it keep its rules: " in answer.message
        tree = _latest(peer, heard, 1)
        assert read_tree(tmp_path / "learned" / "tree.json") == tree
        rules.write_text("rules:\n- never: fly\n")
        answer = peer.call("/learner/relearn")
        assert not answer.success
        assert "line 2, column 10: there is no action 'fly'" in answer.message


def test_a_tree_on_disk_that_breaks_a_rule_is_not_published(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    _record(tmp_path / "demonstrations")
    with NodeProcess("learner_node", domain, tmp_path):
        assert peer.call("/learner/relearn").success
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules:\n- never: go\n")
    with NodeProcess("learner_node", domain, tmp_path, {"rules_file": str(rules)}):
        _status(peer, "the tree on disk is not published: it breaks 'never go'")
