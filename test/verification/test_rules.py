"""Rules are read from YAML, and everything that is wrong with them is said with its place."""

from __future__ import annotations

import json
import math

import jsonschema
import pytest
import strategies as some
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from rule_examples import rules as random_rules

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.wording import quantity_text
from rebt_ros.logic.conditions import (
    KNOWN,
    Difference,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
    WeightedSum,
)
from rebt_ros.verification import rules_file
from rebt_ros.verification.contradictions import refuse_contradictions
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.formulas import AllOf, AnyOf, Formula
from rebt_ros.verification.grammar import ConditionSyntaxError, parse
from rebt_ros.verification.proof import check
from rebt_ros.verification.resolving import demands
from rebt_ros.verification.verdict import Answer, verdicts

GO, GRASP, TURN, WAIT = some.ACTIONS
LEARNED = some.learned(GO)


def formula(text: str, kind: str = "never") -> Formula:
    rules = rules_file.loads(f"rules:\n  - {kind}: go\n    when: {text}\n")
    return demands(rules, LEARNED)[0].when


def said(text: str) -> str:
    """What is wrong with a file of rules."""
    with pytest.raises(RuleError) as caught:
        take(text)
    return str(caught.value)


def take(text: str) -> None:
    asked = demands(rules_file.loads(text, "rules.yaml"), LEARNED)
    refuse_contradictions(asked, LEARNED)


def about(condition: str) -> str:
    return said(f"rules:\n  - never: go\n    when: {condition}\n")


# --- conditions -------------------------------------------------------------------------------


def _sum(**weights: float) -> WeightedSum:
    return WeightedSum(tuple(weights.items()))


BELOW = Literal(Threshold("distance", math.nextafter(0.3, -1)))
AT_MOST = some.at_most("distance", 0.3)
KNOWN_DISTANCE = some.at_most("distance", KNOWN)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("distance < 0.3", BELOW),
        ("0.3 > distance", BELOW),
        ("distance <= 0.3", AT_MOST),
        ("distance ≤ .3", AT_MOST),
        ("distance > 0.3", AllOf((KNOWN_DISTANCE, ~AT_MOST))),
        ("distance >= 3e-1", AllOf((KNOWN_DISTANCE, ~BELOW))),
        ("distance is known", KNOWN_DISTANCE),
        ("distance is missing", ~KNOWN_DISTANCE),
        ("docked", Literal(IsTrue("docked"))),
        ("docked is true", Literal(IsTrue("docked"))),
        ("not docked", ~Literal(IsTrue("docked"))),
        ("docked is false", AllOf((some.at_most("docked", KNOWN), ~Literal(IsTrue("docked"))))),
        ("kind = cup", Literal(HasCategory("kind", "cup"))),
        ("kind == 'cup'", Literal(HasCategory("kind", "cup"))),
        (
            "kind != cup",
            AnyOf((Literal(HasCategory("kind", "box")), Literal(HasCategory("kind", "tool")))),
        ),
        ("doing turn", Literal(PreviousActionIs("turn"))),
        ("last action = turn", Literal(LastActionIs("turn", ("go",)))),
        ("last action != turn", ~Literal(LastActionIs("turn", ("go",)))),
        (
            "distance - battery <= 0.3",
            some.at_most(Difference("distance", "battery"), 0.3),
        ),
        ("distance <= battery", some.at_most(Difference("distance", "battery"), 0.0)),
        ("-battery + distance <= 0", some.at_most(Difference("distance", "battery"), 0.0)),
        ("distance <= 2 * battery", some.at_most(_sum(distance=1.0, battery=-2.0), 0.0)),
        ("distance + battery <= 0.3", some.at_most(_sum(distance=1.0, battery=1.0), 0.3)),
        ("distance -0.5*battery <= 1", some.at_most(_sum(distance=1.0, battery=-0.5), 1.0)),
        ("−2.6 × distance + battery * 3 - docked <= -1", some.at_most(
            _sum(distance=-2.6, battery=3.0, docked=-1.0), -1.0
        )),
        ("distance + 'battery' is missing", ~some.at_most(
            _sum(distance=1.0, battery=1.0), KNOWN
        )),
        ("not (docked or kind = cup)", AllOf(
            (~Literal(IsTrue("docked")), ~Literal(HasCategory("kind", "cup")))
        )),
        ("docked or doing go and kind = cup", AnyOf((
            Literal(IsTrue("docked")),
            AllOf((Literal(PreviousActionIs("go")), Literal(HasCategory("kind", "cup")))),
        ))),
    ],
)  # fmt: skip
def test_a_condition_means_what_it_says(text: str, meaning: Formula) -> None:
    assert formula(text) == meaning


def test_two_comparisons_around_a_feature_are_a_range() -> None:
    assert formula("0.1 < distance <= 0.3") == AllOf(
        (AllOf((KNOWN_DISTANCE, ~some.at_most("distance", 0.1))), AT_MOST)
    )


def test_a_name_with_hyphens_is_one_name_and_a_minus_stands_between_blanks() -> None:
    assert parse("doing Slight-Right-Turn").action.text == "Slight-Right-Turn"
    assert parse("left - right < 0").left.terms[1].feature.text == "right"


def test_a_sum_is_that_of_the_tree_in_whatever_order_and_with_either_sign() -> None:
    wide = WeightedSum((("distance", 1.0), ("battery", 0.1), ("docked", -0.3)))
    learned = some.learned(some.when(some.at_most(wide, 0.2), then=some.action("go")))
    for text, answer in (
        ("0.1 × battery − 0.3 × docked + distance > 0.2", Answer.PROVEN),
        ("0.3 * docked - distance - 0.1 * battery < -0.2", Answer.PROVEN),
        (f"{quantity_text(wide)} > 0.1", Answer.BROKEN),
    ):
        asked = demands(rules_file.loads(f"rules:\n- never: go\n  when: {text}\n"), learned)
        assert [one.answer for one in verdicts(check(learned, asked), asked)] == [answer]


def test_a_sum_that_only_touches_what_the_tree_does_is_proven() -> None:
    close = some.at_most("distance", 0.3)
    tree = some.when(~close, some.at_most("distance", KNOWN), then=some.action("go"))
    learned = some.learned(tree)
    text = "rules:\n- never: go\n  when: distance + 0.5 * battery <= 0.3 and battery >= 0\n"
    asked = demands(rules_file.loads(text), learned)
    assert verdicts(check(learned, asked), asked)[0].answer is Answer.PROVEN


@settings(max_examples=200)
@given(st.text(st.sampled_from("ab <>=!()*+'\"-.0159\\andort\n"), max_size=30))
def test_whatever_is_written_is_a_condition_or_is_refused_at_a_place(text: str) -> None:
    at = 0
    try:
        parse(text)
    except ConditionSyntaxError as err:
        at = err.at
    assert 0 <= at <= len(text)


@pytest.mark.parametrize(
    ("condition", "place", "why"),
    [
        ("distance <", 19, "a feature or a number is expected, not the end"),
        ("distance < 0.3 battery", 24, "numbers stand without units, in those of the feature: 'a"),
        ("docked battery", 16, "'and', 'or' or the end is expected, not 'battery'"),
        ("distance < 0.3 m", 24, "numbers stand without units, in those of the feature: 'and', "),
        ("distence < 0.3", 9, "there is no feature 'distence' ('distance' is like it): there are"),
        ("kind = cups", 16, "'kind' has no category 'cups' ('cup' is like it): it has box, cup"),
        ("doing trun", 15, "there is no action 'trun' ('turn' is like it): there are go, grasp"),
        ("(docked", 16, "')' is expected, not the end"),
        ("0 < distance < 1 < battery", 26, "'and', 'or' or the end is expected"),
        ("0.3 < distance > 0.1", 24, "two comparisons in a row must go the same way"),
        ("distance & docked", 18, "'&' has no meaning here"),
        ("kind = 'cup", 16, "the quote is never closed"),
        ("distance < 1e999", 20, "1e999 is too large for a number"),
        ("front < 0.3", 9, "there is no feature 'front': there are distance, battery"),
        ("kind = bowl", 16, "'kind' has no category 'bowl': it has box, cup, tool"),
        ("kind < 3", 16, "'kind' has categories, box, cup, tool: compare it with = or !="),
        ("distance = cup", 20, "'cup' is neither a number nor a feature"),
        ("distance", 9, "'distance' is numeric, not true or false: compare it"),
        ("doing fly", 15, "there is no action 'fly': there are go, grasp, turn, wait"),
        ("last action < go", 21, "'=' or '!=' is expected, not '<'"),
        ("1 < 2", 9, "two numbers are compared: name a feature"),
        ("distance < distance", 20, "'distance' is compared with itself"),
        ("2 * distance + < 1", 24, "a feature or a number is expected, not '<'"),
        ("distance + 0.5 < 1", 20, "0.5 is added to a feature: put it on the other side of the "),
        ("distance * battery < 1", 20, "a number is expected, not 'battery'"),
        ("2 * 3 < 1", 13, "there is no feature '3': there are"),
        (
            "2 * distance < 1",
            13,
            "'distance' alone is multiplied: compare 'distance' itself",
        ),
        ("distance + 0 * battery < 1", 24, "'battery' is multiplied by 0"),
        ("distance + battery < cup", 30, "a sum is compared with a number or with features"),
        ("distance + battery", 27, "a comparison is expected, not the end"),
        ("distance - battery < distance", 30, "'distance' is named twice: name it once, with one"),
        ("distance + bettery < 1", 20, "there is no feature 'bettery' ('battery' is like it): the"),
        ("distance - kind < 1", 20, "'kind' has categories, box, cup, tool, which cannot be"),
        ("docked and 'docked is", 20, "the quote is never closed"),
    ],
)
def test_what_is_wrong_with_a_condition_is_said_with_its_place(
    condition: str, place: int, why: str
) -> None:
    sentence = said(f"rules:\n- never: go\n  when: |-\n        {condition}\n")
    assert sentence.startswith(f"rules.yaml, line 4, column {place}: {why}"), sentence


@pytest.mark.parametrize(
    ("style", "line", "column"),
    [
        ("  when: docked and front < 1", 3, 20),
        ("  when: 'docked and front < 1'", 3, 21),
        ('  when: "docked and front < 1"', 3, 21),
        ("  when: docked\n    and front < 1", 4, 9),
        ("  when: >\n    docked\n    and front < 1", 5, 9),
    ],
)
def test_places_are_those_of_the_file_however_yaml_writes_a_text(
    style: str, line: int, column: int
) -> None:
    sentence = said(f"rules:\n- never: go\n{style}\n")
    assert sentence.startswith(f"rules.yaml, line {line}, column {column}: there is no feature")


# --- files ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "rules.yaml is empty: list rules under 'rules:'"),
        ("- never: go\n", "line 1, column 1: the file must have fields"),
        ("rules:\n  never: go\n", "line 2, column 3: 'rules' must be a list"),
        ("rulez: []\n", "line 1, column 1: the field 'rulez' is unknown"),
        ("rules:\n- go\n", "line 2, column 3: a rule must have fields"),
        ("rules:\n- when: docked\n", "line 2, column 3: a rule needs exactly one of never"),
        ("rules:\n- never: go\n  only: go\n", "a rule needs exactly one of never, always, only"),
        ("rules:\n- only: go\n", "an 'only' needs a 'when'"),
        ("rules:\n- never: go\n  never: turn\n", "line 3, column 3: the field 'never' is there"),
        ("rules:\n- never: go\n  if: docked\n", "line 3, column 3: the field 'if' is unknown"),
        ("rules:\n- never: [go]\n", "line 2, column 10: an action must be a name"),
        ("rules:\n- never: go\n  when:\n", "'when' must be a condition"),
        ("rules:\n- never: fly\n", "line 2, column 10: there is no action 'fly'"),
        ("rules:\n- never: go\n  channel: arm\n", "the action 'go' is not on a channel 'arm'"),
        ("rules: [\n", "this is not YAML"),
        ("rules: !!python/object:os.system {}\n", "'rules' must be a list"),
        ("[" * 3000, "is nested too deeply to be read"),
        ("#" * 300_000, "has 300000 characters: at most 200000 are read"),
        ("rules:\n" + "- never: go\n" * 501, "there are 501 rules where 500 are read"),
    ],
)
def test_a_malformed_file_is_refused_in_a_sentence(text: str, why: str) -> None:
    sentence = said(text)
    assert why in sentence
    assert sentence.endswith(".")
    assert "\n" not in sentence


def test_an_action_on_several_channels_needs_one_to_be_named() -> None:
    arm, base = nodes.Action("stop", "arm"), nodes.Action("stop", "base")
    learned = some.learned(nodes.Parallel((arm, base)))
    rules = rules_file.loads("rules:\n- never: stop\n")
    with pytest.raises(RuleError, match="on several channels: add 'channel:' with one of arm"):
        demands(rules, learned)
    named = rules_file.loads("rules:\n- never: stop\n  channel: base\n")
    assert demands(named, learned)[0].action == base


@settings(max_examples=60)
@given(random_rules())
def test_the_schema_takes_what_is_read(rule: object) -> None:
    schema = rules_file.json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(yaml.safe_load(rule.text), schema)
    assert len(rules_file.loads(rule.text).rules) == 1


@pytest.mark.parametrize(
    "text",
    [
        '{"rules": [{"when": "docked"}]}',
        '{"rules": [{"never": "go", "always": "go"}]}',
        '{"rules": [{"only": "go"}]}',
        '{"rules": [{"never": "go", "if": "docked"}]}',
        '{"rules": {}}',
        "[]",
    ],
)
def test_the_schema_refuses_what_is_refused(text: str) -> None:
    assert not jsonschema.Draft202012Validator(rules_file.json_schema()).is_valid(json.loads(text))
    assert said(text)


# --- contradictions ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rules", "why"),
    [
        (
            "- always: go\n  when: distance > 0.1\n- never: go\n  when: distance < 0.5\n",
            "line 4, column 10: 'never go when distance < 0.5' contradicts "
            "'always go when distance > 0.1' of rules.yaml, line 2, column 11, as where ",
        ),
        (
            "- always: go\n  when: docked\n- always: turn\n  when: kind = cup\n",
            "'always turn when kind = cup' contradicts 'always go when docked'",
        ),
        (
            "- always: go\n- only: go\n  when: docked\n",
            "'only go when docked' contradicts 'always go'",
        ),
        (
            "- always: go\n  when: distance < battery\n"
            "- never: go\n  when: distance < 0.1 and battery > 0.2\n",
            "contradicts 'always go when distance < battery'",
        ),
        ("- never: go\n  when: distance < 0.1 and distance > 0.2\n", "never holds"),
        (
            "- never: go\n"
            "  when: distance < battery and distance > 0.5 and battery < 0.3\n",
            "never holds: no state is like that",
        ),
    ],
)  # fmt: skip
def test_rules_that_no_tree_can_keep_are_refused(rules: str, why: str) -> None:
    assert why in said(f"rules:\n{rules}")


@pytest.mark.parametrize(
    "rules",
    [
        "- always: go\n  when: distance > 0.5\n- never: go\n  when: distance <= 0.5\n",
        "- always: go\n  when: distance < battery\n- never: go\n  when: distance >= battery\n",
        "- always: go\n  when: docked\n- only: go\n  when: docked or kind = cup\n",
        "- always: go\n  when: docked\n- always: go\n  when: kind = cup\n",
        "- never: go\n- never: turn\n- never: wait\n- never: grasp\n",
        "- always: go\n  when: docked\n- never: turn\n  when: docked\n",
    ],
)  # fmt: skip
def test_rules_that_a_tree_can_keep_are_taken(rules: str) -> None:
    take(f"rules:\n{rules}")
