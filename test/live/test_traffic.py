"""What a recorder hears of its topics."""

from __future__ import annotations

from rebt_ros.live.traffic import Traffic


def test_rates_are_those_since_the_last_report() -> None:
    traffic = Traffic(["/a", "/b"], ["/a", "/b", "/go"], now=10.0)
    for moment in (10.5, 11.0, 11.5):
        traffic.state("/a", moment)
    assert traffic.rates(12.0) == {"/a": 1.5, "/b": 0.0}
    assert traffic.rates(12.0) == {"/a": None, "/b": None}
    assert traffic.rates(13.0) == {"/a": 0.0, "/b": 0.0}


def test_a_topic_is_silent_until_it_carries_state_and_two_seconds_after() -> None:
    # A steady clock may begin at 0.
    traffic = Traffic(["/a", "/b"], ["/a", "/b"], now=0.0)
    assert traffic.silent(0.5) == ["/a", "/b"]
    traffic.state("/a", 0.5)
    assert traffic.silent(2.5) == ["/b"]
    assert traffic.silent(2.75) == ["/a", "/b"]
    assert traffic.heard("/a")
    assert not traffic.heard("/b")


def test_messages_are_counted_and_those_that_are_lost_too() -> None:
    traffic = Traffic(["/a"], ["/a", "/go"], now=0.0)
    traffic.newly_lost(lambda topic: 1)
    for topic, number in (("/a", 1), ("/a", 4), ("/go", 1), ("/go", 2)):
        traffic.message(topic, number)
    assert traffic.newly_lost(lambda topic: 1) == {"/a": 2, "/go": 0}
    assert traffic.newly_lost(lambda topic: 1) == {"/a": 0, "/go": 0}
    assert (traffic.messages, traffic.lost) == (4, 2)
