"""Reading message paths."""

from __future__ import annotations

import math
import re
from typing import Final, NoReturn

from rebt_ros.errors import MessagePathError
from rebt_ros.message_path.path import (
    PLAIN_NAME,
    PLAIN_TOPIC,
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

#: Longest path that is read, in characters, and most parts of one.
LONGEST_PATH: Final = 1000
MOST_PARTS: Final = 50

_QUOTED: Final = re.compile(r'"((?:[^"\\]|\\["\\])*)"')
_TEXT: Final = re.compile(r"\"([^\"]*)\"|'([^']*)'")
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_WHOLE: Final = re.compile(r"[+-]?\d+", re.ASCII)
_BLANKS: Final = re.compile(r"[ \t]*")
_COMPARISON: Final = re.compile("|".join(one.value for one in Comparison))
#: Whole numbers beyond are none of an array's.
_LARGEST_INDEX: Final = 2**31


def parse(text: str) -> MessagePath:
    """The path that a text stands for; `str` is its inverse.

    Raises:
        MessagePathError: It stands for none; one sentence says where and why.

    >>> parse("/joint_states.position[left_wheel].@abs").parts
    (FieldName(name='position'), Entry(name='left_wheel'), Function(name='abs', argument=None))
    """
    if len(text) > LONGEST_PATH:
        raise MessagePathError(
            f"message path {text[:40]!r}… has {len(text)} characters: at most {LONGEST_PATH} are "
            "read."
        )
    return _Reader(text).path()


class _Reader:
    """Reads a path from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._place = 0

    def path(self) -> MessagePath:
        topic = self._topic()
        parts: list[Part] = []
        while self._place < len(self._text):
            if len(parts) == MOST_PARTS:
                raise MessagePathError(
                    f"message path {self._text!r} has more than {MOST_PARTS} parts."
                )
            parts.append(self._part())
        return MessagePath(topic, tuple(parts))

    def _topic(self) -> str:
        topic = self._quoted() or self._match(PLAIN_TOPIC)
        return topic or self._refuse("the name of a topic, such as /odom")

    def _part(self) -> Part:
        if self._take("."):
            if self._take("@"):
                return self._function()
            return FieldName(self._name("the name of a field, or @ and that of a function"))
        if self._take("["):
            part = self._bracket()
            self._expect("]")
            return part
        if self._take("{"):
            filtered = self._filter()
            self._expect("}")
            return filtered
        return self._refuse("a dot and a field, a function as .@abs, or one of [ and {")

    def _function(self) -> Function:
        name = self._match(PLAIN_NAME) or self._refuse("the name of a function, such as abs")
        if not self._take("("):
            return Function(name)
        self._skip_blanks()
        argument = self._number()
        self._skip_blanks()
        self._expect(")")
        return Function(name, argument)

    def _bracket(self) -> Part:
        """What stands between brackets."""
        first = self._quoted() or self._match(PLAIN_NAME)
        if first:
            return Entry(first)
        begin = self._place
        number, degrees = self._end_of_slice()
        if not self._take(":"):
            if degrees:
                self._place = begin
                self._refuse("two angles, such as -15deg:15deg")
            if number is None:
                self._refuse("an index, a slice such as 0:4, or a name")
            return Index(int(number))
        last, last_degrees = self._end_of_slice()
        if degrees or last_degrees:
            if not (degrees and last_degrees) or number is None or last is None:
                self._place = begin
                self._refuse("a slice whose ends are both angles, such as -15deg:15deg")
            return AngleSlice(number, last)
        return Slice(*(None if one is None else int(one) for one in (number, last)))

    def _end_of_slice(self) -> tuple[float | None, bool]:
        """A number, if there is one, and whether it is an angle in degrees."""
        begin = self._place
        if not self._match(_NUMBER):
            return None, False
        text = self._text[begin : self._place]
        if self._take("deg"):
            angle = float(text)
            if not abs(angle) <= 360:
                self._place = begin
                self._refuse("an angle from -360deg to 360deg")
            return angle, True
        if not _WHOLE.fullmatch(text) or len(text) > 11 or abs(int(text)) > _LARGEST_INDEX:
            self._place = begin
            self._refuse("a whole number, or an angle such as 15deg")
        return int(text), False

    def _filter(self) -> Filter:
        self._skip_blanks()
        names = [self._name("the name of a field to compare")]
        while self._take("."):
            names.append(self._name("the name of a field to compare"))
        self._skip_blanks()
        sign = self._match(_COMPARISON) or self._refuse(
            f"one of {', '.join(one.value for one in Comparison)}"
        )
        self._skip_blanks()
        value = self._value()
        self._skip_blanks()
        return Filter(tuple(names), Comparison(sign), value)

    def _value(self) -> bool | float | str | ConstantName:
        """What a filter compares with."""
        quoted = _TEXT.match(self._text, self._place)
        if quoted:
            self._place = quoted.end()
            return quoted[1] if quoted[1] is not None else quoted[2]
        name = self._match(PLAIN_NAME)
        if name:
            return name == "true" if name in ("true", "false") else ConstantName(name)
        return self._number("a number, a text in quotes, true, false or the name of a constant")

    def _number(self, expected: str = "a number") -> float:
        begin = self._place
        text = self._match(_NUMBER) or self._refuse(expected)
        if _WHOLE.fullmatch(text) and len(text) < 20:
            return int(text)
        if not math.isfinite(float(text)):
            self._place = begin
            self._refuse(expected)
        return float(text)

    def _name(self, expected: str) -> str:
        return self._quoted() or self._match(PLAIN_NAME) or self._refuse(expected)

    def _quoted(self) -> str:
        """A name in quotes; empty where there is none."""
        match = _QUOTED.match(self._text, self._place)
        if match is None or not match[1]:
            return ""
        self._place = match.end()
        return re.sub(r"\\(.)", r"\1", match[1])

    def _match(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self._text, self._place)
        if match is None:
            return ""
        self._place = match.end()
        return match[0]

    def _take(self, token: str) -> bool:
        there = self._text.startswith(token, self._place)
        self._place += len(token) if there else 0
        return there

    def _expect(self, token: str) -> None:
        if not self._take(token):
            self._refuse(repr(token))

    def _skip_blanks(self) -> None:
        self._match(_BLANKS)

    def _refuse(self, expected: str) -> NoReturn:
        rest = self._text[self._place :]
        if not rest:
            raise MessagePathError(
                f"message path {self._text!r} ends where there must be {expected}."
            )
        hint = " (variables have no value here: write it)" if rest.startswith("$") else ""
        raise MessagePathError(
            f"message path {self._text!r} has {rest!r} where there must be {expected}{hint}."
        )
