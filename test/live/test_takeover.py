"""Who drives, as the executor and the recorder see it, without ROS."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest
import strategies as some

from rebt_ros.behavior_tree.novelty import Departure, NoveltyDetector
from rebt_ros.behavior_tree.shown import ShownChannel, ShownLeaf, Span
from rebt_ros.demonstration.schema import Feature
from rebt_ros.live.background import Background
from rebt_ros.live.novelty_guard import Novelty, NoveltyGuard
from rebt_ros.live.takeover import Takeover, channel_of
from rebt_ros.live.takeover_watch import TakeoverWatch

SECOND = 10**9


def test_a_takeover_lasts_until_some_time_after_the_last_message() -> None:
    takeover = Takeover(SECOND)
    assert not takeover.lasts(0)
    assert takeover.note(10 * SECOND)
    assert takeover.lasts(10 * SECOND)
    assert not takeover.note(10 * SECOND + SECOND // 2)
    assert takeover.lasts(11 * SECOND)
    assert not takeover.lasts(12 * SECOND)
    assert takeover.note(12 * SECOND)
    assert takeover.count == 2


def test_a_takeover_begins_anew_where_the_clock_is_set_back() -> None:
    takeover = Takeover(SECOND)
    takeover.restart(0)
    takeover.note(10 * SECOND)
    assert takeover.lasts(5 * SECOND)
    takeover.restart(5 * SECOND)
    assert takeover.lasts(5 * SECOND + SECOND // 2)
    assert not takeover.lasts(6 * SECOND)


@pytest.mark.parametrize(
    ("topic", "channels", "topics", "channel"),
    [
        ("action", ["/action"], ["action"], "/action"),
        ("arm", ["base", "arm"], ["base", "arm"], "arm"),
        ("hand", ["base", "arm"], ["hand"], None),
        ("hand", ["class"], ["hand"], "class"),
        ("hand", ["class"], ["hand", "other"], None),
    ],
)
def test_a_topic_is_that_of_the_channel_of_its_name_or_of_the_only_one(
    topic: str, channels: list[str], topics: list[str], channel: str | None
) -> None:
    assert channel_of(topic, channels, topics) == channel


def test_an_action_after_commands_begins_a_takeover_that_knows_what_they_did() -> None:
    watch = TakeoverWatch(["arm", "base"])
    assert watch.act(0, "arm", "grasp") is None
    assert watch.command(SECOND, "arm", "lift")
    assert not watch.command(2 * SECOND, "base", "go")
    assert not watch.command(3 * SECOND, "base", "turn")
    assert watch.act(4 * SECOND, "base", "stop") == {
        "arm": ("grasp", "lift"),
        "base": ("go", "turn"),
    }
    assert watch.act(4 * SECOND + 1, "arm", "drop") is None
    # Was under way.
    assert not watch.command(4 * SECOND + 2, "base", "turn")
    assert watch.act(5 * SECOND, "base", "stop") is None
    assert watch.command(7 * SECOND, "base", "turn")
    assert watch.act(8 * SECOND, "base", "") == {
        "arm": ("grasp", "lift", "drop"),
        "base": ("go", "stop", "turn"),
    }
    assert watch.takeovers == 2


def test_an_executor_that_holds_the_robot_drives_without_commands() -> None:
    watch = TakeoverWatch(["action"])
    watch.act(0, "action", "go")
    assert watch.drive(True)
    assert not watch.drive(True)
    assert watch.act(SECOND, "action", "go") == {"action": ("go",)}
    assert not watch.drive(False)
    assert watch.act(2 * SECOND, "action", "go") is None
    watch.drive(True)
    watch.drive(False)
    # It was disabled before: what follows is a demonstration like any other.
    assert watch.act(3 * SECOND, "action", "go") is None


def test_what_a_person_was_asked_to_show_is_no_takeover() -> None:
    watch = TakeoverWatch(["action"])
    watch.command(0, "action", "go")
    assert watch.driven
    assert watch.act(SECOND, "action", "stop", awaited=True) is None
    assert (watch.driven, watch.takeovers) == (False, 0)
    watch.command(2 * SECOND, "action", "go")
    assert watch.act(3 * SECOND, "action", "turn") == {"action": ("stop", "go")}
    assert watch.takeovers == 1


FAMILIAR, STRANGE = {"state": (7.0, 0.5)}, {"state": (7.0, 3.0)}
LEARNED = replace(
    some.learned(some.action("go"), [Feature("y"), Feature("x")]),
    shown=(ShownChannel("action", (ShownLeaf(1, (Span(7.0, 7.0), Span(0.0, 1.0))),)),),
)
DETECTOR = NoveltyDetector(LEARNED, ["state"], "state", 0.0)
DEPARTURE = Departure("x", 3.0, Span(0.0, 1.0))


def test_a_guard_that_holds_goes_on_to_do_so_until_it_is_released() -> None:
    guard = NoveltyGuard(Novelty.HOLD)
    assert guard.passes(DETECTOR, FAMILIAR)
    assert not guard.passes(DETECTOR, STRANGE)
    assert not guard.passes(DETECTOR, FAMILIAR)
    assert (guard.holding, guard.departure) == (True, DEPARTURE)
    guard.release()
    assert not guard.passes(DETECTOR, STRANGE)
    guard.release()
    assert guard.passes(DETECTOR, FAMILIAR)
    assert guard.departure is None


def test_a_guard_that_warns_lets_the_tree_decide_and_one_that_ignores_does_not_look() -> None:
    guard = NoveltyGuard(Novelty.WARN)
    assert guard.passes(DETECTOR, STRANGE)
    assert guard.departure == DEPARTURE
    assert guard.passes(DETECTOR, FAMILIAR)
    assert guard.departure is None
    guard = NoveltyGuard(Novelty.IGNORE)
    assert guard.passes(DETECTOR, STRANGE)
    assert guard.departure is None


def test_of_what_waits_in_the_background_only_the_latest_is_done() -> None:
    started, go_on, ready = threading.Event(), threading.Event(), threading.Semaphore(0)

    def work(piece: int) -> int:
        started.set()
        assert go_on.wait(30)
        return -piece

    background = Background(work, ready.release)
    background.put(1)
    assert started.wait(30)
    for piece in (2, 3, 4):
        background.put(piece)
    assert background.take() == []
    go_on.set()
    assert ready.acquire(timeout=30)
    assert ready.acquire(timeout=30)
    assert background.take() == [-1, -4]
    background.close()
    background.put(5)
    assert background.take() == []
