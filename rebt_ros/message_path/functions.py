"""The functions of message paths.

A function of one number gives none where it is not defined, as the root of a negative one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Final, TypeAlias

#: A function of a number; None where it is not defined there.
Scalar: TypeAlias = Callable[[float], float | None]


class Series(Enum):
    """Functions of a value and the one before it."""

    DELTA = "delta"
    """How much it has grown."""
    DERIVATIVE = "derivative"
    """The same, by second."""


class Angles(Enum):
    """Functions that turn a quaternion into roll, pitch and yaw, by the order of rotations."""

    YPR = "ypr"
    """Yaw, then pitch, then roll, each about the axes that those before have turned (ZYX)."""
    RPY = "rpy"
    """Roll, then pitch, then yaw, likewise (XYZ)."""


#: Sine of a pitch so steep that roll and yaw turn about the same axis: the later one is then 0.
_LOCK: Final = 1 - 1e-12
#: What `euler` gives, by place.
ANGLES: Final = ("roll", "pitch", "yaw")


def _defined(function: Callable[[float], float]) -> Scalar:
    def apply(value: float) -> float | None:
        try:
            return function(value)
        except (ValueError, OverflowError):
            return None

    return apply


SCALARS: Final[Mapping[str, Scalar]] = {
    "abs": abs,
    "negative": lambda value: -value,
    "sign": lambda value: float((value > 0) - (value < 0)) if value == value else None,
    "ceil": _defined(math.ceil),
    "floor": _defined(math.floor),
    # Foxglove's, that is JavaScript's: halves go up.
    "round": _defined(lambda value: math.floor(value + 0.5)),
    "trunc": _defined(math.trunc),
    "sqrt": _defined(math.sqrt),
    "log": _defined(math.log),
    "log1p": _defined(math.log1p),
    "log2": _defined(math.log2),
    "log10": _defined(math.log10),
    "sin": _defined(math.sin),
    "cos": _defined(math.cos),
    "tan": _defined(math.tan),
    "asin": _defined(math.asin),
    "acos": _defined(math.acos),
    "atan": math.atan,
    "degrees": math.degrees,
    "radians": math.radians,
}

#: Functions with a number behind them.
ARITHMETIC: Final[Mapping[str, Callable[[float], Scalar]]] = {
    "add": lambda number: lambda value: value + number,
    "sub": lambda number: lambda value: value - number,
    "mul": lambda number: lambda value: value * number,
    "div": lambda number: lambda value: value / number,
}


def _smallest(values: Sequence[float]) -> float | None:
    return min((value for value in values if value == value), default=None)


def _largest(values: Sequence[float]) -> float | None:
    return max((value for value in values if value == value), default=None)


def _mean(values: Sequence[float]) -> float | None:
    there = [value for value in values if value == value]
    # Of infinite ones of both signs there is no sum.
    return sum(there) / len(there) if there else None


def _place_of_smallest(values: Sequence[float]) -> float | None:
    there = [place for place, value in enumerate(values) if value == value]
    return min(there, key=values.__getitem__, default=None)


#: Functions that make one number of many, in which NaN stands for those that are missing; None
#: where all of them are.
REDUCERS: Final[Mapping[str, Callable[[Sequence[float]], float | None]]] = {
    "min": _smallest,
    "max": _largest,
    "mean": _mean,
    "argmin": _place_of_smallest,
}

LENGTH: Final = "length"
NORM: Final = "norm"


def norm(values: Sequence[float]) -> float | None:
    """The length of a vector; None where it has no elements.

    >>> norm([3.0, 4.0])
    5.0
    """
    return math.hypot(*values) if values else None


def euler(order: Angles, x: float, y: float, z: float, w: float) -> tuple[float, ...] | None:
    """Roll, pitch and yaw (radians) of a quaternion, be it of length 1 or not.

    None where it is no rotation: of length 0, or not finite.

    >>> euler(Angles.YPR, 0.0, 0.0, 1.0, 1.0)[2] == math.pi / 2
    True
    """
    square = x * x + y * y + z * z + w * w
    if not 0 < square < math.inf:
        return None
    if order is Angles.YPR:
        sine = 2 * (w * y - x * z) / square
        if abs(sine) > _LOCK:
            roll, yaw = 0.0, math.atan2(2 * (w * z - x * y), w * w - x * x + y * y - z * z)
        else:
            roll = math.atan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z)
            yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    else:
        sine = 2 * (w * y + x * z) / square
        if abs(sine) > _LOCK:
            roll, yaw = math.atan2(2 * (w * x + y * z), w * w - x * x + y * y - z * z), 0.0
        else:
            roll = math.atan2(2 * (w * x - y * z), w * w - x * x - y * y + z * z)
            yaw = math.atan2(2 * (w * z - x * y), w * w + x * x - y * y - z * z)
    return roll, math.asin(max(-1.0, min(1.0, sine))), yaw


def names() -> tuple[str, ...]:
    """The names of all functions, sorted."""
    series, angles = ([one.value for one in kind] for kind in (Series, Angles))
    return tuple(sorted((*SCALARS, *ARITHMETIC, *REDUCERS, LENGTH, NORM, *series, *angles)))
