"""Tasks on a line whose states do not tell what to do: it depends on what was done before.

All but `Knock` can be done by who knows the previous action.
"""

from __future__ import annotations

import random
from typing import ClassVar

from driving.task import State


class _Line:
    """A line with a robot on it that moves by steps of varying length."""

    most_steps: ClassVar[int]

    def _begin(self, seed: int) -> None:
        self._chance = random.Random(seed)
        self._steps = 0
        self._failed = False
        self.position = 0.0

    def _move(self, least: float, most: float, direction: int = 1) -> None:
        self.position += direction * self._chance.uniform(least, most)

    def _keep_between(self, west: float, east: float) -> None:
        self.position = min(max(self.position, west), east)

    @property
    def success(self) -> bool:
        raise NotImplementedError

    @property
    def over(self) -> bool:
        return self.success or self._failed or self._steps >= self.most_steps


class Shuttle(_Line):
    """To and fro between the stations at 0 and 6, by way of the one at 3.

    East of the station in the middle the robot creeps when it is loaded, which it is on its way
    east: who drives fast there loses the load.  Nothing but the position is measured.
    """

    name = "shuttle"
    features = ("position",)
    actions = ("east", "creep", "west")
    needs_memory = True
    most_steps = 300

    _MIDDLE, _EAST, _LOST = 3.0, 6.0, 5.0
    _CALLS = 4

    def reset(self, seed: int) -> State:
        self._begin(seed)
        self.position = self._chance.uniform(0.0, 4.0)
        self._eastward, self._calls = True, 0
        return (self.position,)

    def step(self, action: str) -> State:
        self._steps += 1
        if action == "creep":
            self._move(0.12, 0.2)
        else:
            self._move(0.25, 0.45, 1 if action == "east" else -1)
        self._failed = self._eastward and action == "east" and self.position > self._LOST
        self._keep_between(-1.5, 7.5)
        arrived = self.position >= self._EAST if self._eastward else self.position <= 0
        if arrived and not self._failed:
            self._eastward = not self._eastward
            self._calls += 1
        return (self.position,)

    @property
    def success(self) -> bool:
        return self._calls >= self._CALLS

    def expert(self) -> str:
        if not self._eastward:
            return "west"
        return "east" if self.position < self._MIDDLE else "creep"


class Carry(_Line):
    """Picks something up at 2 to 3.2, carries it to the table beyond 5, places it and returns to 0.

    A position sensor and the gripper's switch are all there is.  Gripping and placing sometimes
    fail, and what is placed elsewhere is lost.
    """

    name = "carry"
    features = ("position", "holding")
    actions = ("forward", "back", "pick", "place")
    needs_memory = True
    most_steps = 200

    _SOURCE = (2.0, 3.2)
    _TABLE = 5.0
    #: How far past a border the expert likes to be, and how often gripping and placing work.
    _INSIDE, _WORKS = 0.2, 0.7

    def reset(self, seed: int) -> State:
        self._begin(seed)
        self.position = self._chance.uniform(0.0, 1.5)
        self._holding = self._placed = False
        return self._state

    @property
    def _state(self) -> State:
        return self.position, float(self._holding)

    def step(self, action: str) -> State:
        self._steps += 1
        works = self._chance.random() < self._WORKS
        if action in ("forward", "back"):
            self._move(0.12, 0.28, 1 if action == "forward" else -1)
            self._keep_between(-1.0, 6.5)
        elif action == "pick":
            near = self._SOURCE[0] <= self.position <= self._SOURCE[1]
            self._holding = self._holding or (near and works and not self._placed)
        elif self._holding and works:
            self._holding = False
            self._placed = self.position >= self._TABLE
            self._failed = not self._placed
        return self._state

    @property
    def success(self) -> bool:
        return self._placed and self.position <= 0

    def expert(self) -> str:
        if self._placed:
            return "back"
        if self._holding:
            return "forward" if self.position < self._TABLE + self._INSIDE else "place"
        if self.position > self._SOURCE[1]:
            return "back"
        return "forward" if self.position < self._SOURCE[0] + self._INSIDE else "pick"


class Bell(_Line):
    """Waits until a bell rings, for one step, and then goes to 6; who goes before has failed."""

    name = "bell"
    features = ("position", "ringing")
    actions = ("wait", "go")
    needs_memory = True
    most_steps = 120

    _END = 6.0

    def reset(self, seed: int) -> State:
        self._begin(seed)
        self.position = self._chance.uniform(0.0, 4.0)
        self._rings = self._chance.randint(5, 25)
        return self._state

    @property
    def _state(self) -> State:
        return self.position, float(self._steps == self._rings)

    def step(self, action: str) -> State:
        if action == "go":
            self._failed = self._steps < self._rings
            self._move(0.15, 0.25)
        self._steps += 1
        return self._state

    @property
    def success(self) -> bool:
        return not self._failed and self.position >= self._END

    def expert(self) -> str:
        return "go" if self._steps >= self._rings else "wait"


class Knock(_Line):
    """Goes to the door, knocks three times and enters.

    Who knows the previous action does not know how often the robot has knocked: nothing here
    learns to count.
    """

    name = "knock"
    features = ("position",)
    actions = ("go", "knock", "enter")
    needs_memory = True
    most_steps = 80

    _DOOR, _KNOCKS = 5.0, 3

    def reset(self, seed: int) -> State:
        self._begin(seed)
        self.position = self._chance.uniform(0.0, 3.0)
        self._knocks, self._entered = 0, False
        return (self.position,)

    def step(self, action: str) -> State:
        self._steps += 1
        at_door = self.position >= self._DOOR
        if action == "go":
            self._move(0.15, 0.25)
            self._keep_between(0.0, self._DOOR + 0.3)
        elif action == "knock":
            self._knocks += at_door
        elif at_door:
            self._entered = self._knocks == self._KNOCKS
            self._failed = not self._entered
        return (self.position,)

    @property
    def success(self) -> bool:
        return self._entered

    def expert(self) -> str:
        if self.position < self._DOOR:
            return "go"
        return "knock" if self._knocks < self._KNOCKS else "enter"
