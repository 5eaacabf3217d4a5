"""The last tick is told as it was, whatever the tree remembered."""

from __future__ import annotations

import strategies as some
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.live.last_tick import LastTick
from rebt_ros.live.tick_explanation import explained
from rebt_ros.verification.acting import Outcome, commanding, recorded, trace

GO, GRASP, TURN, WAIT = some.ACTIONS
NEAR = some.at_most("distance", 0.3)


_statuses = st.lists(st.sampled_from((Status.SUCCESS, Status.FAILURE, Status.RUNNING)), max_size=40)


@given(some.trees(), st.lists(some.states, min_size=1, max_size=8), _statuses)
def test_every_tick_is_recorded_as_it_was(
    tree: nodes.Node, states: list[tuple[float, ...]], statuses: list[Status]
) -> None:
    tree = executable(tree)
    runtime = TreeRuntime(some.learned(tree), some.EndsInTurn(statuses), tree)
    leaves = [node for node in nodes.walk(tree) if isinstance(node, nodes.Action)]
    for state in states:
        tick = runtime.tick(state)
        outcomes = {place: Outcome[name] for place, name in runtime.outcomes().items()}
        found = recorded(tree, outcomes)
        assert found.outcome.name == tick.status.name
        acting = [step for step in found.walk() if step.leaf >= 0]
        assert tuple(step.node for step in acting) == tick.actions
        assert all(leaves[step.leaf] == step.node for step in acting)
        command = commanding(found, tree)
        assert tick.commands == ((command.node,) if command else ())
        for step in found.walk():
            # Conditions are told as they are in this very state.
            if isinstance(step.node, nodes.Condition) and not _looks_back(step.node):
                holds = some.holds(step.node.literal, state)
                assert (step.outcome is Outcome.SUCCESS) is holds


def _looks_back(node: nodes.Condition) -> bool:
    return not hasattr(node.literal.condition, "quantity") and not hasattr(
        node.literal.condition, "feature"
    )


@given(some.trees(), some.states)
def test_a_first_tick_is_recorded_as_it_is_traced(
    tree: nodes.Node, state: tuple[float, ...]
) -> None:
    tree = executable(tree)
    runtime = TreeRuntime(some.learned(tree), None, tree)
    runtime.tick(state)
    outcomes = {place: Outcome[name] for place, name in runtime.outcomes().items()}
    assert recorded(tree, outcomes) == trace(tree, some.FEATURES, state, ActionHistory())


def _told(runtime: TreeRuntime, learned: object, state: tuple[float, ...]) -> list[str]:
    runtime.tick(state)
    return explained(LastTick(learned, state, runtime.outcomes())).splitlines()


def test_a_sequence_that_remembers_is_told_from_where_it_goes_on() -> None:
    routine = nodes.Sequence((nodes.Condition(NEAR), GRASP, TURN), memory=True)
    learned = some.learned(nodes.Selector((routine, GO)))
    ends = some.EndsInTurn(
        [Status.SUCCESS, Status.RUNNING, Status.RUNNING, Status.FAILURE, Status.SUCCESS]
    )
    runtime = TreeRuntime(learned, ends)
    near, far = (0.1, 0.5, 0.0, 0.0), (0.9, 0.5, 0.0, 0.0)
    assert _told(runtime, learned, near)[:2] == [
        "turn",
        "  because distance ≤ 0.3 (distance = 0.1)",
    ]
    # The condition holds no longer, and is not asked.
    assert _told(runtime, learned, far) == [
        "turn",
        "  goes on with step 3 of 3, where the tick before left it: "
        "what stands before is not asked again",
        "  because it goes on",
    ]
    runtime.tick(far)
    assert _told(runtime, learned, far)[0] == "go"


def test_a_branch_whose_action_failed_is_told() -> None:
    learned = some.learned(nodes.Selector((some.when(NEAR, then=GRASP), GO)))
    runtime = TreeRuntime(learned, some.EndsInTurn([Status.FAILURE, Status.SUCCESS]))
    assert _told(runtime, learned, (0.1, 0.5, 0.0, 0.0)) == [
        "go",
        "  because no branch before it acts",
        "  Branches before it that did not act:",
        "    grasp: was taken, and failed",
    ]


def test_channels_are_told_one_after_the_other() -> None:
    arm = nodes.Action("lift", "arm")
    tree = nodes.Parallel((some.when(NEAR, then=GO), nodes.Sequence((nodes.Condition(~NEAR), arm))))
    learned = some.learned(tree)
    runtime = TreeRuntime(learned, None, executable(tree))
    assert _told(runtime, learned, (0.9, 0.5, 0.0, 0.0)) == [
        "Channel action:",
        "nothing",
        "  No branch acts:",
        "    go: does not hold: distance ≤ 0.3 (distance = 0.9)",
        "Channel arm:",
        "lift",
        "  because distance > 0.3 (distance = 0.9)",
    ]
