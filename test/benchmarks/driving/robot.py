"""The demo's robot, which drives to its goal around obstacles and charges its battery."""

from __future__ import annotations

from driving.task import State
from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.episode import Episode
from rebt_ros.simulated_robot.robot import Action, Robot
from rebt_ros.simulated_robot.robot import State as Measured
from rebt_ros.simulated_robot.world import furnished_room

#: Simulated seconds.
_TIME_LIMIT = 60.0


class Drive:
    """To the goal within a minute, by way of the dock where the battery is low."""

    name = "robot"
    features = Measured._fields
    actions = tuple(map(str, Action))
    needs_memory = False

    def __init__(self) -> None:
        self._world = furnished_room()

    def reset(self, seed: int) -> State:
        self._robot = Robot(self._world, seed)
        self._episode = Episode(self._robot, _TIME_LIMIT)
        self._measured = self._robot.state
        return tuple(self._measured)

    def step(self, action: str) -> State:
        self._episode.step(action)
        self._measured = self._robot.state
        return tuple(self._measured)

    @property
    def over(self) -> bool:
        return self._episode.over

    @property
    def success(self) -> bool:
        return self._robot.reached

    def expert(self) -> str:
        return str(decide(self._measured))
