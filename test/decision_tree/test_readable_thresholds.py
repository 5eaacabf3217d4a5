from __future__ import annotations

import math
from itertools import combinations, permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.decision_tree.readable_thresholds import roundest, shared_thresholds

_VALUES = st.floats(-1e38, 1e38, allow_nan=False)
#: Many of them begin or end together.
_WHOLE_GAPS = st.tuples(st.integers(0, 12), st.integers(1, 6)).map(
    lambda one: (float(one[0]), float(sum(one)))
)
_GAPS = st.tuples(_VALUES, _VALUES).filter(lambda ends: ends[0] != ends[1]).map(sorted).map(tuple)


def _digits(value: float) -> int:
    """Significant digits of the shortest decimal that is read back as the value."""
    mantissa = repr(abs(value)).split("e")[0].replace(".", "").strip("0")
    return len(mantissa)


@given(st.lists(_GAPS, max_size=30))
def test_each_threshold_lies_in_its_gap(gaps: list[tuple[float, float]]) -> None:
    thresholds = shared_thresholds(gaps)
    assert len(thresholds) == len(gaps)
    for (low, high), threshold in zip(gaps, thresholds, strict=True):
        assert low <= threshold < high


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(st.integers(0, 12), st.integers(1, 6)).map(lambda one: (one[0], sum(one))),
        min_size=1,
        max_size=7,
    )
)
def test_there_are_as_few_values_as_possible(gaps: list[tuple[int, int]]) -> None:
    # Where a value serves a gap of whole numbers, the whole number below it does as well.
    fewest = next(
        count
        for count in range(1, len(gaps) + 1)
        if any(
            all(any(low <= value < high for value in values) for low, high in gaps)
            for values in combinations(range(19), count)
        )
    )
    assert len(set(shared_thresholds([(float(low), float(high)) for low, high in gaps]))) == fewest


@given(st.lists(_GAPS | _WHOLE_GAPS, min_size=1, max_size=10), st.randoms())
def test_the_order_of_the_gaps_does_not_matter(gaps: list[tuple[float, float]], random) -> None:
    found = dict(zip(gaps, shared_thresholds(gaps), strict=True))
    random.shuffle(gaps)
    assert dict(zip(gaps, shared_thresholds(gaps), strict=True)) == found


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(st.integers(0, 30), st.integers(1, 12)).map(lambda one: (one[0], sum(one))),
        min_size=1,
        max_size=12,
    )
)
def test_gaps_that_hold_all_of_another_do_not_change_its_value(
    gaps: list[tuple[int, int]],
) -> None:
    floats = [(float(low), float(high)) for low, high in gaps]
    found = dict(zip(floats, shared_thresholds(floats), strict=True))
    apart = [
        (low, high)
        for low, high in floats
        if not any(low <= a and b <= high and (a, b) != (low, high) for a, b in floats)
    ]
    assert dict(zip(apart, shared_thresholds(apart), strict=True)).items() <= found.items()


def test_the_order_of_gaps_that_end_together_does_not_matter() -> None:
    gaps = [(0.0, 1.0), (0.5, 1.0), (0.3, 5.0), (2.0, 3.0)]
    wanted = dict(zip(gaps, shared_thresholds(gaps), strict=True))
    for order in permutations(gaps):
        assert dict(zip(order, shared_thresholds(order), strict=True)) == wanted


def test_a_gap_that_a_later_value_serves_leaves_an_earlier_one_free() -> None:
    assert shared_thresholds([(0.0, 1.0), (0.93, 5.0), (2.0, 3.0)]) == [0.5, 2.5, 2.5]


@given(st.lists(_GAPS, max_size=10))
def test_gaps_around_a_threshold_keep_it(gaps: list[tuple[float, float]]) -> None:
    for value in set(shared_thresholds(gaps)):
        assert roundest(value, math.nextafter(value, math.inf)) == value


@given(st.integers(1, 9999), st.integers(1, 9999), st.integers(-200, 200))
def test_powers_of_ten_do_not_change_how_round_a_threshold_is(
    one: int, other: int, exponent: int
) -> None:
    low, high = sorted((one, one + other))
    scaled = roundest(float(f"{low}e{exponent}"), float(f"{high}e{exponent}"))
    # Ties between two equally round values may be broken otherwise.
    assert _digits(scaled) == _digits(roundest(float(low), float(high)))


def test_three_readings_of_one_border_become_one_round_value() -> None:
    assert set(shared_thresholds([(0.1952, 0.204), (0.1987, 0.231), (0.19, 0.2019)])) == {0.2}


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.31, 0.55, 0.4),
        (-0.3, 0.2, 0.0),
        (98.7, 104.2, 100.0),
        (10.4, 32.6, 20.0),
        (-0.2561, -0.2497, -0.25),
        # 1 would be rounder, but stands at the edge of what was shown.
        (0.99, 4.0, 2.0),
        (1e37, 9e37, 5e37),
        (2e-300, 9.8e-300, 6e-300),
        # Nothing but the end itself lies in a gap that is one unit in the last place wide.
        (0.1, math.nextafter(0.1, 1), 0.1),
    ],
)
def test_a_threshold_is_what_a_person_would_write(low: float, high: float, expected: float) -> None:
    assert roundest(low, high) == expected


@pytest.mark.parametrize(
    ("low", "high", "largest", "expected"),
    [
        (9.79, 10.002, 10.5, 10.0),
        (9.998, 10.31, 10.5, 10.0),
        (-0.03, 0.16, 10.5, 0.0),
        (0.398, 0.46, 3.0, 0.43),
        (0.39, 0.405, 3.0, 0.4),
        # Every third gap as wide as this one would hold 0, or a whole number.
        (-0.03, 0.16, 0.5, 0.1),
        (0.62, 1.02, 1.5, 0.8),
        # What was shown itself is no border.
        (0.0, 1.0, 10.0, 0.5),
        (10.0, 12.0, 15.0, 11.0),
    ],
)
def test_a_value_near_an_end_is_taken_if_it_is_too_round_to_be_there_by_chance(
    low: float, high: float, largest: float, expected: float
) -> None:
    assert roundest(low, high, largest) == expected


def test_how_much_a_zero_says_depends_on_the_largest_value() -> None:
    gaps = [(-0.03, 0.16), (9.79, 10.002)]
    assert shared_thresholds(gaps) == [0.0, 10.0]
    assert shared_thresholds(gaps[:1]) == [0.1]
    assert shared_thresholds(gaps[:1], 10.5) == [0.0]


@given(_GAPS)
def test_no_rounder_value_stands_in_the_inner_part_of_a_gap(gap: tuple[float, float]) -> None:
    low, high = gap
    threshold = roundest(low, high)
    half = high / 2 - low / 2
    one_digit = [
        value
        for exponent in range(-310, 39)
        for multiple in range(-9, 10)
        if abs((value := float(f"{multiple}e{exponent}")) - (low + half)) < 0.59 * half
    ]
    if one_digit:
        assert _digits(threshold) <= 1


@given(st.floats(1e-30, 1e30), st.floats(0.01, 100))
def test_an_open_end_is_no_obstacle(low: float, share: float) -> None:
    assert low <= shared_thresholds([(low, math.inf)])[0] < math.inf
    assert low <= shared_thresholds([(low, math.inf), (low, low * (1 + share))])[1]


def test_no_gaps_have_no_thresholds() -> None:
    assert shared_thresholds([]) == []
