"""Pictures tell what a tree is, not which object it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Suggestion, SuggestionKind
from rebt_ros.behavior_tree.wording import Kind, Wording
from rebt_ros.drawing.dot import render_dot
from rebt_ros.drawing.svg import render_svg
from rebt_ros.drawing.text import render_text
from rebt_ros.drawing.tree_picture import behavior_tree_page
from rebt_ros.learning.attaching import accept
from rebt_ros.learning.options import LearnOptions, PsaChoice

GO, GRASP, TURN, WAIT = some.ACTIONS
NEAR = nodes.Condition(some.at_most("distance", 0.3))
RULES = nodes.Selector((nodes.Sequence((NEAR, TURN)), GO))

lat_sequences = st.builds(
    lambda steps: nodes.Sequence(tuple(steps), memory=True),
    st.lists(
        st.one_of(
            st.just(NEAR),
            st.sampled_from(some.ACTIONS),
            st.just(nodes.Repeater((NEAR, GRASP, WAIT))),
            st.just(nodes.ParallelSelector((GO, GRASP))),
        ),
        min_size=2,
        max_size=5,
    ),
)


def lat_suggestion(subtree: nodes.Node) -> Suggestion:
    return Suggestion("lat-sequence-1", SuggestionKind.LAT_SEQUENCE, 3, subtree)


@st.composite
def with_suggestion_attached(draw: st.DrawFn) -> LearnedTree:
    """As learning attaches a LAT Sequence, in the default or in the paper's mode."""
    options = replace(
        draw(st.sampled_from((LearnOptions(), LearnOptions.paper()))),
        attach=("lat-sequence-1",),
        psa_choice=draw(st.sampled_from((None, *PsaChoice))),
    )
    suggestions = (lat_suggestion(draw(lat_sequences)),)
    tree, marked = accept(RULES, suggestions, options)
    return replace(some.learned(tree), suggestions=marked)


@pytest.mark.parametrize(
    "render",
    [
        render_svg,
        render_dot,
        render_text,
        behavior_tree_page,
        lambda learned: render_text(learned, color=True),
    ],
)
@settings(max_examples=40)
@given(learned=st.one_of(some.learned_trees(), with_suggestion_attached()))
def test_a_tree_that_was_saved_and_loaded_looks_the_same(
    render: Callable[[LearnedTree], object], learned: LearnedTree
) -> None:
    assert render(learned) == render(loads(dumps(learned)))


@given(with_suggestion_attached())
def test_an_attached_lat_sequence_looks_like_one(learned: LearnedTree) -> None:
    wording = Wording(learned)
    [suggestion] = learned.suggestions
    kinds = [wording.kind(node) for node in nodes.walk(learned.tree)]
    assert suggestion.attached
    assert kinds.count(Kind.LAT_SEQUENCE) == 1
    assert wording.kind(suggestion.subtree) is Kind.LAT_SEQUENCE


def test_other_sequences_do_not_look_like_lat_sequences() -> None:
    steps = (GO, TURN)
    suggestion = lat_suggestion(nodes.Sequence(steps, memory=True))
    learned = replace(some.learned(nodes.Sequence(steps)), suggestions=(suggestion,))
    wording = Wording(learned)
    assert wording.kind(learned.tree) is Kind.CONTROL
    assert wording.kind(nodes.Sequence((TURN, GO), memory=True)) is Kind.CONTROL
    assert wording.kind(nodes.Sequence((*steps, WAIT), memory=True)) is Kind.CONTROL
