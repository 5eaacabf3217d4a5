"""Which rows have equal states, and which numbers are equal."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration.equal_states import codes_of_numbers, codes_of_states


@given(st.lists(st.integers(0, 6) | st.integers(0, 2**62), max_size=30))
def test_codes_are_equal_where_numbers_are(numbers: list[int]) -> None:
    codes = codes_of_numbers(np.array(numbers, dtype=np.int64)).tolist()
    assert all(0 <= code < 2 * len(numbers) for code in codes)
    assert len(set(zip(codes, numbers, strict=True))) == len(set(codes)) == len(set(numbers))


def test_what_is_missing_equals_what_is_missing() -> None:
    states = np.array([[0.0, np.nan], [-0.0, -np.nan], [0.0, 1.0], [1.0, 0.0]])
    first, second, *others = codes_of_states(states).tolist()
    assert first == second
    assert len({first, *others}) == 3
