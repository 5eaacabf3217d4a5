"""How conditions and nodes are put into words."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.wording import Wording, distinct_texts
from rebt_ros.logic.conditions import (
    KNOWN,
    Condition,
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
    WeightedSum,
)

#: Names that are easily taken for something else, so that hypothesis meets collisions quickly.
TRICKY = [
    "a",
    "a = b",
    "b",
    "a = b = c",
    "b = c",
    "not a",
    "Not a",
    "not",
    "nothing",
    "'a'",
    "'",
    '"',
    "\\",
    "\\n",
    "\n",
    "",
    " ",
    " a",
    "a ",
    "a  b",
    "a b",
    "last action",
    "last action = a",
    "doing",
    "doing a",
    "Doing  a",
    "not doing a",
    "a − b",
    "b − a",
    "a −",
    "− b",
    "−",
    "a − b − c",
    "b − c",
    "a ≤ b",
    "0.3 < a − b ≤ 0.5",
    "LAST ACTION",
    "a is known",
    "a is missing",
    "a ≤ 0.5",
    "0.5",
    "a > 0.5",
    "0.3 < a ≤ 0.5",
    "(0.3 < a ≤ 0.5)",
    "a (before b)",
    "a (before b or c)",
    "b or c",
    "or",
    "c",
    "a @b",
    "@",
    "@b",
    "\u200b",
    "\x00",
    "\ud800",
    "é",
    "\u2019a\u2019",
    "a' = 'b",
]
names = st.one_of(st.sampled_from(TRICKY), st.text(max_size=4))
numbers = st.one_of(
    st.sampled_from([0.0, 0.5, 0.3, 0.30000001192092896, 0.3000001, KNOWN, -KNOWN, 1e-310]),
    st.integers(-(10**9), 10**9).map(lambda whole: whole / 1000),
    st.floats(allow_nan=False, allow_infinity=False),
)
differences = st.lists(names, min_size=2, max_size=2, unique=True).map(
    lambda pair: Difference(*pair)
)
weights = numbers.filter(lambda weight: weight not in (0.0, 1.0)) | st.just(1.0)
sums = st.lists(names, min_size=2, max_size=3, unique=True).flatmap(
    lambda its: st.builds(
        lambda first, others: WeightedSum(tuple(zip(its, (first, *others), strict=True))),
        weights,
        st.lists(weights, min_size=len(its) - 1, max_size=len(its) - 1).filter(
            lambda others: others != [-1.0]
        ),
    )
)
quantities = st.one_of(names, differences, sums)
conditions: st.SearchStrategy[Condition] = st.one_of(
    st.builds(Threshold, quantities, numbers),
    st.builds(
        lambda quantity, ends: Interval(quantity, *sorted(ends)),
        quantities,
        st.lists(numbers, min_size=2, max_size=2, unique=True),
    ),
    st.builds(PreviousActionIs, names),
    st.builds(IsTrue, names),
    st.builds(HasCategory, names, names),
    st.builds(LastActionIs, names, st.lists(names, max_size=3).map(tuple)),
)


#: Of two sensors.
APART = Difference("left", "right")
#: As someone balances.
WEIGHED = WeightedSum((("angle", 1.0), ("spin", -0.4), ("x", 1e-5)))


def wording_of(*shown: Condition) -> Wording:
    return Wording(
        nodes.Sequence(tuple(nodes.Condition(Literal(condition)) for condition in shown))
    )


def text(condition: Condition, *others: Condition, positive: bool = True) -> str:
    """The condition's text in a tree that holds the others as well."""
    return wording_of(condition, *others).literal(Literal(condition, positive))


@pytest.mark.parametrize(
    ("condition", "positive", "negative"),
    [
        (Threshold("battery", 0.30000001192092896), "battery ≤ 0.3", "battery > 0.3"),
        (Threshold("battery", 2.0), "battery ≤ 2", "battery > 2"),
        (Threshold("/scan/front [m]", -0.83712), "/scan/front [m] ≤ -0.837", None),
        (Threshold("ticks", 1234.5678), "ticks ≤ 1235", "ticks > 1235"),
        (Threshold("charge", 0.00001234567), "charge ≤ 1.23e-5", None),
        (Threshold("x", KNOWN), "x is known", "x is missing"),
        (Threshold(WEIGHED, 0.02), "angle − 0.4 × spin + 1e-05 × x ≤ 0.02", None),
        (Threshold(WEIGHED, 0.0), "angle − 0.4 × spin + 1e-05 × x ≤ 0", None),
        (Threshold(WEIGHED, KNOWN), "angle − 0.4 × spin + 1e-05 × x is known", None),
        (Threshold(WeightedSum((("x", -2.0), ("y", 10.0))), 1.0), "−2 × x + 10 × y ≤ 1", None),
        (Interval("x", 0.30000001192092896, 2.0), "0.3 < x ≤ 2", "not (0.3 < x ≤ 2)"),
        (IsTrue("docked"), "docked", "not docked"),
        (IsTrue("nothing_near"), "nothing_near", "not nothing_near"),
        (HasCategory("kind", "box"), "kind = box", "kind ≠ box"),
        (HasCategory("kind", "2"), "kind = 2", None),
        (LastActionIs("turn", ("go",)), "last action = turn", "last action ≠ turn"),
        (PreviousActionIs("go"), "doing go", "not doing go"),
        (PreviousActionIs("turn left"), "doing turn left", None),
        (Threshold(APART, 0.0), "left ≤ right", "left > right"),
        (Threshold(APART, -0.0), "left ≤ right", "left > right"),
        (Threshold(APART, 0.30000001192092896), "left − right ≤ 0.3", "left − right > 0.3"),
        (Threshold(APART, KNOWN), "left − right is known", "left − right is missing"),
        (Interval(APART, 0.0, 0.5), "0 < left − right ≤ 0.5", "not (0 < left − right ≤ 0.5)"),
    ],
)
def test_a_condition_reads_as_a_person_writes_it(
    condition: Condition, positive: str, negative: str | None
) -> None:
    assert text(condition) == positive
    if negative is not None:
        assert text(condition, positive=False) == negative


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (IsTrue("a = b"), "'a = b'"),
        (IsTrue("not docked"), "'not docked'"),
        (IsTrue("x is known"), "'x is known'"),
        (HasCategory("last action", "go"), "'last action' = go"),
        (HasCategory("kind", ""), "kind = ''"),
        (HasCategory("kind", "box "), "kind = 'box '"),
        (HasCategory("kind", "it's\n"), "kind = 'it\\'s\\n'"),
        (Threshold("12", 0.5), "'12' ≤ 0.5"),
        (Threshold("2 × x", 0.5), "'2 × x' ≤ 0.5"),
        (Threshold("x + y", 0.5), "'x + y' ≤ 0.5"),
        (Threshold(WeightedSum((("−x", 1.0), ("3", -2.0))), 0.5), "'−x' − 2 × '3' ≤ 0.5"),
        (Interval("12", 0.3, 0.5), "0.3 < '12' ≤ 0.5"),
        (IsTrue("0.3 < x ≤ 0.5"), "'0.3 < x ≤ 0.5'"),
        (IsTrue("doing go"), "'doing go'"),
        (IsTrue("doing_go"), "doing_go"),
        (PreviousActionIs("not go"), "doing 'not go'"),
        (PreviousActionIs(""), "doing ''"),
        (Threshold("left − right", 0.5), "'left − right' ≤ 0.5"),
        (Threshold(Difference("left − right", "x"), 0.5), "'left − right' − x ≤ 0.5"),
        (Threshold(Difference("x", "0.5"), 0.0), "x ≤ '0.5'"),
    ],
)
def test_a_name_that_can_be_misread_is_quoted(condition: Condition, expected: str) -> None:
    assert text(condition) == expected


def test_thresholds_show_more_digits_only_where_they_are_close() -> None:
    far, near, nearer = Threshold("x", 5.4321), Threshold("x", 0.83712), Threshold("x", 0.83749)
    other = Threshold("y", 0.83713)
    shown = wording_of(far, near, nearer, other)
    assert [shown.literal(Literal(one)) for one in (far, near, nearer, other)] == [
        "x ≤ 5.43",
        "x ≤ 0.837",
        "x ≤ 0.8375",
        "y ≤ 0.837",
    ]


def test_the_ends_of_intervals_share_their_digits_with_thresholds() -> None:
    between, near = Interval("x", 0.83712, 5.4321), Threshold("x", 0.83749)
    same, other = Threshold("x", 0.83712), Threshold("y", 0.83713)
    shown = wording_of(between, near, same, other)
    assert [shown.literal(Literal(one)) for one in (between, near, same, other)] == [
        "0.837 < x ≤ 5.43",
        "x ≤ 0.8375",
        "x ≤ 0.837",
        "y ≤ 0.837",
    ]


def test_a_difference_and_its_features_have_digits_of_their_own() -> None:
    near, nearer = Threshold(APART, 0.83712), Threshold(APART, 0.83749)
    left, other = Threshold("left", 0.83713), Threshold(Difference("right", "left"), 0.83714)
    shown = wording_of(near, nearer, left, other)
    assert [shown.literal(Literal(one)) for one in (near, nearer, left, other)] == [
        "left − right ≤ 0.837",
        "left − right ≤ 0.8375",
        "left ≤ 0.837",
        "right − left ≤ 0.837",
    ]


def test_the_action_being_decided_is_named_only_where_it_makes_the_difference() -> None:
    go, turn = LastActionIs("dock", ("go",)), LastActionIs("dock", ("turn", "turn left"))
    assert text(go) == text(go, LastActionIs("turn", ("stop",))) == "last action = dock"
    assert text(go, turn) == "last action = dock (before go)"
    assert text(turn, go) == "last action = dock (before turn or 'turn left')"


@given(st.lists(conditions, min_size=2, max_size=12, unique=True))
def test_different_conditions_never_read_the_same(shown: list[Condition]) -> None:
    wording = wording_of(*shown)
    texts = [
        wording.literal(Literal(condition, positive))
        for condition in shown
        for positive in (True, False)
    ]
    assert len(set(texts)) == len(texts)
    assert all(one.isprintable() for one in texts)


@given(st.lists(numbers, min_size=1, max_size=20, unique=True))
def test_threshold_texts_keep_the_order_of_the_numbers(values: list[float]) -> None:
    texts = distinct_texts(values)
    assert list(texts) == sorted(values)
    for low, high in pairwise(sorted(values)):
        middle = (Fraction(low) + Fraction(high)) / 2
        assert Fraction(texts[low]) < middle < Fraction(texts[high])
        assert float(texts[low]) <= float(texts[high])


@given(st.floats(-1e6, 1e6), st.integers(1, 3))
def test_adjacent_double_precision_numbers_are_told_apart(value: float, steps: int) -> None:
    run = [value]
    for _ in range(steps):
        run.append(run[-1] + abs(run[-1]) * 2.3e-16 + 5e-324)
    texts = distinct_texts(run)
    assert len(set(texts.values())) == len(set(run))


@given(st.lists(st.builds(nodes.Action, names, names), min_size=2, max_size=8, unique=True))
def test_different_actions_never_read_the_same(actions: list[nodes.Action]) -> None:
    wording = Wording(nodes.Selector(tuple(actions)))
    assert len({wording.node(action) for action in actions}) == len(actions)


def test_an_action_names_its_channel_only_where_there_are_several() -> None:
    drive, wave = nodes.Action("go", "wheels"), nodes.Action("wave", "arm")
    assert Wording(drive).node(drive) == "go"
    assert Wording(nodes.Parallel((drive, wave))).node(drive) == "go @wheels"


def test_control_nodes_have_names() -> None:
    leaf = nodes.Action("go", "action")
    shown: list[nodes.Node] = [
        nodes.Sequence((leaf,)),
        nodes.Selector((leaf,)),
        nodes.Parallel((leaf,)),
        nodes.ParallelSelector((leaf,)),
        nodes.Repeater((leaf,)),
        nodes.Inverter(leaf),
    ]
    assert [Wording(node).node(node) for node in shown] == [
        "Sequence",
        "Selector",
        "Parallel",
        "Parallel/Selector",
        "Repeater",
        "not",
    ]


def test_an_explanation_has_every_digit_and_tells_of_missing_values() -> None:
    literal = Literal(Threshold("battery", 0.30000001192092896), positive=False)
    node = nodes.Condition(literal)
    assert Wording(node).explanation(node) == (
        "Condition: 'battery' > 0.30000001192092896, or missing"
    )


@pytest.mark.parametrize(
    ("literal", "expected"),
    [
        (Literal(Threshold(APART, 0.0)), "'left' - 'right' <= 0.0"),
        (
            ~Literal(Threshold(APART, 0.1 + 0.2)),
            "'left' - 'right' > 0.30000000000000004, or missing",
        ),
        (Literal(PreviousActionIs("go")), "the action before is 'go'"),
        (~Literal(PreviousActionIs("go")), "the action before is not 'go'"),
    ],
)
def test_an_explanation_tells_of_differences_and_of_what_was_done_before(
    literal: Literal, expected: str
) -> None:
    node = nodes.Condition(literal)
    assert Wording(node).explanation(node) == f"Condition: {expected}"


@pytest.mark.parametrize(
    ("positive", "expected"),
    [
        (True, "Condition: 0.30000001192092896 < 'x' <= 0.5"),
        (False, "Condition: not (0.30000001192092896 < 'x' <= 0.5), or missing"),
    ],
)
def test_an_explanation_has_every_digit_of_an_interval(positive: bool, expected: str) -> None:
    node = nodes.Condition(Literal(Interval("x", 0.30000001192092896, 0.5), positive))
    assert Wording(node).explanation(node) == expected
