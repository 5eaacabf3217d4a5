"""The paper's measure: networkx's heuristic graph edit distance, one iteration (IV-B).

networkx can take hours for two trees of 20 nodes, in code that cannot be interrupted.  So it runs
in a process of its own, which is killed when a pair takes too long.  That works in any thread and
in any worker process of joblib or Dask.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType

from rebt_ros.errors import RebtError
from rebt_ros.study.edit_distance.labelled_tree import LabelledTree

_WORKER = "rebt_ros.study.edit_distance.networkx_worker"
#: Until the process must have imported networkx, in s.
_LONGEST_START = 120.0


class MeasureError(RebtError):
    """The process that computes distances does not work; the message says why."""


class NetworkxMeasure:
    """Computes distances in a process that is kept from pair to pair.

    The process ends with the ``with`` block, and with the process that started it, whatever way
    that ends.  For one thread at a time.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> NetworkxMeasure:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def id(self) -> int | None:
        """The id of the process that runs, if one does."""
        return None if self._process is None else self._process.pid

    def distance(self, first: LabelledTree, second: LabelledTree, seconds: float) -> float | None:
        """The first distance that networkx comes up with.

        Args:
            first: A tree.
            second: Another one.  Changing places may change networkx's answer.
            seconds: How long it may take.  Starting the process does not count.

        Returns:
            The distance; None where it took too long.

        Raises:
            MeasureError: The process could not be started, or ended by itself.
        """
        if self._process is None:
            self._process = _started()
        request = [[tree.labels, tree.parents] for tree in (first, second)]
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
            line = _line(self._process, seconds)
        except OSError:
            line = b""
        except BaseException:
            # Interrupted: an answer that comes later must not be taken for that of the next pair.
            self.close()
            raise
        if line is None:
            self.close()
            return None
        if not line:
            code = self._process.wait()
            self.close()
            raise MeasureError(
                f"the process that runs networkx ended with code {code}: see what it printed, and "
                "whether the memory suffices."
            )
        return float(line)

    def close(self) -> None:
        """Ends the process at once; the next pair starts another one."""
        process, self._process = self._process, None
        if process is not None:
            _end(process)


def _started() -> subprocess.Popen[bytes]:
    package = Path(__file__).parents[2]
    paths = [str(package), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", _WORKER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # One thread: the matrices are small, and other processes want the processors.
        env=dict(
            os.environ,
            PYTHONPATH=os.pathsep.join(filter(None, paths)),
            OMP_NUM_THREADS="1",
            OPENBLAS_NUM_THREADS="1",
        ),
        # Control-C in a terminal is for the one who asks.
        process_group=0,
    )
    try:
        ready = _line(process, _LONGEST_START)
    except BaseException:
        _end(process)
        raise
    if ready != b"\n":
        _end(process)
        raise MeasureError("the process that runs networkx did not start: see what it printed.")
    return process


def _line(process: subprocess.Popen[bytes], seconds: float) -> bytes | None:
    """The next line of the process; empty where its output ended, None where it took too long."""
    assert process.stdout is not None
    # Unlike select, it takes file descriptors of any number.
    poll = select.poll()
    poll.register(process.stdout, select.POLLIN)
    deadline = time.monotonic() + seconds
    line = b""
    while not line.endswith(b"\n"):
        left = max(0.0, deadline - time.monotonic())
        if not poll.poll(1000 * left):
            return None
        read = os.read(process.stdout.fileno(), 4096)
        if not read:
            return b""
        line += read
    return line


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        try:
            pipe.close()
        except OSError:
            # What could not be written to a process that has ended.
            continue
