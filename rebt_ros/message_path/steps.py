"""What a path does, step by step, once it is known that all of it is there.

A step that is `each` does it to every one of the values that the step before gives; values that it
does not find are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from rebt_ros.message_path.definition import Primitive
from rebt_ros.message_path.functions import Angles, Series
from rebt_ros.message_path.path import Comparison


@dataclass(frozen=True, slots=True)
class Read:
    """Reads a field of a record."""

    attribute: str
    kind: Primitive | None
    """Of the value; None for a record or an array."""
    each: bool = False


@dataclass(frozen=True, slots=True)
class Element:
    """Takes an element of an array."""

    index: int
    kind: Primitive | None
    each: bool = False


@dataclass(frozen=True, slots=True)
class Elements:
    """Takes several elements of an array, from one index to another, both included."""

    first: int | None
    last: int | None
    kind: Primitive | None
    each: bool = False


@dataclass(frozen=True, slots=True)
class NamedElement:
    """Takes the element of a record's array at the place of a name in another array."""

    attribute: str
    names: str
    """Attribute of the array of names."""
    name: str
    kind: Primitive | None
    each: bool = False


@dataclass(frozen=True, slots=True)
class Range:
    """Takes a range of a LaserScan, by its rules (see `scan`)."""

    index: int
    each: bool = False


@dataclass(frozen=True, slots=True)
class Ranges:
    """Takes several ranges of a LaserScan by its rules, by index or by angle."""

    first: float | None
    last: float | None
    by_angle: bool = False
    """Whether they are degrees."""
    each: bool = False


@dataclass(frozen=True, slots=True)
class Keep:
    """Keeps a record if a field of it compares as asked."""

    attributes: tuple[str, ...]
    comparison: Comparison
    value: bool | float | str
    kind: Primitive
    """Of the field."""
    each: bool = False


@dataclass(frozen=True, slots=True)
class Apply:
    """Applies a function to a number."""

    name: str
    argument: float | None
    each: bool = False


@dataclass(frozen=True, slots=True)
class Vector:
    """The numbers of a record, as those of a vector."""

    attributes: tuple[str, ...]
    each: bool = False


@dataclass(frozen=True, slots=True)
class Euler:
    """Turns a quaternion into one of its angles."""

    order: Angles
    place: int
    """Position in `ANGLES`."""
    each: bool = False


@dataclass(frozen=True, slots=True)
class Reduce:
    """Makes one number of several."""

    name: str
    each: bool = False


@dataclass(frozen=True, slots=True)
class First:
    """Takes the first of several values, if there is one."""

    each: bool = False


@dataclass(frozen=True, slots=True)
class Follow:
    """Compares a number with the one before it."""

    series: Series
    each: bool = False


Step: TypeAlias = (
    Read
    | Element
    | Elements
    | NamedElement
    | Range
    | Ranges
    | Keep
    | Apply
    | Vector
    | Euler
    | Reduce
    | First
    | Follow
)
