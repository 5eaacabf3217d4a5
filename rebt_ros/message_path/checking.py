"""Checking a message path against the definition of the messages on its topic."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Final, NoReturn, TypeAlias

from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.definition import Definitions, Field, MessageType, Primitive
from rebt_ros.message_path.functions import (
    ANGLES,
    ARITHMETIC,
    LENGTH,
    NORM,
    REDUCERS,
    SCALARS,
    Angles,
    Series,
    names,
)
from rebt_ros.message_path.path import (
    AngleSlice,
    Comparison,
    ConstantName,
    Entry,
    FieldName,
    Filter,
    Function,
    Index,
    MessagePath,
    Part,
    Slice,
)
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

#: Where the ranges of a scan are, which have rules and angles.
_SCAN: Final = ("sensor_msgs/msg/LaserScan", "ranges")
#: Fields that name the elements of the arrays beside them.
_NAMES: Final = ("name", "names", "joint_names")
_QUATERNION: Final = ("x", "y", "z", "w")
_NUMBERS: Final = frozenset({Primitive.INTEGER, Primitive.BYTE, Primitive.NUMBER})


@dataclass(frozen=True, slots=True)
class CheckedPath:
    """A path of which it is known that its messages have all of it."""

    path: MessagePath
    message: str
    """Name of the type of its messages."""
    kind: Primitive
    """Of its value."""
    names: dict[int, str]
    """Names that constants give to an integer; empty where they give none."""
    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True)
class _Record:
    kind: MessageType


@dataclass(frozen=True, slots=True)
class _Array:
    element: _Record | _Value
    scan: bool = False


@dataclass(frozen=True, slots=True)
class _Value:
    kind: Primitive
    names: dict[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Rotation:
    """Roll, pitch and yaw, of which one is to be chosen."""

    order: Angles


_Shape: TypeAlias = _Record | _Array | _Value | _Rotation


def check(path: MessagePath, message: str, definitions: Definitions) -> CheckedPath:
    """Finds out what a path leads to.

    Args:
        path: The path.
        message: Name of the type of the messages on its topic.
        definitions: Knows that type, and those in it.

    Raises:
        MessagePathError: The messages lack something of it, or it leads to no single value; one
            sentence names the part at fault and what stands there instead.
    """
    checker = _Checker(path, definitions)
    checker.enter(_Record(definitions(message)))
    for place, part in enumerate(path.parts):
        checker.take(part, path.parts[place + 1 : place + 2])
    kind, names_of_values = checker.end()
    return CheckedPath(path, message, kind, names_of_values, tuple(checker.steps))


class _Checker:
    """Walks along a path and notes the steps that it takes."""

    def __init__(self, path: MessagePath, definitions: Definitions) -> None:
        self._path = path
        self._definitions = definitions
        self._shape: _Shape
        self._many = False
        self._filtered = False
        self._follows = False
        self._awaited: Entry | None = None
        self.steps: list[Step] = []

    def enter(self, shape: _Shape) -> None:
        self._shape = shape

    def take(self, part: Part, following: Iterable[Part]) -> None:
        """Goes on by a part.

        Raises:
            MessagePathError: There is no such part.
        """
        match part:
            case FieldName(name=name):
                self._field(name, next(iter(following), None))
            case Index() | Slice() | AngleSlice():
                self._brackets(part)
            case Entry():
                if part is not self._awaited:
                    self._refuse(
                        f"{part} names an element of {self._described()}: only an array whose "
                        "names are in the array 'name' beside it has named elements"
                    )
                self._awaited = None
            case Filter():
                self._filter(part)
            case Function():
                self._function(part)

    def end(self) -> tuple[Primitive, dict[int, str]]:
        """What the path gives.

        Raises:
            MessagePathError: It gives no single value.
        """
        match self._shape:
            case _Record(kind=kind):
                self._refuse(f"it ends at {kind.name}, which is no single value; {_has(kind)}")
            case _Array(element=_Value(kind=kind)) if kind in _NUMBERS:
                self._refuse(
                    "it ends at an array: choose an element, as [0], or make one value of it with "
                    f"{_listed(f'.@{name}' for name in REDUCERS)}"
                )
            case _Array():
                self._refuse(
                    "it ends at an array: choose an element, as [0], or count them with .@length"
                )
            case _Rotation(order=order):
                self._refuse(
                    f".@{order.value} gives roll, pitch and yaw: choose one, as .@{order.value}.yaw"
                )
            case _Value(kind=kind, names=names_of_values):
                if self._many and not self._filtered:
                    self._refuse(
                        "it gives several values: make one of them with "
                        f"{_listed(f'.@{name}' for name in (*REDUCERS, LENGTH))}"
                    )
                if self._many:
                    self.steps.append(First())
                return kind, names_of_values

    def _field(self, name: str, following: Part | None) -> None:
        if isinstance(self._shape, _Rotation):
            if name not in ANGLES:
                self._refuse(
                    f".@{self._shape.order.value} gives {_listed(ANGLES)}, and no {name!r}"
                )
            self._add(Euler(self._shape.order, ANGLES.index(name)), _Value(Primitive.NUMBER))
            return
        if not isinstance(self._shape, _Record):
            self._refuse(f"there is no field {name!r} in {self._described()}")
        record = self._shape.kind
        found = record.field(name)
        if found is None:
            self._refuse(f"{record.name} has no field {name!r}; {_has(record)}")
        shape = self._shape_of(record, found)
        if isinstance(following, Entry) and isinstance(shape, _Array):
            self._named(record, found, following, shape)
        elif isinstance(shape, _Array) and shape.scan:
            # Its ranges are read by their rules, which takes the whole scan.
            self._shape = shape
        else:
            kind = shape.kind if isinstance(shape, _Value) else None
            self._add(Read(found.attribute, kind), shape)

    def _named(self, record: MessageType, found: Field, entry: Entry, shape: _Array) -> None:
        beside = [one for name in _NAMES if (one := record.field(name)) is not None]
        naming = [one for one in beside if one.is_array and one.kind is Primitive.TEXT]
        if not naming or naming[0] is found:
            self._refuse(
                f"{record.name} does not name the elements of {found.name!r}, so that there is no "
                f"{entry}: choose one by its index, as [0]"
            )
        kind = shape.element.kind if isinstance(shape.element, _Value) else None
        step = NamedElement(found.attribute, naming[0].attribute, entry.name, kind)
        self._add(step, shape.element)
        self._awaited = entry

    def _shape_of(self, record: MessageType, found: Field) -> _Shape:
        element: _Record | _Value
        if isinstance(found.kind, str):
            element = _Record(self._definitions(found.kind))
        else:
            element = _Value(found.kind, {} if found.is_array else record.names_of(found.name))
        if not found.is_array:
            return element
        return _Array(element, scan=(record.name, found.name) == _SCAN)

    def _brackets(self, part: Index | Slice | AngleSlice) -> None:
        shape = self._shape
        if not isinstance(shape, _Array):
            self._refuse(f"{part} needs an array, and there is {self._described()}")
        if isinstance(part, AngleSlice) and not shape.scan:
            self._refuse(f"{part} is a slice by angle, which only the ranges of a LaserScan have")
        kind = shape.element.kind if isinstance(shape.element, _Value) else None
        if isinstance(part, Index):
            step = Range(part.index) if shape.scan else Element(part.index, kind)
            self._add(step, shape.element)
            return
        self._refuse_nested(f"{part}")
        self._add(
            Ranges(part.first, part.last, isinstance(part, AngleSlice))
            if shape.scan or isinstance(part, AngleSlice)
            else Elements(part.first, part.last, kind),
            shape.element,
        )
        self._many, self._filtered = True, False

    def _refuse_nested(self, what: str) -> None:
        if self._many:
            self._refuse(
                f"{what} is about an array in each of several elements: choose one of them"
            )

    def _filter(self, part: Filter) -> None:
        if isinstance(self._shape, _Array):
            self._refuse(f"{part} filters elements: put [:] before it")
        if not isinstance(self._shape, _Record):
            self._refuse(f"{part} compares a field, and there is {self._described()}")
        record, attributes = self._shape.kind, []
        value: _Shape = self._shape
        for place, name in enumerate(part.field, 1):
            found = record.field(name)
            if found is None:
                self._refuse(f"{record.name} has no field {name!r}; {_has(record)}")
            attributes.append(found.attribute)
            value = self._shape_of(record, found)
            if isinstance(value, _Record):
                record = value.kind
            elif place < len(part.field):
                self._refuse(f"{part} asks for a field of {name!r}, which has none")
        if not isinstance(value, _Value):
            self._refuse(f"{part} compares {part.field[-1]!r}, which is no single value")
        compared = self._compared(part, value)
        self._add(Keep(tuple(attributes), part.comparison, compared, value.kind), self._shape)
        self._filtered = True

    def _compared(self, part: Filter, value: _Value) -> bool | float | str:
        """What a field is compared with.

        Raises:
            MessagePathError: The field has no such values.
        """
        asked = part.value
        if isinstance(asked, ConstantName):
            number = next((one for one, its in value.names.items() if its == asked.name), None)
            if number is None:
                there = _listed(value.names.values()) or "none"
                self._refuse(
                    f"{part} compares with {asked}, which is no constant for "
                    f"{part.field[-1]!r}; there {'are' if value.names else 'is'} {there}"
                )
            return number
        fits = {
            Primitive.TEXT: isinstance(asked, str),
            Primitive.TRUTH: isinstance(asked, bool),
        }.get(value.kind, isinstance(asked, int | float) and not isinstance(asked, bool))
        if not fits:
            self._refuse(
                f"{part} compares {part.field[-1]!r}, which is {_a(value.kind)}, with {asked!r}"
            )
        ordered = part.comparison not in (Comparison.EQUAL, Comparison.DIFFERENT)
        if ordered and value.kind is Primitive.TRUTH:
            self._refuse(f"{part} compares true and false, which are only equal (==) or not (!=)")
        return asked

    def _function(self, part: Function) -> None:
        name = part.name
        if name not in names():
            self._refuse(f"there is no function {part}; there are {_listed(names())}")
        if name in ARITHMETIC:
            if part.argument is None:
                self._refuse(f"{part} needs a number, as .@{name}(2)")
            if name == "div" and part.argument == 0:
                self._refuse(f"{part} divides by 0")
        elif part.argument is not None:
            self._refuse(f"{part} takes no number: write .@{name}")
        if self._follows and name not in SCALARS and name not in ARITHMETIC:
            self._refuse(
                f"{part} comes after a function of two messages: only functions of a number may, "
                "and at most one of .@delta and .@derivative"
            )
        if name in {Sery.value for Sery in Series}:
            self._follow(part)
        elif name in {Angle.value for Angle in Angles}:
            self._rotation(part)
        elif name == LENGTH:
            self._length(part)
        elif name in REDUCERS:
            self._several_numbers(part)
            self._reduce(name)
        elif name == NORM:
            self._norm(part)
        else:
            self._one_number(part)
            self._add(Apply(name, part.argument), _Value(Primitive.NUMBER))

    def _follow(self, part: Function) -> None:
        self._one_number(part)
        if self._many:
            if not self._filtered:
                self._refuse(f"{part} needs a single value: choose or make one before it")
            self.steps.append(First())
            self._many = False
        self._add(Follow(Series(part.name)), _Value(Primitive.NUMBER))
        self._follows = True

    def _rotation(self, part: Function) -> None:
        shape = self._shape
        if not isinstance(shape, _Record) or not _has_numbers(shape.kind, _QUATERNION):
            self._refuse(
                f"{part} needs a quaternion (x, y, z and w), and there is {self._described()}"
            )
        self._shape = _Rotation(Angles(part.name))

    def _length(self, part: Function) -> None:
        if isinstance(self._shape, _Array):
            self._whole_array(part, self._shape)
        elif not self._many:
            self._refuse(f"{part} needs an array, and there is {self._described()}")
        self._reduce(LENGTH)

    def _norm(self, part: Function) -> None:
        shape = self._shape
        if isinstance(shape, _Record):
            axes = [one for one in ("x", "y", "z") if shape.kind.field(one)]
            if len(axes) < 2 or not _has_numbers(shape.kind, axes):
                self._refuse(
                    f"{part} needs a vector (x, y and z), and there is {self._described()}"
                )
            fields = [shape.kind.field(axis) for axis in axes]
            self._add(
                Vector(tuple(one.attribute for one in fields if one)), _Value(Primitive.NUMBER)
            )
            self._add(Reduce(NORM), _Value(Primitive.NUMBER))
            return
        self._several_numbers(part)
        self._reduce(NORM)

    def _several_numbers(self, part: Function) -> None:
        """Sees to it that there are several numbers, which may be all of an array."""
        shape = self._shape
        element = shape.element if isinstance(shape, _Array) else shape
        several = isinstance(shape, _Array) or self._many
        if not several or not isinstance(element, _Value) or element.kind not in _NUMBERS:
            self._refuse(f"{part} needs several numbers, and there is {self._described()}")
        if isinstance(shape, _Array):
            self._whole_array(part, shape)

    def _whole_array(self, part: Function, shape: _Array) -> None:
        kind = shape.element.kind if isinstance(shape.element, _Value) else None
        self._refuse_nested(str(part))
        self._add(Ranges(None, None) if shape.scan else Elements(None, None, kind), shape.element)
        self._many = True

    def _reduce(self, name: str) -> None:
        self.steps.append(Reduce(name))
        self._shape = _Value(Primitive.NUMBER)
        self._many = self._filtered = False

    def _one_number(self, part: Function) -> None:
        shape = self._shape
        if not isinstance(shape, _Value) or shape.kind not in _NUMBERS:
            self._refuse(f"{part} needs a number, and there is {self._described()}")

    def _add(self, step: Step, shape: _Shape) -> None:
        self.steps.append(replace(step, each=True) if self._many else step)
        self._shape = shape

    def _described(self) -> str:
        match self._shape:
            case _Record(kind=kind):
                return kind.name
            case _Array(element=_Record(kind=kind)):
                return f"an array of {kind.name}"
            case _Array(element=_Value(kind=primitive)):
                return f"an array, each element {_a(primitive)}"
            case _Value(kind=primitive):
                return f"{_a(primitive)}"
            case _:
                return "roll, pitch and yaw"

    def _refuse(self, why: str) -> NoReturn:
        raise MessagePathError(f"message path {str(self._path)!r}: {why}.")


def _a(kind: Primitive) -> str:
    article = "an" if kind is Primitive.INTEGER else "a"
    return f"{article} {kind.value}"


def _has(record: MessageType) -> str:
    """What a record has, in words."""
    return f"it has {_listed(one.name for one in record.fields) or 'no fields'}"


def _has_numbers(record: MessageType, fields: Iterable[str]) -> bool:
    found = [record.field(name) for name in fields]
    return all(one is not None and not one.is_array and one.kind in _NUMBERS for one in found)


def _listed(texts: Iterable[str]) -> str:
    return ", ".join(texts)
