"""Learning in a process of its own, so that a node answers, and ends, at any moment.

The node writes one JSON line per request to the process's standard input and reads one JSON line
per reply from its standard output.  The process ends with its standard input, which means with the
node, whatever way that ends.  This module needs no ROS.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any, BinaryIO

import rebt_ros
from rebt_ros.errors import OptionError, RebtError


@dataclass(frozen=True, slots=True)
class Request:
    """What to learn from and how; options as in `LearnOptions`, enumerations by their values."""

    demonstrations: str
    """Directory of recordings."""
    options: Mapping[str, Any]
    binary_features: Sequence[str] = ()
    categorical_features: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Lesson:
    """What was learned."""

    document: str
    """The behavior tree document."""
    sentence: str
    """What was learned, for people."""
    notes: Sequence[str] = ()
    """What a person should know about the recordings."""


class LearningError(RebtError):
    """Nothing was learned; the message says why."""


class LearningProcess:
    """The node's side: starts the process and speaks to it.

    One thread at a time may ask; any thread may close.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False
        self._lock = threading.Lock()

    @property
    def id(self) -> int | None:
        """The process's id, if one was started."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Starts the process unless it runs, so that it is ready when it is asked."""
        with self._lock:
            if self._closed or (self._process is not None and self._process.poll() is None):
                return
            self._reap()
            package = Path(rebt_ros.__file__).parents[1]
            paths = [str(package), os.environ.get("PYTHONPATH", "")]
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", __name__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, paths))),
                # Control-C in a terminal is for the node alone.
                process_group=0,
            )

    def ask(self, request: Request) -> Lesson:
        """Learns; takes as long as that takes.

        Raises:
            LearningError: The demonstrations or options cannot be used, or the process ended; in
                that case a new one is started for the next time.
        """
        self.start()
        process = self._process
        if process is None:
            raise LearningError("the learner is shutting down.")
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(json.dumps(asdict(request)).encode() + b"\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except (OSError, ValueError):
            line = b""
        if not line.endswith(b"\n"):
            why = _ending(process.wait())
            self.start()
            raise LearningError(f"the learning process {why}: call again to try once more.")
        reply = json.loads(line)
        if "error" in reply:
            raise LearningError(reply["error"])
        return Lesson(**reply)

    def close(self) -> None:
        """Ends the process at once; whoever waits for its reply gets a `LearningError`."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()

    def _reap(self) -> None:
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                try:
                    pipe.close()
                except OSError:
                    # What could not be written to a process that has ended.
                    continue


def _ending(code: int) -> str:
    if code == -signal.SIGKILL:
        return "was killed, perhaps for lack of memory"
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended unexpectedly with code {code}"


def main() -> None:
    """The process's side: learns whenever a line asks it to, until its input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, requests), daemon=True).start()
    # What a library may print must not come between the replies.
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _warm_up()
    while True:
        reply = _reply(requests.get())
        replies.write(json.dumps(reply).encode() + b"\n")


def _listen(requests: BinaryIO, waiting: queue.SimpleQueue[bytes]) -> None:
    for line in requests:
        waiting.put(line)
    # The node has ended: so does this process, in the middle of learning, too.
    os._exit(0)


def _warm_up() -> None:
    """Imports what takes long to import; what is missing is reported once it is asked for."""
    try:
        import rebt_ros.pipeline  # noqa: F401
    except ImportError:
        return


def _reply(line: bytes) -> dict[str, Any]:
    try:
        return asdict(learn(Request(**json.loads(line))))
    except RebtError as err:
        return {"error": str(err)}
    except ImportError as err:
        return {"error": f"{err.name or err} is not installed: install it and call again."}
    except MemoryError:
        return {"error": "the memory does not suffice: learn from fewer demonstrations."}
    except Exception as err:
        traceback.print_exc()
        return {
            "error": f"learning failed, which is a mistake in rebt_ros ({type(err).__name__}: "
            f"{err}): please report it, with the learner's log."
        }


def learn(request: Request) -> Lesson:
    """Learns from all recordings of a directory, in this process.

    Raises:
        RebtError: They cannot be used, or an option makes no sense.
    """
    from rebt_ros import pipeline
    from rebt_ros.behavior_tree.document import dumps
    from rebt_ros.behavior_tree.learned_tree import Root
    from rebt_ros.decision_tree.upsampling import Upsampling
    from rebt_ros.demonstration.schema import FeatureKind
    from rebt_ros.options import LearnOptions, Use
    from rebt_ros.storage.recording import read_recording, recordings

    twice = set(request.binary_features) & set(request.categorical_features)
    if twice:
        raise OptionError(f"feature {min(twice)!r} cannot be both binary and categorical.")
    declared = {
        **dict.fromkeys(request.binary_features, FeatureKind.BINARY),
        **dict.fromkeys(request.categorical_features, FeatureKind.CATEGORICAL),
    }
    kinds: dict[str, type[Enum]] = {
        "root": Root,
        "psa": Use,
        "last_action": Use,
        "upsample": Upsampling,
    }
    chosen: dict[str, Any] = {
        name: kinds[name](value) if name in kinds else value
        for name, value in request.options.items()
    }
    options = LearnOptions(**chosen)
    reads = [read_recording(path) for path in recordings(Path(request.demonstrations))]
    learned = pipeline.learn([read.demonstration for read in reads], options, declared)
    notes = [f"{read.demonstration.name}: {note}" for read in reads for note in read.notes]
    return Lesson(dumps(learned), pipeline.summary_sentence(learned), notes)


if __name__ == "__main__":
    main()
