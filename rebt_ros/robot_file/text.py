"""YAML from outside: maps, lists, texts, numbers and truth values, each with its line.

It is read event by event, with bounds on size and depth; aliases, tags and keys that are there
twice are refused, and nothing is constructed but plain values.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

import yaml

from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.place import Lines, Starts
from rebt_ros.robot_file.robot_file import Json

#: Longest robot file, in characters.
LARGEST: Final = 200_000
#: Deepest nesting of maps and lists.
DEEPEST: Final = 12

#: What helps where a sign cannot stand, as it is called there.
_HELPS: Final = {
    r"'\t'": ": indent with blanks, not with tabs",
    **{f"character {sign!r}": f": quote what begins with {sign}" for sign in "@`%"},
}

_WHOLE: Final = re.compile(r"[+-]?\d{1,18}", re.ASCII)
_DECIMAL: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_WORDS: Final = {
    "true": True,
    "True": True,
    "false": False,
    "False": False,
    "null": None,
    "~": None,
}


def read_yaml(text: str, name: str) -> tuple[Json, Lines, Starts]:
    """Reads YAML.

    Args:
        text: The text.
        name: Name of its file, for messages.

    Returns:
        The value, the line of each place in it, and the line and column of each text.

    Raises:
        RobotFileError: It is no YAML, or uses what is not read.
    """
    if len(text) > LARGEST:
        raise RobotFileError(f"{name} has {len(text)} characters: at most {LARGEST} are read.")
    try:
        return _Reader(name).document(yaml.parse(text, Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as err:
        mark = err.problem_mark or err.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        helps = next((what for sign, what in _HELPS.items() if sign in str(err.problem)), "")
        raise RobotFileError(f"{name}{line}: this is not YAML ({err.problem}){helps}.") from err
    except yaml.YAMLError as err:
        reason = " ".join(str(err).split())
        raise RobotFileError(f"{name} is not YAML ({reason}).") from err


class _Reader:
    def __init__(self, name: str) -> None:
        self._name = name
        self._lines: dict[tuple[str, ...], int] = {}
        self._starts: dict[tuple[str, ...], tuple[int, int]] = {}

    def document(self, events: Iterator[Any]) -> tuple[Json, Lines, Starts]:
        for event in events:
            if isinstance(event, yaml.StreamStartEvent | yaml.DocumentStartEvent):
                continue
            if isinstance(event, yaml.StreamEndEvent):
                break
            value = self._value(event, events, ())
            next(events)
            further = next(events)
            if not isinstance(further, yaml.StreamEndEvent):
                self._refuse(further, "a second document begins: leave one")
            return value, self._lines, self._starts
        return None, self._lines, self._starts

    def _value(self, event: Any, events: Iterator[Any], path: tuple[str, ...]) -> Json:
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            self._refuse(event, "anchors (&) and aliases (*) are not read: write it out")
        if getattr(event, "tag", None) and not isinstance(event, yaml.ScalarEvent):
            self._refuse(event, f"tags are not read: leave {event.tag} out")
        if len(path) > DEEPEST:
            self._refuse(event, f"this is nested more than {DEEPEST} levels deep")
        self._lines[path] = event.start_mark.line + 1
        if isinstance(event, yaml.ScalarEvent):
            mark = event.start_mark
            quoted = event.style is not None and event.style in "'\""
            self._starts[path] = (mark.line + 1, mark.column + 1 + quoted)
            return self._scalar(event)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._list(events, path)
        return self._map(events, path)

    def _list(self, events: Iterator[Any], path: tuple[str, ...]) -> Json:
        values: list[Json] = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                return values
            values.append(self._value(event, events, (*path, str(len(values)))))
        return values

    def _map(self, events: Iterator[Any], path: tuple[str, ...]) -> Json:
        values: dict[str, Json] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                return values
            if not isinstance(event, yaml.ScalarEvent) or event.anchor or event.tag:
                self._refuse(event, "a key must be a plain text or number")
            key = event.value
            if key in values:
                self._refuse(event, f"the key {key!r} is there twice")
            self._lines[(*path, key)] = event.start_mark.line + 1
            values[key] = self._value(next(events), events, (*path, key))
            # What is wrong with a value is found where its key stands.
            self._lines[(*path, key)] = event.start_mark.line + 1
        return values

    def _scalar(self, event: Any) -> Json:
        if event.tag:
            self._refuse(event, f"tags are not read: leave {event.tag} out")
        text: str = event.value
        if event.style:
            return text
        if text in _WORDS or not text:
            return _WORDS.get(text)
        if _WHOLE.fullmatch(text):
            return int(text)
        return float(text) if _DECIMAL.fullmatch(text) else text

    def _refuse(self, event: Any, why: str) -> None:
        raise RobotFileError(f"{self._name}, line {event.start_mark.line + 1}: {why}.")
