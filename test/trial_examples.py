"""Trees for the simulated robot that drive well, never arrive, or are made up."""

from __future__ import annotations

from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.behavior_tree.nodes import Action, Condition, Node, Selector, Sequence, actions
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import IsTrue, Literal, Threshold
from rebt_ros.simulated_robot.robot import State

GO, LEFT, RIGHT, CHARGE = (
    Action(label, "action") for label in ("go", "turn_left", "turn_right", "charge")
)


def learned(tree: Node, agreement: float | None = 1.0) -> LearnedTree:
    """A tree on the state of the simulated robot, as if it were learned."""
    features = tuple(
        Feature(
            name,
            FeatureKind.BINARY if name == "docked" else FeatureKind.NUMERIC,
            topic="state",
            index=index,
        )
        for index, name in enumerate(State._fields)
    )
    figures = Figures(0, agreement, agreement, 2)
    provenance = Provenance(1, 10, 0.0, 5, 0.0, Root.SELECTOR, History.NONE, figures)
    return LearnedTree(features, tuple(dict.fromkeys(actions(tree))), tree, provenance)


def _where(*literals: Literal) -> tuple[Condition, ...]:
    return tuple(map(Condition, literals))


def _at_most(feature: str, value: float) -> Literal:
    return Literal(Threshold(feature, value))


def _above(feature: str, value: float) -> Literal:
    return Literal(Threshold(feature, value), positive=False)


#: What the scripted demonstrator does.
GOOD = learned(
    Selector(
        (
            Sequence((*_where(Literal(IsTrue("docked")), _at_most("battery", 0.95)), CHARGE)),
            Sequence((*_where(_at_most("front", 0.4)), LEFT)),
            Sequence((*_where(_above("target_bearing", 0.25)), LEFT)),
            Sequence((*_where(_at_most("target_bearing", -0.25), _above("right", 0.6)), RIGHT)),
            GO,
        )
    ),
    0.97,
)

#: Goes round in circles, looking ahead, and so never arrives.
BAD = learned(Selector((Sequence((*_where(_at_most("front", 0.4)), RIGHT)), LEFT)), 0.4)

#: Look at nothing, and so need no robot.
ALWAYS_GO, ALWAYS_LEFT = (learned(Selector((one,)), None) for one in (GO, LEFT))

#: Not one of a trial; looks at nothing, either.
ANOTHER = learned(Selector((RIGHT, RIGHT)), None)
