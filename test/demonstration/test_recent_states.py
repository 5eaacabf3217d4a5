"""The states of the last while: an action finds the one that held when it was sent."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration import recent_states
from rebt_ros.demonstration.recent_states import RecentStates

#: One minute and a bit, nanoseconds.
LONG = 61_000_000_000


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 9)), max_size=40), st.integers(0, 50))
def test_it_is_the_last_state_that_was_sent_before_whatever_the_order(
    added: list[tuple[int, int]], when: int
) -> None:
    states = RecentStates()
    known: dict[int, float] = {}
    for sent, value in added:
        states.add(sent, [float(value)])
        known[sent] = float(value)
    sent = max((one for one in known if one <= when), default=None)
    assert states.at(when) == (None if sent is None else (known[sent],))


def test_only_the_newest_are_kept_and_fewer_of_wide_ones(monkeypatch) -> None:
    monkeypatch.setattr(recent_states, "_STATES", 100)
    monkeypatch.setattr(recent_states, "_VALUES", 400)
    for width, most in ((1, 100), (20, 20), (1000, 1)):
        states = RecentStates()
        for sent in range(1000):
            states.add(sent, [float(sent)] * width)
        kept = [sent for sent in range(1000) if states.at(sent) is not None]
        assert kept[-1] == 999
        assert most <= len(kept) <= most + most // 4
        assert states.at(999) == (999.0,) * width


def test_a_clock_that_was_set_back_and_another_length_begin_anew() -> None:
    states = RecentStates()
    states.add(10 * LONG, [1.0])
    states.add(5, [2.0])
    assert states.at(20 * LONG) == (2.0,)
    states.add(6, [3.0, 4.0])
    assert states.at(5) is None
    assert states.at(6) == (3.0, 4.0)
