"""Lagged features: the same in tables, in running trees, in documents and in replays."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import StateEncoder, TreeRuntime
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.lags import evenly_spaced, with_lags
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.schema import LARGEST_LAG, Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.errors import InputError, OptionError
from rebt_ros.learning import evaluation
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn, learn_channels
from rebt_ros.learning.replaying import replay
from rebt_ros.logic.conditions import Condition, HasCategory, IsTrue, Literal, Threshold
from rebt_ros.offline import learning_from_files as offline
from rebt_ros.offline.replay_over_files import replay as replay_files

#: As `some.FEATURES`, but every value can come from a topic.
FEATURES = (*some.FEATURES[:3], replace(some.FEATURES[3], categories=("0", "1", "2")))


def echoing(name: str, rows: int, seed: int, topic: str | None = None) -> Demonstration:
    """What is done tells what x was one row before, and nothing else does."""
    x = np.random.default_rng(seed).uniform(size=rows)
    labels = ["high", *("low" if before <= 0.5 else "high" for before in x[:-1])]
    shown = [
        Row(time, "action", label, None, (0.25, float(value)))
        for time, (value, label) in enumerate(zip(x, labels, strict=True))
    ]
    index = (None, None) if topic is None else (4, 2)
    features = tuple(
        Feature(called, topic=topic, index=at) for called, at in zip("yx", index, strict=True)
    )
    return Demonstration.from_rows(name, features, shown)


# --- tables -----------------------------------------------------------------------------------


@given(some.tables(max_rows=12), st.integers(0, 5))
def test_a_lagged_feature_is_what_its_source_was_so_many_rows_before(
    table: DemonstrationTable, lags: int
) -> None:
    lagged = with_lags(table, lags)
    width = len(table.features)
    assert lagged.features[:width] == table.features
    assert lagged.states.shape == (len(table), width * (lags + 1))
    np.testing.assert_array_equal(lagged.states[:, :width], table.states)
    for place, feature in enumerate(lagged.features[width:], start=width):
        source = table.features[place % width]
        assert feature.index is not None
        assert source == table.features[feature.index]
        assert (feature.kind, feature.categories) == (source.kind, source.categories)
        assert feature.lag == place // width
        assert feature.name == f"{source.name}[t-{feature.lag}]"
        for row in range(len(table)):
            before = row - feature.lag
            known = before >= 0 and table.demonstration[before] == table.demonstration[row]
            expected = table.states[before, place % width] if known else math.nan
            np.testing.assert_equal(lagged.states[row, place], expected)
    np.testing.assert_array_equal(lagged.last, table.last)


def test_looking_back_ends_at_the_border_of_a_demonstration() -> None:
    table = some.table([[1], [2], [3], [4], [5]], [0] * 5, [0, 0, 0, 2, 2], [Feature("x")])
    nan = math.nan
    np.testing.assert_array_equal(
        with_lags(table, 2).states,
        [[1, nan, nan], [2, 1, nan], [3, 2, 1], [4, nan, nan], [5, 4, nan]],
    )


def test_a_part_of_the_rows_still_knows_the_rows_before_it() -> None:
    table = with_lags(some.table([[1], [2], [3]], [0] * 3, features=[Feature("x")]), 1)
    assert table.where(np.array([False, False, True])).states.tolist() == [[3, 2]]


def test_names_stay_unique_and_sources_stay_known() -> None:
    features = [Feature("x", topic="pose", index=7), Feature("x[t-1]", topic="odd", index=0)]
    lagged = with_lags(some.table([[0, 0]], [0], features=features), 1).features
    assert [(one.name, one.topic, one.index, one.lag) for one in lagged] == [
        ("x", "pose", 7, 0),
        ("x[t-1]", "odd", 0, 0),
        ("x[t-1]'", "pose", 7, 1),
        ("x[t-1][t-1]", "odd", 0, 1),
    ]


def test_each_channel_looks_back_at_its_own_rows() -> None:
    rows = [
        Row(time, channel, label, None, (float(time),))
        for time, (channel, label) in enumerate(zip("abbaab", "gghhgh", strict=True))
    ]
    tables = tabulate([Demonstration.from_rows("one", (Feature("x"),), rows)])
    columns = [with_lags(table, 1).states[1:, 1].tolist() for table in tables]
    assert columns == [[0, 3], [1, 2]]


@pytest.mark.parametrize(
    ("stamps", "even"),
    [
        ([0, 100, 200, 300, 400], True),
        ([0, 101, 199, 300, 403], True),
        ([0, 10, 200, 220, 400], False),
        ([5], True),
    ],
)
def test_whether_rows_are_evenly_spaced(stamps: list[int], even: bool) -> None:
    table = some.table([[0]] * len(stamps), [0] * len(stamps), features=[Feature("x")])
    assert evenly_spaced(replace(table, stamps=np.array(stamps))) is even


def test_the_pause_between_demonstrations_is_no_uneven_spacing() -> None:
    table = some.table([[0]] * 4, [0] * 4, [0, 0, 1, 1], [Feature("x")])
    assert evenly_spaced(replace(table, stamps=np.array([0, 10, 9000, 9010])))


# --- learning ---------------------------------------------------------------------------------


@pytest.mark.parametrize("topic", [None, "state"])
def test_what_was_done_because_of_the_row_before_is_learned_with_a_lag(topic: str | None) -> None:
    shown = [echoing("one", 300, 1, topic)]
    without = learn(shown).provenance.figures.own_history_agreement
    assert without is not None
    assert without < 0.8
    learned = learn(shown, LearnOptions(lags=1))
    assert learned.provenance.figures.own_history_agreement == 1.0
    assert learned.provenance.figures.fidelity_mismatches == 0
    tested = {one.literal.condition for one in nodes.conditions(learned.tree)}
    assert {one.quantity for one in tested if isinstance(one, Threshold)} == {"x[t-1]"}
    assert loads(dumps(learned)) == learned
    (result,) = replay(learned, [echoing("new", 200, 2, topic), echoing("newer", 50, 3, topic)])
    assert result.own_history_agreement > 0.98
    (seen,) = replay(learned, shown)
    assert seen.own_history_agreement == 1.0


def test_a_recording_without_the_source_of_a_lagged_feature_is_refused() -> None:
    learned = learn([echoing("one", 100, 1)], LearnOptions(lags=2))
    other = Demonstration.from_rows("other", (Feature("z"),), [Row(0, "action", "low", None, (1,))])
    with pytest.raises(InputError, match=r"'x\[t-1\]', which the recording lacks: it has z\.$"):
        replay(learned, [other])


def test_uneven_rows_are_noted() -> None:
    even = echoing("one", 100, 1)
    uneven = replace(even, stamps=np.cumsum(np.arange(100) % 7 * 1000))
    (noted,) = learn_channels(tabulate([uneven]), LearnOptions(lags=1))
    assert any("not evenly spaced" in note for note in noted.notes)
    for table, lags in ((tabulate([even]), 1), (tabulate([uneven]), 0)):
        (silent,) = learn_channels(table, LearnOptions(lags=lags))
        assert not any("evenly" in note for note in silent.notes)


@pytest.mark.parametrize("lags", [-1, LARGEST_LAG + 1])
def test_lags_out_of_range_are_refused_in_one_sentence(lags: int) -> None:
    with pytest.raises(OptionError) as refused:
        LearnOptions(lags=lags)
    assert str(refused.value) == f"lags must lie between 0 and 20, not at {lags}."


@pytest.mark.parametrize("wrong", [{"lag": -1}, {"lag": 21, "index": 0}, {"lag": 1}, {"index": 0}])
def test_a_feature_says_where_it_comes_from(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="'x'"):
        Feature("x", **wrong)  # type: ignore[arg-type]


def test_tables_are_learned_and_replayed_with_lags_from_files(tmp_path: Path) -> None:
    shown = echoing("one", 120, 4)
    rows = [
        f"{y},{x},{shown.actions[code]}"
        for (y, x), code in zip(shown.states.tolist(), shown.chosen, strict=True)
    ]
    table = tmp_path / "table.csv"
    table.write_text("\n".join(["y,x,action", *rows]) + "\n")
    offline.learn([table], out=tmp_path / "learned", options=LearnOptions(lags=3))
    assert json.loads((tmp_path / "learned" / "summary.json").read_text())["lags"] == 3
    (result,) = replay_files(tmp_path / "learned" / "tree.json", [table])
    assert result.own_history_agreement == 1.0


# --- running ----------------------------------------------------------------------------------


@st.composite
def _rules(draw: st.DrawFn, features: tuple[Feature, ...]) -> nodes.Node:
    def condition() -> Condition:
        feature = draw(st.sampled_from(features))
        match feature.kind:
            case FeatureKind.NUMERIC:
                return Threshold(feature.name, draw(st.sampled_from(some.THRESHOLDS)))
            case FeatureKind.BINARY:
                return IsTrue(feature.name)
            case FeatureKind.CATEGORICAL:
                return HasCategory(feature.name, draw(st.sampled_from(feature.categories)))

    return nodes.Selector(
        tuple(
            some.when(
                *(
                    Literal(condition(), draw(st.booleans()))
                    for _ in range(draw(st.integers(1, 2)))
                ),
                then=draw(st.sampled_from(some.ACTIONS)),
            )
            for _ in range(draw(st.integers(1, 4)))
        )
    )


@settings(max_examples=60)
@given(some.tables(max_rows=12), st.integers(0, 4), st.data())
def test_a_running_tree_looks_back_as_the_table_does(
    table: DemonstrationTable, lags: int, data: st.DataObject
) -> None:
    lagged = with_lags(replace(table, features=FEATURES), lags)
    tree = data.draw(_rules(lagged.features))
    runtime = TreeRuntime(some.learned(tree, lagged.features))
    encoder = StateEncoder(lagged.features)
    taken = []
    for row in range(len(table)):
        if row and table.demonstration[row] != table.demonstration[row - 1]:
            encoder.reset()
        state = encoder.encode({"state": table.states[row].tolist()})
        np.testing.assert_array_equal(state, lagged.states[row])
        done = runtime.tick(state).actions
        taken.append(some.LABELS.index(done[0].label) if done else NO_ACTION)
    assert taken == evaluation.teacher_forced_choices(tree, lagged).tolist()


def test_a_lagged_feature_alone_needs_the_topic_of_its_source() -> None:
    features = (
        Feature("x[t-2]", topic="pose", index=3, lag=2),
        Feature("kind[t-1]", FeatureKind.CATEGORICAL, ("4", "7"), index=1, lag=1),
    )
    encoder = StateEncoder(features, "robot/state")
    assert encoder.topics == {"pose": 4, "robot/state": 2}

    def encode(x: float, kind: float) -> list[float]:
        return encoder.encode({"pose": [0, 0, 0, x], "robot/state": [0, kind]})

    nan = math.nan
    np.testing.assert_array_equal(encode(1.5, 7), [nan, nan])
    np.testing.assert_array_equal(encode(2.5, 5), [nan, 1])
    np.testing.assert_array_equal(encode(3.5, 4), [1.5, nan])
    np.testing.assert_array_equal(encode(4.5, 4), [2.5, 0])
    encoder.reset()
    np.testing.assert_array_equal(encode(5.5, 4), [nan, nan])


# --- documents --------------------------------------------------------------------------------


def test_the_document_says_how_far_a_feature_looks_back() -> None:
    table = some.table([[0, 0]], [0], features=[Feature("x"), Feature("z", topic="p", index=5)])
    tree = nodes.Selector((some.when(some.at_most("x[t-1]", 0.5), then=some.action("go")),))
    learned: LearnedTree = some.learned(tree, with_lags(table, 1).features)
    assert json.loads(dumps(learned))["features"] == [
        {"name": "x", "kind": "numeric"},
        {"name": "z", "kind": "numeric", "topic": "p", "index": 5},
        {"name": "x[t-1]", "kind": "numeric", "index": 0, "lag": 1},
        {"name": "z[t-1]", "kind": "numeric", "topic": "p", "index": 5, "lag": 1},
    ]
    assert loads(dumps(learned)) == learned
