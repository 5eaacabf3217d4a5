"""What a message type consists of, without regard to where that is known from.

A running robot knows it from the installed Python types, a bag from the definitions in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, TypeAlias

#: What a message without fields has, as one in C has to have something; nobody wrote it down.
FILLER: Final = "structure_needs_at_least_one_member"


class Primitive(Enum):
    """A type of values that are no messages; as messages to a person name it."""

    TRUTH = "bool"
    INTEGER = "integer"
    NUMBER = "number"
    BYTE = "byte"
    """An integer that rclpy holds as `bytes`."""
    TEXT = "string"


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message type."""

    name: str
    kind: Primitive | str
    """A primitive, or the name of a message type."""
    is_array: bool = False
    attribute: str = ""
    """Attribute of Python objects that holds it; empty where that is called like the field."""

    def __post_init__(self) -> None:
        if not self.attribute:
            object.__setattr__(self, "attribute", self.name)

    @property
    def is_integer(self) -> bool:
        """Whether it is a single integer."""
        return not self.is_array and self.kind in (Primitive.INTEGER, Primitive.BYTE)


@dataclass(frozen=True, slots=True)
class MessageType:
    """A message type.

    >>> status = MessageType(
    ...     "power_msgs/msg/Status",
    ...     (Field("status", Primitive.INTEGER), Field("cells", Primitive.NUMBER, is_array=True)),
    ...     {"STATUS_FULL": 1, "STATUS_EMPTY": 0, "VERSION": 7},
    ... )
    >>> status.names_of("status")
    {1: 'FULL', 0: 'EMPTY'}
    """

    name: str
    """Such as ``nav_msgs/msg/Odometry``."""
    fields: tuple[Field, ...]
    constants: dict[str, int] = field(default_factory=dict)
    """Integer constants in the order of the definition."""

    def field(self, name: str) -> Field | None:
        """The field of a name; None where there is none."""
        return next((one for one in self.fields if one.name == name), None)

    def names_of(self, name: str) -> dict[int, str]:
        """Names that the constants give to the values of an integer field.

        They are its own if they begin with its name, which is then left out; constants that begin
        with the name of no field belong to the only integer field that there is.  Where two
        constants have the same value, the first one names it.
        """
        prefix = f"{name.upper()}_"
        own = {
            key.removeprefix(prefix): its
            for key, its in self.constants.items()
            if key.startswith(prefix)
        }
        if not own and self._only_integer(name):
            own = self.constants
        names: dict[int, str] = {}
        for key, value in own.items():
            names.setdefault(value, key)
        return names

    def _only_integer(self, name: str) -> bool:
        return [one.name for one in self.fields if one.is_integer] == [name]


#: Looks a message type up by its name; raises `MessagePathError` where it is not known.
Definitions: TypeAlias = Callable[[str], MessageType]
