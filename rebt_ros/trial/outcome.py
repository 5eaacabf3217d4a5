"""How an episode ended, and how the world says so."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from rebt_ros.errors import InputError

_SUCCESS = frozenset({"success", "succeeded", "true"})
_FAILURE = frozenset({"failure", "failed", "false"})

#: Characters of a message that are shown.
_SHOWN = 80


class Ending(Enum):
    """What ended an episode."""

    TOLD = "told"
    """The world or a person said how it went."""
    TIME_LIMIT = "time limit"
    """It took too long, which is a failure."""
    STOPPED = "stopped"
    """A person took over, or disabled the executor, which is a failure."""


class VoidEpisodeError(Exception):
    """The episode says nothing about the tree and is driven again; no user ever sees this."""


class Judge(Protocol):
    """Says how episodes go."""

    def begin(self) -> None:
        """Is told that the next episode is to begin."""

    def ready(self) -> bool:
        """Whether it may begin; asked again and again until that is so.

        Raises:
            RebtError: Nobody is there to say so.
        """

    def success(self) -> bool | None:
        """Whether the episode has succeeded; None while that is not known.

        Raises:
            VoidEpisodeError: The episode is to be driven again.
            RebtError: What the world says is not understood.
        """


@dataclass(frozen=True, slots=True)
class Episode:
    """An episode that has ended."""

    success: bool
    seconds: float
    """How long the tree drove."""
    ending: Ending
    start: int | None = None
    """The start that the world was told; None where it was told none."""


def success_of(text: str, field: str | None = None) -> bool:
    """Whether a message speaks of a success.

    Args:
        text: ``success``, ``succeeded`` or ``true``, ``failure``, ``failed`` or ``false``, in
            small or capital letters; or, with a field, a JSON object that has it.
        field: Name of a boolean field.

    Raises:
        InputError: It says neither.
    """
    if field is not None:
        return _field_of(text, field)
    word = text.strip().strip('"').casefold()
    if word in _SUCCESS or word in _FAILURE:
        return word in _SUCCESS
    fields = [name for name, value in (_object(text) or {}).items() if isinstance(value, bool)]
    if fields:
        raise InputError(
            f"the outcome {_shown(text)} is a JSON object: name its field with --outcome-field "
            f"({' or '.join(fields)})."
        )
    raise InputError(
        f"the outcome {_shown(text)} is neither success nor failure: "
        "send 'success' or 'failure', 'true' or 'false'."
    )


def _field_of(text: str, field: str) -> bool:
    value = (_object(text) or {}).get(field)
    if not isinstance(value, bool):
        raise InputError(
            f"the outcome {_shown(text)} has no boolean field {field!r}: "
            "--outcome-field names one of a JSON object."
        )
    return value


def _object(text: str) -> dict[str, object] | None:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _shown(text: str) -> str:
    return repr(text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…")
