"""Several action topics: one policy per channel, learned from one state, acting side by side."""

from __future__ import annotations

import pytest
from py_trees.common import Status
from strategies import PROVENANCE

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.builder import DemonstrationBuilder, StateTopic
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.errors import OptionError
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn
from rebt_ros.learning.replaying import replay
from rebt_ros.logic.conditions import IsTrue, LastActionIs, Literal

ARM, BASE = "arm/action", "base/action"


def shown(name: str, rounds: int = 30) -> Demonstration:
    """The arm grasps what is near while the base goes on unless something blocks it."""
    builder = DemonstrationBuilder([StateTopic("state", ("distance", "blocked"))], [ARM, BASE])
    rows: list[Row] = []
    for instant in range(rounds * 4):
        distance, blocked = instant % 7 / 7, float(instant % 3 == 0)
        builder.observe(instant, "state", [distance, blocked])
        rows += builder.act(instant, ARM, "grasp" if distance < 0.4 else "open")
        rows += builder.act(instant, BASE, "wait" if blocked else "go")
    assert builder.features is not None
    return Demonstration.from_rows(name, builder.features, rows)


@pytest.fixture(scope="module")
def learned() -> LearnedTree:
    return learn([shown("one"), shown("two")])


def test_each_channel_has_a_policy_of_its_own_under_a_parallel(learned: LearnedTree) -> None:
    assert isinstance(learned.tree, nodes.Parallel)
    policies = nodes.policies(learned.tree)
    assert list(policies) == [ARM, BASE]
    for channel, policy in policies.items():
        assert {action.channel for action in nodes.actions(policy)} == {channel}
    assert [one.channel for one in learned.provenance.channels] == [ARM, BASE]
    assert learned.provenance.rows == 480
    assert learned.provenance.figures.fidelity_mismatches == 0
    assert learned.provenance.figures.own_history_agreement == 1.0


def test_arm_and_base_act_at_the_same_time(learned: LearnedTree) -> None:
    runtime = TreeRuntime(loads(dumps(learned)), tree=executable(learned.tree))
    for distance in (0.1, 0.3, 0.5, 0.9):
        for blocked in (0.0, 1.0):
            tick = runtime.tick([distance, blocked])
            taken = {action.channel: action.label for action in tick.actions}
            assert taken == {
                ARM: "grasp" if distance < 0.4 else "open",
                BASE: "wait" if blocked else "go",
            }
            assert tick.status is Status.SUCCESS


def test_each_channel_has_a_history_of_its_own() -> None:
    def after(last: str, action: nodes.Action) -> nodes.Node:
        test = nodes.Condition(Literal(LastActionIs(last, (action.label,))))
        return nodes.Sequence((test, action))

    # Both channels know the same words, and neither hears the other one's.
    left = [nodes.Action(label, "left") for label in ("open", "close")]
    right = [nodes.Action(label, "right") for label in ("open", "close")]
    tree = nodes.Parallel(
        (
            nodes.Selector((after("open", left[1]), left[0])),
            nodes.Selector(
                (nodes.Sequence((nodes.Condition(Literal(IsTrue("x"))), right[0])), right[1])
            ),
        )
    )
    features = (Feature("x", FeatureKind.BINARY),)
    runtime = TreeRuntime(LearnedTree(features, (*left, *right), tree, PROVENANCE))
    assert runtime.tick([1.0]).actions == (left[0], right[0])
    # left: its last action is open; right would say close, and has not opened anything of left's.
    assert runtime.tick([0.0]).actions == (left[1], right[1])
    assert runtime.histories["left"].before() == "close"
    assert runtime.histories["right"].before("close") == "open"


def test_a_channel_that_fails_does_not_halt_what_runs_on_another_one() -> None:
    class Slow:
        halted = 0

        def update(self, action: nodes.Action) -> Status:
            return Status.RUNNING if action.channel == BASE else Status.SUCCESS

        def halt(self, action: nodes.Action) -> None:
            self.halted += 1

    arm, base = nodes.Action("grasp", ARM), nodes.Action("go", BASE)
    only_if_near = nodes.Sequence((nodes.Condition(Literal(IsTrue("near"))), arm))
    tree = nodes.Parallel((only_if_near, base))
    slow = Slow()
    features = (Feature("near", FeatureKind.BINARY),)
    runtime = TreeRuntime(LearnedTree(features, (arm, base), tree, PROVENANCE), slow)
    assert runtime.tick([1.0]).actions == (arm, base)
    tick = runtime.tick([0.0])
    assert tick.actions == (base,)
    assert tick.status is Status.RUNNING
    assert slow.halted == 0


def test_the_executable_form_keeps_the_channels_parallel_and_makes_their_rules_selectors() -> None:
    arm = [nodes.Action(label, ARM) for label in ("open", "grasp")]
    base = [nodes.Action(label, BASE) for label in ("go", "wait")]
    near, blocked = (nodes.Condition(Literal(IsTrue(name))) for name in ("near", "blocked"))
    rules = nodes.Parallel(
        (nodes.Sequence((near, arm[1])), nodes.Sequence((nodes.Inverter(near), arm[0])))
    )
    priority = nodes.Selector((nodes.Sequence((blocked, base[1])), base[0]))
    tree = nodes.Parallel((rules, priority))
    assert executable(tree) == nodes.Parallel((nodes.Selector(rules.children), priority))
    assert executable(rules) == nodes.Selector(rules.children)


def test_a_recording_is_replayed_channel_by_channel(learned: LearnedTree) -> None:
    results = {one.channel: one for one in replay(learned, [shown("three")])}
    assert list(results) == [ARM, BASE]
    assert all(one.own_history_agreement == 1.0 for one in results.values())
    assert results[ARM].actions == ("grasp", "open")


def test_suggestions_are_attached_to_their_own_channel() -> None:
    demonstrations = [shown("one"), shown("two")]
    offered = learn(demonstrations).suggestions
    assert {one.id.rsplit("/", 1)[0] for one in offered} <= {ARM, BASE}
    for suggestion in offered[:1]:
        attached = learn(demonstrations, LearnOptions(attach=(suggestion.id,)))
        assert [one.id for one in attached.suggestions if one.attached] == [suggestion.id]
    with pytest.raises(OptionError, match="nope"):
        learn(demonstrations, LearnOptions(attach=(f"{ARM}/nope",)))
    with pytest.raises(OptionError, match="leg"):
        learn(demonstrations, LearnOptions(attach=("leg/psa-1",)))
