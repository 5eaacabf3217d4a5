"""The last ten minutes."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.studio.timeline import REACH, EventKind, Moment, Timeline


def moment(time: float, command: str = "go") -> Moment:
    return Moment(time, "document", ("SUCCESS",), {"x": time}, {"action": command})


@given(st.lists(st.floats(0, 3000), min_size=1).map(sorted), st.floats(0, 3000))
def test_the_moment_at_a_time_is_the_last_one_up_to_it(times: list[float], asked: float) -> None:
    timeline = Timeline()
    for time in times:
        timeline.note(moment(time))
    kept = [time for time in times if time >= times[-1] - REACH]
    before = [time for time in kept if time <= asked]
    found = timeline.at(asked)
    assert (found.time if found else None) == (before[-1] if before else None)


def test_events_that_are_too_old_go() -> None:
    timeline = Timeline()
    first = timeline.event(0.0, EventKind.COMMAND, "go", "action")
    assert first == {"1": {"t": 0.0, "kind": "command", "text": "go", "channel": "action"}}
    assert timeline.event(REACH, EventKind.PERSON, "stop").keys() == {"2"}
    later = timeline.event(REACH + 1.0, EventKind.PERSON, "go")
    assert (later["1"], later.keys()) == (None, {"3", "1"})


def test_what_was_done_before_a_time_is_told_once_for_each_change() -> None:
    timeline = Timeline()
    for time, command in enumerate(["go", "go", "turn", "go"]):
        timeline.note(moment(float(time), command))
    assert timeline.done_before(3.5, "action") == ["go", "turn", "go"]
    assert timeline.done_before(2.0, "action") == ["go"]
    assert timeline.done_before(9.0, "arm") == []
