"""The nodes of a soak: started, killed, stopped, and watched."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from ros_processes import CHECKOUT, NodeProcess, command_of

from soak.ledger import Ledger

#: In the environment of every process of a soak, so that none is overlooked.
_MARK: Final = "REBT_ROS_SOAK"

#: How much a node's resident memory may grow once it has run for a while (bytes, seconds).
LARGEST_GROWTH: Final = 48 << 20
_WARM: Final = 20.0

#: How long a node may take to end (seconds).
_PATIENCE: Final = 20.0

NODES: Final = ("recorder", "learner", "executor")


@dataclass(slots=True)
class _Life:
    process: NodeProcess
    began: float
    settled: int = 0
    """Resident memory once it was warm, bytes."""


@dataclass(slots=True)
class Fleet:
    """The three nodes, each with one life after the other."""

    directory: Path
    domain: int
    parameters: dict[str, dict[str, object]]
    ledger: Ledger
    _lives: dict[str, _Life] = field(default_factory=dict)

    def __post_init__(self) -> None:
        os.environ[_MARK] = str(self.directory)

    def start(self, name: str) -> None:
        """Starts a node."""
        process = NodeProcess(
            f"{name}_node",
            self.domain,
            self.directory,
            self.parameters.get(name, {}),
            # Its environment, by which `_left` knows it, is what it was started with.
            command=command_of(name),
        )
        self._lives[name] = _Life(process, time.monotonic())

    def pid(self, name: str) -> int:
        """The process of a node."""
        return self._lives[name].process.process.pid

    def kill(self, name: str) -> None:
        """SIGKILL."""
        process = self._lives.pop(name).process
        self._judge(name, process, process.stop(signal.SIGKILL), -signal.SIGKILL)

    def stop(self, name: str, number: signal.Signals) -> None:
        """Stops a node in order, which must end well."""
        process = self._lives.pop(name).process
        process.process.send_signal(number)
        began = time.monotonic()
        try:
            code = process.process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.ledger.lose("hangs", f"{name} did not end within {_PATIENCE} s of {number.name}")
            process.process.kill()
            code = 0 * process.process.wait()
        self.ledger.raise_to("longest_stop_s", time.monotonic() - began)
        self._judge(name, process, code, 0)

    def watch(self) -> None:
        """Looks after the memory of all nodes, and for any that ended by itself."""
        now = time.monotonic()
        for name, life in self._lives.items():
            if life.process.process.poll() is not None:
                self._judge(name, life.process, life.process.process.returncode, 0)
                self.ledger.lose("nodes ended by themselves", name)
                self.start(name)
                return
            if now - life.began < _WARM:
                continue
            resident = _resident(life.process.process.pid)
            life.settled = life.settled or resident
            growth = resident - life.settled
            self.ledger.raise_to(f"growth_{name}_bytes", growth)
            if growth > LARGEST_GROWTH:
                self.ledger.lose("memory", f"{name} grew by {growth >> 20} MB")
                life.settled = resident

    def end(self) -> None:
        """Stops all nodes; says what is left of them."""
        for name in list(self._lives):
            self.stop(name, signal.SIGINT)
        left = self._left()
        end = time.monotonic() + _PATIENCE
        while left and time.monotonic() < end:
            time.sleep(0.1)
            left = self._left()
        for pid, command in left.items():
            self.ledger.lose("processes left", f"{pid}: {command}")
            os.kill(pid, signal.SIGKILL)

    def kill_all(self) -> None:
        """Leaves nothing behind, however the soak has ended."""
        for life in self._lives.values():
            if life.process.process.poll() is None:
                life.process.process.kill()
                life.process.process.wait()

    def _judge(self, name: str, process: NodeProcess, code: int, expected: int) -> None:
        said = process.stderr
        if code != expected:
            self.ledger.lose("exit codes", f"{name} ended with {code}: {said[-1000:]}")
        if "Traceback" in said or "FATAL" in said:
            self.ledger.lose("tracebacks", f"{name}: {said[-3000:]}")

    def _left(self) -> dict[int, str]:
        """Processes of this soak, this one and the robot excepted."""
        mark = f"{_MARK}={self.directory}".encode()
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdecimal() or int(entry.name) == os.getpid():
                continue
            try:
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                marked = mark in (entry / "environ").read_bytes().split(b"\0")
            except OSError:
                continue
            if marked and command and "soak.robot" not in command:
                found[int(entry.name)] = command
        return found


def _resident(pid: int) -> int:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


class RobotProcess:
    """The robot, and what it has heard.

    Args:
        directory: For its log.
        domain: ROS domain id.
        rate: States per second.
    """

    def __init__(self, directory: Path, domain: int, rate: float) -> None:
        self._log = directory / "commands.log"
        self._log.touch()
        self._read = 0
        self.commands: list[tuple[float, str]] = []
        """When each was sent (seconds, as `time.time` has it), and its label."""
        paths = [str(CHECKOUT / "test"), str(CHECKOUT), os.environ.get("PYTHONPATH", "")]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "soak.robot", str(self._log), str(rate)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=dict(
                os.environ,
                ROS_DOMAIN_ID=str(domain),
                PYTHONPATH=os.pathsep.join(filter(None, paths)),
            ),
        )

    def tell(self, what: str) -> None:
        """``pause`` or ``resume``."""
        assert self._process.stdin is not None
        self._process.stdin.write(what + "\n")
        self._process.stdin.flush()

    def listen(self) -> int:
        """Takes in what was heard; returns how many commands there were so far."""
        with self._log.open(encoding="utf-8") as log:
            log.seek(self._read)
            for line in iter(log.readline, ""):
                if not line.endswith("\n"):
                    break
                stamp, _, label = line.rstrip("\n").partition(" ")
                self.commands.append((float(stamp), label))
                self._read += len(line.encode())
        return len(self.commands)

    def end(self) -> dict[str, int]:
        """Ends it; returns how much it has sent."""
        output, _ = self._process.communicate(timeout=_PATIENCE)
        sent: dict[str, int] = json.loads(output.splitlines()[-1])
        return sent

    def kill(self) -> None:
        """Where there is nothing more to be had from it."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
