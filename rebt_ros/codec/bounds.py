"""Bounds of numbers and of lengths, as they stand in type hints: ``Annotated[int, Bounds(0)]``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, TypeAlias


@dataclass(frozen=True, slots=True)
class Bounds:
    """The least and the largest value of a number, both allowed; or of the length of a tuple."""

    least: float = -math.inf
    most: float = math.inf


#: How many of something.
Count: TypeAlias = Annotated[int, Bounds(0)]
#: From 0 to 1.
Share: TypeAlias = Annotated[float, Bounds(0, 1)]
