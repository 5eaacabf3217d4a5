"""Tests of the weighted sums that a tree may test."""

from __future__ import annotations

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings

from rebt_ros.arrays import FloatArray
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.decision_tree.weighted_sums import likely_sums
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Difference, WeightedSum

NAMES = ("gap", "speed", "noise")


def shown(
    states: FloatArray,
    chosen: FloatArray,
    features: tuple[Feature, ...] = tuple(map(Feature, NAMES)),
) -> DemonstrationTable:
    return some.table(
        [tuple(row) for row in states.tolist()],
        [int(one) for one in chosen],
        features=features,
    )


def drawn(rows: int = 400, seed: int = 1) -> FloatArray:
    """Of three features that are scaled differently, shape (rows, 3)."""
    return np.random.default_rng(seed).uniform(-1, 1, (rows, 3)) * (1.0, 10.0, 1.0)


def found(table: DemonstrationTable) -> tuple[WeightedSum, ...]:
    options = FitOptions(FEATURES_ALONE)
    return likely_sums(table, fit(table, options), options)


def braking(states: FloatArray) -> FloatArray:
    """Brakes where the gap is too small for the speed."""
    return states[:, 0] - 0.08 * states[:, 1] <= 0.1


def test_the_line_between_two_actions_is_found_by_its_own_features() -> None:
    states = drawn()
    table = shown(states, braking(states))
    (line,) = found(table)
    weights = dict(line.terms)
    assert set(weights) == {"gap", "speed"}
    assert weights["speed"] / weights["gap"] == pytest.approx(-0.08, rel=0.05)
    assert line.terms[0][1] == 1
    with_it = fit(table, FitOptions(Vocabulary(combinations=(line,))))
    assert with_it.leaves <= fit(table).leaves / 3


PLACES = tuple(map(Feature, ("food_x", "food_y", "nest_x", "nest_y", "fox_x", "fox_y", "hungry")))
PAIRS = Vocabulary(
    combinations=(
        Difference("food_x", "food_y"),
        Difference("nest_x", "nest_y"),
        Difference("fox_x", "fox_y"),
    )
)


def along_the_longer_way(states: FloatArray) -> FloatArray:
    """Left, right, down or up: away from a fox that is near, else to the food or to the nest."""
    food, nest, fox, hungry = states[:, :2], states[:, 2:4], states[:, 4:6], states[:, 6:] > 0
    near = np.hypot(*fox.T)[:, np.newaxis] < 0.3
    right, up = np.where(near, -fox, np.where(hungry, food, nest)).T
    return np.where(np.abs(right) > np.abs(up), right > 0, 2 + (up > 0))


@pytest.mark.parametrize("seed", range(3))
def test_who_goes_along_the_longer_way_goes_by_sums_as_well_as_differences(seed: int) -> None:
    states = np.random.default_rng(seed).uniform(-1, 1, (800, 7))
    table = shown(states, along_the_longer_way(states), PLACES)
    options = FitOptions(PAIRS)
    fitted = fit(table, options)
    sums = likely_sums(table, fitted, options)
    plain = [WeightedSum(((f"{one}_x", 1.0), (f"{one}_y", 1.0))) for one in ("food", "nest")]
    assert set(plain) <= set(sums)
    assert fit(table, FitOptions(PAIRS.with_more(sums))).leaves < 0.8 * fitted.leaves


def test_a_plain_sum_that_saves_little_is_none() -> None:
    states = np.random.default_rng(0).uniform(-1, 1, (800, 7))
    right, up = states[:, 0], states[:, 1]
    # Seven rows of the other action, beyond a line.
    chosen = (right > up) | (right + up > np.sort(right + up)[-8])
    table = shown(states, chosen, PLACES)
    options = FitOptions(PAIRS)
    assert likely_sums(table, fit(table, options), options) == ()


@pytest.mark.parametrize("seed", range(4))
def test_round_weights_are_found_to_the_digit_whichever_feature_they_are_said_by(seed: int) -> None:
    scales = (2.0, 1.5, 0.2, 1.0)
    features = tuple(map(Feature, ("x", "v", "angle", "spin")))
    rule = {"x": 0.05, "v": 0.1, "angle": 1.0, "spin": 0.4}
    states = np.random.default_rng(seed).normal(size=(8_000, 4)) * scales
    weighed = states @ np.array([*rule.values()])
    # Who balances is close to the border all the time.
    close = np.abs(weighed) < 0.1
    (line,) = found(shown(states[close], weighed[close] > 0, features))
    weights = dict(line.terms)
    assert {name: weight / weights["angle"] for name, weight in weights.items()} == pytest.approx(
        rule, rel=1e-9
    )


def test_a_line_is_found_where_one_step_in_twenty_is_a_mistake() -> None:
    states = drawn()
    chosen = braking(states) ^ (np.random.default_rng(2).random(len(states)) < 0.05)
    weights = [dict(line.terms) for line in found(shown(states, chosen))]
    assert [set(its) for its in weights] == [{"gap", "speed"}]
    assert weights[0]["speed"] / weights[0]["gap"] == pytest.approx(-0.08, rel=0.3)


def test_lines_of_several_actions_are_found_one_after_the_other() -> None:
    states = drawn(800)
    first = states[:, 0] - 0.08 * states[:, 1] <= 0.1
    second = states[:, 2] + 0.05 * states[:, 1] <= 0
    lines = found(shown(states, np.where(first, 0, np.where(second, 1, 2))))
    assert {frozenset(dict(line.terms)) for line in lines} == {
        frozenset({"gap", "speed"}),
        frozenset({"noise", "speed"}),
    }


@pytest.mark.parametrize(
    "chosen",
    [
        lambda states: states[:, 0] <= 0.1,
        lambda states: (states[:, 0] <= 0.1) & (states[:, 1] > 2),
        lambda states: np.random.default_rng(3).random(len(states)) < 0.3,
        lambda states: np.abs(states[:, 0]) <= 0.3,
        lambda states: np.zeros(len(states)),
    ],
    ids=["one feature", "two features", "by chance", "an interval", "one action"],
)
def test_no_sum_is_offered_where_none_is_weighed(chosen) -> None:
    states = drawn()
    assert found(shown(states, chosen(states))) == ()


def test_places_of_a_grid_are_not_weighed() -> None:
    states = np.round(drawn())
    states[:, 1] = np.round(states[:, 1] / 2)
    assert found(shown(states, states[:, 0] + states[:, 1] <= 1)) == ()


def test_what_is_missing_is_left_out() -> None:
    states = drawn()
    chosen = braking(states)
    states[::7, 1] = np.nan
    (line,) = found(shown(states, chosen))
    assert set(dict(line.terms)) == {"gap", "speed"}


def test_sums_of_the_largest_numbers_are_not_offered() -> None:
    states = drawn()
    chosen = braking(states)
    assert found(shown(states * (9e37, 9e36, 9e37), chosen)) == ()


def test_binary_and_lagged_features_are_not_weighed() -> None:
    states = drawn()
    before = Feature("gap[t-1]", index=0, lag=1)
    features = (Feature("gap"), before, Feature("on", FeatureKind.BINARY))
    states[:, 2] = states[:, 2] > 0
    chosen = states[:, 0] - 0.08 * states[:, 1] <= 0.1
    assert found(shown(states, chosen, features)) == ()


@settings(max_examples=30)
@given(some.tables(min_rows=2, max_rows=30), some.vocabularies)
def test_whatever_was_shown_sums_make_the_description_shorter_or_there_are_none(
    table: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    options = FitOptions(vocabulary)
    sums = likely_sums(table, fit(table, options), options)
    assert len(sums) <= 4
    assert sums == likely_sums(table, fit(table, options), options)
