"""Processes that start in no time, as all that they import is there already.

A real process each: it has its own id, streams, directory, environment, signals and end.  Only the
start of Python and the imports, seconds of the processor's time, are shared: each is forked from
one that has done both (`warm_server`).  What happens while a program starts is tested on processes
that start in the ordinary way: by test_signals, test_hostile_nodes and test_hostile_shells.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import warm_server

import rebt_ros

#: Where the package under test is, installed or not.
HOME = Path(rebt_ros.__file__).parents[1]

#: What Python and its libraries read while they start.  How many threads linear algebra has, which
#: a cluster's nanny sets for everybody who comes after it, is the same for all that are forked.
_OF_THE_START = ("PYTHON", "LC_", "LANG", "LD_")

#: As the tests began, whatever one of them changes meanwhile.
_ENVIRONMENT = dict(os.environ)

_ROS = ("rclpy", "std_msgs", "std_srvs", "diagnostic_msgs", "ament_index_python")

#: How long a command may take, on a busy machine (seconds).
_LIMIT = 300.0

_lock = threading.Lock()
_in_use = False
_server: tuple[subprocess.Popen[bytes], socket.socket] | None = None


class WarmProcess:
    """As much of `subprocess.Popen` as tests use.

    Args:
        module: What ``python -m`` would run.
        arguments: Its arguments.
        environment: Its environment; see `can_start`.
        directory: Its working directory.
        files: Its standard input, output and error.
        session: Whether it begins a session of its own.
        blocked: Signals that wait until it unblocks them.
        ros: Whether it can import anything of ROS.
    """

    def __init__(
        self,
        module: str,
        arguments: Sequence[str],
        *,
        environment: Mapping[str, str],
        directory: Path,
        files: tuple[int, int, int],
        session: bool = False,
        blocked: Sequence[int] = (),
        ros: bool = True,
    ) -> None:
        assert can_start(environment), "this environment needs a process that starts as usual"
        request = {
            "module": module,
            "arguments": list(arguments),
            "environment": dict(environment),
            "directory": str(directory),
            "session": session,
            "blocked": list(blocked),
            "hidden": [] if ros else [*_ROS, "rebt_ros.ros"],
            "missing": [] if ros else list(_ROS),
        }
        self._answer, answer = os.pipe()
        try:
            with _lock:
                channel = _channel()
                socket.send_fds(channel, [json.dumps(request).encode()], [*files, answer])
                said = channel.recv(64)
        finally:
            os.close(answer)
        self.pid = int(said)
        self.returncode: int | None = None

    def poll(self) -> int | None:
        return self._ended(0.0)

    def wait(self, timeout: float | None = None) -> int:
        code = self._ended(timeout)
        if code is None:
            assert timeout is not None
            raise subprocess.TimeoutExpired(str(self.pid), timeout)
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def _ended(self, timeout: float | None) -> int | None:
        """The exit code; None where it still runs after a time (seconds; None for any time)."""
        if self.returncode is None and select.select([self._answer], [], [], timeout)[0]:
            said = os.read(self._answer, 64)
            os.close(self._answer)
            self.returncode = int(said)
        return self.returncode


def run(
    module: str,
    *arguments: object,
    directory: Path | None = None,
    ros: bool = True,
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    """Runs what ``python -m`` would run, and returns what it has written.

    Args:
        module: What to run.
        arguments: Its arguments.
        directory: Its working directory, this process's unless given.
        ros: Whether it can import anything of ROS.
        variables: Of its environment, beside those of this process.
    """
    words = list(map(str, arguments))
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, open(os.devnull) as none:
        process = WarmProcess(
            module,
            words,
            environment=as_begun() | variables,
            directory=directory or Path.cwd(),
            files=(none.fileno(), out.fileno(), err.fileno()),
            ros=ros,
        )
        try:
            code = process.wait(_LIMIT)
        except BaseException:
            process.kill()
            raise
        texts = []
        for one in (out, err):
            one.seek(0)
            texts.append(one.read().decode())
    return subprocess.CompletedProcess([module, *words], code, *texts)


def as_begun() -> dict[str, str]:
    """The environment of this process, without what it has changed of what is read at a start."""
    now, began = (
        {name: value for name, value in one.items() if name.startswith(_OF_THE_START) is at_start}
        for one, at_start in ((os.environ, False), (_ENVIRONMENT, True))
    )
    return now | began


def use() -> None:
    """Has nodes start so; a benchmark, which does not call this, measures ordinary processes."""
    global _in_use
    _in_use = True


def can_start(environment: Mapping[str, str]) -> bool:
    """Whether a process with this environment starts as that which others are forked from."""
    return _in_use and _start(environment) == _start(_ENVIRONMENT)


def _start(environment: Mapping[str, str]) -> dict[str, object]:
    """What Python and its libraries read while they start."""
    read: dict[str, object] = {
        name: value for name, value in environment.items() if name.startswith(_OF_THE_START)
    }
    paths = environment.get("PYTHONPATH", "").split(os.pathsep)
    # Where the first path is named twice, the second one makes no difference.
    return read | {"PYTHONPATH": [one for one in paths if one not in ("", str(HOME))]}


def _channel() -> socket.socket:
    """The way to the process that others are forked from, which is started where there is none."""
    global _server
    if _server is None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        paths = [str(HOME), _ENVIRONMENT.get("PYTHONPATH", "")]
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-P", warm_server.__file__, str(theirs.fileno())],
                env=_ENVIRONMENT
                | {
                    "PYTHONPATH": os.pathsep.join(paths),
                    # Libraries of linear algebra begin threads otherwise, which no fork has.
                    "OPENBLAS_NUM_THREADS": "1",
                    "OMP_NUM_THREADS": "1",
                },
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )
        _server = process, ours
    return _server[1]


@atexit.register
def _close() -> None:
    if _server is not None:
        _server[1].close()
        _server[0].wait()
