"""Tasks on grids, of gymnasium and MiniGrid; their experts plan the shortest way at every step."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, ClassVar, NamedTuple

import minigrid  # noqa: F401 - registers its environments
import numpy as np

from driving.control import newest
from driving.planning import shortest_plan
from driving.task import State


class _Table:
    """An environment of numbered states whose transitions are known."""

    actions: ClassVar[tuple[str, ...]]
    needs_memory = False
    most_steps = 60

    _environment: Any

    def reset(self, seed: int) -> State:
        self._environment.reset(seed=seed)
        self._place = int(self._environment.s)
        self._steps, self._done, self._failed = 0, False, False
        return self._state

    @property
    def _state(self) -> State:
        raise NotImplementedError

    def step(self, action: str) -> State:
        number = self.actions.index(action)
        place, reward, ended, _, _ = self._environment.step(number)
        self._place = int(place)
        self._steps += 1
        self._done = ended and reward > 0
        self._failed = ended and reward <= 0
        return self._state

    @property
    def over(self) -> bool:
        return self._done or self._failed or self._steps >= self.most_steps

    @property
    def success(self) -> bool:
        return self._done

    def expert(self) -> str:
        """The first action of a shortest plan; the goal is beyond the last place."""
        table = self._environment.P

        def ways(place: int) -> Iterator[tuple[str, int]]:
            for number, action in enumerate(self.actions):
                [(_, after, reward, ended)] = table[place][number]
                if not ended:
                    yield action, int(after)
                elif reward > 0:
                    yield action, _DONE

        plan = shortest_plan(self._place, ways, lambda place: place == _DONE)
        return plan[0] if plan else self.actions[0]


_DONE = -1


class Ice(_Table):
    """FrozenLake without slipping, 8 by 8, from anywhere on the ice."""

    name = "ice"
    features = ("row", "column")
    actions = ("west", "south", "east", "north")

    def __init__(self) -> None:
        self._environment = newest("FrozenLake8x8", is_slippery=False)
        ice = np.isin(self._environment.desc.ravel(), (b"S", b"F"))
        self._starts = np.flatnonzero(ice).tolist()

    def reset(self, seed: int) -> State:
        super().reset(seed)
        self._place = self._environment.s = random.Random(seed).choice(self._starts)
        return self._state

    @property
    def _state(self) -> State:
        row, column = divmod(self._place, 8)
        return float(row), float(column)


class Taxi(_Table):
    """Fetches a passenger and takes them where they want, within 60 steps."""

    name = "taxi"
    features = ("row", "column", "passenger", "destination")
    actions = ("south", "north", "east", "west", "pick_up", "drop_off")

    _PLACES = ("red", "green", "yellow", "blue", "taxi")

    def __init__(self) -> None:
        self._environment = newest("Taxi")

    @property
    def _state(self) -> State:
        row, column, passenger, destination = self._environment.decode(self._place)
        return float(row), float(column), self._PLACES[passenger], self._PLACES[destination]


class Pose(NamedTuple):
    """What an agent on a grid can change."""

    x: int
    y: int
    heading: int
    """0 to 3: east, south, west, north."""
    has_key: bool
    opened: bool


class _Grid:
    """A room of MiniGrid, seen from its agent: cells ahead of it and to its right."""

    environment: ClassVar[str]
    actions: ClassVar[tuple[str, ...]]
    needs_memory = False
    most_steps: ClassVar[int]

    def __init__(self) -> None:
        self._world: Any = newest(self.environment)
        # Pictures of what the agent sees take most of the time, and nobody looks at them.
        self._world.gen_obs = dict

    def reset(self, seed: int) -> State:
        # It prints that it could not place something and tries again.
        with redirect_stdout(StringIO()):
            self._world.reset(seed=seed)
        self._steps, self._done = 0, False
        self._goal, self._door = self._find("goal"), self._find("door")
        return self._state

    @property
    def _state(self) -> State:
        raise NotImplementedError

    def step(self, action: str) -> State:
        number = getattr(self._world.actions, action)
        _, _, self._done, _, _ = self._world.step(number)
        self._steps += 1
        return self._state

    @property
    def over(self) -> bool:
        return self._done or self._steps >= self.most_steps

    @property
    def success(self) -> bool:
        return self._done

    def _find(self, kind: str) -> tuple[int, int] | None:
        for x in range(self._world.width):
            for y in range(self._world.height):
                cell = self._world.grid.get(x, y)
                if cell is not None and cell.type == kind:
                    return x, y
        return None

    def _seen(self, place: tuple[int, int] | None) -> tuple[float, float]:
        """How far ahead and to the right a place is; 0 and 0 where there is none."""
        if place is None:
            return 0.0, 0.0
        way = np.subtract(place, self._world.agent_pos)
        return float(way @ self._world.dir_vec), float(way @ self._world.right_vec)

    def _beside(self, direction: Any) -> str:
        """What is in the next cell in a direction."""
        cell = self._world.grid.get(*np.add(self._world.agent_pos, direction))
        if cell is None or cell.type == "goal":
            return "free"
        return "open" if cell.type == "door" and cell.is_open else str(cell.type)

    @property
    def _pose(self) -> Pose:
        x, y = map(int, self._world.agent_pos)
        door = self._door and self._world.grid.get(*self._door)
        has_key = self._world.carrying is not None
        return Pose(x, y, int(self._world.agent_dir), has_key, bool(door and door.is_open))

    def expert(self) -> str:
        plan = shortest_plan(self._pose, self._ways, lambda pose: (pose.x, pose.y) == self._goal)
        return plan[0] if plan else self.actions[0]

    def _ways(self, pose: Pose) -> Iterator[tuple[str, Pose]]:
        ahead_x, ahead_y = ((1, 0), (0, 1), (-1, 0), (0, -1))[pose.heading]
        x, y = pose.x + ahead_x, pose.y + ahead_y
        cell = self._world.grid.get(x, y)
        kind = "free" if cell is None else cell.type
        # A key that was taken up has left its cell free.
        passable = {"free", "goal", pose.has_key and "key", pose.opened and "door"}
        if kind in passable:
            yield "forward", pose._replace(x=x, y=y)
        elif kind == "key":
            yield "pickup", pose._replace(has_key=True)
        elif kind == "door" and pose.has_key:
            yield "toggle", pose._replace(opened=True)
        yield "left", pose._replace(heading=(pose.heading - 1) % 4)
        yield "right", pose._replace(heading=(pose.heading + 1) % 4)


class Empty(_Grid):
    """To the corner of an empty room, from anywhere in it."""

    name, environment = "empty", "MiniGrid-Empty-Random-6x6"
    features = ("goal_ahead", "goal_right", "front")
    actions = ("left", "right", "forward")
    most_steps = 40

    @property
    def _state(self) -> State:
        return (*self._seen(self._goal), self._beside(self._world.dir_vec))


class DoorKey(_Grid):
    """Takes a key, opens the door with it and goes to the goal in the other room."""

    name, environment = "doorkey", "MiniGrid-DoorKey-8x8"
    features = (
        "has_key",
        "opened",
        "key_ahead",
        "key_right",
        "door_ahead",
        "door_right",
        "goal_ahead",
        "goal_right",
        "front",
        "left_side",
        "right_side",
    )
    actions = ("left", "right", "forward", "pickup", "toggle")
    most_steps = 120

    @property
    def _state(self) -> State:
        pose, ahead, right = self._pose, self._world.dir_vec, self._world.right_vec
        return (
            float(pose.has_key),
            float(pose.opened),
            *self._seen(self._find("key")),
            *self._seen(self._door),
            *self._seen(self._goal),
            self._beside(ahead),
            self._beside(-right),
            self._beside(right),
        )
