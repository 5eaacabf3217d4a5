"""Trees grown from some rows of a table, with all its rows counted at their nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rebt_ros.arrays import BoolArray, IntArray, in_parts
from rebt_ros.decision_tree.encoding import encode
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.pruning import pruning_path
from rebt_ros.decision_tree.training import PLAIN, FitOptions, fit_parts
from rebt_ros.demonstration.table import DemonstrationTable


def fit_parts_by_sample(
    table: DemonstrationTable,
    parts: Sequence[BoolArray],
    sample: BoolArray,
    options: FitOptions = PLAIN,
) -> list[FittedTree]:
    """Fits trees as `fit_parts` does, but chooses splits by some of the rows.

    Args:
        table: All rows, which are counted.
        parts: Rows of each part, shape (rows,).
        sample: The rows that choose the splits, shape (rows,), some of each part.
        options: Options of each fit.

    Returns:
        The tree of the table, then those of the parts.
    """
    trees = list(fit_parts(table.where(sample), [part[sample] for part in parts], options))
    return counted(trees, table, [np.ones(len(table), dtype=bool), *parts])


def counted(
    trees: Sequence[FittedTree], table: DemonstrationTable, parts: Sequence[BoolArray]
) -> list[FittedTree]:
    """The same trees, as if grown from other rows: they are pruned by the new counts.

    One pass over the table serves all trees, and never encodes it as a whole.

    Args:
        trees: Trees with the same vocabulary.
        table: All rows, which count by their weights; each row has the LAT of the whole table.
        parts: The rows that count for each tree, shape (rows,); at least one.
    """
    actions = len(table.actions)
    weights = table.row_weights
    counts = [np.zeros(len(tree.grown) * actions, dtype=np.int64) for tree in trees]
    for rows in in_parts(len(table)):
        matrix = encode(table, trees[0].vocabulary, rows)
        for tree, part, count in zip(trees, parts, counts, strict=True):
            inside = part[rows]
            places = tree.grown.apply(matrix) * actions + table.chosen[rows]
            weighed = None if weights is None else weights[rows][inside]
            count += np.bincount(places[inside], weighed, len(count)).astype(np.int64)
    return [
        _with_counts(tree, count.reshape(-1, actions))
        for tree, count in zip(trees, counts, strict=True)
    ]


def _with_counts(tree: FittedTree, leaves: IntArray) -> FittedTree:
    """A tree with other rows at its leaves, and their sums at its splits."""
    counts = tree.path.passed(leaves)
    rows = counts.sum(axis=1)
    # A node that no row reaches costs nothing.
    shares = counts / np.maximum(rows, 1)[:, np.newaxis]
    impurity = 1.0 - np.sum(shares**2, axis=1)
    grown = replace(tree.grown, counts=counts, risk=impurity * rows / rows[0])
    return replace(tree, grown=grown, path=pruning_path(grown))
