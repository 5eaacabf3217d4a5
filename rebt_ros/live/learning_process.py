"""Learning in a process of its own, so that the node answers, and ends, whatever happens there.

The node's side.  It writes one JSON line per request, or call for files, to the process's standard
input and reads JSON lines from its standard output: progress, as often as there is any, and then
one reply.  The other side is `rebt_ros.live.learning_worker`.  Both need no ROS.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import rebt_ros
from rebt_ros.errors import RebtError

_WORKER: Final = "rebt_ros.live.learning_worker"

#: What asks for the files of what was learned last: their directory, in place of a request.
_WRITE: Final = "write"

#: What asks for pictures of another tree: their directory, beside the document.
_DRAW: Final = "draw"

#: How long that may take (seconds): fonts may have to be looked for first.
_DRAWING: Final = 120.0

#: How long a process that has closed its output may take to end (seconds).
_LAST_BREATH: Final = 5.0


@dataclass(frozen=True, slots=True)
class Request:
    """What to learn from and how; options as in `LearnOptions`, enumerations by their values."""

    demonstrations: str
    """Directory of recordings."""
    options: Mapping[str, Any]
    binary_features: Sequence[str] = ()
    categorical_features: Sequence[str] = ()
    published: str = ""
    """The document that is published now, to be judged on the same rows; empty for none."""
    rules: str = ""
    """File of the rules that the tree must keep; empty for none."""
    repair: bool = False
    """Whether guards are put into a tree that breaks a rule; otherwise nothing is learned."""
    action_results: bool = False
    """Whether actions may fail or go on, for the proofs."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a request is."""

    stage: str
    share: float
    """Of the work, from 0 to 1."""


@dataclass(frozen=True, slots=True)
class Lesson:
    """What was learned."""

    document: str
    """The behavior tree document."""
    sentence: str
    """What was learned, for people."""
    notes: Sequence[str] = ()
    """What a person should know about the recordings and about the tree; no full stops."""
    figures: Mapping[str, str] = field(default_factory=dict)
    """How well it may do, for /diagnostics."""
    agreement: float | None = None
    """With the held-out rows, after its own choices; None where none were held out."""
    doubts: Sequence[str] = ()
    """Those of the notes that keep a node from saying that all is well."""
    rival: float | None = None
    """The same of the tree that is published, on the same rows; None where it cannot be told."""


class LearningError(RebtError):
    """Nothing was learned; the message says why.

    Args:
        message: That.
        notes: What a person should know about the recordings, as far as they were read; no full
            stops.
    """

    def __init__(self, message: str, notes: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.notes = tuple(notes)


class LearningCancelledError(LearningError):
    """It was not wanted any more."""

    def __init__(self) -> None:
        super().__init__("learning was cancelled: the tree before it stays.")


class LearningProcess:
    """Starts the process and speaks to it.

    Any thread may ask, and waits for those that asked before; any may cancel and close.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._turn = threading.Lock()
        # What follows is guarded by the lock.
        self._closed = False
        self._asked = False
        self._stopped: LearningError | None = None

    @property
    def id(self) -> int | None:
        """The process's id; None if there is none."""
        # Who asks whether a process has ended gives its id free: not while another thread kills it.
        with self._lock:
            process = self._process
            return None if process is None or process.poll() is not None else process.pid

    def start(self) -> None:
        """Starts the process unless it runs, so that it is ready when it is asked.

        Raises:
            LearningError: It cannot be started.
        """
        with self._lock:
            self._started()

    def ask(
        self,
        request: Request,
        *,
        cancelled: threading.Event,
        limit: float | None = None,
        progress: Callable[[Progress], None] = lambda progress: None,
    ) -> Lesson:
        """Learns; takes as long as that takes.

        Args:
            request: What to learn.
            cancelled: Set by whoever calls `cancel`, before that: it may come before the request.
            limit: How long it may take (seconds); None for any time.
            progress: Told how far it is, in this thread.

        Raises:
            LearningCancelledError: It was cancelled.
            LearningError: The demonstrations or options cannot be used, it took too long, or the
                process ended.
        """
        late = LearningError(
            f"learning took longer than relearn_timeout ({limit:g} s) and was stopped: "
            "allow more time or learn from fewer rows."
            if limit is not None
            else ""
        )
        return Lesson(**self._ask(asdict(request), cancelled, limit, late, progress))

    def write(self, directory: Path) -> tuple[str, ...]:
        """Writes what was learned last as the command `learn` does, pictures included.

        Returns:
            Notes on what could not be made; no full stops.

        Raises:
            LearningError: It cannot be written, took too long, or the process ended.
        """
        return self._drawn({_WRITE: str(directory)})

    def draw(self, document: str, directory: Path) -> tuple[str, ...]:
        """Writes text and pictures of a tree in place of those of what was learned last.

        Returns:
            Notes on what could not be made; no full stops.

        Raises:
            LearningError: They cannot be written, took too long, or the process ended.
        """
        return self._drawn({_DRAW: str(directory), "document": document})

    def _drawn(self, message: Mapping[str, Any]) -> tuple[str, ...]:
        late = LearningError(f"drawing took longer than {_DRAWING:g} s and was stopped.")
        reply = self._ask(message, threading.Event(), _DRAWING, late, lambda progress: None)
        return tuple(reply["notes"])

    def _ask(
        self,
        message: Mapping[str, Any],
        cancelled: threading.Event,
        limit: float | None,
        late: LearningError,
        progress: Callable[[Progress], None],
    ) -> dict[str, Any]:
        """The reply to a message."""
        with self._turn:
            return self._ask_in_turn(message, cancelled, limit, late, progress)

    def _ask_in_turn(
        self,
        message: Mapping[str, Any],
        cancelled: threading.Event,
        limit: float | None,
        late: LearningError,
        progress: Callable[[Progress], None],
    ) -> dict[str, Any]:
        with self._lock:
            if cancelled.is_set():
                raise LearningCancelledError
            process = self._started()
            self._asked, self._stopped = True, None
        try:
            with self._limited(limit, late):
                reply = _converse(process, message, progress)
        except Exception:
            # What it still says must not be taken for the next reply.
            with self._lock:
                _kill(process)
            process.wait()
            raise
        finally:
            with self._lock:
                self._asked = False
        if self._stopped is not None:
            process.wait()
            raise self._stopped
        if reply is None:
            raise LearningError(
                f"the learning process {_ending(process)}: call again to try once more."
            )
        if "error" in reply:
            raise LearningError(reply["error"], reply.get("notes", ()))
        return reply

    def cancel(self) -> bool:
        """Ends the process if it is learning, and whoever asked it is told so.

        Returns:
            Whether it was learning.
        """
        return self._stop(LearningCancelledError())

    def close(self) -> None:
        """Ends the process at once; whoever waits for its reply gets a `LearningError`."""
        self._stop(LearningError("the learner is shutting down."))
        with self._lock:
            self._closed = True
            process = self._process
            if process is not None:
                _kill(process)
        if process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_LAST_BREATH)

    def _started(self) -> subprocess.Popen[bytes]:
        """The process, which runs."""
        if self._closed:
            raise LearningError("the learner is shutting down.")
        if self._process is not None and self._process.poll() is None:
            return self._process
        if self._process is not None:
            _close_pipes(self._process)
        package = Path(rebt_ros.__file__).parents[1]
        paths = [str(package), os.environ.get("PYTHONPATH", "")]
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", _WORKER, str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, paths))),
                # Control-C in a terminal is for the node alone.  And Linux shares the processor out
                # among sessions first: only one of its own can stand back for those of other nodes.
                start_new_session=True,
            )
        except OSError as err:
            raise LearningError(
                f"the learning process cannot be started ({err.strerror or err}): "
                "free memory or processes and call again."
            ) from err
        return self._process

    @contextlib.contextmanager
    def _limited(self, limit: float | None, late: LearningError) -> Iterator[None]:
        """Ends the process where the block takes longer."""
        if limit is None:
            yield
            return
        timer = threading.Timer(limit, self._stop, [late])
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _stop(self, why: LearningError) -> bool:
        """Ends the process if it is being asked."""
        with self._lock:
            if not self._asked or self._stopped is not None or self._process is None:
                return False
            self._stopped = why
            _kill(self._process)
            return True


def _converse(
    process: subprocess.Popen[bytes],
    message: Mapping[str, Any],
    progress: Callable[[Progress], None],
) -> dict[str, Any] | None:
    """The reply to a message; None where the process ended, or spoke nonsense, before it."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(message).encode() + b"\n")
        process.stdin.flush()
        for line in process.stdout:
            said = json.loads(line)
            if "stage" not in said:
                return dict(said)
            progress(Progress(**said))
    except (OSError, ValueError):
        # The last line may be cut short.
        return None
    return None


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Ends a process, and those that it has started, at once."""
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _close_pipes(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        # What could not be written to a process that has ended.
        with contextlib.suppress(OSError):
            pipe.close()


def _ending(process: subprocess.Popen[bytes]) -> str:
    """How a process ended that has closed its output."""
    try:
        code = process.wait(_LAST_BREATH)
    except subprocess.TimeoutExpired:
        _kill(process)
        process.wait()
        return "did not speak any more"
    if code == -signal.SIGKILL:
        return "was killed, perhaps for lack of memory"
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended unexpectedly with code {code}"
