"""Rules in numbers are the rules; what is counted in numbers is what is built."""

from __future__ import annotations

import strategies as some
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.priority_root import size_of
from rebt_ros.logic.dnf import Dnf, conditions_of
from rebt_ros.logic.factoring import factored, named, pulled_out
from rebt_ros.logic.float_reduction import implied_literals, reduced
from rebt_ros.logic.intervals import enclosing_literals, with_intervals
from rebt_ros.logic.literal_codes import Numbering, mask
from rebt_ros.paper.re_bt_espresso import rule_tree
from rebt_ros.paper.rule_trees import FactoredRule


@given(some.dnfs())
def test_a_rule_in_numbers_and_back_is_the_rule(rule: Dnf) -> None:
    numbering = Numbering(conditions_of(rule))
    assert numbering.dnf(numbering.cover(rule)) == rule


@given(some.threshold_dnfs)
def test_masks_tell_which_literals_imply_which(rule: Dnf) -> None:
    numbering = Numbering(conditions_of(rule))
    implied = implied_literals(numbering.conditions)
    literals = numbering.literals(range(len(implied)))
    for stronger, weaker in zip(literals, implied, strict=True):
        assert weaker == mask(
            code for code, one in enumerate(literals) if some.implies(stronger, one)
        )


@settings(max_examples=150)
@given(some.threshold_dnfs, st.booleans(), st.booleans(), st.integers(1, 3))
def test_the_size_of_a_rule_is_that_of_its_tree(
    rule: Dnf, repeated: bool, intervals: bool, actions: int
) -> None:
    numbering = Numbering(conditions_of(rule))
    cover = reduced(numbering.cover(rule), implied_literals(numbering.conditions))
    if not cover:
        return
    parts = (factored if repeated else pulled_out)(cover)
    condition = named(parts, numbering)
    if intervals:
        condition = with_intervals(condition)
    tree = rule_tree(FactoredRule(some.ACTIONS[:actions], condition), frozenset())
    enclosing = enclosing_literals(numbering.conditions) if intervals else None
    assert size_of(parts, actions, enclosing) == nodes.size(tree)
