"""Grown decision trees: arrays over their nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True, eq=False, slots=True)
class GrownTree:
    """The nodes of a binary tree, each before its children; the root comes first."""

    left: IntArray
    """Child for values up to the threshold, shape (nodes,); -1 at leaves."""
    right: IntArray
    """Child for larger values, shape (nodes,); -1 at leaves."""
    column: IntArray
    """Column that is compared, shape (nodes,); meaningless at leaves."""
    threshold: FloatArray
    """Threshold, shape (nodes,); meaningless at leaves."""
    counts: IntArray
    """Weighted number of training rows of each action, shape (nodes, actions)."""
    risk: FloatArray
    """Impurity times the share of rows, shape (nodes,)."""
    engine: Callable[[Float32Array], IntArray] | None = None
    """A faster equivalent of `apply`; None if there is none."""

    def __len__(self) -> int:
        return len(self.left)

    @property
    def majority(self) -> IntArray:
        """The most frequent action of each node (the first of equals), shape (nodes,)."""
        return np.asarray(np.argmax(self.counts, axis=1))

    def cheapest(
        self, leaf: FloatArray | IntArray, split: FloatArray | IntArray
    ) -> tuple[float, BoolArray]:
        """The cheapest pruned tree; of equals, the one with the fewest leaves.

        Args:
            leaf: Cost of each node as a leaf, shape (nodes,).
            split: Cost of each node as a split, without its children, shape (nodes,).

        Returns:
            The costs, and the nodes that are leaves, or would be if reached, both (nodes,).
        """
        costs, parting = leaf.tolist(), split.tolist()
        left, other = self.left.tolist(), self.right.tolist()
        is_leaf = self.left < 0
        # Children come after their parents.
        for node in range(len(self) - 1, -1, -1):
            if left[node] >= 0:
                parted = parting[node] + costs[left[node]] + costs[other[node]]
                is_leaf[node] = costs[node] <= parted
                costs[node] = min(costs[node], parted)
        return costs[0], is_leaf

    def apply(self, matrix: Float32Array) -> IntArray:
        """The leaf that each row of a matrix reaches, shape (rows,).

        Args:
            matrix: Shape (rows, columns).
        """
        if self.engine is not None:
            return self.engine(matrix)
        node = np.zeros(len(matrix), dtype=np.int64)
        under_way = np.arange(len(matrix)) if self.left[0] >= 0 else np.empty(0, dtype=np.int64)
        while len(under_way):
            at = node[under_way]
            left = matrix[under_way, self.column[at]] <= self.threshold[at]
            node[under_way] = np.where(left, self.left[at], self.right[at])
            under_way = under_way[self.left[node[under_way]] >= 0]
        return node
