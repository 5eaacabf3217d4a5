"""Forms of single values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import TypeVar

from rebt_ros.codec.form import Definitions, Form, Json, MisfitError

E = TypeVar("E", bound=Enum)


@dataclass(frozen=True, slots=True)
class Text(Form[str]):
    """A text that can be written as UTF-8."""

    def decode(self, value: Json) -> str:
        if not isinstance(value, str):
            raise MisfitError.instead_of("a text", value)
        if not value.isascii() and any("\ud800" <= each <= "\udfff" for each in value):
            raise MisfitError.instead_of("a text of whole characters", value)
        return value

    def encode(self, value: str) -> Json:
        return value

    def schema(self, definitions: Definitions) -> Json:
        return {"type": "string"}


@dataclass(frozen=True, slots=True)
class Truth(Form[bool]):
    """True or false."""

    def decode(self, value: Json) -> bool:
        if not isinstance(value, bool):
            raise MisfitError.instead_of("true or false", value)
        return value

    def encode(self, value: bool) -> Json:
        return value

    def schema(self, definitions: Definitions) -> Json:
        return {"type": "boolean"}


@dataclass(frozen=True, slots=True)
class Number(Form[float]):
    """A finite number within bounds, both of which it may have."""

    least: float = -math.inf
    most: float = math.inf

    def decode(self, value: Json) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise MisfitError.instead_of("a number", value)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number) or not self.least <= number <= self.most:
            bounds = _between(self.least, self.most)
            raise MisfitError.instead_of(
                f"a number{bounds}" if bounds else "a finite number", value
            )
        return number

    def encode(self, value: float) -> Json:
        return value

    def schema(self, definitions: Definitions) -> Json:
        return {"type": "number"} | _bounds(self.least, self.most)


@dataclass(frozen=True, slots=True)
class Whole(Form[int]):
    """A whole number within bounds, both of which it may have; JSON does not tell 2.0 from 2."""

    least: float = -math.inf
    most: float = math.inf

    def decode(self, value: Json) -> int:
        number = value
        if isinstance(number, float) and number.is_integer():
            number = int(number)
        if (
            isinstance(number, bool)
            or not isinstance(number, int)
            or not self.least <= number <= self.most
        ):
            raise MisfitError.instead_of(f"a whole number{_between(self.least, self.most)}", value)
        return number

    def encode(self, value: int) -> Json:
        return value

    def schema(self, definitions: Definitions) -> Json:
        return {"type": "integer"} | _bounds(self.least, self.most)


class Choice(Form[E]):
    """A member of an enum, by its value.

    Args:
        kind: The enum; its values are texts.
    """

    def __init__(self, kind: type[E]) -> None:
        self._members = {str(member.value): member for member in kind}

    def decode(self, value: Json) -> E:
        member = self._members.get(value) if isinstance(value, str) else None
        if member is None:
            raise MisfitError.instead_of(f"one of {', '.join(self._members)}", value)
        return member

    def encode(self, value: E) -> Json:
        return value.value

    def schema(self, definitions: Definitions) -> Json:
        return {"enum": list(self._members)}


def _between(least: float, most: float) -> str:
    if most < math.inf:
        return f" from {least:g} to {most:g}" if least > -math.inf else f" of at most {most:g}"
    return f" of at least {least:g}" if least > -math.inf else ""


def _bounds(least: float, most: float) -> dict[str, float]:
    bounds = {"minimum": least, "maximum": most}
    return {name: bound for name, bound in bounds.items() if math.isfinite(bound)}
