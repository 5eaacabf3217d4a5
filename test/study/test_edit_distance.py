from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import milp
from strategies import (
    action,
    at_most,
    condition_nodes,
    last_actions,
    literals,
    previous_actions,
    trees,
)

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
)
from rebt_ros.study.edit_distance import bounds as bounds_module
from rebt_ros.study.edit_distance import canonical, integer_program
from rebt_ros.study.edit_distance.bounds import (
    Bounds,
    distance_bounds,
)
from rebt_ros.study.edit_distance.labelled_tree import LabelledTree, labelled
from rebt_ros.study.edit_distance.networkx_measure import (
    MeasureError,
    NetworkxMeasure,
)

GO, TURN = action("go"), action("turn")
FAR = nodes.Condition(at_most("distance", 0.5))
AFTER_GO = nodes.Condition(Literal(LastActionIs("go", ("turn",))))

PAIR = LabelledTree(("Sequence", "Action go"), (-1, 0))
#: So large that networkx needs minutes for two of them.
LARGE = LabelledTree(("Sequence",) * 400, (-1, *(node // 3 for node in range(399))))


@st.composite
def labelled_trees(draw: st.DrawFn, largest: int = 5, labels: str = "abc") -> LabelledTree:
    size = draw(st.integers(1, largest))
    parents = [draw(st.integers(0, node - 1)) for node in range(1, size)]
    drawn = draw(st.lists(st.sampled_from(labels), min_size=size, max_size=size))
    return LabelledTree(tuple(drawn), (-1, *parents))


def graph(tree: LabelledTree) -> nx.DiGraph:
    built = nx.DiGraph()
    for node, label in enumerate(tree.labels):
        built.add_node(node, label=label)
    built.add_edges_from(
        (parent, child) for child, parent in enumerate(tree.parents) if parent >= 0
    )
    return built


def exact_distance(first: LabelledTree, second: LabelledTree) -> float:
    return float(
        nx.graph_edit_distance(
            graph(first),
            graph(second),
            node_match=lambda one, other: one["label"] == other["label"],
        )
    )


def cost(first: LabelledTree, second: LabelledTree, kept: tuple[tuple[int, int], ...]) -> int:
    """Of the edit path that keeps these nodes, counted operation by operation."""
    images = dict(kept)
    assert len(images) == len(set(images.values())) == len(kept)
    assert set(images) <= set(range(len(first.labels)))
    assert set(images.values()) <= set(range(len(second.labels)))
    substituted = sum(first.labels[node] != second.labels[image] for node, image in kept)
    deleted = len(first.labels) - len(kept)
    inserted = len(second.labels) - len(kept)
    edges = {(parent, child) for child, parent in enumerate(first.parents) if parent >= 0}
    others = {(parent, child) for child, parent in enumerate(second.parents) if parent >= 0}
    moved = {(images.get(parent, -1), images.get(child, -1)) for parent, child in edges}
    kept_edges = len(moved & others)
    return substituted + deleted + inserted + len(edges) + len(others) - 2 * kept_edges


def shuffled(tree: LabelledTree, draw: st.DrawFn) -> LabelledTree:
    """The same tree, the children of each node in any order."""
    children: dict[int, list[int]] = {}
    for child, parent in enumerate(tree.parents):
        children.setdefault(parent, []).append(child)
    labels: list[str] = []
    parents: list[int] = []

    def add(node: int, parent: int) -> None:
        place = len(labels)
        labels.append(tree.labels[node])
        parents.append(parent)
        for child in draw(st.permutations(children.get(node, []))):
            add(child, place)

    add(0, -1)
    return LabelledTree(tuple(labels), tuple(parents))


def runs(process: int) -> bool:
    """Whether the process is there and not only waits for its parent to notice its end."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


# --- labelled trees ---------------------------------------------------------------------------


def test_labels_are_kinds_actions_and_features() -> None:
    tree = nodes.Selector(
        (
            nodes.Sequence((FAR, GO), memory=True),
            nodes.Repeater((TURN,)),
            nodes.Parallel((nodes.ParallelSelector((GO, TURN)),)),
        )
    )
    assert labelled(tree) == LabelledTree(
        (
            "Selector",
            "Sequence",
            "Condition distance",
            "Action go",
            "Repeater",
            "Action turn",
            "Parallel",
            "ParallelSelector",
            "Action go",
            "Action turn",
        ),
        (-1, 0, 1, 1, 0, 4, 0, 6, 7, 7),
    )


@pytest.mark.parametrize(
    "literal",
    [
        at_most("distance", 0.1),
        ~at_most("distance", 0.2),
        Literal(Interval("distance", 0.1, 0.2)),
        Literal(IsTrue("distance")),
        Literal(HasCategory("distance", "far")),
    ],
)
def test_a_condition_is_known_by_its_feature_alone(literal: Literal) -> None:
    assert labelled(nodes.Condition(literal)) == LabelledTree(("Condition distance",), (-1,))


def test_a_child_takes_its_inverters_place() -> None:
    tree = nodes.Inverter(nodes.Sequence((nodes.Inverter(nodes.Inverter(FAR)), GO)))
    assert labelled(tree) == labelled(nodes.Sequence((FAR, GO)))


def test_conditions_on_the_last_action_are_left_out_with_groups_of_nothing_else() -> None:
    alone = nodes.Selector((AFTER_GO, nodes.Inverter(AFTER_GO)))
    assert labelled(nodes.Sequence((AFTER_GO, alone, GO))) == labelled(nodes.Sequence((GO,)))
    assert labelled(nodes.Parallel((alone,))) is None


@given(trees())
def test_what_is_compared_is_what_is_neither_inverter_nor_about_what_was_done_before(
    tree: nodes.Node,
) -> None:
    def left(node: nodes.Node) -> int:
        if isinstance(node, nodes.Condition):
            return not isinstance(node.literal.condition, PreviousActionIs | LastActionIs)
        below = sum(map(left, nodes.children(node)))
        counts = isinstance(node, nodes.Action) or (below and not isinstance(node, nodes.Inverter))
        return below + bool(counts)

    found = labelled(tree)
    assert (0 if found is None else len(found)) == left(tree)


@given(trees(), literals(last_actions() | previous_actions))
def test_wrapping_in_inverters_and_adding_conditions_on_the_history_changes_nothing(
    tree: nodes.Node, literal: Literal
) -> None:
    def disguised(node: nodes.Node) -> nodes.Node:
        match node:
            case nodes.Inverter(child=child):
                return disguised(child)
            case nodes.Action() | nodes.Condition():
                return nodes.Inverter(node)
            case _:
                below = (nodes.Condition(literal), *map(disguised, node.children))
                return type(node)(below)

    assert labelled(disguised(tree)) == labelled(tree)


@pytest.mark.parametrize(
    ("labels", "parents"),
    [((), ()), (("a",), (0,)), (("a", "b"), (-1,)), (("a", "b"), (-1, 1)), (("a", "b"), (-1, -1))],
)
def test_what_is_no_tree_is_refused(labels: tuple[str, ...], parents: tuple[int, ...]) -> None:
    with pytest.raises(ValueError):
        LabelledTree(labels, parents)


# --- bounds -----------------------------------------------------------------------------------


@settings(max_examples=150)
@given(labelled_trees(), labelled_trees())
def test_small_trees_have_the_exact_distance(first: LabelledTree, second: LabelledTree) -> None:
    exact = exact_distance(first, second)
    assert distance_bounds(first, second) == Bounds(int(exact), int(exact))


@settings(max_examples=150)
@given(labelled_trees(), labelled_trees())
def test_without_the_integer_program_the_distance_lies_between_the_bounds(
    first: LabelledTree, second: LabelledTree
) -> None:
    bounds = _bounds_with(first, second, _LARGEST_LINEAR=0, _MOST_STEPS=2)
    assert bounds.lower <= exact_distance(first, second) <= bounds.upper


@settings(max_examples=50)
@given(labelled_trees(), labelled_trees())
def test_of_large_trees_the_distance_lies_between_the_bounds(
    first: LabelledTree, second: LabelledTree
) -> None:
    bounds = _bounds_with(first, second, _LARGEST_RELAXATION=0)
    assert bounds.lower <= exact_distance(first, second) <= bounds.upper


@settings(max_examples=50)
@given(labelled_trees(8), labelled_trees(8))
def test_the_integer_program_alone_agrees_with_everything_together(
    first: LabelledTree, second: LabelledTree
) -> None:
    assert _bounds_with(first, second, _MOST_STEPS=0) == distance_bounds(first, second)


def test_the_solver_gets_indices_that_old_versions_of_scipy_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    solved = []

    def spied(*args: Any, **kwargs: Any) -> Any:
        solved.append(kwargs["constraints"].A)
        return milp(*args, **kwargs)

    monkeypatch.setattr(integer_program, "milp", spied)
    first, second = LabelledTree(("a", "a"), (-1, 0)), LabelledTree(("a", "b"), (-1, 0))
    assert _bounds_with(first, second, _MOST_STEPS=0).upper > 0
    assert {one.dtype for matrix in solved for one in (matrix.indices, matrix.indptr)} == {
        np.dtype(np.int32)
    }


def _bounds_with(first: LabelledTree, second: LabelledTree, **limits: int) -> Bounds:
    """The bounds under other limits of the work."""
    with pytest.MonkeyPatch.context() as patch:
        for name, limit in limits.items():
            patch.setattr(bounds_module, name, limit)
        bounds_module._compared.cache_clear()
        found = distance_bounds(first, second)
    bounds_module._compared.cache_clear()
    return found


@given(labelled_trees(12), st.data())
def test_the_order_of_children_does_not_count(tree: LabelledTree, data: st.DataObject) -> None:
    other = data.draw(labelled_trees(8))
    same = shuffled(tree, data.draw)
    assert distance_bounds(tree, same) == Bounds(0, 0)
    assert distance_bounds(tree, other) == distance_bounds(same, other)


@settings(max_examples=50)
@given(labelled_trees(12), labelled_trees(12))
def test_the_distance_is_the_same_both_ways(first: LabelledTree, second: LabelledTree) -> None:
    there = distance_bounds(first, second)
    bounds_module._compared.cache_clear()
    assert distance_bounds(second, first) == there


@settings(max_examples=50)
@given(labelled_trees(7), labelled_trees(7))
def test_only_equal_trees_have_distance_0(first: LabelledTree, second: LabelledTree) -> None:
    equal = nx.is_isomorphic(
        graph(first), graph(second), node_match=lambda one, other: one == other
    )
    assert (distance_bounds(first, second).upper == 0) is equal


@settings(max_examples=50)
@given(labelled_trees(6), labelled_trees(6), labelled_trees(6))
def test_a_detour_is_never_shorter(
    first: LabelledTree, second: LabelledTree, third: LabelledTree
) -> None:
    straight = distance_bounds(first, third)
    detour = distance_bounds(first, second).upper + distance_bounds(second, third).upper
    assert straight.lower <= detour


@settings(max_examples=100)
def node_mapping(first: LabelledTree, second: LabelledTree) -> tuple[tuple[int, int], ...]:
    """The nodes that the edit path keeps which costs the upper bound, each with its image."""
    one, other = canonical.canonical(first), canonical.canonical(second)
    small, large = bounds_module._ordered(one, other)
    images = bounds_module._compared(small, large)[1]
    trees = (first, second) if small is one else (second, first)
    of_small, of_large = (canonical._breadth_first(tree)[0] for tree in trees)
    pairs = [(of_small[node], of_large[image]) for node, image in enumerate(images)]
    return tuple(sorted(pairs if small is one else [(image, node) for node, image in pairs]))


@given(labelled_trees(14), labelled_trees(14))
@example(LARGE, LabelledTree(("Selector",) * 700, (-1, *range(699))))
def test_the_mapping_costs_the_upper_bound(first: LabelledTree, second: LabelledTree) -> None:
    bounds = distance_bounds(first, second)
    assert bounds.lower <= bounds.upper
    assert cost(first, second, node_mapping(first, second)) == bounds.upper
    assert cost(second, first, node_mapping(second, first)) == bounds.upper


def test_every_kind_of_node_has_distance_0_to_itself_and_more_to_others() -> None:
    leaves = (FAR, GO)
    kinds = [
        *(nodes.Sequence(leaves), nodes.Selector(leaves), nodes.Parallel(leaves)),
        *(nodes.ParallelSelector(leaves), nodes.Repeater(leaves)),
    ]
    compared = [tree for kind in kinds if (tree := labelled(kind)) is not None]
    assert [[distance_bounds(one, other).upper for one in compared] for other in compared] == [
        [int(row != column) for column in range(5)] for row in range(5)
    ]


@given(trees(st.one_of(condition_nodes, st.sampled_from((GO, TURN)))))
def test_every_behavior_tree_has_distance_0_to_itself(tree: nodes.Node) -> None:
    found = labelled(tree)
    if found is not None:
        assert distance_bounds(found, found) == Bounds(0, 0)


def test_large_trees_take_seconds_at_most() -> None:
    other = LabelledTree(("Sequence",) * 400, (-1, *(node // 2 for node in range(399))))
    start = time.monotonic()
    bounds = distance_bounds(LARGE, other)
    assert time.monotonic() - start < 60
    assert 0 < bounds.lower <= bounds.upper < 1000


# --- networkx ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measure() -> Iterator[NetworkxMeasure]:
    with NetworkxMeasure() as kept:
        yield kept


@settings(max_examples=50)
@given(labelled_trees(6), labelled_trees(6))
def test_networkx_is_never_below_the_bounds(
    measure: NetworkxMeasure, first: LabelledTree, second: LabelledTree
) -> None:
    heuristic = measure.distance(first, second, 60)
    graphs = nx.optimize_graph_edit_distance(
        graph(first), graph(second), node_match=lambda one, other: one == other
    )
    assert heuristic == next(graphs)
    assert heuristic >= distance_bounds(first, second).upper


def test_a_pair_that_takes_too_long_is_missed_and_the_next_one_is_not() -> None:
    with NetworkxMeasure() as measure:
        assert measure.distance(PAIR, PAIR, 60) == 0
        process = measure.id
        assert process is not None
        start = time.monotonic()
        assert measure.distance(LARGE, LARGE, 0.2) is None
        assert time.monotonic() - start < 10
        assert not runs(process)
        assert measure.distance(PAIR, PAIR, 60) == 0
        process = measure.id
    assert process is not None
    assert not runs(process)


def test_the_time_limit_holds_in_any_thread() -> None:
    found: list[float | None] = []

    def measure_once() -> None:
        with NetworkxMeasure() as measure:
            found.append(measure.distance(LARGE, LARGE, 0.2))

    thread = threading.Thread(target=measure_once)
    thread.start()
    thread.join(60)
    assert found == [None]


def test_a_process_that_was_killed_is_an_error_and_is_replaced() -> None:
    with NetworkxMeasure() as measure:
        assert measure.distance(PAIR, PAIR, 60) == 0
        assert measure.id is not None
        os.kill(measure.id, 9)
        with pytest.raises(MeasureError, match="code -9"):
            measure.distance(PAIR, PAIR, 60)
        assert measure.distance(PAIR, PAIR, 60) == 0


def test_the_process_ends_with_the_one_that_started_it(tmp_path: Path) -> None:
    started = os.fork()
    if started == 0:
        # Leaves at once, with a computation running.
        measure = NetworkxMeasure()
        measure.distance(PAIR, PAIR, 60)
        (tmp_path / "id").write_text(str(measure.id))
        threading.Timer(0.2, os._exit, (0,)).start()
        measure.distance(LARGE, LARGE, 60)
        os._exit(1)
    assert os.waitpid(started, 0)[1] == 0
    process = int((tmp_path / "id").read_text())
    deadline = time.monotonic() + 30
    while runs(process) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not runs(process)
