"""States outside what was shown: what is kept of the rows, and what is told from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st
from pruned_trees import train

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.novelty import Departure, NoveltyDetector
from rebt_ros.behavior_tree.shown import (
    MOST_SHOWN_LEAVES,
    ShownChannel,
    ShownLeaf,
    ShownValues,
    Span,
)
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.shown_rows import shown_rows
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.logic.conditions import Difference, WeightedSum

X, Y = Feature("x", topic="state", index=0), Feature("y", topic="state", index=1)
KIND = Feature("kind", FeatureKind.CATEGORICAL, ("3", "7"), topic="state", index=2)
FEATURES = (X, Y, KIND)
VOCABULARIES = st.builds(
    Vocabulary,
    st.sampled_from(History),
    st.sampled_from(((), (Difference("x", "y"), WeightedSum((("x", 2.0), ("y", -0.5)))))),
)
NEAR = ShownLeaf(5, (Span(0.0, 1.0), Span(5.0, 5.0), ("3",)))
FAR = ShownLeaf(5, (Span(3.0, 4.0), Span(5.0, 6.0), ("3", "7")))


def _learned(*leaves: ShownLeaf, features: Sequence[Feature] = FEATURES) -> LearnedTree:
    learned = some.learned(some.action("go"), features)
    return replace(learned, shown=(ShownChannel(some.CHANNEL, leaves),))


def _departure(
    state: Sequence[float], *leaves: ShownLeaf, margin: float = 0.0, **others: Sequence[float]
) -> Departure | None:
    detector = NoveltyDetector(_learned(*(leaves or (NEAR, FAR))), ["state"], "table", margin)
    return detector.departure({"state": state, **others})


@pytest.mark.parametrize(("value", "shown"), [(1.0, True), (0.0, False)])
def test_a_truth_value_on_a_topic_is_the_category_of_that_name(value: float, shown: bool) -> None:
    feature = Feature("docked", FeatureKind.CATEGORICAL, ("False", "True"), topic="state", index=0)
    learned = _learned(ShownLeaf(5, (("True",),)), features=(feature,))
    detector = NoveltyDetector(learned, ["state"], "table", 0.0)
    assert (detector.departure({"state": (value,)}) is None) is shown


@pytest.mark.parametrize(
    "state",
    [(0.0, 5.0, 3.0), (1.0, 5.0, 3.0), (3.5, 5.5, 7.0), (np.float32(1.0), 5.0, 3.0)],
)
def test_a_state_in_the_ranges_of_a_leaf_was_shown(state: Sequence[float]) -> None:
    assert _departure(state) is None


@pytest.mark.parametrize(
    ("state", "departure", "text"),
    [
        ((1.5, 5.0, 3.0), Departure("x", 1.5, Span(0.0, 1.0)), "x is 1.5, 0.5 above the 0 to 1"),
        ((2.9, 5.5, 3.0), Departure("x", 2.9, Span(3.0, 4.0)), "x is 2.9, 0.1 below the 3 to 4"),
        # Each value was shown, but not in the same leaf.
        ((0.5, 5.9, 3.0), Departure("x", 0.5, Span(3.0, 4.0)), "x is 0.5, 2.5 below the 3 to 4"),
        ((0.5, 5.0, 7.0), Departure("x", 0.5, Span(3.0, 4.0)), "x is 0.5"),
        ((3.5, 5.5, 4.0), Departure("kind", 4.0, None), "kind is 4, which was not shown"),
        ((3.5, math.inf, 3.0), Departure("y", math.inf, Span(5.0, 5.0)), "y is inf"),
    ],
)
def test_a_state_outside_differs_in_a_feature_from_the_nearest_leaf(
    state: Sequence[float], departure: Departure, text: str
) -> None:
    found = _departure(state)
    assert found == departure
    assert str(found).startswith(text)


def test_a_departure_says_by_how_much() -> None:
    assert Departure("x", 2.0, Span(0.0, 0.5)).beyond == 1.5
    assert Departure("x", -2.0, Span(0.0, 0.5)).beyond == 2.0
    assert Departure("kind", 4.0, None).beyond == math.inf


def test_the_margin_is_a_share_of_all_that_was_shown_of_the_feature() -> None:
    # x was shown from 0 to 4.
    assert _departure((1.39, 5.0, 3.0), margin=0.1) is None
    assert _departure((1.41, 5.0, 3.0), margin=0.1) is not None
    # Of a value that never changed, a share of the value.
    assert _departure((0.5, 5.4, 3.0), NEAR, margin=0.1) is None
    assert _departure((0.5, 5.6, 3.0), NEAR, margin=0.1) is not None
    # Categories have none.
    assert _departure((3.5, 5.5, 4.0), margin=1000.0) == Departure("kind", 4.0, None)


def test_what_is_not_known_is_not_compared() -> None:
    assert _departure((math.nan, 5.0, 3.0)) is None
    assert _departure((0.5, 5.0, math.nan)) is None
    assert _departure((0.5, 5.0)) is None
    assert _departure(()) is None
    unknown = ShownLeaf(1, (None, Span(0.0, 1.0), None))
    assert _departure((99.0, 0.5, 99.0), unknown) is None
    assert _departure((99.0, 1.5, 99.0), unknown) == Departure("y", 1.5, Span(0.0, 1.0))


def test_features_of_topics_that_are_not_read_and_lagged_ones_are_not_compared() -> None:
    lagged = replace(X, name="x[t-1]", lag=1)
    arm = Feature("arm", topic="arm", index=0)
    leaf = ShownLeaf(1, (Span(0.0, 1.0), None, Span(0.0, 1.0)))
    learned = _learned(leaf, features=(X, lagged, arm))
    latest = {"state": (0.5,), "arm": (9.0,)}
    assert NoveltyDetector(learned, ["state"], "table", 0.0).departure(latest) is None
    departure = NoveltyDetector(learned, ["state", "arm"], "table", 0.0).departure(latest)
    assert departure == Departure("arm", 9.0, Span(0.0, 1.0))


def test_features_of_a_table_are_read_from_the_default_topic() -> None:
    leaf = ShownLeaf(1, (Span(0.0, 1.0), Span(0.0, 1.0)))
    learned = _learned(leaf, features=(Feature("x"), Feature("y")))
    detector = NoveltyDetector(learned, ["table"], "table", 0.0)
    assert detector.departure({"table": (0.5, 2.0)}) == Departure("y", 2.0, Span(0.0, 1.0))


def test_a_state_must_have_been_shown_on_every_channel() -> None:
    learned = replace(
        _learned(), shown=(ShownChannel("arm", (FAR,)), ShownChannel("base", (NEAR, FAR)))
    )
    detector = NoveltyDetector(learned, ["state"], "table", 0.0)
    assert detector.departure({"state": (3.5, 5.5, 3.0)}) is None
    assert detector.departure({"state": (0.5, 5.0, 3.0)}) is not None


def test_nothing_is_novel_where_it_is_not_known_what_was_shown() -> None:
    learned = some.learned(some.action("go"), FEATURES)
    assert NoveltyDetector(learned, ["state"], "t", 0.0).departure({"state": (9.0,) * 3}) is None


@given(
    st.lists(
        st.tuples(
            st.floats(-5, 5, width=32), st.floats(-5, 5, width=32), st.sampled_from([0.0, 1.0])
        ),
        min_size=2,
        max_size=30,
    ),
    st.data(),
)
def test_no_row_that_was_learned_from_is_novel_and_one_beyond_all_rows_is(
    states: list[tuple[float, float, float]], data: st.DataObject
) -> None:
    chosen = data.draw(st.lists(st.integers(0, 3), min_size=len(states), max_size=len(states)))
    table = some.table(states, chosen, features=FEATURES)
    trained = train(table, vocabulary=data.draw(VOCABULARIES))
    shown = shown_rows(table, trained)
    assert sum(leaf.rows for leaf in shown.leaves) == len(table)
    learned = replace(some.learned(some.action("go"), FEATURES), shown=(shown,))
    detector = NoveltyDetector(learned, ["state"], "table", 0.0)
    codes = {0.0: 3.0, 1.0: 7.0}
    for x, y, code in states:
        assert detector.departure({"state": (x, y, codes[code])}) is None
    beyond = max(abs(x) for x, _, _ in states) * 1.1 + 0.1
    departure = detector.departure({"state": (beyond, *states[0][1:2], codes[states[0][2]])})
    assert departure is not None


def test_the_ranges_are_those_of_each_leaf() -> None:
    x = (0.0, 0.2, 0.8, 1.0)
    states = [(value, 5.0, math.nan) for value in x]
    table = some.table(states, [0, 0, 2, 2], features=FEATURES)
    shown = shown_rows(table, train(table))
    spans: list[tuple[ShownValues, ...]] = [leaf.values for leaf in shown.leaves]
    assert spans == [
        (Span(0.0, 0.2), Span(5.0, 5.0), None),
        (Span(0.8, 1.0), Span(5.0, 5.0), None),
    ]
    detector = NoveltyDetector(replace(_learned(), shown=(shown,)), ["state"], "table", margin=0.1)
    # Between the two, nobody showed where one ends and the other begins.
    assert detector.departure({"state": (0.25, 5.0, 3.0)}) is None
    assert detector.departure({"state": (0.5, 5.0, 3.0)}) is not None


def test_a_pruned_tree_has_the_ranges_of_the_leaves_that_are_left() -> None:
    table = some.table([(value, 5.0, 0.0) for value in range(8)], [0, 2] * 4, features=FEATURES)
    assert len(shown_rows(table, train(table)).leaves) == 8
    (leaf,) = shown_rows(table, train(table, ccp_alpha=1.0)).leaves
    assert leaf == ShownLeaf(8, (Span(0.0, 7.0), Span(5.0, 5.0), ("3",)))


def test_a_tree_of_very_many_leaves_keeps_a_bounded_number_of_ranges() -> None:
    rows = 1000
    table = some.table(
        [(value, 5.0, 0.0) for value in range(rows)], [0, 2] * 500, features=FEATURES
    )
    leaves = shown_rows(table, train(table)).leaves
    assert len(leaves) == MOST_SHOWN_LEAVES
    assert {leaf.rows for leaf in leaves} == {4}
    spans = [leaf.values[0] for leaf in leaves]
    assert spans == [Span(first, first + 3.0) for first in range(0, rows, 4)]
    wide = tuple(Feature(f"f{place}", topic="state", index=place) for place in range(500))
    table = some.table([(row,) * 500 for row in range(100)], [0, 2] * 50, features=wide)
    assert len(shown_rows(table, train(table)).leaves) == 20


def test_what_is_learned_says_what_was_shown_of_all_features_but_lagged_ones() -> None:
    states = [(row % 7, 5.0, row % 2) for row in range(60)]
    table = some.table(states, [2 * (row % 7 > 3) for row in range(60)], features=FEATURES)
    learned = learn_from(table, LearnOptions(lags=1)).learned
    (channel,) = learned.shown
    assert channel.channel == some.CHANNEL
    assert sum(leaf.rows for leaf in channel.leaves) == 60
    for leaf in channel.leaves:
        assert leaf.values[1] == Span(5.0, 5.0)
        assert leaf.values[3:] == (None,) * 3


def test_a_tree_that_reads_nothing_finds_nothing_novel() -> None:
    assert NoveltyDetector(_learned(NEAR, FAR), (), "state", 0.1).departure({}) is None
