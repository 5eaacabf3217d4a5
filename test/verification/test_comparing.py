"""Where two trees differ is where they do."""

from __future__ import annotations

import numpy as np
import pytest
import rule_examples as written
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import executable
from rebt_ros.logic.conditions import Difference, WeightedSum
from rebt_ros.verification import comparing
from rebt_ros.verification.comparing import compare
from rebt_ros.verification.errors import TooManyPartsError
from rebt_ros.verification.grid import Boxes, Grid

_SAMPLE = 200


def _boxes_with(boxes: Boxes, grid: Grid, states: written.Everything, row: int) -> np.ndarray:
    """Which boxes have a state, shape (boxes,)."""
    state = dict(zip(written.NAMES, states.values[row].tolist(), strict=True))
    inside = np.ones(boxes.shape[1], dtype=bool)
    for field in grid.fields:
        match field.quantity:
            case None:
                cell = grid.cell_of(states.histories[states.history[row]])
            case Difference(minuend=minuend, subtrahend=subtrahend):
                cell = field.cell(state[minuend] - state[subtrahend])
            case WeightedSum(terms=((one, weight), (other, its))):
                cell = field.cell(weight * state[one] + its * state[other])
            case name:
                cell = field.cell(state[name])
        inside &= field.cells_of(boxes)[:, cell]
    return inside


@given(some.trees(), some.trees(), st.integers(0, 2**32 - 1))
def test_a_state_is_in_a_difference_exactly_where_two_trees_differ(
    mine: nodes.Node, other: nodes.Node, seed: int
) -> None:
    history = written.looks_back(mine) or written.looks_back(other)
    states = written.everything(history, fine=True)
    first, second = (written.commands(executable(tree), states) for tree in (mine, other))
    # Trees without any action have no channel.
    found = next(iter(compare(some.learned(mine), some.learned(other))), None)
    rows = np.random.default_rng(seed).integers(len(states.values), size=_SAMPLE)
    for row in rows.tolist():
        wanted = tuple(
            some.ACTIONS[code] if code >= 0 else None for code in (first[row], second[row])
        )
        there = {
            (one.mine, one.other)
            for one in (found.divergences if found else ())
            if _boxes_with(one.boxes, found.grid, states, row).any()
        }
        assert there == (set() if wanted[0] == wanted[1] else {wanted})


@settings(max_examples=60, deadline=None)
@given(some.rule_trees(), some.rule_trees(), st.integers(0, 60), st.lists(some.states, max_size=5))
def test_where_branches_overlap_too_much_what_is_found_is_true_and_all_is_said_of_all_only(
    mine: nodes.Node, other: nodes.Node, most: int, shown: list[tuple[float, ...]]
) -> None:
    pair = some.learned(mine), some.learned(other)
    tables = [some.table(shown, [0] * len(shown))] if shown else []
    everything = compare(*pair, tables)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(comparing, "_all_differing", _too_many_parts)
        patched.setattr(comparing, "_MOST_SPLIT", most)
        found = compare(*pair, tables)
    for whole, part in zip(everything, found, strict=True):
        known = {(one.mine, one.other): one for one in whole.divergences}
        its = {(one.mine, one.other): one for one in part.divergences}
        assert its.keys() <= known.keys()
        assert {key: known[key].rows for key in its} == {key: one.rows for key, one in its.items()}
        told = {key for key, one in known.items() if one.rows}
        assert told <= its.keys()
        if part.complete and part.exact and whole.exact:
            assert its.keys() == known.keys()
        for key, one in its.items():
            within = known[key].boxes
            # Each box shares cells of every field with what was found by looking at all.
            for box in one.boxes.T:
                shared = within & box[:, np.newaxis]
                assert any(
                    all(shared[field.words, place].any() for field in part.grid.fields)
                    for place in range(within.shape[1])
                )


def _too_many_parts(*_: object) -> None:
    raise TooManyPartsError


def test_differences_that_no_numbers_have_are_left_out() -> None:
    less = some.at_most(some.DIFFERENCE, 0.0)
    far, low = ~some.at_most("distance", 0.5), some.at_most("battery", 0.3)
    mine = nodes.Selector((some.when(less, far, low, then=some.ACTIONS[0]), some.ACTIONS[1]))
    [found] = compare(some.learned(mine), some.learned(some.ACTIONS[1]))
    assert found.divergences == ()
    assert found.exact
