"""Rows that several demonstrations share, as after two recorders heard the same messages."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.demonstration.demonstration import Demonstration

#: Demonstrations that share more of their rows are the same one (share of the shorter one).
_SAME: Final = 0.5
#: Fewer shared rows say nothing.
_FEWEST: Final = 5
#: Lower stamps are row numbers, which other tables have as well (ns).
_FIRST_TIME: Final = 1_000_000_000
#: Fewer shared rows say nothing about demonstrations without times.
_FEWEST_IN_ALL: Final = 20
#: If there are more rows than this, only some are compared.
_MOST: Final = 500_000
#: Number of pairs that notes name.
_NAMED: Final = 5

#: Multiplier that spreads numbers over all 64 bits.
_ODD: Final = np.uint64(0x9E3779B97F4A7C15)

Hashes = NDArray[np.uint64]


def repeated(demonstrations: Sequence[Demonstration]) -> Iterator[str]:
    """Notes on rows that occur twice, in two demonstrations or in a single one.

    Args:
        demonstrations: All that are learned from.  Those without times must share all rows, since
            many tables share some rows at the same positions.
    """
    tell_time = [len(one.stamps) and one.stamps.min() >= _FIRST_TIME for one in demonstrations]
    part = sum(len(one.stamps) for one in demonstrations) // _MOST + 1
    # Those of many rows are looked into where they may share some.
    worth = _may_share(demonstrations) if part > 1 else np.ones(len(demonstrations), dtype=bool)
    hashes = [
        _hashes(one, part) if may else np.zeros(0, np.uint64)
        for one, may in zip(demonstrations, worth.tolist(), strict=True)
    ]
    for one, found in zip(demonstrations, hashes, strict=True):
        again = len(one.stamps) - len(found)
        if part == 1 and again >= max(_FEWEST, _SAME * len(found)):
            yield (
                f"{one.name} holds {again} rows again, which count twice: see whether one of its "
                "files was copied or converted beside itself"
            )
    owner = np.repeat(np.arange(len(hashes)), [len(one) for one in hashes])
    shared = _shared(np.concatenate([*hashes, np.zeros(0, np.uint64)]), owner)
    pairs = [
        (first, second, rows)
        for (first, second), rows in sorted(shared.items())
        if rows >= max(_FEWEST, _SAME * min(len(hashes[first]), len(hashes[second])))
        if tell_time[first] or rows == len(hashes[first]) == len(hashes[second]) >= _FEWEST_IN_ALL
    ]
    for first, second, rows in pairs[:_NAMED]:
        names = f"{demonstrations[first].name} and {demonstrations[second].name}"
        count = rows if part == 1 else f"about {rows * part}"
        yield f"{names} share {count} rows, which count twice: leave one of them out"
    if (more := len(pairs) - _NAMED) > 0:
        yield f"{more} more pairs of demonstrations share rows"


def _may_share(demonstrations: Sequence[Demonstration]) -> BoolArray:
    """Which demonstrations may share as many rows with another one as is told of.

    Those with times overlap it in time; those without have the same first and last stamps, and the
    same rows there.
    """
    ends = [_ends(one) for one in demonstrations]
    alone = Counter(ends)
    span = np.array([[*end[:2]] for end in ends], dtype=np.int64).reshape(-1, 2)
    first, last = span.T
    timed = first >= _FIRST_TIME
    order = np.argsort(first, kind="stable")
    latest = np.maximum.accumulate(last[order])
    overlaps = np.zeros(len(ends), dtype=bool)
    overlaps[order[1:]] = first[order[1:]] <= latest[:-1]
    overlaps[order[:-1]] |= first[order[1:]] <= last[order[:-1]]
    twin = np.array([alone[end] > 1 for end in ends], dtype=bool)
    # One with times may share rows with one that began before them, such as at 0.
    around = timed.any() & (last >= _FIRST_TIME)
    return np.asarray(overlaps & (timed | around) | twin)


def _ends(demonstration: Demonstration) -> tuple[int, int, bytes]:
    """The first and last stamp, and where stamps rise, the states of the rows with them."""
    stamps = demonstration.stamps
    if not len(stamps):
        return 0, 0, b""
    # Adding 0 gives both zeros the same bits.
    rows = demonstration.states[[0, -1]] + 0.0 if (stamps[1:] > stamps[:-1]).all() else np.empty(0)
    return int(stamps.min()), int(stamps.max()), rows.tobytes()


def _hashes(demonstration: Demonstration, part: int) -> Hashes:
    """A number for each distinct row, or for one in so many."""
    mixed = demonstration.stamps.astype(np.uint64)
    for column in _columns(demonstration):
        mixed = (mixed ^ column) * _ODD
        mixed ^= mixed >> np.uint64(29)
    return np.unique(mixed[mixed % np.uint64(part) == 0])


def _columns(demonstration: Demonstration) -> Iterator[Hashes]:
    """The contents of the rows except stamps, column by column."""
    yield _texts(demonstration.actions)[demonstration.chosen]
    yield _texts(demonstration.channels)[demonstration.channel]
    for values in demonstration.states.T:
        # Adding 0 gives both zeros the same bits.
        yield (values + 0.0).view(np.uint64)


def _texts(texts: Sequence[str]) -> Hashes:
    # Unlike those of Python, these are the same in every process.
    digests = (
        hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8).digest()
        for text in texts
    )
    return np.frombuffer(b"".join(digests), dtype="<u8").astype(np.uint64)


def _shared(hashes: Hashes, owner: IntArray) -> Counter[tuple[int, int]]:
    """How many rows each pair of demonstrations shares; a row counts for the first two."""
    order = np.argsort(hashes, kind="stable")
    hashes, owner = hashes[order], owner[order]
    again = np.flatnonzero(hashes[1:] == hashes[:-1])
    return Counter(zip(owner[again].tolist(), owner[again + 1].tolist(), strict=True))
