"""The simplest tree that explains the rows: the smallest of those that fit equally well.

CART grows a tree greedily.  With few rows, splits that only happen to separate them look as good as
those that the demonstrator goes by.  Trees grown from random choices of the columns fit the same
rows; those with the fewest leaves are the simplest explanations (Occam's razor), and generalize
better.

There are often several of these, which differ in states that nobody showed.  There, all trees that
fit the rows vote, as in a random forest (Breiman, 2001), and of the smallest trees the one that
agrees with the vote most often is taken.  The states to vote on take each feature from one of two
rows.  A split that separates the rows by chance is found by few trees, and loses.  Each comparison
of a number makes a vote count less: one of many possible thresholds is likely to separate rows by
chance, while yes and no leave nothing to choose.

This is for trees that a person could read, with enough rows per leaf.  Large trees approximate
curved borders by many small steps, whose number says nothing.  And many small trees fit a few rows,
most of them by chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.decision_tree.encoding import encode
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.grown import GrownTree
from rebt_ros.decision_tree.training import grow_again
from rebt_ros.demonstration.table import DemonstrationTable

#: Maximum number of leaves and rows for a search.
_MOST_LEAVES, _MOST_ROWS = 30, 5_000
_LEAST_ROWS_PER_LEAF = 2
#: Trees tried for each share of the columns that a split is chosen from: as many as fit this many
#: rows in all, within bounds.
_ROWS_TO_FIT, _LEAST_TRIES, _MOST_TRIES = 100_000, 30, 100
_SHARES = (0.3, 0.6, 0.8)
#: What is left of a vote with each comparison of a number.
_COMPARED = 0.25


def simplest(table: DemonstrationTable, fitted: FittedTree) -> FittedTree:
    """The tree itself, or a simpler one that fits the rows as well.

    Args:
        table: What it was fitted to, without made-up rows.
        fitted: A tree.
    """
    rows, leaves = len(table), fitted.leaves
    if leaves > _MOST_LEAVES or rows > _MOST_ROWS or rows < _LEAST_ROWS_PER_LEAF * leaves:
        return fitted
    tries = min(max(_ROWS_TO_FIT // rows, _LEAST_TRIES), _MOST_TRIES)
    matrix = encode(table, fitted.vocabulary)

    def right(grown: GrownTree) -> int:
        """How many rows the tree predicts."""
        hits = grown.choose(matrix) == table.chosen
        return int(table.counts(hits.astype(np.int64), 2)[1])

    # No tree fits rows that contradict each other.
    least = right(fitted.grown)
    others = grow_again(table, fitted, tries, _SHARES)
    trees = [fitted.grown, *(one for one in others if right(one) >= least)]
    fewest = min(one.leaves for one in trees)
    smallest = [place for place, one in enumerate(trees) if one.leaves == fewest]
    best = smallest[0]
    if len(smallest) > 1:
        unseen = encode(_crossed(table, fitted.random_state), fitted.vocabulary)
        chosen = np.stack([one.choose(unseen) for one in trees])
        comparisons = np.array([fitted.comparisons_of(one) for one in trees])
        voted = _vote(chosen, _COMPARED ** (comparisons - comparisons.min()), len(table.actions))
        best = smallest[int(np.argmax((chosen[smallest] == voted).sum(axis=1)))]
    return fitted if best == 0 else fitted.grown_as(trees[best])


def _vote(chosen: IntArray, weights: FloatArray, actions: int) -> IntArray:
    """What most votes choose in each state, the first of equals, shape (states,).

    Args:
        chosen: Positions of actions, shape (trees, states).
        weights: What the vote of each tree counts, shape (trees,).
        actions: Number of actions.
    """
    votes = np.stack([weights @ (chosen == action) for action in range(actions)])
    return np.asarray(np.argmax(votes, axis=0))


def _crossed(table: DemonstrationTable, random_state: int) -> DemonstrationTable:
    """As many states: each feature, and what was done before, is of the row or of any other."""
    random = np.random.default_rng(random_state)
    shape = table.states.shape

    def taken(size: tuple[int, ...]) -> IntArray:
        """Rows to take values from, by features."""
        own = np.broadcast_to(np.arange(len(table)).reshape(-1, *(1,) * (len(size) - 1)), size)
        return np.where(random.random(size) < 0.5, random.integers(len(table), size=size), own)

    states = np.take_along_axis(table.states, taken(shape), axis=0)
    return replace(table, states=states, previous=table.previous[taken(shape[:1])])
