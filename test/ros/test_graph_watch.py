"""What is found in the graph, and when it is logged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ros_processes import wait_until
from std_msgs.msg import String

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
