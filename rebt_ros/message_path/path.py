"""Message paths as values, and how they are written."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from typing import Final, TypeAlias

#: Names that need no quotes.
PLAIN_NAME: Final = re.compile(r"[A-Za-z_]\w*", re.ASCII)
PLAIN_TOPIC: Final = re.compile(r"(?:~?/)?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*", re.ASCII)


@dataclass(frozen=True, slots=True)
class FieldName:
    """``.name``."""

    name: str

    def __str__(self) -> str:
        return f".{_quoted(self.name)}"


@dataclass(frozen=True, slots=True)
class Index:
    """``[i]``; negative ones count from the end."""

    index: int

    def __str__(self) -> str:
        return f"[{self.index}]"


@dataclass(frozen=True, slots=True)
class Slice:
    """``[first:last]``, both included; None for the first or last element there is."""

    first: int | None
    last: int | None

    def __str__(self) -> str:
        first, last = ("" if one is None else one for one in (self.first, self.last))
        return f"[{first}:{last}]"


@dataclass(frozen=True, slots=True)
class AngleSlice:
    """``[first deg:last deg]`` without blanks: the beams of a scan from one angle to another.

    Counter-clockwise, both included.
    """

    first: float
    """Degrees."""
    last: float

    def __str__(self) -> str:
        return f"[{_number(self.first)}deg:{_number(self.last)}deg]"


@dataclass(frozen=True, slots=True)
class Entry:
    """``[name]``: the element whose name stands at the same place of a parallel array."""

    name: str

    def __str__(self) -> str:
        return f"[{_quoted(self.name)}]"


class Comparison(Enum):
    """How a filter compares."""

    EQUAL = "=="
    DIFFERENT = "!="
    AT_MOST = "<="
    AT_LEAST = ">="
    LESS = "<"
    GREATER = ">"


@dataclass(frozen=True, slots=True)
class ConstantName:
    """The name of a constant of the message type, in a filter."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Filter:
    """``{field==value}``: what does not match has no value.

    Raises:
        ValueError: The value is a text that holds both kinds of quotes, which cannot be written.
    """

    field: tuple[str, ...]
    """Names of nested fields."""
    comparison: Comparison
    value: bool | float | str | ConstantName

    def __post_init__(self) -> None:
        if isinstance(self.value, str) and '"' in self.value and "'" in self.value:
            raise ValueError(f"{self.value!r} has both kinds of quotes")

    def __str__(self) -> str:
        return f"{{{'.'.join(map(_quoted, self.field))}{self.comparison.value}{self._value}}}"

    @property
    def _value(self) -> str:
        if isinstance(self.value, bool):
            return "true" if self.value else "false"
        if isinstance(self.value, str):
            quote = "'" if '"' in self.value else '"'
            return f"{quote}{self.value}{quote}"
        return str(self.value) if isinstance(self.value, ConstantName) else _number(self.value)


@dataclass(frozen=True, slots=True)
class Function:
    """``.@name`` or ``.@name(argument)``."""

    name: str
    argument: float | None = None

    def __str__(self) -> str:
        argument = "" if self.argument is None else f"({_number(self.argument)})"
        return f".@{self.name}{argument}"


Part: TypeAlias = FieldName | Index | Slice | AngleSlice | Entry | Filter | Function


@dataclass(frozen=True, slots=True)
class MessagePath:
    """A topic, and the way to a value in its messages.

    >>> str(MessagePath("/scan", (FieldName("ranges"), AngleSlice(-15, 15), Function("min"))))
    '/scan.ranges[-15deg:15deg].@min'
    """

    topic: str
    parts: tuple[Part, ...]

    def __str__(self) -> str:
        topic = self.topic if PLAIN_TOPIC.fullmatch(self.topic) else _in_quotes(self.topic)
        return topic + "".join(map(str, self.parts))


def _quoted(name: str) -> str:
    return name if PLAIN_NAME.fullmatch(name) else _in_quotes(name)


def _in_quotes(name: str) -> str:
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _number(value: float) -> str:
    """A number so that it is read back to the last bit; 3.0 as 3."""
    whole = isinstance(value, int) or (value.is_integer() and abs(value) < 1e15)
    return str(int(value)) if whole else repr(value)
