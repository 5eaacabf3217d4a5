"""The executor, as a process, over real DDS."""

from __future__ import annotations

import json
import signal
import time
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from executor_examples import (
    EXECUTION,
    GO,
    STOP,
    TURN,
    Robot,
    SimulatedTime,
    learned,
    publish,
    report,
    status,
    timed_commands,
    where_x_is_small,
)
from ros_processes import AGES, NodeProcess, Peer, values_of
from std_msgs.msg import String

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.nodes import (
    Action,
    Condition,
    Parallel,
    Selector,
    Sequence,
)
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import LastActionIs, Literal, Threshold
from rebt_ros.storage.tree_file import write_tree


def test_it_waits_for_a_tree_then_to_be_enabled_then_for_state(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path) as executor:
        robot_hears = peer.listen(String, "command")
        status(peer, "waiting for a tree", enabled="False")
        publish(peer, learned(where_x_is_small(GO, TURN)))
        said = status(peer, "disabled")
        assert values_of(said)["nodes"] == "5"
        answer = peer.call("/executor/enable", True)
        assert answer.success
        assert "waiting for state: state (never received)" in answer.message
        said = status(peer, "waiting for state")
        assert int.from_bytes(said.level, "big") == 1
        assert robot_hears == []
        robot = Robot(peer)
        robot.obeys("go")
        robot.state = (7.0, 1.0)
        robot.obeys("turn")
        assert executor.stop() == 0
        assert "Traceback" not in executor.stderr


def test_a_stale_state_halts_the_tree_and_a_fresh_one_resumes(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    write_tree(tmp_path / "tree.json", learned(where_x_is_small(GO, TURN)))
    parameters = {"tree_file": tmp_path / "tree.json", "enabled": True, "state_timeout": 0.2}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        robot = Robot(peer)
        commands = timed_commands(peer)
        robot.obeys("go")
        status(peer, "waiting for state", anew=True)
        silent = peer.reported[EXECUTION]
        assert report(peer)["condition"] == "waiting for state"
        resumed = time.time_ns()
        robot.obeys("go")
        # By now, all that was sent before is here.
        assert not [one for one in commands if silent < one.sent < resumed]


def test_no_command_follows_the_answer_to_a_disabling_call(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"enabled": True, "rate": 200.0}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        commands = timed_commands(peer)
        robot.obeys("go")
        call = peer.begin("/executor/enable", False)
        robot.until(call.done)
        answered = time.time_ns()
        first, second = report(peer, robot=robot), report(peer, robot=robot)
        assert first["condition"] == second["condition"] == "disabled"
        assert first["commands"] == second["commands"]
        enabled = time.time_ns()
        assert peer.call("/executor/enable", True).success
        robot.obeys("go")
        assert not [one for one in commands if answered < one.sent < enabled]


def test_a_tree_that_breaks_a_rule_is_refused_before_the_swap(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules:\n- never: turn\n  when: x < 0.3\n")
    parameters = {"enabled": True, "rules_file": str(rules)}
    with NodeProcess("executor_node", domain, tmp_path, parameters) as executor:
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.obeys("go")
        publish(peer, learned(where_x_is_small(TURN, GO)))
        robot.until(
            lambda: (
                (one := peer.diagnostics.get(EXECUTION)) and values_of(one)["refused trees"] == "1"
            ),
            "refusal",
        )
        executor.says("it breaks 'never turn when x < 0.3': where x = ")
        robot.obeys("go")
        assert {one.data for one in robot.commands} == {"go"}


def test_the_last_tick_is_explained(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}):
        answer = peer.call("/executor/explain")
        assert not answer.success
        assert answer.message == "there was no tick yet: waiting for a tree."
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.obeys("go")
        answer = peer.call("/executor/explain")
        assert answer.success
        assert answer.message.splitlines()[:2] == ["go", "  because x ≤ 0.5 (x = 0)"]


def test_rules_that_cannot_be_read_keep_the_executor_from_starting(
    domain: int, tmp_path: Path
) -> None:
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules:\n- never: turn\n  when: x <\n")
    with NodeProcess("executor_node", domain, tmp_path, {"rules_file": str(rules)}) as executor:
        executor.says("line 3, column 12: a feature or a number is expected, not the end")
        assert executor.process.wait(30) != 0


def test_a_refused_document_keeps_the_tree_running(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}) as executor:
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.obeys("go")
        wave = Action("wave", "arm")
        bad_name = learned(where_x_is_small(TURN, GO), topic="no topic")
        refused = [
            "{",
            "[]",
            dumps(learned(where_x_is_small(TURN, GO))).replace("0.5", "NaN"),
            dumps(learned(where_x_is_small(TURN, GO))).replace('"x"', '"z"', 1),
            dumps(learned(where_x_is_small(wave, GO))),
            dumps(bad_name),
        ]
        for count, document in enumerate(refused, 1):
            publish(peer, document)
            robot.until(
                lambda count=count: (
                    (one := peer.diagnostics.get(EXECUTION))
                    and values_of(one)["refused trees"] == str(count)
                ),
                f"refusal {count}",
            )
            robot.obeys("go")
        executor.says("a behavior tree was refused (the tree before it stays)")
        assert {one.data for one in robot.commands} == {"go"}
        publish(peer, learned(where_x_is_small(STOP, GO)))
        robot.obeys("stop")


def test_bad_state_messages_are_counted_and_let_the_state_go_stale(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}):
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.state = (float("nan"), 0.0)
        robot.obeys("go")  # The tree does not test the first value.
        for state, kind in (
            ((7.0, float("nan")), "value that is not finite"),
            ((7.0, float("-inf")), "value that is not finite"),
            ((7.0,), "unexpected length"),
        ):
            robot.state = state
            robot.until(
                lambda kind=kind: (
                    (one := peer.diagnostics.get(EXECUTION))
                    and values_of(one)["condition"] == "waiting for state"
                    and kind in values_of(one)
                ),
                kind,
            )
            robot.state = (7.0, 0.0)
            robot.obeys("go")


def test_commands_on_change_are_sent_once(domain: int, peer: Peer, tmp_path: Path) -> None:
    parameters = {
        "enabled": True,
        "publish": "on_change",
        "rate": 100.0,
        "state_timeout": AGES,
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.obeys("go")
        robot.state = (7.0, 1.0)
        robot.obeys("turn")
        robot.state = (7.0, 0.0)
        robot.obeys("go")
        assert [one.data for one in robot.commands] == ["go", "turn", "go"]


def test_an_action_runs_until_its_result_comes(domain: int, peer: Peer, tmp_path: Path) -> None:
    tree = Selector((Sequence((GO, TURN), memory=True), STOP))
    parameters = {
        "enabled": True,
        "publish": "on_change",
        "action_result_topic": "result",
        "rate": 100.0,
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        # The tree reads no state, so that its first command comes at once.
        robot = Robot(peer)
        snapshots = peer.listen(String, "/executor/snapshot")
        commands = robot.commands
        publish(peer, learned(tree))

        def sent(*labels: str) -> None:
            peer.wait_until(
                lambda: [one.data for one in commands] == list(labels), what=f"{labels}"
            )

        def running(*statuses: str) -> None:
            peer.wait_until(
                lambda: snapshots and json.loads(snapshots[-1].data)["nodes"] == list(statuses),
                what=f"{statuses}",
            )

        sent("go")
        running("RUNNING", "RUNNING", "RUNNING", "INVALID", "INVALID")
        peer.action("turn:success", topic="result")  # Not what is running.
        peer.action("perhaps", topic="result")
        status(peer, "running", unknown_action_result="1")
        assert [one.data for one in commands] == ["go"]
        peer.action("go:success", topic="result")
        sent("go", "turn")
        running("RUNNING", "RUNNING", "SUCCESS", "RUNNING", "INVALID")
        peer.action("failure", topic="result")
        sent("go", "turn", "stop")
        peer.action("success", topic="result")
        sent("go", "turn", "stop", "go")
        publish(peer, learned(where_x_is_small(TURN, STOP)))
        robot.obeys("turn")  # The running action was interrupted.


def test_a_swapped_tree_knows_what_was_done_before(domain: int, peer: Peer, tmp_path: Path) -> None:
    after_stop = Condition(Literal(LastActionIs("stop", ("turn",))))
    second = Selector((Sequence((after_stop, TURN)), where_x_is_small(GO, STOP)))
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}):
        publish(peer, learned(where_x_is_small(STOP, GO)))
        robot = Robot(peer)
        robot.obeys("stop")
        publish(peer, learned(second))
        robot.obeys("turn")
        assert "go" not in {one.data for one in robot.commands}


def test_a_tree_looks_back_at_ticks_since_it_was_last_halted_or_swapped(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    known_before = Condition(Literal(Threshold("x[t-1]", 1e6)))
    lagged = Feature("x[t-1]", topic="state", index=1, lag=1)
    lagging = replace(
        learned(Selector((GO, TURN))),
        features=(lagged,),
        tree=Selector((Sequence((known_before, GO)), TURN)),
    )
    parameters = {"enabled": True, "rate": 100.0, "use_sim_time": True, "state_timeout": 60.0}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, lagging)
        commands = timed_commands(peer)
        clock = SimulatedTime(peer, commands)
        clock.commanded()

        def looks_back_from_now_on() -> None:
            clock.feed()
            assert [clock.tick().label for _ in range(3)] == ["turn", "go", "go"]

        assert [one.label for one in commands] == ["turn", *["go"] * (len(commands) - 1)]
        assert peer.call("/executor/enable", False).success
        assert peer.call("/executor/enable", True).success
        looks_back_from_now_on()
        # No state for a while.
        clock.jump(100.0)
        assert clock.report()["condition"] == "waiting for state"
        looks_back_from_now_on()
        publish(peer, replace(lagging, actions=(*lagging.actions, STOP)))
        clock.until(lambda: values_of(peer.diagnostics[EXECUTION])["actions"] == "3")
        looks_back_from_now_on()


def test_snapshots_are_sent_when_something_changed(domain: int, peer: Peer, tmp_path: Path) -> None:
    parameters = {"enabled": True, "rate": 100.0, "state_timeout": AGES}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.obeys("go")
        snapshots = peer.listen(String, "/executor/snapshot")
        ticked = ["SUCCESS", "SUCCESS", "SUCCESS", "SUCCESS", "INVALID"]
        robot.until(lambda: snapshots and json.loads(snapshots[-1].data)["nodes"] == ticked)
        first = json.loads(snapshots[-1].data)
        assert first["commands"] == {"action": "go"}
        assert first["tip"]
        before = len(snapshots)
        report(peer, robot=robot)
        report(peer, robot=robot)
        assert len(snapshots) == before
        robot.state = (7.0, 1.0)
        robot.until(lambda: json.loads(snapshots[-1].data)["commands"]["action"] == "turn")


def test_a_tree_from_a_table_reads_the_state_topic_in_its_order(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    write_tree(tmp_path / "tree.json", learned(where_x_is_small(GO, TURN), topic=None))
    parameters = {"tree_file": tmp_path / "tree.json", "enabled": True, "state_topic": "sensors"}
    arguments = ["-r", "sensors:=/state", "-r", "__ns:=/robot", "-r", "command:=/command"]
    with NodeProcess("executor_node", domain, tmp_path, parameters, arguments):
        Robot(peer, "/robot/executor").obeys("go")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_quietly_while_it_commands(
    domain: int, peer: Peer, tmp_path: Path, number: signal.Signals
) -> None:
    with NodeProcess(
        "executor_node", domain, tmp_path, {"enabled": True, "rate": 1000.0}
    ) as executor:
        publish(peer, learned(where_x_is_small(GO, TURN)))
        Robot(peer).obeys("go")
        assert executor.stop(number) == 0
        assert "Traceback" not in executor.stderr


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"rate": 0.0}, "parameter 'rate' must be in [0.1, 1000], not 0.0."),
        ({"rate": 20}, "parameter 'rate' must be a number with a decimal point"),
        ({"publish": "never"}, "must be one of: every_tick, on_change, not 'never'."),
        ({"tree_file": "/absent.json"}, "/absent.json"),
    ],
)
def test_a_wrong_start_is_one_sentence_and_exit_code_1(
    domain: int, tmp_path: Path, parameters: dict[str, object], sentence: str
) -> None:
    with NodeProcess("executor_node", domain, tmp_path, parameters) as executor:
        assert executor.wait() == 1
        assert sentence in executor.stderr
        assert len(executor.stderr.splitlines()) == 1


def test_channels_are_commanded_side_by_side_each_on_a_topic_of_its_own(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    grasp, release = (Action(label, "/arm/action") for label in ("grasp", "release"))
    drive, wait = (Action(label, "base") for label in ("drive", "wait"))
    tree = Parallel((where_x_is_small(grasp, release), where_x_is_small(drive, wait)))
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}):
        robot = Robot(peer)
        publish(peer, learned(tree))
        arm = peer.listen(String, "command/arm/action")
        base = peer.listen(String, "command/base")
        robot.until(lambda: arm and base, "commands on both channels")
        assert (arm[-1].data, base[-1].data) == ("grasp", "drive")
        robot.state = (7.0, 1.0)
        robot.until(lambda: arm[-1].data == "release" and base[-1].data == "wait")
        # A tree of one channel takes over, on the one topic.
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot.obeys("turn")


def test_it_says_which_document_it_runs(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("executor_node", domain, tmp_path):
        for tree in (learned(Selector((GO,))), learned(Selector((TURN,)))):
            publish(peer, tree)
            status(peer, "disabled", document=fingerprint(dumps(tree)))


def test_a_tree_that_runs_and_comes_again_takes_the_place_of_one_that_waits(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path):
        running = learned(Selector((GO,)))
        publish(peer, running)
        status(peer, "disabled", nodes="2")
        publish(peer, learned(where_x_is_small(GO, TURN)))
        status(peer, "disabled", the_next_tree_waits_for="state")
        publish(peer, running)
        peer.wait_until(
            lambda: "the next tree waits for" not in values_of(peer.diagnostics[EXECUTION])
        )
        assert report(peer)["nodes"] == "2"
