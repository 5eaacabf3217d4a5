"""Which states may still be under way."""

from __future__ import annotations

from rebt_ros.live.arrival import LAST
from rebt_ros.live.state_streams import StateStreams

SECOND = 1_000_000_000
PATIENCE = 10 * SECOND


def stream(streams: StateStreams, topic: str, seconds: float, hertz: int = 100) -> int:
    """States at a steady rate that come as they are sent; returns when the last one was sent."""
    last = round(seconds * hertz)
    for number in range(last + 1):
        sent = number * SECOND // hertz
        streams.take(topic, sent, sent)
    return last * SECOND // hertz


def test_of_a_stream_all_has_come_that_was_sent_before_the_last_state() -> None:
    streams = StateStreams(["state"], PATIENCE)
    last = stream(streams, "state", 2.0)
    assert streams.complete(last) == last
    assert streams.complete(last + PATIENCE) == last
    assert streams.complete(last + PATIENCE + 1) == LAST


def test_the_slowest_stream_counts() -> None:
    streams = StateStreams(["pose", "power"], PATIENCE)
    pose, power = stream(streams, "pose", 2.0), stream(streams, "power", 1.8, 5)
    assert power < pose
    assert streams.complete(pose) == power


def test_states_that_come_now_and_then_are_not_waited_for() -> None:
    streams = StateStreams(["state"], PATIENCE)
    for number in range(20):
        streams.take("state", number * SECOND, number * SECOND)
        if number >= 2:
            assert streams.complete(number * SECOND) == LAST


def test_one_pause_does_not_end_a_stream() -> None:
    streams = StateStreams(["state"], PATIENCE)
    last = stream(streams, "state", 2.0)
    streams.take("state", last + 3 * SECOND, last + 3 * SECOND)
    assert streams.complete(last + 4 * SECOND) == last + 3 * SECOND


def test_nothing_is_under_way_from_a_publisher_that_is_gone() -> None:
    streams = StateStreams(["state"], PATIENCE)
    last = stream(streams, "state", 2.0)
    streams.end("state")
    assert streams.complete(last) == LAST
    streams.take("state", last + 1, last + 1)
    assert streams.complete(last + 1) == last + 1


def test_the_first_state_of_every_topic_is_waited_for() -> None:
    streams = StateStreams(["pose", "power"], PATIENCE)
    streams.take("pose", 5, 6)
    assert streams.complete(PATIENCE * 2) == -1
    streams.take("power", 4, PATIENCE)
    assert streams.complete(PATIENCE) == 4


def test_a_clock_that_was_set_back_counts_from_then_on() -> None:
    streams = StateStreams(["state"], PATIENCE)
    last = stream(streams, "state", 5.0)
    streams.take("state", SECOND, last + 1)
    assert streams.complete(last + 1) == SECOND
