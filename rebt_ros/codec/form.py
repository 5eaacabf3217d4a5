"""What every form of a value can do.

form
    How values of one type stand in JSON: it decodes, encodes, and gives its JSON Schema.
misfit
    JSON that is not of the form: what is wrong, and the path to where it is wrong.

Forms of dataclasses are derived from their type hints (`hints`), or declared field by field
(`record`) where the JSON differs from the dataclass.
"""

from __future__ import annotations

import reprlib
from abc import ABC, abstractmethod
from typing import Any, Generic, TypeAlias, TypeVar

T = TypeVar("T")

#: What `json` reads and writes.
Json: TypeAlias = Any

#: Definitions of a JSON Schema, by name.
Definitions: TypeAlias = dict[str, Json]

#: Longest part of a value that a message shows (characters).
_LONGEST = 60

#: Shows the beginning of large values, and not more than a few levels of nested ones.
_SHORT = reprlib.Repr()
_SHORT.maxlevel = 3
_SHORT.maxstring = _LONGEST


class MisfitError(Exception):
    """A value that is not of the form that it should have.

    Args:
        problem: What is wrong, as the rest of a sentence that begins with the path.
    """

    def __init__(self, problem: str) -> None:
        super().__init__(problem)
        self._problem = problem
        self._steps: list[str] = []

    @classmethod
    def instead_of(cls, expected: str, value: object) -> MisfitError:
        """That something else was expected."""
        return cls(f"must be {expected}, not {abridged(value)}")

    def at(self, step: str) -> MisfitError:
        """The same, seen from the value that holds this one.

        Args:
            step: Such as ``.name`` or ``[3]``.
        """
        self._steps.append(step)
        return self

    def sentence(self, root: str) -> str:
        """What is wrong and where, with a full stop.

        Args:
            root: What to call the whole.
        """
        return f"{root}{''.join(reversed(self._steps))} {self._problem}."


class Form(ABC, Generic[T]):
    """How values of one type stand in JSON."""

    @abstractmethod
    def decode(self, value: Json) -> T:
        """The value that JSON stands for.

        Raises:
            MisfitError: It is not of this form.
            ValueError: It is, and the type itself refuses it.
        """

    @abstractmethod
    def encode(self, value: T) -> Json:
        """The value as JSON; `decode` is its inverse."""

    @abstractmethod
    def schema(self, definitions: Definitions) -> Json:
        """The JSON Schema (draft 2020-12) of what `decode` reads.

        Args:
            definitions: Takes up the schemas that this one refers to.
        """


def abridged(value: object) -> str:
    """A value for a message, in as little room and time as it takes to recognize it."""
    text = _SHORT.repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
