"""Choosing the pruning level, LAT and PSA nodes, and the reasons that are given for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros import evaluation
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.choosing import choose, convert, own_history_choices
from rebt_ros.decision_tree.training import fit
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.options import LearnOptions, Use
from rebt_ros.selection import JudgedLevels, folds


def table(
    states: list[float], actions: list[str], demonstrations: list[int] | None = None
) -> DemonstrationTable:
    labels = tuple(sorted(set(actions)))
    numbers = np.array(demonstrations or [0] * len(actions))
    return DemonstrationTable(
        channel="action",
        features=(Feature("x"),),
        states=np.array(states)[:, np.newaxis],
        actions=labels,
        chosen=np.array([labels.index(action) for action in actions]),
        demonstrations=tuple(map(str, range(max(numbers) + 1))),
        demonstration=numbers,
        stamps=np.arange(len(actions)),
    )


def noisy(rows: int = 400) -> DemonstrationTable:
    """Turns where x is positive, goes elsewhere, and errs in every tenth row."""
    random = np.random.default_rng(0)
    numbers = random.normal(size=rows)
    turns = (numbers > 0) ^ (random.random(rows) < 0.1)
    return table(numbers.tolist(), ["turn" if one else "go" for one in turns])


def judged(scores: list[list[float]]) -> JudgedLevels:
    return JudgedLevels(np.arange(len(scores[0]), dtype=float), np.array(scores))


def test_the_smallest_tree_within_one_standard_error_of_the_best_is_chosen() -> None:
    # Means 0.9, 0.92, 0.9 and 0.5; the best has a standard error of 0.02.
    levels = judged([[0.9, 0.94, 0.9, 0.5], [0.9, 0.9, 0.91, 0.5]])
    assert levels.best == 1
    assert levels.standard_errors[1] == pytest.approx(0.02)
    assert levels.chosen == 2


def test_a_level_further_than_one_standard_error_is_not_chosen() -> None:
    assert judged([[0.9, 0.93, 0.8, 0.5], [0.9, 0.92, 0.8, 0.5]]).chosen == 1


def test_one_action_for_everything_is_chosen_only_where_it_is_best() -> None:
    assert judged([[0.5, 0.6, 0.55], [0.7, 0.6, 0.62]]).chosen == 1
    assert judged([[0.5, 0.6, 0.7], [0.5, 0.6, 0.7]]).chosen == 2


def test_folds_are_whole_demonstrations_or_stretches_of_the_only_one() -> None:
    single = folds(table([0.0] * 10, ["a"] * 10))
    assert single.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    several = folds(table([0.0] * 6, ["a"] * 6, [0, 0, 1, 1, 1, 2]))
    assert several.tolist() == [0, 0, 1, 1, 1, 2]
    many = folds(table([0.0] * 12, ["a"] * 12, list(range(12))))
    assert many.tolist() == [0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 4, 4]


def test_noise_is_pruned_away() -> None:
    rows = noisy()
    policy = choose(rows, LearnOptions())
    unpruned = sum(1 for _ in policy.fitted.at(0.0).tree.paths())
    assert unpruned > 20
    tree = policy.fitted.at(policy.ccp_alpha).tree
    assert sum(1 for _ in tree.paths()) <= 4
    assert any("pruning levels" in reason for reason in policy.reasons)


def test_an_alpha_that_is_asked_for_is_used() -> None:
    assert choose(noisy(), LearnOptions(ccp_alpha=0.0)).ccp_alpha == 0.0


def test_few_rows_are_reproduced_instead_of_pruned() -> None:
    few = table([1.0, 2.0, 3.0, 4.0], ["a", "b", "c", "a"])
    policy = choose(few, LearnOptions())
    assert policy.ccp_alpha == 0.0
    assert policy.levels is None
    assert (policy.fitted.at(0.0).predict(few) == few.chosen).all()
    assert "too few" in policy.reasons[0]


def test_choosing_is_the_same_every_time() -> None:
    first, second = choose(noisy(), LearnOptions()), choose(noisy(), LearnOptions())
    assert first.ccp_alpha == second.ccp_alpha
    assert first.reasons == second.reasons


def test_psa_nodes_stand_in_the_tree_where_asked_for_and_not_where_they_do_not_help() -> None:
    random = np.random.default_rng(1)
    numbers = random.normal(size=400)
    either = np.where(random.random(400) < 0.5, "left", "right")
    labels = np.where(numbers > 0, either, "go").tolist()
    ambiguous = table(numbers.tolist(), labels)
    options = LearnOptions(max_depth=1, last_action=Use.NEVER)
    auto = choose(ambiguous, options)
    assert not auto.psa
    assert "PSA nodes do not raise agreement" in auto.reasons[-1]
    always = choose(ambiguous, replace(options, psa=Use.ALWAYS))
    tree = convert(always.fitted.at(0.0), options, psa=always.psa)
    assert any(isinstance(one, nodes.ParallelSelector) for one in nodes.walk(tree))
    plain = convert(always.fitted.at(0.0), options, psa=False)
    assert not any(isinstance(one, nodes.ParallelSelector) for one in nodes.walk(plain))


@settings(max_examples=40, deadline=None)
@given(
    table=some.tables(max_rows=40),
    other=some.tables(max_rows=20),
    options=st.builds(
        LearnOptions,
        delta=st.sampled_from((0.0, 0.3, 0.6, 1.0)),
        max_depth=st.sampled_from((1, 2, None)),
        root=st.sampled_from((Root.SELECTOR, Root.PARALLEL)),
    ),
    paper=st.booleans(),
    last_action=st.booleans(),
    psa=st.booleans(),
)
def test_what_a_tree_is_judged_by_is_what_its_behavior_tree_chooses(
    table: DemonstrationTable,
    other: DemonstrationTable,
    options: LearnOptions,
    paper: bool,
    last_action: bool,
    psa: bool,
) -> None:
    options = replace(options, reductions=None) if paper else options
    trained = fit(table, last_action=last_action, max_depth=options.max_depth).at(0.01)
    tree = convert(trained, options, psa=psa)
    for rows in (table, other):
        chosen = own_history_choices(trained, rows, options, psa=psa)
        assert chosen.tolist() == evaluation.own_history_choices(tree, rows).tolist()
