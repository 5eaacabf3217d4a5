"""What a browser can ask for: a verb and its arguments, checked before anything is done."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from rebt_ros.errors import OptionError, RebtError

#: What is done: a sentence, or a sentence and data.
Answer: TypeAlias = str | tuple[str, Any]


class Arguments:
    """The arguments of a verb, each read with its type.

    All methods raise `OptionError` where an argument is missing or has another type.

    Args:
        given: What the browser has sent.
    """

    def __init__(self, given: Mapping[str, Any]) -> None:
        self._given = given

    def text(self, name: str, *, longest: int = 1000) -> str:
        """A text; no longer than so many characters."""
        value = self._given.get(name)
        if not isinstance(value, str) or len(value) > longest:
            raise OptionError(f"{name!r} must be a text of at most {longest} characters.")
        return value

    def optional_text(self, name: str) -> str:
        """A text; empty where it is missing."""
        return self.text(name) if self._given.get(name) is not None else ""

    def flag(self, name: str) -> bool:
        """Yes or no."""
        value = self._given.get(name)
        if not isinstance(value, bool):
            raise OptionError(f"{name!r} must be true or false.")
        return value

    def number(self, name: str) -> float:
        """A finite number."""
        value = self._given.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise OptionError(f"{name!r} must be a number.")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise OptionError(f"{name!r} must be a finite number.")
        return number

    def optional_number(self, name: str) -> float | None:
        """A finite number; None where it is missing."""
        return self.number(name) if self._given.get(name) is not None else None

    def whole(self, name: str) -> int:
        """A whole number."""
        number = self.number(name)
        if not number.is_integer():
            raise OptionError(f"{name!r} must be a whole number.")
        return int(number)


#: What can be asked for, by name.
Verbs: TypeAlias = Mapping[str, Callable[[Arguments], Answer]]


@dataclass(frozen=True, slots=True)
class Reply:
    """What the browser that asked is told."""

    id: Any
    """Of the request, as the browser gave it."""
    ok: bool
    message: str
    data: Any = None

    def as_json(self) -> dict[str, Any]:
        """As it is sent."""
        return {"answer": self.id, "ok": self.ok, "message": self.message, "data": self.data}


def reply(verbs: Verbs, request: Any) -> Reply:
    """Does what a browser asks for.

    Args:
        verbs: What can be asked for, by name.
        request: What the browser has sent, as JSON gives it.
    """
    if not isinstance(request, dict) or not isinstance(request.get("do"), str):
        return Reply(None, False, "this is no request: it must be an object that says what to do.")
    number = request.get("id")
    if isinstance(number, dict | list):
        number = None
    verb = request["do"]
    if verb not in verbs:
        return Reply(number, False, f"there is no verb {verb[:40]!r}; reload the page.")
    try:
        answer = verbs[verb](Arguments(request))
    except RebtError as err:
        return Reply(number, False, str(err))
    message, data = answer if isinstance(answer, tuple) else (answer, None)
    return Reply(number, True, message, data)
