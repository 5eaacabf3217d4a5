"""What a program that watches trees of BehaviorTree.CPP 4 asks, and what it is answered.

This is the protocol of Groot2's monitor, in version 2, as BehaviorTree.CPP publishes it:
``include/behaviortree_cpp/loggers/groot2_protocol.h`` has the messages and
``src/loggers/groot2_publisher.cpp`` the answers.  A request is one or two frames.  The first has
six bytes: version, kind, and a number of the sender's choice (32 bits, little-endian).  An answer
begins with these and the UUID of the tree; or it is ``error`` and a sentence.

A watcher only watches here: breakpoints, and statuses that it would put in the place of a node's,
are answered with an error.
"""

from __future__ import annotations

import math
import struct
import time
import uuid
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from rebt_ros.export.elements import TREE
from rebt_ros.export.watched import WatchedTree
from rebt_ros.storage.btlog import Transition

#: The version that is spoken.
PROTOCOL = 2
#: Ticks that are kept for a watcher that records.
_MOST_TICKS = 1000
#: Added to the last status of a node that was halted.
_HALTED = 10
_HEADER = struct.Struct("<BBI")
_STATUS = struct.Struct("<HB")
#: Changes of a status that one answer has; as many as BehaviorTree.CPP keeps.
_MOST_CHANGES = 1000


@dataclass(frozen=True, eq=False, slots=True)
class _Moment:
    """What there is to see at one time."""

    tree: WatchedTree
    uuid: bytes = field(default_factory=lambda: uuid.uuid4().bytes)
    outcomes: Mapping[int, str] = field(default_factory=dict)
    values: Sequence[float] = ()
    halted: bool = False


@dataclass(eq=False, slots=True)
class _Recording:
    """What a watcher records of a tree."""

    tree: WatchedTree
    before: Mapping[int, str]
    began: int = field(default_factory=lambda: time.time_ns() // 1000)
    """Microseconds since 1970."""
    goes_on: bool = True
    ticks: deque[tuple[int, Mapping[int, str]]] = field(
        default_factory=lambda: deque(maxlen=_MOST_TICKS)
    )


class Groot2Answers:
    """Answers one watcher or several; `answer` may run in another thread than the rest."""

    def __init__(self) -> None:
        self.bad_requests = 0
        """Requests that were answered with an error."""
        self._moment: _Moment | None = None
        self._recording: _Recording | None = None
        self._kinds = {
            ord("T"): self._tree,
            ord("S"): self._statuses,
            ord("B"): self._blackboard,
            ord("D"): self._hooks,
            ord("A"): self._nothing,
            ord("X"): self._nothing,
            ord("r"): self._record,
            ord("t"): self._transitions,
        }

    def show(self, tree: WatchedTree | None) -> None:
        """Another tree runs, which has a new UUID; None for one that cannot be watched."""
        self._moment = None if tree is None else _Moment(tree)

    def tick(self, outcomes: Mapping[int, str], values: Sequence[float]) -> None:
        """The tree was ticked.

        Args:
            outcomes: From `TreeRuntime.outcomes`.
            values: The state, in the order of the tree's features.
        """
        self._see(outcomes, values, halted=False)

    def rest(self) -> None:
        """The tree was halted."""
        moment = self._moment
        if moment is not None and not moment.halted:
            self._see(moment.outcomes, moment.values, halted=True)

    def _see(self, outcomes: Mapping[int, str], values: Sequence[float], *, halted: bool) -> None:
        moment = self._moment
        if moment is None:
            return
        # In one assignment: whoever answers sees all of it or what was before.
        self._moment = replace(moment, outcomes=outcomes, values=values, halted=halted)
        recording = self._recording
        if recording is not None and recording.goes_on and recording.tree is moment.tree:
            recording.ticks.append((time.time_ns() // 1000, {} if halted else outcomes))

    def answer(self, frames: Sequence[bytes]) -> list[bytes]:
        """The frames of the answer to those of a request, whatever they are."""
        moment = self._moment
        header = frames[0] if frames else b""
        if len(header) != _HEADER.size or len(frames) > 2:
            return self._error("a request has a header of six bytes, and one more frame at most")
        _, kind, number = _HEADER.unpack(header)
        answering = self._kinds.get(kind)
        if answering is None:
            return self._error("a learned tree is only watched: this request is not known")
        if moment is None:
            return self._error("there is no tree yet that can be watched")
        # What a request says beside its kind.
        content = answering(moment, frames[1] if len(frames) > 1 else None)
        if content is None:
            return self._error("the second frame is missing, or not understood")
        return [_HEADER.pack(PROTOCOL, kind, number) + moment.uuid, *content]

    def _error(self, sentence: str) -> list[bytes]:
        self.bad_requests += 1
        return [b"error", sentence.encode()]

    def _tree(self, moment: _Moment, _: bytes | None) -> list[bytes]:
        return [moment.tree.xml.encode()]

    def _statuses(self, moment: _Moment, _: bytes | None) -> list[bytes]:
        halted = _HALTED if moment.halted else 0
        statuses = zip(moment.tree.nodes, moment.tree.statuses(moment.outcomes), strict=True)
        return [
            b"".join(
                _STATUS.pack(node.uid, status + halted if status else status)
                for node, status in statuses
            )
        ]

    def _blackboard(self, moment: _Moment, names: bytes | None) -> list[bytes] | None:
        if names is None:
            return None
        boards = {}
        if TREE.encode() in names.split(b";"):
            # Before the first tick there are no values.
            boards[TREE] = {
                name: moment.values[place] if moment.values else math.nan
                for name, place in moment.tree.features.items()
            }
        return [_packed(boards)]

    def _hooks(self, _: _Moment, __: bytes | None) -> list[bytes]:
        return [b"[]"]

    def _nothing(self, _: _Moment, __: bytes | None) -> list[bytes]:
        """What a watcher says when it leaves: that no breakpoint may stay; there are none."""
        return []

    def _record(self, moment: _Moment, what: bytes | None) -> list[bytes] | None:
        if what == b"start":
            before = {} if moment.halted else moment.outcomes
            self._recording = recording = _Recording(moment.tree, before)
            return [str(recording.began).encode()]
        if what == b"stop":
            if self._recording is not None:
                self._recording.goes_on = False
            return []
        return None

    def _transitions(self, moment: _Moment, _: bytes | None) -> list[bytes]:
        recording, changes = self._recording, deque[bytes](maxlen=_MOST_CHANGES)
        # That of another tree has numbers of other nodes.
        while recording is not None and recording.tree is moment.tree and recording.ticks:
            at, outcomes = recording.ticks.popleft()
            changes.extend(
                Transition(at - recording.began, node.uid, after).packed()
                for node, _, after in moment.tree.changes(recording.before, outcomes)
            )
            recording.before = outcomes
        return [b"".join(changes)]


def _packed(value: Mapping[str, object] | float | str) -> bytes:
    """As MessagePack (https://github.com/msgpack/msgpack/blob/master/spec.md)."""
    if isinstance(value, Mapping):
        head = b"\xdf" + struct.pack(">I", len(value))
        return head + b"".join(
            _packed(key) + _packed(one)  # type: ignore[arg-type]
            for key, one in value.items()
        )
    if isinstance(value, str):
        text = value.encode()
        return b"\xdb" + struct.pack(">I", len(text)) + text
    # What is missing is nothing.
    return b"\xc0" if math.isnan(value) else b"\xcb" + struct.pack(">d", value)
