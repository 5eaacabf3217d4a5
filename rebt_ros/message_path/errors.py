"""The error of a message path that cannot be used."""

from __future__ import annotations

from rebt_ros.errors import RebtError


class MessagePathError(RebtError):
    """A message path is malformed or leads to nothing in the messages of its topic."""
