"""Message definitions as bags hold them: the text of a `.msg` or `.idl` file, and of its needs.

They come from outside: what a line does not say in the plain form of a field or a constant is
passed over, and nothing is made of them but names and types.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping
from typing import Any, Final, TypeAlias

from rosbags.interfaces import Nodetype

from rebt_ros.storage.idl import Definition, parse_idl

#: Constants and fields of each type.
Definitions: TypeAlias = dict[str, Definition]

#: Longest text that is read, in characters, and most types in it.
LARGEST: Final = 500_000
_MOST_TYPES: Final = 500

_SEPARATOR: Final = re.compile(r"^={20,}\s*$", re.MULTILINE)
_HEAD: Final = re.compile(r"\s*(MSG|IDL):\s*([A-Za-z]\w*(?:/[A-Za-z]\w*){1,2})\s*$", re.ASCII)
_MODULE: Final = re.compile(r"^[ \t]*module\s+\w+\s*\{", re.ASCII | re.MULTILINE)
_LINE: Final = re.compile(
    r"\s*([A-Za-z][\w/]*)(?:<=\d+)?(\[(?:<=)?\d*\])?[ \t]+([A-Za-z]\w*)[ \t]*(=?)(.*)", re.ASCII
)
_PRIMITIVES: Final = frozenset(
    ["bool", "byte", "char", "float32", "float64", "string", "wstring"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)


def parse_definitions(name: str, text: str) -> Definitions:
    """The types of a definition: its own, and those that follow it.

    Args:
        name: Name of its type, such as ``my_msgs/msg/Own``.
        text: The text.
    """
    found: Definitions = {}
    parts = _SEPARATOR.split(text[:LARGEST])[:_MOST_TYPES]
    for place, part in enumerate(parts):
        head = None
        kind, lines = name, part.strip("\n").split("\n")
        if place:
            head = _HEAD.fullmatch(lines[0])
            if head is None:
                continue
            kind, lines = _full_name(head[2], ""), lines[1:]
        if (head is not None and head[1] == "IDL") or _MODULE.search(part):
            for one, its in parse_idl("\n".join(lines)).items():
                found.setdefault(one, its)
        elif place or part.strip() or len(parts) == 1:
            found.setdefault(kind, _parsed(kind, lines))
    return found


def differ(name: str, one: str, other: str) -> bool:
    """Whether definitions of a type say something else, and not only in other words."""
    return one != other and parse_definitions(name, one) != parse_definitions(name, other)


def is_known(name: str, definitions: Mapping[str, Any]) -> bool:
    """Whether a type and all types within it are known."""
    within = types_within(name, definitions)
    return all(one in definitions for one in within) and not _holds_itself(name, definitions, ())


def types_within(name: str, definitions: Mapping[str, Any]) -> set[str]:
    """A type and all types within it, as far as they are known."""
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        one = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        for _, (node, about) in definitions[one][1] if one in definitions else ():
            if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                node, about = about[0]
            if node == Nodetype.NAME:
                waiting.append(about)
    return seen


def _holds_itself(name: str, definitions: Mapping[str, Any], above: tuple[str, ...]) -> bool:
    """Whether a type has itself within it, which no message can have."""
    if name in above or len(above) > _DEEPEST:
        return True
    return any(
        _holds_itself(about, definitions, (*above, name))
        for about in {
            its[1] if its[0] == Nodetype.NAME else its[1][0][1]
            for _, its in definitions[name][1]
            if its[0] == Nodetype.NAME
            or (its[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) and its[1][0][0] == Nodetype.NAME)
        }
    )


#: Deepest nesting of messages within messages.
_DEEPEST: Final = 20


def _parsed(kind: str, lines: list[str]) -> Any:
    constants: list[tuple[str, str, Any]] = []
    fields: list[tuple[str, Any]] = []
    for line in lines:
        match = _LINE.fullmatch(line.partition("#")[0].rstrip())
        if match is None:
            continue
        base, array, name, sign, value = match.groups()
        if sign:
            with contextlib.suppress(ValueError):
                constants.append((name, base, int(value.strip(), 0)))
            continue
        element: Any = (
            (Nodetype.BASE, (base, 0))
            if base in _PRIMITIVES
            else (Nodetype.NAME, _full_name(base, kind))
        )
        if array is None:
            fields.append((name, element))
        elif array[1:-1].isdecimal():
            fields.append((name, (Nodetype.ARRAY, (element, int(array[1:-1])))))
        else:
            fields.append((name, (Nodetype.SEQUENCE, (element, 0))))
    return constants, fields


def _full_name(name: str, owner: str) -> str:
    """The name of a type as it is called elsewhere than in the definition of another one."""
    parts = name.split("/")
    if parts == ["Header"]:
        return "std_msgs/msg/Header"
    if len(parts) == 1:
        return f"{owner.split('/')[0]}/msg/{name}"
    return f"{parts[0]}/msg/{parts[-1]}"
