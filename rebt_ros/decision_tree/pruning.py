"""Minimal cost-complexity pruning (Breiman et al., 1984): all levels of one fitted tree.

pruning level
    One tree of the nested sequence of weakest-link pruning, from the fitted tree to its root alone.

scikit-learn fits such a tree again for each ``ccp_alpha``.  The levels of one fitted tree are the
same trees, found in one pass.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.decision_tree.grown import GrownTree

#: Parent of the root, and child of a leaf.
_NONE = -1


@dataclass(frozen=True, eq=False, slots=True)
class PruningPath:
    """The ``ccp_alpha`` at which each split of a fitted tree is pruned."""

    alphas: FloatArray
    """The ``ccp_alpha`` of each level, ascending; the first is 0 and prunes nothing."""
    collapse: FloatArray
    """The smallest ``ccp_alpha`` at which a node is a leaf, shape (nodes,); -inf for leaves of the
    fitted tree.  It rises from each node to its parent."""
    parents: IntArray
    """Parent of each node, -1 for the root, shape (nodes,)."""

    def __len__(self) -> int:
        return len(self.alphas)

    @property
    def middles(self) -> FloatArray:
        """Geometric mean of each ``ccp_alpha`` and the next one; the last one as it is."""
        following = np.append(self.alphas[1:], self.alphas[-1])
        return np.asarray(np.sqrt(self.alphas * following))

    def middle(self, ccp_alpha: float) -> float:
        """The middle of the range of the level that a ``ccp_alpha`` belongs to."""
        level = np.searchsorted(self.alphas, ccp_alpha, side="right") - 1
        return float(self.middles[level])

    def leaves_at(self, ccp_alpha: float) -> BoolArray:
        """Which nodes are leaves, or below a leaf, at this level, shape (nodes,)."""
        # As in scikit-learn, 0 prunes nothing, not even at no cost.
        return np.less_equal(self.collapse, ccp_alpha if ccp_alpha > 0 else -np.inf)

    def leaf_counts(self) -> IntArray:
        """Leaves of the tree at each level, shape (levels,)."""
        return self.sums(np.ones(len(self.collapse), dtype=np.int64))

    def sums(self, of_nodes: IntArray) -> IntArray:
        """The sum over the leaves of the tree at each level, shape (levels,).

        Args:
            of_nodes: What each node adds as a leaf, shape (nodes,).
        """
        first, end = self.levels_decided(self.alphas)
        change = np.zeros(len(self) + 1, dtype=np.int64)
        np.add.at(change, first, of_nodes)
        np.add.at(change, end, -of_nodes)
        return np.cumsum(change)[:-1]

    def levels_decided(self, ccp_alphas: FloatArray) -> tuple[IntArray, IntArray]:
        """The first level at which each node is a leaf, and the first at which it is cut off.

        Args:
            ccp_alphas: The levels, ascending, shape (levels,).

        Returns:
            Positions of levels, or their number if there is none, both of shape (nodes,).
        """
        # 0 prunes nothing, not even at no cost.
        levels = np.where(ccp_alphas > 0, ccp_alphas, -np.inf)
        first = np.searchsorted(levels, self.collapse, side="left")
        return first, np.where(self.parents < 0, len(levels), first[self.parents])

    def passed(self, reached: IntArray) -> IntArray:
        """Rows that pass through each node, given those that end at it, shape (nodes, actions)."""
        passed = reached.copy()
        # Rows that reach a node reach its parent; parents come before their children.
        for node in range(len(passed) - 1, 0, -1):
            passed[self.parents[node]] += passed[node]
        return passed

    def standing(self, is_leaf: BoolArray) -> IntArray:
        """Each node, or the topmost of the given leaves above it, shape (nodes,)."""
        standing = np.arange(len(is_leaf))
        # Parents come before their children.
        for node in range(1, len(is_leaf)):
            above = standing[self.parents[node]]
            if is_leaf[above]:
                standing[node] = above
        return standing


def pruning_path(grown: GrownTree) -> PruningPath:
    """Prunes the weakest link repeatedly, as scikit-learn does, and notes each ``ccp_alpha``.

    The weakness of a link is the effective alpha of its node t: how much the impurity of t alone
    exceeds that of its branch, per leaf saved by pruning.  Takes O(n · depth · log n) steps for n
    nodes.
    """
    parents = _parents(grown.left, grown.right)
    is_leaf = grown.left == _NONE
    collapse = np.where(is_leaf, -np.inf, np.inf)
    for node, alpha in _Links(grown, parents).weakest_first():
        collapse[node] = alpha
    pruned_at = np.unique(collapse[~is_leaf])
    alphas = np.concatenate(([0.0], pruned_at[pruned_at > 0]))
    return PruningPath(alphas, collapse, parents)


class _Links:
    """The remaining splits while links are pruned.

    Its data are lists: reading and changing single numbers is much faster there than in arrays.
    """

    def __init__(self, grown: GrownTree, parents: IntArray) -> None:
        self._parents: list[int] = parents.tolist()
        self._below: list[tuple[int, int]] = list(
            zip(grown.left.tolist(), grown.right.tolist(), strict=True)
        )
        self._risk: list[float] = grown.risk.tolist()
        self._is_split: list[bool] = (grown.left != _NONE).tolist()
        self._branch_risk = [0.0] * len(grown)
        self._leaves = [0] * len(grown)
        for leaf in np.flatnonzero(grown.left == _NONE).tolist():
            for node in self._up_from(leaf):
                self._branch_risk[node] += self._risk[leaf]
                self._leaves[node] += 1

    def weakest_first(self) -> Iterator[tuple[int, float]]:
        """Each split, and the ``ccp_alpha`` at which it is pruned, which never falls."""
        newest = {
            node: self._alpha(node) for node, is_split in enumerate(self._is_split) if is_split
        }
        weakest = [(alpha, node) for node, alpha in newest.items()]
        heapq.heapify(weakest)
        reached = 0.0
        while weakest:
            alpha, node = heapq.heappop(weakest)
            if newest.get(node) != alpha:
                continue
            # Rounding can make a later link slightly weaker than an earlier one, or than 0.
            reached = max(reached, alpha)
            for below in self._cut(node):
                del newest[below]
                yield below, reached
            saved_risk = self._risk[node] - self._branch_risk[node]
            saved_leaves = self._leaves[node] - 1
            for above in self._up_from(node):
                self._branch_risk[above] += saved_risk
                self._leaves[above] -= saved_leaves
                if above != node:
                    newest[above] = self._alpha(above)
                    heapq.heappush(weakest, (newest[above], above))

    def _alpha(self, node: int) -> float:
        """The effective alpha of a split."""
        return (self._risk[node] - self._branch_risk[node]) / (self._leaves[node] - 1)

    def _cut(self, node: int) -> list[int]:
        """Turns a split into a leaf; yields it and the splits below it, which are gone."""
        found, waiting = [], [node]
        while waiting:
            one = waiting.pop()
            if self._is_split[one]:
                self._is_split[one] = False
                found.append(one)
                waiting += self._below[one]
        return found

    def _up_from(self, node: int) -> Iterator[int]:
        """The node, its parent and so on up to the root."""
        while node != _NONE:
            yield node
            node = self._parents[node]


def _parents(left: IntArray, right: IntArray) -> IntArray:
    parents = np.full(len(left), _NONE, dtype=np.int64)
    splits = np.flatnonzero(left != _NONE)
    parents[left[splits]] = splits
    parents[right[splits]] = splits
    return parents
