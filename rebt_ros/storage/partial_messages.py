"""Decoding a part of a message: the fields that are asked for, and none behind the last of them.

A message of CDR is a row of stretches of fixed size, with strings and sequences between them.  What
lies within a stretch is read at once, whatever messages within messages it belongs to.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Final, TypeAlias

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

#: Attributes that lead to a value, or to a message with all that is in it.
Attributes: TypeAlias = tuple[str, ...]

#: How the types of fixed size are written for `struct`, and for numpy.
_FIXED: Final[Mapping[str, tuple[str, str]]] = {
    "bool": ("?", "?"),
    "byte": ("B", "u1"),
    "octet": ("B", "u1"),
    "char": ("B", "u1"),
    "int8": ("b", "i1"),
    "uint8": ("B", "u1"),
    "int16": ("h", "i2"),
    "uint16": ("H", "u2"),
    "int32": ("i", "i4"),
    "uint32": ("I", "u4"),
    "int64": ("q", "i8"),
    "uint64": ("Q", "u8"),
    "float32": ("f", "f4"),
    "float64": ("d", "f8"),
}
#: From here on, a wide string has whole characters instead of units of UTF-16.
_LARGEST_UNIT: Final = 0xFFFF
_ORDERS: Final = {b"\0\1": "<", b"\0\0": ">"}
_LENGTHS: Final = {order: struct.Struct(f"{order}I") for order in _ORDERS.values()}
_HEAD: Final = 4


@dataclass(frozen=True, slots=True)
class _Fixed:
    """A value of fixed size, or an array of them."""

    code: str
    """For `struct`."""
    kind: str
    """For numpy."""
    count: int | None
    """Elements of an array; None of a single value."""
    wanted: bool


@dataclass(slots=True)
class _Stretch:
    """Values of fixed size, one after the other."""

    fields: list[_Fixed] = field(default_factory=list)
    arrays: bool = False
    """Whether arrays are wanted."""
    known: dict[tuple[str, int], struct.Struct] = field(default_factory=dict)

    def read(self, data: bytes, place: int, order: str, into: list[Any]) -> int:
        """Reads what is wanted, and returns where the next value begins."""
        key = (order, place % 8)
        packed = self.known.get(key)
        if packed is None:
            packed = self.known[key] = self._packed(*key)
        found = packed.unpack_from(data, _HEAD + place)
        if self.arrays:
            wanted = [one for one in self.fields if one.wanted]
            found = tuple(
                value if one.count is None else np.frombuffer(value, f"{order}{one.kind}")
                for one, value in zip(wanted, found, strict=True)
            )
        into.extend(found)
        return place + packed.size

    def _packed(self, order: str, offset: int) -> struct.Struct:
        """The stretch where it begins so many bytes behind a multiple of 8."""
        parts, place, skipped = [order], offset, 0
        for one in self.fields:
            size = struct.calcsize(f"={one.code}")
            padding, whole = -place % size, size * (1 if one.count is None else one.count)
            place += padding + whole
            skipped += padding
            if one.wanted:
                parts += [f"{skipped}x", one.code if one.count is None else f"{whole}s"]
                skipped = 0
            else:
                skipped += whole
        parts.append(f"{skipped}x")
        return struct.Struct("".join(part for part in parts if part != "0x"))


@dataclass(frozen=True, slots=True)
class _WideText:
    """A wide string: the middleware of ROS 2 has four bytes for each unit of UTF-16, and no end."""

    wanted: bool

    def read(self, data: bytes, place: int, order: str, into: list[Any]) -> int:
        """See `_Stretch.read`."""
        place, count = _length(data, place, order)
        end = place + 4 * count
        if end + _HEAD > len(data):
            raise ValueError("a string is longer than its message")
        if self.wanted:
            units = np.frombuffer(data, f"{order}u4", count, _HEAD + place if count else 0)
            if np.any(units > _LARGEST_UNIT):
                into.append(units.astype("<u4").tobytes().decode("utf-32-le"))
            else:
                into.append(units.astype("<u2").tobytes().decode("utf-16-le"))
        return end


@dataclass(frozen=True, slots=True)
class _Text:
    """A string."""

    wanted: bool

    def read(self, data: bytes, place: int, order: str, into: list[Any]) -> int:
        """See `_Stretch.read`."""
        place, length = _length(data, place, order)
        end = place + length
        if end + _HEAD > len(data):
            raise ValueError("a string is longer than its message")
        if self.wanted:
            into.append(data[_HEAD + place : _HEAD + max(end - 1, place)].decode())
        return end


@dataclass(frozen=True, slots=True)
class _Texts:
    """Strings, in an array of fixed length or a sequence."""

    one: _Text | _WideText
    count: int | None
    """None for a sequence."""
    wanted: bool

    def read(self, data: bytes, place: int, order: str, into: list[Any]) -> int:
        """See `_Stretch.read`."""
        count = self.count
        if count is None:
            place, count = _length(data, place, order)
        if count > len(data):
            raise ValueError("a sequence is longer than its message")
        texts: list[Any] = []
        for _ in range(count):
            place = self.one.read(data, place, order, texts)
        if self.wanted:
            into.append(texts)
        return place


@dataclass(frozen=True, slots=True)
class _Numbers:
    """A sequence of values of fixed size."""

    kinds: Mapping[str, np.dtype[Any]]
    """By the order of bytes."""
    size: int
    wanted: bool

    def read(self, data: bytes, place: int, order: str, into: list[Any]) -> int:
        """See `_Stretch.read`."""
        place, count = _length(data, place, order)
        if count:
            place += -place % self.size
        end = place + count * self.size
        if end + _HEAD > len(data):
            raise ValueError("a sequence is longer than its message")
        if self.wanted:
            # There may be nothing behind the length of an empty one.
            start = _HEAD + place if count else 0
            into.append(np.frombuffer(data, self.kinds[order], count, start))
        return end


@dataclass(frozen=True, slots=True)
class _Records:
    """Messages, in an array of fixed length or a sequence."""

    parts: list[_Part]
    build: Callable[[Sequence[Any]], SimpleNamespace]
    count: int | None
    """None for a sequence."""
    wanted: bool

    def read(self, data: bytes, place: int, order: str, into: list[Any]) -> int:
        """See `_Stretch.read`."""
        count = self.count
        if count is None:
            place, count = _length(data, place, order)
        if count > len(data):
            raise ValueError("a sequence is longer than its message")
        records: list[Any] = []
        for _ in range(count):
            values: list[Any] = []
            for part in self.parts:
                place = part.read(data, place, order, values)
            records.append(self.build(values))
        if self.wanted:
            into.append(records)
        return place


_Part: TypeAlias = _Stretch | _Text | _WideText | _Texts | _Numbers | _Records


def _length(data: bytes, place: int, order: str) -> tuple[int, int]:
    """Where what has a length begins, and the length."""
    place += -place % 4
    (length,) = _LENGTHS[order].unpack_from(data, _HEAD + place)
    return place + 4, length


class PartialDecoder:
    """Decodes the wanted fields of the messages of a type.

    Args:
        kind: Name of the type.
        wanted: What is asked for.
        definitions: Fields of each type, as rosbags knows them.
    """

    def __init__(
        self, kind: str, wanted: Collection[Attributes], definitions: Mapping[str, Any]
    ) -> None:
        leaves = [
            (name, node, about, any(name[:length] in wanted for length in range(len(name) + 1)))
            for name, node, about in _leaves(definitions, kind, ())
        ]
        while leaves and not leaves[-1][-1]:
            leaves.pop()
        self._definitions = definitions
        self._parts: list[_Part] = []
        for _, node, about, is_wanted in leaves:
            self._add(node, about, is_wanted)
        self._build = _builder([name for name, _, _, is_wanted in leaves if is_wanted])

    def decode(self, data: bytes) -> object:
        """The wanted fields of a message, as attributes of it.

        Raises:
            ValueError: It is no message of this type; or `struct.error`, for the same.
        """
        order = _ORDERS.get(data[:2])
        if order is None or len(data) < _HEAD:
            raise ValueError("it does not begin like a message")
        values: list[Any] = []
        place = 0
        for part in self._parts:
            place = part.read(data, place, order, values)
        return self._build(values)

    def _add(self, node: Any, about: Any, wanted: bool) -> None:
        """Adds a value, an array of fixed length, or a sequence."""
        single = node == Nodetype.BASE
        element = (node, about) if single else about[0]
        name = element[1][0] if element[0] == Nodetype.BASE else ""
        count = about[1] if node == Nodetype.ARRAY else None
        if name in ("string", "wstring"):
            text = _Text(wanted) if name == "string" else _WideText(wanted)
            self._parts.append(text if single else _Texts(text, count, wanted))
        elif element[0] == Nodetype.NAME:
            inner = PartialDecoder(element[1], [()], self._definitions)
            self._parts.append(_Records(inner._parts, inner._build, count, wanted))
        elif node == Nodetype.SEQUENCE:
            code, kind = _FIXED[name]
            kinds = {order: np.dtype(f"{order}{kind}") for order in _ORDERS.values()}
            self._parts.append(_Numbers(kinds, struct.calcsize(f"={code}"), wanted))
        else:
            if not self._parts or not isinstance(self._parts[-1], _Stretch):
                self._parts.append(_Stretch())
            stretch = self._parts[-1]
            assert isinstance(stretch, _Stretch)
            stretch.fields.append(_Fixed(*_FIXED[name], None if single else about[1], wanted))
            stretch.arrays = stretch.arrays or (wanted and not single)


def _leaves(
    definitions: Mapping[str, Any], kind: str, attributes: Attributes
) -> Iterator[tuple[Attributes, Any, Any]]:
    """All values of a message that are no messages, in their order."""
    for name, (node, about) in definitions[kind][1]:
        here = (*attributes, normalize_fieldname(name))
        if node == Nodetype.NAME:
            yield from _leaves(definitions, about, here)
        else:
            yield here, node, about


def _builder(
    names: Sequence[Attributes], first_place: int = 0
) -> Callable[[Sequence[Any]], SimpleNamespace]:
    """What makes an object of values, by the attributes that lead to each.

    Args:
        names: The attributes, in the order of the values.
        first_place: Where the first of them is among all values.
    """
    within: dict[str, list[tuple[int, Attributes]]] = {}
    for place, (first, *rest) in enumerate(names, first_place):
        within.setdefault(first, []).append((place, tuple(rest)))
    plain = [(name, found[0][0]) for name, found in within.items() if found == [(found[0][0], ())]]
    nested = [
        (name, _builder([rest for _, rest in found], found[0][0]))
        for name, found in within.items()
        if found != [(found[0][0], ())]
    ]

    def build(values: Sequence[Any]) -> SimpleNamespace:
        made = SimpleNamespace()
        attributes = made.__dict__
        for name, place in plain:
            attributes[name] = values[place]
        for name, inner in nested:
            attributes[name] = inner(values)
        return made

    return build
