"""Tasks of machines that switch, wait and sort."""

from __future__ import annotations

import math
from typing import ClassVar

from driving.scripted import Scripted
from driving.task import State


class Pendulum(Scripted):
    """Swings a pendulum up, brakes where it has too much energy, and holds it for 40 steps."""

    name = "pendulum"
    features = ("cos", "sin", "speed")
    actions = ("left", "none", "right")
    most_steps = 300

    _TORQUES: ClassVar = {"left": -2.0, "none": 0.0, "right": 2.0}
    _STEP, _FASTEST = 0.025, 8.0
    _UPRIGHT, _LONG_ENOUGH = 0.35, 40

    def _begin(self) -> None:
        self._angle = math.pi + self._chance.uniform(-0.8, 0.8)
        self._speed = self._chance.uniform(-1, 1)
        self._held = 0

    @property
    def _state(self) -> State:
        return (
            round(math.cos(self._angle), 4),
            round(math.sin(self._angle), 4),
            round(self._speed, 4),
        )

    def _act(self, action: str) -> None:
        for _ in range(2):
            pull = 15 * math.sin(self._angle) + 3 * self._TORQUES[action]
            speed = self._speed + pull * self._STEP
            self._speed = max(-self._FASTEST, min(self._FASTEST, speed))
            self._angle += self._speed * self._STEP
        upright = abs(math.remainder(self._angle, 2 * math.pi)) < self._UPRIGHT
        self._held = self._held + 1 if upright else 0
        self._done = self._held >= self._LONG_ENOUGH

    def expert(self) -> str:
        height, side, speed = map(float, self._state)
        if height > 0.93:
            falls = 4 * side + speed
            return "left" if falls > 0.25 else "right" if falls < -0.25 else "none"
        energy = speed * speed / 2 + 15 * (height - 1)
        with_it, against_it = ("right", "left") if speed > 0 else ("left", "right")
        return against_it if energy > 0.3 else with_it


class Thermostat(Scripted):
    """Heats below 18 degrees, until there are 22, and does not switch all the time."""

    name = "thermostat"
    features = ("temperature", "outside")
    actions = ("off", "heat")
    needs_memory = True
    most_steps = 301

    _ENOUGH, _WARMED_UP, _MOST_SWITCHES = 300, 40, 60

    def _begin(self) -> None:
        self._temperature = self._chance.uniform(12, 26)
        self._outside = self._chance.uniform(0, 12)
        self._switches, self._last, self._heats = 0, "off", False

    @property
    def _state(self) -> State:
        return round(self._temperature, 2), round(self._outside, 2)

    def _act(self, action: str) -> None:
        loss = 0.03 * (self._temperature - self._outside)
        self._temperature += (0.9 if action == "heat" else 0.0) - loss
        self._switches += action != self._last
        self._last = action
        comfortable = self._steps <= self._WARMED_UP or 17 < self._temperature < 23
        self._failed = not comfortable or self._switches > self._MOST_SWITCHES
        self._done = self._steps >= self._ENOUGH

    def expert(self) -> str:
        self._heats = self._temperature < 18 or (self._heats and self._temperature <= 22)
        return "heat" if self._heats else "off"


class Elevator(Scripted):
    """Calls the elevator, waits, enters, rides to the floor that is wanted, and leaves."""

    name = "elevator"
    features = ("floor", "wanted", "car", "open", "inside")
    actions = ("wait", "call", "enter", "press", "leave")
    needs_memory = True
    most_steps = 80

    _FLOORS, _MOST_PRESSES = 7, 4

    def _begin(self) -> None:
        self._floor, self._wanted = self._chance.sample(range(self._FLOORS), 2)
        self._car = self._chance.randrange(self._FLOORS)
        self._open = self._inside = False
        self._called_to: int | None = None
        self._presses = 0

    @property
    def _state(self) -> State:
        floors = (self._floor, self._wanted, self._car)
        return *map(float, floors), float(self._open), float(self._inside)

    def _act(self, action: str) -> None:
        if action == ("press" if self._inside else "call"):
            self._called_to = self._wanted if self._inside else self._floor
            self._presses += 1
        elif action == "enter" and self._open and self._car == self._floor:
            self._inside = True
        elif action == "leave" and self._inside and self._open:
            self._inside = False
            self._done = self._floor == self._wanted
            self._failed = not self._done
        self._failed = self._failed or self._presses > self._MOST_PRESSES
        self._ride()

    def _ride(self) -> None:
        if self._called_to is None:
            return
        if self._car == self._called_to:
            self._open, self._called_to = True, None
            return
        self._open = False
        self._car += 1 if self._called_to > self._car else -1
        if self._inside:
            self._floor = self._car

    def expert(self) -> str:
        if self._open and self._inside and self._floor == self._wanted:
            return "leave"
        if self._open and not self._inside and self._car == self._floor:
            return "enter"
        if self._called_to is not None:
            return "wait"
        return "press" if self._inside else "call"


class Sorter(Scripted):
    """Brings four parts from a belt to the bins of their colors, which stand anywhere."""

    name = "sorter"
    features = ("place", "belt", "held", "red_bin", "blue_bin", "green_bin")
    actions = ("left", "right", "pick", "drop")
    most_steps = 120

    _COLORS, _PLACES, _PARTS = ("red", "blue", "green"), 7, 4

    def _begin(self) -> None:
        places = self._chance.sample(range(1, self._PLACES), len(self._COLORS))
        self._bins = dict(zip(self._COLORS, places, strict=True))
        self._place = self._chance.randrange(self._PLACES)
        self._belt = self._chance.choices(self._COLORS, k=self._PARTS)
        self._held = "nothing"

    @property
    def _state(self) -> State:
        belt = self._belt[0] if self._belt else "nothing"
        return float(self._place), belt, self._held, *map(float, self._bins.values())

    def _act(self, action: str) -> None:
        way = {"left": -1, "right": 1}.get(action, 0)
        self._place = min(max(self._place + way, 0), self._PLACES - 1)
        if action == "pick" and self._place == 0 and self._held == "nothing" and self._belt:
            self._held = self._belt.pop(0)
        elif action == "drop" and self._held != "nothing":
            self._failed = self._place != self._bins[self._held]
            self._held = "nothing"
            self._done = not self._belt

    def expert(self) -> str:
        if self._held == "nothing":
            return "left" if self._place > 0 else "pick"
        goal = self._bins[self._held]
        return "drop" if self._place == goal else "right" if goal > self._place else "left"


class Crossing(Scripted):
    """Walks up to a road, and crosses it where the next car takes more than 13 steps to come."""

    name = "crossing"
    features = ("edge", "car_distance", "car_speed")
    actions = ("wait", "walk")
    most_steps = 300

    _WIDTH, _PACE, _SIGHT = 2.0, 0.2, 40.0

    def _begin(self) -> None:
        self._crossed = self._chance.uniform(-3, -1)
        self._next_car()

    def _next_car(self) -> None:
        self._distance = self._chance.uniform(4, self._SIGHT)
        self._speed = self._chance.uniform(0.3, 1.5)

    @property
    def _state(self) -> State:
        return round(-self._crossed, 3), round(self._distance, 3), round(self._speed, 3)

    def _act(self, action: str) -> None:
        self._crossed += self._PACE if action == "walk" else 0.0
        self._distance -= self._speed
        on_the_road = 0 < self._crossed < self._WIDTH
        if self._distance < 0:
            self._failed = on_the_road
            self._next_car()
        self._done = self._crossed >= self._WIDTH

    def expert(self) -> str:
        waits = -self._PACE <= self._crossed <= 0 and self._distance <= 13 * self._speed
        return "wait" if waits else "walk"
