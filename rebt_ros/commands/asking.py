"""A person at the terminal who says how episodes went."""

from __future__ import annotations

import os
import select
import sys
from typing import Final

from rebt_ros.trial.errors import TrialError
from rebt_ros.trial.outcome import VoidEpisodeError

_ANSWERS: Final = {"y": True, "yes": True, "n": False, "no": False}
_AGAIN: Final = frozenset({"r", "repeat"})
#: Bytes that are read at once.
_MOST: Final = 4096

_QUESTION: Final = "Has it succeeded? y, n, or r to drive it again: "


class AskingJudge:
    """Asks on standard error and reads standard input; does not say which tree drives.

    A person who knows which one they would like to win judges less fairly.
    """

    def __init__(self) -> None:
        self._input = sys.stdin.fileno()
        self._typed = b""
        self._episodes = 0

    def begin(self) -> None:
        """Asks for the robot to be put at its start."""
        self._episodes += 1
        self._say(f"\nEpisode {self._episodes}: put the robot at its start, then press Enter: ")

    def ready(self) -> bool:
        """Whether Enter was pressed.

        Raises:
            TrialError: Nobody is there to answer.
        """
        if self._line() is None:
            return False
        self._say(f"It drives. {_QUESTION}")
        return True

    def success(self) -> bool | None:
        """What was answered; None while nothing was.

        Raises:
            TrialError: Nobody is there to answer.
            VoidEpisodeError: The episode is to be driven again.
        """
        line = self._line()
        if line is None:
            return None
        word = line.strip().casefold()
        if word in _AGAIN:
            raise VoidEpisodeError
        if word not in _ANSWERS:
            self._say(_QUESTION)
        return _ANSWERS.get(word)

    def _line(self) -> str | None:
        """The next line; None where there is none yet."""
        if b"\n" not in self._typed and select.select([self._input], [], [], 0.0)[0]:
            read = os.read(self._input, _MOST)
            if not read:
                raise TrialError("nobody answers any more: standard input was closed.")
            self._typed += read
        if b"\n" not in self._typed:
            return None
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace")

    def _say(self, text: str) -> None:
        print(text, end="", file=sys.stderr, flush=True)
