"""SIGINT and SIGTERM at any moment of a node's life: exit code 0, no traceback, no process left.

REBT_ROS_SIGNALS=200 in the environment makes it a campaign: so many moments for each node and
signal instead of a few.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from ros_processes import NodeProcess, command_of, own_domain, wait_until

from rebt_ros.ros.entry import NODES
from rebt_ros.study.simulator.configuration import Act, Check, Group, GroupKind
from rebt_ros.study.simulator.configuration_file import format_config

MOMENTS = int(os.environ.get("REBT_ROS_SIGNALS", "2"))

#: Until when a node is surely at work, on a machine that has nothing else to do (seconds).
AT_WORK = 1.5


def _installed(node: str) -> Path | None:
    """The executable that ``ros2 run`` starts, if the package is installed."""
    # Without a sourced workspace there is no index to look it up in, which is another error.
    with contextlib.suppress(PackageNotFoundError, OSError):
        return Path(get_package_prefix("rebt_ros")) / "lib" / "rebt_ros" / node
    return None


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    with own_domain() as number:
        yield number


def _start(node: str, domain: int, directory: Path) -> NodeProcess:
    executable = _installed(node)
    command = [str(executable)] if executable else command_of(node)
    parameters = {}
    if node == "synthetic_robot":
        parameters["config"] = directory / "tree.json"
        tree = Group(GroupKind.SEQUENCE, (Check("/x", 0.5), Act("go")))
        parameters["config"].write_text(format_config(tree))
    return NodeProcess(node, domain, directory, parameters, command=command)


def _wait_for_moment(seconds: float, process: NodeProcess) -> None:
    end = time.monotonic() + seconds
    wait_until(lambda: time.monotonic() >= end or process.process.poll() is not None)


def _left_behind(process: NodeProcess) -> list[str]:
    """What still runs of the session that the node began."""
    found = []
    for directory in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, _, _, session, *_ = (
                (directory / "stat").read_text().rpartition(")")[2].split(maxsplit=4)
            )
            if session == str(process.process.pid) and state != "Z":
                found.append((directory / "cmdline").read_text().replace("\0", " "))
    return found


def _ended_in_order(process: NodeProcess) -> None:
    code = process.wait()
    assert (code, "Traceback" in process.stderr) == (0, False), process.stderr
    wait_until(lambda: not _left_behind(process), what="the end of all that the node started")


def _moments(node: str, number: signal.Signals) -> Iterator[float]:
    """At once, half of them while Python and the node start, the others whenever."""
    chance = random.Random(f"{node} {number} {os.environ.get('REBT_ROS_SEED', '0')}")
    yield 0.0
    for place in range(MOMENTS):
        yield chance.uniform(0.0, AT_WORK if place % 2 else AT_WORK / 5)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("node", NODES)
def test_a_signal_at_any_moment_ends_a_node_in_order(
    node: str, number: signal.Signals, domain: int, tmp_path: Path
) -> None:
    for moment in _moments(node, number):
        with _start(node, domain, tmp_path) as process:
            process.hears(number)
            _wait_for_moment(moment, process)
            process.process.send_signal(number)
            _ended_in_order(process)


def test_a_node_that_was_started_to_ignore_sigint_ends_by_it_all_the_same(
    domain: int, tmp_path: Path
) -> None:
    """As in a script's background job, where a launch stops its nodes by SIGINT."""
    ignoring = ["/usr/bin/env", "--ignore-signal=INT", *command_of("recorder")]
    with NodeProcess("recorder_node", domain, tmp_path, command=ignoring) as process:
        process.catches(signal.SIGINT)
        process.process.send_signal(signal.SIGINT)
        _ended_in_order(process)


@pytest.mark.parametrize("node", NODES)
def test_a_hail_of_signals_ends_a_node_in_order(node: str, domain: int, tmp_path: Path) -> None:
    chance = random.Random(f"{node} {os.environ.get('REBT_ROS_SEED', '0')}")
    for _ in range(max(MOMENTS // 2, 1)):
        with _start(node, domain, tmp_path) as process:
            process.hears(signal.SIGTERM)
            process.hears(signal.SIGINT)
            _wait_for_moment(chance.uniform(0.0, AT_WORK), process)
            while process.process.poll() is None:
                process.process.send_signal(chance.choice((signal.SIGINT, signal.SIGTERM)))
                _wait_for_moment(chance.expovariate(1000.0), process)
            _ended_in_order(process)
