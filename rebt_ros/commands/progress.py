"""A progress bar on the terminal for work that takes a while."""

from __future__ import annotations

import sys
import time

#: Work that is done sooner needs no bar (seconds).
_PATIENCE = 2.0
_WIDTH = 30


class ProgressBar:
    """Draws on stderr, if that is a terminal, once two seconds have passed."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._drawn = False

    def __call__(self, stage: str, share: float) -> None:
        """Shows the stage and the share of the work, from 0 to 1, that is done."""
        if share >= 1:
            self.clear()
        elif sys.stderr.isatty() and time.monotonic() - self._start > _PATIENCE:
            done = round(share * _WIDTH)
            bar = "█" * done + "░" * (_WIDTH - done)
            print(f"\r\033[K{bar} {share:4.0%} {stage}", end="", file=sys.stderr, flush=True)
            self._drawn = True

    def clear(self) -> None:
        """Takes the bar away."""
        if self._drawn:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
            self._drawn = False
