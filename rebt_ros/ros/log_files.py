"""Log files of nodes, where there may be no home or no room for them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path


def arguments_for_logging(arguments: Sequence[str]) -> list[str]:
    """The arguments with which `rclpy.init` finds a place for log files, or does without.

    It fails where it cannot tell the home, or cannot write there.  Where ``HOME`` is not set, the
    system may still know it.

    Args:
        arguments: Command line, the program's name included.
    """
    try:
        directory = _directory()
        directory.mkdir(parents=True, exist_ok=True)
        if not os.access(directory, os.W_OK):
            raise PermissionError(directory)
    except (OSError, RuntimeError):
        return [*arguments, "--ros-args", "--disable-external-lib-logs"]
    os.environ["ROS_LOG_DIR"] = str(directory)
    return list(arguments)


def _directory() -> Path:
    """Where ROS keeps log files: see ``rcl_logging_get_logging_directory``.

    Raises:
        RuntimeError: There is no home.
    """
    if given := os.environ.get("ROS_LOG_DIR"):
        return Path(given).expanduser()
    return (Path(os.environ.get("ROS_HOME") or "~/.ros") / "log").expanduser()
