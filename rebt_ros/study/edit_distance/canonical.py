"""One form for all trees that differ in the order of children only, with what bounds read of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rebt_ros.study.edit_distance.labelled_tree import LabelledTree

Integers: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class CanonicalTree:
    """A tree in breadth-first order, the children of each node in the order of their codes.

    The children of a node follow each other, so that sums and maxima over them are reductions of
    slices.
    """

    code: str
    """The same for trees that are equal but for the order of children, and for no others."""
    labels: tuple[str, ...] = field(compare=False, repr=False)
    parents: Integers = field(compare=False, repr=False)
    """-1 for the root."""
    inner: Integers = field(compare=False, repr=False)
    """The nodes with children."""
    first_children: Integers = field(compare=False, repr=False)
    """The first child of each of them, less 1: its position among the nodes below the root."""
    families: tuple[int, ...] = field(compare=False, repr=False)
    """How many children each of them has, in descending order."""

    def __len__(self) -> int:
        return len(self.labels)


@lru_cache(maxsize=1 << 14)
def canonical(tree: LabelledTree) -> CanonicalTree:
    """The canonical form of a tree."""
    order, code = _breadth_first(tree)
    place = {node: position for position, node in enumerate(order)}
    parents = [place[tree.parents[node]] for node in order[1:]]
    inner = sorted(set(parents))
    return CanonicalTree(
        code,
        tuple(tree.labels[node] for node in order),
        np.array([-1, *parents], dtype=np.intp),
        np.array(inner, dtype=np.intp),
        np.searchsorted(parents, inner),
        tuple(sorted(Counter(parents).values(), reverse=True)),
    )


def _breadth_first(tree: LabelledTree) -> tuple[tuple[int, ...], str]:
    """The nodes, the children of each in the order of their codes; and the code of the root."""
    children: list[list[int]] = [[] for _ in tree.labels]
    for parent, child in tree.edges:
        children[parent].append(child)
    codes = _codes(tree.labels, children)
    order = [0]
    for node in order:
        order.extend(sorted(children[node], key=codes.__getitem__))
    return tuple(order), codes[0]


def _codes(labels: Sequence[str], children: Sequence[Sequence[int]]) -> list[str]:
    """A text for each subtree.  Labels come with their length: they may hold any character."""
    codes = [""] * len(labels)
    for node in reversed(range(len(labels))):
        below = "".join(sorted(codes[child] for child in children[node]))
        codes[node] = f"{len(labels[node])}:{labels[node]}({below})"
    return codes
