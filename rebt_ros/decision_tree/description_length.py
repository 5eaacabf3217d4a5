"""How many bits describe what was done: a decision tree, and the rows that it gets wrong.

This is the minimum description length principle (Rissanen, 1978; for decision trees, Quinlan and
Rivest, 1989).  Unlike the size of an explanation (see `FittedTree.explanation`), it distinguishes
cheap tests from expensive ones: a threshold is one of as many as there are rows, while a category
or a previous action needs no number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from rebt_ros.behavior_tree.condition_tests import StateTests
from rebt_ros.decision_tree.encoding import Number
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.tree import DecisionTree, Split
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Quantity, Threshold


@dataclass(frozen=True, slots=True)
class Description:
    """The shortest description of the rows that a tree was fitted to, over all ways to prune it."""

    bits: float
    """Bits of the tree and its exceptions."""
    exceptions: int
    """Rows that the tree gets wrong."""
    exception_bits: float
    """Bits of each exception."""


def shortest_description(fitted: FittedTree) -> Description:
    """Describes the rows by a tree, pruned for the shortest description.

    Each node takes one bit that says whether it is a leaf.  A leaf names its action, an exception
    its row and another action.  A split names its column.  A split that compares a number also
    names one of the rows of its node, whose value is the threshold.
    """
    grown = fitted.grown
    rows = np.maximum(grown.counts.sum(axis=1), 1)
    actions = max(int(np.count_nonzero(grown.counts[0])), 2)
    exception_bits = math.log2(rows[0]) + math.log2(actions - 1)
    exceptions = rows - grown.counts.max(axis=1)
    compares = np.array([isinstance(asked, Number) for asked in fitted.asked])[
        np.maximum(grown.column, 0)
    ]
    split = 1 + math.log2(len(fitted.asked)) + np.where(compares, np.log2(rows), 0.0)
    bits, is_leaf = grown.cheapest(1 + math.log2(actions) + exceptions * exception_bits, split)
    leaves = np.unique(fitted.path.standing(is_leaf)[grown.left < 0])
    return Description(bits, int(exceptions[leaves].sum()), exception_bits)


def border_bits(tree: DecisionTree, table: DemonstrationTable) -> float:
    """Bits of the numbers that a tree compares with.

    Each is a multiple of its power of ten, up to the largest absolute value in the table: 10 is one
    of 0 and 10, and 9.3 is one of more than a hundred.  This distinguishes borders that a person
    has in mind from borders that only happen to separate the rows.

    Args:
        tree: A tree with thresholds that are as round as possible.
        table: The rows that it separates.
    """
    borders: dict[Quantity, set[float]] = {}
    for node in tree.walk():
        match node:
            # Whatever the largest value, 0 is the only multiple needed.
            case Split(condition=Threshold(quantity=quantity, value=value)) if value:
                borders.setdefault(quantity, set()).add(value)
    tests = StateTests(table.features)
    bits = 0.0
    for quantity, its in borders.items():
        values = np.abs(tests.reading(quantity)(table.states.T))
        largest = float(np.max(values, initial=0.0, where=np.isfinite(values)))
        bits += sum(max(math.log2(largest) - math.log2(_power_of_ten(value)), 0.0) for value in its)
    return bits


def _power_of_ten(value: float) -> float:
    """The largest power of ten that a value other than 0, as written, is a multiple of."""
    return float(10.0 ** int(Decimal(repr(value)).normalize().as_tuple().exponent))
