"""Lagged features: the state some rows earlier.

One row back is a fixed step back in time only if rows are evenly spaced: recorded with a sample
rate, or samples in a table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rebt_ros.demonstration.large_arrays import roomy
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable

#: Gaps between rows are equal if they differ from the median by less than this share of it.
_JITTER = 0.25
#: Minimum share of equal gaps in evenly spaced rows: a recording may have a few pauses.
_EVEN = 0.9


def with_lags(table: DemonstrationTable, lags: int) -> DemonstrationTable:
    """The table with the values that each feature had 1 to `lags` rows earlier.

    Looking back ends at the beginning of a demonstration: in its first k rows, the value of k rows
    earlier is missing.  Take parts of the table (`DemonstrationTable.where`) only afterwards.

    Args:
        table: Rows of one channel, without lagged features.
        lags: How many rows to look back, 0 or more.

    Returns:
        The same rows; all features of the table, then all of one row earlier, and so on.
    """
    if not lags:
        return table
    # Position in its demonstration, whose rows are contiguous.
    row = np.arange(len(table)) - np.searchsorted(table.demonstration, table.demonstration)
    width = len(table.features)
    states = roomy((len(table), width * (1 + lags)))
    states[:, :width] = table.states
    for lag in range(1, lags + 1):
        earlier = states[:, lag * width : (lag + 1) * width]
        earlier[lag:] = table.states[:-lag]
        earlier[row < lag] = np.nan
    features = (*table.features, *_lagged(table.features, lags))
    return replace(table, features=features, states=states)


def evenly_spaced(table: DemonstrationTable) -> bool:
    """Whether (nearly) the same time passes from each row of a demonstration to the next."""
    gaps = np.diff(table.stamps)[np.diff(table.demonstration) == 0]
    if not len(gaps):
        return True
    usual = float(np.median(gaps))
    return bool(np.mean(np.abs(gaps - usual) <= _JITTER * usual) >= _EVEN)


def _lagged(features: tuple[Feature, ...], lags: int) -> Iterator[Feature]:
    taken = {feature.name for feature in features}
    for lag in range(1, lags + 1):
        for place, source in enumerate(features):
            name = f"{source.name}[t-{lag}]"
            while name in taken:
                name += "'"
            taken.add(name)
            index = place if source.index is None else source.index
            yield replace(source, name=name, index=index, lag=lag)
