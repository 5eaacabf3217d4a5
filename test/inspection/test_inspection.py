"""What is found out about demonstrations."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from html.parser import HTMLParser
from importlib import resources

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from rebt_ros import inspection as room
from rebt_ros.arrays import FloatArray
from rebt_ros.codec.text import indented
from rebt_ros.demonstration.demonstration import Demonstration, RowKind
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError, OptionError
from rebt_ros.inspection.idle import IDLE_ROWS, STILL, idle
from rebt_ros.inspection.inspecting import inspect
from rebt_ros.inspection.inspection import Inspected, Inspection, OutlierKind, dumps, json_schema
from rebt_ros.inspection.page import inspection_page
from rebt_ros.inspection.timing import clock
from rebt_ros.inspection.wording import findings

SECOND = 1_000_000_000


def shown(
    name: str,
    states: Sequence[Sequence[float]] | FloatArray,
    labels: Sequence[str],
    *,
    stamps: Sequence[int] | None = None,
    channels: Sequence[str] | None = None,
    kind: RowKind = RowKind.SAMPLE,
) -> Demonstration:
    """A demonstration, whose rows are a tenth of a second apart unless it says otherwise."""
    values = np.asarray(states, dtype=float).reshape(len(labels), -1)
    on = list(channels or ["action"] * len(labels))
    actions, known = sorted(set(labels)), sorted(set(on))
    times = range(0, len(labels) * SECOND // 10, SECOND // 10) if stamps is None else stamps
    return Demonstration(
        name,
        tuple(Feature(f"x{place}") for place in range(values.shape[1])),
        values,
        np.array(times, dtype=np.int64),
        tuple(actions),
        np.array([actions.index(label) for label in labels], dtype=np.int64),
        tuple(known),
        np.array([known.index(channel) for channel in on], dtype=np.int64),
        row_kind=kind,
    )


def drive(name: str, seed: int = 0, rows: int = 100, start: float = 0.0) -> Demonstration:
    """A robot that goes to and fro, with noise of its own."""
    noise = np.random.default_rng(seed).normal(scale=0.02, size=(rows, 2))
    phase = start + np.linspace(0, 9, rows)
    states = np.stack([np.sin(phase), np.cos(phase)], axis=1) + noise
    return shown(name, states, ["go" if sine > 0 else "turn" for sine in np.sin(phase)])


def drives(count: int = 6) -> list[Demonstration]:
    return [drive(f"run_{number}", number, 95 + number, number / 3) for number in range(count)]


def of(inspection: Inspection, name: str) -> Inspected:
    return next(one for one in inspection.demonstrations if one.name == name)


@st.composite
def coincidences(draw: st.DrawFn) -> list[Demonstration]:
    """Demonstrations of few states and actions, so that many contradict each other."""
    row = st.tuples(
        st.sampled_from([0.0, -0.0, 1.0, float("nan")]),
        st.sampled_from([0.0, 2.0]),
        st.sampled_from(["go", "stop", "turn"]),
        st.sampled_from(["arm", "base"]),
    )
    several = draw(st.lists(st.lists(row, max_size=8), min_size=1, max_size=4))
    several.append([(0.0, 0.0, "go", "arm")])
    return [
        shown(
            f"run_{number}",
            np.array([(first, second) for first, second, _, _ in rows]).reshape(len(rows), 2)
            if rows
            else np.empty((0, 2)),
            [label for _, _, label, _ in rows],
            channels=[channel for _, _, _, channel in rows],
        )
        if rows
        else _empty(f"run_{number}")
        for number, rows in enumerate(several)
    ]


def _empty(name: str) -> Demonstration:
    none = np.empty(0, dtype=np.int64)
    features = (Feature("x0"), Feature("x1"))
    return Demonstration(
        name, features, np.empty((0, 2)), none, (), none, (), none, row_kind=RowKind.SAMPLE
    )


@given(coincidences())
def test_every_row_is_accounted_for(demonstrations: list[Demonstration]) -> None:
    found = inspect(demonstrations)
    assert [one.rows for one in found.demonstrations] == [len(one) for one in demonstrations]
    assert found.rows == sum(one.rows for one in found.demonstrations)
    for one in found.demonstrations:
        assert sum(action.rows for action in one.actions) == one.rows
    total = Counter[tuple[str, str]]()
    for one in found.demonstrations:
        total.update({(action.channel, action.action): action.rows for action in one.actions})
    assert total == {(one.channel, one.action): one.rows for one in found.actions}
    assert found.contradicting == sum(one.contradicting.rows for one in found.demonstrations)
    assert not list(Draft202012Validator(json_schema()).iter_errors(json.loads(dumps(found))))
    assert inspection_page(found)
    assert list(findings(found)) == list(findings(found))


@given(coincidences())
def test_rows_contradict_where_an_equal_state_has_another_action(
    demonstrations: list[Demonstration],
) -> None:
    rows = [
        (number, place, str(one.states[row] + 0.0), one.channels[one.channel[row]], label)
        for number, one in enumerate(demonstrations)
        for row, place in enumerate(range(len(one)))
        for label in [one.actions[one.chosen[row]]]
    ]
    found = inspect(demonstrations)
    for number, one in enumerate(found.demonstrations):
        mine = [row for row in rows if row[0] == number]
        against = {
            row: [other for other in rows if other[2:4] == row[2:4] and other[4] != row[4]]
            for row in mine
        }
        contradicting = [row for row in mine if against[row]]
        same = {row: sum(other[2:] == row[2:] for other in rows) for row in mine}
        assert one.contradicting.rows == len(contradicting)
        assert one.contradicting.with_others == sum(
            any(other[0] != number for other in against[row]) for row in contradicting
        )
        assert one.contradicting.outvoted == sum(
            max(Counter(other[4] for other in against[row]).values()) > same[row]
            for row in contradicting
        )
        for example in one.contradicting.examples:
            row = mine[example.row]
            where = next(
                other
                for other in against[row]
                if found.demonstrations[other[0]].name == example.demonstration
                and other[1] == example.other_row
            )
            assert (example.action, example.other) == (row[4], where[4])


@given(
    st.lists(
        st.tuples(st.sampled_from([0.0, 0.009, 0.02, 5.0]), st.sampled_from([0, 1])),
        max_size=40,
    ),
    st.sampled_from([0.3, 1.2]),
)
def test_idle_stretches_are_windows_in_which_nothing_changes(
    rows: list[tuple[float, int]], seconds: float
) -> None:
    states = np.array([value for value, _ in rows]).reshape(-1, 1)
    chosen = np.array([action for _, action in rows], dtype=np.int64)
    time = clock(np.arange(len(rows)) * SECOND // 10)
    least = max(IDLE_ROWS, round(seconds * 10) + 1) if len(rows) > 1 else IDLE_ROWS
    still = np.zeros(len(rows), dtype=bool)
    for first in range(len(rows) - least + 1):
        window = slice(first, first + least)
        if np.ptp(states[window]) <= STILL and np.ptp(chosen[window]) == 0:
            still[window] = True
    found = idle(states, chosen, time, seconds)
    assert found.rows == np.count_nonzero(still)
    assert found.count == np.count_nonzero(np.diff(still.astype(int), prepend=0) > 0)
    for stretch in found.longest:
        assert still[stretch.row : stretch.row + stretch.rows].all()


def test_a_gap_is_far_longer_than_the_other_times_between_rows() -> None:
    steps = np.full(60, SECOND // 10)
    steps[20], steps[40] = 3 * SECOND, SECOND // 10 + SECOND // 20
    stamps = np.concatenate([[7], 7 + np.cumsum(steps)]).tolist()
    found = inspect([shown("run", np.arange(61.0), ["go"] * 60 + ["turn"], stamps=stamps)])
    (one,) = found.demonstrations
    assert one.gaps is not None
    assert one.timing is not None
    assert (one.gaps.count, one.gaps.rows, one.gaps.longest[0].row) == (1, 1, 20)
    assert one.gaps.longest[0].at == pytest.approx(2.0)
    assert one.gaps.seconds == pytest.approx(3.0)
    assert one.timing.rate == pytest.approx(10.0)
    assert one.timing.seconds == pytest.approx(8.95)
    assert "run: gap of 3 s at 2.0 s" in list(findings(found))


def test_rows_that_come_unevenly_have_no_gaps() -> None:
    steps = np.random.default_rng(0).uniform(0.05, 0.15, 200) * SECOND
    stamps = np.cumsum(steps).astype(int).tolist()
    (one,) = inspect(
        [shown("run", np.arange(200.0), ["go", "turn"] * 100, stamps=stamps)]
    ).demonstrations
    assert one.gaps is not None
    assert one.gaps.count == 0


def test_where_stamps_number_rows_there_is_no_time() -> None:
    (one,) = inspect([shown("run", [0.5] * 30, ["go"] * 30, stamps=range(30))]).demonstrations
    assert (one.timing, one.gaps) == (None, None)
    assert one.idle is not None
    assert (one.idle.count, one.idle.rows, one.idle.seconds) == (1, 30, None)


def test_a_clock_that_is_set_back_is_told_and_adds_no_time() -> None:
    stamps = [*range(0, 10 * SECOND, SECOND), *range(5 * SECOND, 15 * SECOND, SECOND)]
    found = inspect([shown("run", np.arange(20.0), ["go", "turn"] * 10, stamps=stamps)])
    timing = found.demonstrations[0].timing
    assert timing is not None
    assert (timing.clock_set_back, timing.seconds) == (1, 18.0)
    assert "run: the clock was set back once" in list(findings(found))


def test_of_events_nobody_knows_whether_they_are_idle() -> None:
    (one,) = inspect([shown("run", [0.5] * 30, ["go"] * 30, kind=RowKind.EVENT)]).demonstrations
    assert one.idle is None


def test_rows_of_several_channels_at_one_time_are_one() -> None:
    stamps = [row // 2 * SECOND // 10 for row in range(40)]
    (one,) = inspect(
        [
            shown(
                "run",
                [row // 2 for row in range(40)],
                ["go", "grasp"] * 20,
                stamps=stamps,
                channels=["base", "arm"] * 20,
            )
        ]
    ).demonstrations
    assert one.timing is not None
    assert one.timing.rate == pytest.approx(10.0)
    assert one.contradicting.rows == 0
    assert {(action.channel, action.action) for action in one.actions} == {
        ("base", "go"),
        ("arm", "grasp"),
    }


def test_a_copy_is_a_near_duplicate_and_so_is_one_with_a_little_noise() -> None:
    runs = drives()
    noisy = runs[2].states + np.random.default_rng(1).normal(scale=0.003, size=runs[2].states.shape)
    labels = [runs[2].actions[code] for code in runs[2].chosen]
    copies = [shown("copy", runs[2].states, labels), shown("noisy", noisy, labels)]
    found = inspect([*runs, *copies])
    assert [one.near_duplicate for one in found.demonstrations[:6]] == [None] * 6
    copy, noisy_copy = (of(found, name).near_duplicate for name in ("copy", "noisy"))
    assert copy is not None
    assert noisy_copy is not None
    assert (copy.of, copy.share) == ("run_2", 1.0)
    # The first of them stands for all.
    assert noisy_copy.of == "run_2"
    assert any("copy: near-duplicate of run_2 (100.0%" in finding for finding in findings(found))


def test_the_same_way_at_another_speed_is_no_near_duplicate() -> None:
    rows = np.arange(100)
    states = np.stack([rows / 100, rows % 7], axis=1)
    labels = ["go" if row < 50 else "turn" for row in rows]
    slow = range(0, 100 * SECOND // 5, SECOND // 5)
    found = inspect([shown("fast", states, labels), shown("slow", states, labels, stamps=slow)])
    assert of(found, "slow").near_duplicate is None


def test_another_action_in_the_same_states_is_no_near_duplicate() -> None:
    states = np.arange(100.0)
    found = inspect([shown("first", states, ["go"] * 100), shown("second", states, ["turn"] * 100)])
    assert of(found, "second").near_duplicate is None
    assert of(found, "second").contradicting.with_others == 100


@given(st.lists(st.integers(0, 3), min_size=2, max_size=7), st.integers(1, 30))
def test_of_equal_demonstrations_all_but_the_first_are_near_duplicates(
    kinds: list[int], features: int
) -> None:
    runs = [
        shown(
            f"run_{number}",
            np.random.default_rng(kind).normal(size=(12 + kind, features)),
            ["go", "turn"] * (6 + kind // 2) + ["go"] * (kind % 2),
        )
        for number, kind in enumerate(kinds)
    ]
    found = inspect(runs)
    for number, one in enumerate(found.demonstrations):
        first = kinds.index(kinds[number])
        if first == number:
            assert one.near_duplicate is None
        else:
            assert one.near_duplicate is not None
            assert (one.near_duplicate.of, one.near_duplicate.share) == (f"run_{first}", 1.0)


def test_what_is_far_from_the_rest_is_an_outlier() -> None:
    runs = drives(9)
    long = drive("long", 20, 400)
    odd = drive("odd", 21)
    odd.states[50, 1] = 30.0
    typo = shown("typo", odd.states * 0 + drive("x", 22).states, ["go"] * 99 + ["trun"])
    found = inspect([*runs, long, odd, typo])
    assert [of(found, f"run_{number}").outliers for number in range(9)] == [()] * 9
    kinds = {
        name: [(one.kind, one.name) for one in of(found, name).outliers]
        for name in ("long", "odd", "typo")
    }
    assert kinds["long"][:2] == [(OutlierKind.ROWS, ""), (OutlierKind.SECONDS, "")]
    assert kinds["odd"] == [(OutlierKind.FEATURE_RANGE, "x1")]
    assert (OutlierKind.ACTION_ONLY_HERE, "trun") in kinds["typo"]
    assert (OutlierKind.ACTION_SHARE, "go") in kinds["typo"]
    told = list(findings(found))
    assert "typo: only here is trun shown (once)" in told
    assert any(one.startswith("odd: x1 is 30, above the 1.0") for one in told)


def test_of_few_demonstrations_none_is_an_outlier() -> None:
    found = inspect([drive("first"), drive("second", 1), drive("long", 2, 900)])
    assert [one.outliers for one in found.demonstrations] == [()] * 3
    assert found.notes == ("outliers are told among 5 or more demonstrations only",)


def test_features_that_never_vary_are_named_here_and_everywhere() -> None:
    first = np.stack([np.arange(20.0), np.full(20, 3.0), np.full(20, np.nan)], axis=1)
    second = np.stack([np.full(20, 4.0), np.full(20, 3.0), np.full(20, np.nan)], axis=1)
    found = inspect([shown("first", first, ["go"] * 20), shown("second", second, ["turn"] * 20)])
    assert found.constant == ("x1", "x2")
    assert of(found, "second").constant == ("x0", "x1", "x2")
    assert of(found, "second").missing == 20
    told = list(findings(found))
    assert told[0] == "never vary in any demonstration: x1, x2"
    assert "second: never varies here, but does elsewhere: x0" in told


def test_large_offsets_and_missing_values_do_not_hide_differences() -> None:
    far = 1e12 + np.arange(100.0)
    labels = ["go"] * 50 + ["turn"] * 50
    holes = far.copy()
    holes[30:60] = np.nan
    found = inspect(
        [
            shown("first", far, labels),
            shown("backwards", far[::-1], labels),
            shown("holes", holes, labels),
            shown("again", holes, labels),
        ]
    )
    near = [one.near_duplicate for one in found.demonstrations]
    assert near[:3] == [None] * 3
    assert near[3] is not None
    assert near[3].of == "holes"


@given(
    st.lists(
        st.lists(
            st.tuples(
                st.floats(-1e38, 1e38) | st.just(float("nan")),
                st.integers(-(2**63), 2**63 - 1),
            ),
            min_size=10,
            max_size=11,
        ),
        min_size=5,
        max_size=5,
    )
)
@settings(max_examples=20)
def test_whatever_the_numbers_are_all_figures_are_numbers(
    runs: list[list[tuple[float, int]]],
) -> None:
    found = inspect(
        [
            shown(
                f"run_{number}",
                [[value] for value, _ in rows],
                ["go"] * len(rows),
                stamps=[stamp for _, stamp in rows],
            )
            for number, rows in enumerate(runs)
        ]
    )
    assert not list(Draft202012Validator(json_schema()).iter_errors(json.loads(dumps(found))))


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), 1e6])
def test_a_time_that_makes_no_sense_is_refused(seconds: float) -> None:
    with pytest.raises(OptionError, match="idle stretch must be above 0"):
        inspect([drive("run")], idle_seconds=seconds)


def test_demonstrations_without_rows_are_refused() -> None:
    with pytest.raises(InputError, match="no demonstration rows"):
        inspect([_empty("run")])


def test_the_schema_that_is_installed_is_the_one_that_the_forms_give() -> None:
    shipped = resources.files(room).joinpath("inspection.schema.json")
    generated = indented(json_schema()) + "\n"
    assert shipped.read_text(encoding="utf-8") == generated, f"write to {shipped}:\n{generated}"
    Draft202012Validator.check_schema(json_schema())


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.seen = Counter[str]()
        self.attributes = set[str]()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen[tag] += 1
        self.attributes.update(name for name, _ in attrs)


def test_the_page_needs_nothing_else_and_names_do_not_act_on_it() -> None:
    hostile = "<script>alert(1)</script>\x1b[2J\udc80"
    runs = [*drives(5), shown(hostile, drive("x").states, [hostile[:25]] * 100)]
    page = inspection_page(inspect(runs))
    tags = _Tags()
    tags.feed(page)
    assert not {"script", "link", "img", "iframe"} & tags.seen.keys()
    assert not {"src", "href", "onclick"} & tags.attributes
    assert not re.search(r"url\(|@import|https?:", page)
    assert "prefers-color-scheme: dark" in page
    assert "\x1b" not in page
    page.encode("utf-8")
    assert "&lt;script&gt;" in page
    dumps(inspect(runs)).encode("utf-8")
