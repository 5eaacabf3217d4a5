"""Demonstrations become one table per channel, with kinds of features and held-out rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, history_at, part_of, tabulate
from rebt_ros.errors import InputError, OptionError, RebtError

NUMERIC, BINARY, CATEGORICAL = FeatureKind


def shown(
    name: str,
    states: Sequence[Sequence[float]],
    actions: str,
    features: Sequence[Feature] | None = None,
    channels: str | None = None,
) -> Demonstration:
    """A demonstration with one letter per action, and per channel."""
    width = len(states[0]) if states else 0
    features = [Feature(f"f{place}") for place in range(width)] if features is None else features
    rows = [
        Row(stamp, channel, action, None, tuple(map(float, state)))
        for stamp, (state, action, channel) in enumerate(
            zip(states, actions, channels or "m" * len(actions), strict=True)
        )
    ]
    return Demonstration.from_rows(name, tuple(features), rows)


def column(values: Sequence[float], feature: Feature | None = None) -> Demonstration:
    feature = Feature("f0") if feature is None else feature
    return shown("one", [(value,) for value in values], "a" * len(values), [feature])


@given(some.tables())
def test_demonstrations_begin_where_their_number_changes(table: DemonstrationTable) -> None:
    numbers, first = np.unique(table.demonstration, return_index=True)
    assert table.begins.tolist() == first.tolist()
    assert table.demonstration[table.begins].tolist() == numbers.tolist()


@pytest.mark.parametrize(
    ("values", "lacks"),
    [([math.nan, math.nan], True), ([math.nan, 1.0], False), ([1.0, math.nan], False), ([], True)],
)
def test_a_feature_is_lacking_without_a_value_in_any_row(values: list[float], lacks: bool) -> None:
    states = np.array([[value, 0.0] for value in values]).reshape(-1, 2)
    rows = [Row(0, "m", "a", None, tuple(state)) for state in states.tolist()]
    one = Demonstration.from_rows("one", (Feature("f0"), Feature("f1")), rows)
    assert one.lacks(0) is lacks


# --- kinds of features ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([0, 1, 1], BINARY),
        ([1, 0, math.nan], BINARY),
        ([-0.0, 1], BINARY),
        # Only one of the two values tells too little.
        ([0, 0], NUMERIC),
        ([1, 1], NUMERIC),
        ([0, 1, 2], NUMERIC),
        ([0, 0.5, 1], NUMERIC),
        ([math.nan, math.nan], NUMERIC),
    ],
)
def test_a_feature_that_holds_0_and_1_and_nothing_else_is_binary(
    values: list[float], kind: FeatureKind
) -> None:
    (table,) = tabulate([column(values)])
    assert table.features == (Feature("f0", kind),)
    assert np.array_equal(table.states[:, 0], values, equal_nan=True)


def test_zeros_in_one_demonstration_and_ones_in_another_are_binary() -> None:
    (table,) = tabulate([column([0, 0]), column([1])])
    assert table.features[0].kind is BINARY


@pytest.mark.parametrize(
    ("values", "declared", "codes", "categories"),
    [
        ([0, 1], NUMERIC, [0, 1], ()),
        ([1, 1], BINARY, [1, 1], ()),
        ([7, 3, 7], CATEGORICAL, [1, 0, 1], ("3", "7")),
        ([0.5, math.nan, -1], CATEGORICAL, [1, math.nan, 0], ("-1", "0.5")),
        ([0, 1], CATEGORICAL, [0, 1], ("0", "1")),
    ],
)
def test_a_declared_kind_is_taken(
    values: list[float], declared: FeatureKind, codes: list[float], categories: tuple[str, ...]
) -> None:
    (table,) = tabulate([column(values)], {"f0": declared})
    assert table.features == (Feature("f0", declared, categories),)
    assert np.array_equal(table.states[:, 0], codes, equal_nan=True)


@settings(max_examples=60)
@given(st.lists(st.floats(-1e38, 1e38) | st.integers(-5, 5).map(float), min_size=1))
def test_the_categories_of_numbers_are_the_numbers_written_as_text(values: list[float]) -> None:
    (table,) = tabulate([column(values)], {"f0": CATEGORICAL})
    names = table.features[0].categories
    assert len(set(names)) == len(names)
    assert [float(names[int(code)]) for code in table.states[:, 0]] == values


KINDS = Feature("f0", CATEGORICAL, ("box", "cup"))


@pytest.mark.parametrize(
    ("demonstration", "declared", "message"),
    [
        (column([0, 2]), {"f0": BINARY}, r"'f0' cannot be binary: it holds 0, 2\."),
        (column([0.5]), {"f0": BINARY}, r"'f0' cannot be binary: it holds 0\.5\."),
        (column([1, 2, 3, 4]), {"f0": BINARY}, r"it holds 1, 2, 3, …\."),
        (column([0, 1], KINDS), {"f0": NUMERIC}, "'f0' cannot be numeric: it holds text"),
        (column([0, 1], KINDS), {"f0": BINARY}, "'f0' cannot be binary: it holds text"),
        (column([math.nan]), {"f0": CATEGORICAL}, "'f0' cannot be categorical: it holds nothing"),
        (column([1]), {"g": BINARY}, "there is no feature 'g': the features are f0"),
    ],
)
def test_a_kind_that_does_not_fit_is_refused(
    demonstration: Demonstration, declared: dict[str, FeatureKind], message: str
) -> None:
    with pytest.raises(OptionError, match=message) as refusal:
        tabulate([demonstration], declared)
    assert str(refusal.value).endswith(".")


def test_a_column_of_text_may_be_all_missing_in_the_rows() -> None:
    # As when its only text stood in a row without a label.
    (table,) = tabulate([column([math.nan, math.nan], KINDS)])
    assert table.features == (KINDS,)


# --- several demonstrations -------------------------------------------------------------------


def test_categories_are_united_across_demonstrations() -> None:
    one = column([0, 1, math.nan], Feature("f0", CATEGORICAL, ("box", "tool")))
    two = column([1, 0], Feature("f0", CATEGORICAL, ("ball", "tool")))
    (table,) = tabulate([one, two])
    assert table.features == (Feature("f0", CATEGORICAL, ("ball", "box", "tool")),)
    names = [
        None if math.isnan(code) else table.features[0].categories[int(code)]
        for code in table.states[:, 0]
    ]
    assert names == ["box", "tool", None, "tool", "ball"]


def test_the_demonstrations_stay_as_they_are() -> None:
    one = column([0, 1], Feature("f0", CATEGORICAL, ("box", "tool")))
    before = one.states.copy()
    tabulate([one, column([0], Feature("f0", CATEGORICAL, ("ball",)))])
    numbers = column([3, 5])
    tabulate([numbers], {"f0": CATEGORICAL})
    assert (one.states == before).all()
    assert numbers.states[:, 0].tolist() == [3, 5]


def test_numbers_and_truth_values_unite_to_numbers() -> None:
    (table,) = tabulate([column([0, 1], Feature("f0", BINARY)), column([2.5])])
    assert table.features[0].kind is NUMERIC


def test_text_and_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="'f0' holds text in one demonstration and numbers"):
        tabulate([column([0, 1], KINDS), column([2.5])])


@pytest.mark.parametrize(
    ("others", "named"),
    [
        ([Feature("x")], r"different features \(y\)"),
        ([Feature("x"), Feature("z")], r"different features \(y, z\)"),
        ([Feature("y"), Feature("x")], r"the same features in different orders \(x, y; y, x\)"),
        ([Feature("x"), Feature("y"), Feature("z")], r"different features \(z\)"),
    ],
)
def test_features_that_differ_are_refused_by_name(others: list[Feature], named: str) -> None:
    one = shown("monday", [(1, 2)], "a", [Feature("x"), Feature("y")])
    other = shown("tuesday", [tuple(range(len(others)))], "a", others)
    with pytest.raises(InputError, match=rf"monday and tuesday have {named}"):
        tabulate([one, other])


def test_empty_demonstrations_are_left_out() -> None:
    empty = shown("empty", [], "", [Feature("x"), Feature("y")])
    (table,) = tabulate([empty, shown("full", [(1,), (2,)], "ab"), empty])
    assert table.demonstrations == ("full",)
    assert table.demonstration.tolist() == [0, 0]


@pytest.mark.parametrize("demonstrations", [[], [shown("empty", [], "")]])
def test_no_rows_at_all_are_refused(demonstrations: list[Demonstration]) -> None:
    with pytest.raises(InputError, match="no demonstration rows"):
        tabulate(demonstrations)


def test_lat_starts_anew_in_every_demonstration() -> None:
    (table,) = tabulate([shown("one", [(1,)] * 3, "aba"), shown("two", [(1,)] * 3, "bba")])
    assert table.actions == ("a", "b")
    assert table.last.tolist() == [NO_ACTION, 0, 1, NO_ACTION, NO_ACTION, 1]


def test_a_table_without_features_has_its_rows_all_the_same() -> None:
    (table,) = tabulate([shown("one", [(), ()], "ab", [])])
    assert table.states.shape == (2, 0)
    assert table.last.tolist() == [NO_ACTION, 0]


# --- channels ---------------------------------------------------------------------------------


def test_every_channel_is_a_table_of_its_own() -> None:
    one = shown("one", [(n,) for n in range(5)], "gxthg", channels="mamam")
    two = shown("two", [(n,) for n in range(5, 7)], "tg", channels="mm")
    arm, move = tabulate([one, two])
    assert (arm.channel, move.channel) == ("a", "m")
    assert (arm.actions, move.actions) == (("h", "x"), ("g", "t"))
    assert arm.states[:, 0].tolist() == [1, 3]
    assert move.states[:, 0].tolist() == [0, 2, 4, 5, 6]
    assert move.demonstration.tolist() == [0, 0, 0, 1, 1]
    # LAT is the channel's own.
    assert arm.last.tolist() == [NO_ACTION, 1]
    assert move.last.tolist() == [NO_ACTION, 0, 1, NO_ACTION, 1]
    assert move.stamps.tolist() == [0, 2, 4, 0, 1]


def test_all_channels_see_the_same_kinds_of_features() -> None:
    both = shown("one", [(0,), (1,)], "gx", channels="ma")
    for table in tabulate([both]):
        assert table.features == (Feature("f0", BINARY),)


# --- parts of tables --------------------------------------------------------------------------


@settings(max_examples=60)
@given(some.tables(), st.data())
def test_a_part_of_a_table_derives_lat_anew(table: DemonstrationTable, data: st.DataObject) -> None:
    size = len(table)
    kept = np.array(data.draw(st.lists(st.booleans(), min_size=size, max_size=size)), dtype=bool)
    part = table.where(kept)
    assert part.actions == table.actions
    assert part.chosen.tolist() == table.chosen[kept].tolist()
    assert np.array_equal(part.states, table.states[kept], equal_nan=True)
    again = some.table(part.states, part.chosen, part.demonstration)
    assert part.last.tolist() == again.last.tolist()


@settings(max_examples=60)
@given(some.tables(), st.data())
def test_a_part_of_a_table_keeps_the_previous_action_of_each_row(
    table: DemonstrationTable, data: st.DataObject
) -> None:
    size = len(table)
    kept = np.array(data.draw(st.lists(st.booleans(), min_size=size, max_size=size)), dtype=bool)
    part = table.where(kept)
    assert part.previous.tolist() == table.previous[kept].tolist()
    # And so does a part of the part.
    again = part.where(np.arange(len(part)) % 2 == 1)
    assert again.previous.tolist() == part.previous[1::2].tolist()


def test_the_previous_action_is_the_channels_own_and_starts_anew_in_every_demonstration() -> None:
    one = shown("one", [(n,) for n in range(5)], "gxthg", channels="mamam")
    two = shown("two", [(n,) for n in range(3)], "ttg", channels="mmm")
    arm, move = tabulate([one, two])
    assert (arm.actions, move.actions) == (("h", "x"), ("g", "t"))
    assert arm.previous.tolist() == [NO_ACTION, 1]
    assert move.previous.tolist() == [NO_ACTION, 0, 1, NO_ACTION, 1, 1]


def test_what_rows_are_goes_from_demonstrations_to_tables() -> None:
    events = [shown(name, [(1,)] * 2, "gt", channels="ma") for name in ("one", "two")]
    assert {table.row_kind for table in tabulate(events)} == {RowKind.EVENT}
    samples = [replace(one, row_kind=RowKind.SAMPLE) for one in events]
    for table in tabulate(samples):
        assert table.row_kind is RowKind.SAMPLE
        assert table.where(np.array([True, False])).row_kind is RowKind.SAMPLE


def test_demonstrations_whose_rows_mean_different_things_are_refused() -> None:
    events = shown("one", [(1,)] * 2, "gt")
    samples = replace(shown("two", [(1,)] * 2, "gt"), row_kind=RowKind.SAMPLE)
    with pytest.raises(InputError) as refused:
        tabulate([events, samples])
    assert str(refused.value) == (
        "the rows of one are events and those of two are samples, so that what was done before a "
        "row means different things: record all with the same sample_rate, or none."
    )
    # One without rows says nothing.
    empty = replace(shown("none", [], ""), features=samples.features, states=np.empty((0, 1)))
    assert tabulate([empty, samples])[0].row_kind is RowKind.SAMPLE


@pytest.mark.parametrize(
    ("demonstrations", "rows", "kept"),
    [
        # The first rows of the only one; whole demonstrations, evenly spread, and at least two.
        ([0] * 10, 4, [0, 1, 2, 3]),
        ([0] * 10, 10, list(range(10))),
        ([0, 0, 1, 1, 2, 2, 3, 3], 4, [0, 1, 4, 5]),
        ([0, 0, 1, 1, 2, 2, 3, 3], 1, [0, 1, 4, 5]),
        ([0, 0, 1, 1], 100, [0, 1, 2, 3]),
    ],
)
def test_a_part_that_tells_is_made_of_whole_demonstrations(
    demonstrations: list[int], rows: int, kept: list[int]
) -> None:
    table = some.table(
        [(0.0,) * 4] * len(demonstrations), [0] * len(demonstrations), demonstrations
    )
    assert part_of(table, rows).stamps.tolist() == kept


@pytest.mark.parametrize(
    ("rows", "fraction", "held_out"),
    [
        (4, 0.25, 1),
        (10, 0.25, 3),
        (10, 0.5, 5),
        (5456, 0.25, 1364),
        # At least one row is held out, and at least one is kept.
        (10, 1e-9, 1),
        (10, 0.999, 9),
        (2, 0.01, 1),
        (2, 0.99, 1),
        # Nothing can be held out, or is to be.
        (1, 0.5, 0),
        (10, 0.0, 0),
    ],
)
def test_the_last_rows_of_a_single_demonstration_are_held_out(
    rows: int, fraction: float, held_out: int
) -> None:
    table = some.table([(0.0,) * 4] * rows, [0] * rows)
    expected = [False] * (rows - held_out) + [True] * held_out
    assert table.held_out(fraction).tolist() == expected


@pytest.mark.parametrize(
    ("demonstration", "fraction", "held_out"),
    [
        ([0, 0, 0, 1], 0.25, {1}),
        # As nearly the share of the rows as whole demonstrations allow: here 1 of 10, not 7.
        ([0, 0, 0, 1, 1, 1, 1, 1, 1, 2], 0.25, {2}),
        ([0] * 5 + [1] * 2 + [2], 0.25, {2}),
        ([0] * 5 + [1] * 2 + [2], 0.3, {1, 2}),
        ([0, 1, 2, 3, 4], 0.25, {4}),
        # Of two that come as close, the fewer rows.
        ([0, 1, 2, 3, 4], 0.5, {3, 4}),
        ([0, 1, 2, 3], 0.25, {3}),
        ([0, 1, 2, 3], 0.5, {2, 3}),
        ([0, 1, 2, 3], 0.9, {1, 2, 3}),
        ([0, 0, 1, 1, 1], 1e-9, {1}),
        # Numbers without rows, as in the table of one channel, do not count.
        ([3, 3, 7, 7, 9], 0.3, {9}),
        ([0, 1], 0.0, set()),
    ],
)
def test_the_last_ones_of_several_demonstrations_are_held_out_whole(
    demonstration: list[int], fraction: float, held_out: set[int]
) -> None:
    rows = len(demonstration)
    table = some.table([(0.0,) * 4] * rows, [0] * rows, demonstration)
    expected = [number in held_out for number in demonstration]
    assert table.held_out(fraction).tolist() == expected


@settings(max_examples=60)
@given(some.tables(min_rows=2), st.floats(0, 1, exclude_min=True, exclude_max=True))
def test_held_out_rows_are_the_last_ones_and_never_all(
    table: DemonstrationTable, fraction: float
) -> None:
    held_out = table.held_out(fraction)
    assert 0 < held_out.sum() < len(table)
    assert (np.sort(held_out) == held_out).all()
    shown = sorted(set(table.demonstration.tolist()))
    if len(shown) > 1:
        # No other number of last demonstrations comes closer to the share.
        sizes = [int((table.demonstration >= first).sum()) for first in shown[1:]]
        off = [abs(size - fraction * len(table)) for size in sizes]
        assert abs(held_out.sum() - fraction * len(table)) <= min(off) + 1e-9
        apart = set(table.demonstration[held_out]) & set(table.demonstration[~held_out])
        assert not apart


# --- values -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "build",
    [
        lambda: Feature("x", CATEGORICAL),
        lambda: Feature("x", NUMERIC, ("a",)),
        lambda: Feature("x", BINARY, ("a",)),
        lambda: Feature("x", topic="state"),
        lambda: Feature("x", index=0),
        lambda: shown("one", [(1, 2)], "a", [Feature("x")]),
    ],
)
def test_values_that_contradict_themselves_cannot_be_built(build: object) -> None:
    assert callable(build)
    with pytest.raises(ValueError):
        build()


def test_user_errors_are_one_family() -> None:
    assert issubclass(InputError, RebtError)
    assert issubclass(OptionError, RebtError)


def test_a_correction_begins_with_the_last_action_of_the_robot() -> None:
    def shown(actions: list[str], before: dict[str, str]) -> Demonstration:
        rows = [Row(place, "action", one, None, (0.0,)) for place, one in enumerate(actions)]
        return replace(Demonstration.from_rows("d", (Feature("x"),), rows), before=before)

    (table,) = tabulate(
        [
            shown(["go", "go", "turn"], {}),
            shown(["go", "turn"], {"action": "turn"}),
            # What nobody showed is no action of the table, and so no condition.
            shown(["go"], {"action": "wait", "arm": "turn"}),
        ]
    )
    assert table.actions == ("go", "turn")
    assert table.last.tolist() == [-1, -1, 0, 1, 0, -1]
    # A part that begins inside of it does not.
    assert table.where(np.array([0, 0, 0, 1, 1, 1], dtype=bool)).last.tolist() == [1, 0, -1]
    assert table.where(np.array([1, 0, 0, 0, 1, 1], dtype=bool)).last.tolist() == [-1, -1, -1]


letters = st.sampled_from("abd")
drawn_rows = st.lists(
    st.tuples(
        st.lists(st.sampled_from((0.0, -0.0, 1.0, 2.0, math.nan)), min_size=2, max_size=2),
        letters,
        letters,
    ),
    min_size=1,
    max_size=8,
)


@given(st.lists(drawn_rows, min_size=1, max_size=3))
def test_tables_hold_what_was_shown_row_by_row(
    drawn: list[list[tuple[list[float], str, str]]],
) -> None:
    demonstrations = []
    for name, rows in enumerate(drawn):
        states, actions, channels = zip(*rows, strict=True)
        demonstrations.append(
            shown(str(name), states, "".join(actions), channels="".join(channels))
        )
    everything = [(str(name), *row) for name, rows in enumerate(drawn) for row in rows]
    tables = tabulate(demonstrations)
    assert [one.channel for one in tables] == sorted({row[3] for row in everything})
    for table in tables:
        its = [row for row in everything if row[3] == table.channel]
        assert table.actions == tuple(sorted({row[2] for row in its}))
        assert [table.actions[code] for code in table.chosen] == [row[2] for row in its]
        assert [table.demonstrations[code] for code in table.demonstration] == [
            row[0] for row in its
        ]
        np.testing.assert_array_equal(table.states, [row[1] for row in its])
        for place, feature in enumerate(table.features):
            values = {row[1][place] for row in everything if not math.isnan(row[1][place])}
            assert feature.kind is (BINARY if values == {0.0, 1.0} else NUMERIC)


# --- what was done before a row -------------------------------------------------------------------


@given(some.tables())
def test_the_history_at_a_row_is_what_its_columns_say(table: DemonstrationTable) -> None:
    def code(label: str | None) -> int:
        return NO_ACTION if label is None else table.actions.index(label)

    for row in range(len(table)):
        history = history_at(table, row)
        assert code(history.previous) == table.previous[row]
        assert code(history.before(table.actions[table.chosen[row]])) == table.last[row]


def test_the_history_at_a_row_reaches_back_to_what_was_before_its_demonstration() -> None:
    first, second = column([1, 2, 3]), shown("two", [(1,), (2,), (3,)], "bca")
    [table] = tabulate([first, replace(second, before={"m": "d"}), shown("three", [(0,)], "d")])
    history = history_at(table, 5)
    assert history.previous == "c"
    assert [history.before(*done) for done in (["c"], ["c", "b"], ["c", "b", "d"])] == [
        "b",
        "d",
        None,
    ]
    assert history_at(table, 3).previous is None
