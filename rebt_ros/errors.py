"""The errors that a user of the package can cause.

Every message is one sentence that names the thing at fault and says what to do.  Lower errors are
wrapped with ``raise ... from err`` at the border where their context is known; only commands and
nodes turn a `RebtError` into text, an exit code or a failed service response.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

#: Longest message (characters), however long the names and values are that it mentions.
LONGEST_MESSAGE: Final = 1000


class RebtError(Exception):
    """Root of all errors that a user can cause; anything else is a programming mistake.

    Messages mention names and values that come from outside.  As text, they are one line that any
    log, terminal and service response can bear.
    """

    def __str__(self) -> str:
        text = super().__str__()
        if len(text) > LONGEST_MESSAGE:
            half = (LONGEST_MESSAGE - 1) // 2
            text = f"{text[:half]}…{text[-half:]}"
        return printable(text)


def printable(text: str) -> str:
    r"""The text as a single line that any log and terminal can bear.

    >>> printable("/state\n\x1b[31m")
    '/state \\x1b[31m'
    """
    return text if text.isprintable() else "".join(map(_printable, text))


def _printable(character: str) -> str:
    if character.isprintable():
        return character
    return " " if character.isspace() else ascii(character)[1:-1]


def listing(names: Sequence[object], most: int = 8, separator: str = ", ") -> str:
    """Names in a sentence: separated, by commas unless said otherwise, and cut off after so many.

    >>> listing(["a", "b", "c"]), listing(["a", "b", "c"], most=2), listing([])
    ('a, b, c', 'a, b, …', '')
    """
    return separator.join([*map(str, names[:most]), *(["…"] if len(names) > most else [])])


class InputError(RebtError):
    """What was shown (a bag, a recording, a table, a message) cannot be used."""


class OptionError(RebtError):
    """An option or parameter has a value that makes no sense."""


class MessagePathError(RebtError):
    """A message path is malformed or leads to nothing in the messages of its topic."""


class DocumentError(RebtError):
    """A behavior tree document is malformed or does not fit where it should run."""
