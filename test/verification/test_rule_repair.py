"""A tree that breaks rules is mended by guards, and is proven to keep them."""

from __future__ import annotations

import numpy as np
import pytest
import rule_examples as written
import strategies as some
from hypothesis import HealthCheck, assume, given, settings

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import executable
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.proof import check
from rebt_ros.verification.repairing import Repaired, repair
from rebt_ros.verification.resolving import demands
from rebt_ros.verification.rules_file import loads
from rebt_ros.verification.sweep import Results
from rebt_ros.verification.verdict import Answer, verdicts

GO, GRASP, TURN, WAIT = some.ACTIONS
NEAR, LOW = some.at_most("distance", 0.3), some.at_most("battery", 0.2)


def mended(tree: nodes.Node, text: str, *tables: object, **options: object) -> Repaired:
    learned = some.learned(tree)
    return repair(learned, demands(loads(f"rules:\n{text}"), learned), tables, **options)


@settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck))
@given(some.rule_trees(), written.rules())
def test_a_mended_tree_keeps_its_rule_and_does_the_same_where_the_rule_says_nothing(
    tree: nodes.Node, rule: written.WrittenRule
) -> None:
    learned = some.learned(tree)
    asked = demands(loads(rule.text), learned)
    try:
        found = repair(learned, asked)
    except RuleError:
        assume(False)
    history = written.looks_back(tree) or rule.when.looks_back
    states = written.everything(history, rule.when.differs)
    before = written.commands(executable(tree), states)
    after = written.commands(executable(found.learned.tree), states)
    assert not rule.broken(states, after).any()
    broken = rule.broken(states, before)
    assert np.array_equal(before[~broken], after[~broken])
    assert [one.answer for one in verdicts(check(found.learned, asked), asked)] == [Answer.PROVEN]
    if not broken.any() and not rule.when.differs:
        assert found.learned.tree == tree


def test_a_guard_is_one_condition_where_that_is_enough() -> None:
    tree = nodes.Selector((some.when(LOW, then=WAIT), some.when(~LOW, then=GO), TURN))
    found = mended(tree, "- never: go\n  when: distance <= 0.3 and not battery <= 0.2\n")
    guarded = some.when(~LOW, ~NEAR, then=GO)
    assert found.learned.tree == nodes.Selector((some.when(LOW, then=WAIT), guarded, TURN))
    assert found.change.added == 1


def test_what_acts_only_where_it_must_not_is_left_out() -> None:
    tree = nodes.Selector((some.when(NEAR, then=GO), TURN))
    found = mended(tree, "- never: go\n  when: distance <= 0.5\n")
    assert found.learned.tree == nodes.Selector((TURN,))


def test_what_is_demanded_has_a_branch_before_all_others() -> None:
    found = mended(nodes.Selector((GO,)), "- always: wait\n  when: battery <= 0.2\n")
    assert found.learned.tree == nodes.Selector((some.when(LOW, then=WAIT), GO))


def test_where_guards_leave_no_command_the_nearest_rows_say_what_is_done() -> None:
    shown = some.table(
        [(0.35, 0.5, 0, 0), (0.4, 0.5, 0, 0), (0.9, 0.1, 0, 0), (0.8, 0.9, 0, 0)], [2, 2, 3, 0]
    )
    tree = nodes.Selector((some.when(LOW, then=WAIT), GO))
    text = "- never: go\n  when: distance <= 0.3\n"
    found = mended(tree, text, shown)
    guarded = nodes.Sequence((nodes.Condition(~NEAR), GO))
    assert found.learned.tree == nodes.Selector((some.when(LOW, then=WAIT), guarded, TURN))
    # It must not be forbidden itself.
    both = f"{text}- never: turn\n  when: distance <= 0.2\n"
    again = mended(tree, both, shown)
    assert again.learned.tree == nodes.Selector((some.when(LOW, then=WAIT), guarded, WAIT))


def test_several_rules_are_kept_at_once_and_rows_are_counted() -> None:
    shown = some.table(
        [(0.1, 0.5, 0, 0), (0.9, 0.5, 0, 0), (0.9, 0.1, 0, 0), (0.2, 0.1, 0, 0)], [0, 0, 0, 2]
    )
    text = "- never: go\n  when: distance <= 0.3\n- always: wait\n  when: battery <= 0.2\n"
    found = mended(nodes.Selector((GO, TURN)), text, shown)
    assert (found.change.changed, found.change.rows) == (3, 4)
    assert str(found.change) == (
        "+5 nodes, 3 of 4 rows changed, agreement with them from 75.0% to 25.0%, mean recall 50.0% "
        "to 16.7%"
    )
    assert found.learned.provenance.mended == found.change
    assert {one.answer for one in found.verdicts} == {Answer.PROVEN}


def test_a_guard_is_asked_again_where_a_sequence_resumes() -> None:
    going = nodes.Sequence((nodes.Condition(~LOW), nodes.Repeater((GO,))), memory=True)
    found = mended(nodes.Selector((going, TURN)), "- never: go\n  when: distance <= 0.3\n")
    assert {one.answer for one in found.verdicts} == {Answer.PROVEN}


def test_where_actions_may_fail_the_branches_after_them_are_guarded_too() -> None:
    tree = nodes.Selector((some.when(NEAR, then=TURN), GO))
    text = "- never: go\n  when: distance <= 0.3\n"
    assert mended(tree, text).change.added == 0
    found = mended(tree, text, results=Results.REPORTED)
    guarded = nodes.Sequence((nodes.Condition(~NEAR), GO))
    assert found.learned.tree == nodes.Selector((some.when(NEAR, then=TURN), guarded))


def test_channels_are_mended_each_by_itself() -> None:
    arm, base = nodes.Action("stop", "arm"), nodes.Action("go", "base")
    tree = nodes.Parallel((arm, nodes.Selector((base,))))
    found = mended(tree, "- never: go\n  channel: base\n  when: distance <= 0.3\n")
    guarded = nodes.Sequence((nodes.Condition(~NEAR), base))
    assert found.learned.tree == nodes.Parallel((arm, nodes.Selector((guarded,))))


def test_a_tree_of_which_nothing_would_be_left_is_not_mended() -> None:
    with pytest.raises(RuleError, match="nothing is left of it without what breaks 'never go'"):
        mended(nodes.Selector((GO,)), "- never: go\n")
