"""Which differences of two features a tree may test: ``left < right``, ``goal_x − x > 0.3``.

A tree that compares one feature at a time needs many splits for what a difference says in one.
But n features have n (n - 1) / 2 differences, most of which mean nothing.  A difference is offered
if its features have the same scale, and if a tree of some of the rows makes use of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from types import MappingProxyType

import numpy as np

from rebt_ros.arrays import FloatArray
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary, columns, encode
from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Difference

#: Percentiles that bound a feature's range, and the factor by which two ranges may differ.
_FROM, _TO, _MOST_RATIO = 5.0, 95.0, 2.0
#: Rows of the tree that shows which differences are useful, evenly spread.
_MOST_ROWS = 1_000
#: Only this many features, the first ones, make differences; this bounds the columns.
_MOST_FEATURES = 24
#: Number of differences offered, and the minimum share of each in the impurity decrease.
_MOST_DIFFERENCES, _LEAST_SHARE = 6, 0.02


def likely_differences(
    table: DemonstrationTable,
    vocabulary: Vocabulary,
    units: Mapping[str, str] = MappingProxyType({}),
    random_state: int = 0,
) -> tuple[Difference, ...]:
    """The differences that a tree makes most use of.

    Args:
        table: At least one row.
        vocabulary: What else the tree may test.
        units: Units of features by name; features with different units make no difference.
        random_state: Breaks ties between equally good splits.

    Returns:
        At most six, in the order of the features.
    """
    possible = _of_one_scale(table, units)
    if not possible:
        return ()
    step = -(-len(table) // _MOST_ROWS)
    some = table.where(np.arange(len(table)) % step == 0)
    every = vocabulary.with_more(possible)
    from sklearn.tree import DecisionTreeClassifier

    classifier = DecisionTreeClassifier(random_state=random_state)
    classifier.fit(encode(some, every), some.chosen, sample_weight=some.row_weights)
    first = len(columns(table, FEATURES_ALONE)) + len(vocabulary.combinations)
    shares = classifier.feature_importances_[first : first + len(possible)]
    ranked = np.argsort(-shares, kind="stable")[:_MOST_DIFFERENCES]
    return tuple(possible[place] for place in sorted(ranked) if shares[place] >= _LEAST_SHARE)


def _of_one_scale(table: DemonstrationTable, units: Mapping[str, str]) -> tuple[Difference, ...]:
    ranges: dict[str, float] = {}
    for place, feature in enumerate(table.features):
        if feature.kind is FeatureKind.NUMERIC and not feature.lag:
            spread = _spread(table.states[:, place])
            if spread > 0 and len(ranges) < _MOST_FEATURES:
                ranges[feature.name] = spread
    return tuple(
        Difference(one, other)
        for one, other in combinations(ranges, 2)
        if units.get(one) == units.get(other)
        and max(ranges[one], ranges[other]) <= _MOST_RATIO * min(ranges[one], ranges[other])
    )


def _spread(column: FloatArray) -> float:
    """From the 5th to the 95th percentile; 0 if nothing is known or differences overflow."""
    known = column[~np.isnan(column)]
    if not len(known) or np.abs(known).max() > LARGEST_VALUE / 2:
        return 0.0
    low, high = np.percentile(known, (_FROM, _TO))
    return float(high - low)
