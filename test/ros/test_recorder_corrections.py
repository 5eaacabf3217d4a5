"""Corrections of a task that needs memory, from the recorder's files to a tree that drives."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rebt_ros
from rebt_ros import LearnedTree, Policy
from rebt_ros.arrays import IntArray
from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.live.recording_session import RecordingSession
from rebt_ros.storage.inputs import load
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.storage.recording_files import recordings
from rebt_ros.storage.recording_head import Origin, read_head

#: Rows per second, and the time between two of them (nanoseconds).
RATE, PERIOD = 10.0, 100_000_000

#: Ends of the way; how far a step leads; how often it is driven in a row, in so many steps at most.
LEFT, RIGHT, SPEED, LEGS, MOST_STEPS = 0.0, 10.0, 0.5, 5, 150

#: Where a robot turns round, on its last way to the right, before a person takes over.
TOO_EARLY = 7.0

DEMONSTRATIONS, TAKEOVERS, FRESH = 3, 6, range(1000, 1040)

Driver = Callable[[float], str | None]


class Shuttle:
    """Something that is to go to and fro, first to the right, and knows only where it is."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._place = self._random.uniform(3.0, 7.0)
        self._wanted = "right"
        self.legs = 0

    @property
    def measured(self) -> float:
        return self._place + self._random.gauss(0.0, 0.02)

    def step(self, action: str | None) -> None:
        self._place += {"left": -SPEED, "right": SPEED}.get(action or "", 0.0)
        end = RIGHT if self._wanted == "right" else LEFT
        if abs(self._place - end) < 2 * SPEED:
            self.legs += 1
            self._wanted = other(self._wanted)


class Person:
    """Goes on to an end, and turns round there; also knows what a robot should do that drives."""

    def __init__(self) -> None:
        self.wants = "right"

    def __call__(self, place: float) -> str:
        if place > RIGHT - SPEED:
            self.wants = "left"
        elif place < LEFT + SPEED:
            self.wants = "right"
        return self.wants


def other(action: str) -> str:
    return "left" if action == "right" else "right"


def succeeds(seed: int, driver: Driver) -> bool:
    shuttle = Shuttle(seed)
    for _ in range(MOST_STEPS):
        shuttle.step(driver(shuttle.measured))
        if shuttle.legs >= LEGS:
            return True
    return False


class Desk:
    """A recorder's session that writes files, and what happens in its sight."""

    def __init__(self, directory: Path) -> None:
        def open_writer(features: tuple[Feature, ...], origin: Origin) -> RecordingWriter:
            return RecordingWriter(directory, features, ["action"], sample_rate=RATE, origin=origin)

        self.now = 0
        self.session = RecordingSession(
            [StateTopic("state", ("place",))],
            ["action"],
            RATE,
            open_writer,
            lambda kind, text: pytest.fail(f"{kind}: {text}"),
        )
        self.session.start(self.now)

    def drive(self, shuttle: Shuttle, decide: Driver, steps: int, *, person: bool) -> None:
        """A person, or an executor, drives until the legs are driven or so many steps are done."""
        send = self.session.act if person else self.session.command
        for _ in range(steps):
            if shuttle.legs >= LEGS:
                return
            self.now += PERIOD
            place = shuttle.measured
            self.session.observe(self.now, "state", [place], [])
            action = decide(place)
            send(self.now, "action", action or "")
            shuttle.step(action)

    def show(self, seed: int) -> None:
        """An episode as it should be."""
        shuttle = Shuttle(seed)
        self.drive(shuttle, Person(), MOST_STEPS, person=True)
        assert shuttle.legs == LEGS
        self.session.act(self.now + 1, "action", "")
        self.session.renew(self.now + 2)

    def stop_and_show(self, seed: int) -> None:
        """A person only stops a robot amid the way, says that it failed, and shows it anew."""
        shuttle = Shuttle(seed)
        self.now += 10 * PERIOD
        self.session.drive(self.now, True)
        self.drive(shuttle, Person(), random.Random(seed).randrange(10, 70), person=False)
        self.drive(shuttle, lambda _: "stop", 8, person=True)
        self.session.act(self.now + 1, "action", "")
        assert self.session.fail(self.now + 2).success
        self.session.drive(self.now + 3, False)
        self.show(seed)

    def take_over(self, seed: int) -> None:
        """A robot turns round too early, and a person takes over to the end of the episode."""
        shuttle, person = Shuttle(seed), Person()
        self.now += 10 * PERIOD
        self.session.drive(self.now, True)
        while not (shuttle.legs == LEGS - 1 and shuttle.measured > TOO_EARLY):
            self.drive(shuttle, person, 1, person=False)
        for _ in range(2):
            self.drive(shuttle, lambda place: other(person(place)), 1, person=False)
        self.drive(shuttle, person, 1, person=True)
        self.session.drive(self.now + 1, False)
        self.drive(shuttle, person, MOST_STEPS, person=True)
        assert shuttle.legs == LEGS
        self.session.act(self.now + 1, "action", "")
        self.session.renew(self.now + 2)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Some demonstrations, and takeovers from a robot that did the opposite."""
    directory = tmp_path_factory.mktemp("shuttle")
    desk = Desk(directory)
    for seed in range(DEMONSTRATIONS):
        desk.show(seed)
    for seed in range(100, 100 + TAKEOVERS):
        desk.take_over(seed)
    return directory


def table_of(directory: Path) -> DemonstrationTable:
    (table,) = tabulate(load([directory]).demonstrations)
    return table


def origins(directory: Path) -> list[Origin]:
    found = []
    for path in recordings(directory):
        with path.open("rb") as file:
            found.append(read_head(path, file).origin)
    return found


def success(tree: LearnedTree) -> float:
    """Share of fresh episodes."""
    policy = Policy(tree)
    done = 0
    for seed in FRESH:
        policy.reset()
        done += succeeds(seed, lambda place: str(policy.act([place])))
    return done / len(FRESH)


def first_rows(table: DemonstrationTable) -> IntArray:
    """Of each demonstration."""
    return np.unique(table.demonstration, return_index=True)[1]


def test_takeovers_are_recordings_of_their_own_with_what_the_robot_did_as_lat(shown: Path) -> None:
    assert origins(shown) == (
        [Origin.DEMONSTRATION] * DEMONSTRATIONS + [Origin.TAKEOVER] * TAKEOVERS
    )
    demonstrations = load([shown]).demonstrations
    assert {one.row_kind for one in demonstrations} == {RowKind.SAMPLE}
    assert [one.before for one in demonstrations[:DEMONSTRATIONS]] == [{}] * DEMONSTRATIONS
    for one in demonstrations[DEMONSTRATIONS:]:
        assert one.before == {"action": "left"}
        assert one.actions == ("right",)
        # The person drives on to the end.
        assert one.states[0, 0] < TOO_EARLY < RIGHT - 3 * SPEED < one.states[-1, 0]


def test_the_first_row_of_a_takeover_has_no_previous_action(shown: Path) -> None:
    table = table_of(shown)
    first = first_rows(table)
    assert table.previous[first].tolist() == [NO_ACTION] * (DEMONSTRATIONS + TAKEOVERS)
    assert (table.previous == NO_ACTION).sum() == len(first)
    lat = [NO_ACTION] * DEMONSTRATIONS + [table.actions.index("left")] * TAKEOVERS
    assert table.last[first].tolist() == lat


def test_takeovers_do_not_poison_what_is_learned(shown: Path) -> None:
    assert success(rebt_ros.learn([shown]).learned) >= 0.95


def test_with_what_the_robot_did_as_the_previous_action_they_would_poison_it(shown: Path) -> None:
    table = table_of(shown)
    previous = table.previous.copy()
    assert table.before is not None
    previous[first_rows(table)] = table.before
    assert success(learn_from(replace(table, previous=previous)).learned) < 0.9


def test_a_takeover_that_did_not_help_is_not_learned_from(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    for seed in range(DEMONSTRATIONS):
        desk.show(seed)
    for seed in range(100, 104):
        desk.stop_and_show(seed)
    assert origins(tmp_path) == [Origin.DEMONSTRATION] * DEMONSTRATIONS + [Origin.FAILED] * 4
    assert len(list(tmp_path.glob("*.failed"))) == 4
    assert table_of(tmp_path).actions == ("left", "right")
    assert success(rebt_ros.learn([tmp_path]).learned) >= 0.95
