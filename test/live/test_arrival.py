"""Messages in the order in which they were received, whatever the order of their callbacks."""

from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.live.arrival import ArrivalOrder


def test_a_burst_comes_out_in_the_order_of_its_stamps() -> None:
    order = ArrivalOrder[str](window=50)
    for stamp, item in ((1, "s0"), (4, "action"), (2, "s1"), (3, "s2")):
        order.push(stamp, item, now=100)
    assert order.ready(now=149) == []
    assert order.ready(now=150) == ["s0", "s1", "s2", "action"]
    assert len(order) == 0


def test_equal_stamps_keep_the_order_in_which_they_came() -> None:
    order = ArrivalOrder[str](window=0)
    for item in "abc":
        order.push(7, item, now=0)
    assert order.ready(now=0) == ["a", "b", "c"]


def test_an_item_takes_along_what_was_received_before_it() -> None:
    order = ArrivalOrder[str](window=50)
    order.push(10, "later", now=0)
    order.push(5, "earlier", now=40)
    order.push(20, "last", now=40)
    assert order.ready(now=50) == ["earlier", "later"]
    assert order.flush() == ["last"]
    assert order.flush() == []


def test_what_waits_holds_up_what_follows_it_until_all_before_it_has_come() -> None:
    order = ArrivalOrder[str](window=5, patience=100)
    order.push(20, "action", now=0, waits=True)
    order.push(30, "service", now=0)
    assert order.ready(now=50, complete=10) == []
    assert order.held == 1
    order.push(15, "late state", now=51)
    assert order.ready(now=56, complete=15) == ["late state"]
    assert order.ready(now=57, complete=20) == ["action", "service"]
    assert order.held == 0


def test_nothing_is_held_up_for_longer_than_the_patience() -> None:
    order = ArrivalOrder[str](window=5, patience=100)
    order.push(20, "action", now=0, waits=True)
    assert order.ready(now=99, complete=10) == []
    assert order.ready(now=100, complete=10) == ["action"]


def test_the_end_leaves_what_still_needs_others() -> None:
    order = ArrivalOrder[str](window=5, patience=100)
    order.push(10, "state", now=0)
    order.push(20, "action", now=0, waits=True)
    order.push(30, "action", now=0, waits=True)
    assert order.flush(complete=20) == ["state", "action"]
    assert order.held == 1


def test_stamps_that_begin_anew_wait_for_their_window_again() -> None:
    order = ArrivalOrder[str](window=5)
    order.push(1000, "before", now=0)
    assert order.ready(now=5) == ["before"]
    order.push(7, "set back", now=6)
    assert order.ready(now=10) == []
    assert order.ready(now=11) == ["set back"]


@given(st.lists(st.tuples(st.integers(0, 20), st.integers(0, 5))), st.integers(0, 10))
def test_nothing_is_lost_and_nothing_waits_longer_than_the_window(
    pushes: list[tuple[int, int]], window: int
) -> None:
    order = ArrivalOrder[int](window)
    now, waiting = 0, {}
    for number, (stamp, pause) in enumerate(pushes):
        now += pause
        order.push(stamp, number, now)
        waiting[number] = now
        for taken in order.ready(now):
            del waiting[taken]
        assert all(now - pushed < window for pushed in waiting.values())
    assert sorted(order.flush()) == sorted(waiting)
