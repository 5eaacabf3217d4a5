"""Programs that watch the executor: Groot2's monitor, as btview asks for it, logs, and topics."""

from __future__ import annotations

import random
import socket
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from executor_examples import GO, STOP, TURN, Robot, learned, publish, status, where_x_is_small
from ros_processes import LATCHED, NodeProcess, Peer, values_of
from std_msgs.msg import String

from rebt_ros.storage.btlog import read_btlog


def _free_port() -> int:
    """A TCP port that nobody listens on, and that no outgoing connection is given."""
    while True:
        port = random.SystemRandom().randrange(20_000, 30_000)
        with socket.socket() as one:
            try:
                one.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port


def _by_name(client: Any) -> dict[str, str]:
    """The status of each node that btview sees; the last one of a name counts."""
    names = {node.uid: node.name for node in client.fetch_tree().walk()}
    return {names[uid]: one.status.name for uid, one in client.poll().statuses.items()}


def test_btview_sees_what_the_executor_does_follows_a_swap_and_each_tree_has_a_log(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    btview = pytest.importorskip("btview.client")
    port = _free_port()
    parameters = {
        "enabled": True,
        "groot2_port": port,
        "btlog_directory": str(tmp_path / "logs"),
        "status_topics": True,
    }
    with NodeProcess("executor_node", domain, tmp_path, parameters) as executor:
        client = btview.Groot2Client(port=port, timeout_ms=20_000)
        trees = peer.listen(String, "/executor/tree_xml", LATCHED)
        publish(peer, learned(where_x_is_small(GO, TURN)))
        robot = Robot(peer)
        robot.obeys("go")
        robot.until(lambda: _by_name(client).get("go") == "SUCCESS", "the status of go")
        assert _by_name(client)["turn"] == "IDLE"
        board = client.fetch_blackboard(["LearnedTree"])["LearnedTree"]
        assert board == {"x": 0.0}
        robot.state = (7.0, 1.0)
        robot.until(lambda: _by_name(client).get("turn") == "SUCCESS", "the status of turn")
        robot.until(lambda: trees, "the XML of the first tree")
        first = client.tree_uuid
        publish(peer, learned(where_x_is_small(STOP, GO)))
        robot.until(lambda: _by_name(client).get("go") == "SUCCESS", "the new tree")
        assert client.tree_uuid != first
        assert peer.call("/executor/enable", False).success
        assert set(_by_name(client).values()) == {"IDLE"}
        said = values_of(status(peer, "disabled", groot2=f"127.0.0.1:{port}"))
        assert said["bad groot2 requests"] == "0"
        client.close()
        peer.wait_until(lambda: len(trees) == 2, what="the XML of both trees")
        assert ['name="turn"' in one.data for one in trees] == [True, False]
        assert said["statuses on"] in ("none: install nav2_msgs", "/executor/behavior_tree_log")
        assert executor.stop() == 0
        assert "Traceback" not in executor.stderr
    logs = sorted(map(read_btlog, (tmp_path / "logs").iterdir()), key=lambda log: log.began)
    assert [("stop" in log.xml) for log in logs] == [False, True]
    # Of the first tree all was idle in the end, and of both, the condition was tested.
    for log in logs:
        last = {one.uid: one.status for one in log.transitions}
        assert set(last.values()) == {0}
        assert set(last) >= {1, 2, 3, 5}
