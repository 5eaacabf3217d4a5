"""What is proven of a tree holds in every state, and every witness is one."""

from __future__ import annotations

import math
import os
from dataclasses import replace

import numpy as np
import pytest
import rule_examples as written
import strategies as some
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.logic.conditions import (
    Interval,
    Threshold,
)
from rebt_ros.verification import branches, proof, searching
from rebt_ros.verification.proof import check, grid_of
from rebt_ros.verification.resolving import demands
from rebt_ros.verification.rules_file import loads
from rebt_ros.verification.sweep import Results, Ticks, remembers, sweep
from rebt_ros.verification.verdict import Answer, Coverage, ShownRow, verdicts

#: With REBT_ROS_RULES=N, N times as many pairs of trees and rules.
MORE = int(os.environ.get("REBT_ROS_RULES", "1"))
RULES_PER_TREE = 10


def _compares(tree: nodes.Node) -> bool:
    return any(
        isinstance(one.literal.condition, Threshold | Interval)
        and not isinstance(one.literal.condition.quantity, str)
        for one in nodes.conditions(tree)
    )


def _on_channel(node: nodes.Node, channel: str) -> nodes.Node:
    if isinstance(node, nodes.Action):
        return nodes.Action(node.label, channel)
    family = tuple(_on_channel(child, channel) for child in nodes.children(node))
    return nodes.with_children(node, family)


def _single(point: object) -> written.Everything:
    before = point.before
    history = ActionHistory() if before is None else before.history()
    return written.Everything(np.array([point.values]), (history,), np.zeros(1, dtype=np.int64))


@settings(max_examples=40 * MORE, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    some.trees(),
    st.none() | some.trees(),
    st.lists(written.rules(), min_size=RULES_PER_TREE, max_size=RULES_PER_TREE),
)
def test_answers_are_those_of_brute_force_over_all_cells(
    tree: nodes.Node, beside: nodes.Node | None, rules: list[written.WrittenRule]
) -> None:
    learned = some.learned(tree)
    channel = ""
    if beside is not None and nodes.actions(tree) and nodes.actions(beside):
        # Another channel has actions of the same names.
        arm = _on_channel(beside, "arm")
        actions = tuple(nodes.Action(label, "arm") for label in some.LABELS)
        learned = replace(learned, tree=nodes.Parallel((tree, arm)), actions=some.ACTIONS + actions)
        channel = f"    channel: {some.CHANNEL}\n"
    executed = executable(tree)
    history = written.looks_back(tree) or any(rule.when.looks_back for rule in rules)
    differs = _compares(tree) or any(rule.when.differs for rule in rules)
    states = written.everything(history, differs)
    done = written.commands(executed, states)
    for rule in rules:
        asked = demands(loads(f"{rule.text}{channel}"), learned)
        verdict = verdicts(check(learned, asked), asked)[0]
        broken = rule.broken(states, done)
        if verdict.answer is Answer.PROVEN:
            assert not broken.any()
        if verdict.answer is Answer.BROKEN:
            found = _single(verdict.witness.point)
            assert rule.broken(found, written.commands(executed, found)).all()
        elif not differs and not remembers(executed, Results.AT_ONCE):
            assert verdict.answer is Answer.PROVEN
        if broken.any():
            assert verdict.answer is not Answer.PROVEN
            if not differs:
                assert verdict.answer is Answer.BROKEN


@settings(max_examples=40 * MORE, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    some.rule_trees(),
    st.lists(written.rules(), min_size=4, max_size=4),
    st.lists(some.states, max_size=4),
    st.sampled_from((1, 1_000_000)),
    st.sampled_from(((), (1, 4, 24))),
    st.sampled_from((1, 3, 256)),
)
def test_what_is_searched_where_branches_overlap_is_what_is_found_by_looking_at_all(
    tree: nodes.Node,
    rules: list[written.WrittenRule],
    shown: list[tuple[float, ...]],
    most_nearer: int,
    tried: tuple[int, ...],
    split_in_turn: int,
) -> None:
    learned, tables = some.learned(tree), []
    if shown:
        tables = [some.table(shown, [0] * len(shown))]
    asked = [demands(loads(rule.text), learned)[0] for rule in rules]
    known = verdicts(check(learned, asked, tables), asked)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(proof, "_MOST_PARTS", -1)
        patched.setattr(proof, "_MOST_PER_NODE", 0)
        patched.setattr(searching, "_MOST_NEARER", most_nearer)
        patched.setattr(searching, "_TRIED", tried)
        patched.setattr(branches, "_SPLIT_IN_TURN", split_in_turn)
        found = verdicts(check(learned, asked, tables), asked)
    for rule, one, other in zip(rules, known, found, strict=True):
        # Boxes that are cut otherwise may not be settled where combinations are compared.
        unsettled = Answer.UNKNOWN in (one.answer, other.answer) and (
            rule.when.differs or _compares(tree)
        )
        assert one.answer is other.answer or unsettled
        if one.answer is not other.answer and Answer.PROVEN in (one.answer, other.answer):
            # What one of them leaves open, the other one has not proven wrongly.
            states = written.everything(written.looks_back(tree) or rule.when.looks_back, fine=True)
            done = written.commands(executable(tree), states)
            assert not rule.broken(states, done).any()
        if other.answer is Answer.BROKEN:
            state = _single(other.witness.point)
            assert rule.broken(state, written.commands(executable(tree), state)).all()
            if most_nearer > 1 and not unsettled and not rule.when.differs and not _compares(tree):
                assert other.witness.distance == pytest.approx(one.witness.distance)


ended = st.lists(st.sampled_from((Status.SUCCESS, Status.FAILURE, Status.RUNNING)), max_size=60)


@settings(max_examples=150 * MORE, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    some.trees(),
    st.lists(written.rules(), min_size=3, max_size=3),
    st.lists(some.states, min_size=1, max_size=12),
    ended,
    st.sampled_from(Results),
)
def test_what_is_proven_is_kept_tick_after_tick_whatever_is_remembered(
    tree: nodes.Node,
    rules: list[written.WrittenRule],
    states: list[tuple[float, ...]],
    statuses: list[Status],
    results: Results,
) -> None:
    learned = some.learned(tree)
    asked = [demands(loads(rule.text), learned)[0] for rule in rules]
    proven = [
        rule
        for rule, verdict in zip(
            rules, verdicts(check(learned, asked, results=results), asked), strict=True
        )
        if verdict.answer is Answer.PROVEN
    ]
    commander = some.EndsInTurn(statuses) if results is Results.REPORTED else None
    runtime = TreeRuntime(learned, commander, executable(tree))
    history = runtime.histories[some.CHANNEL]
    for state in states:
        before = ActionHistory(history.taken)
        before.previous = history.previous
        commands = runtime.tick(state).commands
        done = np.array([some.ACTIONS.index(commands[0]) if commands else -1])
        here = written.Everything(np.array([state]), (before,), np.zeros(1, dtype=np.int64))
        for rule in proven:
            assert not rule.broken(here, done)[0]


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(some.trees(), some.states, st.lists(st.sampled_from(some.LABELS), max_size=5))
def test_each_state_lies_in_a_box_that_says_what_a_tick_does(
    tree: nodes.Node, state: tuple[float, ...], earlier: list[str]
) -> None:
    learned, executed = some.learned(tree), executable(tree)
    grid = grid_of(learned, [executed])
    done = sweep(executed, grid, Results.AT_ONCE, Ticks.FIRST)
    history = ActionHistory(earlier)
    runtime = TreeRuntime(learned, tree=executed, histories={some.CHANNEL: history})
    inside = np.ones(done.boxes.shape[1], dtype=bool)
    before = ActionHistory(earlier)
    commands = runtime.tick(state).commands
    for one in grid.fields:
        if one.quantity is None:
            cell = grid.cell_of(before)
        elif isinstance(one.quantity, str):
            cell = one.cell(state[written.NAMES.index(one.quantity)])
        else:
            pair = (one.quantity.minuend, one.quantity.subtrahend)
            minuend, subtrahend = (state[written.NAMES.index(name)] for name in pair)
            cell = one.cell(minuend - subtrahend)
        inside &= one.cells_of(done.boxes)[:, cell]
    assert inside.sum() == 1
    [place] = np.flatnonzero(inside)
    assert done.command(int(place)) == (commands[0] if commands else None)


def test_memory_makes_what_a_first_tick_keeps_unknown() -> None:
    going = nodes.Repeater((some.action("go"),))
    resumed = nodes.Sequence((nodes.Condition(some.at_most("distance", 0.3)), going), memory=True)
    for tree, answer in ((resumed, Answer.UNKNOWN), (going, Answer.BROKEN)):
        learned = some.learned(tree)
        asked = demands(loads("rules:\n- only: go\n  when: distance <= 0.3\n"), learned)
        verdict = verdicts(check(learned, asked), asked)[0]
        assert verdict.answer is answer
    plain = some.learned(some.when(some.at_most("distance", 0.3), then=some.action("go")))
    asked = demands(loads("rules:\n- only: go\n  when: distance <= 0.3\n"), plain)
    assert verdicts(check(plain, asked), asked)[0].answer is Answer.PROVEN


def test_an_action_that_may_fail_lets_the_next_branch_act() -> None:
    near = some.at_most("distance", 0.3)
    tree = nodes.Selector((some.when(near, then=some.action("turn")), some.action("go")))
    learned = some.learned(tree)
    asked = demands(loads("rules:\n- never: go\n  when: distance <= 0.3\n"), learned)
    answers = [
        verdicts(check(learned, asked, results=results), asked)[0].answer for results in Results
    ]
    assert answers == [Answer.PROVEN, Answer.UNKNOWN]


def test_channels_are_checked_each_by_itself() -> None:
    arm, base = nodes.Action("stop", "arm"), nodes.Action("stop", "base")
    low = some.at_most("battery", 0.2)
    learned = some.learned(nodes.Parallel((some.when(low, then=arm), base)))
    text = "rules:\n" + "".join(
        f"- never: stop\n  channel: {channel}\n  when: battery > 0.2\n"
        for channel in ("arm", "base")
    )
    asked = demands(loads(text), learned)
    found = verdicts(check(learned, asked), asked)
    assert [one.answer for one in found] == [Answer.PROVEN, Answer.BROKEN]


def test_the_witness_is_near_to_what_was_shown_and_names_the_row() -> None:
    learned = some.learned(some.action("go"))
    shown = some.table([(0.9, 0.5, 1, 0), (0.35, 0.4, 0, 1), (0.6, 0.1, 1, 1)], [0, 2, 0])
    asked = demands(loads("rules:\n- never: go\n  when: distance < 0.3\n"), learned)
    verdict = verdicts(check(learned, asked, [shown]), asked)[0]
    assert verdict.witness.row == ShownRow("demonstration 0", 1, "turn")
    distance, *others = verdict.witness.point.values
    assert 0.25 < distance < 0.3
    assert others == [0.4, 0, 1]
    assert verdict.coverage == Coverage(0, 3, 0)


def test_coverage_counts_rows_and_those_that_break_the_rule_themselves() -> None:
    learned = some.learned(some.action("go"))
    shown = some.table([(0.1, 0, 0, 0), (0.2, 0, 0, 0), (math.nan, 0, 0, 0), (1, 0, 0, 0)],
                       [0, 1, 0, 0])  # fmt: skip
    text = "rules:\n- never: go\n  when: distance < 0.3\n- always: go\n  when: distance < 0.3\n"
    text += "- only: go\n  when: distance < 0.3\n"
    asked = demands(loads(text), learned)
    found = verdicts(check(learned, asked, [shown]), asked)
    assert [one.coverage for one in found] == [
        Coverage(2, 4, 1), Coverage(2, 4, 1), Coverage(2, 4, 2)
    ]  # fmt: skip
