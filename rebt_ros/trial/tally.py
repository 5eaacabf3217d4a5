"""Successes among episodes, and what they say about the share that is behind them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, NamedTuple

#: Of the intervals.
CONFIDENCE: Final = 0.95
_Z: Final = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)


class Interval(NamedTuple):
    """From where to where, both in 0..1."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Tally:
    """How many episodes succeeded.

    Raises:
        ValueError: There cannot be so many successes.
    """

    successes: int = 0
    episodes: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.successes <= self.episodes:
            raise ValueError(f"{self.successes} successes of {self.episodes} episodes")

    @property
    def share(self) -> float | None:
        """Share of successes, 0..1; None where nothing was tried."""
        return self.successes / self.episodes if self.episodes else None

    @property
    def interval(self) -> Interval:
        """Where the share would come to lie after very many episodes, at `CONFIDENCE`.

        Wilson's score interval (1927): it stays within 0..1 and means what it says also for few
        episodes and for shares of 0 and 1, where the usual one has no width at all.
        """
        count = self.episodes
        if not count:
            return Interval(0.0, 1.0)
        share, square = self.successes / count, _Z * _Z
        middle = (share + square / (2 * count)) / (1 + square / count)
        spread = math.sqrt(share * (1 - share) / count + square / (4 * count * count))
        half = _Z * spread / (1 + square / count)
        # Exact at both ends, whatever the rounding.
        low = 0.0 if self.successes == 0 else max(middle - half, 0.0)
        high = 1.0 if self.successes == count else min(middle + half, 1.0)
        return Interval(low, high)

    def least_lead(self, other: Tally) -> float:
        """By how much its share is above another one at least, at `CONFIDENCE`; -1..1.

        The lower end of Newcombe's interval of a difference (1998, method 10), made of both Wilson
        intervals, as if the episodes of the two had nothing to do with each other; where they have
        the same starts, that is on the safe side.
        """
        mine, others = self.share, other.share
        if mine is None or others is None:
            return -1.0
        chance = math.hypot(mine - self.interval.low, other.interval.high - others)
        return mine - others - chance

    def surely_above(self, other: Tally) -> bool:
        """Whether its share is larger, and not only by chance."""
        return self.least_lead(other) > 0
