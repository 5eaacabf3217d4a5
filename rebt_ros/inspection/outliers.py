"""Outliers: demonstrations of which a figure is far from that of the others.

The measure is the modified z-score (Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993):
0.6745 times the distance from the median, in median absolute deviations, or where more than half of
the figures are equal, the distance in 1.2533 mean absolute deviations.  From 3.5 on it is an
outlier, as they recommend, unless the difference is too small to matter to anyone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.inspection.inspection import Outlier, OutlierKind, Timing
from rebt_ros.inspection.joined import Joined

#: Of fewer demonstrations, nobody knows what is usual.
FEWEST: Final = 5
#: Modified z-score from which on a figure is an outlier.
SCORE: Final = 3.5
#: Lengths and rates differ by this factor at least, ...
FACTOR: Final = 1.5
#: ... shares of actions by so much, ...
SHARE: Final = 0.1
#: ... and medians of features by this share of the usual range.
RANGE: Final = 0.5
#: A value is far outside what the others have from this share of the usual range on.
OUTSIDE: Final = 0.1
#: Scores end there.
LARGEST_SCORE: Final = 1e6
#: Outliers that are listed of a demonstration.
MOST_LISTED: Final = 10

#: What makes deviations comparable with standard deviations of a normal distribution.
_MEDIAN_DEVIATION, _MEAN_DEVIATION = 0.6745, 1.253314


def outliers(
    joined: Joined, counts: IntArray, timings: Sequence[Timing | None]
) -> tuple[tuple[Outlier, ...], ...]:
    """The outliers of each demonstration, the furthest first.

    Args:
        joined: All rows.
        counts: Rows of each action, shape (demonstrations, actions).
        timings: Of each demonstration.
    """
    found: list[list[Outlier]] = [[] for _ in timings]
    rows = np.diff(joined.starts)
    shown = np.flatnonzero(rows)
    if len(shown) < FEWEST:
        return tuple(() for _ in timings)
    nothing = np.full(len(rows), np.nan)
    timed = [place for place, one in enumerate(timings) if one is not None and one.seconds > 0]
    seconds, rates = nothing.copy(), nothing.copy()
    for place in timed:
        one = timings[place]
        assert one is not None
        seconds[place], rates[place] = one.seconds, one.rate
    lengths = np.where(rows > 0, rows, np.nan)
    for kind, figures in (
        (OutlierKind.ROWS, lengths),
        (OutlierKind.SECONDS, seconds),
        (OutlierKind.RATE, rates),
    ):
        for place, outlier in _far(kind, "", np.log(figures), np.log(FACTOR)):
            value, usual = np.exp([outlier.value, outlier.usual]).tolist()
            found[place].append(Outlier(kind, "", value, usual, outlier.score))
    shares = counts / lengths[:, np.newaxis]
    several = len({channel for channel, _ in joined.actions}) > 1
    for code, (channel, label) in enumerate(joined.actions):
        name = f"{channel}: {label}" if several else label
        for place, outlier in _far(OutlierKind.ACTION_SHARE, name, shares[:, code], SHARE):
            found[place].append(outlier)
        where = np.flatnonzero(counts[:, code])
        if len(where) == 1:
            count = float(counts[where[0], code])
            found[where[0]].append(Outlier(OutlierKind.ACTION_ONLY_HERE, name, count, 0.0, SCORE))
    for place, outlier in _of_features(joined, shown):
        found[place].append(outlier)
    return tuple(tuple(sorted(its, key=lambda one: -one.score)[:MOST_LISTED]) for its in found)


def _far(
    kind: OutlierKind, name: str, figures: FloatArray, least: float
) -> Iterator[tuple[int, Outlier]]:
    """Which figures are far from the others, by at least so much.

    Args:
        kind: What they are.
        name: Of what.
        figures: Of each demonstration, shape (demonstrations,); NaN where there is none.
        least: What a difference has to be.
    """
    known = figures[~np.isnan(figures)]
    if len(known) < FEWEST:
        return
    median = float(np.median(known))
    deviations = np.abs(known - median)
    unit = float(np.median(deviations)) / _MEDIAN_DEVIATION
    unit = unit or float(np.mean(deviations)) * _MEAN_DEVIATION
    if not unit:
        return
    with np.errstate(invalid="ignore", over="ignore"):
        scores = np.minimum(np.abs(figures - median) / unit, LARGEST_SCORE)
        far = (scores > SCORE) & (np.abs(figures - median) >= least)
    for place in np.flatnonzero(far).tolist():
        yield place, Outlier(kind, name, float(figures[place]), median, float(scores[place]))


def _of_features(joined: Joined, shown: IntArray) -> Iterator[tuple[int, Outlier]]:
    """Medians and ranges of numeric features that are far from those of the others."""
    figures = np.full((3, len(joined.starts) - 1, len(joined.table.features)), np.nan)
    for number in shown.tolist():
        figures[:, number] = _low_median_high(joined.table.states[joined.rows_of(number)])
    for place, feature in enumerate(joined.table.features):
        if feature.kind is not FeatureKind.NUMERIC:
            continue
        width = float(joined.usual.width[place])
        low, median, high = figures[:, :, place]
        yield from _far(OutlierKind.FEATURE_MEDIAN, feature.name, median, RANGE * width)
        yield from _outside(feature.name, low, width, above=False)
        yield from _outside(feature.name, high, width, above=True)


def _low_median_high(states: FloatArray) -> FloatArray:
    """Of each feature, without what is missing, shape (3, features); NaN where all is."""
    # These leave out what is missing, unless all is.
    low, high = np.fmin.reduce(states, axis=0), np.fmax.reduce(states, axis=0)
    if not np.isnan(states).any():
        return np.array([low, np.median(states, axis=0), high])
    known = np.count_nonzero(~np.isnan(states), axis=0)
    ordered = np.sort(states, axis=0)
    columns = np.arange(states.shape[1])
    below, above = np.maximum(known - 1, 0) // 2, np.minimum(known // 2, len(states) - 1)
    # Halves first: the sum of large values has no bounds.
    median = ordered[below, columns] / 2 + ordered[above, columns] / 2
    return np.array([low, median, high])


def _outside(
    name: str, ends: FloatArray, width: float, *, above: bool
) -> Iterator[tuple[int, Outlier]]:
    """Ranges that end far outside those of all others; one at most.

    Args:
        name: Of the feature.
        ends: Upper ends of the ranges, or lower ones, shape (demonstrations,).
        width: The usual range.
        above: Whether they are upper ends.
    """
    known = np.flatnonzero(~np.isnan(ends))
    if len(known) < FEWEST:
        return
    order = known[np.argsort(ends[known], kind="stable")]
    place, other = (order[-1], order[-2]) if above else (order[0], order[1])
    value, usual = float(ends[place]), float(ends[other])
    # Widths may be as small as numbers can be.
    score = min(abs(value - usual) / OUTSIDE / width, LARGEST_SCORE)
    if score >= 1:
        yield int(place), Outlier(OutlierKind.FEATURE_RANGE, name, value, usual, score)
