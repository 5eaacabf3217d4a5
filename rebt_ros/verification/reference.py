"""States that were shown, which states found by a proof are compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import FloatArray
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.shown import ShownValues, Span
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """What was shown on one channel: rows, or where they are not at hand, their ranges."""

    low: FloatArray
    """Smallest values, shape (rows, features); NaN: missing, -inf: anything."""
    high: FloatArray
    """Largest values, in the same way; of rows, the same as `low`."""
    scale: FloatArray
    """How far the values of each feature lie apart, above 0, shape (features,)."""
    table: DemonstrationTable | None
    """The rows; None where only their ranges are known."""

    def __len__(self) -> int:
        return len(self.low)


def of_table(table: DemonstrationTable) -> Reference:
    """The rows of a table, whose features are those of the tree."""
    return Reference(table.states, table.states, _scale(table.states, table.states), table)


def of_tree(learned: LearnedTree, channel: str) -> Reference:
    """What a tree knows of the rows it was learned from; without it, there are no rows."""
    leaves = [leaf for one in learned.shown if one.channel == channel for leaf in one.leaves]
    ranges = [
        [
            _range(values, feature)
            for values, feature in zip(leaf.values, learned.features, strict=True)
        ]
        for leaf in leaves
    ]
    both = np.array(ranges, dtype=np.float64).reshape(len(leaves), len(learned.features), 2)
    low, high = both[..., 0], both[..., 1]
    return Reference(low, high, _scale(low, high), None)


def _range(values: ShownValues, feature: Feature) -> tuple[float, float]:
    if isinstance(values, Span):
        return values.low, values.high
    if values is not None and len(values) == 1 and feature.kind is FeatureKind.CATEGORICAL:
        code = float(feature.categories.index(values[0]))
        return code, code
    return -np.inf, np.inf


def _scale(low: FloatArray, high: FloatArray) -> FloatArray:
    lowest = np.min(np.where(np.isfinite(low), low, np.inf), axis=0, initial=np.inf)
    highest = np.max(np.where(np.isfinite(high), high, -np.inf), axis=0, initial=-np.inf)
    known = highest > lowest
    spread = np.subtract(highest, lowest, out=np.ones(len(known)), where=known)
    return np.where(np.isfinite(spread), spread, 1.0)
