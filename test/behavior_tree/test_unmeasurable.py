"""Which features of a tree no topic of numbers can carry."""

from __future__ import annotations

import strategies as some

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import unmeasurable
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.logic.conditions import HasCategory, Literal

NUMBERED = Feature("gear", FeatureKind.CATEGORICAL, ("1", "2"))
NAMED = Feature("held", FeatureKind.CATEGORICAL, ("box", "2"))


def condition_on(feature: Feature, category: str) -> nodes.Node:
    return nodes.Sequence(
        (nodes.Condition(Literal(HasCategory(feature.name, category))), some.ACTIONS[0])
    )


def test_texts_that_are_tested_cannot_be_measured() -> None:
    for tree, expected in (
        (condition_on(NUMBERED, "1"), ()),
        (condition_on(NAMED, "box"), (NAMED,)),
        # What is a number can be told from all others, texts among them.
        (condition_on(NAMED, "2"), ()),
        (some.ACTIONS[0], ()),
    ):
        assert unmeasurable(some.learned(tree, (NUMBERED, NAMED))) == expected
