"""What a browser can ask for to change the draft."""

from __future__ import annotations

from typing import Protocol

from rebt_ros.errors import OptionError
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import PsaChoice
from rebt_ros.studio import draft, learning_view
from rebt_ros.studio.draft import Change
from rebt_ros.studio.verbs import Answer, Arguments, Verbs


class Bench(Protocol):
    """Has the draft."""

    @property
    def learning(self) -> Learning:
        """The policy of the draft; raises `OptionError` where nothing was learned."""

    def size_of(self, number: int) -> str:
        """A pruning level in words."""

    def change(self, what: str, change: Change) -> str:
        """Changes the draft; returns what was done, in a sentence."""


class Curating:
    """Changes the draft as browsers ask.

    All methods that take arguments raise `RebtError` where what is asked for cannot be done.

    Args:
        bench: Has the draft.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def verbs(self) -> Verbs:
        """What can be asked for, by name."""
        return {
            "level": self._level,
            "attach": self._attach,
            "detach": self._detach,
            "psa": self._psa,
            "threshold": self._threshold,
            "remove": self._remove,
            "move": self._move,
            "histogram": self._histogram,
        }

    def _level(self, asked: Arguments) -> str:
        number = asked.whole("number")
        return self._bench.change(
            f"choosing {self._bench.size_of(number)}", draft.chosen_level(number)
        )

    def _attach(self, asked: Arguments) -> str:
        name = asked.text("suggestion")
        return self._bench.change(f"attaching {name}", draft.attached(name))

    def _detach(self, asked: Arguments) -> str:
        name = asked.text("suggestion")
        return self._bench.change(f"detaching {name}", draft.detached(name))

    def _psa(self, asked: Arguments) -> str:
        path, choice = asked.text("path"), asked.text("choice")
        if choice not in {one.value for one in PsaChoice}:
            raise OptionError("'choice' must be 'parallel' or 'selector'.")
        change = draft.resolved(path, PsaChoice(choice))
        return self._change("making", path, change, f" a {choice}")

    def _threshold(self, asked: Arguments) -> str:
        path, value = asked.text("path"), asked.number("value")
        end = asked.optional_text("end") or "at_most"
        if end not in {"above", "at_most"}:
            raise OptionError("'end' must be 'above' or 'at_most'.")
        change = draft.with_threshold(path, value, upper=end == "at_most")
        return self._change("changing", path, change, f" to {value:.6g}")

    def _remove(self, asked: Arguments) -> str:
        path = asked.text("path")
        return self._change("removing", path, draft.removed(path))

    def _move(self, asked: Arguments) -> str:
        path, by = asked.text("path"), asked.whole("by")
        return self._change("moving", path, draft.moved(path, by))

    def _histogram(self, asked: Arguments) -> Answer:
        path = asked.text("path")
        return path, learning_view.histogram(self._bench.learning, path)

    def _change(self, verb: str, path: str, change: Change, how: str = "") -> str:
        node = draft.words_at(self._bench.learning, path)
        return self._bench.change(f"{verb} {node}{how}", change)
