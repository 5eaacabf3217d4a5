"""Declaring a node's parameters: each with type, range, description, and one clear sentence.

A parameter is *fixed* where the node reads it once, when it starts: setting it later is refused
instead of being ignored.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, cast

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterUninitializedException,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from rebt_ros.errors import OptionError

T = TypeVar("T")

_TYPES = {
    bool: "true or false",
    int: "an integer",
    float: "a number with a decimal point, such as 1.0",
    str: "a text",
    list: "a list of texts",
}

#: Parameters that rclpy itself declares once it opens what they are about.
_BUILT_IN = "qos_overrides./clock."


class Parameters:
    """Declares parameters of a node; every method returns a function that reads the value.

    All of them raise `OptionError` where the value that the node was started with has another
    type or lies out of range.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._declared: list[str] = []
        self._choices: dict[str, tuple[str, ...]] = {}
        node.add_on_set_parameters_callback(self._refuse_other_choices)

    def flag(
        self, name: str, default: bool, description: str, *, fixed: bool = True
    ) -> Callable[[], bool]:
        """A Boolean."""
        return self._declare(name, default, _descriptor(description, fixed))

    def integer(
        self, name: str, default: int, description: str, low: int, high: int, *, fixed: bool = True
    ) -> Callable[[], int]:
        """An integer in [low, high]."""
        descriptor = _descriptor(description, fixed)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
        return self._declare(name, default, descriptor)

    def number(
        self,
        name: str,
        default: float,
        description: str,
        low: float,
        high: float,
        *,
        fixed: bool = True,
    ) -> Callable[[], float]:
        """A number in [low, high]."""
        descriptor = _descriptor(description, fixed)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        return self._declare(name, default, descriptor)

    def text(
        self,
        name: str,
        default: str,
        description: str,
        *,
        choices: Sequence[str] = (),
        fixed: bool = True,
    ) -> Callable[[], str]:
        """A text; one of `choices` where there are some."""
        descriptor = _descriptor(description, fixed)
        if choices:
            self._choices[name] = tuple(choices)
            descriptor.additional_constraints = f"one of: {', '.join(choices)}"
        return self._declare(name, default, descriptor)

    def texts(
        self, name: str, default: Sequence[str], description: str, *, fixed: bool = True
    ) -> Callable[[], tuple[str, ...]]:
        """A list of texts.  Empty ones do not count: ROS 2 cannot write down an empty list."""
        descriptor = _descriptor(description, fixed)
        read = self._declare(name, list(default) or [""], descriptor)
        return lambda: tuple(one for one in read() or () if one)

    def directory(
        self, name: str, default: str, description: str, *, fixed: bool = True
    ) -> Callable[[], Path]:
        """A directory; ``~`` is the user's home.

        The default one of a node in a namespace is a directory of that name in it, so that robots
        side by side do not share theirs by accident.

        Raises:
            OptionError: It is empty, or the home of nobody.
        """
        read = self.text(name, default, description, fixed=fixed)

        def path() -> Path:
            if not read():
                raise OptionError(f"parameter {name!r} is empty: give it a directory.")
            given = at_home(name, read())
            if read() == default:
                return given / self._node.get_namespace().strip("/")
            return given

        path()
        return path

    def refuse_others(self) -> None:
        """Refuses what the node was started with and nobody has declared, such as mistyped names.

        Raises:
            OptionError: There is such a parameter.
        """
        # rclpy has no public way to see them.
        for name in self._node._parameter_overrides:
            if self._node.has_parameter(name) or name.startswith(_BUILT_IN):
                continue
            close = get_close_matches(name, self._declared, n=1)
            advice = (
                f"did you mean {close[0]!r}?"
                if close
                else f"there are {', '.join(sorted(self._declared))}; in a parameter file, what "
                "stands under /** is for every node."
            )
            raise OptionError(f"there is no parameter {name!r}: {advice}")

    def _declare(self, name: str, default: T, descriptor: ParameterDescriptor) -> Callable[[], T]:
        self._declared.append(name)
        try:
            self._node.declare_parameter(name, default, descriptor)
        except InvalidParameterTypeException as err:
            raise OptionError(
                f"parameter {name!r} must be {_TYPES[type(default)]}, "
                f"not {self._started_with(name)!r}."
            ) from err
        except InvalidParameterValueException as err:
            raise OptionError(
                f"parameter {name!r} must be {_allowed(descriptor)}, "
                f"not {self._started_with(name)!r}."
            ) from err
        # A list that is given as [] has no type to ROS 2, and the parameter then has no value.
        if not isinstance(default, list) and self._value(name) is None:
            raise OptionError(f"parameter {name!r} must be {_TYPES[type(default)]}, not empty.")
        return lambda: cast(T, self._value(name))

    def _value(self, name: str) -> Any:
        try:
            return self._node.get_parameter(name).value
        except ParameterUninitializedException:
            return None

    def _started_with(self, name: str) -> Any:
        # rclpy has no public way to see a value that it refused.
        value = self._node._parameter_overrides[name].value
        return list(value) if isinstance(value, array) else value

    def _refuse_other_choices(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            choices = self._choices.get(parameter.name, ())
            if choices and parameter.value not in choices:
                return SetParametersResult(
                    successful=False,
                    reason=f"{parameter.name} must be one of {', '.join(choices)}, "
                    f"not {parameter.value!r}",
                )
        return SetParametersResult(successful=True)


def at_home(parameter: str, path: str) -> Path:
    """A path in which ``~`` is the user's home.

    Raises:
        OptionError: There is no such home.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError as err:
        raise OptionError(
            f"parameter {parameter!r} is {path!r}, but there is no such home: write out the path."
        ) from err


def _descriptor(description: str, fixed: bool) -> ParameterDescriptor:
    return ParameterDescriptor(description=description, read_only=fixed)


def _allowed(descriptor: ParameterDescriptor) -> str:
    for span in (*descriptor.integer_range, *descriptor.floating_point_range):
        return f"in [{span.from_value:g}, {span.to_value:g}]"
    return str(descriptor.additional_constraints)


def nanoseconds(seconds: float) -> int:
    """A duration as clocks and stamps count it."""
    return round(seconds * 1e9)
