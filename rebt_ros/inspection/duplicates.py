"""Near-duplicates: demonstrations that are hardly another one than one before them.

alike
    Of two demonstrations at the same share of their rows: the action is the same, and no feature
    differs by more than a fiftieth of its usual range.
near-duplicate
    A demonstration as long as an earlier one that is alike in 95 % of the rows.

Every pair is looked at by a sketch only, one number for each of 16 evenly spaced rows: where states
are alike, these are near each other.  So the work grows with the square of the number of
demonstrations, but slowly.  Pairs whose sketches are near each other in three quarters of the rows
are compared by these rows, and the 20 that agree best row by row.  What is a near-duplicate itself
is not compared with.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.inspection.inspection import Duplicate
from rebt_ros.inspection.joined import Joined

#: Share of its usual range by which a feature may differ in rows that are alike.
ALIKE: Final = 0.02
#: Share of the rows that are alike in near-duplicates.
MOST_ROWS: Final = 0.95
#: A near-duplicate is as long as the other one up to this share.
LENGTH: Final = 0.1
#: Shorter demonstrations are alike by chance.
FEWEST_ROWS: Final = 10
#: Of more demonstrations, near-duplicates are not looked for.
MOST_DEMONSTRATIONS: Final = 20_000

#: Rows of a sketch, and how many of them have to be near.
_SKETCHED, _NEAR = 16, 12
#: Demonstrations that are compared row by row with each, and rows that are compared, evenly spaced.
_MOST_PARTNERS, _MOST_COMPARED = 20, 1_000
#: Sketches that are compared with all others at a time.
_AT_A_TIME = 256


def near_duplicates(
    joined: Joined, seconds: Sequence[float | None]
) -> dict[int, tuple[int, float]]:
    """Near-duplicates, each with the first that it is nearly, and the share of rows alike.

    Args:
        joined: All rows.
        seconds: How long each demonstration is; None where stamps tell no time.
    """
    rows = np.diff(joined.starts)
    looked_at = np.flatnonzero(rows >= FEWEST_ROWS)
    if len(looked_at) < 2 or len(rows) > MOST_DEMONSTRATIONS:
        return {}
    lengths = _Lengths(rows, seconds)
    sketched = np.array([_spread(joined, number, _SKETCHED) for number in looked_at.tolist()])
    found: dict[int, tuple[int, float]] = {}
    for place, near in enumerate(_near_earlier(_sketches(joined, sketched))):
        number = int(looked_at[place])
        near = near[[int(looked_at[one]) not in found for one in near.tolist()]]
        near = near[lengths.alike(number, looked_at[near])]
        if not len(near):
            continue
        agreeing = _alike(joined, sketched[place][np.newaxis], sketched[near]).sum(axis=1)
        order = np.argsort(-agreeing, kind="stable")[:_MOST_PARTNERS]
        for partner in np.sort(near[order[agreeing[order] >= _NEAR]]).tolist():
            other = int(looked_at[partner])
            share = _share_alike(joined, number, other)
            if share >= MOST_ROWS:
                found[number] = other, share
                break
    return found


class _Lengths:
    """Which demonstrations are as long as each other."""

    def __init__(self, rows: IntArray, seconds: Sequence[float | None]) -> None:
        self._rows = rows.astype(np.float64)
        self._seconds = np.array([np.nan if one is None else one for one in seconds])

    def alike(self, number: int, others: IntArray) -> BoolArray:
        """Whether each of the others is as long, in seconds where both have them, else in rows."""
        timed = ~np.isnan(self._seconds[others] + self._seconds[number])
        mine = np.where(timed, self._seconds[number], self._rows[number])
        its = np.where(timed, self._seconds[others], self._rows[others])
        return np.asarray(np.minimum(mine, its) >= (1 - LENGTH) * np.maximum(mine, its))


def _spread(joined: Joined, number: int, count: int) -> IntArray:
    """So many evenly spaced rows of a demonstration, the first and the last among them."""
    first, end = joined.starts[number], joined.starts[number + 1]
    return np.asarray(np.rint(np.linspace(first, end - 1, count)), dtype=np.int64)


def _sketches(joined: Joined, rows: IntArray) -> FloatArray:
    """A number for each of the rows; near each other, by 1 at most, where states are alike.

    Args:
        joined: All rows.
        rows: Shape (demonstrations, rows).
    """
    count = len(joined.table.features)
    # Signs that tell features apart; the sum of what alike features differ by is ALIKE at most.
    signs = np.random.default_rng(0).choice((-1.0, 1.0), size=count)
    states = joined.scaled(rows.ravel())
    return np.asarray(states @ signs / (count * ALIKE)).reshape(rows.shape)


def _near_earlier(sketches: FloatArray) -> Iterator[IntArray]:
    """For each demonstration, the earlier ones whose sketches are near its own."""
    # What is added up rounds.
    most = 1.0 + 1e-6
    for start in range(0, len(sketches), _AT_A_TIME):
        some, earlier = sketches[start : start + _AT_A_TIME], sketches[: start + _AT_A_TIME]
        near = np.zeros((len(some), len(earlier)), dtype=np.uint8)
        for mine, its in zip(some.T, earlier.T, strict=True):
            near += np.abs(mine[:, np.newaxis] - its) <= most
        for place, counts in enumerate(near):
            yield np.flatnonzero(counts[: start + place] >= _NEAR)


def _alike(joined: Joined, rows: IntArray, others: IntArray) -> BoolArray:
    """Whether rows are alike.

    Args:
        joined: All rows.
        rows: Shape (1, rows).
        others: Shape (demonstrations, rows).

    Returns:
        Shape (demonstrations, rows).
    """
    chosen = joined.table.chosen
    mine = joined.scaled(rows.ravel()).reshape(*rows.shape, -1)
    its = joined.scaled(others.ravel()).reshape(*others.shape, -1)
    same = (np.abs(mine - its) <= ALIKE).all(axis=2)
    return np.asarray(same & (chosen[rows] == chosen[others]))


def _share_alike(joined: Joined, number: int, other: int) -> float:
    longest = max(joined.starts[one + 1] - joined.starts[one] for one in (number, other))
    count = min(int(longest), _MOST_COMPARED)
    mine, its = (_spread(joined, one, count)[np.newaxis] for one in (number, other))
    return float(np.mean(_alike(joined, mine, its)))


def as_duplicate(found: tuple[int, float] | None, names: Sequence[str]) -> Duplicate | None:
    """What was found, with the name of the other demonstration."""
    return None if found is None else Duplicate(names[found[0]], found[1])
