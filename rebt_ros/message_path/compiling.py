"""Turning a checked path into a function that reads it from messages.

Nothing is evaluated: a getter is made of functions that read attributes and elements.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final, TypeAlias, cast

from rebt_ros.message_path.checking import CheckedPath
from rebt_ros.message_path.definition import Primitive
from rebt_ros.message_path.functions import (
    ARITHMETIC,
    LENGTH,
    NORM,
    REDUCERS,
    SCALARS,
    Series,
    euler,
    norm,
)
from rebt_ros.message_path.path import Comparison
from rebt_ros.message_path.scan import SCAN_FIELDS, Beams, range_at
from rebt_ros.message_path.steps import (
    Apply,
    Element,
    Elements,
    Euler,
    First,
    Follow,
    Keep,
    NamedElement,
    Range,
    Ranges,
    Read,
    Reduce,
    Step,
    Vector,
)

#: A value of a message: a number (truth is 0 or 1), a text, or None where it is missing.
Value: TypeAlias = float | str | None
#: Reads a value from a message that was received, or sent, at a time in nanoseconds.  Those of
#: `.@delta` and `.@derivative` are to be called with one message after the other.
Getter: TypeAlias = Callable[[object, int], Value]

_Function: TypeAlias = Callable[[Any], Any]

_COMPARISONS: Final[Mapping[Comparison, Callable[[Any, Any], bool]]] = {
    Comparison.EQUAL: operator.eq,
    Comparison.DIFFERENT: operator.ne,
    Comparison.AT_MOST: operator.le,
    Comparison.AT_LEAST: operator.ge,
    Comparison.LESS: operator.lt,
    Comparison.GREATER: operator.gt,
}


def attribute_of(path: CheckedPath) -> str | None:
    """The dotted attribute that is all that a path of a number reads; None where it does more."""
    if path.kind in (Primitive.TEXT, Primitive.BYTE):
        return None
    reads = [step.attribute for step in path.steps if isinstance(step, Read)]
    return ".".join(reads) if len(reads) == len(path.steps) else None


def wanted_of(path: CheckedPath) -> tuple[tuple[str, ...], ...]:
    """The attributes of messages that a path reads, each with all that is in it."""
    attributes: tuple[str, ...] = ()
    for step in path.steps:
        match step:
            case Read(attribute=attribute):
                attributes = (*attributes, attribute)
            case Range() | Ranges():
                return tuple((*attributes, one) for one in SCAN_FIELDS)
            case NamedElement(attribute=attribute, names=names):
                return (*attributes, attribute), (*attributes, names)
            case _:
                return (attributes,)
    return (attributes,)


def getter(path: CheckedPath) -> Getter:
    """The function that reads a path."""
    steps, last = list(path.steps), _text if path.kind is Primitive.TEXT else _finite
    place = next((at for at, step in enumerate(steps) if isinstance(step, Follow)), None)
    if place is None:
        return _timeless(_chained([*_functions(steps), last]))
    follow = cast(Follow, steps[place])
    before = _chained([*_functions(steps[:place]), _finite])
    following = _Following(follow.series)
    after = _chained([*_functions(steps[place + 1 :]), last])

    def read(message: object, stamp: int) -> Value:
        grown = following.take(before(message), stamp)
        return None if grown is None else cast(Value, after(grown))

    return read


def _timeless(read: Callable[[Any], Value]) -> Getter:
    """A getter that does not look at the time."""
    return lambda message, _: read(message)


class _Following:
    """Compares a number with the one before it."""

    def __init__(self, series: Series) -> None:
        self._per_second = series is Series.DERIVATIVE
        self._before: tuple[float, int] | None = None

    def take(self, value: float | None, stamp: int) -> float | None:
        """How much it has grown, or by second; None for the first number, and for none."""
        if value is None:
            return None
        before, self._before = self._before, (value, stamp)
        if before is None:
            return None
        grown, seconds = value - before[0], (stamp - before[1]) / 1e9
        if not self._per_second:
            return grown
        # Two messages of one instant, and a clock that was set back, tell of no rate.
        return grown / seconds if seconds > 0 else None


def _functions(steps: Sequence[Step]) -> list[_Function]:
    """The functions of some steps, fewer than those where several can be done at once."""
    functions: list[_Function] = []
    attributes: list[str] = []
    skip = False
    for step, following in pairwise([*steps, None]):
        assert step is not None
        if skip:
            skip = False
        elif isinstance(step, Read) and not step.each:
            attributes.append(step.attribute)
            if not (isinstance(following, Read) and not following.each):
                functions += [operator.attrgetter(".".join(attributes)), *_conversion(step.kind)]
                attributes = []
        else:
            at_once = _at_once(step, following)
            skip = at_once is not None
            functions.append(at_once or _function(step))
    return functions


def _at_once(step: Step, following: Step | None) -> _Function | None:
    """Both steps in one function, if there is such a one."""
    if not (isinstance(step, Ranges) and isinstance(following, Reduce)) or step.each:
        return None
    beams = Beams(step.first, step.last, step.by_angle)
    return {"min": beams.least, "max": beams.largest, "mean": beams.mean}.get(following.name)


def _function(step: Step) -> _Function:
    one = _single(step)
    if not step.each:
        return one
    return lambda values: [found for value in values if (found := one(value)) is not None]


def _single(step: Step) -> _Function:
    """What a step does to one value, which is not None."""
    match step:
        case Read(attribute=attribute, kind=kind):
            return _chained([operator.attrgetter(attribute), *_conversion(kind)])
        case Element(index=index, kind=kind):
            return _chained([_element(index), *_conversion(kind)])
        case Elements(first=first, last=last, kind=kind):
            return _elements(first, last, kind)
        case NamedElement():
            return _chained([_Named(step), *_conversion(step.kind)])
        case Range(index=index):
            return lambda scan: range_at(scan, index)
        case Ranges(first=begin, last=end, by_angle=by_angle):
            beams = Beams(begin, end, by_angle)
            return lambda scan: beams.ranges(scan).tolist()
        case Keep():
            return _kept(step)
        case Apply(name=name, argument=None):
            return SCALARS[name]
        case Apply(name=name, argument=argument):
            assert argument is not None
            return ARITHMETIC[name](argument)
        case Vector(attributes=attributes):
            return operator.attrgetter(*attributes)
        case Euler(order=order, place=place):
            components = operator.attrgetter("x", "y", "z", "w")

            def angle(quaternion: Any) -> float | None:
                angles = euler(order, *components(quaternion))
                return None if angles is None else angles[place]

            return angle
        case Reduce(name=name):
            return len if name == LENGTH else norm if name == NORM else REDUCERS[name]
        case First():
            return lambda values: values[0] if values else None
        case Follow():
            raise ValueError("it is no function of one message")


def _chained(functions: Sequence[_Function]) -> _Function:
    """One function after the other, up to one that gives nothing."""
    if len(functions) == 1:
        return functions[0]
    if len(functions) == 2:
        first, second = functions

        def both(value: Any) -> Any:
            between = first(value)
            return None if between is None else second(between)

        return both

    def all_of_them(value: Any) -> Any:
        for function in functions:
            value = function(value)
            if value is None:
                return None
        return value

    return all_of_them


def _conversion(kind: Primitive | None) -> list[_Function]:
    """What makes a value the same whether it comes from rclpy or from rosbags."""
    match kind:
        case Primitive.BYTE:
            return [_whole]
        case Primitive.INTEGER:
            return [int]
        case Primitive.NUMBER:
            # Elements of numpy's arrays would go on with their own precision.
            return [float]
        case Primitive.TRUTH:
            return [bool]
        case _:
            return []


def _whole(value: Any) -> int:
    return value[0] if isinstance(value, bytes) else int(value)


def _element(index: int) -> _Function:
    def element(array: Any) -> Any:
        try:
            return array[index]
        except IndexError:
            return None

    return element


def _elements(first: int | None, last: int | None, kind: Primitive | None) -> _Function:
    part = slice(first, None if last is None or last == -1 else last + 1)

    def elements(array: Any) -> Any:
        values = array[part]
        # Those of array.array and numpy, as Python's numbers.
        return values.tolist() if hasattr(values, "tolist") else values

    if kind is Primitive.BYTE:
        return lambda array: [_whole(one) for one in array[part]]
    return elements


class _Named:
    """Finds an element by its name; where the names stay as they are, without a search."""

    def __init__(self, step: NamedElement) -> None:
        self._arrays = operator.attrgetter(step.attribute, step.names)
        self._name = step.name
        self._place = 0

    def __call__(self, record: Any) -> Any:
        values, names = self._arrays(record)
        try:
            if names[self._place] != self._name:
                self._place = names.index(self._name)
            return values[self._place]
        except IndexError:
            # There are fewer names than before, or fewer elements than names.
            self._place = 0
            return values[names.index(self._name)] if self._has(names, values) else None
        except ValueError:
            return None

    def _has(self, names: Any, values: Any) -> bool:
        return self._name in names and names.index(self._name) < len(values)


def _kept(step: Keep) -> _Function:
    read = _chained([operator.attrgetter(".".join(step.attributes)), *_conversion(step.kind)])
    compare, wanted = _COMPARISONS[step.comparison], step.value
    return lambda record: record if compare(read(record), wanted) else None


def _finite(value: Any) -> float | None:
    """A number as a feature has it."""
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _text(value: Any) -> str:
    return str(value)
