"""Scores of simulated subtrees: the least distance of each pruning level."""

from __future__ import annotations

from statistics import median

import hypothesis.strategies as st
from hypothesis import given, settings
from strategies import action, at_most, trees, when

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import LastActionIs, Literal
from rebt_ros.study.edit_distance.bounds import distance_bounds
from rebt_ros.study.edit_distance.labelled_tree import labelled
from rebt_ros.study.modes import under_root
from rebt_ros.study.scores import ComparedTree, Distances, comparable, score

GO, TURN, WAIT = action("go"), action("turn"), action("wait")
TIRED = at_most("battery", 0.2)


def compared(*subtrees: nodes.Node) -> tuple[ComparedTree, ...]:
    return comparable(subtrees)


@settings(max_examples=40)
@given(simulated=trees(), levels=st.lists(st.lists(trees(), max_size=5), min_size=1, max_size=4))
def test_a_score_is_the_least_distance_whatever_was_excluded(
    simulated: nodes.Node, levels: list[list[nodes.Node]]
) -> None:
    tree = labelled(simulated)
    generated = [compared(*level) for level in levels]
    if tree is None or not any(generated):
        return
    distances = Distances()
    found = score(tree, generated, distances)
    each = [[distance_bounds(tree, one.tree) for one in level] for level in generated if level]
    minima = [min(bounds.upper for bounds in level) for level in each]
    assert found.minimum == min(minima)
    assert found.median == median(minima)
    assert found.levels == len(minima)
    assert found.minimum_at_least <= found.minimum
    assert found.minimum_at_least <= min(bounds.lower for level in each for bounds in level)
    assert distances.compared == sum(map(len, generated))
    assert distances.measured + distances.excluded <= distances.compared


def test_of_several_nearest_subtrees_the_smallest_counts_and_of_these_the_first() -> None:
    simulated = labelled(nodes.Sequence((GO, TURN)))
    assert simulated is not None
    # One node too many, or one too few, with its edge: both have distance 2.
    larger, smaller = nodes.Sequence((GO, TURN, WAIT)), nodes.Sequence((GO,))
    other = nodes.Sequence((TURN,))
    found = score(simulated, [compared(larger), compared(larger, smaller, other)], Distances())
    assert (found.minimum, found.nodes, found.level) == (2, 2, 1)
    assert found.found == "Sequence(go)"


def test_repeaters_and_psa_nodes_of_the_nearest_subtree_are_counted() -> None:
    tree = nodes.Repeater((GO, nodes.ParallelSelector((TURN, WAIT))))
    simulated = labelled(tree)
    assert simulated is not None
    found = score(simulated, [compared(GO), compared(tree)], Distances())
    assert (found.minimum, found.repeaters, found.psa) == (0, 1, 1)
    assert found.median == (0 + distance_bounds(simulated, compared(GO)[0].tree).upper) / 2
    assert found.exact_levels == found.levels == 2


def test_subtrees_that_are_compared_alike_are_compared_once() -> None:
    last = Literal(LastActionIs("wait"))
    once = compared(when(TIRED, then=GO), when(last, TIRED, then=GO), when(~TIRED, then=GO))
    assert [one.node for one in once] == [when(TIRED, then=GO)]


def test_the_subtrees_of_a_learned_tree_stand_under_its_root() -> None:
    rules = (when(TIRED, then=GO), TURN)
    assert under_root(nodes.Parallel(rules)) == rules
    assert under_root(nodes.Selector(rules)) == rules
    for single in (GO, nodes.ParallelSelector((GO, TURN)), when(TIRED, then=GO)):
        assert under_root(single) == (single,)
