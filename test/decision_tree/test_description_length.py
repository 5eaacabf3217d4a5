"""How many bits it takes to say what was done."""

from __future__ import annotations

import math

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.decision_tree.description_length import shortest_description
from rebt_ros.decision_tree.encoding import FEATURES_ALONE
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.schema import Feature, FeatureKind

NUMBER, SWITCH = Feature("x"), Feature("on", FeatureKind.BINARY)
PLAIN = FitOptions(vocabulary=FEATURES_ALONE)


def test_a_split_on_a_number_also_names_the_row_of_its_threshold() -> None:
    actions = [0] * 8 + [1] * 8
    by_number = fit(
        some.table([[code] for code in range(16)], actions, [0] * len(actions), (NUMBER,)), PLAIN
    )
    by_switch = fit(
        some.table([[code] for code in actions], actions, [0] * len(actions), (SWITCH,)), PLAIN
    )
    # A split and two leaves say what they are, the split its only column, each leaf its action.
    assert shortest_description(by_switch).bits == pytest.approx(3 + 0 + 2)
    assert shortest_description(by_number).bits == pytest.approx(3 + 0 + 2 + math.log2(16))


def test_a_single_mistake_is_an_exception_and_no_branch() -> None:
    actions = [0] * 20 + [1] + [0] * 19
    said = shortest_description(
        fit(
            some.table([[code] for code in range(40)], actions, [0] * len(actions), (NUMBER,)),
            PLAIN,
        )
    )
    assert said.exceptions == 1
    assert said.exception_bits == pytest.approx(math.log2(40))
    assert said.bits == pytest.approx(2 + said.exception_bits)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 2)), min_size=1, max_size=60))
def test_no_description_is_longer_than_naming_the_exceptions_of_one_action(
    rows: list[tuple[int, int]],
) -> None:
    states, actions = [[float(x)] for x, _ in rows], [action for _, action in rows]
    said = shortest_description(
        fit(some.table(states, actions, [0] * len(actions), (NUMBER,)), PLAIN)
    )
    shown = max(len(set(actions)), 2)
    most = max(map(actions.count, set(actions)))
    assert 0 < said.bits <= 1 + math.log2(shown) + (len(rows) - most) * said.exception_bits + 1e-9
    assert 0 <= said.exceptions <= len(rows) - most
