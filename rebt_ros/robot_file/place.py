"""A value of a robot file and the way to it, for messages."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Collection, Iterator, Mapping
from enum import Enum
from typing import Final, NoReturn, TypeAlias, TypeVar

from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.robot_file import Json

#: Line of each place by the keys that lead there; empty where the value was no text.
Lines: TypeAlias = Mapping[tuple[str, ...], int]
#: Line and column of each text by the keys that lead there, behind its quote if it has one.
Starts: TypeAlias = Mapping[tuple[str, ...], tuple[int, int]]

_E = TypeVar("_E", bound=Enum)

_SHORT: Final = reprlib.Repr()
_SHORT.maxlevel = 2
_SHORT.maxstring = 60


class Place:
    """A place in a robot file.

    Args:
        value: What stands there.
        name: Name of the file.
        lines: Where which line is.
        path: Keys that lead there.
        starts: Where which text starts.
    """

    def __init__(
        self,
        value: Json,
        name: str,
        lines: Lines,
        path: tuple[str, ...] = (),
        starts: Starts | None = None,
    ) -> None:
        self.value = value
        self._name = name
        self._lines = lines
        self._path = path
        self._starts = starts or {}

    @property
    def start(self) -> tuple[int, int] | None:
        """Line and column of its text, from 1; None where that is not known."""
        return self._starts.get(self._path)

    def refuse(self, why: str) -> NoReturn:
        """Refuses the file.

        Raises:
            RobotFileError: Always; it names the place, and ends with `why`.
        """
        line = next(
            (
                f", line {self._lines[self._path[:length]]}"
                for length in range(len(self._path), -1, -1)
                if self._path[:length] in self._lines
            ),
            "",
        )
        where = ".".join(self._path)
        raise RobotFileError(f"{self._name}{line}: {f'{where} ' if where else 'it '}{why}.")

    def must_be(self, expected: str) -> NoReturn:
        """Refuses the file, because the value should be something else."""
        self.refuse(f"must be {expected}, not {_SHORT.repr(self.value)}")

    @property
    def is_map(self) -> bool:
        """Whether it is a map, which has `items`."""
        return isinstance(self.value, dict)

    def fields(self, *known: str) -> dict[str, Place]:
        """The values of a map that has no other keys than these."""
        fields = dict(self.items())
        for key, value in fields.items():
            if key not in known:
                value.refuse(f"is unknown here; known are {', '.join(known)}")
        return fields

    def items(self) -> Iterator[tuple[str, Place]]:
        """Keys and values of a map."""
        if not isinstance(self.value, dict):
            self.must_be("a map, of names and what they stand for")
        for key, value in self.value.items():
            yield key, Place(value, self._name, self._lines, (*self._path, key), self._starts)

    def elements(self) -> list[Place]:
        """The elements of a list."""
        if not isinstance(self.value, list):
            self.must_be("a list")
        return [
            Place(value, self._name, self._lines, (*self._path, str(place)), self._starts)
            for place, value in enumerate(self.value)
        ]

    def text(self) -> str:
        """A text that is not empty and can be printed; a number as it is written."""
        value = self.value
        if isinstance(value, int | float) and not isinstance(value, bool):
            return str(value)
        if not isinstance(value, str) or not value or not value.isprintable():
            self.must_be("a text")
        return value

    def number(self, least: float, most: float) -> float:
        """A number in [least, most]."""
        value = self.value
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
            or not least <= value <= most
        ):
            self.must_be(f"a number from {least:g} to {most:g}")
        return float(value)

    def truth(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            self.must_be("true or false")
        return self.value

    def one_of(self, kind: type[_E], only: Collection[_E] = ()) -> _E:
        """A member by its value."""
        members = [one for one in kind if not only or one in only]
        for member in members:
            if member.value == self.value:
                return member
        self.must_be(f"one of {', '.join(str(one.value) for one in members)}")
