"""What a decision tree was learned from, leaf by leaf."""

from __future__ import annotations

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
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

#: Ranges that a channel may have, over all leaves and features: bounds the size of documents.
_MOST_RANGES = 10_000


def shown_rows(table: DemonstrationTable, trained: TrainedTree) -> ShownChannel:
    """The ranges of the features in the rows of each leaf.

    Where there are more leaves than a document should hold, leaves that stand side by side in the
    tree share their ranges: what was shown is then told from what was not less sharply.

    Args:
        table: The rows that the tree was learned from; those made up for rare actions were not
            shown.
        trained: The tree.
    """
    compared = sum(not feature.lag for feature in table.features)
    most = min(MOST_SHOWN_LEAVES, max(_MOST_RANGES // max(compared, 1), 1))
    # scikit-learn numbers nodes from left to right, so that neighbours have neighbouring numbers.
    leaves, leaf_of_row = np.unique(trained.leaves(table), return_inverse=True)
    group_of_row = _groups(len(leaves), most)[leaf_of_row]
    order = np.argsort(group_of_row, kind="stable")
    starts = np.flatnonzero(np.diff(group_of_row[order], prepend=-1))
    # Feature by feature, so that a large table is not held a second time.
    columns = [
        _values(feature, table.states[:, place], order, starts)
        for place, feature in enumerate(table.features)
    ]
    rows = np.diff(starts, append=len(table)).tolist()
    return ShownChannel(
        table.channel,
        tuple(
            ShownLeaf(count, tuple(values[group] for values in columns))
            for group, count in enumerate(rows)
        ),
    )


def _groups(leaves: int, most: int) -> IntArray:
    """The group of each leaf: itself, or one of `most` groups of about equally many."""
    count = min(leaves, most)
    return np.arange(leaves) * count // max(leaves, 1)


def _values(
    feature: Feature, column: FloatArray, order: IntArray, starts: IntArray
) -> list[ShownValues]:
    """What a feature was in the rows of each group.

    Args:
        feature: The feature.
        column: Its values, shape (rows,).
        order: Positions of the rows, group after group.
        starts: Where each group begins in `order`.
    """
    if feature.lag:
        return [None] * len(starts)
    ordered = column[order]
    if feature.kind is FeatureKind.CATEGORICAL:
        return [_categories(feature, part) for part in np.split(ordered, starts[1:])]
    # These leave out what is missing, unless all is.
    low, high = np.fmin.reduceat(ordered, starts), np.fmax.reduceat(ordered, starts)
    return [
        None if np.isnan(least) else Span(least, most)
        for least, most in zip(low.tolist(), high.tolist(), strict=True)
    ]


def _categories(feature: Feature, column: FloatArray) -> ShownValues:
    known = column[~np.isnan(column)]
    codes = np.unique(known).astype(np.int64).tolist()
    return tuple(feature.categories[code] for code in codes) if codes else None
