"""Whole runs of the simulated robot."""

from __future__ import annotations

from collections.abc import Callable

from rebt_ros.simulated_robot.episode import Episode, EpisodeResult
from rebt_ros.simulated_robot.robot import Robot

#: Decides from a state what the robot does; None where it has nothing to say.
Policy = Callable[[tuple[float, ...]], str | None]


def run_episode(robot: Robot, policy: Policy, time_limit: float) -> EpisodeResult:
    """Lets a policy drive the robot from where it stands to the end of the run.

    Args:
        robot: Stands at a start.
        policy: Is asked once per time step.
        time_limit: Simulated seconds.
    """
    episode = Episode(robot, time_limit)
    while not episode.over:
        episode.step(policy(robot.state))
    return episode.result
