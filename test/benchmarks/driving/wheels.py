"""Tasks of robots on wheels, which turn and drive on a plane."""

from __future__ import annotations

import math
from typing import ClassVar

from driving.scripted import Scripted
from driving.task import State

_Point = tuple[float, float]


def _turned(angle: float) -> float:
    """An angle within -pi..pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def _steering(bearing: float, tolerance: float) -> str:
    """Turns towards a bearing, and drives once it is close to that."""
    if abs(bearing) <= tolerance:
        return "forward"
    return "left" if bearing > 0 else "right"


class _Wheels(Scripted):
    """A robot with a position and a heading."""

    def _stand(self, x: float, y: float, heading: float) -> None:
        self._x, self._y, self._heading = x, y, heading

    def _move(self, forward: float, turn: float) -> None:
        self._heading = _turned(self._heading + turn)
        self._x += forward * math.cos(self._heading)
        self._y += forward * math.sin(self._heading)

    def _seen(self, place: _Point) -> tuple[float, float]:
        """How far away a place is, and its bearing."""
        x, y = place[0] - self._x, place[1] - self._y
        return round(math.hypot(x, y), 3), round(_turned(math.atan2(y, x) - self._heading), 3)


class Wall(_Wheels):
    """Follows the wall on its right for a lap, past a corner that stands out and into a bay."""

    name = "wall"
    features = ("front", "front_right", "right", "left")
    actions = ("forward", "left", "right")
    most_steps = 700

    _CORNERS = ((0, 0), (6, 0), (6, 2), (7.5, 2), (7.5, 5), (3, 5), (3, 6.5), (0, 6.5))
    _MIDDLE: _Point = (3.5, 3)
    _SECTORS = (0.0, -math.pi / 4, -math.pi / 2, math.pi / 2)
    _BEAMS = (-0.3, -0.15, 0.0, 0.15, 0.3)
    _RANGE, _RADIUS = 5.0, 0.15
    _SPEEDS: ClassVar = {"forward": (0.1, 0.0), "left": (0.03, 0.2), "right": (0.06, -0.2)}

    def _begin(self) -> None:
        x, y = self._chance.uniform(1.5, 4.5), self._chance.uniform(0.5, 0.9)
        self._stand(x, y, self._chance.uniform(-0.4, 0.4))
        self._lap = 0.0

    @property
    def _state(self) -> State:
        return tuple(
            round(min(self._range(sector + beam) for beam in self._BEAMS), 3)
            for sector in self._SECTORS
        )

    def _act(self, action: str) -> None:
        forward, turn = self._SPEEDS[action]
        before = self._around
        self._move(forward, turn + self._chance.gauss(0, 0.02))
        self._lap += _turned(self._around - before)
        nearest = min(self._range(beam * math.pi / 8) for beam in range(16))
        self._failed = nearest < self._RADIUS
        self._done = self._lap > 2 * math.pi

    @property
    def _around(self) -> float:
        return math.atan2(self._y - self._MIDDLE[1], self._x - self._MIDDLE[0])

    def _range(self, bearing: float) -> float:
        """How far away the wall is."""
        angle = self._heading + bearing
        along, across = math.cos(angle), math.sin(angle)
        nearest = self._RANGE
        for (x, y), (end_x, end_y) in zip(
            self._CORNERS, (*self._CORNERS[1:], self._CORNERS[0]), strict=True
        ):
            wall_x, wall_y = end_x - x, end_y - y
            parallel = across * wall_x - along * wall_y
            if abs(parallel) < 1e-9:
                continue
            to_x, to_y = x - self._x, y - self._y
            distance = (to_y * wall_x - to_x * wall_y) / parallel
            share = (along * to_y - across * to_x) / parallel
            if distance > 0 and 0 <= share <= 1:
                nearest = min(nearest, distance)
        return nearest

    def expert(self) -> str:
        front, front_right, right, _ = map(float, self._state)
        if front < 0.7 or front_right < 0.5 or right < 0.35:
            return "left"
        return "right" if front_right > 0.9 or right > 0.7 else "forward"


class Vacuum(_Wheels):
    """Cleans six spots; below a fifth of the battery it docks, and stays until that is full."""

    name = "vacuum"
    features = (
        "battery",
        "spot_distance",
        "spot_bearing",
        "dock_distance",
        "dock_bearing",
        "docked",
    )
    actions = ("left", "right", "forward", "clean", "charge")
    needs_memory = True
    most_steps = 600

    _DOCK: _Point = (0.0, 0.0)
    _ROOM, _SPOTS, _NEAR = 5.0, 6, 0.3
    _LOW, _FULL = 0.2, 0.95

    def _begin(self) -> None:
        self._stand(*self._anywhere(), self._chance.uniform(-3, 3))
        self._battery = self._chance.uniform(0.25, 0.9)
        self._spots = [self._anywhere() for _ in range(self._SPOTS)]
        self._charging = False

    def _anywhere(self) -> _Point:
        return self._chance.uniform(0, self._ROOM), self._chance.uniform(0, self._ROOM)

    @property
    def _state(self) -> State:
        dock = self._seen(self._DOCK)
        return round(self._battery, 3), *self._spot, *dock, float(dock[0] < self._NEAR)

    @property
    def _spot(self) -> tuple[float, float]:
        return self._seen(self._spots[0]) if self._spots else (9.0, 0.0)

    def _act(self, action: str) -> None:
        self._battery -= 0.004
        turn = {"left": 0.25, "right": -0.25}.get(action, 0.0)
        self._move(0.15 if action == "forward" else 0.0, turn)
        if action == "clean" and self._spot[0] < self._NEAR:
            del self._spots[0]
        elif action == "charge" and self._seen(self._DOCK)[0] < self._NEAR:
            self._battery = min(self._battery + 0.05, 1.0)
        self._done = not self._spots
        self._failed = self._battery <= 0

    def expert(self) -> str:
        self._charging = self._battery < self._LOW or (
            self._charging and self._battery <= self._FULL
        )
        distance, bearing = self._seen(self._DOCK) if self._charging else self._spot
        if distance < 0.28:
            return "charge" if self._charging else "clean"
        return _steering(bearing, 0.3)


class Parking(_Wheels):
    """Stops in a slot, along it: drives along a curve, and straightens out at its end."""

    name = "parking"
    features = ("distance", "bearing", "heading")
    actions = ("forward", "left", "right", "stop")
    most_steps = 200

    def _begin(self) -> None:
        x, y = self._chance.uniform(-6, -3), self._chance.uniform(-1.5, 1.5)
        self._stand(x, y, self._chance.uniform(-0.6, 0.6))

    @property
    def _state(self) -> State:
        return *self._seen((0.0, 0.0)), round(self._heading, 3)

    def _act(self, action: str) -> None:
        if action == "stop":
            distance, _ = self._seen((0.0, 0.0))
            self._done = distance < 0.45 and abs(self._heading) < 0.35
            self._failed = not self._done
            return
        self._move(0.12, {"left": 0.15, "right": -0.15}.get(action, 0.0))
        self._failed = self._x > 1.5

    def expert(self) -> str:
        distance, bearing, heading = map(float, self._state)
        if distance < 0.4:
            return "stop"
        if distance < 0.9:
            return _steering(-heading, 0.12)
        return _steering(1.8 * bearing + 0.8 * heading, 0.15)


class Follow(_Wheels):
    """Keeps 0.8 to 1.4 m behind a person, and turns to the side on which it lost them."""

    name = "follow"
    features = ("distance", "bearing", "visible")
    actions = ("stay", "forward", "back", "left", "right")
    needs_memory = True
    most_steps = 301

    _ENOUGH, _FIELD_OF_VIEW = 300, 1.0
    _NEAREST, _FARTHEST, _LOST = 0.3, 3.5, 50

    def _begin(self) -> None:
        self._stand(0.0, 0.0, self._chance.uniform(-3, 3))
        angle = self._heading + self._chance.uniform(-2.5, 2.5)
        self._person: _Point = (1.5 * math.cos(angle), 1.5 * math.sin(angle))
        self._speed, self._course = 0.03, self._chance.uniform(-3, 3)
        self._side, self._unseen = "left", 0

    @property
    def _state(self) -> State:
        distance, bearing = self._seen(self._person)
        visible = abs(bearing) <= self._FIELD_OF_VIEW
        return (distance, bearing, 1.0) if visible else (0.0, 0.0, 0.0)

    def _act(self, action: str) -> None:
        self._walk()
        turn = {"left": 0.15, "right": -0.15}.get(action, 0.0)
        self._move({"forward": 0.1, "back": -0.1}.get(action, 0.0), turn)
        distance, bearing = self._seen(self._person)
        self._unseen = self._unseen + 1 if abs(bearing) > self._FIELD_OF_VIEW else 0
        near = self._NEAREST <= distance <= self._FARTHEST
        self._failed = not near or self._unseen > self._LOST
        self._done = self._steps >= self._ENOUGH

    def _walk(self) -> None:
        if self._chance.random() < 0.03:
            self._speed = self._chance.choice((0.0, 0.03, 0.06))
        self._course += self._chance.gauss(0, 0.1)
        x, y = self._person
        if math.hypot(x, y) > 6:
            self._course = math.atan2(-y, -x)
        self._person = (
            x + self._speed * math.cos(self._course),
            y + self._speed * math.sin(self._course),
        )

    def expert(self) -> str:
        distance, bearing, visible = map(float, self._state)
        if visible and abs(bearing) <= 0.3:
            return "forward" if distance > 1.4 else "back" if distance < 0.8 else "stay"
        if visible:
            self._side = "left" if bearing > 0 else "right"
        return self._side


class Fetch(_Wheels):
    """Looks round for a beacon, picks it up and brings it to the base; picking sometimes fails."""

    name = "fetch"
    features = (
        "sees_beacon",
        "beacon_bearing",
        "beacon_distance",
        "holding",
        "base_bearing",
        "base_distance",
        "front",
    )
    actions = ("turn", "left", "right", "forward", "pick", "drop")
    most_steps = 250

    _FIELD_OF_VIEW, _WALLS = 0.6, 4.5

    def _begin(self) -> None:
        x, y = self._chance.uniform(-2, 2), self._chance.uniform(-2, 2)
        self._stand(x, y, self._chance.uniform(-3, 3))
        self._beacon, self._base = self._anywhere(), self._anywhere()
        self._holding = False

    def _anywhere(self) -> _Point:
        return self._chance.uniform(-4, 4), self._chance.uniform(-4, 4)

    @property
    def _state(self) -> State:
        distance, bearing = self._seen(self._beacon)
        to_base, base_bearing = self._seen(self._base)
        sees = not self._holding and abs(bearing) < self._FIELD_OF_VIEW
        return (
            float(sees),
            bearing if sees else 0.0,
            distance if sees else 0.0,
            float(self._holding),
            base_bearing,
            to_base,
            round(self._WALLS - max(abs(self._x), abs(self._y)), 3),
        )

    def _act(self, action: str) -> None:
        turn = {"turn": 0.4, "left": 0.15, "right": -0.15}.get(action, 0.0)
        self._move(0.12 if action == "forward" else 0.0, turn)
        if action == "pick" and self._seen(self._beacon)[0] < 0.35:
            self._holding = self._holding or self._chance.random() < 0.8
        elif action == "drop" and self._holding:
            self._done = self._seen(self._base)[0] < 0.4
            self._failed = not self._done

    def expert(self) -> str:
        sees, bearing, distance, holding, base_bearing, to_base, _ = map(float, self._state)
        if holding:
            if to_base < 0.35:
                return "drop"
            return "turn" if abs(base_bearing) > 1.0 else _steering(base_bearing, 0.15)
        if not sees:
            return "turn"
        return "pick" if distance < 0.3 else _steering(bearing, 0.15)
