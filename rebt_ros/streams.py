"""Standard output and error that take whatever is written to them.

Terminals, logs and services may have another encoding than UTF-8, or no stream at all.
"""

from __future__ import annotations

import codecs
import os
import sys
import unicodedata
from typing import TextIO

#: What stands for characters of trees and tables where a stream cannot hold them.
_PLAIN = {
    "│": "|", "─": "-", "└": "`", "├": "|", "┌": "-", "┐": "-", "┘": "-", "┤": "|", "·": ".",
    "≤": "<=", "≥": ">=", "≠": "!=", "→": "->", "⇉": "=>", "↻": "@", "…": "...", "±": "+-",
    "\u2212": "-", "\u2013": "-", "\u00d7": "x", "δ": "delta",
    "█": "#", "░": ".", "\u2019": "'", "∞": "inf",
}  # fmt: skip
_HANDLER = "rebt_ros.plain"


def prepare() -> None:
    """Makes the standard streams take all text; to be called first of all."""
    _open_what_is_closed()
    codecs.register_error(_HANDLER, _plain)
    sys.stdout = _ready(sys.stdout)
    sys.stderr = _ready(sys.stderr)


def drop(stream: TextIO) -> None:
    """Has nothing more written to a stream, not even at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _open_what_is_closed() -> None:
    """Gives the standard streams' numbers to nothing else, in this process and in its children."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest number that is free is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


def _ready(stream: TextIO | None) -> TextIO:
    if stream is None:
        # It was closed when the process began.
        return open(os.devnull, "w", encoding="utf-8")
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors=_HANDLER)
    return stream


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Other characters for those that cannot be encoded."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_spelt, error.object[error.start : error.end])), error.end


def _spelt(character: str) -> str:
    if character in _PLAIN:
        return _PLAIN[character]
    # Letters without their accents.
    bare = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return bare or "?"
