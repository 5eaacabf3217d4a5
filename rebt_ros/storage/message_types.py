"""The message types of a bag, for decoding and as the definitions of message paths."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from typing import Any, Final

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import normalize_fieldname

from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.definition import FILLER, Field, MessageType, Primitive
from rebt_ros.storage.idl import Definition
from rebt_ros.storage.message_definitions import (
    Definitions,
    is_known,
    parse_definitions,
    types_within,
)
from rebt_ros.storage.partial_messages import Attributes, PartialDecoder

#: Bytes before the values of a message, and what tells their order.
_HEAD: Final = 4
_BIG, _LITTLE = b"\0\0", b"\0\1"
#: What rclpy.serialization leaves behind an empty array of numbers of 8 bytes, or two.
_MOST_PADDING: Final = 15

#: Types of one byte that `.msg` and `.idl` files call otherwise.
_BYTES: Final = dict.fromkeys(("byte", "octet", "char"), "uint8")

_PRIMITIVES: Final = {
    "bool": Primitive.TRUTH,
    "byte": Primitive.BYTE,
    "octet": Primitive.BYTE,
    "float32": Primitive.NUMBER,
    "float64": Primitive.NUMBER,
    "string": Primitive.TEXT,
    "wstring": Primitive.TEXT,
}


class BagTypes:
    """The types of ROS 2 Jazzy, and those that a bag defines.

    Args:
        definitions: Definitions in the bag by the name of their type, as `.msg` or `.idl` files
            have them, those of the types within them included.  They are looked at when they are
            needed.  Where ROS 2 has another type of that name, as in another distribution, the
            messages of the bag are those of the bag's.
        elsehow: How the bag defines types where it does so otherwise, by their names.
    """

    def __init__(
        self,
        definitions: Mapping[str, str] | None = None,
        elsehow: Mapping[str, str] | None = None,
    ) -> None:
        self._texts = definitions or {}
        self._elsehow = elsehow or {}
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._own: Definitions = {}
        self._fields = ChainMap[str, Any](self._own, dict(self._store.fielddefs))
        self._decoders: dict[str, Callable[[bytes], object]] = {}
        self._known: dict[str, MessageType] = {}

    def __call__(self, name: str) -> MessageType:
        """The definition of a type.

        Raises:
            MessagePathError: It is not known.
        """
        if name not in self._known:
            self._known[name] = self._definition(name)
        return self._known[name]

    def decode(self, data: bytes, name: str) -> object:
        """A message of a type that is known.

        Raises:
            Exception: The data are no such message; rosbags raises whatever it meets.
        """
        if name not in self._decoders:
            self._decoders[name] = self._decoder_of_all(name)
        return self._decoders[name](data)

    def _decoder_of_all(self, name: str) -> Callable[[bytes], object]:
        """What decodes messages of a type that is known, with all that is in them."""
        if self._own.keys().isdisjoint(types_within(name, self._fields)):
            return partial(self._decode_known, name)
        return PartialDecoder(name, [()], self._fields).decode

    def _decode_known(self, name: str, data: bytes) -> object:
        """A message of a type that is that of ROS 2, with all types within it."""
        order = data[:2]
        if len(data) < _HEAD or order not in (_BIG, _LITTLE):
            raise ValueError("it does not begin like a message")
        about = self._store.get_msgdef(name)
        read = about.deserialize_cdr_le if order == _LITTLE else about.deserialize_cdr_be
        message, end = read(data[_HEAD:], 0, about.cls, self._store)
        if end + _HEAD + _MOST_PADDING < len(data):
            raise ValueError("it is longer than its type")
        return message

    def decoder(self, name: str, wanted: Collection[Attributes]) -> Callable[[bytes], object]:
        """What decodes messages of a type that is known, at least as far as attributes are wanted.

        Args:
            name: The type.
            wanted: Attributes that lead to values, or to messages with all that is in them.
        """
        return PartialDecoder(name, wanted, self._fields).decode

    def _definition(self, name: str) -> MessageType:
        found: Definitions = {}
        if self._texts.get(name, "").strip():
            found = parse_definitions(name, self._texts[name])
            # What cannot be read of a definition is no other one.
            whole = is_known(name, ChainMap(found, self._fields))
            for kind, its in found.items():
                ours = self._store.fielddefs.get(kind)
                if ours is None or (whole and its[1] and not _are_one(its, ours)):
                    self._own.setdefault(kind, its)
        if not is_known(name, self._fields):
            why = self._why_unknown(name, ChainMap(found, self._fields))
            self._own.pop(name, None)
            raise MessagePathError(f"the type {name} is none of ROS 2 Jazzy, and {why}.")
        constants, fields = self._fields[name]
        return MessageType(
            name,
            tuple(_field(field, its) for field, its in fields if field != FILLER),
            _whole(constants),
        )

    def _why_unknown(self, name: str, fields: Mapping[str, Any]) -> str:
        """Why a type is not known, and what helps."""
        if how := self._elsehow.get(name):
            return (
                f"the bag defines it in {how}, which is not read here: record it with a package "
                "that has .msg files"
            )
        missing = sorted(types_within(name, fields) - fields.keys())
        if any(missing):
            which = "it" if name in missing else f"{missing[-1]}, which is within it"
            return f"the bag does not define {which}: record it where its package is sourced"
        return (
            "the bag defines it as no type of ROS 2 can be: record it with a package that has .msg "
            "files"
        )


def _are_one(one: Definition, other: Any) -> bool:
    """Whether definitions have the same fields and whole constants, whatever their bounds."""
    return _shapes(one[1]) == _shapes(other[1]) and _whole(one[0]) == _whole(other[0])


def _shapes(fields: Iterable[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """Fields without the bounds of texts and sequences."""

    def shape(descriptor: Any) -> Any:
        node, about = descriptor
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            return node, shape(about[0]), about[1] if node == Nodetype.ARRAY else 0
        return node, about if node == Nodetype.NAME else _BYTES.get(about[0], about[0])

    return [(name, shape(its)) for name, its in fields if name != FILLER]


def _whole(constants: Iterable[tuple[str, str, Any]]) -> dict[str, int]:
    return {
        name: value
        for name, kind, value in constants
        if kind != "bool" and isinstance(value, int) and not isinstance(value, bool)
    }


def _field(name: str, descriptor: Any) -> Field:
    node, about = descriptor
    is_array = node in (Nodetype.ARRAY, Nodetype.SEQUENCE)
    if is_array:
        node, about = about[0]
    kind = about if node == Nodetype.NAME else _PRIMITIVES.get(about[0], Primitive.INTEGER)
    return Field(name, kind, is_array, normalize_fieldname(name))
