"""The executor ticks on states that arrive, where that is asked for."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from executor_examples import READS_X, Robot, status
from ros_processes import NodeProcess, Peer

from rebt_ros.behavior_tree.document import dumps


def parameters(tmp_path: Path, **more: object) -> dict[str, object]:
    file = tmp_path / "tree.json"
    file.write_text(dumps(READS_X))
    return {"enabled": True, "tree_file": str(file), "tick_on": "state", **more}


def test_a_state_is_ticked_on_when_it_arrives(domain: int, peer: Peer, tmp_path: Path) -> None:
    period = 10.0
    given = parameters(tmp_path, rate=1 / period, state_timeout=30.0)
    with NodeProcess("executor_node", domain, tmp_path, given):
        robot = Robot(peer)
        robot.obeys("go")
        began = time.monotonic()
        for x, command in ((1.0, "turn"), (0.0, "go"), (1.0, "turn")):
            robot.state = (0.0, x)
            robot.obeys(command)
        # The timer alone would have needed a period for each.
        assert time.monotonic() - began < 2 * period


def test_the_timer_still_notices_that_no_state_arrives(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    given = parameters(tmp_path, rate=50.0, state_timeout=0.3, halt_action="stop")
    with NodeProcess("executor_node", domain, tmp_path, given):
        robot = Robot(peer)
        robot.obeys("go")
        status(peer, "waiting for state")
        peer.wait_until(lambda: robot.commands[-1].data == "stop")
