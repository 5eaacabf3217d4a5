"""Categories that come to be known while messages are read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

#: Most categories of one feature; what comes after them is missing.
MOST_CATEGORIES: Final = 1000


class Categories:
    """The categories of one feature, by number, as far as they were seen.

    Args:
        known: Those that there are; empty for all that will be seen.

    >>> categories = Categories()
    >>> categories.code("manual"), categories.code("auto"), categories.code("manual")
    (0.0, 1.0, 0.0)
    """

    def __init__(self, known: Sequence[str] = ()) -> None:
        self.names = list(known)
        self._codes = {name: float(code) for code, name in enumerate(known)}
        self.is_open = not known
        """Whether it takes what it does not know."""

    def code(self, name: str) -> float:
        """The number of a category; NaN where it is none, or there are too many."""
        code = self._codes.get(name)
        if code is not None:
            return code
        if not self.is_open or not name or len(self.names) == MOST_CATEGORIES:
            return math.nan
        if not name.isprintable():
            return self.code(ascii(name)[1:-1])
        self._codes[name] = code = float(len(self.names))
        self.names.append(name)
        return code
