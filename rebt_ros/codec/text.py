"""JSON as text, strictly: no constants beyond the standard's, and one sentence for what is none."""

from __future__ import annotations

import json
from json.encoder import encode_basestring
from typing import NoReturn

from rebt_ros.codec.form import Json


def parsed(text: str) -> Json:
    """What a JSON text says.

    Raises:
        ValueError: It is none; the message says why, without a full stop.
        RecursionError: It is nested too deeply.
    """
    return json.loads(text, parse_constant=_refuse_constant)


def indented(value: Json) -> str:
    """JSON text with a line for each value, indented by a blank per level.

    It is ``json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False)`` to the last
    character, in a third of the time: the standard library indents in Python, piece by piece.

    Raises:
        ValueError: A number is not finite.

    >>> print(indented({"deciding": ["go", "turn"], "at_most": 0.3}))
    {
     "deciding": [
      "go",
      "turn"
     ],
     "at_most": 0.3
    }
    """
    return _indented(value, "\n")


def _indented(value: Json, margin: str) -> str:
    if isinstance(value, str):
        return encode_basestring(value)
    inner = margin + " "
    between = "," + inner
    if isinstance(value, dict) and value:
        lines = [f"{encode_basestring(name)}: {_indented(value[name], inner)}" for name in value]
        return f"{{{inner}{between.join(lines)}{margin}}}"
    if isinstance(value, list) and value:
        elements = [_indented(element, inner) for element in value]
        return f"[{inner}{between.join(elements)}{margin}]"
    return json.dumps(value, allow_nan=False)


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")
