"""The studio beside real nodes: everything that its page asks for, without a browser."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from ros_processes import NodeProcess, Peer, own_domain
from std_msgs.msg import String
from std_srvs.srv import Trigger
from studio_client import StudioClient, url_of

from rebt_ros.ros.studio.calls import CallError, Calls
from rebt_ros.studio.access import COOKIE, HEADERS

PORT = {"port": 0}


@pytest.fixture
def studio(domain: int, tmp_path: Path) -> Iterator[NodeProcess]:
    with NodeProcess("studio", domain, tmp_path, PORT) as node:
        url_of(node)
        yield node
        assert node.stop() == 0


@pytest.fixture(scope="module")
def lonely(tmp_path_factory: pytest.TempPathFactory) -> Iterator[NodeProcess]:
    """A studio without a robot, for all tests that leave it as it is."""
    with own_domain() as domain:
        directory = tmp_path_factory.mktemp("lonely")
        with NodeProcess("studio", domain, directory, PORT) as node:
            url_of(node)
            yield node


def asked(
    node: NodeProcess, path: str = "/", method: str = "GET", **headers: str
) -> http.client.HTTPResponse:
    """The answer to a request with headers of its own."""
    port = urlsplit(url_of(node)).port
    connection = http.client.HTTPConnection("localhost", port, timeout=30)
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    for name, value in {"Host": f"localhost:{port}", **headers}.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    response = connection.getresponse()
    response.text = response.read().decode()  # type: ignore[attr-defined]
    return response


def test_what_is_not_from_a_page_of_the_studio_is_refused(lonely: NodeProcess) -> None:
    port = urlsplit(url_of(lonely)).port
    token = asked(lonely).getheader("Set-Cookie", "").split(";")[0]
    assert token.startswith(f"{COOKIE}=")
    own = {"Cookie": token}
    assert asked(lonely, "/plotly.js", **own).status == 200
    websocket = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }
    here = f"http://localhost:{port}"
    assert asked(lonely, "/live", **own, **websocket, Origin=here).status == 101
    for why, path, headers in (
        ("a foreign host", "/", {"Host": f"evil.example:{port}"}),
        ("another port", "/", {"Host": "localhost:1"}),
        ("no port", "/", {"Host": "localhost"}),
        ("a host that looks alike", "/", {"Host": f"localhost.evil.example:{port}"}),
        ("somebody in front", "/", {"Host": f"me@localhost:{port}"}),
        ("a foreign origin", "/", {"Origin": "http://evil.example"}),
        ("an origin that hides", "/", {"Origin": "null"}),
        ("another scheme", "/", {"Origin": f"https://localhost:{port}"}),
        ("another name of this machine", "/", {"Origin": f"http://127.0.0.1:{port}"}),
        ("no token", "/plotly.js", {}),
        ("a wrong token", "/plotly.js", {"Cookie": f"{COOKIE}=AAAA"}),
        ("a WebSocket of a foreign page", "/live", {**own, **websocket, "Origin": "http://a.b"}),
        ("a WebSocket of no page", "/live", {**own, **websocket}),
        ("a WebSocket without a token", "/live", {**websocket, "Origin": here}),
        ("a wrong token in the URL", "/?token=AAAA", {}),
    ):
        assert asked(lonely, path, **headers).status == 403, why


@pytest.mark.parametrize(
    "path",
    [
        "/../setup.py",
        "/page/../../__init__.py",
        "/page/%2e%2e/%2e%2e/__init__.py",
        "/..%2f..%2fetc%2fpasswd",
        "//etc/passwd",
        "/page/",
        "/page/index.html%00.js",
        "/learned/tree.json",
    ],
)
def test_no_file_but_those_of_the_page_is_served(lonely: NodeProcess, path: str) -> None:
    cookie = asked(lonely).getheader("Set-Cookie", "").split(";")[0]
    assert asked(lonely, path, Cookie=cookie).status in {400, 404}


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"])
def test_nothing_but_get_is_understood(lonely: NodeProcess, method: str) -> None:
    assert asked(lonely, method=method).status == 405


def test_every_answer_tells_the_browser_to_trust_nobody_else(lonely: NodeProcess) -> None:
    cookie = asked(lonely).getheader("Set-Cookie", "")
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    answers = (asked(lonely), asked(lonely, "/nothing"), asked(lonely, "/", Origin="http://a.b"))
    for answer in answers:
        assert {name: answer.getheader(name) for name in HEADERS} == dict(HEADERS)


def test_from_elsewhere_the_url_with_its_token_is_needed(domain: int, tmp_path: Path) -> None:
    with NodeProcess("studio", domain, tmp_path, PORT | {"host": "0.0.0.0"}) as studio:
        url = urlsplit(url_of(studio))
        assert url.query.startswith("token=")
        assert asked(studio).status == 403
        assert asked(studio, Host=f"evil.example:{url.port}").status == 403
        answer = asked(studio, f"/?{url.query}")
        assert (answer.status, answer.getheader("Location")) == (303, "/")
        cookie = answer.getheader("Set-Cookie", "").split(";")[0]
        assert asked(studio, Cookie=cookie).status == 200


def test_a_port_that_is_taken_is_a_sentence(
    lonely: NodeProcess, domain: int, tmp_path: Path
) -> None:
    port = urlsplit(url_of(lonely)).port
    with NodeProcess("studio", domain, tmp_path, {"port": port}) as other:
        assert other.wait() == 1
        assert f"cannot listen on port {port}" in other.stderr
        assert "Traceback" not in other.stderr


@pytest.mark.parametrize(
    "message",
    [
        None,
        [],
        {},
        {"do": 3},
        {"do": "nothing", "id": 1},
        {"do": "level", "id": 1},
        {"do": "level", "number": "1", "id": 1},
        {"do": "level", "number": 1.5, "id": 1},
        {"do": "level", "number": 1e999, "id": 1},
        {"do": "threshold", "path": "0.0", "value": True, "id": 1},
        {"do": "remove", "path": "0.x", "id": 1},
        {"do": "act", "label": "\x1b[31m", "id": 1},
        {"do": "delete", "name": "../../learned/tree", "id": 1},
        {"do": "restore", "version": "../tree", "id": 1},
        {"do": "explain", "t": 0, "id": 1},
        {"do": "learn", "id": {"a": [1]}},
    ],
)
def test_requests_that_make_no_sense_are_answered_in_a_sentence(
    lonely: NodeProcess, message: object
) -> None:
    with StudioClient(url_of(lonely)) as client:
        client.send(message)
        number = message.get("id") if isinstance(message, dict) else None
        answer = client.answer(number if isinstance(number, int) else None)
        assert not answer["ok"]
        assert "mistake in rebt_ros" not in answer["message"]
        assert answer["message"].endswith((".", "page."))
        assert client.ask("nothing")["message"].startswith("there is no verb 'nothing'")


@contextmanager
def robot_nodes(domain: int, directory: Path) -> Iterator[dict[str, NodeProcess]]:
    parameters = {
        "recorder": {"sample_rate": 0.0},
        "learner": {},
        "executor": {"rate": 20.0, "state_timeout": 60.0, "enabled": False},
    }
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(NodeProcess(name, domain, directory, values))
            for name, values in parameters.items()
        }


def show(peer: Peer, client: StudioClient, offset: float) -> None:
    """A demonstration: back below a half, else go, and stop beyond two thirds."""
    for step in range(20):
        x = (step + offset) / 20
        peer.state(x, 1.0 - x, labels=["x", "y"])
        peer.action("back" if x < 0.5 else "go" if x < 0.75 else "stop")
    peer.deliver()
    client.does("new_demonstration")


def test_a_person_teaches_learns_edits_publishes_and_the_robot_does_it(
    studio: NodeProcess, domain: int, peer: Peer, tmp_path: Path
) -> None:
    with robot_nodes(domain, tmp_path), StudioClient(url_of(studio)) as client:
        everybody = ("recorder", "learner", "executor")
        client.wait(lambda: all(client.board["nodes"][role]["there"] for role in everybody))
        peer.connect(String, "action")
        peer.state(0.0, 1.0, labels=["x", "y"])
        client.does("record", on=True)
        for number in range(3):
            show(peer, client, number / 4)

        def rows() -> list[int]:
            return [view["rows"] for view in client.board["demonstrations"].values()]

        client.wait(lambda: rows() == [20, 20, 20])
        shown = list(client.board["demonstrations"].values())
        assert shown[0]["actions"] == {"back": 10, "go": 5, "stop": 5}
        assert [band[2] for band in shown[0]["bands"]] == ["back", "go", "stop"]
        assert set(client.board["actions"]) >= {"back", "go", "stop"}

        answer = client.does("learn")
        assert "60 rows" in answer["message"]
        client.wait(lambda: client.board["tree"] and client.board["draft"])
        client.wait(lambda: client.board["draft"]["published"])
        view = client.board["draft"]["view"]
        assert view["nodes"] == client.board["tree"]["view"]["nodes"]
        assert client.board["learning"]["recalls"].keys() == {"back", "go", "stop"}

        # Another threshold: from now on it goes from 0.3.
        path = next(
            node["path"]
            for node in view["nodes"]
            if node.get("feature") in {"x", "y"} and 0.4 < (node["at_most"] or 0) < 0.6
        )
        feature = next(node["feature"] for node in view["nodes"] if node["path"] == path)
        client.does("threshold", path=path, value=0.3 if feature == "x" else 0.7)
        client.wait(lambda: client.board["draft"].get("undo"))
        changed = client.board["draft"]["changed"]
        assert 0 < changed["rows"] < changed["of"] == 60
        assert sum(changed["demonstrations"].values()) == changed["rows"]
        assert not client.board["draft"]["published"]
        assert any(words.startswith("new:") for words in client.board["draft"]["words"])
        client.does("undo")
        client.wait(lambda: client.board["draft"]["published"])
        client.does("redo")
        before = client.board["tree"]["document"]
        answer = client.does("publish", note="earlier")
        client.wait(lambda: client.board["tree"]["document"] != before)
        client.wait(lambda: client.board["draft"]["published"])
        client.wait(
            lambda: (
                [
                    version["what"]
                    for version in client.board["versions"].values()
                    if version["current"]
                ]
                == ["earlier"]
            )
        )

        # The executor has it, and does it.
        commands = peer.listen(String, "command")
        peer.state(0.4, 0.6, labels=["x", "y"])
        client.does("enable", on=True)
        peer.wait_until(lambda: commands and commands[-1].data == "go")
        client.wait(lambda: client.board["run"].get("commands") == {"action": "go"})
        run = client.board["run"]
        assert run["document"] == client.board["tree"]["document"]
        assert len(run["statuses"]) == len(client.board["tree"]["view"]["nodes"])
        client.wait(lambda: client.board["values"] == {"x": 0.4, "y": 0.6})
        told = client.does("explain")["data"]
        assert told["lines"][0] == "go"
        assert told["statuses"] == run["statuses"]
        acting = told["acting"]
        nodes = client.board["tree"]["view"]["nodes"]
        assert [node["label"] for node in nodes if node["path"] == acting] == ["go"]
        client.wait(
            lambda: any(
                event["kind"] == "command" and event["text"] == "go"
                for event in client.board["timeline"].values()
            )
        )

        # A person takes over with a button of the page.
        client.does("act", label="stop")
        client.wait(lambda: client.board["run"].get("driving") is False)
        events = client.board["timeline"].values()
        assert any(event["kind"] == "person" and event["text"] == "stop" for event in events)

        # The strip must not show that the person is at it until the tree drives.
        for _ in range(3):
            client.does("act", label="stop")
        client.wait(
            lambda: any(
                event["kind"] == "person" and event["text"] == "nothing"
                for event in client.board["timeline"].values()
            )
        )

        # What was published before can be restored.
        first = min(client.board["versions"])
        client.does("restore", version=first)
        client.wait(lambda: client.board["tree"]["document"] == before)


def test_a_call_is_given_up_once_the_node_that_lost_it_rests(peer: Peer) -> None:
    # It is never spun, so that it never answers.
    peer.node.create_service(Trigger, "learner/relearn", lambda _, response: response)
    calls = Calls(peer.node)
    calls.prepare([], ["learner/relearn"])
    works = iter((True, True, False))
    with pytest.raises(CallError, match="learner/relearn did not answer"):
        calls.trigger("learner/relearn", patience=0.01, works=lambda: next(works))
    assert next(works, None) is None


def test_it_ends_in_order_while_a_service_keeps_it_waiting(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    # It is never spun, so that it never answers.
    peer.node.create_service(Trigger, "learner/relearn", lambda _, response: response)
    with NodeProcess("studio", domain, tmp_path, PORT) as studio:
        with StudioClient(url_of(studio)) as client:
            client.begin("learn")
            client.does("ping")
        assert studio.stop() == 0
        assert "Traceback" not in studio.stderr


def test_two_browsers_see_the_same(
    studio: NodeProcess, domain: int, peer: Peer, tmp_path: Path
) -> None:
    with StudioClient(url_of(studio)) as one, StudioClient(url_of(studio)) as other:
        with NodeProcess("recorder", domain, tmp_path) as recorder:
            for client in (one, other):
                client.wait(lambda client=client: client.board["nodes"]["recorder"]["there"])
            peer.connect(String, "action")
            peer.state(0.0)
            peer.action("go")
            one.does("record", on=True)
            assert "A new demonstration has begun" in one.does("new_demonstration")["message"]
            recorder.stop()
        for client in (one, other):
            client.wait(lambda client=client: not client.board["nodes"]["recorder"]["there"])
        one.wait(lambda: one.board["demonstrations"])
        other.wait(lambda: other.board["demonstrations"] == one.board["demonstrations"])
        assert json.dumps(one.board["names"]) == json.dumps(other.board["names"])
