"""What routines are found by: moments, programs, their likelihood, the search's moves, guards."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.arrays import BoolArray, FloatArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import States, triggered
from rebt_ros.beyond_the_paper.routines.corpus import LONGEST_WORD, Corpus, corpus
from rebt_ros.beyond_the_paper.routines.guards import Guard, guard, holds
from rebt_ros.beyond_the_paper.routines.likelihood import _PRICE, Model, Models
from rebt_ros.beyond_the_paper.routines.moments import Word, moments
from rebt_ros.beyond_the_paper.routines.moves import MOST_STATES, neighbours
from rebt_ros.beyond_the_paper.routines.program import (
    Program,
    Routine,
    Step,
    Stream,
    complexity,
    places,
    states_needed,
    tidy,
)
from rebt_ros.beyond_the_paper.routines.search import fold
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Condition, HasCategory, IsTrue, Literal, Threshold

X = Feature("x")
A, B, C, D = range(4)


def table_of(words: Sequence[Word]) -> DemonstrationTable:
    """Each word in a state of its own."""
    states = [[float(place)] for place, word in enumerate(words) for _ in word]
    return some.table(states, [one for word in words for one in word], features=(X,))


def corpus_of(*words: Word, times: int = 1) -> Corpus:
    return corpus(moments(table_of(words * times)))


def once(*steps: Step) -> Routine:
    return Routine(1, steps)


def sequence(*chosen: int) -> Stream:
    """A stream of one action after the other."""
    return (once(*((one,) for one in chosen)),)


# --- moments ------------------------------------------------------------------------------------


def words_of(table: DemonstrationTable) -> list[Word]:
    """The word of each moment, in their order."""
    shown = moments(table)
    return [shown.words[one] for one in shown.word.tolist()]


def test_rows_that_follow_each_other_in_one_state_are_one_moment() -> None:
    states = [[0.5], [0.5], [0.2], [0.5], [0.5], [0.5]]
    shown = moments(some.table(states, [A, B, C, A, B, A], features=(X,)))
    assert [shown.words[one] for one in shown.word.tolist()] == [(A, B), (C,), (A, B, A)]
    assert shown.states.tolist() == [[0.5], [0.2], [0.5]]
    assert (len(shown), shown.rows) == (3, 6)
    # The word with the most rows comes first.
    assert shown.words[0] == (A, B, A)


def test_no_moment_reaches_across_demonstrations() -> None:
    shown = some.table([[0.5]] * 4, [A, B, C, D], [0, 0, 1, 1], features=(X,))
    assert words_of(shown) == [(A, B), (C, D)]


def test_values_that_are_missing_in_both_rows_are_the_same() -> None:
    states = [[math.nan, 1.0], [math.nan, 1.0], [0.5, 1.0], [math.nan, 1.0]]
    shown = some.table(states, [A, B, C, D], features=(X, Feature("y")))
    assert words_of(shown) == [(A, B), (C,), (D,)]


def test_without_features_rows_of_one_stamp_are_one_moment() -> None:
    shown = some.table([[]] * 4, [A, B, C, D], features=())
    shown = replace(shown, stamps=np.array([5, 5, 6, 6]))
    assert words_of(shown) == [(A, B), (C, D)]


def test_what_was_before_does_not_tell_moments_apart() -> None:
    before = Feature("x[t-1]", index=0, lag=1)
    states = [[0.5, math.nan], [0.5, 0.5], [0.5, 0.5], [0.2, 0.5], [0.2, 0.2]]
    shown = some.table(states, [A, B, C, A, B], features=(X, before))
    assert words_of(shown) == [(A, B, C), (A, B)]
    assert np.array_equal(moments(shown).states[1], [0.2, 0.5])


@given(some.tables(max_rows=30))
def test_moments_hold_every_row_once_and_in_order(shown: DemonstrationTable) -> None:
    found = moments(shown)
    assert [one for word in words_of(shown) for one in word] == shown.chosen.tolist()
    assert found.rows == len(shown)
    assert found.counts.tolist() == np.bincount(found.word).tolist()
    assert len(set(found.words)) == len(found.words)


@given(st.lists(st.lists(st.integers(0, 3), min_size=1, max_size=12).map(tuple), min_size=1))
def test_a_corpus_reads_every_moment_of_few_words(words: list[Word]) -> None:
    read = corpus_of(*words)
    ended, cut = (sum(level[place].sum() for level in read.levels) for place in (2, 3))
    assert ended + cut == read.moments == len(words)
    assert cut == sum(len(word) > LONGEST_WORD for word in words)
    assert len(read.levels) <= LONGEST_WORD


# --- programs -----------------------------------------------------------------------------------

steps = st.lists(st.integers(0, 3), max_size=3, unique=True).map(tuple)
routines = st.builds(Routine, st.sampled_from((1, 1, 2, 3)), st.lists(steps, max_size=3).map(tuple))
streams = st.lists(routines, max_size=3).map(tuple)
untidy_programs = st.lists(streams, max_size=3).map(tuple)
programs = untidy_programs.map(tidy).filter(lambda one: 0 < states_needed(one) <= 30)
words = st.lists(st.integers(0, 3), min_size=1, max_size=8).map(tuple)


def written_out(stream: Stream) -> list[Step]:
    """The steps that are done, one after the other."""
    return [stream[place.routine].steps[place.step] for place in places(stream)]


@given(untidy_programs)
def test_a_tidied_program_does_the_same(program: Program) -> None:
    tidied = tidy(program)
    done = [[step for step in written_out(stream) if step] for stream in program]
    assert [written_out(stream) for stream in tidied] == [stream for stream in done if stream]
    assert tidy(tidied) == tidied
    assert complexity(tidied) <= complexity(program)
    assert states_needed(tidied) == states_needed(program)


@given(untidy_programs)
def test_a_tidied_program_has_no_empty_parts_and_joins_what_is_done_once(program: Program) -> None:
    for stream in tidy(program):
        assert stream
        assert all(routine.steps and all(routine.steps) for routine in stream)
        rounds = [routine.rounds for routine in stream]
        assert (1, 1) not in pairwise(rounds)


@given(words)
def test_a_word_folds_into_a_stream_that_does_it(word: Word) -> None:
    # As often as it takes to do all of the longest repetition.
    done = [step[0] for step in written_out(fold(word, rounds=len(word)))]
    rest = iter(done)
    assert all(one in rest for one in word)
    assert tidy((fold(word, 3),)) == (fold(word, 3),)
    assert {one for (one,) in written_out(fold(word, 3))} == set(word)


@given(st.permutations(range(4)), st.integers(1, 4), st.integers(2, 4))
def test_what_is_repeated_folds_into_one_routine(order: list[int], length: int, times: int) -> None:
    unit = tuple(order[:length])
    repeated = Routine(3, tuple((one,) for one in unit))
    assert fold(unit * times, rounds=3) == (repeated,)
    assert fold(unit, rounds=3) == sequence(*unit)


# --- likelihood ---------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(programs, st.lists(words, min_size=1, max_size=8))
def test_expectation_maximization_never_lowers_the_likelihood(
    program: Program, shown: list[Word]
) -> None:
    read = corpus_of(*shown)
    # So many moments that the pseudo-counts of the estimates weigh nothing.
    often = 1e6
    levels = tuple(
        one._replace(ended=one.ended * often, cut=one.cut * often) for one in read.levels
    )
    read = replace(read, levels=levels, moments=read.moments * often)
    model = Model(program, read)
    # Round by round; what a program costs stays the same.
    scores = [model.fit(0), *(model.fit(1) for _ in range(8))]
    assert all(math.isfinite(score) for score in scores)
    rounding = 1e-5 * read.moments
    assert all(after >= before - rounding for before, after in pairwise(scores))


def test_what_a_program_can_say_exactly_is_learned() -> None:
    read = corpus_of(*[(A,)] * 5, *[(B,)] * 3, *[(A, B)] * 2, times=500)
    model = Model((sequence(A), sequence(B)), read)
    scores = [model.fit(1) for _ in range(40)]
    assert all(after >= before - 0.1 for before, after in pairwise(scores))
    # More than the words' entropy is due to noise, which no stream shares out.
    price = _PRICE * read.moments * complexity(model.program)
    entropy = -sum(share * math.log(share) for share in (0.5, 0.3, 0.2)) * read.moments
    assert scores[-1] + price == pytest.approx(-entropy, abs=0.005 * read.moments)


@settings(max_examples=20, deadline=None)
@given(programs, st.lists(words, min_size=1, max_size=6))
def test_rounds_of_one_call_or_of_several_are_the_same(program: Program, shown: list[Word]) -> None:
    read = corpus_of(*shown)
    one_by_one = Model(program, read)
    one_by_one.fit(1)
    one_by_one.fit(2)
    assert one_by_one.fit(1) == pytest.approx(Model(program, read).fit(4))


@settings(max_examples=20, deadline=None)
@given(st.lists(programs, min_size=1, max_size=4), st.lists(words, min_size=1, max_size=6))
def test_a_program_is_worth_the_same_whatever_it_is_read_together_with(
    together: list[Program], shown: list[Word]
) -> None:
    read = corpus_of(*shown)
    alone = [Model(program, read).fit(3) for program in together]
    assert Models(together, read).fit(3).tolist() == pytest.approx(alone, rel=1e-4, abs=1e-3)


def test_rare_actions_that_no_program_does_are_improbable_and_no_more() -> None:
    frequent, rare = (A,) * 9, (B, C, D) * 3
    read = corpus_of(*[frequent] * 5000, rare)
    models = Models([(sequence(A),), (sequence(A), sequence(B, C, D))], read)
    worth = models.fit(20)
    assert np.isfinite(worth).all()


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(4)), st.integers(2, 4), st.data())
def test_a_word_is_more_probable_under_a_program_that_makes_it(
    order: list[int], length: int, data: st.DataObject
) -> None:
    word = tuple(order[:length])
    missing = data.draw(st.integers(0, length - 1))
    read = corpus_of(word, times=50)
    without = sequence(*word[:missing], *word[missing + 1 :])
    assert Model((sequence(*word),), read).fit(4) > Model((without,), read).fit(4) + 50
    backwards = sequence(*reversed(word))
    assert Model((sequence(*word),), read).fit(4) > Model((backwards,), read).fit(4) + 50


def test_a_larger_program_costs_more_where_it_explains_no_more() -> None:
    read = corpus_of((A, B), (A,), times=200)
    smaller, larger = (sequence(A, B),), (sequence(A, B), sequence(C))
    assert complexity(larger) > complexity(smaller)
    assert Model(smaller, read).fit(10) > Model(larger, read).fit(10)


def test_how_often_a_stream_goes_on_is_learned() -> None:
    read = corpus_of((A, B), (A, B), (A, B), (A,), times=100)
    model = Model((sequence(A, B),), read)
    model.fit(30)
    assert model.goes_on.tolist() == pytest.approx([0.75], abs=0.01)


@settings(max_examples=40, deadline=None)
@given(programs, st.lists(words, min_size=1, max_size=4), words, st.booleans())
def test_each_action_of_a_word_is_explained_by_a_step_with_it(
    program: Program, shown: list[Word], word: Word, cut: bool
) -> None:
    model = Model(program, corpus_of(*shown))
    model.fit(1)
    explained = model.explain(word, cut)
    assert len(explained) == len(word)
    for number, action in zip(explained, word, strict=True):
        if number is not None:
            state = model.states[number]
            place = model.order[state.stream][state.place]
            step = program[state.stream][place.routine].steps[place.step]
            assert step[state.member] == action
    # A stream hands over to a later one only.
    takers = [model.states[one].stream for one in explained if one is not None]
    assert takers == sorted(takers)


def test_streams_are_told_apart_in_one_word_and_what_is_unknown_is_noise() -> None:
    program = (sequence(A, B), (Routine(3, ((C,),)),))
    model = Model(program, corpus_of((A, B, C, C), (A,), (B, C), (D, A), times=50))
    model.fit(10)
    explained = model.explain((A, B, D, C, C), cut=False)
    streams = [None if one is None else model.states[one].stream for one in explained]
    assert streams == [0, 0, None, 1, 1]
    first, second = (model.states[one].place for one in explained[3:] if one is not None)
    assert second == first + 1


# --- moves --------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(programs, st.lists(words, min_size=1, max_size=6))
def test_neighbours_are_different_tidy_and_small_enough(
    program: Program, shown: list[Word]
) -> None:
    found = neighbours(program, corpus_of(*shown), rounds=3)
    assert found
    assert len(set(found)) == len(found)
    assert program not in found
    assert all(one and tidy(one) == one for one in found)
    assert all(states_needed(one) <= MOST_STATES for one in found)


def test_no_neighbour_of_a_large_program_is_too_large() -> None:
    large = (tuple(Routine(6, ((A,), (B,), (C,), (D,))) for _ in range(4)),)
    assert states_needed(large) == 96
    found = neighbours(large, corpus_of((A, B, C, D)), rounds=6)
    assert found
    assert max(map(states_needed, found)) <= MOST_STATES


def test_one_step_more_or_less_and_another_order_are_neighbours() -> None:
    read = corpus_of((A, B, C), (B, A), times=10)
    found = neighbours((sequence(A, B),), read, rounds=3)
    for wanted in (
        (sequence(A, B, C),),
        (sequence(A),),
        (sequence(B, A),),
        (sequence(A), sequence(B)),
        ((once((A, B)),),),
        ((Routine(3, ((A,), (B,))),),),
        (sequence(A, B), sequence(C)),
    ):
        assert wanted in found


# --- guards -------------------------------------------------------------------------------------

DISTANCE, BATTERY = some.at_most("distance", 0.5), some.at_most("battery", 0.3)
DOCKED, CUP = Literal(IsTrue("docked")), Literal(HasCategory("kind", "cup"))


def negated(literal: Literal) -> Literal:
    return Literal(literal.condition, positive=not literal.positive)


def random_states(rows: int, seed: int) -> FloatArray:
    """Values of `FEATURES`, each as probable as the others."""
    draw = np.random.default_rng(seed)
    columns = [draw.random(rows), draw.random(rows), draw.integers(2, size=rows)]
    return np.column_stack([*columns, draw.integers(3, size=rows)]).astype(float)


def events(where: BoolArray, seed: int, inside: float = 0.9, outside: float = 0.1) -> BoolArray:
    """What happens with these probabilities where something holds, and elsewhere."""
    return np.random.default_rng(1000 + seed).random(len(where)) < np.where(where, inside, outside)


def shape(found: Guard) -> set[frozenset[tuple[object, bool]]]:
    """The clauses without the values of their thresholds."""
    return {frozenset((_asked(one.condition), one.positive) for one in clause) for clause in found}


def _asked(condition: Condition) -> object:
    return condition.quantity if isinstance(condition, Threshold) else condition


@pytest.mark.parametrize(
    "wanted",
    [
        ((DISTANCE,),),
        ((negated(DISTANCE),), (BATTERY,)),
        ((DOCKED,),),
        ((CUP,), (negated(DOCKED),)),
        ((negated(CUP),),),
        ((DISTANCE, BATTERY),),
        ((negated(BATTERY), DOCKED),),
        ((DISTANCE,), (DOCKED, CUP)),
    ],
    ids=str,
)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_conditions_that_decide_are_found(wanted: Guard, seed: int) -> None:
    states = random_states(3000, seed)
    went_on = events(holds(wanted, states, some.FEATURES), seed)
    found = guard(states, went_on, some.FEATURES, 0.6)
    # IsTrue is one of two values, so both ways to say it mean the same.
    assert shape(found) == shape(wanted)
    asked = {_asked(one.condition): one.condition for clause in wanted for one in clause}
    for literal in (one for clause in found for one in clause):
        if isinstance(literal.condition, Threshold):
            true = asked[literal.condition.quantity]
            assert isinstance(true, Threshold)
            assert literal.condition.value == pytest.approx(true.value, abs=0.05)


def test_hardly_any_condition_is_found_where_chance_decides() -> None:
    found = 0
    for seed in range(100):
        states = random_states(400, seed)
        chance = events(np.ones(len(states), dtype=bool), seed, inside=0.3 + 0.1 * (seed % 5))
        found += bool(guard(states, chance, some.FEATURES, 0.75))
    # One in a hundred at most.
    assert found <= 1


@pytest.mark.parametrize("happens", [False, True])
def test_nothing_decides_what_always_or_never_happens(happens: bool) -> None:
    states = random_states(500, 1)
    assert guard(states, np.full(500, happens), some.FEATURES, 0.6) == ()


def test_a_few_events_prove_nothing() -> None:
    states = random_states(25, 1)
    assert guard(states, states[:, 2] == 1, some.FEATURES, 0.6) == ()


def test_a_small_difference_is_no_guard() -> None:
    states = random_states(6000, 1)
    went_on = events(holds(((DOCKED,),), states, some.FEATURES), 1, inside=0.6, outside=0.5)
    assert guard(states, went_on, some.FEATURES, 0.6) == ()
    assert guard(states, went_on, some.FEATURES, 0.95)


def test_missing_values_are_no_obstacle() -> None:
    states = random_states(3000, 1)
    states[::7, 0] = math.nan
    states[:, 1] = math.nan
    wanted = ((DISTANCE,),)
    went_on = events(holds(wanted, states, some.FEATURES), 1)
    assert shape(guard(states, went_on, some.FEATURES, 0.6)) == shape(wanted)


def test_of_a_great_many_states_some_are_enough() -> None:
    states = random_states(50_000, 1)
    wanted = ((DISTANCE,), (DOCKED,))
    went_on = events(holds(wanted, states, some.FEATURES), 1)
    assert shape(guard(states, went_on, some.FEATURES, 0.6)) == shape(wanted)


asked = some.literals(
    st.one_of(
        # Of differences, guards know nothing.
        some.thresholds("distance"),
        some.thresholds("battery"),
        st.just(IsTrue("docked")),
        st.sampled_from(some.FEATURES[3].categories).map(lambda name: HasCategory("kind", name)),
    )
)


@given(
    st.lists(st.lists(asked, min_size=1, max_size=2).map(tuple), max_size=3).map(tuple),
    st.lists(some.states, min_size=1, max_size=10),
)
def test_a_guard_holds_where_the_tree_with_its_conditions_goes_on(
    found: Guard, values: list[tuple[float, ...]]
) -> None:
    states = np.array(values)
    go = some.action("go")
    clauses = [nodes.Selector(tuple(map(nodes.Condition, clause))) for clause in found]
    rows = States(some.FEATURES, states, lambda condition: False)
    reached = triggered(nodes.Sequence((*clauses, go)), rows)[go]
    assert np.array_equal(holds(found, states, some.FEATURES), reached)
