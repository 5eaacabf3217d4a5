"""Demonstrations, one file after another, without ROS and without a disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from rebt_ros.demonstration.builder import Fault, StateTopic
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import OptionError, RebtError
from rebt_ros.live import recording_session
from rebt_ros.live.recording_session import RecordingSession
from rebt_ros.storage.recording_head import Origin


class Disk:
    """Opens files in memory; fails while it is full."""

    def __init__(self) -> None:
        self.files: list[File] = []
        self.full = False
        self.moved = False
        self.syncs = 0

    def open(self, features: tuple[Feature, ...], origin: Origin) -> File:
        self.check()
        self.files.append(File(self, features, origin))
        return self.files[-1]

    def check(self) -> None:
        if self.full:
            raise RebtError("the disk is full.")


class File:
    def __init__(self, disk: Disk, features: tuple[Feature, ...], origin: Origin) -> None:
        self._disk = disk
        self.features = features
        self.origin = origin
        self.path = Path("file")
        self.written: list[Row] = []
        self.end = ""

    @property
    def rows(self) -> int:
        return len(self.written)

    def write(self, row: Row) -> None:
        self._disk.check()
        self.written.append(row)

    def look(self) -> None:
        if self._disk.moved:
            raise RebtError("it was moved.")

    def sync(self) -> None:
        self._disk.check()
        self._disk.syncs += 1

    def close(self) -> None:
        self._disk.check()
        self.end = "closed"

    def set_aside(self) -> None:
        self._disk.check()
        self.end = "aside"

    def discard(self) -> None:
        self.end = "discarded"


class Desk:
    """A session with its disk and the faults it noted."""

    def __init__(self, sample_rate: float | None = None) -> None:
        self.disk = Disk()
        self.faults: list[str] = []
        self.session = RecordingSession(
            [StateTopic("state")],
            ["action"],
            sample_rate,
            self.disk.open,
            lambda kind, _: self.faults.append(kind),
        )

    def rows(self) -> list[list[tuple[str, str | None, tuple[float, ...]]]]:
        return [
            [(row.action, row.last_action, row.state) for row in file.written]
            for file in self.disk.files
        ]

    def actions(self) -> list[tuple[Origin, list[str], str]]:
        """Of each file its origin, its actions, and how it ended."""
        return [
            (file.origin, [row.action for row in file.written], file.end)
            for file in self.disk.files
        ]


@pytest.fixture(autouse=True)
def _retry_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_session, "_RETRY_AFTER", 0.0)


def test_states_before_the_start_are_known_and_actions_are_not() -> None:
    desk = Desk()
    desk.session.observe(1, "state", [1.0], ["x"])
    desk.session.act(2, "action", "before")
    assert desk.session.start(3).success
    desk.session.act(4, "action", "go")
    assert desk.rows() == [[("go", None, (1.0,))]]
    assert desk.disk.files[0].features[0].name == "x"


@pytest.mark.parametrize("sample_rate", [None, 1.0])
def test_a_simulation_that_begins_anew_begins_a_demonstration(sample_rate: float | None) -> None:
    second = 1_000_000_000
    desk = Desk(sample_rate)
    desk.session.start(0)
    for run in range(2):
        begin = 5 * second
        desk.session.observe(begin, "state", [float(run)], ["x"] if run == 0 else [])
        desk.session.act(begin + 1, "action", "go")
        for step in range(3):
            desk.session.observe(begin + step * second, "state", [float(run)], [])
        desk.session.act(begin + 3 * second, "action", "turn")
        if run == 0:
            # What is known of the first run does not hold in the second.
            desk.session.set_back(0)
            desk.session.act(second, "action", "go")
            assert Fault.NO_STATE.value in desk.faults
    desk.session.stop(9 * second)
    first, second_file = desk.disk.files
    assert {row.state for row in first.written} == {(0.0,)}
    assert {row.state for row in second_file.written} == {(1.0,)}
    assert second_file.written[0].last_action is None
    assert first.features == second_file.features
    assert recording_session.SET_BACK in desk.faults


def test_time_that_is_set_back_while_nothing_is_recorded_is_no_demonstration() -> None:
    desk = desk_with_state()
    desk.session.stop(2)
    desk.session.set_back(0)
    desk.session.observe(1, "state", [2.0], [])
    desk.session.start(2)
    desk.session.act(3, "action", "go")
    assert desk.rows() == [[("go", None, (2.0,))]]


def test_no_file_is_opened_without_a_row() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    answer = desk.session.stop(2)
    assert (answer.success, "no rows" in answer.message) == (False, True)
    assert desk.disk.files == []


def test_actions_before_the_first_state_are_counted_in_the_answer() -> None:
    desk = Desk()
    desk.session.start(0)
    assert not desk.session.knows("state")
    desk.session.observe(1, "state", (float("nan"),), ())
    assert not desk.session.knows("state")
    desk.session.act(2, "action", "go")
    desk.session.act(3, "action", "go")
    early = " 2 actions are left out, which came before the first state."
    assert desk.session.renew(4) == (
        False,
        f"no rows were recorded.{early} A new demonstration has begun.",
    )
    desk.session.act(5, "action", "go")
    desk.session.observe(6, "state", (1.0,), ())
    assert desk.session.knows("state")
    desk.session.act(7, "action", "go")
    assert desk.session.stop(8) == (
        True,
        "stopped; recorded 1 row in file. 1 action is left out, which came before the first state.",
    )
    desk.session.start(9)
    desk.session.act(10, "action", "go")
    assert desk.session.stop(11) == (True, "stopped; recorded 1 row in file.")


def test_while_nothing_is_recorded_a_state_without_values_is_not_known() -> None:
    desk = Desk()
    for values in ((), (float("inf"),), (1.0, float("nan"))):
        desk.session.observe(1, "state", values, ())
        assert not desk.session.knows("state")
    desk.session.observe(1, "state", (1.0,), ())
    assert desk.session.knows("state")


def test_rows_that_the_disk_refused_are_in_the_answer() -> None:
    desk = desk_with_state()
    desk.disk.full = True
    desk.session.act(2, "action", "go")
    assert desk.session.stop(3) == (False, "stopped; rows were lost: the disk is full.")


def test_what_was_recorded_before_counts_where_nothing_was_since() -> None:
    desk = desk_with_state()
    desk.session.act(2, "action", "go")
    assert desk.session.renew(3).success
    answer = desk.session.stop(4)
    assert answer.success
    assert answer.message == "stopped; no rows since the last demonstration, 1 row in all."


def test_a_full_disk_ends_a_demonstration_and_room_begins_another() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    desk.session.act(2, "action", "go")
    desk.session.act(3, "action", "turn")
    desk.disk.full = True
    desk.session.act(4, "action", "go")
    desk.session.act(5, "action", "turn")
    assert desk.session.failure == "the disk is full."
    desk.disk.full = False
    desk.session.act(6, "action", "go")
    assert desk.session.failure == ""
    assert desk.rows() == [
        [("go", None, (1.0,)), ("turn", "go", (1.0,))],
        [("go", None, (1.0,))],
    ]
    assert (desk.session.rows, desk.session.lost) == (3, 2)
    assert desk.faults == ["write error"] * 2


def test_a_disk_that_does_not_keep_its_rows_ends_a_demonstration() -> None:
    desk = Desk()
    desk.session.sync(0)
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    desk.session.sync(1)
    desk.session.act(2, "action", "go")
    desk.session.sync(3)
    assert (desk.disk.syncs, desk.session.failure) == (1, "")
    desk.disk.full = True
    desk.session.sync(4)
    assert desk.session.failure == "the disk is full."
    desk.disk.full = False
    desk.session.act(5, "action", "turn")
    assert desk.session.failure == ""
    assert desk.rows() == [[("go", None, (1.0,))], [("turn", None, (1.0,))]]


def test_a_file_that_was_moved_ends_a_demonstration_and_the_next_action_begins_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recording_session, "_RETRY_AFTER", 100.0)
    desk = Desk()
    desk.session.look(0)
    desk.session.start(0)
    desk.session.look(0)
    desk.session.observe(1, "state", [1.0], [])
    desk.session.act(2, "action", "go")
    desk.session.look(3)
    assert (desk.faults, desk.session.failure) == ([], "")
    desk.disk.moved = True
    desk.session.look(3)
    assert (desk.faults, desk.session.failure) == (["write error"], "it was moved.")
    desk.session.act(4, "action", "turn")
    assert (desk.session.rows, desk.session.lost, desk.session.failure) == (2, 0, "")
    assert desk.rows() == [[("go", None, (1.0,))], [("turn", None, (1.0,))]]


def test_a_new_length_is_accepted_by_a_new_demonstration_only() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    desk.session.observe(2, "state", [1.0, 2.0], [])
    desk.session.act(3, "action", "go")
    assert desk.faults == ["unexpected length"]
    desk.session.renew(4)
    desk.session.observe(5, "state", [1.0, 2.0], [])
    desk.session.act(6, "action", "go")
    assert desk.rows() == [[("go", None, (1.0,))], [("go", None, (1.0, 2.0))]]


@pytest.mark.parametrize("bad", [[1.0, 2.0], [float("nan")], []])
def test_a_demonstration_does_not_begin_with_a_message_that_was_refused(bad: list[float]) -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], ["x"])
    desk.session.observe(2, "state", bad, [])
    desk.session.renew(3)
    desk.session.observe(4, "state", [3.0], [])
    desk.session.act(5, "action", "go")
    assert desk.rows() == [[("go", None, (3.0,))]]
    assert desk.disk.files[0].features[0].name == "x"


def test_names_from_the_first_message_hold_for_later_demonstrations() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], ["x"])
    desk.session.observe(2, "state", [2.0], [])
    desk.session.renew(3)
    desk.session.act(4, "action", "go")
    assert desk.disk.files[0].features[0].name == "x"


def test_a_discarded_demonstration_does_not_count() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    desk.session.act(2, "action", "go")
    assert desk.session.discard(3).success
    assert desk.disk.files[0].end == "discarded"
    assert desk.session.rows == 0
    desk.session.act(4, "action", "turn")
    assert desk.rows()[1] == [("turn", None, (1.0,))]


def test_a_held_action_is_sampled_on_in_the_next_demonstration() -> None:
    desk = Desk(sample_rate=10.0)
    tenth = 100_000_000
    desk.session.observe(0, "state", [0.0], [])
    desk.session.act(0, "action", "go")
    desk.session.start(0)
    for step in range(1, 6):
        desk.session.observe(step * tenth, "state", [float(step)], [])
    desk.session.renew(5 * tenth)
    for step in range(6, 9):
        desk.session.observe(step * tenth, "state", [float(step)], [])
    first, second = desk.rows()
    assert [state[0] for _, _, state in first] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert [state[0] for _, _, state in second] == [5.0, 6.0, 7.0]


def test_wrong_topics_are_refused_before_anything_is_recorded() -> None:
    with pytest.raises(OptionError, match="must differ"):
        RecordingSession([StateTopic("a")], ["a"], None, Disk().open, lambda *_: None)


SECOND = 10**9


def test_what_a_person_does_while_the_executor_drives_is_a_demonstration_of_its_own() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    desk.session.act(2, "action", "go")
    desk.session.command(1 * SECOND, "action", "turn")
    assert desk.disk.files[0].end == "closed"
    desk.session.command(2 * SECOND, "action", "go")
    desk.session.act(3 * SECOND, "action", "stop")
    desk.session.act(4 * SECOND, "action", "go")
    desk.session.drive(5 * SECOND, True)
    assert desk.disk.files[1].end == "closed"
    # Held at once: it drove, and commanded nothing.
    desk.session.act(6 * SECOND, "action", "go")
    assert desk.rows() == [
        [("go", None, (1.0,))],
        [("stop", "go", (1.0,)), ("go", "stop", (1.0,))],
        [("go", "stop", (1.0,))],
    ]
    assert desk.session.takeovers == 2


def test_an_action_is_held_no_longer_than_until_the_executor_drives() -> None:
    desk = Desk(sample_rate=10.0)
    desk.session.start(0)
    desk.session.observe(0, "state", [1.0], [])
    desk.session.act(0, "action", "go")
    desk.session.observe(2 * SECOND // 10, "state", [2.0], [])
    desk.session.command(SECOND // 2, "action", "turn")
    rows = len(desk.rows()[0])
    for tenth in range(6, 20):
        desk.session.observe(tenth * SECOND // 10, "state", [3.0], [])
    assert len(desk.disk.files) == 1
    assert len(desk.rows()[0]) == rows
    desk.session.act(2 * SECOND, "action", "stop")
    desk.session.observe(2 * SECOND + 1, "state", [3.0], [])
    assert desk.rows()[1] == [("stop", "turn", (3.0,))]


def test_who_drives_is_known_also_while_nothing_is_recorded() -> None:
    desk = Desk()
    desk.session.observe(1, "state", [1.0], [])
    desk.session.command(2, "action", "turn")
    desk.session.act(SECOND, "action", "go")
    desk.session.start(SECOND + 1)
    desk.session.act(SECOND + 2, "action", "go")
    assert desk.rows() == [[("go", None, (1.0,))]]


TENTH = SECOND // 10
DEMONSTRATION, TAKEOVER, FAILED = Origin.DEMONSTRATION, Origin.TAKEOVER, Origin.FAILED


def desk_with_state(sample_rate: float | None = None, *, recording: bool = True) -> Desk:
    desk = Desk(sample_rate)
    if recording:
        desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    return desk


def hold(desk: Desk, start: int, end: int, value: float = 1.0) -> None:
    """Nothing but states, every tenth of a second from one to the other, in tenths."""
    for number in range(start, end):
        desk.session.observe(number * TENTH, "state", [value], [])


def test_what_failed_is_shown_while_nothing_was_recorded() -> None:
    desk = desk_with_state(recording=False)
    desk.session.act(2, "action", "before")
    answer = desk.session.fail(3)
    assert answer.success
    assert answer.message == (
        "recording. Now put the robot back to where the episode began, or leave it where it is, "
        "and show how it is done, to the end; then call ~/new_demonstration."
    )
    assert (desk.session.recording, desk.session.awaited, desk.session.failed) == (True, True, 1)
    desk.session.act(4, "action", "go")
    assert not desk.session.awaited
    desk.session.renew(5)
    desk.session.act(6, "action", "turn")
    assert desk.actions() == [(FAILED, ["go"], "closed"), (DEMONSTRATION, ["turn"], "")]


def test_what_failed_ends_the_demonstration_under_way_and_keeps_its_rows() -> None:
    desk = desk_with_state()
    desk.session.act(2, "action", "go")
    desk.session.act(3, "action", "turn")
    answer = desk.session.fail(4)
    assert answer.success
    assert answer.message.startswith("recorded 2 rows in file. Now put the robot back")
    desk.session.act(5, "action", "go")
    assert desk.actions() == [
        (DEMONSTRATION, ["go", "turn"], "closed"),
        (FAILED, ["go"], ""),
    ]
    assert desk.rows()[1] == [("go", None, (1.0,))]
    assert desk.session.rows == 3


@pytest.mark.parametrize("disabled", [True, False])
def test_what_failed_while_the_executor_drives_begins_with_what_a_person_does(
    disabled: bool,
) -> None:
    desk = desk_with_state()
    desk.session.drive(2, True)
    desk.session.command(3, "action", "turn")
    answer = desk.session.fail(4)
    assert "Now disable the executor, put the robot back" in answer.message
    desk.session.command(1 * SECOND, "action", "stop")
    if disabled:
        desk.session.drive(2 * SECOND, False)
        # Was under way when the executor was disabled.
        desk.session.command(2 * SECOND + 1, "action", "stop")
    assert desk.disk.files == []
    assert desk.session.awaited
    desk.session.act(3 * SECOND, "action", "go")
    desk.session.act(4 * SECOND, "action", "go")
    # Neither does LAT know of what the executor did, nor is it a takeover.
    assert desk.rows() == [[("go", None, (1.0,)), ("go", None, (1.0,))]]
    assert desk.actions() == [(FAILED, ["go", "go"], "")]
    assert (desk.session.takeovers, desk.session.failed) == (0, 1)


def test_what_failed_ends_where_the_executor_drives_again() -> None:
    desk = desk_with_state()
    desk.session.drive(2, True)
    desk.session.fail(3)
    desk.session.act(1 * SECOND, "action", "go")
    desk.session.drive(2 * SECOND, True)
    desk.session.act(3 * SECOND, "action", "stop")
    assert desk.actions() == [(FAILED, ["go"], "closed"), (TAKEOVER, ["stop"], "")]
    assert desk.session.takeovers == 1


def test_a_takeover_in_an_episode_that_failed_is_kept_and_not_learned_from() -> None:
    desk = desk_with_state()
    desk.session.drive(2, True)
    desk.session.act(1 * SECOND, "action", "stop")
    answer = desk.session.fail(2 * SECOND)
    assert answer.success
    assert answer.message.startswith(
        "the takeover did not help and is set aside: 1 row in file. Now disable the executor,"
    )
    # It waits for no longer than its takeover_timeout.
    desk.session.drive(3 * SECOND, True)
    assert desk.session.awaited
    desk.session.act(4 * SECOND, "action", "go")
    assert desk.actions() == [(TAKEOVER, ["stop"], "aside"), (FAILED, ["go"], "")]
    assert desk.rows()[1] == [("go", None, (1.0,))]
    # A takeover of an episode before is not concerned.
    desk.session.drive(5 * SECOND, True)
    desk.session.act(6 * SECOND, "action", "turn")
    desk.session.drive(7 * SECOND, True)
    desk.session.fail(8 * SECOND)
    assert desk.actions()[-1] == (TAKEOVER, ["turn"], "closed")


def test_a_takeover_without_rows_leaves_nothing_to_set_aside() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.drive(1, True)
    desk.session.act(2, "action", "go")
    assert desk.session.origin is TAKEOVER
    answer = desk.session.fail(3)
    assert answer.success
    assert answer.message.startswith(
        "no rows were recorded. 1 action is left out, which came before the first state. Now "
        "disable the executor,"
    )


def test_who_ends_a_takeover_after_the_executor_drives_on_is_told_that_it_is_kept() -> None:
    desk = desk_with_state()
    desk.session.drive(2, True)
    desk.session.act(3, "action", "stop")
    desk.session.drive(4, True)
    assert desk.actions() == [(TAKEOVER, ["stop"], "closed")]
    answer = desk.session.renew(5)
    assert answer.success
    assert answer.message == (
        "the takeover is kept: recorded 1 row in file. A new demonstration has begun."
    )
    # It is meant once, and not where something came after it.
    assert desk.session.renew(6) == (
        False,
        "no rows were recorded. A new demonstration has begun.",
    )
    desk.session.drive(7, True)
    desk.session.act(8, "action", "turn")
    desk.session.drive(9, True)
    desk.session.discard(10)
    assert not desk.session.renew(11).success


def test_what_failed_twice_is_awaited_still_and_what_was_shown_is_kept() -> None:
    desk = desk_with_state()
    assert desk.session.fail(2).success
    assert desk.session.fail(3).success
    assert desk.session.awaited
    desk.session.act(4, "action", "go")
    assert desk.session.fail(5).message.startswith("recorded 1 row in file. Now put")
    desk.session.act(6, "action", "turn")
    assert desk.actions() == [(FAILED, ["go"], "closed"), (FAILED, ["turn"], "")]
    assert desk.rows()[1] == [("turn", None, (1.0,))]
    assert desk.session.failed == 3


def test_what_failed_before_any_state_is_shown_once_there_is_one() -> None:
    desk = Desk()
    desk.session.fail(1)
    desk.session.act(2, "action", "too early")
    assert desk.faults == ["action before the first state"]
    desk.session.drive(3, True)
    desk.session.observe(4, "state", [1.0], [])
    desk.session.act(1 * SECOND, "action", "go")
    assert desk.actions() == [(FAILED, ["go"], "")]
    assert desk.session.takeovers == 0


@pytest.mark.parametrize("end", ["renew", "stop"])
def test_nobody_has_to_show_what_failed(end: str) -> None:
    desk = desk_with_state()
    desk.session.drive(2, True)
    desk.session.fail(3)
    assert getattr(desk.session, end)(4).success
    desk.session.start(5)
    assert not desk.session.awaited
    desk.session.act(6, "action", "go")
    assert desk.actions() == [(TAKEOVER, ["go"], "")]


def test_what_has_just_ended_is_discarded_where_nothing_was_recorded_since() -> None:
    desk = desk_with_state()
    for label in ("kept", "wrong"):
        desk.session.act(2, "action", label)
        assert desk.session.renew(3).success
    answer = desk.session.discard(4)
    assert (answer.success, answer.message) == (
        True,
        "discarded 1 row in file; a new demonstration has begun.",
    )
    assert desk.session.rows == 1
    # A second call does not take what was kept before.
    answer = desk.session.discard(5)
    assert (answer.success, "there is no row to discard" in answer.message) == (False, True)
    assert [end for _, _, end in desk.actions()] == ["closed", "discarded"]


def test_what_failed_is_shown_again_where_it_is_discarded_after_its_end() -> None:
    desk = desk_with_state()
    desk.session.fail(2)
    desk.session.act(3, "action", "wrong")
    desk.session.renew(4)
    assert desk.session.discard(5).success
    assert desk.session.awaited
    desk.session.act(6, "action", "right")
    assert desk.actions() == [(FAILED, ["wrong"], "discarded"), (FAILED, ["right"], "")]


@pytest.mark.parametrize("begin", ["fail", "start"])
def test_what_ended_before_something_else_began_stays(begin: str) -> None:
    desk = desk_with_state()
    desk.session.act(2, "action", "go")
    if begin == "start":
        desk.session.stop(3)
    getattr(desk.session, begin)(4)
    assert not desk.session.discard(5).success
    assert [end for _, _, end in desk.actions()] == ["closed"]


def test_what_ended_last_is_named_where_nothing_is_recorded() -> None:
    desk = desk_with_state()
    desk.session.act(2, "action", "go")
    desk.session.stop(3)
    answer = desk.session.discard(4)
    assert (answer.success, answer.message) == (
        False,
        "not recording: the one that ended last is file, a file that you can delete.",
    )


def test_what_was_shown_badly_of_what_failed_is_discarded_and_shown_again() -> None:
    desk = desk_with_state()
    desk.session.fail(2)
    desk.session.act(3, "action", "wrong")
    assert desk.session.discard(4).success
    assert desk.session.awaited
    desk.session.act(5, "action", "right")
    assert desk.actions() == [(FAILED, ["wrong"], "discarded"), (FAILED, ["right"], "")]


def test_a_disk_that_refuses_what_came_before_does_not_keep_a_person_from_showing() -> None:
    desk = desk_with_state()
    desk.session.act(2, "action", "go")
    desk.disk.full = True
    answer = desk.session.fail(3)
    assert not answer.success
    assert answer.message.startswith("the disk is full. Now put the robot back")
    desk.disk.full = False
    desk.session.act(4, "action", "turn")
    assert desk.actions()[1] == (FAILED, ["turn"], "")


def test_what_a_gap_parts_has_one_origin() -> None:
    desk = desk_with_state()
    desk.session.fail(2)
    desk.session.act(3, "action", "go")
    desk.disk.full = True
    desk.session.act(4, "action", "turn")
    desk.disk.full = False
    desk.session.act(5, "action", "stop")
    assert [file.origin for file in desk.disk.files] == [FAILED, FAILED]
    desk.disk.full = True
    desk.session.sync(6)
    desk.disk.full = False
    desk.session.act(7, "action", "go")
    assert [file.origin for file in desk.disk.files] == [FAILED, FAILED, FAILED]


def test_what_is_held_when_it_failed_is_not_sampled_while_the_robot_is_put_back() -> None:
    desk = desk_with_state(10.0)
    desk.session.act(0, "action", "stop")
    hold(desk, 1, 4)
    desk.session.fail(4 * TENTH)
    assert desk.actions() == [(DEMONSTRATION, ["stop"] * 4, "closed")]
    hold(desk, 5, 20)
    assert len(desk.disk.files) == 1
    desk.session.act(20 * TENTH, "action", "")
    desk.session.act(21 * TENTH, "action", "go")
    hold(desk, 21, 25, 2.0)
    assert desk.rows()[1] == [("go", None, (2.0,))] * 3


def test_an_executor_that_drives_is_not_sampled_before_a_person_shows_what_failed() -> None:
    desk = desk_with_state(10.0)
    desk.session.act(0, "action", "go")
    desk.session.command(5 * TENTH, "action", "turn")
    rows = desk.session.rows
    desk.session.fail(6 * TENTH)
    for number in range(7, 30):
        desk.session.command(number * TENTH, "action", "turn")
        hold(desk, number, number + 1)
    assert desk.session.rows == rows
    desk.session.act(30 * TENTH, "action", "go")
    # Under way: the person has the robot.
    desk.session.command(31 * TENTH, "action", "turn")
    hold(desk, 31, 34)
    assert desk.actions()[1] == (FAILED, ["go"] * 3, "")


def test_a_takeover_holds_all_until_its_end_while_the_person_only_holds_an_action() -> None:
    desk = desk_with_state(10.0)
    desk.session.drive(2, True)
    desk.session.command(9 * TENTH, "action", "turn")
    desk.session.act(10 * TENTH, "action", "go")
    desk.session.drive(10 * TENTH + 1, False)
    hold(desk, 11, 60)
    desk.session.act(60 * TENTH, "action", "")
    hold(desk, 61, 80)
    desk.session.act(80 * TENTH, "action", "stop")
    hold(desk, 81, 85)
    # Also what is due since the last state: nothing tells it from what was before.
    desk.session.renew(86 * TENTH)
    assert desk.actions() == [(TAKEOVER, ["go"] * 50 + ["stop"] * 6, "closed")]
    assert desk.rows()[0][0] == ("go", "turn", (1.0,))
    assert desk.session.takeovers == 1


@pytest.mark.parametrize("end", ["renew", "stop", "fail", "hand over"])
def test_a_demonstration_ends_with_the_samples_that_were_due(end: str) -> None:
    desk = desk_with_state(10.0)
    desk.session.act(0, "action", "go")
    if end == "hand over":
        desk.session.drive(5 * TENTH, True)
    else:
        getattr(desk.session, end)(5 * TENTH)
    assert desk.actions() == [(DEMONSTRATION, ["go"] * 5, "closed")]


def test_a_second_takeover_of_an_episode_is_another_demonstration() -> None:
    desk = desk_with_state()
    desk.session.drive(2, True)
    for start in (1, 5):
        desk.session.act(start * SECOND, "action", "go")
        # However slow the person is, as long as the executor rests.
        desk.session.act((start + 3) * SECOND, "action", "stop")
        desk.session.drive((start + 3) * SECOND + 1, True)
    assert desk.actions() == [(TAKEOVER, ["go", "stop"], "closed")] * 2
    assert desk.session.takeovers == 2
