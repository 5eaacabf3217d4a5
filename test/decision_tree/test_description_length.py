"""How many bits it takes to say what was done."""

from __future__ import annotations

import math

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.decision_tree.description_length import border_bits, shortest_description
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


def test_round_borders_take_fewer_bits() -> None:
    def bits(*borders: float) -> float:
        states = [[border + side] for border in borders for side in (-1e-4, 1e-4)] * 3 + [[100.0]]
        actions = [sum(x > border for border in borders) % 2 for (x,) in states]
        table = some.table(states, actions, [0] * len(actions), (NUMBER,))
        fitted = fit(table, PLAIN)
        return border_bits(fitted.readable_explained(table).tree, table)

    assert bits(0.0) == 0
    assert bits(10.0) == pytest.approx(math.log2(10))
    assert bits(20.0) == pytest.approx(math.log2(10))
    assert bits(9.37) == pytest.approx(math.log2(10_000))
    assert bits(9.37, 20.0) == pytest.approx(math.log2(10_000) + math.log2(10))


def test_a_tree_without_thresholds_has_no_borders() -> None:
    table = some.table([[0], [1]] * 5, [0, 1] * 5, [0] * 10, (SWITCH,))
    assert border_bits(fit(table, PLAIN).readable_explained(table).tree, table) == 0
