"""Tasks with names of things, angles that wrap around, rare events, and useless sensors."""

from __future__ import annotations

import math
from typing import ClassVar

from driving.scripted import Scripted
from driving.task import State


class Guard(Scripted):
    """Walks up and down, closes a door, raises an alarm, and charges from a quarter to nine tenths.

    The weather does not matter.
    """

    name = "guard"
    features = ("place", "battery", "seen", "door_open", "temperature", "humidity", "light")
    actions = ("forward", "back", "alarm", "close", "charge")
    needs_memory = True
    most_steps = 251

    _ENOUGH, _DOOR, _PATIENCE = 250, 5.0, 90

    def _begin(self) -> None:
        self._place = self._chance.uniform(1, 9)
        self._battery = self._chance.uniform(30, 90)
        self._seen, self._door_open = "nothing", False
        self._since_opened = self._since_seen = 0
        self._way, self._charges = "forward", False
        self._weather = [self._chance.uniform(5, 30), self._chance.uniform(20, 90), 0.0]

    @property
    def _state(self) -> State:
        numbers = (round(self._place, 2), round(self._battery, 1))
        weather = (round(one, 1) for one in self._weather)
        return *numbers, self._seen, float(self._door_open), *weather

    def _act(self, action: str) -> None:
        way = {"forward": 0.4, "back": -0.4}.get(action, 0.0)
        self._place = min(max(self._place + way, 0.0), 10.0)
        charged = 4.0 if action == "charge" and self._place < 0.5 else -0.5
        self._battery = min(self._battery + charged, 100.0)
        if action == "alarm":
            self._failed = self._seen != "person"
            self._seen, self._since_seen = "nothing", 0
        if action == "close" and abs(self._place - self._DOOR) < 0.5:
            self._door_open, self._since_opened = False, 0
        self._since_opened += self._door_open
        self._since_seen += self._seen == "person"
        self._happens()
        late = self._since_opened > self._PATIENCE or self._since_seen > 3
        self._failed = self._failed or late or self._battery <= 0
        self._done = self._steps >= self._ENOUGH

    def _happens(self) -> None:
        chance = self._chance
        self._weather = [one + chance.gauss(0, 1) for one in self._weather]
        self._door_open = self._door_open or chance.random() < 0.02
        if self._seen != "person":
            self._seen = chance.choices(("nothing", "cat", "person"), (90, 8, 2))[0]

    def expert(self) -> str:
        if self._seen == "person":
            return "alarm"
        self._charges = self._battery < 25 or (self._charges and self._battery < 90)
        if self._charges:
            return "charge" if self._place < 0.5 else "back"
        if self._door_open and abs(self._place - self._DOOR) < 0.5:
            return "close"
        if self._place >= 9:
            self._way = "back"
        elif self._place <= 1:
            self._way = "forward"
        return self._way


class Compass(Scripted):
    """Turns the shorter way to a bearing in degrees, and goes there, three times."""

    name = "compass"
    features = ("heading", "bearing", "distance")
    actions = ("left", "right", "forward", "stop")
    most_steps = 250

    _GOALS, _NEAR = 3, 0.4

    def _begin(self) -> None:
        self._x, self._y = 0.0, 0.0
        self._heading = self._chance.uniform(0, 360)
        self._reached = 0
        self._next_goal()

    def _next_goal(self) -> None:
        self._goal = self._chance.uniform(-5, 5), self._chance.uniform(-5, 5)

    @property
    def _to_goal(self) -> tuple[float, float]:
        return self._goal[0] - self._x, self._goal[1] - self._y

    @property
    def _state(self) -> State:
        right, up = self._to_goal
        bearing = math.degrees(math.atan2(up, right)) % 360
        return round(self._heading, 1), round(bearing, 1), round(math.hypot(right, up), 3)

    def _act(self, action: str) -> None:
        self._heading = (self._heading + {"left": 12, "right": -12}.get(action, 0)) % 360
        if action == "forward":
            self._x += 0.3 * math.cos(math.radians(self._heading))
            self._y += 0.3 * math.sin(math.radians(self._heading))
        if action == "stop":
            self._failed = math.hypot(*self._to_goal) >= self._NEAR
            self._reached += 1
            self._done = self._reached >= self._GOALS
            self._next_goal()

    def expert(self) -> str:
        heading, bearing, distance = map(float, self._state)
        if distance < self._NEAR:
            return "stop"
        off = (bearing - heading + 180) % 360 - 180
        return "left" if off > 15 else "right" if off < -15 else "forward"


class Waiter(Scripted):
    """Takes what was ordered from where it stands, and serves it at the table, four times."""

    name = "waiter"
    features = ("x", "y", "carried", "ordered")
    actions = ("up", "down", "left", "right", "take", "serve")
    most_steps = 120

    _SHELVES: ClassVar = {"soup": (0, 0), "salad": (0, 5), "cake": (5, 0), "tea": (3, 5)}
    _TABLE, _SIZE, _ORDERS = (5, 5), 6, 4

    def _begin(self) -> None:
        self._x, self._y = self._chance.randrange(self._SIZE), self._chance.randrange(self._SIZE)
        self._orders = self._chance.choices(list(self._SHELVES), k=self._ORDERS)
        self._carried = "nothing"

    @property
    def _state(self) -> State:
        ordered = self._orders[0] if self._orders else "nothing"
        return float(self._x), float(self._y), self._carried, ordered

    def _act(self, action: str) -> None:
        right = {"left": -1, "right": 1}.get(action, 0)
        up = {"down": -1, "up": 1}.get(action, 0)
        self._x = min(max(self._x + right, 0), self._SIZE - 1)
        self._y = min(max(self._y + up, 0), self._SIZE - 1)
        here = self._x, self._y
        if action == "take" and self._carried == "nothing":
            found = [dish for dish, place in self._SHELVES.items() if place == here]
            self._carried = found[0] if found else "nothing"
        elif action == "serve" and self._carried != "nothing":
            self._failed = here != self._TABLE or self._carried != self._orders.pop(0)
            self._carried = "nothing"
            self._done = not self._orders

    def expert(self) -> str:
        carries = self._carried != "nothing"
        goal = self._TABLE if carries else self._SHELVES[self._orders[0]]
        if self._x != goal[0]:
            return "right" if goal[0] > self._x else "left"
        if self._y != goal[1]:
            return "up" if goal[1] > self._y else "down"
        return "serve" if carries else "take"


class Mower(Scripted):
    """Mows a lawn in lanes, one to the east and the next to the west."""

    name = "mower"
    features = ("x", "y", "width", "depth")
    actions = ("east", "west", "north", "stop")
    needs_memory = True
    most_steps = 150

    def _begin(self) -> None:
        self._width, self._depth = self._chance.randint(4, 9), self._chance.randint(3, 7)
        self._x = self._y = 0
        self._mown = {(0, 0)}
        self._way = "east"

    @property
    def _state(self) -> State:
        return float(self._x), float(self._y), float(self._width), float(self._depth)

    def _act(self, action: str) -> None:
        self._x += {"east": 1, "west": -1}.get(action, 0)
        self._y += action == "north"
        self._failed = not (0 <= self._x < self._width and self._y < self._depth)
        self._mown.add((self._x, self._y))
        if action == "stop":
            self._done = len(self._mown) == self._width * self._depth
            self._failed = not self._done

    def expert(self) -> str:
        end = self._width - 1 if self._way == "east" else 0
        if self._x != end:
            return self._way
        if self._y == self._depth - 1:
            return "stop"
        self._way = "west" if self._way == "east" else "east"
        return "north"


class Belt(Scripted):
    """Pushes heavy and metal parts off a belt as they pass; a dozen sensors tell nothing."""

    name = "belt"
    features = ("position", "weight", "length", "metal", *(f"sensor_{one}" for one in range(12)))
    actions = ("wait", "push")
    most_steps = 400

    _PARTS, _PUSHER = 12, 5.0

    def _begin(self) -> None:
        self._passed = 0
        self._next_part()

    def _next_part(self) -> None:
        self._position = self._chance.uniform(0, 1)
        self._weight, self._length = self._chance.uniform(0, 10), self._chance.uniform(1, 3)
        self._metal = self._chance.random() < 0.25
        self._noise = [self._chance.uniform(0, 1) for _ in range(12)]

    @property
    def _bad(self) -> bool:
        return self._metal or self._weight > 6

    @property
    def _state(self) -> State:
        numbers = round(self._position, 2), round(self._weight, 2), round(self._length, 2)
        return *numbers, float(self._metal), *(round(one, 3) for one in self._noise)

    def _act(self, action: str) -> None:
        if action == "push":
            off = abs(self._position - self._PUSHER) > 0.25
            self._failed = off or not self._bad
        self._position += 0.4
        self._noise = [self._chance.uniform(0, 1) for _ in self._noise]
        if action == "push" or self._position > 8:
            self._failed = self._failed or (self._bad and action != "push")
            self._passed += 1
            self._done = self._passed >= self._PARTS
            self._next_part()

    def expert(self) -> str:
        here = abs(self._position - self._PUSHER) <= 0.2
        return "push" if here and self._bad else "wait"


class Forage(Scripted):
    """Fetches food to a nest, and gives way to a fox that comes by."""

    name = "forage"
    features = ("food_x", "food_y", "nest_x", "nest_y", "fox_x", "fox_y", "carries")
    actions = ("left", "right", "up", "down", "take", "put")
    most_steps = 300

    _PIECES, _NEAR, _AFRAID, _SIGHT = 3, 0.6, 2.0, 9.0
    _WAYS: ClassVar = {
        "left": (-0.5, 0.0),
        "right": (0.5, 0.0),
        "up": (0.0, 0.5),
        "down": (0.0, -0.5),
    }

    def _begin(self) -> None:
        self._me = self._anywhere()
        self._nest, self._food = self._anywhere(), self._anywhere()
        self._next_fox()
        self._carries, self._brought = False, 0

    def _anywhere(self) -> tuple[float, float]:
        return self._chance.uniform(-7, 7), self._chance.uniform(-7, 7)

    def _seen(self, place: tuple[float, float]) -> tuple[float, float]:
        return place[0] - self._me[0], place[1] - self._me[1]

    @property
    def _state(self) -> State:
        places = (*self._seen(self._food), *self._seen(self._nest), *self._seen(self._fox))
        return *(round(one, 2) for one in places), float(self._carries)

    def _act(self, action: str) -> None:
        right, up = self._WAYS.get(action, (0.0, 0.0))
        self._me = self._me[0] + right, self._me[1] + up
        if action == "take" and not self._carries:
            self._carries = math.hypot(*self._seen(self._food)) < self._NEAR
        elif action == "put" and self._carries and math.hypot(*self._seen(self._nest)) < self._NEAR:
            self._carries, self._food = False, self._anywhere()
            self._brought += 1
            self._done = self._brought >= self._PIECES
        self._fox = self._fox[0] + self._fox_way[0], self._fox[1] + self._fox_way[1]
        distance = math.hypot(*self._seen(self._fox))
        self._failed = distance < self._NEAR
        if distance > self._SIGHT:
            self._next_fox()

    def _next_fox(self) -> None:
        """Starts far away, in the direction of where the robot is."""
        angle = self._chance.uniform(0, 2 * math.pi)
        right, up = math.cos(angle), math.sin(angle)
        self._fox = self._me[0] + 8 * right, self._me[1] + 8 * up
        self._fox_way = -0.3 * right, -0.3 * up

    def expert(self) -> str:
        fox = self._seen(self._fox)
        if math.hypot(*fox) < self._AFRAID:
            return self._toward((-fox[0], -fox[1]))
        goal = self._seen(self._nest if self._carries else self._food)
        if math.hypot(*goal) < self._NEAR:
            return "put" if self._carries else "take"
        return self._toward(goal)

    @staticmethod
    def _toward(there: tuple[float, float]) -> str:
        right, up = there
        if abs(right) >= abs(up):
            return "right" if right > 0 else "left"
        return "up" if up > 0 else "down"
