"""The process that those of `warm_processes` are forked from: it has imported what takes long.

It has opened nothing of the middleware, and its only other threads are those of the tracing
library LTTng, which is told of each fork: so a child is sound.  It runs its module as ``python -m``
does, on its own streams and with its own environment, and ends as a process of Python ends.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib.util
import json
import os
import runpy
import selectors
import signal
import socket
import sys
import warnings
from pathlib import Path
from typing import Any

#: Commands; whatever they import comes with them.
_CORE = (
    "rebt_ros.commands.check",
    "rebt_ros.commands.describe",
    "rebt_ros.commands.explain",
    "rebt_ros.commands.export",
    "rebt_ros.commands.inspect",
    "rebt_ros.commands.learn",
    "rebt_ros.commands.replay",
    "rebt_ros.commands.revise",
    "rebt_ros.commands.show",
    "rebt_ros.commands.suggest_rules",
    "rebt_ros.commands.trial",
    "rebt_ros.live.learning_worker",
)

#: Nodes, where there is a ROS.
_NODES = (
    "rebt_ros.ros.executor.node",
    "rebt_ros.ros.learner.node",
    "rebt_ros.ros.recorder.node",
    "rebt_ros.ros.robots.demonstrator",
    "rebt_ros.ros.robots.robot",
    "rebt_ros.ros.robots.synthetic_robot",
    "rebt_ros.ros.studio.node",
)

_MOMENTS = ("before_fork", "after_fork_parent", "after_fork_child")

#: A request is one message of at most this size.
LARGEST = 1 << 17

#: Standard input, output and error, and where the exit code is told.
FILES = 4


class Tracing:
    """LTTng, which rclpy loads, as it is to be told of forks: else a child crashes at its end.

    See "Using LTTng-UST with daemons" in lttng-ust(3); before its version 2.13 the names have no
    "lttng_" in front.
    """

    def __init__(self) -> None:
        mapped = Path("/proc/self/maps").read_text().split()
        libraries = [ctypes.CDLL(one) for one in sorted(set(mapped)) if "/liblttng-ust" in one]
        found = [
            (library, prefix)
            for library in libraries
            for prefix in ("lttng_ust_", "ust_")
            if hasattr(library, f"{prefix}before_fork")
        ]
        # Others may pass the same functions on.
        self._calls = [
            tuple(getattr(library, f"{prefix}{moment}") for moment in _MOMENTS)
            for library, prefix in found[:1]
        ]
        threads = len(os.listdir("/proc/self/task"))
        assert threads == 1 or self._calls, f"{threads} threads: no fork would have them"

    def fork(self) -> int:
        """Forks; returns 0 in the child."""
        # Room for a set of signals, in which they are kept meanwhile.
        signals = ctypes.create_string_buffer(128)
        for before, _, _ in self._calls:
            before(signals)
        with warnings.catch_warnings():
            # Python 3.12 and later warn of threads, of which LTTng takes care.
            warnings.simplefilter("ignore")
            child = os.fork()
        for _, in_parent, in_child in self._calls:
            (in_parent if child else in_child)(signals)
        return child


def serve(channel: socket.socket, tracing: Tracing) -> dict[str, Any]:
    """Forks a process per request; returns in each of them, with what it is to run."""
    tell: dict[int, int] = {}
    ends, notice = os.pipe()
    for one in (ends, notice):
        os.set_blocking(one, False)
    signal.set_wakeup_fd(notice)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    with selectors.DefaultSelector() as selector:
        selector.register(channel, selectors.EVENT_READ)
        selector.register(ends, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is not channel:
                    with contextlib.suppress(BlockingIOError):
                        os.read(ends, 4096)
                    _bury(tell)
                    continue
                said, files, _, _ = socket.recv_fds(channel, LARGEST, FILES)
                if not said:
                    # Whoever asked has ended, perhaps killed.  A node that goes on would be heard
                    # by later tests in its domain.
                    for child in tell:
                        with contextlib.suppress(ProcessLookupError):
                            os.kill(child, signal.SIGKILL)
                    os._exit(0)
                request = json.loads(said)
                child = _fork(request["blocked"], tracing)
                if not child:
                    signal.set_wakeup_fd(-1)
                    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                    for one in (*tell.values(), ends, notice, channel.detach(), files.pop()):
                        os.close(one)
                    request["files"] = files
                    return request
                tell[child] = files.pop()
                for one in files:
                    os.close(one)
                channel.send(str(child).encode())


def _fork(blocked: list[int], tracing: Tracing) -> int:
    """Forks a process for which some signals wait from its very beginning."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    child = tracing.fork()
    signal.pthread_sigmask(signal.SIG_SETMASK, before if child else blocked)
    return child


def _bury(tell: dict[int, int]) -> None:
    """Tells the exit codes of those that have ended."""
    for child in list(tell):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            answer = tell.pop(child)
            with contextlib.suppress(BrokenPipeError):
                os.write(answer, str(os.waitstatus_to_exitcode(status)).encode())
            os.close(answer)


def become(request: dict[str, Any]) -> None:
    """Makes this process what was asked for."""
    if request["session"]:
        os.setsid()
    for number, one in enumerate(request["files"]):
        os.dup2(one, number)
        os.close(one)
    os.chdir(request["directory"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv = [request["module"], *request["arguments"]]
    for one in list(sys.modules):
        if any(one == hidden or one.startswith(f"{hidden}.") for hidden in request["hidden"]):
            del sys.modules[one]
    sys.modules.update(dict.fromkeys(request["missing"]))


def main() -> None:
    """Imports, serves, and runs in each child the module that was asked for."""
    for module in _CORE + (_NODES if importlib.util.find_spec("rclpy") else ()):
        importlib.import_module(module)
    gc.collect()
    gc.freeze()
    request = serve(socket.socket(fileno=int(sys.argv[1])), Tracing())
    become(request)
    # runpy warns of a module that is there already, and a program begins anew.
    sys.modules.pop(request["module"], None)
    runpy.run_module(request["module"], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
