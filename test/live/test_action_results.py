"""Actions that run until the robot says how they ended."""

import strategies as some
from py_trees.common import Status

from rebt_ros.behavior_tree.nodes import Action, Parallel
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.live.action_results import ActionResults

GO, TURN = Action("go", "action"), Action("turn", "action")


def test_an_action_runs_until_its_result_and_then_starts_anew() -> None:
    results = ActionResults()
    seen = []
    for word in ("", "success", "", "go:failure", ""):
        results.report(word)
        results.begin_tick()
        seen.append((results.update(GO), results.started))
    assert seen == [
        (Status.RUNNING, True),
        (Status.SUCCESS, False),
        (Status.RUNNING, True),
        (Status.FAILURE, False),
        (Status.RUNNING, True),
    ]


def test_results_of_other_actions_and_of_none_have_no_effect() -> None:
    results = ActionResults()
    assert results.report("success")
    assert results.update(GO) is Status.RUNNING
    assert results.report("turn: success")
    assert results.update(GO) is Status.RUNNING
    assert not results.report("done")
    assert not results.report("go:")
    assert results.update(GO) is Status.RUNNING


def test_a_result_for_an_interrupted_action_is_not_taken_for_the_next() -> None:
    results = ActionResults()
    results.update(GO)
    results.report("success")
    results.begin_tick()
    assert results.update(TURN) is Status.RUNNING
    results.halt(GO)
    assert results.report("turn:success")
    assert results.update(TURN) is Status.SUCCESS


def test_another_node_may_go_on_with_the_same_action() -> None:
    results = ActionResults()
    results.update(GO)
    results.begin_tick()
    results.update(GO)
    results.halt(GO)  # By the node that ran it before.
    results.begin_tick()
    assert (results.update(GO), results.started) == (Status.RUNNING, False)
    results.begin_tick()
    results.halt(GO)
    assert (results.update(GO), results.started) == (Status.RUNNING, True)


def test_a_label_may_hold_a_colon() -> None:
    results = ActionResults()
    results.update(Action("say: hello", "action"))
    assert results.report("say: hello:success")
    assert results.update(Action("say: hello", "action")) is Status.SUCCESS


def test_under_a_parallel_the_first_action_has_the_channel_until_it_ends() -> None:
    results = ActionResults()
    runtime = TreeRuntime(some.learned(Parallel((GO, TURN))), results)
    sent = []
    for word in ("", "", "go:success", "turn:success", "success"):
        results.report(word)
        results.begin_tick()
        [command] = runtime.tick((0.0,) * 4).commands
        sent.append((command, results.started))
    # A Parallel begins anew with its first child.
    assert sent == [(GO, True), (GO, False), (TURN, True), (GO, True), (TURN, True)]
