"""Gaps in the numbers of messages are losses, but only of a topic with one publisher."""

from rebt_ros.live.losses import Losses


def heard(*numbers: int | None, publishers: int = 1, before: int = 1) -> int:
    losses = Losses(["state"])
    losses.settle(lambda _: before)
    for number in numbers:
        losses.take("state", number)
    return losses.settle(lambda _: publishers)["state"]


def test_gaps_are_losses() -> None:
    assert heard(1, 2, 3) == 0
    assert heard(1, 3, 7) == 4


def test_messages_before_the_first_one_are_not_missed() -> None:
    assert heard(100, 101) == 0


def test_a_publisher_that_begins_anew_is_no_loss() -> None:
    assert heard(8, 9, 1, 2) == 0


def test_the_numbers_of_two_publishers_say_nothing() -> None:
    assert heard(1, 50, 2, 51, publishers=2) == 0
    assert heard(1, 50, 2, 51, before=2) == 0


def test_a_middleware_without_numbers_says_nothing() -> None:
    assert heard(None, None) == 0


def test_a_loss_is_told_once() -> None:
    losses = Losses(["state"])
    losses.settle(lambda _: 1)
    losses.take("state", 1)
    losses.take("state", 3)
    assert losses.settle(lambda _: 1) == {"state": 1}
    assert losses.settle(lambda _: 1) == {"state": 0}
    losses.take("state", 6)
    assert losses.settle(lambda _: 1) == {"state": 2}
