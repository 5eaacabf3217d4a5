"""The benchmark of driving: its tasks, its demonstrators, its statistics and what it writes."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.tree import DecisionTreeClassifier

sys.path.append(str(Path(__file__).parent / "benchmarks"))

from driving import shared, tasks
from driving.__main__ import main
from driving.cells import Origin, Store
from driving.corrections import Course, Mode, Stage, taken_over
from driving.demonstrating import (
    Demonstrator,
    Shown,
    UselessDemonstratorError,
    demonstrations,
    show,
    write_tables,
)
from driving.episodes import Worlds, drive, fresh
from driving.plain import PlainDriver
from driving.planning import shortest_plan
from driving.report import Measured, corrections_report, report
from driving.results import (
    EXPERT,
    Cell,
    Comparison,
    Mean,
    Result,
    compare,
    entries,
    growth,
    needed,
)
from driving.running import success_of
from driving.task import State, Task
from driving.tasks import NAMES, missing_for, task_named

from rebt_ros.errors import OptionError
from rebt_ros.storage.inputs import load

CHECKOUT = Path(__file__).resolve().parents[1]
MEMORY = ("shuttle", "carry", "bell")


def _some_task(name: str) -> Task:
    if missing := missing_for(name):
        pytest.skip(f"{' and '.join(missing)} is not installed")
    return task_named(name)


def _expert_run(task: Task, seed: int) -> tuple[list[State], list[str]]:
    states, actions = [task.reset(seed)], []
    while not task.over:
        actions.append(task.expert())
        states.append(task.step(actions[-1]))
    return states, actions


# --- tasks -------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_expert_does_the_task_with_its_actions_in_states_of_its_features(name: str) -> None:
    task = _some_task(name)
    successes = 0
    for seed in range(10):
        states, actions = _expert_run(task, seed)
        successes += task.success
        assert {len(state) for state in states} == {len(task.features)}
        assert set(actions) <= set(task.actions)
    assert successes >= 9


@pytest.mark.parametrize("name", NAMES)
def test_equal_seeds_and_actions_make_equal_episodes(name: str) -> None:
    task, again = _some_task(name), _some_task(name)
    again.reset(77)
    chance = random.Random(3)
    for seed in (3, 4):
        assert task.reset(seed) == again.reset(seed)
        for _ in range(30):
            if task.over:
                break
            action = chance.choice(task.actions)
            assert task.step(action) == again.step(action)
            assert (task.over, task.success) == (again.over, again.success)


@pytest.mark.parametrize("name", MEMORY)
def test_a_memory_task_is_done_by_who_knows_the_previous_action_and_by_nobody_else(
    name: str,
) -> None:
    task, worlds = task_named(name), Worlds(name)
    assert task.needs_memory
    shown = demonstrations(task, 0, 8)
    success = {
        history: success_of(
            worlds, PlainDriver(DecisionTreeClassifier(random_state=0), task, shown, history), 20
        )
        for history in (True, False)
    }
    assert success[True] >= 0.9
    assert success[False] <= 0.2


def test_what_must_not_be_done_ends_an_episode() -> None:
    bell = task_named("bell")
    bell.reset(0)
    bell.step("go")
    assert bell.over
    assert not bell.success
    carry = task_named("carry")
    carry.reset(0)
    while carry.expert() != "pick":
        carry.step("forward")
    while not carry.step("pick")[1]:
        pass
    while not carry.over:
        carry.step("place")
    assert not carry.success
    shuttle = task_named("shuttle")
    shuttle.reset(0)
    while not shuttle.over:
        (position,) = shuttle.step("east")
    assert not shuttle.success
    assert float(position) < 6


def test_an_unknown_task_is_refused_with_the_known_ones() -> None:
    with pytest.raises(OptionError, match="no task 'dance': choose of robot, shuttle"):
        task_named("dance")


@pytest.mark.skipif(not shared.is_there(), reason="../shared/closed_loop is not there")
def test_the_expert_of_a_shared_task_does_it_in_states_of_its_features() -> None:
    task = _some_task("shared-patrol")
    assert task.needs_memory
    states, _ = _expert_run(task, 3)
    assert task.success
    assert {len(state) for state in states} == {len(task.features)}
    with pytest.raises(OptionError, match=r"no task 'shared-dance': choose of .*shared-patrol"):
        task_named("shared-dance")


@given(st.sets(st.tuples(st.integers(0, 4), st.integers(0, 4)), max_size=12))
def test_a_plan_leads_to_the_goal_and_none_is_shorter(walls: set[tuple[int, int]]) -> None:
    moves = {"east": (1, 0), "west": (-1, 0), "north": (0, 1), "south": (0, -1)}
    walls = walls - {(0, 0), (4, 4)}

    def ways(place: tuple[int, int]) -> list[tuple[str, tuple[int, int]]]:
        all_ways = [(name, (place[0] + x, place[1] + y)) for name, (x, y) in moves.items()]
        inside = [(name, to) for name, to in all_ways if min(to) >= 0 and max(to) <= 4]
        return [(name, to) for name, to in inside if to not in walls]

    plan = shortest_plan((0, 0), ways, lambda place: place == (4, 4))
    reached = [{(0, 0)}]
    while (4, 4) not in reached[-1] and len(reached) < 26:
        reached.append({to for place in reached[-1] for _, to in ways(place)})
    if (4, 4) not in reached[-1]:
        assert plan is None
        return
    assert plan is not None
    place = (0, 0)
    for action in plan:
        place = dict(ways(place))[action]
    assert place == (4, 4)
    assert len(plan) == len(reached) - 1


# --- demonstrators -----------------------------------------------------------


@pytest.mark.parametrize("demonstrator", [Demonstrator(), Demonstrator(late=2, wrong=0.05)])
def test_demonstrations_of_a_set_are_nested_and_sets_differ(demonstrator: Demonstrator) -> None:
    task = task_named("carry")
    four = demonstrations(task, 1, 4, demonstrator)
    assert demonstrations(task, 1, 2, demonstrator) == four[:2]
    assert len(set(four)) == 4
    assert not set(four) & set(demonstrations(task, 2, 4, demonstrator))


def test_a_late_demonstrator_does_what_was_decided_some_steps_before() -> None:
    task = task_named("bell")
    on_time, late = show(task, 5), show(task, 5, Demonstrator(late=3))
    assert on_time is not None
    assert late is not None
    ringing = [int(state[1]) for state in on_time.states].index(1)
    assert on_time.actions.index("go") == ringing
    assert late.actions.index("go") == ringing + 3


def test_a_demonstrator_errs_in_about_its_share_of_steps_and_only_successes_are_kept() -> None:
    task = task_named("bell")
    shown = demonstrations(task, 0, 60, Demonstrator(wrong=0.1))
    for one in shown:
        # Going before the bell would have been no success.
        before = [int(state[1]) for state in one.states].index(1)
        assert set(one.actions[:before]) == {"wait"}
    after = [
        action
        for one in shown
        for state, action in zip(one.states, one.actions, strict=True)
        if state[0] != one.states[0][0]
    ]
    # Of the actions that are taken by mistake, half are those that were due.
    assert 0.03 < after.count("wait") / len(after) < 0.08


def test_a_demonstrator_who_never_succeeds_is_no_use() -> None:
    with pytest.raises(UselessDemonstratorError, match="late by 40 steps"):
        demonstrations(task_named("shuttle"), 0, 1, Demonstrator(late=40))


@pytest.mark.parametrize("values", [(-1, 0.0), (0, 1.0), (0, -0.1)])
def test_a_demonstrator_that_cannot_be_is_refused(values: tuple[int, float]) -> None:
    with pytest.raises(OptionError):
        Demonstrator(*values)


def test_tables_hold_what_was_shown(tmp_path: Path) -> None:
    shown = (
        Shown(((0.1, "red"), (1 / 3, "blue")), ("go", "stop")),
        Shown(((2.0, "red"),), ("go",)),
    )
    loaded = load(write_tables(tmp_path, ("place", "light"), shown)).demonstrations
    assert [len(one) for one in loaded] == [2, 1]
    assert [feature.name for feature in loaded[0].features] == ["place", "light"]
    assert loaded[0].states[:, 0].tolist() == [0.1, 1 / 3]
    assert loaded[0].stamps.tolist() == [0, 50_000_000]
    assert [loaded[0].actions[code] for code in loaded[0].chosen] == ["go", "stop"]


# --- driving -----------------------------------------------------------------


class _Scripted:
    """Answers from a list, step by step, in every episode."""

    def __init__(self, answers: Sequence[str | None]) -> None:
        self._answers = answers

    def reset(self, episodes: int) -> None:
        self._steps = [0] * episodes

    def act_many(self, states: Sequence[State], episodes: Sequence[int]) -> list[str | None]:
        chosen = [self._answers[self._steps[place] % len(self._answers)] for place in episodes]
        for place in episodes:
            self._steps[place] += 1
        return chosen


def test_where_nothing_is_answered_the_last_action_holds() -> None:
    (driven,) = drive(Worlds("bell"), _Scripted([None] * 4 + ["go", None]), fresh(1))
    assert driven.actions[:4] == ("wait",) * 4
    assert set(driven.actions[4:]) == {"go"}


@pytest.mark.parametrize("history", [True, False])
def test_episodes_side_by_side_are_those_driven_alone(history: bool) -> None:
    task, worlds = task_named("carry"), Worlds("carry")
    shown = demonstrations(task, 0, 2)
    driver = PlainDriver(DecisionTreeClassifier(random_state=0), task, shown, history)
    together = drive(worlds, driver, fresh(6))
    assert together == tuple(drive(worlds, driver, [seed])[0] for seed in fresh(6))
    assert len(set(together)) > 1


def test_a_takeover_is_the_rest_of_the_episode_that_failed() -> None:
    task = task_named("carry")
    whole = show(task, 9)
    assert whole is not None
    # As the expert does, until it has placed what it carries; then it stays where it is.
    placed = whole.actions.index("back")
    done = (*whole.actions[:placed], *["pick"] * 30)
    rest = taken_over(task, 9, done)
    assert rest is not None
    assert rest.states[0] == whole.states[placed]
    assert set(rest.actions) == {"back"}
    assert len(rest) < len(whole)


def test_where_nothing_can_be_saved_a_takeover_shows_all() -> None:
    task = task_named("bell")
    assert taken_over(task, 4, ("go",)) == show(task, 4)
    lost = ("wait",) * 120
    rest = taken_over(task, 4, lost)
    assert rest is not None
    # Too late to get to the end within the steps that are left, unless long before.
    assert len(rest) < 120


# --- statistics --------------------------------------------------------------


def _results(successes: Mapping[str, Sequence[Sequence[float]]]) -> list[Result]:
    """Of methods, each with the success of its sets, for 1, 2, 4, … demonstrations."""
    return [
        Result(Cell("walk", number, 2**place, method), success, nodes=10 + number)
        for method, sets in successes.items()
        for number, by_count in enumerate(sets)
        for place, success in enumerate(by_count)
    ]


def test_methods_are_compared_in_pairs_and_the_error_is_that_of_sets() -> None:
    results = _results({"a": [[0.5, 1.0], [0.9, 0.8]], "b": [[0.5, 0.8], [0.5, 0.4]]})
    found = compare(results, "a", "b")
    assert found is not None
    # The sets' mean differences are 0.1 and 0.4.
    assert found.difference.value == pytest.approx(0.25)
    assert found.difference.error == pytest.approx(0.15)
    assert (found.better, found.equal, found.worse) == (3, 1, 0)


def test_only_cells_that_both_methods_have_are_compared() -> None:
    results = _results({"a": [[0.75, 1.0]], "b": [[0.5]], "c": []})
    assert compare(results, "a", "b") == Comparison(Mean(0.25, None), 1, 0, 0)
    assert compare(results, "a", "c") is None


SHARES = st.lists(st.lists(st.floats(0, 1), min_size=3, max_size=3), min_size=2, max_size=5)


@given(SHARES, SHARES)
def test_a_comparison_the_other_way_round_has_the_other_sign(
    mine: list[list[float]], others: list[list[float]]
) -> None:
    results = _results({"a": mine, "b": others})
    one, other = compare(results, "a", "b"), compare(results, "b", "a")
    assert one is not None
    assert other is not None
    assert one.difference.value == pytest.approx(-other.difference.value)
    assert one.difference.error == pytest.approx(other.difference.error)
    assert (one.better, one.worse) == (other.worse, other.better)


def test_success_falls_where_it_falls_in_all_sets_alike() -> None:
    results = _results({"a": [[0.9, 0.7], [0.8, 0.6], [0.9, 0.69]]})
    assert [one.falls for one in growth(results, "a")] == [True]
    noisy = _results({"a": [[0.9, 0.7], [0.8, 0.9], [0.9, 0.69]]})
    assert [one.falls for one in growth(noisy, "a")] == [False]


def test_the_demonstrations_needed_are_the_fewest_that_are_enough() -> None:
    results = _results({"a": [[0.2, 0.8, 0.5]], "b": [[0.1, 0.2, 0.3]]})
    found = entries(results)
    assert needed(found, {"walk": 0.84}, "a") == {"walk": 2}
    assert needed(found, {"walk": 0.84}, "b") == {"walk": None}


def test_entries_are_means_over_sets_in_the_form_that_is_promised() -> None:
    results = _results({"a": [[0.5], [0.7]], EXPERT: [[1.0]]})
    assert [one.as_json() for one in entries(results)] == [
        {
            "task": "walk",
            "n": 1,
            "method": "a",
            "success": 0.6,
            "standard_error": 0.1,
            "nodes": 10.5,
        }
    ]
    (alone,) = entries(results[:1])
    assert alone.as_json()["standard_error"] is None


def test_results_are_kept_as_long_as_what_made_them_is_the_same(tmp_path: Path) -> None:
    store = Store(tmp_path, Origin("settings", "package", "benchmark"))
    cells = [Cell("bell", 0, 2, "default"), Cell("bell", 0, 2, "tree"), Cell("bell", 1, 2, "tree")]
    results = [Result(cell, 0.5, 7, 99, 1.5, None, {"agreement": 0.9}) for cell in cells]
    for one in results[:2]:
        store.write(one)
    assert store.missing(cells) == (cells[2],)
    assert store.results(cells) == tuple(results[:2])
    # What plain learners make does not depend on the package.
    changed = Store(tmp_path, Origin("settings", "changed", "benchmark"))
    assert changed.missing(cells) == (cells[0], cells[2])
    for other in (Origin("other", "package", "benchmark"), Origin("settings", "package", "other")):
        assert Store(tmp_path, other).missing(cells) == tuple(cells)


# --- what is written ---------------------------------------------------------


def test_a_report_names_all_methods_and_what_was_refused() -> None:
    results = [
        *_results({"default": [[0.5, 1.0], [0.9, 0.2]], "tree": [[0.5, 0.8], [0.5, 0.4]]}),
        Result(Cell("walk", 0, 1, "paper"), 0.0, refusal="one action only"),
        Result(Cell("walk", 0, 0, EXPERT), 1.0),
    ]
    text = report(Measured(tuple(results), frozenset()))
    assert "| tree    | 55" in text
    assert "+10.0 ± 0.0" in text
    assert "walk, paper: 1 (one action only)" in text
    tables = [part.split("\n") for part in text.rstrip().split("\n\n") if part.startswith("|")]
    assert tables
    assert all(len({len(line) for line in table}) == 1 for table in tables)


def test_corrections_are_counted_to_the_last_one() -> None:
    stages = (Stage(2, 100, 0, 0.5), Stage(3, 130, 4, 1.0))
    courses = [
        Course("walk", 0, Mode.FAILED, stages, reached=True),
        Course("walk", 0, Mode.WHOLE, (stages[0], Stage(3, 160, 2, 0.8)), reached=False),
    ]
    assert courses[0].after(5) == stages[1]
    text = corrections_report(courses)
    assert "| walk | failed | 1 of 1  | 3.0            | 130.0 | 4.0      | 100     |" in text
    assert "+20.0" in text
    assert "0.50" in text


def test_the_command_writes_figures_tables_and_a_plot_and_goes_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--quick", "--workers", "1", "--results", str(tmp_path)]
    # What these make does not depend on the package, which may change at any time.
    arguments += ["--methods", "tree,tree+history"]
    main(arguments)
    printed = capsys.readouterr()
    assert len(printed.err.splitlines()) == 2 * 2
    listed = json.loads((tmp_path / "driving-quick.json").read_text())
    assert len(listed) == 2 * 2 * 2
    for one in listed:
        assert list(one) == ["task", "n", "method", "success", "standard_error", "nodes"]
        assert 0 <= one["success"] <= 1
    assert (tmp_path / "driving-quick.md").read_text() in printed.out
    if "matplotlib" not in printed.out:
        assert "</svg>" in (tmp_path / "driving-quick.svg").read_text()
    cells = sorted((tmp_path / "driving-quick").rglob("*.json"))
    assert len(cells) == 2 * (2 * 2 * 2 + 1)
    cells[0].unlink()
    main(arguments)
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert json.loads((tmp_path / "driving-quick.json").read_text()) == listed


def test_the_command_corrects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["corrections", "--quick", "--tasks", "carry", "--sets", "0", "--workers", "1"]
    main([*arguments, "--results", str(tmp_path)])
    courses = json.loads((tmp_path / "driving-quick-corrections.json").read_text())
    assert [one["mode"] for one in courses] == ["failed", "takeover", "whole"]
    for one in courses:
        counts = [stage["demonstrations"] for stage in one["stages"]]
        assert counts == list(range(2, 2 + len(counts)))
    assert "| carry | takeover |" in capsys.readouterr().out


def test_tasks_whose_packages_are_missing_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tasks, "find_spec", lambda name: None)
    with pytest.raises(OptionError, match="'doorkey' needs gymnasium and minigrid: pip install"):
        task_named("doorkey")
    few = ["--sets", "0", "--counts", "1", "--episodes", "1", "--methods", "tree"]
    main([*few, "--workers", "1", "--results", str(tmp_path)])
    assert "lander, ice, taxi, empty, doorkey are left out" in capsys.readouterr().err
    listed = json.loads((tmp_path / "driving.json").read_text())
    memory, wheels = ["shuttle", "carry", "bell"], ["wall", "vacuum", "parking", "follow", "fetch"]
    chores = ["pendulum", "thermostat", "elevator", "sorter", "crossing"]
    assert [one["task"] for one in listed] == ["robot", *memory, *wheels, *chores]


@pytest.mark.parametrize("what", [[], ["corrections"]])
def test_the_command_runs_as_a_module_in_several_processes(tmp_path: Path, what: list[str]) -> None:
    # What is tested comes first: the installed package, if that is.
    path = [*sys.path, str(CHECKOUT)]
    options = ["--quick", "--tasks", "bell", "--workers", "2", "--results", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "driving", *what, *options],
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, path))),
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert f"Written to {tmp_path}" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--tasks", "dance"], 1, "there is no task 'dance'"),
        (["--methods", "magic"], 1, "there is no method 'magic'"),
        (["--wrong", "2"], 1, "wrong is a share from 0"),
        (["--workers", "0"], 1, "--workers is a number from 1 on"),
        (["--sets", "4-2"], 2, "'4-2' is no range of sets"),
        (["--counts", "0,3"], 2, "does not list numbers from 1 on"),
        (["corrections", "--modes", "shout"], 2, "there is no mode 'shout'"),
        (["corrections", "--methods", "default,tree"], 1, "of one method"),
        (["corrections", "--late", "2"], 1, "neither late nor wrong"),
    ],
)
def test_the_command_refuses_in_a_sentence(
    arguments: list[str], code: int, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as raised:
        main(arguments)
    assert raised.value.code == code
    assert sentence in capsys.readouterr().err.splitlines()[-1]
