"""A list of branches does in every box what the sweep through its nodes says."""

from __future__ import annotations

import numpy as np
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import Literal
from rebt_ros.verification import sweep as sweeping
from rebt_ros.verification.branches import branches_of
from rebt_ros.verification.grid import Grid
from rebt_ros.verification.proof import grid_of
from rebt_ros.verification.sweep import Results, Sweep, Ticks, sweep

_literals = some.literals()
_conditions = _literals.map(nodes.Condition)


def _joined(tests: st.SearchStrategy[nodes.Node]) -> st.SearchStrategy[nodes.Node]:
    several = st.lists(tests, min_size=1, max_size=3).map(tuple)
    return st.one_of(several.map(nodes.Sequence), several.map(nodes.Selector))


_tests = st.recursive(
    st.one_of(_conditions, _conditions.map(nodes.Inverter)), _joined, max_leaves=6
)
_actions = st.sampled_from(some.ACTIONS)
_groups = st.lists(_actions, min_size=1, max_size=3).map(tuple)
_acting = st.one_of(_actions, _groups.map(nodes.Parallel), _groups.map(nodes.ParallelSelector))


def _asked(acting: st.SearchStrategy[nodes.Node]) -> st.SearchStrategy[nodes.Node]:
    return st.builds(
        lambda tests, last: nodes.Sequence((*tests, last)),
        st.lists(_tests, min_size=1, max_size=2),
        acting,
    )


_lists = st.recursive(
    st.one_of(_acting, _asked(_acting)),
    lambda inner: st.one_of(
        st.lists(inner, min_size=1, max_size=4).map(lambda all_of: nodes.Selector(tuple(all_of))),
        _asked(inner),
    ),
    max_leaves=5,
)


def _leaf_of_each_cell(done: Sweep, grid: Grid, cells: np.ndarray) -> list[set[tuple[int, int]]]:
    """Leaf and origin of all boxes that have some combinations of cells."""
    inside = np.ones((len(cells), done.boxes.shape[1]), dtype=bool)
    for place, field in enumerate(grid.fields):
        inside &= field.cells_of(done.boxes).T[cells[:, place]]
    return [
        set(zip(done.commanding[its].tolist(), done.origin[its].tolist(), strict=True))
        for its in inside
    ]


@given(_lists, st.integers(0, 2**32 - 1), st.sampled_from(Results), _literals)
def test_it_acts_as_the_sweep_through_its_nodes_says(
    tree: nodes.Node, seed: int, results: Results, split: Literal
) -> None:
    assert branches_of(tree) is not None
    learned = some.learned(tree)
    grid = grid_of(learned, [tree], [split])
    # Boxes of a start that share out all states.
    start = np.concatenate([grid.within(grid.everything(), one) for one in (split, ~split)], axis=1)
    found = sweep(tree, grid, results, Ticks.FIRST, start)
    expected = sweeping._Sweeper(tree, grid, results, Ticks.FIRST, False).run(start)
    random = np.random.default_rng(seed)
    cells = np.stack([random.integers(field.cells, size=200) for field in grid.fields], axis=1)
    both = [_leaf_of_each_cell(done, grid, cells) for done in (found, expected)]
    assert found.leaves == expected.leaves
    assert all(len(one) == 1 for one in both[0])
    assert both[0] == both[1]


def test_boxes_are_about_as_few_as_the_rules() -> None:
    near = [some.at_most("distance", value) for value in (0.1, 0.2, 0.3, 0.4)]
    far = [some.at_most("battery", value) for value in (0.1, 0.2, 0.3, 0.4)]
    rules = tuple(
        nodes.Sequence((nodes.Condition(one), nodes.Condition(other), some.ACTIONS[place % 2]))
        for place, one in enumerate(near)
        for other in far
    )
    tree = nodes.Selector((*rules, some.ACTIONS[2]))
    grid = grid_of(some.learned(tree), [tree])
    assert sweep(tree, grid, Results.AT_ONCE, Ticks.FIRST).boxes.shape[1] <= 25


def test_other_trees_are_no_lists_of_branches() -> None:
    go, low = some.ACTIONS[0], nodes.Condition(some.at_most("battery", 0.2))
    for tree in (
        nodes.Sequence((low, go), memory=True),
        nodes.Selector((go, low), memory=True),
        nodes.Repeater((low, go)),
        nodes.Sequence((go, low)),
        nodes.Sequence((low, go, some.ACTIONS[1])),
        nodes.Parallel((nodes.Sequence((low, go)), go)),
        nodes.Inverter(go),
        nodes.Selector((low, go)),
    ):
        assert branches_of(tree) is None
