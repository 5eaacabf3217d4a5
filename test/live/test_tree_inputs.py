"""What a running tree takes from state messages."""

import math

import pytest

from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.behavior_tree.nodes import Action, Condition, Selector, Sequence
from rebt_ros.demonstration.builder import BadMessageError, Fault
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.live.tree_inputs import Message, TreeInputs
from rebt_ros.logic.conditions import HasCategory, LastActionIs, Literal, Threshold

GO, TURN = Action("go", "action"), Action("turn", "action")

FEATURES = (
    Feature("unread", topic="other", index=0),
    Feature("x", topic="pose", index=2),
    Feature("room", FeatureKind.CATEGORICAL, ("1", "4"), topic="place", index=0),
)

_PROVENANCE = Provenance(1, 9, 0.0, 5, 0.0, Root.SELECTOR, History.LAST, Figures(0, None, None, 0))


def _inputs(features: tuple[Feature, ...] = FEATURES) -> TreeInputs:
    tests = (Threshold("x", 0.5), HasCategory("room", "4"), LastActionIs("go", ("turn",)))
    tree = Selector((Sequence((*(Condition(Literal(one)) for one in tests), TURN)), GO))
    return TreeInputs(LearnedTree(features, (GO, TURN), tree, _PROVENANCE), "table", timeout=100)


def test_only_what_the_tree_tests_is_needed() -> None:
    inputs = _inputs()
    assert inputs.topics == ("pose", "place")
    inputs.accept("pose", Message((math.nan, math.inf, 0.25), 10))
    inputs.accept("place", Message((4.0, 9.0), 10))
    state = inputs.state()
    assert math.isnan(state[0])
    assert list(state[1:]) == [0.25, 1.0]


def test_a_category_that_was_never_shown_is_missing() -> None:
    inputs = _inputs()
    inputs.accept("pose", Message((0.0, 0.0, 0.0), 0))
    inputs.accept("place", Message((3.0,), 0))
    assert math.isnan(inputs.state()[2])


def test_features_of_a_table_come_in_their_order_on_the_default_topic() -> None:
    inputs = _inputs(
        (Feature("unread"), Feature("x"), Feature("room", FeatureKind.CATEGORICAL, ("1", "4")))
    )
    assert inputs.topics == ("table",)
    inputs.accept("table", Message((9.0, 0.25, 1.0), 0))
    assert list(inputs.state()[1:]) == [0.25, 0.0]


def test_values_are_taken_by_the_names_that_messages_give_them() -> None:
    inputs = _inputs()
    inputs.accept("place", Message((1.0,), 0, ("other",)))
    for names, values in (
        ((), (0.0, 0.0, 0.25)),
        (("a", "b", "c"), (0.0, 0.0, 0.25)),
        (("a", "b", "x"), (0.0, 0.0, 0.25)),
        (("x", "b", "a"), (0.25, 0.0, 0.0)),
        (("b", "x"), (0.0, 0.25)),
    ):
        inputs.accept("pose", Message(values, 0, names))
        assert inputs.state()[1] == 0.25
    tests_two = TreeInputs(
        LearnedTree(
            (Feature("x", topic="pose", index=0), Feature("y", topic="pose", index=1)),
            (GO, TURN),
            Selector(
                (Sequence((*(Condition(Literal(Threshold(one, 0.5))) for one in "xy"), TURN)), GO)
            ),
            _PROVENANCE,
        ),
        "table",
        timeout=100,
    )
    wrong = Message((0.0, 0.0), 0, ("x", "z"))
    with pytest.raises(BadMessageError, match="no value called 'y'") as caught:
        tests_two.accept("pose", wrong)
    assert caught.value.fault is Fault.NAMES
    assert "no value called 'y'" in tests_two.misfit({"pose": wrong})
    assert tests_two.misfit({"pose": Message((0.0, 0.0), 0, ("y", "x"))}) == ""


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ((), Fault.LENGTH),
        ((0.0, 0.0), Fault.LENGTH),
        ((0.0, 0.0, math.nan), Fault.NOT_FINITE),
        ((0.0, 0.0, -math.inf), Fault.NOT_FINITE),
    ],
)
def test_an_unusable_message_is_left_out(values: tuple[float, ...], fault: Fault) -> None:
    inputs = _inputs()
    inputs.accept("pose", Message((0.0, 0.0, 1.0), 0))
    with pytest.raises(BadMessageError) as caught:
        inputs.accept("pose", Message(values, 50))
    assert caught.value.fault is fault
    assert inputs.values["pose"] == (0.0, 0.0, 1.0)


def test_freshness_ends_with_the_timeout_and_with_a_clock_set_back() -> None:
    inputs = _inputs()
    inputs.accept("place", Message((1.0,), 1000))
    assert inputs.stale(1000) == {"pose": "never received"}
    inputs.accept("pose", Message((0.0, 0.0, 1.0), 1000))
    assert inputs.stale(1100) == {}
    assert set(inputs.stale(1101)) == {"pose", "place"}
    assert set(inputs.stale(999)) == {"pose", "place"}


def test_a_tree_that_tests_a_lagged_feature_reads_its_source_and_looks_back_until_reset() -> None:
    features = (Feature("other"), Feature("x[t-1]", index=3, lag=1))
    tree = Selector((Sequence((Condition(Literal(Threshold("x[t-1]", 0.5))), TURN)), GO))
    provenance = Provenance(
        1, 9, 0.0, 5, 0.0, Root.SELECTOR, History.NONE, Figures(0, None, None, 0)
    )
    inputs = TreeInputs(LearnedTree(features, (GO, TURN), tree, provenance), "table", timeout=100)
    assert inputs.topics == ("table",)
    with pytest.raises(BadMessageError):
        inputs.accept("table", Message((0.0, 0.0, 0.0), 0))
    seen: list[float] = []
    for tick, value in enumerate((0.25, 0.5, 0.75)):
        inputs.accept("table", Message((0.0, 0.0, 0.0, value), tick))
        seen.append(inputs.state()[1])
    assert math.isnan(seen[0])
    assert seen[1:] == [0.25, 0.5]
    inputs.reset()
    assert math.isnan(inputs.state()[1])
