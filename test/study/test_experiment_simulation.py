"""The paper's agent-based simulation, and that its trees are ticked as py_trees would."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import OptionError
from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    ExperimentConfig,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
)
from rebt_ros.study.simulator.configuration_file import parse_config
from rebt_ros.study.simulator.py_trees_form import py_trees_form
from rebt_ros.study.simulator.synthetic_robot import (
    TICK_PERIOD,
    ExperimentBody,
    ExperimentRobot,
    simulate,
)
from rebt_ros.study.simulator.ticking import Outcome, ticker

EXPERIMENTS = Path(__file__).resolve().parents[3] / "shared" / "experiments"

OUTCOMES = {"S": Outcome.SUCCESS, "F": Outcome.FAILURE, "R": Outcome.RUNNING}
STATUS = {
    Outcome.SUCCESS: Status.SUCCESS,
    Outcome.FAILURE: Status.FAILURE,
    Outcome.RUNNING: Status.RUNNING,
}
A, B = Act("a"), Act("b")


class ScriptedBody:
    """Actions return what a script says, one letter per attempt; checks are read alike."""

    def __init__(self, **scripts: str) -> None:
        self._scripts = {label: iter(script) for label, script in scripts.items()}
        self.attempted = ""

    def sense(self, check: Check) -> bool:
        self.attempted += check.variable
        return next(self._scripts[check.variable]) == "S"

    def attempt(self, act: Act) -> Outcome:
        self.attempted += act.label
        return OUTCOMES[next(self._scripts[act.label])]


def play(tree: SimulatedNode, ticks: int, **scripts: str) -> list[str]:
    """For each tick, what was attempted and what the tree returned, as in ``ab:R``."""
    body = ScriptedBody(**scripts)
    root = ticker(tree, body, repeats=2)
    table = []
    for _ in range(ticks):
        body.attempted = ""
        letter = root.tick().name[0]
        table.append(f"{body.attempted}:{letter}")
    return table


def test_a_sequence_stops_at_a_failure_and_begins_again() -> None:
    tree = Group(GroupKind.SEQUENCE, (A, B))
    # tick        1     2      3
    assert play(tree, 3, a="FSS", b="FS") == ["a:F", "ab:F", "ab:S"]


def test_a_sequence_resumes_at_the_child_that_runs() -> None:
    tree = Group(GroupKind.SEQUENCE, (Check("x", 0.5), A, B))
    assert play(tree, 4, x="SF", a="S", b="RRS") == ["xab:R", "b:R", "b:S", "x:F"]


def test_a_selector_asks_its_first_child_at_every_tick() -> None:
    tree = Group(GroupKind.SELECTOR, (Check("x", 0.5), A))
    assert play(tree, 4, x="FFSF", a="RRF") == ["xa:R", "xa:R", "x:S", "xa:F"]


def test_a_selector_halts_the_child_that_ran_when_an_earlier_one_succeeds() -> None:
    resuming = Group(GroupKind.SEQUENCE, (A, B))
    tree = Group(GroupKind.SELECTOR, (Check("x", 0.5), resuming))
    # At the third tick the Sequence begins with a again.
    assert play(tree, 3, x="FSF", a="SS", b="RS") == ["xab:R", "x:S", "xab:S"]


@pytest.mark.parametrize("kind", [GroupKind.PARALLEL, GroupKind.PARALLEL_SELECTOR])
def test_a_parallel_waits_for_all_and_ticks_none_again_that_has_succeeded(kind: GroupKind) -> None:
    assert play(Group(kind, (A, B)), 4, a="SS", b="RRSS") == ["ab:R", "b:R", "b:S", "ab:S"]


def test_a_parallel_fails_with_a_child_and_halts_the_others() -> None:
    resuming = Group(GroupKind.SEQUENCE, (A, B))
    tree = Group(GroupKind.PARALLEL, (resuming, Check("x", 0.5)))
    assert play(tree, 2, a="SS", b="RS", x="FS") == ["abx:F", "abx:S"]


def test_a_repeater_goes_through_its_children_several_times_in_a_tick() -> None:
    tree = Group(GroupKind.REPEATER, (Check("x", 0.5), A))
    assert play(tree, 1, x="SS", a="SS") == ["xaxa:S"]


def test_a_repeater_resumes_where_it_was_in_whatever_round() -> None:
    tree = Group(GroupKind.REPEATER, (A, B))
    assert play(tree, 3, a="SRS", b="SRS") == ["aba:R", "ab:R", "b:S"]


def test_a_repeater_that_fails_begins_with_its_first_round() -> None:
    tree = Group(GroupKind.REPEATER, (Check("x", 0.5), A))
    assert play(tree, 2, x="SFSS", a="SSS") == ["xax:F", "xaxa:S"]


def test_an_inverted_node_turns_success_and_failure_and_keeps_running() -> None:
    assert play(Inverted(A), 3, a="SFR") == ["a:F", "a:S", "a:R"]


checks = st.builds(
    Check, st.sampled_from("xy"), st.sampled_from([0.3, 0.7]), st.sampled_from([0.8, 1.0])
)
acts = st.builds(Act, st.sampled_from("abc"), st.sampled_from([0.7, 1.0]))
trees = st.recursive(
    st.one_of(checks, acts),
    lambda inner: st.one_of(
        st.builds(Inverted, inner),
        st.builds(
            Group, st.sampled_from(GroupKind), st.lists(inner, min_size=1, max_size=4).map(tuple)
        ),
    ),
    max_leaves=12,
)


@settings(max_examples=150)
@given(tree=trees, seed=st.integers(0, 10**6), running_chance=st.sampled_from([0.0, 0.4, 0.8]))
def test_trees_do_at_every_tick_what_py_trees_does(
    tree: SimulatedNode, seed: int, running_chance: float
) -> None:
    ours = ExperimentBody(("x", "y"), str(seed), running_chance)
    theirs = ExperimentBody(("x", "y"), str(seed), running_chance)
    root, behaviour = ticker(tree, ours, repeats=3), py_trees_form(tree, theirs, repeats=3)
    for _ in range(30):
        ours.change_environment()
        theirs.change_environment()
        outcome = root.tick()
        behaviour.tick_once()
        assert STATUS[outcome] is behaviour.status
        assert ours.log == theirs.log


def config(*children: SimulatedNode, name: str = "it") -> ExperimentConfig:
    return ExperimentConfig(name, Group(GroupKind.SEQUENCE, children))


X = Check("/x", 0.5)


def columns(run_of: ExperimentConfig, seed: int, ticks: int = 300) -> list[list[float]]:
    run = simulate(ExperimentRobot(run_of, seed), ticks)
    shown = run.demonstration
    return [shown.stamps.tolist(), shown.chosen.tolist(), shown.states.ravel().tolist()]


def test_equal_seeds_give_equal_demonstrations_and_others_differ() -> None:
    tree = config(X, A, B)
    assert columns(tree, 7) == columns(tree, 7)
    assert columns(tree, 7) != columns(tree, 8)
    assert columns(tree, 7) != columns(dataclasses.replace(tree, name="other"), 7)


def test_draws_are_the_same_on_every_version_and_machine() -> None:
    robot = ExperimentRobot(config(X, A), 1)
    robot.step()
    assert robot.state == (0.6710708756505428,)


def test_the_environment_does_not_depend_on_what_the_tree_does() -> None:
    one, other = ExperimentRobot(config(X, A), 1), ExperimentRobot(config(Inverted(X), B, A), 1)
    for _ in range(20):
        one.step()
        other.step()
        assert one.state == other.state


def test_every_variable_is_uniform_and_drawn_at_every_tick() -> None:
    robot = ExperimentRobot(config(X, A), 3, variables=("/x", "/unread"))
    states = []
    for _ in range(4000):
        robot.step()
        states.append(robot.state)
    drawn = np.array(states)
    assert len(np.unique(drawn[:, 0])) == len(np.unique(drawn[:, 1])) == 4000
    assert np.histogram(drawn[:, 1], bins=4, range=(0, 1))[0] == pytest.approx(1000, abs=120)
    assert drawn.min() >= 0
    assert drawn.max() < 1


def test_an_action_is_logged_in_the_tick_and_environment_in_which_it_is_done() -> None:
    run = simulate(ExperimentRobot(config(X, A), 5, running_chance=0.0), 2000)
    shown = run.demonstration
    robot = ExperimentRobot(config(X, A), 5)
    environment = []
    for _ in range(2000):
        robot.step()
        environment.append(robot.state)
    ticks = [tick for tick, (value,) in enumerate(environment) if value < 0.5]
    assert shown.states.tolist() == [list(environment[tick]) for tick in ticks]
    assert shown.stamps.tolist() == [(tick + 1) * TICK_PERIOD for tick in ticks]
    assert run.succeeded.all()


def rows_of_one_action(ticks: int, **options: float) -> int:
    robot = ExperimentRobot(config(A), 2, **options)  # type: ignore[arg-type]
    return len(simulate(robot, ticks).demonstration)


def test_nothing_is_logged_while_an_action_runs() -> None:
    assert rows_of_one_action(5000, running_chance=0.0) == 5000
    assert rows_of_one_action(5000) == pytest.approx(3000, abs=120)
    assert rows_of_one_action(5000, running_chance=0.9) == pytest.approx(500, abs=80)


def test_a_failed_action_is_logged_as_such_and_fails_its_sequence() -> None:
    run = simulate(ExperimentRobot(config(Act("a", 0.25), B), 2, running_chance=0.0), 4000)
    shown = run.demonstration
    is_a = np.array(shown.actions)[shown.chosen] == "a"
    assert np.mean(run.succeeded[is_a]) == pytest.approx(0.25, abs=0.03)
    assert int(np.sum(~is_a)) == int(np.sum(run.succeeded[is_a]))


def test_a_check_is_right_with_its_probability() -> None:
    run = simulate(ExperimentRobot(config(Check("/x", 0.5, 0.9), A), 2, running_chance=0), 4000)
    assert np.mean(run.demonstration.states < 0.5) == pytest.approx(0.9, abs=0.03)


def test_features_are_the_environment_variables_and_no_more() -> None:
    run = simulate(ExperimentRobot(config(Check("/y", 0.5), X, A, B), 1), 400)
    (table,) = tabulate([run.demonstration])
    assert [feature.name for feature in table.features] == ["/x", "/y"]
    assert table.actions == ("a", "b")


def test_an_action_that_never_occurred_is_not_among_the_actions() -> None:
    never = Check("/x", 0.0)
    shown = simulate(ExperimentRobot(config(B, never, A), 1), 50).demonstration
    assert shown.actions == ("b",)
    assert set(shown.chosen) == {0}


def test_a_run_without_any_action_is_an_empty_demonstration() -> None:
    run = simulate(ExperimentRobot(config(Check("/x", 0.0), A), 1), 50)
    assert len(run.demonstration) == len(run.succeeded) == 0


def test_progress_is_reported_as_a_share() -> None:
    shares: list[float] = []
    simulate(ExperimentRobot(config(A), 1), 2500, shares.append)
    assert shares == [0.0, 0.4, 0.8]


def test_a_watcher_sees_every_tick_and_all_that_is_done() -> None:
    seen: list[tuple[int, tuple[float, ...], int]] = []
    run = simulate(
        ExperimentRobot(config(X, A, B), 1),
        200,
        watch=lambda stamp, state, done: seen.append((stamp, state, len(done))),
    )
    assert [stamp for stamp, _, _ in seen] == [TICK_PERIOD * tick for tick in range(1, 201)]
    done = [(stamp, list(state)) for stamp, state, count in seen for _ in range(count)]
    shown = run.demonstration
    assert done == list(zip(shown.stamps.tolist(), shown.states.tolist(), strict=True))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"running_chance": 1.0}, "the running chance is 1"),
        ({"running_chance": -0.1}, "the running chance is -0.1"),
        ({"repeats": 0}, "repeats is 0"),
        ({"variables": ("/y",)}, "reads the variable '/x'"),
    ],
)
def test_settings_that_make_no_sense_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        ExperimentRobot(config(X, A), 0, **options)  # type: ignore[arg-type]


def test_no_ticks_are_refused() -> None:
    with pytest.raises(OptionError, match="ticks is 0"):
        simulate(ExperimentRobot(config(A), 0), 0)


def paths() -> Iterable[Path]:
    return sorted(EXPERIMENTS.glob("*.json"))[::12]


@pytest.mark.skipif(not EXPERIMENTS.is_dir(), reason=f"there is no {EXPERIMENTS}")
@pytest.mark.parametrize("path", paths(), ids=lambda path: path.stem)
def test_the_authors_trees_do_what_py_trees_does(path: Path) -> None:
    read = parse_config(path.read_text(encoding="utf-8"), path.stem)
    theirs = ExperimentBody(read.variables, f"4 {read.name}", 0.4)
    behaviour = py_trees_form(read.root, theirs, repeats=3)
    robot = ExperimentRobot(read, 4)
    done = 0
    for _ in range(150):
        log = robot.step()
        theirs.change_environment()
        behaviour.tick_once()
        assert log == theirs.log
        assert robot.state == tuple(theirs.environment.values())
        done += len(log)
    assert done > 0
