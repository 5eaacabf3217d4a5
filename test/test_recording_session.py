"""Demonstrations, one file after another, without ROS and without a disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import OptionError, RebtError
from rebt_ros.ros import recording_session
from rebt_ros.ros.recording_session import RecordingSession


class Disk:
    """Opens files in memory; fails while it is full."""

    def __init__(self) -> None:
        self.files: list[File] = []
        self.full = False
        self.syncs = 0

    def open(self, features: tuple[Feature, ...]) -> File:
        self.check()
        self.files.append(File(self, features))
        return self.files[-1]

    def check(self) -> None:
        if self.full:
            raise RebtError("the disk is full.")


class File:
    def __init__(self, disk: Disk, features: tuple[Feature, ...]) -> None:
        self._disk = disk
        self.features = features
        self.path = Path("file")
        self.written: list[Row] = []
        self.end = ""

    @property
    def rows(self) -> int:
        return len(self.written)

    def write(self, row: Row) -> None:
        self._disk.check()
        self.written.append(row)

    def sync(self) -> None:
        self._disk.check()
        self._disk.syncs += 1

    def close(self) -> None:
        self.end = "closed"

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


def test_no_file_is_opened_without_a_row() -> None:
    desk = Desk()
    desk.session.start(0)
    desk.session.observe(1, "state", [1.0], [])
    answer = desk.session.stop()
    assert (answer.success, "no rows" in answer.message) == (True, True)
    assert desk.disk.files == []


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
