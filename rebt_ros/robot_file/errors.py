"""The error of a robot file that cannot be used."""

from __future__ import annotations

from rebt_ros.errors import RebtError


class RobotFileError(RebtError):
    """A robot file is malformed, or does not fit the robot or the bag."""
