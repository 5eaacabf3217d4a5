"""The simplest tree that explains the rows: of those that fit them equally well, the smallest.

CART grows a tree greedily, and where rows are few, splits that only happen to part them are as good
to it as the ones that the demonstrator goes by.  Trees that are grown from random choices of the
columns fit the same rows; those with the fewest leaves are the simplest explanations (Occam's
razor), and generalize better.  Of several, the one with the fewest comparisons of numbers is taken:
a threshold is one of many that could have been tried until rows are parted by chance, where yes and
no leave nothing to choose.  Of those it is the one with the longest paths: it parts few rows from
the rest at a time, and so is most like a list of rules by priority, as demonstrators have in mind
and as behavior trees are.  Where none is simpler, the greedy tree stays.

This is for trees that a person could read, with rows enough for each leaf.  Large trees stand for
curved borders by many small steps, whose number says nothing; and few rows are fitted by many small
trees, most of them by chance.
"""

from __future__ import annotations

import numpy as np

from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import fit_again
from rebt_ros.demonstration.table import DemonstrationTable

#: Leaves and rows up to which there is a search.
_MOST_LEAVES, _MOST_ROWS = 30, 5_000
_LEAST_ROWS_PER_LEAF = 5
#: Trees that are tried for each share of the columns from which a split is chosen.
_TRIES, _SHARES = 30, (0.3, 0.6, 0.8)


def simplest(table: DemonstrationTable, fitted: FittedTree) -> FittedTree:
    """The tree itself, or a simpler one that fits the rows as well.

    Args:
        table: What it was fitted to, without made-up rows.
        fitted: A tree.
    """
    rows, leaves = len(table), fitted.leaves
    if leaves > _MOST_LEAVES or rows > _MOST_ROWS or rows < _LEAST_ROWS_PER_LEAF * leaves:
        return fitted
    right = fitted.right(table)
    best, rank = fitted, (fitted.leaves, fitted.comparisons, -np.inf)
    for number in range(_TRIES):
        for share in _SHARES:
            other = fit_again(table, fitted, number, share)
            # Where rows contradict each other, no tree fits them all.
            if other.leaves <= best.leaves and other.right(table) >= right:
                its = _rank(table, other)
                if its < rank:
                    best, rank = other, its
    return best


def _rank(table: DemonstrationTable, fitted: FittedTree) -> tuple[int, int, float]:
    """The lower, the simpler."""
    lengths, weights = fitted.path_lengths(table), table.row_weights
    return fitted.leaves, fitted.comparisons, -float(np.average(lengths, weights=weights))
