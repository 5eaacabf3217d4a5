"""``make demo``: a robot is shown a task, learns it, and does it, all through the real nodes.

The simulated robot, the demonstrator, the recorder, the learner and the executor run as processes
of their own and talk over DDS, on a domain of their own.  This command only plays the person who
starts them, calls their services and watches.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import loads
from rebt_ros.commands.shell import aligned, count, directory, parse, run, use_color
from rebt_ros.drawing.svg import render_svg
from rebt_ros.drawing.text import render_text
from rebt_ros.errors import RebtError
from rebt_ros.ros.log_files import arguments_for_logging
from rebt_ros.simulated_robot.demonstrator import ENOUGH
from rebt_ros.storage.atomic import write_text_atomically

#: Starts of the robot that are never shown.
_FRESH_STARTS = 100_000
#: Simulated seconds per second.
_SPEEDUP = 20.0
_WATCHED_SPEEDUP = 4.0
_USUAL_PORT = 8970
#: What the studio says when its page can be opened.
_PAGE = re.compile(r"open (http://\S+) in a browser")
#: Says where features and actions are in the robot's messages, and what labels do.
_ROBOT_FILE = "demo_robot.yaml"
#: Ticks of the executor per simulated second.
_RATE = 20.0
_START_TIMEOUT, _RUN_TIMEOUT, _LEARN_TIMEOUT, _STOP_TIMEOUT = 30.0, 60.0, 120.0, 5.0

T = TypeVar("T")


class DemoError(RebtError):
    """The demonstration cannot go on."""


@dataclass(frozen=True, slots=True)
class Plan:
    """How much to show and to try."""

    demonstrations: int
    trials: int
    out: Path
    plain: bool
    """Whether everybody speaks arrays and words, and not the messages of real robots."""
    studio: bool
    """Whether a person goes on in the studio once the task was shown."""

    @property
    def speedup(self) -> float:
        """Simulated seconds per second: a person wants to see what happens."""
        return _WATCHED_SPEEDUP if self.studio else _SPEEDUP


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="demo", description=__doc__.splitlines()[0])
    parser.add_argument("--demonstrations", type=count, default=ENOUGH, help="default: %(default)s")
    parser.add_argument(
        "--trials",
        type=count,
        default=6,
        help="runs of each driver to compare (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=directory, default=Path("demo-results"), help="default: ./%(default)s"
    )
    parser.add_argument(
        "--plain",
        action="store_true",
        help="speak Float64MultiArray and String, instead of standard messages and a robot file",
    )
    parser.add_argument(
        "--studio",
        action="store_true",
        help="go on in the studio once the task was shown, until Ctrl-C; the robot is --plain then",
    )
    parsed = parse(parser, arguments)
    folder = parsed.out / f"{datetime.now():%Y-%m-%d_%H-%M-%S}"
    plan = Plan(
        parsed.demonstrations,
        parsed.trials,
        folder.resolve(),
        parsed.plain or parsed.studio,
        parsed.studio,
    )
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)
    run(lambda: _demonstrate(plan), "demo")


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _demonstrate(plan: Plan) -> None:
    started = time.monotonic()
    # A domain of its own, on this machine only: the demo never meets a robot.  Those from 215 to
    # 232 are as good as those up to 101 (whose ports no other program gets on Linux), and rarer.
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randrange(215, 233))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    (plan.out / "logs").mkdir(parents=True)
    with _processes(plan) as processes, _person(processes, plan.out) as person:
        print("Starting robot, demonstrator, recorder, learner and executor …")
        person.wait_for_nodes()
        if plan.studio:
            _go_on_in_the_studio(plan, person)
            return
        shown = person.drive("demonstrator", plan.demonstrations, 0, "Showing", record=True)
        print("Learning …")
        sentence = person.learn()
        print(f"  {sentence}")
        taught = person.drive(
            "demonstrator", plan.trials, _FRESH_STARTS, "Demonstrator, new starts"
        )
        learned = person.drive("executor", plan.trials, _FRESH_STARTS, "Learned tree, new starts")
        document = person.document
    _report(plan, document, shown, taught, learned, time.monotonic() - started)


def _go_on_in_the_studio(plan: Plan, person: Person) -> None:
    """Shows the task, and leaves the rest to a person with a browser."""
    person.drive("demonstrator", plan.demonstrations, 0, "Showing", record=True)
    log = plan.out / "logs" / "studio.log"
    urls = person.wait(lambda: _PAGE.findall(log.read_text()), _START_TIMEOUT, "the studio's page")
    print(f"Open {urls[0]} in a browser: learn there, and let the tree drive.  Ctrl-C ends it all.")
    with contextlib.suppress(KeyboardInterrupt):
        person.wait(lambda: False, math.inf, "")
    print(f"Ended; recordings, trees and logs are in {plan.out}")


@contextlib.contextmanager
def _processes(plan: Plan) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """The nodes as processes, none of which outlives the block."""
    robot_file = {} if plan.plain else {"robot_file": _shared_files() / "config" / _ROBOT_FILE}
    shown = plan.out / "demonstrations"
    commands: dict[str, dict[str, Any]] = {
        "robot": {
            "speedup": plan.speedup,
            "rate": _RATE,
            "lockstep": not plan.studio,
            "plain": plan.plain,
        },
        "demonstrator": {"enabled": False, "plain": plan.plain},
        "recorder": {"demonstrations": shown, "recording": False, **robot_file},
        "learner": {"demonstrations": shown, "output": plan.out / "learned"},
        "executor": {"rate": _RATE * plan.speedup, **robot_file},
    }
    if plan.studio:
        commands["studio"] = {
            "demonstrations": shown,
            "output": plan.out / "learned",
            "port": _free_port(),
        }
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, parameters in commands.items():
            with (plan.out / "logs" / f"{name}.log").open("wb") as log:
                running[name] = subprocess.Popen(
                    _command(name, parameters), stdout=log, stderr=subprocess.STDOUT
                )
        yield running
    finally:
        _stop(list(running.values()))


def _free_port() -> int:
    """The studio's usual port; 0, for any other, where somebody has it."""
    with contextlib.closing(socket.socket()) as probe:
        try:
            probe.bind(("127.0.0.1", _USUAL_PORT))
        except OSError:
            return 0
    return _USUAL_PORT


#: Of a module of the installed package below its prefix, beside its file: lib, its Python's
#: directory, site-packages, and the package.
_DEPTH = 4


def _prefix() -> Path:
    """Where the package is installed."""
    try:
        return Path(get_package_prefix("rebt_ros"))
    except (PackageNotFoundError, OSError) as err:  # the latter where nothing at all was sourced
        prefix = Path(rebt_ros.__file__).parents[_DEPTH]
        if (prefix / "share" / "rebt_ros").is_dir():
            return prefix
        raise DemoError(
            "the package rebt_ros is not in the environment: "
            "build it and source install/local_setup.bash first, or use 'make demo'."
        ) from err


def _shared_files() -> Path:
    return _prefix() / "share" / "rebt_ros"


def _command(name: str, parameters: dict[str, Any]) -> list[str]:
    command = [str(_prefix() / "lib" / "rebt_ros" / name), "--ros-args"]
    command += ["--params-file", str(_shared_files() / "config" / f"{name}.yaml")]
    for parameter, value in parameters.items():
        command += ["-p", f"{parameter}:={_yaml(value)}"]
    return command


def _yaml(value: object) -> str:
    """A parameter's value, in which a path may have blanks and signs."""
    if isinstance(value, str | Path):
        quoted = str(value).replace("'", "''")
        return f"'{quoted}'"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _stop(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        process.terminate()
    deadline = time.monotonic() + _STOP_TIMEOUT
    for process in processes:
        try:
            process.wait(max(deadline - time.monotonic(), 0.0))
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            process.kill()
            process.wait()


@contextlib.contextmanager
def _person(processes: dict[str, subprocess.Popen[bytes]], out: Path) -> Iterator[Person]:
    rclpy.init(args=arguments_for_logging(sys.argv), signal_handler_options=SignalHandlerOptions.NO)
    try:
        person = Person(processes, out)
        try:
            yield person
        finally:
            person.destroy_node()
    finally:
        try_shutdown()


class Person(Node):
    """Calls the services that a person would call, and watches what comes of it."""

    def __init__(self, processes: dict[str, subprocess.Popen[bytes]], out: Path) -> None:
        super().__init__("person")
        self._logs = out / "logs"
        self._processes = processes
        self._runs: list[dict[str, Any]] = []
        self.document = ""
        remembered = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        latest = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, "robot/episode", self._on_episode, remembered)
        self.create_subscription(String, "behavior_tree", self._on_document, latest)
        self.create_subscription(Bool, "recorder/ready", self._on_ready, latest)
        self._ready = False
        self._at_hand: dict[str, Any] = {
            name: self.create_client(kind, name)
            for name, kind in (
                ("robot/reset", Trigger),
                ("robot/set_parameters", SetParameters),
                ("demonstrator/enable", SetBool),
                ("recorder/record", SetBool),
                ("recorder/new_demonstration", Trigger),
                ("learner/relearn", Trigger),
                ("executor/enable", SetBool),
            )
        }

    def wait_for_nodes(self) -> None:
        """Waits until all services can be called."""
        for name, client in self._at_hand.items():
            self.wait(client.service_is_ready, _START_TIMEOUT, f"service {name} to appear")

    def drive(
        self, driver: str, runs: int, first_start: int, what: str, *, record: bool = False
    ) -> list[dict[str, Any]]:
        """Lets a driver do some runs.

        Returns:
            What the robot said of each run.
        """
        value = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=first_start)
        setting = [Parameter(name="first_start", value=value)]
        self._call("robot/set_parameters", SetParameters.Request(parameters=setting))
        self._call("robot/reset", Trigger.Request())
        if record:
            self.wait(lambda: self._ready, _START_TIMEOUT, "the recorder to hear all topics")
            self._call("recorder/record", SetBool.Request(data=True))
        before = len(self._runs)
        for done in range(runs):
            self._call(f"{driver}/enable", SetBool.Request(data=True))
            self.wait(
                lambda done=done: len(self._runs) > before + done,  # type: ignore[misc]
                _RUN_TIMEOUT,
                f"run {done + 1} of the {driver} to end",
            )
            # Between two runs nobody drives, so that a recording ends with its run.
            self._call(f"{driver}/enable", SetBool.Request(data=False))
            if record:
                self._call("recorder/new_demonstration", Trigger.Request())
            _show_progress(what, self._runs[before : before + done + 1], runs)
        if record:
            self._call("recorder/record", SetBool.Request(data=False))
        return self._runs[before : before + runs]

    def learn(self) -> str:
        """Has the learner learn, and waits for the tree.

        Returns:
            The learner's sentence.
        """
        answer = self._call("learner/relearn", Trigger.Request(), _LEARN_TIMEOUT)
        if not answer.success:
            raise DemoError(f"the learner refused: {answer.message}")
        self.wait(lambda: bool(self.document), _START_TIMEOUT, "the learned tree")
        return str(answer.message)

    def _on_episode(self, message: String) -> None:
        self._runs.append(json.loads(message.data))

    def _on_ready(self, message: Bool) -> None:
        self._ready = message.data

    def _on_document(self, message: String) -> None:
        self.document = message.data

    def _call(self, service: str, request: Any, timeout: float = _START_TIMEOUT) -> Any:
        future = self._at_hand[service].call_async(request)
        self.wait(future.done, timeout, f"an answer of service {service}")
        return future.result()

    def wait(self, condition: Callable[[], T], timeout: float, what: str) -> T:
        """Waits until a condition holds; returns what it gave.

        Raises:
            DemoError: It did not hold in time, or a node has ended.
        """
        deadline = time.monotonic() + timeout
        while not (found := condition()):
            rclpy.spin_once(self, timeout_sec=0.05)
            for name, process in self._processes.items():
                if process.poll() is not None:
                    raise DemoError(f"the {name} has ended by itself: see {self._logs / name}.log.")
            if time.monotonic() > deadline:
                raise DemoError(f"waited {timeout:.0f} s in vain for {what}: see {self._logs}.")
        return found


def _show_progress(what: str, runs: Sequence[dict[str, Any]], total: int) -> None:
    marks = "".join("●" if one["reached"] else "○" for one in runs)
    line = f"{what:<26} {marks:<{total}} {_reached(runs)}"
    if sys.stdout.isatty():
        print(f"\r{line}", end="" if len(runs) < total else "\n", flush=True)
    elif len(runs) == total:
        print(line, flush=True)


def _reached(runs: Sequence[dict[str, Any]]) -> str:
    return f"{sum(one['reached'] for one in runs)} of {len(runs)} reached the goal"


def _report(
    plan: Plan,
    document: str,
    shown: Sequence[dict[str, Any]],
    taught: Sequence[dict[str, Any]],
    learned: Sequence[dict[str, Any]],
    seconds: float,
) -> None:
    tree = loads(document)
    write_text_atomically(plan.out / "learned" / "tree.svg", render_svg(tree))
    print(f"\nThe learned tree ({nodes.size(tree.tree)} nodes):\n")
    print(render_text(replace(tree, suggestions=()), color=use_color()))
    rows = [
        ("", "goal reached", "mean time", "bumps"),
        ("demonstrator, shown starts", *_figures(shown)),
        ("demonstrator, new starts", *_figures(taught)),
        ("learned tree, new starts", *_figures(learned)),
    ]
    print("\n".join(aligned(rows)))
    ratio = _share(learned) / _share(taught) if _share(taught) else 0.0
    print(f"\nThe learned tree reaches the goal {ratio:.0%} as often as the demonstrator.")
    print(f"It took {seconds:.0f} s; recordings, tree, picture and logs are in {plan.out}")


def _figures(runs: Sequence[dict[str, Any]]) -> tuple[str, str, str]:
    times = [one["seconds"] for one in runs if one["reached"]]
    mean = f"{sum(times) / len(times):.1f} s" if times else "-"
    bumps = sum(one["bumps"] for one in runs)
    return f"{sum(one['reached'] for one in runs)} of {len(runs)}", mean, str(bumps)


def _share(runs: Sequence[dict[str, Any]]) -> float:
    return sum(one["reached"] for one in runs) / len(runs) if runs else 0.0


if __name__ == "__main__":
    main()
