"""Whether the times at which messages were sent can be compared."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

pytest.importorskip("rclpy")

from rebt_ros.ros.recorder import sending_time
from rebt_ros.ros.recorder.sending_time import PairBy, SendingTime

HERE, THERE = b"\x01\x0f\x78\xfd", b"\x01\x0f\x12\x34"


@dataclass
class Endpoint:
    endpoint_gid: list[int]
    node_name: str = "robot"
    node_namespace: str = "/"


def endpoint(host: bytes, name: str = "robot") -> Endpoint:
    return Endpoint([*host, *range(12)], name)


@dataclass
class Graph:
    """What a node sees of others."""

    publishers: dict[str, list[Endpoint]]
    subscriptions: list[Endpoint] = field(
        default_factory=lambda: [endpoint(HERE, "recorder"), endpoint(THERE, "display")]
    )

    def get_name(self) -> str:
        return "recorder"

    def get_namespace(self) -> str:
        return "/"

    def get_publishers_info_by_topic(self, topic: str) -> list[Endpoint]:
        return self.publishers.get(topic, [])

    def get_subscriptions_info_by_topic(self, topic: str) -> list[Endpoint]:
        return self.subscriptions


@pytest.fixture(autouse=True)
def _fast_dds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        sending_time, "get_rmw_implementation_identifier", lambda: "rmw_fastrtps_cpp"
    )


def looked(graph: Any, pair_by: PairBy = PairBy.AUTO) -> SendingTime:
    sending = SendingTime(graph, ["state", "action"], pair_by)
    sending.look()
    return sending


INFO = {"source_timestamp": 1_000, "received_timestamp": 5_000}


def test_publishers_of_this_machine_have_its_clock() -> None:
    sending = looked(Graph({"state": [endpoint(HERE)], "action": [endpoint(HERE)] * 2}))
    assert sending.comparable
    assert sending.of(INFO) == 1_000


@pytest.mark.parametrize(
    "graph",
    [
        Graph({"state": [endpoint(HERE)], "action": [endpoint(THERE)]}),
        Graph({"state": [endpoint(HERE), endpoint(THERE)]}),
        # Which of them is this one cannot be told.
        Graph(
            {"state": [endpoint(HERE)]}, [endpoint(HERE, "recorder"), endpoint(THERE, "recorder")]
        ),
    ],
)
def test_one_publisher_elsewhere_and_the_order_is_that_of_arrival(graph: Graph) -> None:
    assert looked(graph).of(INFO) is None
    assert looked(graph, PairBy.SENT).of(INFO) == 1_000


def test_it_changes_with_those_who_publish() -> None:
    graph = Graph({"state": [endpoint(HERE)]})
    sending = SendingTime(graph, ["state", "action"], PairBy.AUTO)  # type: ignore[arg-type]
    graph.publishers["action"] = [endpoint(THERE)]
    assert sending.look() == []
    assert not sending.comparable
    del graph.publishers["action"]
    assert sending.look() == ["action"]
    assert sending.comparable


def test_another_middleware_does_not_say_where_its_endpoints_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        sending_time, "get_rmw_implementation_identifier", lambda: "rmw_cyclonedds_cpp"
    )
    assert looked(Graph({"state": [endpoint(HERE)]})).of(INFO) is None


def test_what_came_before_it_was_sent_has_another_clock() -> None:
    sending = looked(Graph({}))
    early = {"source_timestamp": 10_000_000, "received_timestamp": 5_000_000}
    assert sending.of(early) is None
    assert looked(Graph({}), PairBy.SENT).of(early) == 10_000_000


def test_who_wants_the_order_of_arrival_gets_it() -> None:
    assert looked(Graph({"state": [endpoint(HERE)]}), PairBy.RECEIVED).of(INFO) is None
