"""Programs beside the studio, and the studio itself, are killed and started again.

Who is killed says no goodbye: the middleware takes it to be there for some seconds more.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import pytest
import strategies as some
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.task import Future
from ros_processes import LATCHED, NodeProcess, Peer
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from studio_client import StudioClient, url_of
from test_studio import PORT

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.demonstration.schema import Feature
from rebt_ros.ros.studio import calls as studio_calls
from rebt_ros.ros.studio.calls import CallError, Calls, Newcomers

NODES: Final = {
    "recorder": {"sample_rate": 0.0},
    "learner": {},
    "executor": {"rate": 20.0, "enabled": False},
}
#: What each is asked for, and what it says to that.
ASKED: Final[dict[str, tuple[str, dict[str, Any], str]]] = {
    "recorder": ("record", {"on": True}, "recording"),
    "learner": ("rollback", {}, "there is no tree in "),
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
            answer = client.answer(number)
            if "ask again" in answer["message"]:
                # On a slow machine it starts too late.
                client.wait(lambda role=role: client.board["nodes"][role]["there"])
                answer = client.ask(verb, **arguments)
            assert said in answer["message"]
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


def test_what_an_executor_said_before_its_first_report_is_not_forgotten(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    reports = peer.node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    driving = peer.node.create_publisher(Bool, "executor/driving", LATCHED)
    report = DiagnosticArray(
        status=[DiagnosticStatus(hardware_id=f"/{role}") for role in ("learner", "executor")]
    )
    with (
        NodeProcess("studio", domain, tmp_path, PORT) as studio,
        StudioClient(url_of(studio)) as client,
    ):

        def are_there() -> bool:
            reports.publish(report)
            return all(client.board["nodes"][role]["there"] for role in ("learner", "executor"))

        def learner_is_gone() -> bool:
            driving.publish(Bool(data=True))
            return not client.board["nodes"]["learner"]["there"]

        client.wait(are_there)
        client.wait(learner_is_gone)
        # It reported when the learner did, and has said since that it drives.
        assert client.board["nodes"]["executor"]["there"]
        assert client.board["run"]["driving"] is True


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


class Mute:
    """A node and its client: the middleware says how many servers there are; one answers, say.

    Args:
        servers: How many there are at each look; then as many as at the last one.
        answers: Which of the requests is answered, counted from 1; 0: none.
    """

    srv_name = "learner/rollback"

    def __init__(self, servers: Sequence[int], answers: int) -> None:
        self.sent = 0
        self._servers = list(servers)
        self._answers = answers

    def create_client(self, *_: object) -> Mute:
        return self

    def count_services(self, _: str) -> int:
        return self._servers.pop(0) if len(self._servers) > 1 else self._servers[0]

    def wait_for_service(self, _: float) -> bool:
        return True

    def call_async(self, _: object) -> Future:
        self.sent += 1
        future = Future()
        if self.sent == self._answers:
            future.set_result(Trigger.Response(success=True, message="rolled back."))
        return future

    def remove_pending_request(self, _: Future) -> None:
        """Nothing is kept."""


@pytest.mark.parametrize(
    ("servers", "answers", "verb", "sent"),
    [
        pytest.param([1], 1, "trigger", 1, id="answered"),
        pytest.param([1, 2], 2, "trigger", 2, id="started again"),
        pytest.param([2, 1, 2], 2, "trigger", 2, id="one is forgotten, and another one starts"),
        pytest.param([1], 2, "trigger", 1, id="slow: what is not to be done twice is not"),
        pytest.param([2, 1], 2, "trigger", 1, id="one is forgotten"),
        pytest.param([1], 2, "switch", 2, id="a switch does no harm"),
    ],
)
def test_what_is_called_again(
    servers: Sequence[int], answers: int, verb: str, sent: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio_calls, "_LOOK", 0.001)
    node = Mute(servers, answers)
    calls = Calls(node)  # type: ignore[arg-type]
    calls.prepare(["switch"], ["trigger"])
    if sent < answers:
        with pytest.raises(CallError, match="did not answer"):
            calls.trigger("trigger", 0.02)
    elif verb == "switch":
        assert calls.switch("switch", True) == "rolled back."
    else:
        assert calls.trigger("trigger", 0.02) == "rolled back."
    assert node.sent == sent


def test_who_has_come_since_is_known_also_where_others_go_meanwhile() -> None:
    counts = iter((1, 1, 2, 2, 1, 2))
    newcomers = Newcomers(lambda: next(counts))
    newcomers.begin()
    assert [newcomers.have_come for _ in range(5)] == [False, True, False, False, True]
