"""What the executor promises under load, faults and a person's hand, over real DDS.

Each test fails when the protection that it names is taken away.
"""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from executor_examples import (
    EXECUTION,
    GO,
    READS_X,
    STOP,
    TURN,
    Robot,
    Sent,
    SimulatedTime,
    large,
    learned,
    publish,
    report,
    shown,
    status,
    timed_commands,
    where_x_is_small,
)
from ros_processes import AGES, LATCHED, NodeProcess, Peer, values_of
from std_msgs.msg import Bool, Float64MultiArray

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.nodes import Condition, Selector, Sequence
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import LastActionIs, Literal


def _labels(commands: list[Any]) -> list[str]:
    return [one.label if hasattr(one, "label") else one.data for one in commands]


# --- halting ----------------------------------------------------------------------------------


def test_the_halt_action_is_sent_once_whenever_the_tree_is_halted(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"rate": 100.0, "state_timeout": 0.3, "halt_action": "halt"}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, READS_X)
        robot = Robot(peer)
        # Nothing to halt, as nothing was commanded.
        assert peer.call("/executor/enable", True).success
        assert peer.call("/executor/enable", False).success
        assert peer.call("/executor/enable", True).success
        robot.obeys("go")
        # The state goes stale; perhaps more often than it is left to, as this process may stall.
        peer.wait_until(lambda: robot.commands[-1].data == "halt")
        status(peer, "waiting for state")
        robot.obeys("go")
        assert peer.call("/executor/enable", False).success
        status(peer, "disabled")
        peer.wait_until(lambda: robot.commands[-1].data == "halt")
        assert report(peer)["condition"] == "disabled"
        phases = [label for label, _ in groupby(_labels(robot.commands))]
        halts = _labels(robot.commands).count("halt")
        assert halts == phases.count("halt") >= 2
        assert phases == ["go", "halt"] * halts


# --- disabling --------------------------------------------------------------------------------


def _note_answers(peer: Peer, answers: list[Sent]) -> None:
    """Notes when the answer of each service that the peer calls was sent and received."""
    executor: Any = peer._executor

    def take(client: Any) -> Any:
        with client.handle:
            header, response = client.handle.take_response(client.srv_type.Response)

        async def finish() -> None:
            if header is not None:
                answers.append(Sent("answer", header.source_timestamp, header.received_timestamp))
                client.get_pending_request(header.request_id.sequence_number).set_result(response)

        return finish

    executor._take_client = take


def test_no_command_is_received_after_the_answer_to_a_disabling_call_under_load(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True, "rate": 1000.0}):
        publish(peer, READS_X)
        robot = Robot(peer)
        commands = timed_commands(peer)
        answers: list[Sent] = []
        _note_answers(peer, answers)
        for _ in range(10):
            seen = len(commands)
            robot.until(lambda seen=seen: len(commands) > seen + 20)
            call = peer.begin("/executor/enable", False)
            robot.until(call.done)
            answer = answers[-1]
            # Enough for a tick that should not have come, and what was under way is here as well.
            end = time.monotonic() + 0.02
            robot.until(lambda end=end: time.monotonic() > end)
            assert not [one for one in commands if one.sent > answer.sent or one.follows(answer)]
            assert peer.call("/executor/enable", True).success


# --- swapping ---------------------------------------------------------------------------------


def test_swapping_under_load_neither_misses_nor_doubles_a_command(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"enabled": True, "rate": 100.0, "use_sim_time": True}
    trees = [dumps(large(200, action)) for action in (GO, TURN)]
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, trees[1])
        commands = timed_commands(peer)
        clock = SimulatedTime(peer, commands)
        clock.commanded()
        swaps = steps = 0
        first = len(commands)
        while swaps < 40:
            if commands[-1].label == (GO, TURN)[swaps % 2 - 1].label:
                publish(peer, trees[swaps % 2])
                swaps += 1
            clock.tick()
            steps += 1
        said = clock.report()
        assert said["ticks"] == said["commands"] == str(len(commands))
        assert len(commands) == first + steps


def test_swapping_large_trees_leaves_no_gap_beyond_a_tick(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    """Reading and building such a tree takes several ticks on any machine.

    Were it to keep the executor from ticking, the gap would be as long as the swap.
    """
    period = 0.02
    documents = [dumps(large(2000, action)) for action in (GO, TURN)]
    parameters = {"enabled": True, "rate": 1 / period, "state_timeout": AGES}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, documents[0])
        robot = Robot(peer)
        commands = timed_commands(peer)

        def swapped(document: str, label: str) -> tuple[float, float]:
            """The longest time between two commands, and that from document to command."""
            first, began = len(commands), time.time_ns()
            publish(peer, document)
            robot.until(lambda: commands[-1].label == label)
            sent = [one.sent for one in commands[first:]]
            gap = max((b - a for a, b in pairwise(sent)), default=sent[-1] - began)
            return gap / 1e9, (sent[-1] - began) / 1e9

        robot.until(lambda: commands, "a command")
        # A busy machine may well delay a tick, but not in each of several attempts.
        attempts: list[tuple[float, float]] = []
        while not any(gap < max(2 * period, swap / 2) for gap, swap in attempts):
            assert len(attempts) < 40, attempts
            document, action = ((documents[1], TURN), (documents[0], GO))[len(attempts) % 2]
            attempts.append(swapped(document, action.label))


def test_a_swap_to_the_same_command_does_not_send_it_again_where_changes_are_sent(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {
        "enabled": True,
        "rate": 100.0,
        "publish": "on_change",
        "state_timeout": AGES,
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, READS_X)
        robot = Robot(peer)
        robot.obeys("go")
        for size in (50, 60, 70):
            tree = large(size, GO)
            publish(peer, tree)
            status(peer, "running", robot=robot, nodes=str(nodes.size(tree.tree)))
        publish(peer, learned(where_x_is_small(TURN, GO)))
        robot.obeys("turn")
        assert _labels(robot.commands) == ["go", "turn"]


def test_a_tree_whose_topic_has_too_few_values_is_refused_and_the_old_one_goes_on(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    def reading(topic: str, index: int) -> str:
        tree = where_x_is_small(STOP, TURN)
        features = (Feature("x", topic=topic, index=index),)
        return dumps(replace(learned(tree), features=features))

    with NodeProcess("executor_node", domain, tmp_path, {"enabled": True}) as executor:
        publish(peer, READS_X)
        robot = Robot(peer)
        robot.obeys("go")
        publish(peer, reading("state", 5))
        status(peer, "running", robot=robot, refused_trees="1")
        executor.says("state topic 'state' sends 2 values where the tree reads 6")
        robot.obeys("go")
        # Of a topic that is new nothing is known before it sends.
        publish(peer, reading("other", 2))
        robot.until(
            lambda: (
                (one := peer.diagnostics.get(EXECUTION))
                and values_of(one).get("the next tree waits for") == "other"
            )
        )
        robot.obeys("go")

        other = peer.connect(Float64MultiArray, "other")

        def refused() -> Any:
            other.publish(Float64MultiArray(data=[0.0]))
            one = peer.diagnostics[EXECUTION]
            return values_of(one)["refused trees"] == "2"

        robot.until(refused)
        said = peer.diagnostics[EXECUTION].message
        assert "state topic 'other' sends 1 values where the tree reads 3" in said
        robot.obeys("go")
        assert set(_labels(robot.commands)) == {"go"}
        publish(peer, reading("other", 2))

        def fits() -> bool:
            other.publish(Float64MultiArray(data=[0.0, 0.0, 0.0]))
            return robot.commands[-1].data == "stop"

        peer.wait_until(fits)


# --- a person takes over ----------------------------------------------------------------------


def test_a_person_pauses_the_tree_which_knows_afterwards_what_was_done(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    after_wave = Condition(Literal(LastActionIs("wave", ("go",))))
    wave = replace(GO, label="wave")
    tree = learned(
        Selector((Sequence((after_wave, GO)), where_x_is_small(TURN, GO))), "state", wave
    )
    parameters = {
        "enabled": True,
        "rate": 100.0,
        "use_sim_time": True,
        "takeover_timeout": 0.3,
        "state_timeout": AGES,
        "halt_action": "halt",
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, tree)
        commands = timed_commands(peer)
        driving = peer.listen(Bool, "/executor/driving", LATCHED)
        clock = SimulatedTime(peer, commands)
        clock.commanded()
        assert clock.tick().label == "turn"
        clock.until(lambda: driving and driving[-1].data, "the word that it drives")
        told, ticked = len(driving), len(commands)
        # A second message makes the pause longer.
        for _ in range(2):
            peer.action("wave")
            peer.deliver()
            clock.until(lambda: [one.data for one in driving[told:]] == [False], "a pause")
            clock.report()
            clock.go_on(20)
            said = clock.report()
            assert (said["condition"], said["commands"]) == ("paused", str(ticked))

        def resumed() -> bool:
            clock.go_on(1)
            return len(commands) > ticked

        peer.wait_until(resumed, what="the end of the pause")
        assert commands[ticked].label == "go"
        # The person's hand is not halted.
        assert "halt" not in _labels(commands)
        clock.until(lambda: [one.data for one in driving[told:]] == [False, True], "the end")
        status(peer, "running", takeovers="1")


def test_nobody_takes_over_where_that_is_turned_off_or_the_commands_are_remapped_there(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"enabled": True, "rate": 100.0, "takeover_topics": ["hand"]}
    arguments = ["-r", "command:=hand"]
    with NodeProcess("executor_node", domain, tmp_path, parameters, arguments):
        publish(peer, READS_X)
        robot = Robot(peer, topic="hand")
        robot.until(lambda: len(robot.commands) > 50, "commands that are no takeover")
        assert report(peer, robot=robot)["takeovers"] == "0"


def test_a_robot_that_a_person_leaves_where_the_tree_cannot_drive_is_halted(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {
        "enabled": True,
        "rate": 100.0,
        "takeover_timeout": 0.2,
        "state_timeout": 0.5,
        "halt_action": "halt",
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, READS_X)
        robot = Robot(peer)
        robot.obeys("go")
        peer.wait_until(lambda: robot.commands[-1].data == "halt")
        # The tree rests; a person moves the robot and goes away.
        assert report(peer)["condition"] == "waiting for state"
        rested = len(robot.commands)
        peer.action("wave")
        peer.wait_until(lambda: len(robot.commands) > rested)
        assert report(peer)["condition"] == "waiting for state"
        assert _labels(robot.commands[rested:]) == ["halt"]


# --- the clock --------------------------------------------------------------------------------


def test_the_clock_may_jump_either_way(domain: int, peer: Peer, tmp_path: Path) -> None:
    parameters = {
        "enabled": True,
        "rate": 100.0,
        "use_sim_time": True,
        "state_timeout": 0.5,
        "halt_action": "halt",
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, READS_X)
        commands = timed_commands(peer)
        status(peer, "waiting for /clock")
        clock = SimulatedTime(peer, commands)
        clock.commanded()
        running = len(commands)

        # Forwards: what is known of the state is old, and hours of ticks do not come at once.
        clock.jump(3600)
        clock.wait(lambda: _labels(commands)[-1] == "halt", "the halt action")
        for _ in range(20):
            clock.step()
        assert clock.report()["condition"] == "waiting for state"
        assert _labels(commands)[running:] == ["halt"]

        def ticks_with_state() -> None:
            before = len(commands)
            clock.feed()
            for _ in range(10):
                clock.tick()
            assert _labels(commands)[before:] == ["go"] * 10

        ticks_with_state()

        # Backwards, and on past the moments at which states came before.
        then, came = clock.now, len(commands)
        clock.jump(-0.2)
        clock.wait(lambda: _labels(commands)[-1] == "halt", "the halt action")
        while clock.now < then + 10**8:
            clock.step()
        assert clock.report()["condition"] == "waiting for state"
        assert _labels(commands)[came:] == ["halt"]
        ticks_with_state()


# --- outside of what was shown ----------------------------------------------------------------

FAMILIAR = shown(READS_X, ((7.0, 7.0), (0.0, 0.5)), ((7.0, 7.0), (0.6, 1.0)))


@pytest.mark.parametrize(
    ("state", "why"),
    [
        ((7.0, 3.0), "x is 3, 2 above the 0.6 to 1 that was shown in such a state"),
        # The tree does not test it, because it was always the same.
        ((5.0, 0.0), "y is 5, 2 below the 7 to 7 that was shown in such a state"),
    ],
)
def test_the_robot_is_held_outside_of_what_was_shown_until_a_person_takes_over(
    domain: int, peer: Peer, tmp_path: Path, state: tuple[float, float], why: str
) -> None:
    parameters = {
        "enabled": True,
        "rate": 100.0,
        "novelty": "hold",
        "halt_action": "halt",
        "takeover_timeout": 0.2,
        "state_timeout": AGES,
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, FAMILIAR)
        robot = Robot(peer)
        robot.obeys("go")
        robot.state = state
        robot.obeys("halt")
        held = len(robot.commands)
        said = status(peer, "held until a person takes over", robot=robot, novelty=why)
        assert why in said.message
        assert int.from_bytes(said.level, "big") == 1
        # Also where the state is a known one again.
        robot.state = (7.0, 0.0)
        report(peer, robot=robot)
        said = report(peer, robot=robot)
        assert said["condition"] == "held until a person takes over"
        assert said["states outside what was shown"] == "1"
        assert len(robot.commands) == held
        peer.action("wave")
        robot.obeys("go")


def test_a_state_outside_of_what_was_shown_is_counted_and_reported_while_the_tree_goes_on(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    parameters = {"enabled": True, "rate": 50.0, "state_timeout": AGES}
    with NodeProcess("executor_node", domain, tmp_path, parameters):
        publish(peer, FAMILIAR)
        robot = Robot(peer)
        robot.obeys("go")
        robot.state = (7.0, 3.0)
        robot.obeys("turn")

        def reported() -> Any:
            one = peer.diagnostics.get(EXECUTION)
            novelty = values_of(one).get("novelty", "") if one else ""
            return one if novelty.startswith("x is 3, 2 above") else None

        said = robot.until(reported)
        assert int(values_of(said)["states outside what was shown"]) > 0
        assert values_of(said)["condition"] == "running"
        assert int.from_bytes(said.level, "big") == 1
        assert "the state is outside what was shown: x is 3" in said.message
