"""The life of a node's process: start, spin, and an orderly end whatever the moment."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import rclpy
from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
    ParameterException,
)
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import (
    SignalHandlerOptions,
    install_signal_handlers,
    uninstall_signal_handlers,
)
from rclpy.utilities import ok, remove_ros_args, try_shutdown

from rebt_ros.errors import RebtError
from rebt_ros.ros.entry import STOP_SIGNALS
from rebt_ros.ros.log_files import arguments_for_logging
from rebt_ros.ros.parameter_files import without_effect

#: What a user can get wrong with a node's arguments, parameters and remappings.
_WRONG_START = (
    RebtError,
    ParameterException,
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
)


def run(factory: Callable[[], Node], args: list[str] | None = None, *, threads: int = 1) -> None:
    """Runs a node until SIGINT, SIGTERM or a shutdown of its context.

    A signal never interrupts a callback, only the spinning between callbacks.  A node that has
    callbacks which take long has a method ``interrupt()`` that makes them return.  A node that has
    a method ``close()`` gets it called, outside of any callback, before it is destroyed.

    Args:
        factory: Makes the node; called once ROS is initialized.
        args: Command line, the program's name included; ``sys.argv`` if None.
        threads: Number of threads that run callbacks.

    Raises:
        SystemExit: With code 1 where arguments or parameters keep the node from starting; a
            sentence on standard error says why.
    """
    with _noted_signals() as stopped:
        given = sys.argv if args is None else args
        _answer_other_arguments(given)
        _refuse_what_ros_cannot_write(given)
        try:
            rclpy.init(
                args=arguments_for_logging(given), signal_handler_options=SignalHandlerOptions.NO
            )
        except Exception as err:
            _give_up(_why_ros_does_not_start(err), err)
        try:
            if not stopped():
                _live(factory, given, threads, stopped)
        finally:
            try_shutdown()


def _answer_other_arguments(args: list[str]) -> None:
    """Answers what is not for ROS: a call for help, or what nobody understands."""
    try:
        program, *others = remove_ros_args(args) or ["node"]
    except Exception:
        # What is wrong with those for ROS is told where they are used.
        return
    name = Path(program).name
    usage = (
        f"{name} [--ros-args [-p PARAMETER:=VALUE]… [--params-file FILE] [-r FROM:=TO]…]; "
        f"'ros2 param describe /{name} PARAMETER' tells what a parameter means, and so does "
        f"config/{name}.yaml"
    )
    if {"-h", "--help"} & set(others):
        print(f"usage: {usage}.")
        raise SystemExit(0)
    if others:
        _give_up(f"the argument {others[0]!r} is not understood; usage: {usage}.", None)


def _refuse_what_ros_cannot_write(args: Sequence[str]) -> None:
    """Refuses paths that can stand in no log and no answer: ROS takes nothing but UTF-8."""
    texts = list(args)
    with suppress(OSError, RuntimeError):
        texts += [os.getcwd(), str(Path.home())]
    for text in texts:
        try:
            text.encode("utf-8")
        except UnicodeEncodeError:
            spelt = text.encode("utf-8", "backslashreplace").decode("utf-8")
            _give_up(
                f"{spelt!r} cannot be read as {sys.getfilesystemencoding()}, and ROS needs UTF-8: "
                "set PYTHONUTF8=1, or LC_ALL=C.UTF-8, or take another name.",
                None,
            )


def _live(
    factory: Callable[[], Node],
    args: Sequence[str],
    threads: int,
    stopped: Callable[[], bool],
) -> None:
    try:
        node = factory()
    except _WRONG_START as err:
        if ok():
            _give_up(str(err), err)
        return
    except Exception:
        # A signal shuts the context down, upon which all that rclpy still creates raises.
        if ok():
            raise
        return
    try:
        for sentence in without_effect(args, node.get_fully_qualified_name()):
            node.get_logger().warning(sentence)
        _spin(node, threads, stopped)
    finally:
        _call(node, "close")
        node.destroy_node()


def _spin(node: Node, threads: int, stopped: Callable[[], bool]) -> None:
    executor: Executor | None = None
    try:
        executor = MultiThreadedExecutor(threads) if threads > 1 else SingleThreadedExecutor()
        executor.add_node(node)
        # Only now, because rclpy cannot create things in a context that a signal has shut down.
        install_signal_handlers()
        while ok() and not stopped():
            executor.spin_once()
    except ExternalShutdownException:
        pass
    except Exception:
        # A callback that publishes just after the context was shut down.
        if ok():
            raise
    finally:
        _call(node, "interrupt")
        if executor is not None:
            executor.shutdown()


def _call(node: Node, name: str) -> None:
    method = getattr(node, name, None)
    if method is not None:
        method()


@contextmanager
def _noted_signals() -> Iterator[Callable[[], bool]]:
    """Replaces KeyboardInterrupt and sudden death by a note, also where rclpy does not listen.

    While a node spins, rclpy hears the signals first, shuts the context down, and then calls the
    handlers set here.
    """
    came: list[int] = []
    before = {
        one: signal.signal(one, lambda number, _: came.append(number)) for one in STOP_SIGNALS
    }
    try:
        yield lambda: bool(came)
    finally:
        uninstall_signal_handlers()
        for one, handler in before.items():
            signal.signal(one, handler)


def _give_up(sentence: str, err: Exception | None) -> None:
    get_logger("rebt_ros").fatal(" ".join(sentence.split()))
    sys.stderr.flush()
    raise SystemExit(1) from err


def _why_ros_does_not_start(err: Exception) -> str:
    said = str(err).split(", at /")[0].removeprefix("failed to initialize rcl: ")
    if said.startswith("Couldn't parse") or type(err).__name__ == "UnknownROSArgsError":
        return f"these arguments are not understood: {said}"
    if os.environ.get("ROS_SECURITY_ENABLE", "").lower() == "true" and "not set" in said:
        said = "SROS 2 is on, and there is no enclave for the node under ROS_SECURITY_KEYSTORE"
    return f"ROS 2 does not start: {said}; check the environment variables ROS_* and RMW_*."
