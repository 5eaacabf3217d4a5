"""The behavior tree as it is ticked: what every kind of node does, tick by tick.

A script gives what the commander answers for each action at each tick: R running, S success,
F failure.  The tables beside the tests show the ticks as rows.
"""

from __future__ import annotations

import gc
import itertools
import math
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.prediction import States, as_it_stands, choose
from rebt_ros.behavior_tree.runtime import StateEncoder, SucceedAtOnce, TreeRuntime, executable
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)

GO, GRASP, TURN, WAIT = some.ACTIONS
STATUS = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}

NEAR = some.at_most("distance", 0.3)
LOW = some.at_most("battery", 0.2)
DOCKED = Literal(IsTrue("docked"))
CUP = Literal(HasCategory("kind", "cup"))
BETWEEN = Literal(Interval("distance", 0.1, 0.3))
AHEAD = some.at_most(some.DIFFERENCE, 0.0)
APART = Literal(Interval(some.DIFFERENCE, 0.0, 0.5))

#: Distance, battery, docked, kind.
FAR_AWAY = (1.0, 1.0, 0.0, 0.0)
NEARBY = (0.1, 1.0, 0.0, 0.0)


class Scripted:
    """Answers from a script, letter by letter, the last one for ever; notes what it is told."""

    def __init__(self, **script: str) -> None:
        self.script = script
        self.log: list[str] = []

    def update(self, action: nodes.Action) -> Status:
        self.log.append(action.label)
        letters = self.script.get(action.label, "S")
        self.script[action.label] = letters[1:] or letters
        return STATUS[letters[0]]

    def halt(self, action: nodes.Action) -> None:
        self.log.append(f"halt {action.label}")


def run(
    tree: nodes.Node, commander: Scripted, states: Sequence[Sequence[float]]
) -> list[tuple[str, str]]:
    """The tree's status and what the commander was told, for each tick."""
    runtime = TreeRuntime(some.learned(tree), commander)
    ticks = []
    for state in states:
        commander.log.clear()
        tick = runtime.tick(state)
        assert [one.label for one in tick.actions] == [
            entry for entry in commander.log if not entry.startswith("halt")
        ]
        ticks.append((tick.status.name[0], ", ".join(commander.log)))
    return ticks


# --- leaves and Inverters ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("literal", "state", "status"),
    [
        (NEAR, (0.3, 0, 0, 0), "S"),
        (NEAR, (math.nextafter(0.3, 1), 0, 0, 0), "F"),
        (~NEAR, (0.3, 0, 0, 0), "F"),
        (~NEAR, (0.31, 0, 0, 0), "S"),
        (DOCKED, (0, 0, 1.0, 0), "S"),
        (DOCKED, (0, 0, 0.0, 0), "F"),
        (CUP, (0, 0, 0, 1.0), "S"),
        (CUP, (0, 0, 0, 2.0), "F"),
        (BETWEEN, (0.1, 0, 0, 0), "F"),
        (BETWEEN, (math.nextafter(0.1, 1), 0, 0, 0), "S"),
        (BETWEEN, (0.3, 0, 0, 0), "S"),
        (BETWEEN, (math.nextafter(0.3, 1), 0, 0, 0), "F"),
        (~BETWEEN, (0.1, 0, 0, 0), "S"),
        # A missing value satisfies no condition, and every negation.
        (BETWEEN, (math.nan, 0, 0, 0), "F"),
        (~BETWEEN, (math.nan, 0, 0, 0), "S"),
        (NEAR, (math.nan, 0, 0, 0), "F"),
        (~NEAR, (math.nan, 0, 0, 0), "S"),
        (DOCKED, (0, 0, math.nan, 0), "F"),
        (~DOCKED, (0, 0, math.nan, 0), "S"),
        (CUP, (0, 0, 0, math.nan), "F"),
        (~CUP, (0, 0, 0, math.nan), "S"),
        # Distance minus battery.
        (AHEAD, (0.75, 0.5, 0, 0), "F"),
        (AHEAD, (0.5, 0.5, 0, 0), "S"),
        (AHEAD, (0.25, 0.5, 0, 0), "S"),
        (~AHEAD, (0.75, 0.5, 0, 0), "S"),
        (APART, (0.5, 0.5, 0, 0), "F"),
        (APART, (0.75, 0.5, 0, 0), "S"),
        (APART, (1.0, 0.5, 0, 0), "S"),
        (APART, (1.5, 0.5, 0, 0), "F"),
        (AHEAD, (math.nan, 0.5, 0, 0), "F"),
        (AHEAD, (0.5, math.nan, 0, 0), "F"),
        (~AHEAD, (0.5, math.nan, 0, 0), "S"),
        (~APART, (math.nan, math.nan, 0, 0), "S"),
        # Nothing was done before the first tick.
        (Literal(PreviousActionIs("go")), (0, 0, 0, 0), "F"),
        (~Literal(PreviousActionIs("go")), (0, 0, 0, 0), "S"),
        (Literal(LastActionIs("go")), (0, 0, 0, 0), "F"),
        (~Literal(LastActionIs("go")), (0, 0, 0, 0), "S"),
    ],
)
def test_a_condition_succeeds_where_its_literal_holds(
    literal: Literal, state: tuple[float, ...], status: str
) -> None:
    assert run(nodes.Condition(literal), Scripted(), [state]) == [(status, "")]
    inverted = nodes.Inverter(nodes.Condition(literal))
    opposite = {"S": "F", "F": "S"}[status]
    assert run(inverted, Scripted(), [state]) == [(opposite, "")]


@settings(max_examples=100)
@given(some.literals(some.conditions(history=False)), some.states)
def test_a_condition_means_what_it_is_defined_to_mean(
    literal: Literal, state: tuple[float, ...]
) -> None:
    ((status, _),) = run(nodes.Condition(literal), Scripted(), [state])
    assert status == ("S" if some.holds(literal, state) else "F")


def test_an_action_has_the_status_that_the_commander_says() -> None:
    ticks = run(GO, Scripted(go="RRSRF"), [FAR_AWAY] * 5)
    assert ticks == [("R", "go"), ("R", "go"), ("S", "go"), ("R", "go"), ("F", "go")]


def test_an_inverter_turns_an_action_round_unless_it_runs() -> None:
    ticks = run(nodes.Inverter(GO), Scripted(go="RSF"), [FAR_AWAY] * 3)
    assert ticks == [("R", "go"), ("F", "go"), ("S", "go")]


def test_actions_succeed_at_once_unless_there_is_a_commander() -> None:
    tick = TreeRuntime(some.learned(GO)).tick(FAR_AWAY)
    assert tick.status is Status.SUCCESS
    assert tick.actions == (GO,)
    assert SucceedAtOnce().update(GO) is Status.SUCCESS


# --- Sequence and Selector --------------------------------------------------------------------

TABLES = [
    pytest.param(
        # go   turn   Sequence
        # R    -      R
        # S    R      R
        # S    R      R   go is asked again, as there is no memory
        # S    S      S
        # F    -      F
        nodes.Sequence((GO, TURN)),
        {"go": "RSSSF", "turn": "RRS"},
        [("R", "go"), ("R", "go, turn"), ("R", "go, turn"), ("S", "go, turn"), ("F", "go")],
        id="Sequence",
    ),
    pytest.param(
        # go   turn   Sequence
        # R    -      R
        # S    R      R
        # -    R      R   resumes at turn
        # -    S      S
        # F    -      F   starts again
        nodes.Sequence((GO, TURN), memory=True),
        {"go": "RSF", "turn": "RRS"},
        [("R", "go"), ("R", "go, turn"), ("R", "turn"), ("S", "turn"), ("F", "go")],
        id="Sequence with memory",
    ),
    pytest.param(
        # go   turn   Sequence
        # S    R      R
        # F    halt   F   an earlier child fails: the later one is interrupted
        # S    R      R
        nodes.Sequence((GO, TURN)),
        {"go": "SFS", "turn": "R"},
        [("R", "go, turn"), ("F", "go, halt turn"), ("R", "go, turn")],
        id="Sequence that is interrupted",
    ),
    pytest.param(
        # go   turn   Selector
        # R    -      R
        # F    R      R
        # F    R      R   go is asked again
        # F    S      S
        # F    F      F
        nodes.Selector((GO, TURN)),
        {"go": "RFFFF", "turn": "RRSF"},
        [
            ("R", "go"),
            ("R", "go, turn"),
            ("R", "go, turn"),
            ("S", "go, turn"),
            ("F", "go, turn"),
        ],
        id="Selector",
    ),
    pytest.param(
        # go   turn   Selector
        # F    R      R
        # -    R      R   resumes at turn
        # -    F      F
        # S    -      S
        nodes.Selector((GO, TURN), memory=True),
        {"go": "FS", "turn": "RRF"},
        [("R", "go, turn"), ("R", "turn"), ("F", "turn"), ("S", "go")],
        id="Selector with memory",
    ),
    pytest.param(
        # go   turn   Selector
        # F    R      R
        # R    halt   R   an earlier child takes over
        # S    -      S
        nodes.Selector((GO, TURN)),
        {"go": "FRS", "turn": "R"},
        [("R", "go, turn"), ("R", "go, halt turn"), ("S", "go")],
        id="Selector that switches",
    ),
    pytest.param(
        # go   turn   PSA: acts as a Selector without memory
        # R    -      R
        # F    S      S
        # S    -      S
        # F    F      F
        nodes.ParallelSelector((GO, TURN)),
        {"go": "RFSF", "turn": "SF"},
        [("R", "go"), ("S", "go, turn"), ("S", "go"), ("F", "go, turn")],
        id="ParallelSelector",
    ),
    pytest.param(
        # go   turn   PSA: the first action is asked again while the second runs
        # F    R      R
        # S    -      S
        nodes.ParallelSelector((GO, TURN)),
        {"go": "FS", "turn": "R"},
        [("R", "go, turn"), ("S", "go, halt turn")],
        id="ParallelSelector without memory",
    ),
    pytest.param(
        # go   turn   Parallel
        # R    R      R
        # S    R      R   succeeds when all have succeeded
        # S    S      S
        nodes.Parallel((GO, TURN)),
        {"go": "RSS", "turn": "RRS"},
        [("R", "go, turn"), ("R", "go, turn"), ("S", "go, turn")],
        id="Parallel",
    ),
    pytest.param(
        # go   turn   Parallel
        # R    F      F   one fails: the other is interrupted, once
        # F    S      F
        nodes.Parallel((GO, TURN)),
        {"go": "RF", "turn": "FS"},
        [("F", "go, turn, halt go"), ("F", "go, turn")],
        id="Parallel that fails",
    ),
    pytest.param(
        # go   turn   Repeater
        # R    -      R
        # S    R      R
        # -    S      R   all have succeeded: it will start again
        # R    -      R
        # S    F      F
        # S    S      R   and may be started again
        nodes.Repeater((GO, TURN)),
        {"go": "RSRSS", "turn": "RSFS"},
        [
            ("R", "go"),
            ("R", "go, turn"),
            ("R", "turn"),
            ("R", "go"),
            ("F", "go, turn"),
            ("R", "go, turn"),
        ],
        id="Repeater",
    ),
    pytest.param(
        # go   Repeater
        # S    R
        # S    R
        # F    F
        nodes.Repeater((GO,)),
        {"go": "SSF"},
        [("R", "go"), ("R", "go"), ("F", "go")],
        id="Repeater of one action",
    ),
]


@pytest.mark.parametrize(("tree", "script", "ticks"), TABLES)
def test_tick_table(tree: nodes.Node, script: dict[str, str], ticks: list[tuple[str, str]]) -> None:
    assert run(tree, Scripted(**script), [FAR_AWAY] * len(ticks)) == ticks


def test_a_repeater_is_left_when_its_guard_fails_and_starts_at_its_first_child_again() -> None:
    # near  Repeater            else
    # S     go S, turn R        -
    # S     turn R              -
    # F     halt turn           wait
    # S     go S, turn R        -
    tree = nodes.Selector((some.when(NEAR, then=nodes.Repeater((GO, TURN))), some.action("wait")))
    ticks = run(tree, Scripted(turn="R"), [NEARBY, NEARBY, FAR_AWAY, NEARBY])
    assert ticks == [
        ("R", "go, turn"),
        ("R", "turn"),
        ("S", "halt turn, wait"),
        ("R", "go, turn"),
    ]


def test_a_rule_whose_condition_fails_interrupts_its_action_before_the_next_rule_acts() -> None:
    tree = nodes.Selector((some.when(NEAR, then=TURN), some.when(~NEAR, then=GO)))
    ticks = run(tree, Scripted(go="R", turn="R"), [NEARBY, NEARBY, FAR_AWAY, NEARBY])
    assert ticks == [
        ("R", "turn"),
        ("R", "turn"),
        ("R", "halt turn, go"),
        ("R", "turn, halt go"),
    ]


def with_own_labels(node: nodes.Node, numbers: Iterator[int]) -> nodes.Node:
    """The tree with a label of its own for every Action node."""
    match node:
        case nodes.Action():
            return some.action(f"action {next(numbers)}")
        case nodes.Inverter(child=child):
            return nodes.Inverter(with_own_labels(child, numbers))
        case nodes.Condition():
            return node
        case _:
            children = tuple(with_own_labels(child, numbers) for child in node.children)
            return replace(node, children=children)


class Watched:
    """Answers at random, and knows which actions run and which were ticked."""

    def __init__(self, answers: Sequence[str]) -> None:
        self.answers = itertools.cycle(answers)
        self.running: set[str] = set()
        self.ticked: set[str] = set()

    def update(self, action: nodes.Action) -> Status:
        status = STATUS[next(self.answers)]
        self.ticked.add(action.label)
        self.running.discard(action.label)
        if status is Status.RUNNING:
            self.running.add(action.label)
        return status

    def halt(self, action: nodes.Action) -> None:
        assert action.label in self.running
        self.running.remove(action.label)


@settings(max_examples=100)
@given(
    some.trees(),
    st.lists(st.tuples(some.states, st.booleans()), min_size=1, max_size=6),
    st.text("RSF", min_size=1),
)
def test_an_action_that_runs_is_asked_again_at_the_next_tick_or_halted_once(
    drawn: nodes.Node, script: list[tuple[tuple[float, ...], bool]], answers: str
) -> None:
    tree = with_own_labels(drawn, itertools.count())
    commander = Watched(answers)
    runtime = TreeRuntime(some.learned(tree), commander)
    for state, halted in script:
        commander.ticked.clear()
        runtime.tick(state)
        assert commander.running <= commander.ticked
        assert commander.running == {
            node.label
            for node, status in zip(nodes.walk(tree), runtime.snapshot(), strict=True)
            if isinstance(node, nodes.Action) and status == "RUNNING"
        }
        if halted:
            runtime.halt()
            assert not commander.running


# --- halting ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tree",
    [
        GO,
        nodes.Sequence((TURN, GO), memory=True),
        nodes.Selector((nodes.Inverter(TURN), GO)),
        nodes.Parallel((TURN, GO)),
        nodes.Repeater((TURN, GO)),
        nodes.Parallel((nodes.Repeater((TURN, nodes.Inverter(GO))), TURN)),
    ],
)
def test_halting_interrupts_a_running_action_exactly_once(tree: nodes.Node) -> None:
    commander = Scripted(go="R")
    runtime = TreeRuntime(some.learned(tree), commander)
    runtime.tick(FAR_AWAY)
    commander.log.clear()
    runtime.halt()
    assert commander.log == ["halt go"]
    runtime.halt()
    assert commander.log == ["halt go"]
    assert set(runtime.snapshot()) == {"INVALID"}


def test_halting_leaves_alone_what_does_not_run() -> None:
    commander = Scripted()
    runtime = TreeRuntime(some.learned(nodes.Sequence((GO, TURN))), commander)
    runtime.halt()
    runtime.tick(FAR_AWAY)
    runtime.halt()
    assert commander.log == ["go", "turn"]


def test_after_halting_a_memory_starts_afresh_but_lat_goes_on() -> None:
    tree = nodes.Sequence((GO, TURN), memory=True)
    commander = Scripted(turn="R")
    runtime = TreeRuntime(some.learned(tree), commander)
    runtime.tick(FAR_AWAY)
    runtime.halt()
    commander.log.clear()
    runtime.tick(FAR_AWAY)
    assert commander.log == ["go", "turn"]
    assert runtime.histories[some.CHANNEL].before() == "turn"


# --- the previous action ----------------------------------------------------------------------


def doing(action: str) -> Literal:
    return Literal(PreviousActionIs(action))


#: By turns: turns after going, waits after turning, and goes otherwise.
BY_TURNS = nodes.Selector(
    (some.when(doing("go"), then=TURN), some.when(doing("turn"), then=WAIT), GO)
)
#: Turns where it is near, does nothing where it is docked, waits after going, goes otherwise.
DISTURBED = nodes.Selector(
    (
        some.when(NEAR, then=TURN),
        some.when(~DOCKED, doing("go"), then=WAIT),
        some.when(~DOCKED, then=GO),
    )
)
DOCK = (1.0, 1.0, 1.0, 0.0)

PREVIOUS_TABLES = [
    pytest.param(
        # go   turn  wait   previous
        # R    -     -      -
        # halt R     -      go     a sample: what was commanded at the tick before
        # -    halt  R      turn
        # R    -     halt   wait
        # halt F     -      go     turn fails, and going is the next rule
        BY_TURNS,
        RowKind.SAMPLE,
        {"go": "R", "turn": "RF", "wait": "R"},
        [FAR_AWAY] * 5,
        ["go", "turn, halt go", "halt turn, wait", "halt wait, go", "turn, go"],
        [None, "go", "turn", "wait", "go", "go"],
        id="samples of running actions",
    ),
    pytest.param(
        # go   turn  wait   previous
        # R    -     -      -
        # R    -     -      -      still under way: nothing has ended
        # S    -     -      -
        # -    R     -      go
        # -    S     -      go
        # -    -     S      turn
        # S    -     -      wait
        BY_TURNS,
        RowKind.EVENT,
        {"go": "RRS", "turn": "RS", "wait": "S"},
        [FAR_AWAY] * 7,
        ["go", "go", "go", "turn", "turn", "wait", "go"],
        [None, None, None, "go", "go", "turn", "wait", "go"],
        id="events that run and succeed",
    ),
    pytest.param(
        # go   turn   previous
        # F    -      -      it failed, and so has ended
        # F    F      go     in the order in which they were ticked: going ended last
        BY_TURNS,
        RowKind.EVENT,
        {"go": "F", "turn": "F"},
        [FAR_AWAY] * 2,
        ["go", "turn, go"],
        [None, "go", "go"],
        id="events that fail",
    ),
    pytest.param(
        # state  go    turn   wait   previous
        # far    R     -      -      -
        # near   halt  R      -      -      going has ended, as turning takes its place
        # far    -     halt   R      go     and so has turning
        # far    R     -      halt   turn
        DISTURBED,
        RowKind.EVENT,
        {"go": "R", "turn": "R", "wait": "R"},
        [FAR_AWAY, NEARBY, FAR_AWAY, FAR_AWAY],
        ["go", "turn, halt go", "halt turn, wait", "halt wait, go"],
        [None, None, "go", "turn", "wait"],
        id="events that are interrupted by another action",
    ),
    pytest.param(
        # state   go    wait   previous
        # far     R     -      -
        # docked  halt  -      -     interrupted, and nothing takes its place
        # docked  -     -      go
        # far     -     S      go
        DISTURBED,
        RowKind.EVENT,
        {"go": "R"},
        [FAR_AWAY, DOCK, DOCK, FAR_AWAY],
        ["go", "halt go", "", "wait"],
        [None, None, "go", "go", "wait"],
        id="events that are interrupted by nothing",
    ),
    pytest.param(
        # state   go    wait   previous
        # far     R     -      -
        # docked  halt  -      go    a tick without a command leaves it as it is
        # docked  -     -      go
        # far     -     S      go
        DISTURBED,
        RowKind.SAMPLE,
        {"go": "R"},
        [FAR_AWAY, DOCK, DOCK, FAR_AWAY],
        ["go", "halt go", "", "wait"],
        [None, "go", "go", "go", "wait"],
        id="samples without a command",
    ),
    pytest.param(
        # go   turn   previous
        # S    R      -
        # -    R      go    a Sequence with memory: going has ended, turning has not
        # -    S      go
        nodes.Sequence((GO, TURN), memory=True),
        RowKind.EVENT,
        {"turn": "RRS"},
        [FAR_AWAY] * 3,
        ["go, turn", "turn", "turn"],
        [None, "go", "go", "turn"],
        id="events one after the other",
    ),
    pytest.param(
        # go   turn   previous
        # S    R      -
        # -    R      turn
        nodes.Sequence((GO, TURN), memory=True),
        RowKind.SAMPLE,
        {"turn": "RRS"},
        [FAR_AWAY] * 2,
        ["go, turn", "turn"],
        [None, "turn", "turn"],
        id="samples one after the other",
    ),
]


@pytest.mark.parametrize(("tree", "kind", "script", "states", "log", "previous"), PREVIOUS_TABLES)
def test_tick_table_of_the_previous_action(
    tree: nodes.Node,
    kind: RowKind,
    script: dict[str, str],
    states: list[tuple[float, ...]],
    log: list[str],
    previous: list[str | None],
) -> None:
    commander = Scripted(**script)
    runtime = TreeRuntime(some.learned(tree, row_kind=kind), commander)
    history = runtime.histories[some.CHANNEL]
    seen, told = [history.previous], []
    for state in states:
        commander.log.clear()
        runtime.tick(state)
        told.append(", ".join(commander.log))
        seen.append(history.previous)
    assert told == log
    assert seen == previous


@pytest.mark.parametrize(("kind", "previous"), [(RowKind.EVENT, "turn"), (RowKind.SAMPLE, "turn")])
def test_what_runs_has_ended_once_the_tree_is_halted(kind: RowKind, previous: str) -> None:
    runtime = TreeRuntime(some.learned(BY_TURNS, row_kind=kind), Scripted(turn="R"))
    for _ in range(2):
        runtime.tick(FAR_AWAY)
    runtime.halt()
    history = runtime.histories[some.CHANNEL]
    assert history.previous == previous
    assert runtime.tick(FAR_AWAY).actions == (WAIT,)
    # It is not counted a second time.
    assert history.previous == "wait"


def test_halting_what_does_not_run_leaves_the_previous_action() -> None:
    for kind in RowKind:
        runtime = TreeRuntime(some.learned(BY_TURNS, row_kind=kind))
        runtime.halt()
        assert runtime.histories[some.CHANNEL].previous is None
        runtime.tick(FAR_AWAY)
        runtime.halt()
        assert runtime.histories[some.CHANNEL].previous == "go"


@pytest.mark.parametrize("kind", RowKind)
def test_what_a_person_did_is_the_previous_action(kind: RowKind) -> None:
    runtime = TreeRuntime(some.learned(BY_TURNS, row_kind=kind), Scripted(go="R"))
    history = runtime.histories[some.CHANNEL]
    runtime.tick(FAR_AWAY)
    # As in a takeover: the tree is halted, and the person's commands are noted.
    runtime.halt()
    for label in ("go", "turn"):
        history.take(label)
    assert runtime.tick(FAR_AWAY).actions == (WAIT,)
    # Where everything is forgotten, the tree begins as in a demonstration's first row.
    runtime.halt()
    history.clear()
    assert runtime.tick(FAR_AWAY).actions == (GO,)


def test_what_a_robot_is_sent_to_stop_it_is_not_the_previous_action() -> None:
    runtime = TreeRuntime(some.learned(BY_TURNS))
    runtime.tick(FAR_AWAY)
    runtime.histories[some.CHANNEL].begin("turn")
    assert runtime.histories[some.CHANNEL].before() == "turn"
    assert runtime.tick(FAR_AWAY).actions == (TURN,)


@pytest.mark.parametrize("kind", RowKind)
def test_a_tree_that_follows_another_goes_on_with_its_previous_action(kind: RowKind) -> None:
    first = TreeRuntime(some.learned(GO, row_kind=kind), Scripted(go="R"))
    first.tick(FAR_AWAY)
    first.halt()
    second = TreeRuntime(some.learned(BY_TURNS, row_kind=kind), histories=first.histories)
    assert second.tick(FAR_AWAY).actions == (TURN,)
    # The histories are shared, not copied.
    assert first.histories[some.CHANNEL].previous == "turn"


WAVE, REST = nodes.Action("wave", "arm"), nodes.Action("rest", "arm")


@pytest.mark.parametrize(
    ("kind", "chosen"),
    [
        # The arm's actions are done at once; going runs, and so is no previous action of events.
        (RowKind.EVENT, [("go", "rest"), ("go", "wave"), ("go", "rest"), ("go", "wave")]),
        (RowKind.SAMPLE, [("go", "rest"), ("turn", "wave"), ("wait", "rest"), ("go", "wave")]),
    ],
)
def test_each_channel_has_a_previous_action_of_its_own(
    kind: RowKind, chosen: list[tuple[str, str]]
) -> None:
    arm = nodes.Selector((some.when(doing("rest"), then=WAVE), REST))
    learned = some.learned(nodes.Parallel((BY_TURNS, arm)), row_kind=kind)
    runtime = TreeRuntime(learned, Scripted(go="R", turn="R", wait="R"))
    ticked = [
        tuple(action.label for action in runtime.tick(FAR_AWAY).actions) for _ in range(len(chosen))
    ]
    assert ticked == chosen


def test_what_was_interrupted_on_one_channel_says_nothing_of_the_other_one() -> None:
    drive = nodes.Selector((some.when(NEAR, then=TURN), some.when(~DOCKED, then=GO)))
    arm = nodes.Selector((WAVE,))
    learned = some.learned(nodes.Parallel((drive, arm)))
    runtime = TreeRuntime(learned, Scripted(go="R", wave="R"))
    for state in (FAR_AWAY, DOCK):
        runtime.tick(state)
    histories = runtime.histories
    assert histories[some.CHANNEL].previous == "go"
    assert histories["arm"].previous is None
    runtime.halt()
    assert histories["arm"].previous == "wave"


def test_all_conditions_of_a_tick_see_the_same_previous_action() -> None:
    tree = nodes.Sequence((GO, nodes.Condition(doing("go"))))
    for kind in RowKind:
        runtime = TreeRuntime(some.learned(tree, row_kind=kind))
        assert runtime.tick(FAR_AWAY).status is Status.FAILURE
        assert runtime.tick(FAR_AWAY).status is Status.SUCCESS


@settings(max_examples=150)
@given(
    some.rule_trees(),
    st.lists(st.tuples(some.states, st.sampled_from("RS")), min_size=1, max_size=12),
    st.sampled_from(RowKind),
)
def test_each_tick_takes_what_prediction_says_after_the_ticks_before(
    tree: nodes.Node, script: list[tuple[tuple[float, ...], str]], kind: RowKind
) -> None:
    learned = some.learned(tree, row_kind=kind)
    commander = Scripted()
    runtime = TreeRuntime(learned, commander)
    history = runtime.histories[some.CHANNEL]
    previous: str | None = None
    running: str | None = None
    for state, answer in script:
        commander.script = dict.fromkeys(some.LABELS, answer)
        assert history.previous == previous
        states = States(some.FEATURES, np.array([state]), as_it_stands(history))
        (code,) = choose(tree, some.ACTIONS, states).tolist()
        chosen = () if code == NO_ACTION else (some.ACTIONS[code],)
        assert runtime.tick(state).actions == chosen
        label = None if code == NO_ACTION else some.LABELS[code]
        if kind is RowKind.SAMPLE:
            previous = previous if label is None else label
            continue
        if running not in (None, label):
            previous = running
        running = label if answer == "R" else None
        previous = label if answer == "S" and label else previous


# --- LAT --------------------------------------------------------------------------------------


def last(action: str, *deciding: str) -> Literal:
    return Literal(LastActionIs(action, deciding))


def test_all_conditions_of_a_tick_see_the_same_history() -> None:
    # The action is ticked before the condition, and still noted only after the tick.
    tree = nodes.Sequence((GO, nodes.Condition(last("go"))))
    runtime = TreeRuntime(some.learned(tree))
    assert runtime.tick(FAR_AWAY).status is Status.FAILURE
    assert runtime.tick(FAR_AWAY).status is Status.SUCCESS


def test_lat_is_read_from_the_side_of_the_rule_that_asks() -> None:
    # near   LAT for turn   chosen
    # no     -              go
    # yes    go             turn   after go, turn
    # yes    go             turn   turn itself does not count: still after go
    # no     -              go
    tree = nodes.Selector(
        (some.when(NEAR, last("go", "turn"), then=TURN), some.when(~NEAR, then=GO), WAIT)
    )
    runtime = TreeRuntime(some.learned(tree))
    chosen = [
        runtime.tick(state).actions[0].label for state in (FAR_AWAY, NEARBY, NEARBY, FAR_AWAY)
    ]
    assert chosen == ["go", "turn", "turn", "go"]


def test_lat_of_a_group_looks_past_all_actions_of_the_group() -> None:
    tree = some.when(last("wait", "go", "turn"), then=GO)
    runtime = TreeRuntime(some.learned(tree))
    for label in ("wait", "turn", "go", "turn"):
        runtime.histories[some.CHANNEL].take(label)
    assert runtime.tick(FAR_AWAY).actions == (GO,)


def test_every_action_that_is_ticked_is_noted_in_the_order_of_the_ticks() -> None:
    runtime = TreeRuntime(some.learned(nodes.Sequence((GO, TURN, WAIT))))
    assert runtime.tick(FAR_AWAY).actions == (GO, TURN, WAIT)
    history = runtime.histories[some.CHANNEL]
    assert history.before() == "wait"
    assert history.before("wait") == "turn"
    assert history.before("wait", "turn") == "go"


def test_actions_are_noted_on_their_own_channel() -> None:
    arm = nodes.Action("grasp", "arm")
    runtime = TreeRuntime(some.learned(nodes.Sequence((GO, arm))))
    runtime.tick(FAR_AWAY)
    assert runtime.histories[some.CHANNEL].before() == "go"
    assert runtime.histories["arm"].before() == "grasp"


def test_a_runtime_can_go_on_with_a_history() -> None:
    history = ActionHistory(["wait"])
    tree = some.when(last("wait", "go"), then=GO)
    runtime = TreeRuntime(some.learned(tree), histories={some.CHANNEL: history})
    assert runtime.tick(FAR_AWAY).actions == (GO,)
    assert history.before("wait") == "go"


def test_a_runtime_that_is_taken_apart_leaves_no_garbage() -> None:
    tree = nodes.Selector(
        (
            some.when(Literal(LastActionIs("go", ("turn",))), then=some.action("turn")),
            some.action("go"),
        )
    )
    runtime = TreeRuntime(some.learned(tree))
    runtime.tick(NEARBY)
    behaviours = [weakref.ref(one) for one in runtime.root.iterate()]
    gc.collect()
    gc.disable()
    try:
        runtime.dismantle()
        del runtime
        assert [one() for one in behaviours] == [None] * len(behaviours)
    finally:
        gc.enable()


def test_two_runtimes_in_one_process_do_not_disturb_each_other() -> None:
    tree = nodes.Selector((some.when(last("go", "turn"), then=TURN), GO))
    one, two = (TreeRuntime(some.learned(tree), Scripted(go="R")) for _ in range(2))
    assert one.tick(FAR_AWAY).actions == (GO,)
    # Had they one history, the second would turn now.
    assert two.tick(FAR_AWAY).actions == (GO,)
    one.halt()
    assert two.snapshot() == ("RUNNING", "FAILURE", "FAILURE", "INVALID", "RUNNING")
    assert one.tick(FAR_AWAY).actions == (TURN,)


# --- snapshot, tip, executable form -----------------------------------------------------------


def test_a_snapshot_has_the_nodes_in_the_order_of_walk() -> None:
    tree = nodes.Selector(
        (
            some.when(NEAR, then=TURN),
            nodes.Sequence((nodes.Inverter(nodes.Condition(NEAR)), nodes.Repeater((GO, WAIT)))),
        )
    )
    runtime = TreeRuntime(some.learned(tree), Scripted(wait="R"))
    assert runtime.snapshot() == ("INVALID",) * nodes.size(tree)
    runtime.tick(FAR_AWAY)
    expected = {
        tree: "RUNNING",
        tree.children[0]: "FAILURE",
        nodes.Condition(NEAR): "FAILURE",
        TURN: "INVALID",
        tree.children[1]: "RUNNING",
        nodes.Inverter(nodes.Condition(NEAR)): "SUCCESS",
        nodes.Repeater((GO, WAIT)): "RUNNING",
        GO: "SUCCESS",
        WAIT: "RUNNING",
    }
    assert runtime.snapshot() == tuple(expected[node] for node in nodes.walk(tree))


@settings(max_examples=60)
@given(some.trees(), some.states)
def test_every_node_has_a_place_in_the_snapshot(tree: nodes.Node, state: tuple[float, ...]) -> None:
    runtime = TreeRuntime(some.learned(tree))
    tick = runtime.tick(state)
    snapshot = runtime.snapshot()
    assert len(snapshot) == nodes.size(tree)
    assert snapshot[0] == tick.status.name
    for node, status in zip(nodes.walk(tree), snapshot, strict=True):
        if isinstance(node, nodes.Action) and status != "INVALID":
            assert node in tick.actions


def test_the_tip_is_the_action_that_runs() -> None:
    tree = nodes.Selector((some.when(NEAR, then=TURN), GO))
    runtime = TreeRuntime(some.learned(tree), Scripted(go="R"))
    runtime.tick(FAR_AWAY)
    assert "go" in runtime.tip


def test_a_root_parallel_is_executed_as_a_selector() -> None:
    inner = nodes.Parallel((GO, TURN))
    assert executable(nodes.Parallel((inner, WAIT))) == nodes.Selector((inner, WAIT))


@given(some.trees())
def test_every_other_root_is_executed_as_it_is(tree: nodes.Node) -> None:
    if isinstance(tree, nodes.Parallel):
        assert executable(tree) == nodes.Selector(tree.children, memory=False)
    else:
        assert executable(tree) is tree


def test_an_executable_form_can_be_run_instead_of_the_tree() -> None:
    tree = nodes.Parallel((some.when(NEAR, then=TURN), some.when(~NEAR, then=GO)))
    learned = some.learned(tree)
    runtime = TreeRuntime(learned, tree=executable(tree))
    assert runtime.tick(FAR_AWAY).status is Status.SUCCESS
    assert TreeRuntime(learned).tick(FAR_AWAY).status is Status.FAILURE


@settings(max_examples=60)
@given(
    some.trees(),
    st.lists(some.states, min_size=1, max_size=6),
    st.text("RSF", min_size=1),
    st.sampled_from(RowKind),
)
def test_the_tree_of_a_document_runs_like_the_tree_itself(
    tree: nodes.Node, states: list[tuple[float, ...]], answers: str, kind: RowKind
) -> None:
    learned = some.learned(tree, row_kind=kind)
    script = {label: answers[place:] or answers for place, label in enumerate(some.LABELS)}
    one = TreeRuntime(learned, Scripted(**script))
    two = TreeRuntime(loads(dumps(learned)), Scripted(**script))
    for state in states:
        assert one.tick(state) == two.tick(state)
        assert one.snapshot() == two.snapshot()


# --- encoding of states -----------------------------------------------------------------------


def test_the_state_comes_from_several_topics_at_their_places() -> None:
    features = (
        Feature("x", topic="pose", index=2),
        Feature("volt", topic="power", index=0),
        Feature("docked", FeatureKind.BINARY, topic="power", index=4),
        Feature("y", topic="pose", index=0),
    )
    encoder = StateEncoder(features)
    assert encoder.topics == {"pose": 3, "power": 5}
    latest = {"pose": [1.0, 2.0, 3.0], "power": [12.0, 0, 0, 0, 1.0, 99.0]}
    assert encoder.encode(latest) == [3.0, 12.0, 1.0, 1.0]


def test_features_of_a_table_come_from_one_topic_in_their_order() -> None:
    encoder = StateEncoder(some.FEATURES, "robot/state")
    assert encoder.topics == {"robot/state": 4}
    numbers = Feature("kind", FeatureKind.CATEGORICAL, ("3", "7"))
    encoder = StateEncoder((Feature("x"), numbers))
    assert encoder.topics == {"state": 2}
    assert encoder.encode({"state": [5.0, 7.0]}) == [5.0, 1.0]


@pytest.mark.parametrize(
    ("value", "code"),
    [(3.0, 0), (3, 0), (-0.5, 1), (1e38, 2), (0.0, 3), (-0.0, 3)],
)
def test_a_categorical_value_becomes_its_code(value: float, code: int) -> None:
    names = ("3", "-0.5", str(int(1e38)), "0")
    encoder = StateEncoder([Feature("kind", FeatureKind.CATEGORICAL, names, "state", 0)])
    assert encoder.encode({"state": [value]}) == [float(code)]


@pytest.mark.parametrize("value", [5.0, math.nan, 2.9999999999999996])
def test_a_category_that_was_never_shown_is_missing_and_no_condition_on_it_holds(
    value: float,
) -> None:
    feature = Feature("kind", FeatureKind.CATEGORICAL, ("3", "box"), "state", 0)
    encoder = StateEncoder([feature])
    state = encoder.encode({"state": [value]})
    assert math.isnan(state[0])
    for name in feature.categories:
        literal = Literal(HasCategory("kind", name))
        for one, status in ((literal, Status.FAILURE), (~literal, Status.SUCCESS)):
            runtime = TreeRuntime(some.learned(nodes.Condition(one), [feature]))
            assert runtime.tick(state).status is status


def test_encoding_leaves_the_messages_as_they_are() -> None:
    message = [3.0]
    encoder = StateEncoder([Feature("kind", FeatureKind.CATEGORICAL, ("3",), "state", 0)])
    encoder.encode({"state": message})
    assert message == [3.0]


def test_conditions_on_thresholds_of_a_document_hold_on_their_border() -> None:
    value = 0.1 + 0.2
    tree = nodes.Condition(Literal(Threshold("distance", value)))
    runtime = TreeRuntime(loads(dumps(some.learned(tree))))
    assert runtime.tick((value, 0, 0, 0)).status is Status.SUCCESS
    assert runtime.tick((math.nextafter(value, 1), 0, 0, 0)).status is Status.FAILURE
