"""Work beside the node's callbacks, for what takes longer than a tick."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

A = TypeVar("A")
B = TypeVar("B")


class Background(Generic[A, B]):
    """Does one piece of work after the other in a thread of its own.

    Of several pieces that wait only the latest is done.

    Args:
        work: Done in the thread; must return whatever happens.
        done: Called in the thread when there is a result to `take`.
    """

    def __init__(self, work: Callable[[A], B], done: Callable[[], None]) -> None:
        self._work = work
        self._done = done
        self._changed = threading.Condition()
        self._waiting: list[A] = []
        self._results: list[B] = []
        self._closed = False
        # It must not keep a process from ending.
        threading.Thread(target=self._run, daemon=True).start()

    def put(self, piece: A) -> None:
        """Has the piece worked on."""
        with self._changed:
            self._waiting = [piece]
            self._changed.notify()

    def take(self) -> list[B]:
        """The results since the last call, oldest first."""
        with self._changed:
            results, self._results = self._results, []
            return results

    def close(self) -> None:
        """Begins nothing any more and says nothing any more."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and not self._closed:
                    self._changed.wait()
                if self._closed:
                    return
                piece = self._waiting.pop()
            result = self._work(piece)
            with self._changed:
                if self._closed:
                    return
                self._results.append(result)
                self._done()
