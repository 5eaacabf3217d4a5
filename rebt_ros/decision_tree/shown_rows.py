"""What a decision tree was learned from, leaf by leaf."""

from __future__ import annotations

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, in_parts
from rebt_ros.behavior_tree.shown import (
    MOST_SHOWN_LEAVES,
    ShownChannel,
    ShownLeaf,
    ShownValues,
    Span,
)
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable

#: Maximum number of ranges of a channel, over all leaves and features; bounds documents.
_MOST_RANGES = 10_000


def shown_rows(table: DemonstrationTable, trained: TrainedTree) -> ShownChannel:
    """The ranges of the features in the rows of each leaf.

    If there are more leaves than a document should hold, leaves next to each other share their
    ranges.  These then separate shown from unknown states less sharply.

    Args:
        table: The rows that the tree was learned from, without rows made up for rare actions.
        trained: The tree.
    """
    compared = sum(not feature.lag for feature in table.features)
    most = min(MOST_SHOWN_LEAVES, max(_MOST_RANGES // max(compared, 1), 1))
    leaf_of_row = trained.leaves(table)
    # scikit-learn numbers nodes from left to right, so neighbors have adjacent numbers.
    reached = np.bincount(leaf_of_row, minlength=len(trained.grown))
    leaves = np.flatnonzero(reached)
    group_of_leaf = np.zeros(len(reached), dtype=np.int64)
    group_of_leaf[leaves] = _groups(len(leaves), most)
    # Numbers of few bits are sorted several times as fast.
    group_of_leaf = group_of_leaf.astype(np.min_scalar_type(-most - 1))
    rows = np.bincount(group_of_leaf[leaves], weights=reached[leaves]).astype(np.int64)
    columns = [_Values(feature, len(rows)) for feature in table.features]
    for part in in_parts(len(table)):
        group_of_row = group_of_leaf[leaf_of_row[part]]
        order = np.argsort(group_of_row, kind="stable")
        starts = np.flatnonzero(np.diff(group_of_row[order], prepend=-1))
        groups, states = group_of_row[order[starts]].astype(np.int64), table.states[part]
        for place, values in enumerate(columns):
            values.add(states[:, place][order], groups, starts)
    shown = [values.shown() for values in columns]
    return ShownChannel(
        table.channel,
        tuple(
            ShownLeaf(count, tuple(values[group] for values in shown))
            for group, count in enumerate(rows.tolist())
        ),
    )


def _groups(leaves: int, most: int) -> IntArray:
    """The group of each leaf: itself, or one of `most` groups of about equal size."""
    count = min(leaves, most)
    return np.arange(leaves) * count // max(leaves, 1)


class _Values:
    """The values of a feature in the rows of each group, gathered part by part of a table.

    Args:
        feature: The feature.
        groups: Number of groups.
    """

    def __init__(self, feature: Feature, groups: int) -> None:
        self._feature = feature
        self._low, self._high = np.full((2, groups), np.nan)
        self._occurs = np.zeros((groups, len(feature.categories)), dtype=bool)

    def add(self, column: FloatArray, groups: IntArray, starts: IntArray) -> None:
        """Adds the values of some rows.

        Args:
            column: Values, one group after another, shape (rows,).
            groups: The groups that have rows.
            starts: Where each of them begins.
        """
        if self._feature.lag:
            return
        if self._feature.kind is FeatureKind.CATEGORICAL:
            of_row = np.repeat(groups, np.diff(starts, append=len(column)))
            known = ~np.isnan(column)
            self._occurs[of_row[known], column[known].astype(np.int64)] = True
            return
        # These ignore missing values, unless all are missing.
        self._low[groups] = np.fmin(self._low[groups], np.fmin.reduceat(column, starts))
        self._high[groups] = np.fmax(self._high[groups], np.fmax.reduceat(column, starts))

    def shown(self) -> list[ShownValues]:
        """What was shown, group by group."""
        if self._feature.lag:
            return [None] * len(self._low)
        if self._feature.kind is FeatureKind.CATEGORICAL:
            return [self._categories(occurs) for occurs in self._occurs]
        return [
            None if np.isnan(least) else Span(least, most)
            for least, most in zip(self._low.tolist(), self._high.tolist(), strict=True)
        ]

    def _categories(self, occurs: BoolArray) -> ShownValues:
        codes = np.flatnonzero(occurs).tolist()
        return tuple(self._feature.categories[code] for code in codes) or None
