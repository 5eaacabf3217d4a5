"""Upper bounds of the score, and mappings close to the best, from one assignment problem each.

A kept edge scores 2.  The bound splits that between its two ends: a share, between 0 and 2, to the
child's image, and the rest to the parent's.  A node's image then scores its label, its share as a
child, and as a parent the best that its children could have with those of the image, whatever
their own images are.  The best assignment of nodes to images cannot score less than the best
mapping, whatever the shares.  A subgradient method moves the shares to where the bound is lowest:
a Lagrangian relaxation of the integer program in `rebt_ros.study.edit_distance.integer_program`.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from rebt_ros.study.edit_distance.canonical import Integers
from rebt_ros.study.edit_distance.pair import Numbers, Pair

Flags: TypeAlias = NDArray[np.bool_]

#: Whole numbers lie closer to their floating-point sums.
ROUNDING = 1e-6


class Relaxation:
    """The bound of a pair of trees of at least two nodes."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self._inner = np.ix_(pair.small.inner, pair.large.inner)
        # Of each node of the small tree but the root (rows) and of the large one (columns).
        self._shares = np.ones((len(pair.small) - 1, len(pair.large) - 1))
        self._direction = np.zeros(self._shares.shape)
        self.bound = np.inf
        """No mapping scores more."""
        self.mapping: Integers = np.empty(0, dtype=np.intp)
        """The assignment that would."""
        self._rowwise: Flags = np.zeros(pair.same_label.shape, dtype=np.bool_)
        self.assign()

    def assign(self) -> None:
        """Solves the assignment problem."""
        by_rows, by_columns = self._as_parents()
        values = self._pair.same_label.copy()
        values[1:, 1:] += self._shares
        values[self._inner] += np.minimum(by_rows, by_columns)
        nodes, self.mapping = linear_sum_assignment(values, maximize=True)
        self.bound = float(values[nodes, self.mapping].sum())
        self._rowwise[self._inner] = by_rows <= by_columns

    def step(self, best_score: float) -> bool:
        """Moves the shares so that the next assignment may have a lower bound.

        Args:
            best_score: That of the best mapping known; the step is as long as if it were the best.

        Returns:
            Whether there is something to move.
        """
        slope = self._slope()
        before = self._direction
        length = float((before * before).sum())
        # Camerini's rule against zigzags: no direction that turns back from the last one.
        turn = float((slope * before).sum())
        if turn < 0:
            slope = slope - 1.5 * turn / length * before
        steepness = float((slope * slope).sum())
        if steepness < ROUNDING:
            return False
        self._direction = slope
        self._shares = np.clip(self._shares - (self.bound - best_score) / steepness * slope, 0, 2)
        return True

    def _as_parents(self) -> tuple[Numbers, Numbers]:
        """What inner nodes score as parents at most, shape (inner of small, inner of large).

        First where each child has its best image, then where each image has its best child.
        """
        rest = 2 - self._shares
        rows, columns = self._pair.small.first_children, self._pair.large.first_children
        of_children = np.maximum.reduceat(rest, columns, axis=1)
        of_images = np.maximum.reduceat(rest, rows, axis=0)
        return (
            np.add.reduceat(of_children, rows, axis=0),
            np.add.reduceat(of_images, columns, axis=1),
        )

    def _slope(self) -> Numbers:
        """How the bound rises with each share: 1 for images of children, -1 for what parents take.

        Where several images, or children, are equally good, each gets a part.
        """
        mapping = self.mapping
        parents = self._pair.small.parents[1:]
        parent_images = mapping[parents]
        siblings = parent_images[:, None] == self._pair.large.parents[1:]
        rest = np.where(siblings, 2 - self._shares, -1.0)
        best_image = siblings & (rest == rest.max(axis=1, keepdims=True))
        best_child = siblings & (rest == rest.max(axis=0, keepdims=True))
        slope: Numbers = -np.where(
            self._rowwise[parents, parent_images][:, None],
            best_image / np.maximum(best_image.sum(axis=1, keepdims=True), 1),
            best_child / np.maximum(best_child.sum(axis=0, keepdims=True), 1),
        )
        below = np.flatnonzero(mapping[1:])
        slope[below, mapping[1:][below] - 1] += 1
        return slope
