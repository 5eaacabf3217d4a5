"""Programs beside the studio, and the studio itself, are killed and started again.

Who is killed says no goodbye: the middleware takes it to be there for some seconds more.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import strategies as some
from ros_processes import LATCHED, NodeProcess, Peer
from std_msgs.msg import String
from studio_client import StudioClient, url_of
from test_studio import PORT

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.demonstration.schema import Feature
from rebt_ros.ros.studio.calls import Newcomers

NODES: Final = {
    "recorder": {"sample_rate": 0.0},
    "learner": {},
    "executor": {"rate": 20.0, "enabled": False},
}
#: What each is asked for, and what it says to that.
ASKED: Final[dict[str, tuple[str, dict[str, Any], str]]] = {
    "recorder": ("record", {"on": True}, "recording"),
    "learner": ("rollback", {}, "there is no tree before this one"),
    "executor": ("enable", {"on": True}, "enabled"),
}

_GO: Final = Action("go", "action")
_TREE: Final = LearnedTree((Feature("x"),), (_GO,), _GO, some.PROVENANCE)


def killed(node: NodeProcess) -> None:
    """Kills a node."""
    node.process.send_signal(signal.SIGKILL)
    node.wait()


def test_the_studio_knows_who_was_killed_and_asks_who_was_started_again(
    domain: int, tmp_path: Path
) -> None:
    with ExitStack() as stack:

        def start(name: str, parameters: dict[str, Any]) -> NodeProcess:
            return stack.enter_context(NodeProcess(name, domain, tmp_path, parameters))

        nodes = {role: start(role, parameters) for role, parameters in NODES.items()}
        client = stack.enter_context(StudioClient(url_of(start("studio", PORT))))

        def everybody(*, there: bool) -> Callable[[], bool]:
            return lambda: all(client.board["nodes"][role]["there"] is there for role in NODES)

        client.wait(everybody(there=True))
        for role, (verb, arguments, said) in ASKED.items():
            killed(nodes[role])
            # Nobody gets this: the one who was killed cannot, and the other is not there yet.
            number = client.begin(verb, **arguments)
            nodes[role] = start(role, NODES[role])
            assert said in client.answer(number)["message"]
        client.wait(everybody(there=True))
        client.wait(lambda: "driving" in client.board["run"])
        for node in nodes.values():
            killed(node)
        client.wait(everybody(there=False))
        for role in NODES:
            assert f"no {role} is running: start it" in client.board["nodes"][role]["message"]
        client.wait(lambda: client.board["run"] == {})
        client.wait(
            lambda: any(
                event["text"] == "the tree rests: the executor has ended"
                for event in client.board["timeline"].values()
            )
        )


def test_a_studio_that_was_killed_knows_everything_again(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    trees = peer.node.create_publisher(String, "behavior_tree", LATCHED)
    trees.publish(String(data=dumps(_TREE)))

    def shown(client: StudioClient) -> dict[str, Any]:
        client.wait(lambda: client.board["tree"] and client.board["nodes"]["recorder"]["there"])
        client.wait(lambda: client.board["actions"])
        return {name: client.board[name] for name in ("tree", "names", "actions", "demonstrations")}

    with (
        NodeProcess("recorder", domain, tmp_path, NODES["recorder"]),
        NodeProcess("studio", domain, tmp_path, PORT) as studio,
    ):
        with StudioClient(url_of(studio)) as client:
            client.does("rename", name="go", shown="forward")
            client.wait(lambda: client.board["names"])
            before = shown(client)
            killed(studio)
        again = {"port": urlsplit(url_of(studio)).port}
        with (
            NodeProcess("studio", domain, tmp_path, again) as studio,
            StudioClient(url_of(studio)) as client,
        ):
            assert shown(client) == before
            assert "recording" in client.does("record", on=True)["message"]


def test_who_has_come_since_is_known_also_where_others_go_meanwhile() -> None:
    counts = iter((1, 1, 2, 2, 1, 2))
    newcomers = Newcomers(lambda: next(counts))
    newcomers.begin()
    assert [newcomers.have_come for _ in range(2)] == [False, True]
    newcomers.begin()
    assert [newcomers.have_come for _ in range(2)] == [False, True]
