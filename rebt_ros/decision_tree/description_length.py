"""How many bits it takes to say what was done: a decision tree, and the rows that it gets wrong.

That is the minimum description length principle (Rissanen, 1978; Quinlan and Rivest, 1989, for
decision trees).  Beside the size of an explanation (see `FittedTree.explanation`) it tells cheap
tests from dear ones: a threshold is one of as many as there are rows, a category or a previous
action is nothing but itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rebt_ros.decision_tree.encoding import Number
from rebt_ros.decision_tree.fitted import FittedTree


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
    rows = grown.counts.sum(axis=1)
    actions = max(int(np.count_nonzero(grown.counts[0])), 2)
    exception_bits = math.log2(max(rows[0], 1)) + math.log2(actions - 1)
    exceptions = (rows - grown.counts.max(axis=1)).tolist()
    bits = [1 + math.log2(actions) + wrong * exception_bits for wrong in exceptions]
    threshold_bits = np.log2(np.maximum(rows, 1)).tolist()
    left, right, column = (one.tolist() for one in (grown.left, grown.right, grown.column))
    # Children come after their parents.
    for node in range(len(grown) - 1, -1, -1):
        if left[node] < 0:
            continue
        split = 1 + math.log2(len(fitted.asked)) + bits[left[node]] + bits[right[node]]
        if isinstance(fitted.asked[column[node]], Number):
            split += threshold_bits[node]
        if split < bits[node]:
            bits[node] = split
            exceptions[node] = exceptions[left[node]] + exceptions[right[node]]
    return Description(bits[0], int(exceptions[0]), exception_bits)
