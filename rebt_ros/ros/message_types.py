"""The message types that are installed, as the definitions of message paths and as classes."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.definition import FILLER, Field, MessageType, Primitive

#: Package and name of a type.
_NAME: Final = re.compile(r"([a-z][a-z0-9_]*)/(?:(msg|srv|action)/)?([A-Za-z]\w*)", re.ASCII)
_SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, \d+)?>")
_ARRAY: Final = re.compile(r"(.+)\[\d+\]")

_PRIMITIVES: Final = {
    "boolean": Primitive.TRUTH,
    "octet": Primitive.BYTE,
    "float": Primitive.NUMBER,
    "double": Primitive.NUMBER,
    "long double": Primitive.NUMBER,
}
_INTEGERS: Final = re.compile(r"u?int\d+|char|wchar")

#: Ends the names of defaults, which rclpy keeps among the constants.
_DEFAULT: Final = "__DEFAULT"


@cache
def message_class(name: str) -> type[Any]:
    """The class of a message type.

    Args:
        name: Such as ``nav_msgs/msg/Odometry``, or without ``msg``.

    Raises:
        MessagePathError: It is not installed, and so on: one sentence says what is.
    """
    found = _class(name, "msg", "message", "nav_msgs/msg/Odometry")
    if not hasattr(found, "get_fields_and_field_types"):
        raise MessagePathError(f"{name} is no message.")
    return found


@cache
def service_class(name: str) -> type[Any]:
    """The class of a service type, such as ``std_srvs/srv/Trigger``; see `message_class`."""
    return _class(name, "srv", "service", "std_srvs/srv/Trigger")


@cache
def action_class(name: str) -> type[Any]:
    """The class of an action type, such as ``nav2_msgs/action/Spin``; see `message_class`."""
    return _class(name, "action", "action", "nav2_msgs/action/Spin")


def _class(name: str, interface: str, noun: str, example: str) -> type[Any]:
    """The class of a type of an interface, which messages call by a noun."""
    match = _NAME.fullmatch(name)
    if match is None or match[2] not in (None, interface):
        raise MessagePathError(f"{name!r} is no name of a {noun} type: write it as {example}.")
    package, kind = match[1], match[3]
    if not _has(package, interface):
        raise MessagePathError(
            f"the package {package} of {name} is not installed: install "
            f"ros-jazzy-{package.replace('_', '-')}, or source the workspace that it is built in."
        )
    try:
        module = import_module(f"{package}.{interface}")
    except Exception as err:  # whatever a broken installation raises
        raise MessagePathError(
            f"the {noun} types of the package {package} cannot be loaded ({err}): install it again."
        ) from err
    found = getattr(module, kind, None)
    if not isinstance(found, type):
        raise MessagePathError(f"the package {package} has no {noun} {kind!r}.")
    return found


@cache
def installed(name: str) -> MessageType:
    """The definition of a message type that is installed.

    Raises:
        MessagePathError: It is not.
    """
    kind = message_class(name)
    package, short = kind.__module__.split(".")[0], kind.__name__
    return MessageType(
        f"{package}/msg/{short}",
        tuple(
            _field(field, its)
            for field, its in kind.get_fields_and_field_types().items()
            if field != FILLER
        ),
        _constants(kind),
    )


def _has(package: str, interface: str) -> bool:
    # The package itself is not loaded: the name may come from a document, and be that of anything.
    spec = find_spec(package)
    places = spec.submodule_search_locations if spec else None
    return any(Path(place, interface, "__init__.py").exists() for place in places or ())


def _constants(kind: type[Any]) -> dict[str, int]:
    """The integers among the constants of a class."""
    constants: dict[str, int] = {}
    for name, value in type(kind).__prepare__("", ()).items():
        if name.endswith(_DEFAULT) or isinstance(value, bool):
            continue
        if isinstance(value, bytes) and len(value) == 1:
            constants[name] = value[0]
        elif isinstance(value, int):
            constants[name] = value
    return constants


def _field(name: str, kind: str) -> Field:
    array = _SEQUENCE.fullmatch(kind) or _ARRAY.fullmatch(kind)
    return Field(name, _kind(array[1] if array else kind), array is not None)


def _kind(name: str) -> Primitive | str:
    if name in _PRIMITIVES:
        return _PRIMITIVES[name]
    if _INTEGERS.fullmatch(name):
        return Primitive.INTEGER
    if name.startswith(("string", "wstring")):
        return Primitive.TEXT
    package, _, short = name.partition("/")
    return f"{package}/msg/{short.removeprefix('msg/')}"
