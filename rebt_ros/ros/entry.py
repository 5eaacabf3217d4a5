"""Where the process of a node begins: signals are heard before anything slow is imported.

The executables that setup.py installs for the nodes block SIGINT and SIGTERM until then, so that
one which comes while Python itself starts waits for this module instead of ending the process with
a traceback.  ``python -m rebt_ros.ros.entry recorder`` begins the same way, without the blocking.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys

from rebt_ros import streams

STOP_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})
"""What ends a node, in order and with exit code 0."""

_MODULES = {
    "demonstrator": "robots.demonstrator",
    "executor": "executor.node",
    "learner": "learner.node",
    "recorder": "recorder.node",
    "robot": "robots.robot",
    "studio": "studio.node",
    "synthetic_robot": "robots.synthetic_robot",
}
NODES = tuple(_MODULES)


def demonstrator() -> None:
    """Runs the scripted demonstrator."""
    _run("demonstrator")


def executor() -> None:
    """Runs the executor."""
    _run("executor")


def learner() -> None:
    """Runs the learner."""
    _run("learner")


def recorder() -> None:
    """Runs the recorder."""
    _run("recorder")


def robot() -> None:
    """Runs the simulated robot."""
    _run("robot")


def studio() -> None:
    """Runs the studio."""
    _run("studio")


def synthetic_robot() -> None:
    """Runs the synthetic robot."""
    _run("synthetic_robot")


def _run(node: str) -> None:
    for one in STOP_SIGNALS:
        signal.signal(one, _leave)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    streams.prepare()
    try:
        importlib.import_module(f"rebt_ros.ros.{_MODULES[node]}").main()
    finally:
        # Python gives handled signals their default effect, death, before it has ended.
        for one in STOP_SIGNALS:
            signal.signal(one, signal.SIG_IGN)


def _leave(*_: object) -> None:
    """Ends the process at once: nothing has been opened yet, or everything is closed again."""
    os._exit(0)


if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in NODES:
        sys.argv[:2] = [sys.argv[1]]
        _run(sys.argv[0])
    else:
        sys.exit(f"name the node to run: {', '.join(NODES)}.")
