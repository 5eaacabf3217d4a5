"""Which state the recorder gives to an action, whatever DDS delivers when; without DDS."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from ros_processes import own_domain, wait_until
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.ros.recorder.node import RecorderNode
from rebt_ros.storage.recording import read_recording

MS = 1_000_000
#: When everything begins, nanoseconds.
BEGIN = 1_700_000_000_000 * MS
#: Time between two states (ms).
PERIOD = 5


class Desk:
    """A recorder that does not spin, and is handed its messages."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self.node = RecorderNode()

    def state(self, number: int, late: int = 0) -> None:
        """The state of this number, which comes so many milliseconds after it was sent."""
        self.node._on_state("state", Float64MultiArray(data=[float(number)]), _info(number, late))

    def action(self, number: int, late: int = 0) -> None:
        """One that was sent just after the state of this number."""
        self.node._on_action("action", String(data=f"a{number}"), _info(number, late, 1))

    def rows(self) -> list[tuple[float, str]]:
        """State and action of what is recorded so far."""
        self.node._take_ready()
        found = []
        for path in sorted(self._directory.glob("demonstrations/*.rec")):
            shown = read_recording(path).demonstration
            found += [
                (float(state[0]), shown.actions[code])
                for state, code in zip(shown.states, shown.chosen, strict=True)
            ]
        return found

    def settle(self) -> None:
        """Until whatever does not wait for others has been taken."""
        end = time.monotonic_ns() + 2 * self.node._settings.reorder_window

        def over() -> bool:
            self.node._take_ready()
            return time.monotonic_ns() > end

        wait_until(over)


def _info(number: int, late: int, after: int = 0) -> dict[str, Any]:
    sent = BEGIN + (number * PERIOD + after) * MS
    return {"source_timestamp": sent, "received_timestamp": sent + late * MS}


@pytest.fixture
def desk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Desk]:
    parameters = {"demonstrations": f"'{tmp_path / 'demonstrations'}'"}
    parameters |= getattr(request, "param", {})
    arguments = [f"{name}:={value}" for name, value in parameters.items()]
    with own_domain() as domain:
        rclpy.init(
            args=["--ros-args", *(part for one in arguments for part in ("-p", one))],
            domain_id=domain,
        )
        try:
            desk = Desk(tmp_path)
            yield desk
            desk.node.destroy_node()
        finally:
            rclpy.try_shutdown()


def test_an_action_waits_for_the_states_before_it(desk: Desk) -> None:
    for number in range(5):
        desk.state(number)
    desk.action(6)
    desk.settle()
    assert desk.rows() == []
    desk.state(5, late=3000)
    desk.state(6, late=3000)
    desk.settle()
    assert desk.rows() == []
    desk.state(7, late=3000)
    assert wait_until(desk.rows) == [(6.0, "a6")]


def test_the_first_state_is_waited_for(desk: Desk) -> None:
    desk.action(3)
    desk.settle()
    for number in range(8):
        desk.state(number, late=3000)
    assert wait_until(desk.rows) == [(3.0, "a3")]
    assert desk.node._faults.counts == {}


def test_an_action_that_comes_late_has_the_state_of_its_sending(desk: Desk) -> None:
    for number in range(1000):
        desk.state(number)
    desk.settle()
    for number in (20, 300, 998):
        desk.action(number, late=4000)
    rows = wait_until(lambda: len(desk.rows()) == 3 and desk.rows())
    assert rows == [(20.0, "a20"), (300.0, "a300"), (998.0, "a998")]


@pytest.mark.parametrize("desk", [{"pair_by": "received"}, {"sample_rate": 100.0}], indirect=True)
def test_by_reception_a_late_action_has_the_state_of_its_arrival_and_is_told(desk: Desk) -> None:
    for number in range(500):
        desk.state(number)
    desk.action(20, late=2000)
    desk.settle()
    assert desk.node._faults.counts["late action"] == 1
    if desk.node._settings.sample_rate is None:
        assert desk.rows() == [(420.0, "a20")]


@pytest.mark.parametrize("desk", [{"state_wait": 0.2}], indirect=True)
def test_no_action_waits_for_longer_than_it_may(desk: Desk) -> None:
    desk.state(0)
    desk.action(1)
    assert wait_until(desk.rows) == [(0.0, "a1")]


def test_the_end_leaves_out_actions_whose_states_have_not_come(desk: Desk) -> None:
    for number in range(5):
        desk.state(number)
    desk.action(3)
    desk.action(4)
    desk.node.close()
    assert desk.rows() == [(3.0, "a3")]


@pytest.mark.parametrize("begin", ["start", "fail"])
def test_nothing_from_before_the_start_is_taken_for_a_state_of_later(
    desk: Desk, begin: str
) -> None:
    for number in range(5):
        desk.state(number)
    desk.settle()
    desk.node._session.stop(BEGIN)
    desk.settle()
    for number in range(5, 9):
        desk.state(number)
    desk.settle()
    getattr(desk.node._session, begin)(BEGIN)
    # Sent while nothing was recorded: it belongs to no demonstration.
    desk.action(4, late=20)
    desk.action(7, late=20)
    desk.settle()
    assert desk.rows() == []
