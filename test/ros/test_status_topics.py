"""What the executor publishes for those who watch topics; Nav2's messages are played by others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

import strategies as some

from rebt_ros.behavior_tree import nodes
from rebt_ros.errors import MessagePathError
from rebt_ros.export.watched import watched
from rebt_ros.ros.executor import status_topics
from rebt_ros.ros.executor.status_topics import LogTypes, StatusTopics

TREE = watched(some.learned(nodes.Selector((some.action("go"), some.action("turn")))))
OTHER = watched(some.learned(some.action("go")))
#: The first action fails and the second one runs.
OUTCOMES = {0: "RUNNING", 1: "FAILURE", 2: "RUNNING"}
#: The fields of Nav2's messages, from Humble to Kilted.
LOG = {"timestamp", "event_log"}
CHANGE = {"timestamp", "node_name", "uid", "previous_status", "current_status"}


class _Publisher:
    def __init__(self, topic: str) -> None:
        self.topic_name = topic.replace("~", "/executor")
        self.sent: list[Any] = []
        self.listeners = 1

    def publish(self, message: Any) -> None:
        self.sent.append(message)

    def get_subscription_count(self) -> int:
        return self.listeners


class _Node:
    """Of a node, what is needed here."""

    def __init__(self) -> None:
        self.publishers: dict[str, _Publisher] = {}
        self.warned: list[str] = []

    def create_publisher(
        self, _: type[Any], topic: str, __: Any, *, event_callbacks: Any
    ) -> _Publisher:
        self.publishers[topic] = _Publisher(topic)
        return self.publishers[topic]

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warned.append)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: 7))


def _message(fields: set[str]) -> Any:
    def made(**values: Any) -> SimpleNamespace:
        assert values.keys() == fields
        return SimpleNamespace(**values)

    return made


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> _Node:
    monkeypatch.setattr(
        status_topics, "log_types", lambda: LogTypes(_message(LOG), _message(CHANGE))
    )
    return _Node()


def _sent(node: _Node) -> list[list[tuple[str, int, str, str]]]:
    return [
        [(one.node_name, one.uid, one.previous_status, one.current_status) for one in log.event_log]
        for log in node.publishers["~/behavior_tree_log"].sent
    ]


def test_the_first_message_has_all_nodes_and_then_what_changes(node: _Node) -> None:
    topics = StatusTopics(node)  # type: ignore[arg-type]
    topics.show(TREE)
    assert [one.data for one in node.publishers["~/tree_xml"].sent] == [TREE.xml]
    root, go, turn = (one.name for one in TREE.nodes)
    topics.tick(OUTCOMES)
    topics.tick(OUTCOMES)
    topics.tick(OUTCOMES | {2: "SUCCESS"})
    topics.tick({})
    assert _sent(node) == [
        [
            (root, 1, "IDLE", "RUNNING"),
            (go, 2, "IDLE", "FAILURE"),
            (turn, 3, "IDLE", "RUNNING"),
        ],
        [(turn, 3, "RUNNING", "SUCCESS")],
        [
            (root, 1, "RUNNING", "IDLE"),
            (go, 2, "FAILURE", "IDLE"),
            (turn, 3, "SUCCESS", "IDLE"),
        ],
    ]
    log = node.publishers["~/behavior_tree_log"].sent[0]
    assert (log.timestamp, log.event_log[0].timestamp) == (7, 7)


def test_who_comes_later_hears_the_status_of_every_node(node: _Node) -> None:
    topics = StatusTopics(node)  # type: ignore[arg-type]
    log = node.publishers["~/behavior_tree_log"]
    log.listeners = 0
    topics.show(TREE)
    topics.tick(OUTCOMES)
    assert log.sent == []
    for listeners in (1, 1, 2):
        log.listeners = listeners
        topics.tick(OUTCOMES)
    assert [len(changes) for changes in _sent(node)] == [3, 3]


def test_after_a_swap_no_status_of_the_tree_before_is_left(node: _Node) -> None:
    topics = StatusTopics(node)  # type: ignore[arg-type]
    topics.show(OTHER)
    topics.tick({0: "SUCCESS"})
    topics.show(TREE)
    topics.tick({0: "RUNNING", 1: "RUNNING"})
    topics.show(None)
    topics.tick({0: "SUCCESS"})
    assert [[change[3] for change in changes] for changes in _sent(node)] == [
        ["SUCCESS"],
        ["RUNNING", "RUNNING", "IDLE"],
    ]
    # No XML is left of a tree that does not run.
    assert [one.data for one in node.publishers["~/tree_xml"].sent] == [OTHER.xml, TREE.xml, ""]


def test_without_nav2_msgs_the_tree_is_published_and_a_note_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing() -> LogTypes:
        raise MessagePathError("nav2_msgs is not installed.")

    monkeypatch.setattr(status_topics, "log_types", missing)
    node = _Node()
    topics = StatusTopics(node)  # type: ignore[arg-type]
    topics.show(TREE)
    topics.tick(OUTCOMES)
    assert node.publishers.keys() == {"~/tree_xml"}
    assert node.warned == [
        "the XML of trees is on /executor/tree_xml, and no topic has the statuses of their nodes: "
        "nav2_msgs is not installed."
    ]
    assert topics.where == "none: install nav2_msgs"


def test_the_fields_are_those_of_the_installed_messages() -> None:
    nav2_msgs = pytest.importorskip("nav2_msgs.msg", reason="needs nav2_msgs")
    assert nav2_msgs.BehaviorTreeLog.get_fields_and_field_types().keys() == LOG
    assert nav2_msgs.BehaviorTreeStatusChange.get_fields_and_field_types().keys() == CHANGE
