"""How late a demonstrator acted: read off the demonstrations, and undone."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import assume, given
from hypothesis import strategies as st

from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.last_action import (
    NO_ACTION,
    History,
    last_actions,
    previous_actions,
)
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import OptionError
from rebt_ros.learning import reaction_time
from rebt_ros.learning.late_actions import rows_in, shifted
from rebt_ros.learning.reaction_time import ReactionTime, Trial, estimate

X = (Feature("x"), Feature("noise"))
LEFT, RIGHT, STAY = 0, 1, 2
#: Nanoseconds.
TENTH = 100_000_000


def joined(*shown: tuple[list[list[float]], list[int]]) -> DemonstrationTable:
    """A table of demonstrations, each its states and its actions."""
    states = [state for its, _ in shown for state in its]
    chosen = [code for _, its in shown for code in its]
    number = [place for place, (_, its) in enumerate(shown) for _ in its]
    return some.table(states, chosen, number, X)


def acted_late(decide: Iterator[int], late: int) -> Callable[[], int]:
    """What is done now: what was decided so many steps before, or first of all."""
    decided: list[int] = []

    def act() -> int:
        decided.append(next(decide))
        return decided[max(0, len(decided) - 1 - late)]

    return act


def shuttle(
    late: int, seed: int, turns: int = 6, leg: float = 10, wall: float = math.inf
) -> tuple[list[list[float]], list[int]]:
    """To and fro between 0 and `leg`, about half a metre at a time: this needs memory.

    A wall stands so far behind either end.
    """
    chance = random.Random(seed)
    x, target = chance.uniform(1, leg - 1), RIGHT

    def decide() -> Iterator[int]:
        while True:
            yield target

    act = acted_late(decide(), late)
    states, actions = [], []
    while turns:
        states.append([x, chance.random()])
        actions.append(act())
        x += (1 if actions[-1] == RIGHT else -1) * chance.uniform(0.4, 0.6)
        x = min(max(x, -wall), leg + wall)
        if x >= leg if target == RIGHT else x <= 0:
            target, turns = LEFT + RIGHT - target, turns - 1
    return states, actions


def balancing(late: int, seed: int, rows: int = 120) -> tuple[list[list[float]], list[int]]:
    """Keeps x near 0 against a wind: states alone tell what to do."""
    chance = random.Random(seed)
    x = chance.uniform(-3, 3)

    def decide() -> Iterator[int]:
        while True:
            yield LEFT if x > 1 else RIGHT if x < -1 else STAY

    act = acted_late(decide(), late)
    states, actions = [], []
    for _ in range(rows):
        states.append([x, chance.random()])
        actions.append(act())
        x += (0, 0.3, 0)[actions[-1]] - 0.3 * (actions[-1] == LEFT) + chance.gauss(0, 0.4)
    return states, actions


def shuttles(late: int, count: int = 20) -> DemonstrationTable:
    return joined(*(shuttle(late, seed) for seed in range(count)))


def balancings(late: int, count: int = 5) -> DemonstrationTable:
    return joined(*(balancing(late, seed) for seed in range(count)))


def by_chance(rows: int, count: int, seed: int) -> DemonstrationTable:
    chance = np.random.default_rng(seed)
    return joined(
        *(
            (chance.normal(size=(rows, 2)).tolist(), chance.integers(0, 3, rows).tolist())
            for _ in range(count)
        )
    )


def paced(table: DemonstrationTable, gap: int) -> DemonstrationTable:
    """The same with a row in so many nanoseconds."""
    return replace(table, stamps=table.stamps * gap)


# --- moving actions back ------------------------------------------------------------------------


def test_each_row_gets_the_action_of_some_rows_later_in_its_demonstration() -> None:
    states = [[float(row), 0.0] for row in range(9)]
    table = some.table(states, [0, 1, 2, 3, 0, 1, 2, 3, 0], [0, 0, 0, 0, 1, 1, 2, 2, 2], X)
    moved = shifted(table, 2)
    assert moved.states[:, 0].tolist() == [0, 1, 6]
    assert moved.stamps.tolist() == [0, 1, 6]
    assert moved.chosen.tolist() == [2, 3, 0]
    assert moved.demonstration.tolist() == [0, 0, 2]
    assert moved.demonstrations == table.demonstrations
    assert moved.previous.tolist() == [NO_ACTION, 2, NO_ACTION]
    assert moved.last.tolist() == [NO_ACTION, 2, NO_ACTION]


@given(some.tables())
def test_no_delay_changes_nothing(table: DemonstrationTable) -> None:
    assert shifted(table, 0) is table


@st.composite
def begun_before(draw: st.DrawFn) -> DemonstrationTable:
    """Tables, some of whose demonstrations began amid something else."""
    table = draw(some.tables(min_rows=8, max_demonstrations=2))
    first = np.searchsorted(table.demonstration, np.arange(len(table.demonstrations)))
    before = np.full(len(table.demonstrations), NO_ACTION)
    for place in np.unique(table.demonstration).tolist():
        others = set(range(len(some.LABELS))) - {int(table.chosen[first[place]])}
        before[place] = draw(st.sampled_from([NO_ACTION, *sorted(others)]))
    return replace(table, before=draw(st.sampled_from([None, before])))


@given(begun_before(), st.integers(1, 2), st.integers(1, 2))
def test_two_delays_add_up(table: DemonstrationTable, first: int, second: int) -> None:
    assume(np.bincount(table.demonstration).max() > first + second)
    twice, once = shifted(shifted(table, first), second), shifted(table, first + second)
    for name in ("states", "chosen", "demonstration", "stamps", "last", "previous"):
        np.testing.assert_array_equal(getattr(twice, name), getattr(once, name))


@given(begun_before(), st.integers(1, 4))
def test_what_was_done_before_follows_from_the_moved_actions(
    table: DemonstrationTable, rows: int
) -> None:
    lengths = np.bincount(table.demonstration)
    assume(lengths.max() > rows)
    moved = shifted(table, rows)
    assert len(moved) == np.maximum(lengths - rows, 0).sum()
    np.testing.assert_array_equal(
        moved.previous, previous_actions(moved.chosen, moved.demonstration)
    )
    assert not (moved.last == moved.chosen).any()
    if table.before is None:
        np.testing.assert_array_equal(moved.last, last_actions(moved.chosen, moved.demonstration))


def test_a_delay_longer_than_all_demonstrations_is_refused_in_one_sentence() -> None:
    with pytest.raises(OptionError) as refused:
        shifted(shuttles(0, 2), 1000)
    assert str(refused.value) == (
        "no demonstration is longer than a reaction time of 1000 rows: give a shorter one."
    )


def test_seconds_are_rows_where_stamps_tell_time() -> None:
    table = paced(shuttles(0, 2), TENTH)
    assert [rows_in(table, seconds) for seconds in (0, 0.04, 0.06, 0.2)] == [0, 0, 1, 2]
    assert rows_in(shuttles(0, 2), 0) == 0
    with pytest.raises(OptionError, match=r"needs rows with stamps.*'stamp'"):
        rows_in(shuttles(0, 2), 0.2)


def test_a_reaction_time_can_be_said() -> None:
    said = reaction_time.given(paced(shuttles(0, 2), TENTH), 0.3)
    assert (said.rows, said.seconds, said.trials) == (3, 0.3, ())


# --- reading it off -----------------------------------------------------------------------------


@pytest.mark.parametrize("late", range(6))
@pytest.mark.parametrize("task", [shuttles, balancings])
def test_a_delay_is_found_and_undone_exactly(
    task: Callable[[int], DemonstrationTable], late: int
) -> None:
    table = task(late)
    found = estimate(table)
    assert found.rows == late
    assert (found.rows > 0) is (late > 0)
    # The first rows of a late demonstrator answer to no state.
    moved = shifted(table, found.rows)
    assert explained(moved) == 0


def explained(table: DemonstrationTable) -> int:
    """Rows that a tree of eight leaves gets wrong."""
    place = np.arange(len(table)) - np.searchsorted(table.demonstration, table.demonstration)
    table = table.where(place > 0)
    vocabulary = Vocabulary(history=History.PREVIOUS)
    trained = fit(table, FitOptions(vocabulary=vocabulary, max_depth=3)).at(0.0)
    return int(np.count_nonzero(trained.predict(table) != table.chosen))


@pytest.mark.parametrize(("gap", "late"), [(TENTH, 3), (TENTH // 2, 4), (TENTH // 2, 9)])
def test_a_delay_is_told_in_seconds(gap: int, late: int) -> None:
    found = estimate(paced(balancings(late), gap))
    assert found.rows == late
    assert found.seconds == pytest.approx(late * gap / 1e9)
    assert found.sentence == (
        f"the demonstrator acted {late * gap / 1e9:.2f} s ({late} rows) late; "
        "actions are learned from when they were due"
    )


def test_without_time_a_delay_is_told_in_rows() -> None:
    found = estimate(balancings(1))
    assert found.seconds is None
    assert found.sentence.startswith("the demonstrator acted 1 row late;")


@pytest.mark.parametrize("leg", [3, 5, 10])
@pytest.mark.parametrize("gap", [1, TENTH // 2])
def test_going_to_and_fro_without_delay_does_not_look_late(leg: int, gap: int) -> None:
    table = joined(*(shuttle(0, seed, turns=8, leg=leg) for seed in range(5)))
    assert estimate(paced(table, gap)).rows == 0


@pytest.mark.parametrize("seed", range(10))
def test_no_delay_shows_in_random_actions(seed: int) -> None:
    found = estimate(by_chance(80, 1 + 3 * (seed % 3), seed))
    assert found.rows == 0
    assert len(found.trials) == 7


@pytest.mark.parametrize("seed", range(5))
def test_no_delay_shows_in_actions_that_are_held_by_chance(seed: int) -> None:
    table = by_chance(80, 4, seed)
    place = np.arange(len(table))
    changes = (np.random.default_rng(seed).random(len(table)) < 0.1) | (place % 80 == 0)
    chosen = table.chosen[np.maximum.accumulate(np.where(changes, place, 0))]
    held = replace(table, chosen=chosen, previous=previous_actions(chosen, table.demonstration))
    assert estimate(held).rows == 0


def test_no_delay_shows_where_people_err_only() -> None:
    chance = np.random.default_rng(0)
    table = balancings(0, 8)
    wrong = chance.random(len(table)) < 0.05
    chosen = np.where(wrong, chance.integers(0, 3, len(table)), table.chosen)
    erring = replace(table, chosen=chosen, previous=previous_actions(chosen, table.demonstration))
    assert estimate(erring).rows == 0


@pytest.mark.parametrize("seed", range(6))
def test_who_goes_to_and_fro_and_errs_is_not_half_a_way_late(seed: int) -> None:
    table = joined(*(shuttle(0, 100 * seed + number) for number in range(3)))
    wrong = np.random.default_rng(seed).random(len(table)) < 0.025
    chosen = np.where(wrong, LEFT + RIGHT - table.chosen, table.chosen)
    erring = replace(table, chosen=chosen, previous=previous_actions(chosen, table.demonstration))
    assert estimate(paced(erring, TENTH // 2)).rows == 0


@pytest.mark.parametrize("seed", range(3))
def test_no_delay_shows_where_actions_take_turns_row_by_row(seed: int) -> None:
    chance = np.random.default_rng(seed)
    # Now and then one is left out, so that what was done before does not tell everything.
    chosen = np.cumsum(1 + (chance.random(300) < 0.05)) % 3
    table = joined((chance.normal(size=(300, 2)).tolist(), chosen.tolist()))
    found = estimate(table)
    assert found.rows == 0
    assert (found.by_states_alone, found.trials[0].rows) == (False, 0)


@given(some.tables(max_rows=30))
def test_little_is_shown_and_nothing_is_found(table: DemonstrationTable) -> None:
    found = estimate(table)
    assert found.rows == 0
    assert found.sentence


@pytest.mark.parametrize(
    ("table", "why"),
    [
        (joined(([[1.0, 0.0]], [LEFT])), "the action is always the same"),
        (joined(*[([[1.0, 0.0], [2.0, 0.0]], [LEFT, RIGHT])] * 9), "demonstrations are too short"),
        (paced(balancings(3), 5 * TENTH), "rows are too far apart"),
        (
            replace(balancings(3), stamps=np.cumsum(np.arange(600) % 7 * TENTH)),
            "not evenly spaced",
        ),
    ],
)
def test_it_is_said_why_nothing_can_be_told(table: DemonstrationTable, why: str) -> None:
    found = estimate(table)
    assert (found.rows, found.trials) == (0, ())
    assert why in found.sentence


@pytest.mark.parametrize(
    ("sizes", "rows"),
    [
        ([30, 28, 26, 21, 14, 22, 30], 4),
        ([30, 28, 26, 25, 24, 25, 30], 0),  # less than a standard error
        ([30, 14, 13, 13, 13, 14, 30], 3),  # the middle of a valley
        ([30, 14, 13, 13, 14, 14, 30], 2),
        ([30, 14, 13, 13, 13, 13, 13], 2),  # where each state follows from the one before
        ([30, 28, 26, 24, 20, 15, 10], 0),  # may go on to fall
        ([10, 12, 15, 20, 24, 26, 28], 0),
    ],
)
def test_a_delay_is_taken_where_sizes_have_a_clear_valley(
    sizes: list[int], rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Without a delay states with the previous action are asked for, too.
    left = iter([sizes[0], 99, *sizes[1:]])
    monkeypatch.setattr(FittedTree, "explanation", property(lambda _: next(left)))
    monkeypatch.setattr(reaction_time, "border_bits", lambda *_: 0.0)
    found = estimate(shuttles(0))
    assert found.trials == tuple(Trial(*one) for one in enumerate(sizes))
    assert found.rows == rows


def test_states_alone_decide_unless_the_task_needs_memory() -> None:
    assert estimate(balancings(1)).by_states_alone
    assert not estimate(shuttles(1)).by_states_alone


def test_the_same_table_gives_the_same_estimate() -> None:
    assert estimate(balancings(2)) == estimate(balancings(2))
    assert estimate(shuttles(2)) == estimate(shuttles(2))


def fan(late: int, seed: int, rows: int = 200) -> tuple[list[list[float]], list[int]]:
    """Cools from 25 degrees on until it is 22, whatever is measured beside: this needs memory."""
    chance = random.Random(seed)
    x, runs, cooled = chance.uniform(18, 28), False, 0.0

    def decide() -> Iterator[int]:
        nonlocal runs
        while True:
            runs = x > 25 or (runs and x > 22)
            yield RIGHT if runs else STAY

    act = acted_late(decide(), late)
    states, actions = [], []
    for _ in range(rows):
        states.append([x, chance.random()])
        actions.append(act())
        cooled += 0.35 * ((actions[-1] == RIGHT) - cooled)
        x += 0.2 - 0.5 * cooled + chance.gauss(0, 0.03)
    return states, actions


@pytest.mark.parametrize("count", [1, 3, 8])
@pytest.mark.parametrize("seed", range(4))
def test_who_goes_on_until_another_border_is_not_late(count: int, seed: int) -> None:
    table = joined(*(fan(0, 100 * seed + number) for number in range(count)))
    assert estimate(paced(table, TENTH // 2)).rows == 0


def heater(seed: int, rows: int = 300) -> tuple[list[list[float]], list[int]]:
    """Heats below 18 degrees until 22: warms up in a few rows, and cools down in more."""
    chance = random.Random(seed)
    degrees, outside, heats = chance.uniform(12, 26), chance.uniform(0, 12), False
    states, actions = [], []
    for _ in range(rows):
        heats = degrees < 18 or (heats and degrees <= 22)
        states.append([round(degrees, 2), round(outside, 2)])
        actions.append(int(heats))
        degrees += 0.9 * heats + 0.03 * (outside - degrees)
    return states, actions


@pytest.mark.parametrize("seed", [0, 1, 2, 8, 23, 25, 36])
def test_who_takes_longer_one_way_than_the_other_is_not_late(seed: int) -> None:
    assert estimate(paced(joined(heater(seed)), TENTH // 2)).rows == 0


@pytest.mark.parametrize("late", [2, 4])
def test_who_goes_on_until_another_border_may_be_late_too(late: int) -> None:
    table = joined(*(fan(late, number) for number in range(20)))
    assert estimate(paced(table, TENTH // 2)).rows == late


# --- what it costs --------------------------------------------------------------------------------


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Rows of each tree that is fitted."""
    rows: list[int] = []

    def counted(table: DemonstrationTable, options: FitOptions) -> FittedTree:
        rows.append(len(table))
        return fit(table, options)

    monkeypatch.setattr(reaction_time, "fit", counted)
    return rows


def visits(late: int, seed: int) -> tuple[list[list[float]], list[int]]:
    """Waits somewhere until a bell has rung for one step, then goes: this needs memory."""
    chance = random.Random(seed)
    x, rings, going = chance.uniform(2, 8), chance.randrange(12, 25), False
    position: list[list[float]] = []

    def decide() -> Iterator[int]:
        nonlocal going
        while True:
            going = going or position[-1][1] > 0
            yield RIGHT if going else STAY

    act = acted_late(decide(), late)
    actions: list[int] = []
    for step in range(rings + 20):
        position.append([x, float(step == rings)])
        actions.append(act())
        x += chance.uniform(0.4, 0.6) * (actions[-1] == RIGHT)
    return position, actions


@pytest.mark.parametrize("late", [0, 2, 3])
def test_three_demonstrations_of_one_change_each_tell_the_delay(late: int) -> None:
    bell = (Feature("x"), Feature("bell", FeatureKind.BINARY))
    table = replace(joined(*(visits(late, seed) for seed in range(3))), features=bell)
    found = estimate(table)
    assert found.rows == late
    assert found.in_bits == (late > 0)


@pytest.mark.parametrize("late", [2, 4])
@pytest.mark.parametrize("seed", range(0, 60, 20))
def test_where_several_delays_explain_the_rows_round_borders_tell_which(
    seed: int, late: int
) -> None:
    table = joined(*(shuttle(late, seed + number, turns=4, wall=0.5) for number in range(3)))
    found = estimate(table)
    assert found.rows == late
    sizes = [one.size for one in found.trials]
    assert sizes.count(min(sizes)) > 1


@pytest.mark.parametrize("seed", [21, 45, 117])
def test_where_half_a_run_late_is_simplest_a_clear_shorter_delay_is_told(seed: int) -> None:
    table = joined(*(shuttle(2, seed + number, wall=0.5) for number in range(3)))
    found = estimate(paced(table, TENTH // 2))
    sizes = [one.size for one in found.trials]
    assert sizes[-1] < min(sizes[:-1])
    assert (found.rows, found.in_bits) == (2, False)


def test_borders_that_are_no_rounder_do_not_move_a_delay() -> None:
    sloped = joined(*(shuttle(3, seed, leg=9.37) for seed in range(20)))
    assert estimate(sloped).rows == 3


@pytest.mark.parametrize(
    ("gap", "most"), [(1, 14), (TENTH, 14), (TENTH // 2, 24), (TENTH // 10, 40)]
)
def test_few_rows_are_fitted_few_times(fits: list[int], gap: int, most: int) -> None:
    estimate(paced(by_chance(2000, 4, 0), gap))
    assert len(fits) <= most
    assert max(fits) <= 2000


def test_where_nothing_could_be_simpler_nothing_else_is_tried(fits: list[int]) -> None:
    table = balancings(0)
    assert estimate(table) == ReactionTime(
        0,
        None,
        "no reaction time is found: actions are learned from when they were taken",
        (Trial(0, 3),),
    )
    assert len(fits) == 2
