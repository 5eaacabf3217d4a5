"""How many bits it takes to say what was done: a decision tree, and the rows that it gets wrong.

That is the minimum description length principle (Rissanen, 1978; Quinlan and Rivest, 1989, for
decision trees).  Beside the size of an explanation (see `FittedTree.explanation`) it tells cheap
tests from dear ones: a threshold is one of as many as there are rows, a category or a previous
action is nothing but itself.
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
    """The shortest description of the rows that a tree was fitted to, of all ways to prune it."""

    bits: float
    """Of the tree and its exceptions."""
    exceptions: int
    """Rows that the tree gets wrong."""
    exception_bits: float
    """What each of them takes."""


def shortest_description(fitted: FittedTree) -> Description:
    """Describes the rows by a tree as pruned best for that.

    Each node takes one bit that says whether it is a leaf.  A leaf names its action, an exception
    its row and another action.  A split names its column; one that compares a number, also one of
    the rows of its node, whose value is the threshold.
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
    """What it takes to say the numbers that a tree compares with.

    Each is one of the multiples of its power of ten up to the largest absolute value in a table, as
    10 of 0 and 10, and 9.3 of more than a hundred.  Beside the size of a tree that tells borders
    that a person has in mind from such as only part the rows.

    Args:
        tree: With thresholds that are as round as they can be.
        table: The rows that it parts.
    """
    borders: dict[Quantity, set[float]] = {}
    for node in tree.walk():
        match node:
            # Whatever the largest value is, 0 is the only multiple that is needed.
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
    """The largest power of ten that a value other than 0 is a multiple of, as it is written."""
    return float(10.0 ** int(Decimal(repr(value)).normalize().as_tuple().exponent))
