"""Which differences of two features are offered to a tree."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from pruned_trees import train

from rebt_ros.decision_tree.differences import likely_differences
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.tree import Split
from rebt_ros.demonstration.builder import LARGEST_VALUE
from rebt_ros.demonstration.lags import with_lags
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Difference, Threshold

SIDES = Difference("left", "right")


def table(
    rows: int = 500,
    features: Sequence[Feature] = (Feature("left"), Feature("right"), Feature("battery")),
    scale: Sequence[float] = (1.0, 1.0, 1.0),
    apart: float = 0.0,
) -> DemonstrationTable:
    """Turns where the left side is nearer than the right one, whatever the battery says."""
    states = np.random.default_rng(1).uniform(0, 2, size=(rows, len(features)))
    turns = states[:, 0] < states[:, 1] - apart
    return some.table((states * np.array(scale)).tolist(), (2 * turns).tolist(), features=features)


@pytest.mark.parametrize("vocabulary", [FEATURES_ALONE, some.PREVIOUS])
@pytest.mark.parametrize("apart", [0.0, 0.3])
def test_the_difference_that_decides_is_found(vocabulary: Vocabulary, apart: float) -> None:
    shown = table(apart=apart)
    assert likely_differences(shown, vocabulary) == (SIDES,)
    with_it = train(shown, vocabulary=Vocabulary(vocabulary.history, (SIDES,)))
    assert isinstance(with_it.tree.root, Split)
    assert isinstance(with_it.tree.root.condition, Threshold)
    assert with_it.tree.root.condition.quantity == SIDES
    assert with_it.tree.root.condition.value == pytest.approx(-apart, abs=0.02)
    assert with_it.tree.leaves < train(shown, vocabulary=vocabulary).tree.leaves / 5


def test_missing_values_are_no_obstacle() -> None:
    shown = table()
    shown.states[::7, 0] = math.nan
    shown.states[::11, 1] = math.nan
    assert SIDES in likely_differences(shown, FEATURES_ALONE)


def test_of_a_great_many_rows_some_are_enough() -> None:
    assert likely_differences(table(rows=30_000), FEATURES_ALONE) == (SIDES,)


@pytest.mark.parametrize(("factor", "offered"), [(1.9, True), (2.2, False), (1000.0, False)])
def test_features_of_different_scales_are_not_compared(factor: float, offered: bool) -> None:
    shown = table(scale=(factor, 1.0, 100_000.0))
    # That something decides is not what this is about.
    shown.chosen[:] = 2 * (shown.states[:, 0] < shown.states[:, 1])
    assert (SIDES in likely_differences(shown, FEATURES_ALONE)) is offered


@pytest.mark.parametrize(
    ("units", "offered"),
    [
        ({}, True),
        ({"left": "m", "right": "m"}, True),
        ({"left": "m", "right": "V"}, False),
        # One unit that is known and one that is not are not the same.
        ({"left": "m"}, False),
        ({"battery": "V"}, True),
    ],
)
def test_features_of_different_units_are_not_compared(
    units: Mapping[str, str], offered: bool
) -> None:
    assert (SIDES in likely_differences(table(), FEATURES_ALONE, units)) is offered


def test_only_numbers_of_the_present_are_compared() -> None:
    kinds = (
        Feature("left", FeatureKind.BINARY),
        Feature("right", FeatureKind.CATEGORICAL, ("0", "1")),
        Feature("battery"),
    )
    shown = table(features=kinds)
    shown.states[:, :2] = np.round(shown.states[:, :2] / 2)
    assert likely_differences(shown, FEATURES_ALONE) == ()
    lagged = with_lags(table(), 2)
    names = {feature.name for feature in lagged.features if feature.lag}
    found = likely_differences(lagged, FEATURES_ALONE)
    assert SIDES in found
    assert not names & {name for one in found for name in (one.minuend, one.subtrahend)}


def test_differences_that_would_overflow_are_not_offered() -> None:
    shown = table(scale=(LARGEST_VALUE, LARGEST_VALUE, 1.0))
    assert likely_differences(shown, FEATURES_ALONE) == ()


@pytest.mark.parametrize("features", [(), (Feature("left"),)])
def test_where_there_are_no_two_features_there_is_no_difference(
    features: tuple[Feature, ...],
) -> None:
    shown = some.table([(0.5,) * len(features)] * 4, [0, 2, 0, 2], features=features)
    assert likely_differences(shown, FEATURES_ALONE) == ()


def test_at_most_six_are_offered_in_the_order_of_the_features() -> None:
    width = 8
    features = tuple(Feature(f"x{place}") for place in range(width))
    states = np.random.default_rng(2).uniform(size=(900, width))
    # Every pair of neighbours decides about something.
    above = states[:, :-1] < states[:, 1:]
    chosen = above.sum(axis=1) % 4
    shown = some.table(states.tolist(), chosen.tolist(), features=features)
    found = likely_differences(shown, FEATURES_ALONE)
    assert 0 < len(found) <= 6
    order = [(int(one.minuend[1:]), int(one.subtrahend[1:])) for one in found]
    assert order == sorted(order)
    assert all(first < second for first, second in order)


@settings(max_examples=40)
@given(some.tables(min_rows=2, max_rows=30), some.vocabularies)
def test_whatever_was_shown_the_only_difference_is_offered_or_none(
    shown: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    plain = Vocabulary(vocabulary.history)
    found = likely_differences(shown, plain)
    assert found in ((), (some.DIFFERENCE,))
    assert likely_differences(shown, plain) == found


@pytest.mark.parametrize(
    ("largest", "offered"), [(LARGEST_VALUE / 2, True), (LARGEST_VALUE, False)]
)
def test_a_feature_is_subtracted_only_where_no_difference_can_overflow(
    largest: float, offered: bool
) -> None:
    shown = table()
    # A single row, which does not change how far the rows are spread.
    shown.states[0, 0] = largest
    assert (SIDES in likely_differences(shown, FEATURES_ALONE)) is offered
