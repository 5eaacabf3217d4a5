"""Where two trees differ is where they do."""

from __future__ import annotations

import numpy as np
import rule_examples as written
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import executable
from rebt_ros.logic.conditions import Difference, WeightedSum
from rebt_ros.verification.comparing import compare
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


def test_differences_that_no_numbers_have_are_left_out() -> None:
    less = some.at_most(some.DIFFERENCE, 0.0)
    far, low = ~some.at_most("distance", 0.5), some.at_most("battery", 0.3)
    mine = nodes.Selector((some.when(less, far, low, then=some.ACTIONS[0]), some.ACTIONS[1]))
    [found] = compare(some.learned(mine), some.learned(some.ACTIONS[1]))
    assert found.divergences == ()
    assert found.exact
