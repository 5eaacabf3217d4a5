"""One run of the robot, from its start to its end."""

from __future__ import annotations

from dataclasses import dataclass

from rebt_ros.simulated_robot.robot import TIME_STEP, Robot, Velocity


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """How a run ended."""

    start: int
    reached: bool
    """Whether the goal was reached; otherwise the battery was empty or the time was up."""
    seconds: float
    """Simulated."""
    bumps: int
    """How often the robot drove against something."""
    battery: float
    """Charge that was left, 0..1."""


class Episode:
    """A run under way.

    Args:
        robot: Stands at a start.
        time_limit: Simulated seconds after which the run is lost.
        time_step: Simulated seconds of a step.
    """

    def __init__(self, robot: Robot, time_limit: float, time_step: float = TIME_STEP) -> None:
        self.robot = robot
        self._time_limit = time_limit
        self._time_step = time_step
        self._steps = 0

    @property
    def seconds(self) -> float:
        """Simulated seconds since the start."""
        return self._steps * self._time_step

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        robot = self.robot
        return robot.reached or robot.battery <= 0 or self.seconds >= self._time_limit

    @property
    def result(self) -> EpisodeResult:
        """How it stands, and once it is over, how it ended."""
        robot = self.robot
        return EpisodeResult(
            robot.start,
            robot.reached,
            round(self.seconds, 3),
            robot.bumps,
            round(robot.battery, 3),
        )

    def step(self, command: str | Velocity | None) -> None:
        """Lets one time step pass."""
        self.robot.step(command, self._time_step)
        self._steps += 1
