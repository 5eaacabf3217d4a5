"""The simulated robot, its demonstrator, and what a decision tree learns from it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robot_episodes import Policy, run_episode
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.learning.pipeline import learn
from rebt_ros.simulated_robot.demonstrator import ENOUGH, decide
from rebt_ros.simulated_robot.episode import EpisodeResult
from rebt_ros.simulated_robot.robot import TIME_STEP, Action, Robot, State
from rebt_ros.simulated_robot.world import Obstacle, Point, World, furnished_room

WORLD = furnished_room()
TIME_LIMIT = 60.0

#: Not among the starts that are demonstrated below.
FRESH_STARTS = range(1000, 1040)


def _runs(policy: Policy, starts: Iterable[int]) -> list[EpisodeResult]:
    return [run_episode(Robot(WORLD, start), policy, TIME_LIMIT) for start in starts]


def _reached(results: list[EpisodeResult]) -> float:
    return sum(one.reached for one in results) / len(results)


def _delayed(policy: Policy, steps: int) -> Policy:
    """The policy whose every action comes some steps late."""
    pending: deque[str | None] = deque([None] * steps)

    def late(state: tuple[float, ...]) -> str | None:
        pending.append(policy(state))
        return pending.popleft()

    return late


def _open_world() -> World:
    return World(10.0, (), goal=Point(9.0, 9.0), dock=Point(2.0, 2.0))


def _robot_at(x: float, y: float, heading: float, battery: float = 0.8) -> Robot:
    robot = Robot(_open_world())
    robot.position, robot.heading, robot.battery = Point(x, y), heading, battery
    return robot


def _demonstrated(starts: Iterable[int]) -> tuple[list[State], list[str]]:
    states: list[State] = []
    actions: list[str] = []

    def watched(state: tuple[float, ...]) -> str:
        states.append(State(*state))
        actions.append(decide(state))
        return actions[-1]

    _runs(watched, starts)
    return states, actions


def _learned(starts: Iterable[int]) -> Policy:
    """What a decision tree of the package's default depth learns from demonstrations."""
    states, actions = _demonstrated(starts)
    model = DecisionTreeClassifier(max_depth=5, random_state=0).fit(np.array(states), actions)
    tree = model.tree_

    def policy(state: tuple[float, ...]) -> str:
        node = 0
        while tree.children_left[node] >= 0:
            low = np.float32(state[tree.feature[node]]) <= tree.threshold[node]
            node = (tree.children_left if low else tree.children_right)[node]
        return str(model.classes_[np.argmax(tree.value[node, 0])])

    return policy


# The room


@given(
    x=st.floats(0.01, 9.99),
    y=st.floats(0.01, 9.99),
    first=st.floats(-7.0, 7.0),
    width=st.floats(0.01, math.pi),
)
def test_a_range_is_that_of_the_nearest_point_in_the_cone(
    x: float, y: float, first: float, width: float
) -> None:
    place = Point(x, y)
    if WORLD.clearance(place) <= 0:
        return
    nearest = WORLD.nearest(place, first, first + width)
    # Walking along any ray of the cone, nothing is met before that distance, and at the end of
    # one of them something is.
    rays = np.linspace(first, first + width, 200)
    ends = [
        Point(x + distance * math.cos(ray), y + distance * math.sin(ray))
        for ray in rays
        for distance in np.linspace(0.0, nearest - 1e-9, 10)
    ]
    assert min(map(WORLD.clearance, ends)) > -1e-6
    further = nearest * 1.01 + 0.1
    assert any(
        WORLD.clearance(Point(x + part * math.cos(ray), y + part * math.sin(ray))) <= 0
        for ray in rays
        for part in np.linspace(nearest, further, 10)
    )


def test_a_goal_inside_an_obstacle_is_refused() -> None:
    with pytest.raises(ValueError, match="goal"):
        World(10.0, (Obstacle(Point(5, 5), 1.0),), goal=Point(5.5, 5.0), dock=Point(1.0, 1.0))


# Starts


def test_equal_starts_are_equal_and_others_differ() -> None:
    states = [Robot(WORLD, start).state for start in range(50)]
    assert states == [Robot(WORLD, start).state for start in range(50)]
    assert len(set(states)) == 50


def test_every_third_start_has_a_low_battery() -> None:
    charges = [Robot(WORLD, start).battery for start in range(30)]
    assert max(charges[::3]) < 0.35 < min(charges[1::3] + charges[2::3])


def test_a_run_does_not_depend_on_the_runs_before() -> None:
    used = Robot(WORLD, 3)
    run_episode(used, decide, TIME_LIMIT)
    used.begin(7)
    again = run_episode(used, decide, TIME_LIMIT)
    assert again == run_episode(Robot(WORLD, 7), decide, TIME_LIMIT)


# The robot


def test_it_turns_on_the_spot_and_goes_straight_ahead() -> None:
    robot = _robot_at(5.0, 5.0, heading=0.0)
    for _ in range(10):
        robot.step(Action.TURN_LEFT)
    assert robot.position == Point(5.0, 5.0)
    assert robot.heading == pytest.approx(0.5)
    for _ in range(20):
        robot.step("turn_right")
    assert robot.heading == pytest.approx(-0.5)
    robot.step("go")
    assert robot.position.distance(Point(5.0, 5.0)) == pytest.approx(TIME_STEP)
    assert Point(5.0, 5.0).direction(robot.position) == pytest.approx(-0.5)


@pytest.mark.parametrize("word", [None, "", "stop", "GO", "go ", "charge"])
def test_it_stands_still_at_any_other_word(word: str | None) -> None:
    robot = _robot_at(5.0, 5.0, heading=0.0)
    before = robot.state
    robot.step(word)
    assert robot.state == before


def test_it_measures_from_its_hull_and_not_further_than_its_sensors() -> None:
    state = _robot_at(8.8, 5.0, heading=0.0).state
    assert state.front == pytest.approx(1.0)
    assert state.left == state.right == pytest.approx(1.2 / math.sin(math.radians(60)) - 0.2)
    assert _robot_at(5.0, 5.0, heading=0.0).state.front == 4.0


def test_its_target_is_the_dock_while_the_battery_is_low() -> None:
    assert _robot_at(5.0, 9.0, 0.0, battery=0.5).state.target_bearing == pytest.approx(0.0)
    low = _robot_at(2.0, 9.0, math.pi, battery=0.2).state
    assert low.target_bearing == pytest.approx(math.pi / 2)


def test_a_wall_stops_it_and_is_one_bump() -> None:
    robot = _robot_at(9.0, 5.0, heading=0.0)
    for _ in range(40):
        robot.step("go")
    assert 9.7 < robot.position.x <= 9.8
    assert robot.bumps == 1
    assert robot.state.front < 0.05


def test_driving_drains_the_battery_until_it_stands() -> None:
    robot = _robot_at(5.0, 5.0, heading=0.0, battery=0.002)
    for _ in range(3):
        robot.step("go")
    assert robot.battery == 0.0
    place = robot.position
    robot.step("go")
    assert robot.position == place


def test_it_charges_on_the_dock_only() -> None:
    away, docked = _robot_at(5.0, 5.0, 0.0, 0.5), _robot_at(2.1, 2.0, 0.0, 0.5)
    assert (away.state.docked, docked.state.docked) == (0.0, 1.0)
    for _ in range(20):
        away.step("charge")
        docked.step("charge")
    assert away.battery == 0.5
    assert docked.battery == pytest.approx(0.6)
    docked.step("turn_left")
    assert docked.battery == pytest.approx(0.6)


@given(st.integers(0, 10**9), st.lists(st.sampled_from([*Action, "stop"]), max_size=60))
def test_whatever_it_is_told_it_stays_in_the_free_part_of_the_room(
    start: int, words: list[str]
) -> None:
    robot = Robot(WORLD, start)
    for word in words:
        robot.step(word, 0.3)
        assert WORLD.clearance(robot.position) >= 0.2 - 1e-9
        state = robot.state
        assert all(0.0 <= value <= 4.0 for value in (state.left, state.front, state.right))
        assert -math.pi <= state.target_bearing <= math.pi
        assert 0.0 <= state.battery <= 1.0
        assert state.docked in (0.0, 1.0)


# Runs


def test_a_run_is_lost_when_its_time_is_up() -> None:
    result = run_episode(Robot(WORLD, 1), lambda _: None, time_limit=2.0)
    assert (result.reached, result.seconds, result.start) == (False, 2.0, 1)


def test_a_run_is_lost_when_the_battery_is_empty() -> None:
    result = run_episode(Robot(WORLD, 0), lambda _: "turn_left", TIME_LIMIT)
    assert not result.reached
    assert result.battery == 0.0
    assert result.seconds < TIME_LIMIT


# The demonstrator


def test_the_demonstrator_reaches_the_goal() -> None:
    results = _runs(decide, range(200))
    assert _reached(results) >= 0.97
    assert sum(one.bumps for one in results) == 0
    assert 8.0 < sum(one.seconds for one in results) / 200 < 25.0


def test_the_demonstrator_reaches_the_goal_though_its_actions_come_late() -> None:
    results = [one for start in range(40) for one in _runs(_delayed(decide, 3), [start])]
    assert _reached(results) >= 0.95


@given(
    st.builds(
        State,
        *[st.floats(0.0, 4.0)] * 3,
        st.floats(-math.pi, math.pi),
        st.floats(0.0, 1.0),
        st.sampled_from([0.0, 1.0]),
    )
)
def test_the_demonstrator_always_knows_a_word_that_the_robot_obeys(state: State) -> None:
    assert decide(state) in set(Action)


def test_who_does_not_charge_does_not_arrive_from_a_start_with_a_low_battery() -> None:
    def careless(state: tuple[float, ...]) -> str:
        return decide(State(*state)._replace(docked=0.0))

    results = _runs(careless, range(30))
    assert _reached(results[::3]) == 0.0
    assert _reached(results[1::3]) == 1.0


# Learning


@pytest.mark.parametrize("shown", [range(8), range(100, 110), range(200, 212)])
def test_a_decision_tree_drives_as_well_as_the_demonstrator_it_learned_from(shown: range) -> None:
    results = _runs(_learned(shown), FRESH_STARTS)
    assert _reached(results) >= 0.95 * _reached(_runs(decide, FRESH_STARTS))


@pytest.mark.parametrize("first", [0, 50, 200])
def test_a_behavior_tree_drives_as_well_after_as_many_demonstrations_as_the_demo_shows(
    first: int,
) -> None:
    features = tuple(Feature(name) for name in State._fields)
    demonstrations = []
    for start in range(first, first + ENOUGH):
        shown = zip(*_demonstrated([start]), strict=True)
        rows = [Row(t, "action", action, None, state) for t, (state, action) in enumerate(shown)]
        demonstrations.append(Demonstration.from_rows(str(start), features, rows))
    runtime = TreeRuntime(learn(demonstrations))

    def policy(state: tuple[float, ...]) -> str:
        return runtime.tick(state).actions[0].label

    assert _reached(_runs(policy, FRESH_STARTS)) >= 0.95


def test_a_learned_tree_still_arrives_when_its_actions_come_late() -> None:
    learned = _learned(range(10))
    results = [one for start in FRESH_STARTS for one in _runs(_delayed(learned, 2), [start])]
    assert _reached(results) >= 0.95


def test_the_demonstrations_show_every_action_the_robot_knows() -> None:
    assert set(_demonstrated(range(3))[1]) == set(Action)
