"""Trees grown from some rows, with the rows of a whole table counted at their nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_pruning import noisy_table

from rebt_ros import arrays
from rebt_ros.arrays import FloatArray
from rebt_ros.decision_tree.counting import counted, fit_parts_by_sample
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import FitOptions, fit, fit_parts
from rebt_ros.demonstration.last_action import History

VOCABULARIES = (FEATURES_ALONE, Vocabulary(History.PREVIOUS), Vocabulary(History.LAST))


@given(st.integers(0, 10_000), st.integers(2, 120), st.sampled_from(VOCABULARIES))
def test_counting_the_rows_that_a_tree_was_grown_from_changes_nothing(
    seed: int, rows: int, vocabulary: Vocabulary
) -> None:
    table = noisy_table(seed, rows)
    fitted = fit(table, FitOptions(vocabulary))
    (again,) = counted([fitted], table, [np.ones(rows, dtype=bool)])
    assert again.grown.counts.tolist() == fitted.grown.counts.tolist()
    np.testing.assert_allclose(again.grown.risk, fitted.grown.risk, atol=1e-12)
    np.testing.assert_allclose(_levels(again), _levels(fitted), atol=1e-9)


def _levels(fitted: FittedTree) -> FloatArray:
    """The levels' ``ccp_alpha``; those that differ in the last bits only are one."""
    alphas = fitted.path.alphas
    return np.asarray(alphas[np.diff(alphas, prepend=-1.0) > 1e-9])


@given(st.integers(0, 10_000), st.integers(1, 40), st.sampled_from(VOCABULARIES))
def test_all_rows_of_each_part_are_counted_where_they_end(
    seed: int, grown: int, vocabulary: Vocabulary
) -> None:
    rows = 100
    table = noisy_table(seed, rows)
    part, sample = np.arange(rows) % 3 > 0, np.arange(rows) < grown + 2
    trees = fit_parts_by_sample(table, [part], sample, FitOptions(vocabulary))
    structure = list(fit_parts(table.where(sample), [part[sample]], FitOptions(vocabulary)))
    for fitted, other, inside in zip(
        trees, structure, (np.ones(rows, dtype=bool), part), strict=True
    ):
        for name in ("left", "right", "column", "threshold"):
            assert getattr(fitted.grown, name).tolist() == getattr(other.grown, name).tolist()
        leaves = fitted.at(0.0).leaves(table)
        for leaf in np.flatnonzero(fitted.grown.left < 0):
            here = table.chosen[inside & (leaves == leaf)]
            assert fitted.grown.counts[leaf].tolist() == np.bincount(here, minlength=4).tolist()
        assert fitted.grown.counts[0].sum() == inside.sum()
        # A tree of one leaf errs in all rows that are not of the most frequent action.
        root = fitted.at(float("inf"))
        right = np.count_nonzero(root.predict(table)[inside] == table.chosen[inside])
        assert right == np.bincount(table.chosen[inside]).max()


@given(st.integers(0, 10_000), st.lists(st.integers(1, 5), min_size=1, max_size=6))
def test_rows_count_by_the_weights_of_their_demonstrations(seed: int, weights: list[int]) -> None:
    table = noisy_table(seed, 60)
    weighted = replace(
        table,
        demonstrations=tuple(map(str, range(len(weights)))),
        demonstration=np.arange(60) * len(weights) // 60,
        weights=np.array(weights),
        previous=None,
    )
    fitted = fit(weighted)
    (again,) = counted([fitted], weighted, [np.ones(60, dtype=bool)])
    assert again.grown.counts.tolist() == fitted.grown.counts.tolist()
    np.testing.assert_allclose(again.grown.risk, fitted.grown.risk, atol=1e-12)


def test_rows_are_encoded_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    table = noisy_table(0, 100)
    everything = [np.ones(100, dtype=bool)]
    fitted = fit(table.where(np.arange(100) < 50))
    (whole,) = counted([fitted], table, everything)
    monkeypatch.setattr(arrays, "_ROWS_AT_A_TIME", 7)
    (in_parts,) = counted([fitted], table, everything)
    assert in_parts.grown.counts.tolist() == whole.grown.counts.tolist()
