"""Messages with values that a robot file gives."""

from __future__ import annotations

import re
from array import array
from typing import Any, Final

from rebt_ros.errors import MessagePathError
from rebt_ros.robot_file.place import Place
from rebt_ros.ros.message_types import message_class

_INTEGER: Final = re.compile(r"(u?)int(\d+)")
_SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, (\d+))?>")
_ARRAY: Final = re.compile(r"(.+)\[(\d+)\]")
_LARGEST_FLOAT: Final = 3e38


def fill(message: Any, place: Place) -> Any:
    """Sets the fields of a message that a place names, and returns it.

    Raises:
        RobotFileError: It has no such field, or one of another type; a sentence says which.
    """
    kinds = message.get_fields_and_field_types()
    for name, value in place.items():
        if name not in kinds:
            there = ", ".join(kinds) or "no fields"
            value.refuse(f"is no field of {_name(message)}; it has {there}")
        setattr(message, name, _value(kinds[name], getattr(message, name), value))
    return message


def _value(kind: str, before: Any, place: Place) -> Any:
    several = _SEQUENCE.fullmatch(kind) or _ARRAY.fullmatch(kind)
    if several is not None:
        return _values(kind, several, before, place)
    if kind == "boolean":
        return place.truth()
    if kind in ("float", "double"):
        return place.number(-_LARGEST_FLOAT, _LARGEST_FLOAT)
    if kind == "octet":
        return bytes([_whole(place, 0, 255)])
    if integer := _INTEGER.fullmatch(kind):
        most = 2 ** int(integer[2]) if integer[1] else 2 ** (int(integer[2]) - 1)
        return _whole(place, 0 if integer[1] else -most, most - 1)
    if kind.startswith(("string", "wstring")):
        return "" if place.value in ("", None) else place.text()
    try:
        return fill(message_class(kind)(), place)
    except MessagePathError as err:
        place.refuse(f"is wrong, as {str(err).rstrip('.')}")


def _values(kind: str, several: re.Match[str], before: Any, place: Place) -> Any:
    """The elements of an array, in what the message holds them in."""
    elements = place.elements()
    fixed, most = kind.endswith("]"), several[2]
    if most is not None and (len(elements) > int(most) or (fixed and len(elements) != int(most))):
        place.must_be(f"a list of {'' if fixed else 'at most '}{most} elements")
    values = [_value(several[1], None, element) for element in elements]
    return array(before.typecode, values) if isinstance(before, array) else values


def _whole(place: Place, least: int, most: int) -> int:
    value = place.value
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        place.must_be(f"a whole number from {least} to {most}")
    return value


def _name(message: Any) -> str:
    package = type(message).__module__.split(".")[0]
    return f"{package}/{type(message).__name__}"
