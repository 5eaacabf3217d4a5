"""What is found in the graph, and when it is logged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_processes import wait_until
from std_msgs.msg import Int32, String

from rebt_ros.ros import graph_watch
from rebt_ros.ros.graph_watch import Finding, GraphWatch
from rebt_ros.ros.robots.demonstrator import Patience


@contextmanager
def _node(name: str, domain: int) -> Iterator[Node]:
    """A node like one in a process of its own."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node(name, context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def _conflicts(watch: GraphWatch) -> list[str]:
    return [one.sentence for one in watch.several("topic", "trees", "stop all but one")]


def test_nodes_are_counted_not_publishers(domain: int) -> None:
    with _node("watcher", domain) as watcher, _node("same", domain) as one:
        watch = GraphWatch(watcher)
        for _ in range(2):
            one.create_publisher(String, "topic", 1)
        wait_until(lambda: watcher.count_publishers("topic") == 2)
        assert _conflicts(watch) == []
        with _node("same", domain) as other:
            other.create_publisher(String, "topic", 1)
            wait_until(lambda: watcher.count_publishers("topic") == 3)
            wait_until(lambda: "unknown" not in "".join(_conflicts(watch)))
            assert _conflicts(watch) == [
                "2 nodes publish trees on topic (/same, /same): stop all but one"
            ]


def test_states_of_two_nodes_are_told_from_those_of_one(domain: int) -> None:
    with _node("watcher", domain) as watcher, _node("first", domain) as one:
        watch = GraphWatch(watcher)
        states = watcher.create_subscription(String, "topic", lambda _: None, 1)
        one.create_publisher(String, "topic", 1)
        wait_until(lambda: watcher.count_publishers("topic") == 1)
        assert list(watch.mixed([states])) == []
        with _node("second", domain) as other:
            other.create_publisher(String, "topic", 1)
            wait_until(lambda: watcher.count_publishers("topic") == 2)
            wait_until(lambda: "unknown" not in "".join(f.sentence for f in watch.mixed([states])))
            [finding] = watch.mixed([states])
            assert "2 nodes publish states on /topic (/first, /second)" in finding.sentence


@pytest.mark.parametrize(
    ("kind", "qos", "said"),
    [
        (String, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL), "QoS"),
        (String, QoSProfile(depth=1, deadline=Duration(seconds=1)), "QoS"),
        (Int32, QoSProfile(depth=1), "for std_msgs/msg/Int32, not std_msgs/msg/String"),
        (String, QoSProfile(depth=1), ""),
        (String, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT), ""),
    ],
)
def test_who_listens_and_hears_nothing_is_named(
    kind: type, qos: QoSProfile, said: str, domain: int
) -> None:
    with _node("watcher", domain) as watcher, _node("robot", domain) as robot:
        watch = GraphWatch(watcher)
        commands = watcher.create_publisher(String, "topic", 1)
        assert [one.sentence for one in watch.unread([commands])] == ["nobody listens to /topic"]
        robot.create_subscription(kind, "topic", lambda _: None, qos)
        wait_until(lambda: watcher.count_subscribers("topic") == 1)
        wait_until(lambda: "unknown" not in "".join(f.sentence for f in watch.unread([commands])))
        sentences = [one.sentence for one in watch.unread([commands])]
        assert len(sentences) == bool(said)
        assert all(one.startswith("/robot ") and said in one for one in sentences)


class _Logged(list[str]):
    """A node that has nothing but a log."""

    def get_logger(self) -> Any:
        return self

    def warning(self, sentence: str) -> None:
        self.append(sentence)


def test_a_finding_is_logged_once_until_it_comes_back() -> None:
    log = _Logged()
    watch = GraphWatch(log)  # type: ignore[arg-type]
    wrong, other = Finding("it is wrong", waits=False), Finding("other", waits=False)
    for findings in ([wrong], [wrong, other], [wrong]):
        assert watch.say(findings) == [one.sentence for one in findings]
    assert log == ["it is wrong.", "other."]
    assert watch.say([]) == []
    watch.say([wrong])
    assert log == ["it is wrong.", "other.", "it is wrong."]


def test_what_may_pass_is_logged_once_it_has_lasted(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(graph_watch.time, "monotonic", lambda: now[0])
    log = _Logged()
    watch = GraphWatch(log)  # type: ignore[arg-type]
    late = Finding("nobody is there", waits=True)
    for moment, logged in ((0.0, 0), (4.9, 0), (5.0, 1), (9.0, 1)):
        now[0] = moment
        assert watch.say([late]) == ["nobody is there"]
        assert len(log) == logged
    watch.say([])
    for moment, logged in ((10.0, 1), (14.9, 1), (15.0, 2)):
        now[0] = moment
        watch.say([late])
        assert len(log) == logged


def test_patience_begins_anew_for_who_comes_later() -> None:
    now = [0.0]
    patience = Patience(5.0, lambda: now[0])
    said = []
    for moment, missing in ((0, True), (5, True), (6, True), (7, False), (8, True), (13, True)):
        now[0] = float(moment)
        said.append(patience.lasts(missing))
    assert said == [True, True, False, False, True, True]
