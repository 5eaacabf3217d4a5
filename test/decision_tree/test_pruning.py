"""The pruning levels of one fit are the trees that scikit-learn fits for each ccp_alpha."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary, encode
from rebt_ros.decision_tree.grown import GrownTree
from rebt_ros.decision_tree.pruning import pruning_path
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Difference


def noisy_table(seed: int, rows: int, decimals: int = 1) -> DemonstrationTable:
    """Few distinct values, so that there are ties between splits and between links."""
    random = np.random.default_rng(seed)
    states = np.round(random.normal(size=(rows, 4)), decimals)
    chosen = (states[:, 0] > 0) + (states[:, 1] > 0.5) + (random.random(rows) < 0.15)
    return DemonstrationTable(
        channel="action",
        features=tuple(Feature(name) for name in "abcd"),
        states=states,
        actions=("go", "grasp", "turn", "wait"),
        chosen=chosen.astype(np.int64),
        demonstrations=("one",),
        demonstration=np.zeros(rows, dtype=np.int64),
        stamps=np.arange(rows),
    )


tables = st.builds(
    noisy_table, st.integers(0, 10_000), st.integers(2, 150), st.sampled_from((0, 1, 3))
)


vocabularies = st.builds(
    Vocabulary, st.sampled_from(History), st.sampled_from(((), (Difference("a", "b"),)))
)


@settings(max_examples=25, deadline=None)
@given(table=tables, vocabulary=vocabularies, max_depth=st.sampled_from((None, 3)))
def test_every_level_equals_scikit_learns_own_fit_at_its_alpha(
    table: DemonstrationTable, vocabulary: Vocabulary, max_depth: int | None
) -> None:
    fitted = fit(table, FitOptions(vocabulary=vocabulary, max_depth=max_depth))
    matrix = encode(table, vocabulary)
    for ccp_alpha in fitted.path.alphas:
        own = DecisionTreeClassifier(max_depth=max_depth, ccp_alpha=ccp_alpha, random_state=0)
        own.fit(matrix, table.chosen)
        level = fitted.at(ccp_alpha)
        assert sum(1 for _ in level.tree.paths()) == own.get_n_leaves()
        assert (level.predict(table) == own.predict(matrix)).all()


@settings(max_examples=25, deadline=None)
@given(table=tables)
def test_the_levels_are_the_positive_alphas_of_scikit_learns_path(
    table: DemonstrationTable,
) -> None:
    path = DecisionTreeClassifier(random_state=0).cost_complexity_pruning_path(
        encode(table, FEATURES_ALONE), table.chosen
    )
    alphas = fit(table).path.alphas
    assert alphas[0] == 0.0
    assert (np.diff(alphas) > 0).all()
    np.testing.assert_allclose(
        alphas[1:], np.unique(np.maximum.accumulate(path.ccp_alphas)[path.ccp_alphas > 0])
    )


@settings(max_examples=25, deadline=None)
@given(table=tables, other=tables, vocabulary=vocabularies)
def test_hits_of_all_levels_at_once_equal_those_of_each_tree(
    table: DemonstrationTable, other: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    fitted = fit(table, FitOptions(vocabulary=vocabulary))
    # Between the levels as well as on them, and beyond the last one.
    alphas = np.unique(np.concatenate((fitted.path.alphas, fitted.path.alphas * 1.5, [0.7])))
    each = [other.chosen[fitted.at(one).predict(other) == other.chosen] for one in alphas]
    assert fitted.hits(other, alphas).tolist() == [
        np.bincount(right, minlength=len(other.actions)).tolist() for right in each
    ]


def test_the_last_level_is_a_single_leaf_with_the_most_frequent_action() -> None:
    table = noisy_table(1, 100)
    fitted = fit(table)
    last = fitted.at(float(fitted.path.alphas[-1]))
    assert [len(conjunction) for conjunction, _ in last.tree.paths()] == [0]
    assert (last.predict(table) == np.bincount(table.chosen).argmax()).all()


@pytest.mark.parametrize("rows", [1, 2])
def test_a_tree_without_splits_has_one_level(rows: int) -> None:
    table = noisy_table(3, rows)
    same = table.where(table.chosen == table.chosen[0])
    assert fit(same).path.alphas.tolist() == [0.0]


def test_alpha_0_prunes_nothing_not_even_a_split_that_gains_nothing() -> None:
    idle = GrownTree(
        left=np.array([1, -1, -1]),
        right=np.array([2, -1, -1]),
        column=np.array([0, -1, -1]),
        threshold=np.array([0.5, 0.0, 0.0]),
        counts=np.array([[2, 2], [1, 1], [1, 1]]),
        risk=np.array([0.5, 0.25, 0.25]),
    )
    path = pruning_path(idle)
    assert path.leaves_at(0.0).tolist() == [False, True, True]
    assert path.leaves_at(1e-9).tolist() == [True, True, True]
