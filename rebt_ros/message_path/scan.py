"""Ranges of a LaserScan, by the rules of its message.

Above range_max, or infinite: nothing is there as far as the sensor sees, which is range_max.  Below
range_min, or NaN: the sensor does not know, and the range is missing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from rebt_ros.arrays import FloatArray

#: How far a beam may be off the end of a slice, in shares of the angle between two beams.
_TOLERANCE: Final = 1e-3


#: What is read of a LaserScan.
SCAN_FIELDS: Final = ("angle_min", "angle_increment", "range_min", "range_max", "ranges")


class Scan(Protocol):
    """What is read of a LaserScan."""

    angle_min: float
    """Radians, as below."""
    angle_increment: float
    range_min: float
    """Meters, as below."""
    range_max: float
    ranges: Sequence[float]


def range_at(scan: Scan, index: int) -> float | None:
    """One range; None where it is missing or there is no such beam."""
    try:
        distance = float(scan.ranges[index])
    except IndexError:
        return None
    return min(distance, _most(scan)) if distance >= scan.range_min else None


@dataclass(frozen=True, slots=True)
class _Read:
    """What several paths read of one scan, one after the other."""

    scan: Scan | None
    ranges: FloatArray
    """All of them, NaN where one is missing."""
    most: float
    """The largest range there can be."""
    angles: tuple[int, float, float]
    """How many ranges, the first angle and the increment: one object while they stay the same."""


#: The scan that was read last.
_latest = _Read(None, np.zeros(0), math.inf, (0, 0.0, 0.0))


class Beams:
    """Reads the ranges of some beams.

    Args:
        first: The first of them: an index, negative from the end, or an angle; None for the first
            there is.
        last: The last one, likewise.
        by_angle: Whether both are angles in degrees; from the first, counter-clockwise.
    """

    def __init__(self, first: float | None, last: float | None, by_angle: bool) -> None:
        self._between = (
            (math.radians(first), math.radians(last))
            if by_angle and first is not None and last is not None
            else None
        )
        start = None if first is None else int(first)
        stop = None if last is None or last == -1 else int(last) + 1
        self._beams: slice | NDArray[np.intp] = slice(start, stop)
        # Scans of one sensor have the same angles as a rule.
        self._angles: tuple[int, float, float] | None = None

    def ranges(self, scan: Scan) -> FloatArray:
        """The ranges, NaN where one is missing; shape (beams,)."""
        part, most = self._part(scan)
        return np.minimum(part, most)

    def least(self, scan: Scan) -> float | None:
        """The smallest of the ranges; None where all are missing."""
        part, most = self._part(scan)
        # What is missing is passed over, unless all is.
        smallest = float(_fmin(part)) if part.size else math.nan
        return (smallest if smallest < most else most) if smallest == smallest else None

    def largest(self, scan: Scan) -> float | None:
        """The largest of the ranges; None where all are missing."""
        part, most = self._part(scan)
        largest = float(_fmax(part)) if part.size else math.nan
        return (largest if largest < most else most) if largest == largest else None

    def mean(self, scan: Scan) -> float | None:
        """The mean of the ranges; None where all are missing."""
        part, most = self._part(scan)
        there = part[part == part]
        if not there.size:
            return None
        return float(np.minimum(there, most).mean(dtype=np.float64))

    def _part(self, scan: Scan) -> tuple[FloatArray, float]:
        """The ranges of the beams as they are in the message, NaN where they are missing.

        With the largest range there can be.
        """
        read = _latest
        if read.scan is not scan:
            read = _newly_read(scan)
        if self._angles is not read.angles:
            self._angles = read.angles
            if self._between is not None:
                first, last = self._between
                self._beams = _between(first, last, *read.angles)
        return read.ranges[self._beams], read.most


_MISSING: Final = np.float32(math.nan)
_fmin, _fmax = np.fmin.reduce, np.fmax.reduce


def _newly_read(scan: Scan) -> _Read:
    """Reads a scan."""
    global _latest
    ranges, most = np.asarray(scan.ranges), _most(scan)
    # Not true of NaN.
    there = ranges >= scan.range_min
    if most == math.inf:
        there &= ranges < math.inf
    angles = (len(ranges), scan.angle_min, scan.angle_increment)
    _latest = _Read(
        scan,
        np.where(there, ranges, _MISSING),
        most,
        _latest.angles if _latest.angles == angles else angles,
    )
    return _latest


def _most(scan: Scan) -> float:
    """The largest range there can be; infinite where the message does not tell."""
    return scan.range_max if scan.range_max > 0 else math.inf


def _between(
    first: float, last: float, count: int, angle_min: float, increment: float
) -> slice | NDArray[np.intp]:
    """The beams from one angle to another, counter-clockwise, in this order.

    >>> _between(-0.1, 0.1, 63, 0.0, 0.1)
    array([62,  0,  1])
    """
    if not (math.isfinite(angle_min) and math.isfinite(increment)):
        return slice(0)
    tolerance = _TOLERANCE * abs(increment)
    circle = 2 * math.pi
    # A whole turn, and more, is all of it.
    width = last - first if 0 <= last - first < circle else (last - first) % circle
    if last - first >= circle - 1e-9:
        width = circle
    offsets = (angle_min + increment * np.arange(count) - first + tolerance) % circle
    beams = np.flatnonzero(offsets <= width + 2 * tolerance)
    ordered = beams[np.argsort(offsets[beams], kind="stable")]
    if ordered.size and np.all(np.diff(ordered) == 1):
        # To slice costs less than to pick.
        return slice(int(ordered[0]), int(ordered[-1]) + 1)
    return ordered
