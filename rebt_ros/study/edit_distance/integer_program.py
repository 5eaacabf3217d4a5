"""The best mapping as an integer program, solved by HiGHS with a bounded number of branches.

x[u, v] = 1
    The image of node u of the small tree is node v of the large one.
y[c, d] = 1
    The image of the edge into c is the edge into d.

The edge into c can have no other image than that into x's image of c, and only one whose parent is
the image of c's parent.  Summed over the children of a parent, the constraints are so tight that
the linear relaxation nearly always has the value of the best mapping, rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linear_sum_assignment, milp
from scipy.sparse import csr_array

from rebt_ros.study.edit_distance.canonical import CanonicalTree, Integers
from rebt_ros.study.edit_distance.pair import Pair

#: What the solver takes for nothing adds up to less.
TOLERANCE = 1e-4
#: Most are solved at the root.
_MOST_BRANCHES = 20
#: Far more than they take, in s; on a stalled machine only do results depend on it.
_LONGEST = 20.0


@dataclass(frozen=True, slots=True)
class Solution:
    """What the solver found."""

    bound: float
    """No mapping scores more, but for rounding; infinite where the solver found no bound."""
    mapping: Integers | None
    """A good mapping, if it found one."""


def solve(pair: Pair, *, whole: bool) -> Solution:
    """Solves the program of two trees of at least two nodes.

    Args:
        pair: The trees.
        whole: Whether nodes and edges have whole images, or may be split between several, which is
            solved several times as fast.
    """
    constraints, most = _constraints(pair)
    edges = constraints.shape[1] - pair.same_label.size
    result = milp(
        -np.concatenate([pair.same_label.ravel(), np.full(edges, 2.0)]),
        constraints=LinearConstraint(constraints, -np.inf, most),
        bounds=Bounds(0, 1),
        integrality=int(whole),
        options={"node_limit": _MOST_BRANCHES, "time_limit": _LONGEST},
    )
    # Of the linear program, which has no branches, the best value is the bound.
    found = result.get("mip_dual_bound") if whole else result.fun
    usable = found is not None and np.isfinite(found) and (whole or result.success)
    bound = -float(found) if usable else np.inf
    if result.x is None:
        return Solution(bound, None)
    images = result.x[: pair.same_label.size].reshape(pair.same_label.shape)
    return Solution(bound, linear_sum_assignment(images, maximize=True)[1])


def _constraints(pair: Pair) -> tuple[csr_array, np.ndarray]:
    """Matrix and upper bounds: columns are x, then y, row by row."""
    small, large = pair.small, pair.large
    x = np.arange(pair.same_label.size).reshape(pair.same_label.shape)
    y = x.size + np.arange((len(small) - 1) * (len(large) - 1)).reshape(len(small) - 1, -1)
    child, image = np.indices(y.shape)
    entries: list[tuple[np.ndarray, np.ndarray, float]] = []
    rows = 0

    def add(of_rows: Any, columns: Any, value: float) -> None:
        entries.append((rows + of_rows.ravel(), columns.ravel(), value))

    # A node has one image at most, and is that of one at most.
    node, other = np.indices(x.shape)
    add(node, x, 1)
    add(len(small) + other, x, 1)
    rows += len(small) + len(large)
    ones = rows
    # The image of an edge ends in the image of its child.
    add(child * y.shape[1] + image, y, 1)
    add(child * y.shape[1] + image, x[1:, 1:], -1)
    rows += y.size
    # It starts in the image of its parent: one edge out of a node at most for each child ...
    groups = _group(large)
    per_child = np.indices((y.shape[0], len(large.inner)))
    add(child * len(large.inner) + groups[image], y, 1)
    add(
        per_child[0] * len(large.inner) + per_child[1],
        x[small.parents[1:][per_child[0]], large.inner[per_child[1]]],
        -1,
    )
    rows += per_child[0].size
    # ... and one edge out of a node at most for each image.
    groups = _group(small)
    per_image = np.indices((len(small.inner), y.shape[1]))
    add(groups[child] * y.shape[1] + image, y, 1)
    add(
        per_image[0] * y.shape[1] + per_image[1],
        x[small.inner[per_image[0]], large.parents[1:][per_image[1]]],
        -1,
    )
    rows += per_image[0].size
    values = np.concatenate([np.full(len(columns), value) for _, columns, value in entries])
    # HiGHS counts in 32 bits, and older versions of scipy do not convert.
    places = tuple(
        np.concatenate([entry[axis] for entry in entries]).astype(np.int32) for axis in (0, 1)
    )
    most = np.zeros(rows)
    most[:ones] = 1
    return csr_array((values, places), shape=(rows, x.size + y.size)), most


def _group(tree: CanonicalTree) -> Integers:
    """The position of each node's parent among the inner nodes, for all nodes but the root."""
    return np.searchsorted(tree.inner, tree.parents[1:])
