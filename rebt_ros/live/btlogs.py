"""Logs of what the executor does, one for each tree, written beside its ticks."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from queue import Full, Queue

from rebt_ros.errors import RebtError
from rebt_ros.export.watched import WatchedTree
from rebt_ros.storage.btlog import BtLogWriter, Transition

#: Ticks that may wait to be written: eight minutes at 20 Hz.
_MOST_WAITING = 10_000
#: How long `close` waits for what is not written yet (seconds).
_PATIENCE = 5.0


class BtLogs:
    """Writes a log for each tree that is ticked, in a thread of its own.

    Where the disk is slow ticks wait, and where it stands still they are left out and counted:
    nothing that is called here waits for it, except `close`.

    Args:
        directory: Where the logs are; made when there is something to write.
    """

    def __init__(self, directory: Path) -> None:
        self.lost = 0
        """Ticks that are in no log."""
        self.fault = ""
        """Why the tree that runs has no log, or no more of it; a sentence, or empty."""
        self._directory = directory
        self._waiting: Queue[tuple[WatchedTree, int, Mapping[int, str]] | None] = Queue(
            _MOST_WAITING
        )
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def tick(self, tree: WatchedTree, outcomes: Mapping[int, str]) -> None:
        """The tree was ticked, or halted.

        Args:
            tree: The tree.
            outcomes: From `TreeRuntime.outcomes`; empty where it was halted.
        """
        try:
            self._waiting.put_nowait((tree, time.time_ns() // 1000, outcomes))
        except Full:
            self.lost += 1

    def close(self) -> None:
        """Writes what waits, if that can be done within ten seconds."""
        with suppress(Full):
            self._waiting.put(None, timeout=_PATIENCE)
        self._thread.join(_PATIENCE)

    def _run(self) -> None:
        log: _Log | None = None
        while (tick := self._waiting.get()) is not None:
            tree, at, outcomes = tick
            try:
                if log is None or log.tree is not tree:
                    if log is not None:
                        log.close()
                    self.fault = ""
                    log = _Log(tree)
                    log.open(self._directory, at)
                log.write(at, outcomes)
                if self._waiting.empty():
                    log.flush()
            except RebtError as err:
                self.fault = str(err)
                self.lost += 1
                assert log is not None
                log.give_up()
        if log is not None:
            with suppress(RebtError):
                log.close()


class _Log:
    """The log of one tree; after `give_up` it takes ticks and writes none."""

    def __init__(self, tree: WatchedTree) -> None:
        self.tree = tree
        self._writer: BtLogWriter | None = None
        self._began = 0
        self._before: Mapping[int, str] = {}

    def open(self, directory: Path, at: int) -> None:
        """Begins a file whose name tells when that was.

        Args:
            directory: Where it is.
            at: Microseconds since 1970.

        Raises:
            StorageError: It cannot be written.
        """
        self._began = at
        stem = time.strftime("%Y%m%d-%H%M%S", time.gmtime(at / 1e6))
        names = (f"{stem}{f'-{number}' if number > 1 else ''}.btlog" for number in count(1))
        path = next(path for name in names if not (path := directory / name).exists())
        self._writer = BtLogWriter(path, self.tree.xml, at, anew=True)

    def write(self, at: int, outcomes: Mapping[int, str]) -> None:
        """Adds what has changed since the tick before.

        Raises:
            StorageError: It cannot be written.
        """
        if self._writer is not None:
            self._writer.write(
                Transition(at - self._began, node.uid, status)
                for node, _, status in self.tree.changes(self._before, outcomes)
            )
        self._before = outcomes

    def flush(self) -> None:
        """Hands what was written to the operating system.

        Raises:
            StorageError: It cannot be written.
        """
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        """Ends the file.

        Raises:
            StorageError: The last of it cannot be written.
        """
        if self._writer is not None:
            self._writer.close()

    def give_up(self) -> None:
        """Leaves the file as it is."""
        if self._writer is not None:
            with suppress(RebtError):
                self._writer.close()
        self._writer = None
