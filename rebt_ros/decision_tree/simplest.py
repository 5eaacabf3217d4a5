"""The simplest tree that explains the rows: the smallest of those that fit equally well.

CART grows a tree greedily.  With few rows, splits that only happen to separate them look as good as
those that the demonstrator goes by.  Trees grown from random choices of the columns fit the same
rows; those with the fewest leaves are the simplest explanations (Occam's razor), and generalize
better.  Of several, the one with the fewest comparisons of numbers is taken: one of many possible
thresholds is likely to separate rows by chance, while yes and no leave nothing to choose.  Of
these, it is the one with the longest paths: it separates few rows from the rest at a time, and is
so most like a list of rules by priority, which is what demonstrators have in mind and what behavior
trees are.  If none is simpler, the greedy tree stays.

This is for trees that a person could read, with enough rows per leaf.  Large trees approximate
curved borders by many small steps, whose number says nothing.  And many small trees fit a few rows,
most of them by chance.
"""

from __future__ import annotations

import numpy as np

from rebt_ros.decision_tree.encoding import Number
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import fit_again
from rebt_ros.demonstration.table import DemonstrationTable

#: Maximum number of leaves and rows for a search.
_MOST_LEAVES, _MOST_ROWS = 30, 5_000
_LEAST_ROWS_PER_LEAF = 2
#: Trees tried for each share of the columns that a split is chosen from.
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
    if leaves <= 2 and (
        not fitted.comparisons or all(isinstance(one, Number) for one in fitted.asked)
    ):
        # None can be simpler.
        return fitted
    # Of few columns, several shares are the same number.
    numbers = dict.fromkeys(max(1, int(share * len(fitted.asked))) for share in _SHARES)
    right = fitted.right(table)
    best, rank = fitted, (fitted.leaves, fitted.comparisons, -np.inf)
    for number in range(_TRIES):
        for among in numbers:
            other = fit_again(table, fitted, number, among)
            # No tree fits rows that contradict each other.
            if other.leaves <= best.leaves and other.right(table) >= right:
                its = _rank(table, other)
                if its < rank:
                    best, rank = other, its
    return best


def _rank(table: DemonstrationTable, fitted: FittedTree) -> tuple[int, int, float]:
    """Lower means simpler."""
    lengths, weights = fitted.path_lengths(table), table.row_weights
    return fitted.leaves, fitted.comparisons, -float(np.average(lengths, weights=weights))
