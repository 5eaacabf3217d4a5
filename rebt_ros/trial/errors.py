"""Why a trial cannot go on."""

from __future__ import annotations

from rebt_ros.errors import RebtError


class TrialError(RebtError):
    """Executor, robot or world do not do what a trial needs."""
