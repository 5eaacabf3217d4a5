"""Lagged features: what the state was some rows before.

A row back is a step back in time only where rows are evenly spaced: recorded with a sample rate,
or samples of a table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rebt_ros.demonstration.large_arrays import roomy
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable

#: Gaps between rows that differ from the median by less than this share of it are equal.
_JITTER = 0.25
#: Least share of equal gaps in rows that are evenly spaced: a recording may have a few pauses.
_EVEN = 0.9


def with_lags(table: DemonstrationTable, lags: int) -> DemonstrationTable:
    """The table with the values that each feature had 1 to `lags` rows before.

    Looking back ends at the border of a demonstration: its first k rows lack the value of k rows
    before.  Take parts of the table (`DemonstrationTable.where`) afterwards, not before.

    Args:
        table: Rows of one channel, without lagged features.
        lags: How many rows to look back, 0 or more.

    Returns:
        The same rows; all features of the table, then all of one row before, and so on.
    """
    if not lags:
        return table
    # Position in its demonstration; a demonstration's rows stand together.
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
