"""Groot2's monitor: what is answered, to btview, which is not ours, and to noise."""

from __future__ import annotations

import math
import socket
import struct
from collections.abc import Iterator

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.errors import OptionError
from rebt_ros.export.watched import WatchedTree, watched
from rebt_ros.live.groot2_protocol import Groot2Answers
from rebt_ros.live.groot2_server import Groot2Server
from rebt_ros.logic.conditions import IsTrue, Literal, Threshold

TREE = watched(some.learned(nodes.Selector((some.action("go"), some.action("turn")))))
OTHER = watched(some.learned(some.action("go")))
#: The first action fails and the second one runs.
OUTCOMES = {0: "RUNNING", 1: "FAILURE", 2: "RUNNING"}


def _request(kind: str, number: int = 7) -> bytes:
    return struct.pack("<BBI", 2, ord(kind), number)


def _answers(tree: WatchedTree | None = TREE) -> Groot2Answers:
    answers = Groot2Answers()
    answers.show(tree)
    return answers


def test_statuses_are_three_bytes_for_each_node() -> None:
    answers = _answers()
    assert answers.answer([_request("S")])[1] == b"\1\0\0\2\0\0\3\0\0"
    answers.tick(OUTCOMES, (1.0,))
    header, statuses = answers.answer([_request("S")])
    assert header[:6] == _request("S")
    assert statuses == b"\1\0\1\2\0\3\3\0\1"
    answers.rest()
    # What was halted is idle, and says what it was before.
    assert answers.answer([_request("S")])[1] == b"\1\0\x0b\2\0\x0d\3\0\x0b"


def test_the_blackboard_has_the_features_that_are_tested() -> None:
    msgpack = pytest.importorskip("msgpack")
    conditions = map(Literal, (Threshold("battery", 0.5), IsTrue("docked")))
    answers = _answers(watched(some.learned(some.when(*conditions, then=some.action("go")))))

    def board(names: bytes) -> object:
        return msgpack.unpackb(answers.answer([_request("B"), names])[1])

    assert board(b"LearnedTree") == {"LearnedTree": {"battery": None, "docked": None}}
    answers.tick({}, (math.nan, 0.25, math.nan, 2.0))
    assert board(b"another;LearnedTree") == {"LearnedTree": {"battery": 0.25, "docked": None}}
    assert board(b"another") == board(b"") == {}


def test_a_swapped_tree_has_another_uuid_and_is_idle() -> None:
    answers = _answers()
    answers.tick(OUTCOMES, ())
    first, xml = answers.answer([_request("T")])
    assert xml.decode() == TREE.xml
    answers.show(OTHER)
    second, xml = answers.answer([_request("T")])
    assert xml.decode() == OTHER.xml
    assert len(first) == len(second) == 22
    assert first[6:] != second[6:]
    assert answers.answer([_request("S")])[1] == b"\1\0\0"


def test_what_a_watcher_records_is_what_changed_meanwhile() -> None:
    answers = _answers()
    answers.tick(OUTCOMES, ())
    began = answers.answer([_request("r"), b"start"])[1]
    assert int(began) > 10**15
    answers.tick(OUTCOMES, ())
    answers.tick({0: "SUCCESS", 1: "SUCCESS"}, ())
    answers.rest()
    answers.answer([_request("r"), b"stop"])
    answers.tick(OUTCOMES, ())
    recorded = answers.answer([_request("t")])[1]
    changes = [recorded[at + 6 : at + 9] for at in range(0, len(recorded), 9)]
    assert changes == [b"\1\0\2", b"\2\0\2", b"\3\0\0", b"\1\0\0", b"\2\0\0"]
    assert answers.answer([_request("t")])[1] == b""


def test_a_record_of_one_tree_is_not_told_of_another() -> None:
    answers = _answers()
    answers.answer([_request("r"), b"start"])
    answers.tick(OUTCOMES, ())
    answers.show(OTHER)
    answers.tick({0: "RUNNING"}, ())
    assert answers.answer([_request("t")])[1] == b""


def test_what_is_recorded_is_bounded() -> None:
    answers = _answers()
    answers.answer([_request("r"), b"start"])
    for number in range(3000):
        answers.tick({0: "SUCCESS"} if number % 2 else {0: "FAILURE"}, ())
    assert len(answers.answer([_request("t")])[1]) == 9 * 1000


@pytest.mark.parametrize(
    "frames",
    [
        [],
        [b""],
        [b"hello"],
        [_request("S") + b"!"],
        [_request("S"), b"", b""],
        [_request("?")],
        [_request("I"), b"{}"],
        [_request("U"), b"{}"],
        [_request("B")],
        [_request("r")],
        [_request("r"), b"now"],
    ],
)
def test_a_bad_request_is_answered_with_an_error_and_counted(frames: list[bytes]) -> None:
    answers = _answers()
    error, sentence = answers.answer(frames)
    assert (error, answers.bad_requests) == (b"error", 1)
    assert sentence.decode().isprintable()


def test_before_there_is_a_tree_that_is_said() -> None:
    for answers in (Groot2Answers(), _answers(None)):
        answers.tick(OUTCOMES, ())
        answers.rest()
        assert b"no tree" in answers.answer([_request("T")])[1]


@given(st.lists(st.one_of(st.binary(max_size=8), st.sampled_from("TSBDAXrtIRU").map(_request))))
def test_any_frames_are_answered_in_two_frames_at_most(frames: list[bytes]) -> None:
    answers = _answers()
    answers.tick(OUTCOMES, (1.0, math.nan, math.inf))
    answer = answers.answer(frames)
    assert 1 <= len(answer) <= 2
    # The version is ours, whatever that of the request is.
    assert answer[0] == b"error" or answer[0][1:6] == frames[0][1:]


@pytest.fixture
def server() -> Iterator[Groot2Server]:
    pytest.importorskip("zmq")
    made = Groot2Server(0)
    yield made
    made.close()


def test_btview_sees_the_statuses_and_follows_a_swap(server: Groot2Server) -> None:
    client = pytest.importorskip("btview.client").Groot2Client(port=server.port, timeout_ms=20_000)
    server.answers.show(TREE)
    server.answers.tick(OUTCOMES, (0.25,))
    seen = client.fetch_tree()
    first = client.tree_uuid
    assert [(one.uid, one.name) for one in seen.walk()] == [(1, "Selector"), (2, "go"), (3, "turn")]
    statuses = {uid: one.status.name for uid, one in client.poll().statuses.items()}
    assert statuses == {1: "RUNNING", 2: "FAILURE", 3: "RUNNING"}
    server.answers.rest()
    assert {one.status.name for one in client.poll().statuses.values()} == {"IDLE"}
    server.answers.show(OTHER)
    assert [one.name for one in client.fetch_tree().walk()] == ["go"]
    assert client.tree_uuid != first
    client.close()


def test_noise_on_the_port_keeps_nobody_else_from_being_answered(server: Groot2Server) -> None:
    zmq = pytest.importorskip("zmq")
    client = pytest.importorskip("btview.client").Groot2Client(port=server.port, timeout_ms=20_000)
    server.answers.show(TREE)
    with zmq.Context() as context, context.socket(zmq.REQ) as asking:
        asking.linger = 0
        asking.rcvtimeo = 20_000
        asking.connect(f"tcp://127.0.0.1:{server.port}")
        for frames in ([b""], [b"\0" * 60_000], [_request("S")] * 5):
            asking.send_multipart(frames)
            assert asking.recv_multipart()[0] == b"error"
        # Too large to be read; who sent it is cut off.
        asking.send(b"\0" * 100_000)
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as plain:
        plain.sendall(b"GET / HTTP/1.1\r\n\r\n")
    assert len(client.poll().statuses) == 3
    assert server.answers.bad_requests == 3
    client.close()


def test_a_port_that_is_taken_is_named(server: Groot2Server) -> None:
    with pytest.raises(OptionError, match=f"'groot2_port' is {server.port}, where nobody"):
        Groot2Server(server.port)


def test_nobody_from_another_machine_is_answered(server: Groot2Server) -> None:
    # Any address of 127.0.0.0/8 but the one is as far away as another machine.
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", server.port), timeout=20)
