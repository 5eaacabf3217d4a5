"""Categories that are discovered while messages are read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

#: Maximum number of categories of a feature; further ones are missing values.
MOST_CATEGORIES: Final = 1000


class Categories:
    """The categories of a feature, numbered as they were seen.

    Args:
        known: All categories that count; empty if all that will be seen do.

    >>> categories = Categories()
    >>> categories.code("manual"), categories.code("auto"), categories.code("manual")
    (0.0, 1.0, 0.0)
    """

    def __init__(self, known: Sequence[str] = ()) -> None:
        self.names = list(known)
        self._codes = {name: float(code) for code, name in enumerate(known)}
        self.is_open = not known
        """Whether it accepts new categories."""

    def code(self, name: str) -> float:
        """The number of a category; NaN if it is not one, or if there are too many."""
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
