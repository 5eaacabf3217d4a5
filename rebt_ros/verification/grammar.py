"""The grammar of a rule's condition; nothing is evaluated.

::

    any    = all { "or" all }
    all    = single { "and" single }
    single = "not" single | "(" any ")" | "doing" name | "last action" ("=" | "!=") name
           | name | side "is" ("known" | "missing" | "true" | "false")
           | side sign side | side sign side sign side
    side   = number | name | sum
    sum    = [ "-" ] term { ( "+" | "-" ) term }
    term   = name | number "*" name | name "*" number
    sign   = "<" | "<=" | ">" | ">=" | "=" | "!="

A name is a word, such as ``front`` or ``imu/roll.x``, or any text in quotes.  It may have hyphens
inside, so a minus stands between blanks.  ``×`` is as good as ``*``, so that a condition can be
copied from the text of a tree.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

from rebt_ros.verification.expressions import (
    And,
    Comparison,
    Doing,
    Expression,
    LastAction,
    Not,
    Number,
    Or,
    Presence,
    Side,
    Sign,
    Sum,
    Term,
    Truth,
    Word,
)

#: Longest condition that is read, in characters.
LONGEST_CONDITION: Final = 4000
#: Deepest nesting of parentheses and negations.
_DEEPEST: Final = 50


class ConditionSyntaxError(Exception):
    """A condition that cannot be read: why, and the place, in characters from 0."""

    def __init__(self, why: str, at: int) -> None:
        super().__init__(why)
        self.why = why
        self.at = at


class _Kind(Enum):
    NUMBER = "number"
    QUOTED = "quoted"
    WORD = "word"
    SIGN = "sign"
    MARK = "mark"
    END = "end"


@dataclass(frozen=True, slots=True)
class _Token:
    kind: _Kind
    text: str
    at: int

    def is_word(self, *words: str) -> bool:
        """Whether it is one of these words of the grammar; a quoted one is a name."""
        return self.kind is _Kind.WORD and self.text in words

    def is_mark(self, marks: str) -> bool:
        """Whether it is one of these marks."""
        return self.kind is _Kind.MARK and self.text in marks

    @property
    def is_signed(self) -> bool:
        """Whether it is a number that begins with a sign, which may join it to a sum."""
        return self.kind is _Kind.NUMBER and self.text[0] in "+-"

    def __str__(self) -> str:
        return "the end" if self.kind is _Kind.END else repr(self.text)


_TOKEN: Final = re.compile(
    r"""\s*(?:
        (?P<number>[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?(?![\w.]))
      | (?P<quoted>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")
      | (?P<word>[^\W\d][\w./]*(?:-[\w./]+)*|\d[\w./]*)
      | (?P<sign><=|>=|==|!=|[<>=≤≥≠])
      | (?P<mark>[()\-−+*×])
      | (?P<end>$)
    )""",
    re.VERBOSE,
)

_SIGNS: Final = {
    "<": Sign.BELOW,
    "<=": Sign.AT_MOST,
    "≤": Sign.AT_MOST,
    ">": Sign.ABOVE,
    ">=": Sign.AT_LEAST,
    "≥": Sign.AT_LEAST,
    "=": Sign.EQUAL,
    "==": Sign.EQUAL,
    "!=": Sign.DIFFERENT,
    "≠": Sign.DIFFERENT,
}
_RISING: Final = (Sign.BELOW, Sign.AT_MOST)
_FALLING: Final = (Sign.ABOVE, Sign.AT_LEAST)
_EQUALITY: Final = (Sign.EQUAL, Sign.DIFFERENT)

_PLUS: Final = "+"
_MINUS: Final = "-−"
_TIMES: Final = "*×"

#: Words with a meaning, which are names only in quotes.
_RESERVED: Final = frozenset({"and", "or", "not", "is", "doing"})


def parse(text: str) -> Expression:
    """The condition that a text says.

    >>> parse("front < 0.3")
    Comparison(left=Word(text='front', at=0), sign=<Sign.BELOW: '<'>, \
right=Number(value=0.3, text='0.3', at=8))

    Raises:
        ConditionSyntaxError: It is no condition.
    """
    if len(text) > LONGEST_CONDITION:
        raise ConditionSyntaxError(
            f"the condition has {len(text)} characters where {LONGEST_CONDITION} are read", 0
        )
    parser = _Parser(_tokens(text))
    expression = parser.any_of(_DEEPEST)
    parser.expect_end()
    return expression


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    place = 0
    while not tokens or tokens[-1].kind is not _Kind.END:
        match = _TOKEN.match(text, place)
        if match is None:
            at = place + len(text[place:]) - len(text[place:].lstrip())
            if text[at] in "'\"":
                raise ConditionSyntaxError("the quote is never closed", at)
            raise ConditionSyntaxError(f"{text[at]!r} has no meaning here", at)
        kind = str(match.lastgroup)
        tokens.append(_Token(_Kind(kind), match.group(kind), match.start(kind)))
        place = match.end()
    return tokens


class _Parser:
    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._place = 0

    @property
    def _next(self) -> _Token:
        return self._tokens[self._place]

    def _take(self) -> _Token:
        token = self._next
        self._place += 1
        return token

    def _refuse(self, expected: str) -> ConditionSyntaxError:
        token = self._next
        return ConditionSyntaxError(f"{expected} is expected, not {token}", token.at)

    def expect_end(self) -> None:
        """Refuses what comes after a condition."""
        token = self._next
        if token.kind is _Kind.WORD and self._tokens[self._place - 1].kind is _Kind.NUMBER:
            raise ConditionSyntaxError(
                f"numbers stand without units, in those of the feature: 'and', 'or' or the end is "
                f"expected, not {token}",
                token.at,
            )
        if token.kind is not _Kind.END:
            raise self._refuse("'and', 'or' or the end")

    def any_of(self, deepest: int) -> Expression:
        """Conditions of which one has to hold."""
        parts = self._joined("or", lambda: self._all_of(deepest))
        return parts[0] if len(parts) == 1 else Or(parts)

    def _all_of(self, deepest: int) -> Expression:
        parts = self._joined("and", lambda: self._single(deepest))
        return parts[0] if len(parts) == 1 else And(parts)

    def _joined(self, word: str, part: Callable[[], Expression]) -> tuple[Expression, ...]:
        parts = [part()]
        while self._next.is_word(word):
            self._take()
            parts.append(part())
        return tuple(parts)

    def _single(self, deepest: int) -> Expression:
        token = self._next
        if deepest == 0:
            raise ConditionSyntaxError("the condition is nested too deeply", token.at)
        if token.is_word("not"):
            self._take()
            return Not(self._single(deepest - 1))
        if token.is_mark("("):
            self._take()
            inner = self.any_of(deepest - 1)
            if not self._next.is_mark(")"):
                raise self._refuse("')'")
            self._take()
            return inner
        if token.is_word("doing"):
            self._take()
            return Doing(self._name("an action"))
        if token.is_word("last") and self._tokens[self._place + 1].is_word("action"):
            return self._last_action()
        return self._comparison()

    def _last_action(self) -> Expression:
        self._place += 2
        sign = _SIGNS.get(self._next.text)
        if self._next.kind is not _Kind.SIGN or sign not in _EQUALITY:
            raise self._refuse("'=' or '!='")
        self._take()
        return LastAction(self._name("an action"), sign is Sign.EQUAL)

    def _comparison(self) -> Expression:
        left = self._side()
        if self._next.is_word("is"):
            return self._state_of(left)
        if self._next.kind is not _Kind.SIGN:
            if isinstance(left, Word):
                return Truth(left)
            raise self._refuse("a comparison")
        sign = _SIGNS[self._take().text]
        middle = self._side()
        first = Comparison(left, sign, middle)
        if self._next.kind is not _Kind.SIGN:
            return first
        second = _SIGNS[self._next.text]
        same_way = {sign, second} <= set(_RISING) or {sign, second} <= set(_FALLING)
        if not same_way or isinstance(middle, Number):
            raise ConditionSyntaxError(
                "two comparisons in a row must go the same way around a feature, "
                "as in 0.2 < front <= 0.5",
                self._next.at,
            )
        self._take()
        return And((first, Comparison(middle, second, self._side())))

    def _state_of(self, left: Side) -> Expression:
        self._take()
        token = self._next
        if token.is_word("known", "missing") and not isinstance(left, Number):
            self._take()
            return Presence(left, token.text == "known")
        if token.is_word("true", "false") and isinstance(left, Word):
            self._take()
            return Truth(left, token.text == "true")
        raise self._refuse("'known', 'missing', 'true' or 'false'")

    def _side(self) -> Side:
        token = self._next
        if token.kind is _Kind.NUMBER and not self._tokens[self._place + 1].is_mark(_TIMES):
            return self._number()
        if token.is_mark(_MINUS):
            self._take()
            return self._sum(token.at, self._term(-1.0))
        first = self._term(1.0)
        if first.weight == 1.0 and not self._goes_on:
            return first.feature
        return self._sum(token.at, first)

    @property
    def _goes_on(self) -> bool:
        """Whether a further term comes."""
        return self._next.is_mark(_PLUS + _MINUS) or self._next.is_signed

    def _sum(self, at: int, first: Term) -> Sum:
        terms = [first]
        while self._goes_on:
            # In "x -2 * y", the minus was read as that of the number.
            sign = "+" if self._next.is_signed else self._take().text
            terms.append(self._term(1.0 if sign in _PLUS else -1.0))
        return Sum(tuple(terms), at)

    def _term(self, weight: float) -> Term:
        token = self._next
        if token.kind is _Kind.NUMBER:
            number = self._number()
            if not self._next.is_mark(_TIMES):
                raise ConditionSyntaxError(
                    f"{token.text} is added to a feature: put it on the other side of the "
                    "comparison, or '*' and a feature behind it",
                    token.at,
                )
            self._take()
            return Term(weight * number.value, self._name("a feature"))
        feature = self._name("a feature or a number")
        if not self._next.is_mark(_TIMES):
            return Term(weight, feature)
        self._take()
        if self._next.kind is not _Kind.NUMBER:
            raise self._refuse("a number")
        return Term(weight * self._number().value, feature)

    def _number(self) -> Number:
        token = self._take()
        value = float(token.text)
        if not math.isfinite(value):
            raise ConditionSyntaxError(f"{token.text} is too large for a number", token.at)
        return Number(value, token.text, token.at)

    def _name(self, what: str) -> Word:
        token = self._next
        if token.kind is _Kind.QUOTED:
            self._take()
            return Word(re.sub(r"\\(.)", r"\1", token.text[1:-1]), token.at)
        # An action or a category may be called 2.
        if token.kind not in (_Kind.WORD, _Kind.NUMBER) or token.text in _RESERVED:
            raise self._refuse(what)
        self._take()
        return Word(token.text, token.at)
