"""Choosing the pruning level, the history, differences and PSA nodes, and the reasons given."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import strategies as some
from algorithm_1 import algorithm_1
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pruned_trees import train
from robot_episodes import run_episode

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.simplest import simplest
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION, History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import OptionError
from rebt_ros.learning import evaluation
from rebt_ros.learning.choice import choose
from rebt_ros.learning.conversion import convert, convert_shown, own_history_choices
from rebt_ros.learning.cross_validation import CrossValidation, folds
from rebt_ros.learning.judged_levels import JudgedLevels, clearly_raised
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.logic.conditions import Difference, WeightedSum
from rebt_ros.simulated_robot.demonstrator import decide
from rebt_ros.simulated_robot.robot import Robot, State
from rebt_ros.simulated_robot.world import furnished_room


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


# --- the level ----------------------------------------------------------------------------------


def judged(
    hits: list[list[list[int]]],
    shown: list[list[int]],
    leaves: list[int] | None = None,
    explanations: list[int] | None = None,
) -> JudgedLevels:
    """Levels by the rows of each action that each one hits in each fold.

    Unless said otherwise, each has a leaf less than the one before, and gets no row wrong.
    """
    levels = len(hits[0])
    leaves = leaves or list(range(levels, 0, -1))
    return JudgedLevels(
        np.arange(levels, dtype=float),
        np.array(hits),
        np.array(shown),
        np.array(leaves),
        np.array(explanations or leaves),
    )


def test_a_rare_action_counts_as_much_as_a_frequent_one() -> None:
    levels = judged([[[90, 0], [80, 10], [85, 4]]], [[90, 10]])
    assert levels.mean_recalls == pytest.approx([0.5, (80 / 90 + 1) / 2, (85 / 90 + 0.4) / 2])
    assert levels.best == 1
    # Agreement says otherwise of the first two.
    assert levels.means == pytest.approx([0.9, 0.9, 0.89])


def test_recall_is_over_the_rows_of_all_folds_and_of_actions_that_were_shown() -> None:
    # The first action stands in one fold only, and the last one in none.
    levels = judged([[[0, 4, 0], [0, 2, 0]], [[3, 1, 0], [6, 5, 0]]], [[0, 4, 0], [6, 6, 0]])
    np.testing.assert_allclose(levels.recalls, [[0.5, 0.5, np.nan], [1.0, 0.7, np.nan]])
    assert levels.mean_recalls == pytest.approx([0.5, 0.85])
    assert levels.scores.tolist() == [[1.0, 0.5], [4 / 12, 11 / 12]]


def test_of_levels_with_the_same_recall_the_largest_tree_is_the_best() -> None:
    levels = judged([[[5, 4], [4, 5], [5, 4], [3, 3]]], [[10, 10]])
    assert levels.best == 0
    # The same shares, added up in another order.
    thirds = judged(
        [[[1, 2], [2, 1]], [[2, 1], [1, 2]], [[1, 0], [1, 0]]], [[3, 3], [3, 3], [1, 3]]
    )
    assert thirds.best == 0


def test_the_best_level_is_chosen_where_every_fold_is_clear_about_it() -> None:
    fold = [[6, 6], [7, 7], [5, 5]]
    levels = judged([fold, fold, fold], [[10, 10]] * 3)
    assert levels.best == levels.chosen == 1


def test_a_larger_tree_that_is_worse_in_a_single_fold_is_clearly_worse() -> None:
    fold = [[8, 8], [8, 8]]
    levels = judged([fold, [[7, 8], [8, 8]], fold, fold], [[10, 10]] * 4)
    assert levels.best == levels.chosen == 1


def test_a_single_fold_is_not_enough_where_leaves_of_a_small_tree_have_few_rows() -> None:
    fold = [[2, 2], [2, 2]]
    hits, shown = [fold, [[1, 2], [2, 2]], fold, fold], [[4, 3]] * 4
    for leaves, explanations, chosen in (
        ([2, 1], [2, 1], 1),
        ([3, 1], [3, 2], 0),
        ([30, 1], [30, 24], 0),
        ([31, 1], [31, 25], 1),
    ):
        levels = judged(hits, shown, leaves, explanations)
        assert (levels.best, levels.chosen) == (1, chosen)
    twice = [*hits[1:], hits[1]]
    assert judged(twice, shown, [3, 1], [3, 2]).chosen == 1


def test_of_trees_that_folds_disagree_about_the_largest_is_chosen() -> None:
    levels = judged([[[6, 6], [8, 8]], [[8, 8], [7, 7]]], [[10, 10]] * 2)
    assert levels.best == 1
    assert levels.chosen == 0


#: Two folds that disagree about which of three levels is the best.
_DISAGREEING = [[[6, 6], [8, 8], [7, 7]], [[8, 8], [7, 7], [6, 6]]]


def test_of_trees_that_folds_disagree_about_one_that_is_clearly_simpler_is_chosen() -> None:
    levels = judged(_DISAGREEING, [[150, 150]] * 2, [30, 4, 3], [30, 15, 15])
    assert levels.best == levels.chosen == 1
    assert levels.largest == 0


@pytest.mark.parametrize("explanations", [[30, 24, 24], [15, 15, 15], [15, 40, 40]])
def test_a_tree_that_is_not_clearly_simpler_is_none_to_prune_for(explanations: list[int]) -> None:
    levels = judged(_DISAGREEING, [[150, 150]] * 2, [30, 4, 3], explanations)
    assert levels.chosen == levels.largest == 0


def test_how_simple_a_tree_is_tells_nothing_where_its_leaves_have_few_rows() -> None:
    levels = judged(_DISAGREEING, [[10, 9]] * 2, [30, 4, 3], [30, 15, 15])
    assert levels.chosen == levels.largest == 0


def test_a_clearly_worse_tree_is_not_chosen_for_being_simpler() -> None:
    fold = [[9, 9], [6, 6]]
    levels = judged([fold, fold], [[150, 150]] * 2, [30, 4], [30, 15])
    assert levels.chosen == levels.largest == 0


#: Two folds that are clear about a tree of 4 leaves, which gives up so many rows of 30 leaves.
_MISTAKES, _STEPS = 15, 22


@pytest.mark.parametrize(
    ("given_up", "rows", "chosen"),
    [(_MISTAKES, 300, 1), (_STEPS, 300, 0), (_STEPS, 898, 0), (_STEPS, 900, 1)],
)
def test_where_leaves_have_few_rows_only_what_looks_like_mistakes_is_given_up(
    given_up: int, rows: int, chosen: int
) -> None:
    fold = [[rows // 8, rows // 8], [rows // 5, rows // 5]]
    levels = judged(
        [fold, fold], [[rows // 4, rows // 4 + rows % 4 // 2]] * 2, [30, 4], [30, 4 + given_up]
    )
    assert levels.shown.sum() == rows
    assert (levels.best, levels.best_without_mistakes, levels.chosen) == (1, chosen, chosen)


def test_frequent_mistakes_take_fewer_leaves_each() -> None:
    fold = [[12, 12], [20, 20]]
    for given_up, chosen in ((15, 1), (21, 1), (24, 0)):
        levels = judged([fold, fold], [[25, 25]] * 2, [30, 3], [30, 3 + given_up])
        assert levels.chosen == chosen


counts = st.integers(0, 20)


@given(st.integers(1, 5), st.integers(1, 6), st.data())
def test_no_tree_smaller_than_the_best_is_chosen_and_none_that_every_fold_speaks_against(
    folds: int, levels: int, data: st.DataObject
) -> None:
    shown = np.full((folds, 3), 20)
    hits = np.array(
        data.draw(
            st.lists(counts, min_size=folds * levels * 3, max_size=folds * levels * 3), label="hits"
        )
    ).reshape(folds, levels, 3)
    sizes = st.lists(counts.map(lambda count: 1 + count), min_size=levels, max_size=levels)
    leaves, explanations = (np.array(data.draw(sizes)) for _ in range(2))
    result = JudgedLevels(np.arange(levels, dtype=float), hits, shown, leaves, explanations)
    recalls = (hits / 20).mean(axis=(0, 2))
    assert result.mean_recalls == pytest.approx(recalls)
    assert recalls[result.best] == pytest.approx(recalls.max())
    assert not (recalls[: result.best] > recalls.max() - 1e-9).any()
    best = result.best_without_mistakes
    assert best == result.best or shown.sum() < 30 * leaves[0]
    assert result.largest <= result.chosen <= best
    sums = hits.sum(axis=2)
    apart = sums[:, best] - sums[:, result.chosen]
    assert result.chosen == best or apart.min() < apart.max()


@given(st.integers(1, 5), st.data())
def test_a_recall_is_clearly_raised_where_the_better_level_would_be_chosen(
    folds: int, data: st.DataObject
) -> None:
    drawn = data.draw(st.lists(counts, min_size=folds * 4, max_size=folds * 4), label="hits")
    hits, shown = np.array(drawn).reshape(folds, 2, 2), np.full((folds, 2), 20)
    both = judged(hits.tolist(), shown.tolist())
    before, after = (judged(hits[:, [place]].tolist(), shown.tolist()) for place in range(2))
    assert clearly_raised(before, after) is (both.chosen == 1)
    assert not (clearly_raised(before, after) and clearly_raised(after, before))
    assert not clearly_raised(before, before)


def test_folds_are_whole_demonstrations_or_stretches_of_the_only_one() -> None:
    single = folds(table([0.0] * 10, ["a"] * 10))
    assert single.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    several = folds(table([0.0] * 6, ["a"] * 6, [0, 0, 1, 1, 1, 2]))
    assert several.tolist() == [0, 0, 1, 1, 1, 2]
    many = folds(table([0.0] * 12, ["a"] * 12, list(range(12))))
    assert many.tolist() == [0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 4, 4]


@settings(max_examples=25, deadline=None)
@given(some.tables(min_rows=20, max_rows=40), st.sampled_from((some.PREVIOUS, some.EVERYTHING)))
def test_levels_are_judged_by_trees_that_were_not_shown_a_fold_after_what_the_demonstrator_did(
    table: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    levels = CrossValidation(table, FitOptions(vocabulary=vocabulary)).levels(
        lambda trained, rows: NOBODY
    )
    alphas = fit(table, FitOptions(vocabulary=vocabulary)).path.alphas
    assert levels.ccp_alphas.tolist() == alphas.tolist()
    middles = np.sqrt(alphas * np.append(alphas[1:], alphas[-1]))
    number = folds(table)
    for place, fold in enumerate(np.unique(number)):
        rows = table.where(number == fold)
        # Each row keeps the previous action that it has in the whole table.
        assert rows.previous.tolist() == table.previous[number == fold].tolist()
        fitted = fit(table.where(number != fold), FitOptions(vocabulary=vocabulary))
        for level, middle in enumerate(middles):
            right = fitted.at(middle).predict(rows) == rows.chosen
            wanted = np.bincount(rows.chosen[right], minlength=len(table.actions))
            assert levels.hits[place, level].tolist() == wanted.tolist()
        assert levels.shown[place].tolist() == np.bincount(rows.chosen, minlength=4).tolist()


@settings(max_examples=25, deadline=None)
@given(some.tables(min_rows=24, max_rows=40), some.vocabularies, st.floats(0.1, 0.5))
def test_rows_that_are_held_out_have_no_say_but_are_in_the_tree_of_all_rows(
    table: DemonstrationTable, vocabulary: Vocabulary, fraction: float
) -> None:
    held_out = table.held_out(fraction)
    shown = table.where(~held_out)
    assume(len(shown) > 1)
    judge = CrossValidation(table, FitOptions(vocabulary=vocabulary), held_out=held_out)
    alone = CrossValidation(shown, FitOptions(vocabulary=vocabulary))
    levels, wanted = judge.teacher_forced(), alone.teacher_forced()
    assert levels.ccp_alphas.tolist() == wanted.ccp_alphas.tolist()
    assert levels.hits.tolist() == wanted.hits.tolist()
    assert levels.shown.tolist() == wanted.shown.tolist()
    assert judge.fitted.at(0.0).tree == alone.fitted.at(0.0).tree
    assert judge.of_all.at(0.0).tree == fit(table, FitOptions(vocabulary=vocabulary)).at(0.0).tree


#: What nothing is chosen by.
NOBODY = np.empty(0, dtype=np.int64)


def test_noise_is_pruned_away() -> None:
    rows = noisy()
    policy = choose(rows, LearnOptions())
    unpruned = sum(1 for _ in policy.fitted.at(0.0).tree.paths())
    assert unpruned > 20
    tree = policy.fitted.at(policy.ccp_alpha).tree
    assert sum(1 for _ in tree.paths()) <= 4
    assert any("pruning levels" in reason for reason in policy.reasons)


def test_a_simpler_tree_is_chosen_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    levels = judged(_DISAGREEING, [[150, 150]] * 2, [30, 4, 3], [30, 15, 15])
    monkeypatch.setattr(CrossValidation, "levels", lambda judge, choices: levels)
    policy = choose(noisy(), LearnOptions(simplest=False, psa=Use.NEVER))
    assert policy.ccp_alpha == levels.ccp_alphas[1]
    told = "more leaves and exceptions to explain the rows (30 instead of 15)."
    assert any(reason.endswith(told) for reason in policy.reasons)


@settings(max_examples=25, deadline=None)
@given(some.tables(min_rows=1, max_rows=40), some.vocabularies)
def test_the_explanation_of_a_level_is_its_leaves_and_the_rows_it_gets_wrong(
    rows: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    fitted = fit(rows, FitOptions(vocabulary=vocabulary))
    trees = [fitted.at(ccp_alpha) for ccp_alpha in fitted.path.alphas.tolist()]
    wrong = [int(np.count_nonzero(one.predict(rows) != rows.chosen)) for one in trees]
    wanted = [one.tree.leaves + its for one, its in zip(trees, wrong, strict=True)]
    assert fitted.explanations.tolist() == wanted
    assert fitted.explanation <= min(wanted)


def test_an_alpha_that_is_asked_for_is_used() -> None:
    assert choose(noisy(), LearnOptions(ccp_alpha=0.0)).ccp_alpha == 0.0


def test_few_rows_are_reproduced_instead_of_pruned() -> None:
    few = table([1.0, 2.0, 3.0, 4.0], ["a", "b", "c", "a"])
    policy = choose(few, LearnOptions())
    assert policy.ccp_alpha == 0.0
    assert policy.levels is None
    assert policy.fitted.vocabulary == FEATURES_ALONE
    assert (policy.fitted.at(0.0).predict(few) == few.chosen).all()
    assert "too few" in policy.reasons[0]


def test_few_rows_tell_that_a_task_needs_memory() -> None:
    # There, and back after a pick.
    few = table(
        [0, 1, 2, 2, 1, 0] * 3,
        ["go", "go", "pick", "back", "back", "back"] * 3,
        [row // 6 for row in range(18)],
    )
    policy = choose(few, LearnOptions())
    assert policy.levels is None
    assert policy.fitted.vocabulary.history is History.PREVIOUS
    assert [reason.split(":")[0] for reason in policy.reasons] == [
        "The previous action is tested",
        "18 rows are too few to choose by",
    ]
    without = choose(few, LearnOptions(history=History.NONE))
    assert without.fitted.vocabulary == FEATURES_ALONE
    assert len(without.reasons) == 1


def test_choosing_is_the_same_every_time() -> None:
    first, second = choose(noisy(), LearnOptions()), choose(noisy(), LearnOptions())
    assert first.ccp_alpha == second.ccp_alpha
    assert first.reasons == second.reasons


def test_a_level_that_is_asked_for_is_used() -> None:
    rows = noisy()
    fitted = choose(rows, LearnOptions()).fitted
    alphas = fitted.path.alphas
    for level in (0, 3, len(alphas) - 1):
        policy = choose(rows, LearnOptions(level=level))
        assert policy.ccp_alpha == alphas[level]
        leaves = policy.fitted.at(policy.ccp_alpha).tree.leaves
        assert leaves == policy.fitted.path.leaf_counts()[level]
    with pytest.raises(OptionError, match=f"no pruning level {len(alphas)}: the last one is"):
        choose(rows, LearnOptions(level=len(alphas)))


def test_a_level_is_one_of_the_simplest_tree_where_that_is_another_one() -> None:
    # Turns where one of two values is low and not both; the third one differs by chance.
    sides = np.tile([(0, 0), (0, 1), (1, 0), (1, 1)], (50, 1)).astype(float)
    by_chance = np.random.default_rng(4).integers(0, 2, 200)
    labels = np.where(sides[:, 0] != sides[:, 1], "turn", "go").tolist()
    rows = replace(
        table(sides[:, 0].tolist(), labels),
        features=(Feature("x"), Feature("y"), Feature("z")),
        states=np.column_stack([sides, by_chance]),
    )
    options = LearnOptions(differences=Use.NEVER, history=History.NONE)
    greedy = choose(rows, replace(options, simplest=False)).fitted
    policy = choose(rows, options)
    assert policy.fitted.leaves < greedy.leaves
    assert any("is the simplest" in reason for reason in policy.reasons)
    for level, leaves in enumerate(policy.fitted.path.leaf_counts().tolist()):
        asked = choose(rows, replace(options, level=level))
        assert asked.fitted.at(asked.ccp_alpha).tree.leaves == leaves


# --- history ------------------------------------------------------------------------------------


def shuttling(demonstrations: int = 3, legs: int = 4, steps: int = 5) -> DemonstrationTable:
    """Samples of driving to and fro between two walls: what to do depends on what was done."""
    places, labels, number = [], [], []
    for one in range(demonstrations):
        place, label = 0.1 * one, "right"
        for _ in range(legs * steps):
            if place > steps:
                label = "left"
            elif place < 0:
                label = "right"
            places.append(place)
            labels.append(label)
            number.append(one)
            place += 1 if label == "right" else -1
    return table(places, labels, number)


def by_hand(rows: DemonstrationTable, vocabulary: Vocabulary) -> list[float]:
    """What each fold adds to the mean recall of unpruned trees that live through their fold."""
    number = folds(rows)
    shown = np.bincount(rows.chosen, minlength=len(rows.actions))
    gained = []
    for fold in np.unique(number):
        trained = train(rows.where(number != fold), vocabulary=vocabulary)
        own = rows.where(number == fold)
        chosen = evaluation.own_history_choices(algorithm_1(trained.tree, delta=None), own)
        hits = np.bincount(own.chosen[chosen == own.chosen], minlength=len(rows.actions))
        gained.append(float(np.mean(hits[shown > 0] / shown[shown > 0])))
    return gained


def explanation_by_hand(rows: DemonstrationTable, vocabulary: Vocabulary) -> int:
    """Leaves and wrong rows, of the pruning level where they are fewest or of a better cut."""
    fitted = fit(rows, FitOptions(vocabulary=vocabulary))
    sizes = []
    for ccp_alpha in fitted.path.alphas.tolist():
        trained = fitted.at(ccp_alpha)
        wrong = int(np.sum(trained.predict(rows) != rows.chosen))
        sizes.append(trained.tree.leaves + wrong)
    return min(sizes)


@settings(max_examples=25, deadline=None)
@given(some.tables(min_rows=20, max_rows=50))
def test_history_is_tested_where_it_makes_the_explanation_simpler_or_raises_recall_clearly(
    rows: DemonstrationTable,
) -> None:
    explanation = {}
    gained = {}
    recall = {}
    for vocabulary in (FEATURES_ALONE, some.PREVIOUS):
        gained[vocabulary] = by_hand(rows, vocabulary)
        recall[vocabulary] = sum(gained[vocabulary])
        unpruned = CrossValidation(rows, FitOptions(vocabulary=vocabulary)).unpruned()
        assert unpruned.mean_recalls[0] == pytest.approx(recall[vocabulary])
        explanation[vocabulary] = fit(rows, FitOptions(vocabulary=vocabulary)).explanation
        # Levels of cost-complexity pruning are some of the ways to prune.
        assert explanation[vocabulary] <= explanation_by_hand(rows, vocabulary)
    with_it, without = explanation[some.PREVIOUS], explanation[FEATURES_ALONE]
    more = np.subtract(gained[some.PREVIOUS], gained[FEATURES_ALONE])
    error = float(np.std(more, ddof=1) * np.sqrt(len(more)))
    assume(abs(more.sum() - 0.75 * error) > 1e-9)
    clearly = more.sum() > 0.75 * error
    alone, with_previous = (
        simplest(rows, fit(rows, FitOptions(vocabulary=vocabulary)))
        for vocabulary in (FEATURES_ALONE, some.PREVIOUS)
    )
    fewer = (
        with_it == without
        and with_previous.leaves <= alone.leaves
        and with_previous.comparisons < alone.comparisons
    )
    tested = with_it <= 0.875 * without or fewer or (with_it <= without and clearly)
    nodes_alone, nodes_with_previous = (
        nodes.size(convert_shown(one.at(0.0), LearnOptions(), rows, psa=False))
        for one in (alone, with_previous)
    )
    if with_it == without and nodes_alone != nodes_with_previous:
        tested = nodes_with_previous < nodes_alone
    follows = np.count_nonzero(rows.previous != NO_ACTION)
    itself = np.count_nonzero(rows.previous == rows.chosen)
    if rows.row_kind is RowKind.EVENT and itself < 0.1 * follows:
        # Each row is another action than the one before, which explains a lot for nothing.
        halfway = (1 / len(np.unique(rows.chosen)) + recall[some.PREVIOUS]) / 2
        assume(abs(recall[FEATURES_ALONE] - halfway) > 1e-9)
        tested = recall[FEATURES_ALONE] < halfway
    history = choose(rows, LearnOptions(differences=Use.NEVER)).fitted.vocabulary.history
    assert history is (History.PREVIOUS if tested else History.NONE)


def rung_once(waits: int, start: float, goes: int = 12) -> DemonstrationTable:
    """Waits at some place until a bell rings, for one row, and goes from there."""
    states = [(start, 0.0)] * waits + [(start, 1.0)]
    states += [(start + 0.2 * step, 0.0) for step in range(1, goes)]
    return DemonstrationTable(
        channel="action",
        features=(Feature("position"), Feature("ringing", FeatureKind.BINARY)),
        states=np.array(states),
        actions=("go", "wait"),
        chosen=np.array([1] * waits + [0] * goes),
        demonstrations=("0",),
        demonstration=np.zeros(waits + goes, dtype=np.int64),
        stamps=np.arange(waits + goes),
    )


@pytest.mark.parametrize(("waits", "start"), [(9, 3.7), (22, 2.9), (25, 0.3)])
def test_what_was_heard_explains_one_demonstration_better_than_where_it_happened_to_be(
    waits: int, start: float
) -> None:
    rows = rung_once(waits, start)
    for history in (None, History.PREVIOUS):
        policy = choose(rows, LearnOptions(history=history))
        assert policy.fitted.vocabulary.history is History.PREVIOUS
        assert policy.fitted.leaves == 3
        assert policy.fitted.comparisons == 0
    assert "0 comparisons of numbers do instead of 1" in choose(rows, LearnOptions()).reasons[0]


@pytest.mark.parametrize("first", [6, 18])
def test_of_equally_large_explanations_the_one_with_the_smaller_behavior_tree_is_taken(
    first: int,
) -> None:
    policy = choose(robot_runs(first, first + 1, first + 2), LearnOptions())
    assert policy.fitted.vocabulary.history is History.NONE
    said = re.search(r"the behavior tree has (\d+) nodes with it, (\d+)", policy.reasons[0])
    assert said is not None
    assert int(said[1]) > int(said[2])


def robot_runs(*starts: int) -> DemonstrationTable:
    """The simulated robot, driven to its goal by one who needs no memory."""
    states: list[tuple[float, ...]] = []
    labels: list[str] = []
    numbers: list[int] = []

    def driven(number: int, state: tuple[float, ...]) -> str:
        states.append(tuple(map(float, state)))
        labels.append(decide(state))
        numbers.append(number)
        return labels[-1]

    for number, start in enumerate(starts):
        run_episode(Robot(furnished_room(), start), partial(driven, number), 60.0)
    kinds = {"docked": FeatureKind.BINARY}
    features = tuple(Feature(name, kinds.get(name, FeatureKind.NUMERIC)) for name in State._fields)
    plain = table([row[0] for row in states], labels, numbers)
    return replace(plain, features=features, states=np.array(states), row_kind=RowKind.SAMPLE)


def test_one_demonstration_in_which_little_happens_is_not_pruned() -> None:
    policy = choose(shuttling(1, legs=3, steps=16), LearnOptions(history=History.NONE))
    assert policy.levels is not None
    assert policy.levels.chosen > 0
    assert policy.ccp_alpha == 0.0
    assert "actions are begun 3 times does not tell how far to prune" in " ".join(policy.reasons)


def test_several_demonstrations_and_one_in_which_much_happens_tell_how_far_to_prune() -> None:
    for rows in (shuttling(3, legs=3, steps=16), noisy()):
        reasons = " ".join(choose(rows, LearnOptions(history=History.NONE)).reasons)
        assert "pruning levels, ccp_alpha" in reasons


def test_a_task_that_needs_memory_gets_the_previous_action() -> None:
    policy = choose(shuttling(), LearnOptions())
    assert policy.fitted.vocabulary.history is History.PREVIOUS
    assert policy.reasons[0].startswith("The previous action is tested: ")
    assert choose(shuttling(), LearnOptions(history=History.NONE)).fitted.vocabulary.history is (
        History.NONE
    )


def test_a_task_whose_states_alone_tell_nothing_gets_the_previous_action() -> None:
    # A tree of constant states has one leaf, however many rows it gets wrong.
    labels = ["open", "close"] * 40
    policy = choose(table([0.0] * 80, labels, [row // 16 for row in range(80)]), LearnOptions())
    assert policy.fitted.vocabulary.history is History.PREVIOUS
    assert "2 leaves and exceptions" in policy.reasons[0]
    assert "41 without it" in policy.reasons[0]


@pytest.mark.parametrize("kind", RowKind)
@pytest.mark.parametrize("seed", range(3))
def test_events_that_alternate_are_not_explained_by_that(seed: int, kind: RowKind) -> None:
    # Turns between 3 and 6, and an event is sent when that begins and when it is over.
    random = np.random.default_rng(seed)
    numbers = [
        random.uniform(3.2, 5.8) if row % 2 else random.choice([random.uniform(0, 2.8), 8.0])
        for row in range(48)
    ]
    labels = ["go", "turn"] * 24
    shown = table(numbers, labels, [row // 12 for row in range(48)])
    policy = choose(replace(shown, row_kind=kind), LearnOptions())
    needed = History.NONE if kind is RowKind.EVENT else History.PREVIOUS
    assert policy.fitted.vocabulary.history is needed
    if kind is RowKind.EVENT:
        assert "each row is another action than the one before" in policy.reasons[0]


def test_a_task_that_needs_none_does_not_get_it() -> None:
    policy = choose(noisy(), LearnOptions())
    assert policy.fitted.vocabulary.history is History.NONE
    assert policy.reasons[0].startswith("The previous action is not tested: ")


def test_what_demonstrators_do_by_mistake_counts_once_each_in_an_explanation() -> None:
    rows = noisy()
    mistakes = int(
        np.sum((rows.states[:, 0] > 0) != (np.array(rows.actions)[rows.chosen] == "turn"))
    )
    assert fit(rows).leaves > mistakes
    assert fit(rows).explanation <= mistakes + 2


def turning(seed: int, goals: int = 9) -> DemonstrationTable:
    """Turns the shorter way to a bearing in degrees, and goes on for a while; three goals each."""
    random = np.random.default_rng(seed)
    states: list[tuple[float, float]] = []
    labels: list[str] = []
    numbers: list[int] = []
    heading = 0.0
    for goal in range(goals):
        bearing, ahead = random.uniform(0, 360), 16
        while ahead:
            off = (bearing - heading + 180) % 360 - 180
            labels.append("left" if off > 15 else "right" if off < -15 else "go")
            states.append((round(heading, 1), round(bearing, 1)))
            numbers.append(goal // 3)
            heading = (heading + {"left": 12, "right": -12}.get(labels[-1], 0)) % 360
            ahead -= labels[-1] == "go"
    plain = table([row[0] for row in states], labels, numbers)
    features = Feature("heading"), Feature("bearing")
    return replace(plain, features=features, states=np.array(states), row_kind=RowKind.SAMPLE)


@pytest.mark.parametrize("seed", [8, 9, 13])
def test_going_on_is_not_simpler_than_what_a_difference_explains(seed: int) -> None:
    policy = choose(turning(seed), LearnOptions())
    vocabulary = policy.fitted.vocabulary
    assert vocabulary.history is History.NONE
    assert vocabulary.combinations == (Difference("heading", "bearing"),)
    assert "leaves, exceptions and differences of features" in policy.reasons[0]


# --- differences --------------------------------------------------------------------------------


def diagonal(rows: int = 400) -> DemonstrationTable:
    """Turns where the left side is nearer than the right one, in demonstrations of 80 rows."""
    random = np.random.default_rng(3)
    sides = random.uniform(0, 2, size=(rows, 2))
    labels = np.where(sides[:, 0] < sides[:, 1], "turn", "go").tolist()
    plain = table(sides[:, 0].tolist(), labels, [row // 80 for row in range(rows)])
    return replace(plain, features=(Feature("left"), Feature("right")), states=sides)


def sorting(seed: int, demonstrations: int = 3, parts: int = 4) -> DemonstrationTable:
    """Brings parts to the bins of their colors, which stand elsewhere in each demonstration."""
    random = np.random.default_rng(seed)
    states: list[tuple[float, ...]] = []
    labels: list[str] = []
    numbers: list[int] = []

    def row(number: int, label: str, *state: float) -> None:
        states.append(state)
        labels.append(label)
        numbers.append(number)

    for number in range(demonstrations):
        bins = random.permutation(np.arange(1, 7))[:2].tolist()
        for color in random.integers(0, 2, parts).tolist():
            goal = bins[color]
            row(number, "pick", 0, 2, *bins)
            for place in range(goal):
                row(number, "right", place, color, *bins)
            row(number, "drop", goal, color, *bins)
            for place in range(goal, 0, -1):
                row(number, "left", place, 2, *bins)
    features = (
        Feature("place"),
        Feature("held", FeatureKind.CATEGORICAL, ("0", "1", "2")),
        Feature("red_bin"),
        Feature("blue_bin"),
    )
    plain = table([row[0] for row in states], labels, numbers)
    return replace(plain, features=features, states=np.array(states), row_kind=RowKind.SAMPLE)


@pytest.mark.parametrize("seed", [1, 2, 9])
def test_a_difference_that_clearly_raises_recall_is_tested_in_a_tree_of_the_same_size(
    seed: int,
) -> None:
    policy = choose(sorting(seed), LearnOptions())
    assert policy.fitted.vocabulary.combinations
    assert any("Differences of features make a better tree" in one for one in policy.reasons)


@pytest.mark.parametrize("use", [Use.AUTO, Use.ALWAYS])
def test_a_difference_that_makes_a_much_smaller_tree_is_tested(use: Use) -> None:
    policy = choose(diagonal(), LearnOptions(differences=use))
    assert policy.fitted.vocabulary.combinations == (Difference("left", "right"),)
    tree = policy.fitted.at(policy.ccp_alpha).tree
    assert tree.leaves <= 4
    said = any("make a smaller tree" in reason for reason in policy.reasons)
    assert said is (use is Use.AUTO)


def test_differences_are_not_tested_where_that_is_not_wanted() -> None:
    policy = choose(diagonal(), LearnOptions(differences=Use.NEVER, sums=Use.NEVER))
    assert policy.fitted.vocabulary.combinations == ()


def slanted(rows: int = 400) -> DemonstrationTable:
    """Turns where the left side is less than half as far away as the right one."""
    plain = diagonal(rows)
    turns = plain.states[:, 0] < 0.5 * plain.states[:, 1]
    turn, go = plain.actions.index("turn"), plain.actions.index("go")
    return replace(plain, chosen=np.where(turns, turn, go))


@pytest.mark.parametrize("use", [Use.AUTO, Use.ALWAYS])
def test_a_weighted_sum_that_makes_a_simpler_tree_is_tested(use: Use) -> None:
    policy = choose(slanted(), LearnOptions(sums=use))
    (line,) = policy.fitted.vocabulary.combinations
    assert isinstance(line, WeightedSum)
    weights = dict(line.terms)
    assert weights["left"] / weights["right"] == pytest.approx(-2, rel=0.1)
    assert policy.fitted.at(policy.ccp_alpha).tree.leaves <= 6
    said = any("Weighted sums of features make a simpler tree" in one for one in policy.reasons)
    assert said is (use is Use.AUTO)


def test_weighted_sums_are_not_tested_where_that_is_not_wanted() -> None:
    policy = choose(slanted(), LearnOptions(sums=Use.NEVER))
    assert not any(isinstance(one, WeightedSum) for one in policy.fitted.vocabulary.combinations)


def test_a_difference_that_makes_no_smaller_tree_is_not_tested() -> None:
    # A step across the diagonal: the difference tells much, but not all.
    random = np.random.default_rng(5)
    sides = random.uniform(0, 2, size=(400, 2))
    labels = np.where((sides[:, 0] < 1) & (sides[:, 1] > 1), "turn", "go").tolist()
    plain = table(sides[:, 0].tolist(), labels, [row // 80 for row in range(400)])
    rows = replace(plain, features=(Feature("left"), Feature("right")), states=sides)
    policy = choose(rows, LearnOptions())
    assert policy.fitted.vocabulary.combinations == ()
    assert any("Differences of features make no better tree" in one for one in policy.reasons)


# --- PSA nodes ----------------------------------------------------------------------------------


def test_psa_nodes_stand_in_the_tree_where_asked_for_and_not_where_they_do_not_help() -> None:
    random = np.random.default_rng(1)
    numbers = random.normal(size=400)
    either = np.where(random.random(400) < 0.5, "left", "right")
    labels = np.where(numbers > 0, either, "go").tolist()
    ambiguous = table(numbers.tolist(), labels)
    options = LearnOptions(max_depth=1, history=History.NONE)
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
    vocabulary=some.vocabularies,
    psa=st.booleans(),
)
def test_what_a_tree_is_judged_by_is_what_its_behavior_tree_chooses(
    table: DemonstrationTable,
    other: DemonstrationTable,
    options: LearnOptions,
    paper: bool,
    vocabulary: Vocabulary,
    psa: bool,
) -> None:
    options = replace(options, reductions=None) if paper else options
    trained = fit(table, FitOptions(vocabulary=vocabulary, max_depth=options.max_depth)).at(0.01)
    tree = convert(trained, options, psa=psa)
    for rows in (table, other):
        chosen = own_history_choices(trained, rows, options, psa=psa)
        assert chosen.tolist() == evaluation.own_history_choices(tree, rows).tolist()
