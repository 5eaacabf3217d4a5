"""The behavior tree document: what goes out comes back, and what is not one is refused."""

from __future__ import annotations

import copy
import json
import struct
from collections.abc import Callable, Iterator
from importlib import resources
from typing import Any

import pytest
import strategies as some
from hypothesis import example, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator, ValidationError, validators

from rebt_ros import behavior_tree
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import (
    DEEPEST_TREE,
    LARGEST_DOCUMENT,
    dumps,
    json_schema,
    loads,
)
from rebt_ros.behavior_tree.learned_tree import (
    ChannelProvenance,
    Figures,
    LearnedTree,
    Provenance,
    Root,
    Suggestion,
    SuggestionKind,
)
from rebt_ros.behavior_tree.shown import ShownChannel, ShownLeaf, Span
from rebt_ros.codec.text import indented
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.errors import DocumentError
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
)


def _one_of(
    validator: Any, alternatives: list[Any], instance: object, _: object
) -> Iterator[ValidationError]:
    """What "oneOf" means, without all that is wrong with each alternative.

    To find that at each level of a tree takes time that grows exponentially with its depth.
    """
    if sum(validator.evolve(schema=one).is_valid(instance) for one in alternatives) != 1:
        yield ValidationError(f"{instance!r} is not valid under exactly one of the schemas.")


SCHEMA = validators.extend(Draft202012Validator, {"oneOf": _one_of})(json_schema())

NEAR = Literal(Threshold("distance", 0.1 + 0.2))
EVERY_NODE = nodes.Parallel(
    (
        some.when(NEAR, then=some.action("turn")),
        nodes.Selector((nodes.Inverter(nodes.Condition(Literal(IsTrue("docked")))),), memory=True),
        nodes.Sequence((nodes.Condition(~Literal(HasCategory("kind", "cup"))),), memory=True),
        nodes.ParallelSelector((some.action("go"), some.action("wait"))),
        nodes.Repeater(
            (
                nodes.Condition(Literal(LastActionIs("go", ("turn", "wait")))),
                some.action("turn"),
            )
        ),
        nodes.Condition(Literal(Interval("battery", 0.1, 0.7))),
        nodes.Condition(Literal(Threshold(some.DIFFERENCE, 0.1 + 0.2))),
        nodes.Condition(~Literal(Interval(some.DIFFERENCE, -0.1, 0.0))),
        nodes.Condition(Literal(Threshold(some.SUM, 0.1 + 0.2))),
        nodes.Condition(~Literal(Interval(some.SUM, -0.1, 0.0))),
        nodes.Condition(Literal(PreviousActionIs("go"))),
    )
)
FULL = LearnedTree(
    some.FEATURES,
    some.ACTIONS,
    EVERY_NODE,
    Provenance(
        3,
        70,
        0.3,
        5,
        0.01,
        Root.SELECTOR,
        History.PREVIOUS,
        Figures(0, 0.75, 0.5, 20, 0.25),
        (ChannelProvenance(some.CHANNEL, 70, 0.01, History.LAST, Figures(1, None, None, 0)),),
        late_rows=2,
        late_seconds=0.2,
    ),
    (Suggestion("psa-1", SuggestionKind.PSA, 3, EVERY_NODE.children[3], attached=True),),
    (
        ShownChannel(
            some.CHANNEL,
            (ShownLeaf(7, (Span(0.1, 0.1 + 0.2), None, Span(0.0, 1.0), ("cup",))),),
        ),
    ),
    RowKind.SAMPLE,
)


def document() -> dict[str, Any]:
    """A valid document that has everything once."""
    decoded: dict[str, Any] = json.loads(dumps(FULL))
    return decoded


def refusal(text: str) -> str:
    """Why a text is refused; that it is refused otherwise fails the test."""
    with pytest.raises(DocumentError) as refused:
        loads(text)
    message = str(refused.value)
    assert message.endswith(".")
    assert "\n" not in message
    # For a log line or a service response, whatever was sent.
    assert len(message) < 500
    message.encode()
    return message


def reason_against(text: str) -> str | None:
    try:
        loads(text)
    except DocumentError as refused:
        return str(refused)
    return None


# --- there and back ---------------------------------------------------------------------------


@settings(max_examples=40)
@given(some.learned_trees())
@example(FULL)
def test_what_is_dumped_is_loaded_again(learned: LearnedTree) -> None:
    text = dumps(learned)
    text.encode()
    assert loads(text) == learned
    assert dumps(loads(text)) == text
    assert SCHEMA.is_valid(json.loads(text))


@given(st.floats(allow_nan=False, allow_infinity=False))
@example(-0.0)
@example(5e-324)
@example(1.7976931348623157e308)
@example(0.1 + 0.2)
def test_thresholds_keep_every_bit(value: float) -> None:
    for quantity in ("distance", some.DIFFERENCE, some.SUM):
        tree = nodes.Condition(Literal(Threshold(quantity, value)))
        loaded = loads(dumps(some.learned(tree))).tree
        assert isinstance(loaded, nodes.Condition)
        threshold = loaded.literal.condition
        assert isinstance(threshold, Threshold)
        assert threshold.quantity == quantity
        assert struct.pack("d", threshold.value) == struct.pack("d", value)


@given(some.quantities, some.ends)
def test_ends_of_intervals_keep_every_bit(quantity: Quantity, between: list[float]) -> None:
    tree = nodes.Condition(Literal(Interval(quantity, *between)))
    loaded = loads(dumps(some.learned(tree))).tree
    assert isinstance(loaded, nodes.Condition)
    interval = loaded.literal.condition
    assert isinstance(interval, Interval)
    assert interval.quantity == quantity
    assert struct.pack("2d", interval.above, interval.at_most) == struct.pack("2d", *between)


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(json_schema())
    Draft202012Validator(json_schema()).validate(document())


def test_the_schema_that_is_installed_is_the_one_that_the_forms_give() -> None:
    shipped = resources.files(behavior_tree).joinpath("behavior_tree.schema.json")
    generated = indented(json_schema()) + "\n"
    assert shipped.read_text(encoding="utf-8") == generated, f"write to {shipped}:\n{generated}"


def test_numbers_may_be_written_with_or_without_a_fraction() -> None:
    changed = document()
    changed["version"] = 3.0
    changed["provenance"]["rows"] = 7.0
    changed["provenance"]["delta"] = 1
    changed["tree"]["children"][0]["children"][0]["test"]["at_most"] = 3
    assert SCHEMA.is_valid(changed)
    loaded = loads(json.dumps(changed))
    assert loaded.provenance.rows == 7
    assert type(loaded.provenance.rows) is int
    assert type(loaded.provenance.delta) is float


# --- the schema and the reader agree ----------------------------------------------------------

#: What the schema cannot say.
EXTRA_RULES = (
    "is not declared",
    "has no category",
    "two features have the same name",
    "more than 100 levels",
    "whole characters",
    "finite number",
    "must not be empty",
    "a leaf has the values of",
    "cannot be",
    "does not have all categories",
    "and itself is always 0",
    "the weight of",
    "two different features",
)


def places(value: object) -> Iterator[tuple[Any, Any]]:
    """Every container of the document with each of its keys."""
    if isinstance(value, dict | list):
        for key in list(value) if isinstance(value, dict) else range(len(value)):
            yield value, key
            yield from places(value[key])


scalars = st.sampled_from(
    (None, True, False, 0, 1, -1, 1.0, 0.5, 1.5, -0.5, 10**400, "", "x", "condition", "psa")
)
json_values = st.recursive(
    scalars | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=4,
)


@st.composite
def mutated(draw: st.DrawFn) -> Any:
    changed = document()
    for _ in range(draw(st.integers(1, 2))):
        every = list(places(changed))
        if not every:
            break
        container, key = draw(st.sampled_from(every))
        how = draw(st.sampled_from(("delete", "replace", "swap", "rename", "add", "wrap")))
        other_container, other_key = draw(st.sampled_from(every))
        if how == "delete":
            del container[key]
        elif how == "replace":
            container[key] = draw(json_values)
        elif how == "swap":
            container[key] = copy.deepcopy(other_container[other_key])
        elif how == "wrap":
            container[key] = draw(
                st.sampled_from(([container[key]], {"child": container[key]}, [], {}))
            )
        elif isinstance(container, dict):
            name = other_key if isinstance(other_key, str) else draw(st.text(max_size=3))
            container[name] = container.pop(key) if how == "rename" else draw(json_values)
        else:
            container.append(copy.deepcopy(container[key]))
    return changed


@settings(max_examples=150)
@given(mutated())
def test_the_reader_accepts_what_the_schema_accepts(changed: Any) -> None:
    text = json.dumps(changed)
    reason = reason_against(text)
    if SCHEMA.is_valid(changed):
        assert reason is None or any(rule in reason for rule in EXTRA_RULES), reason
    else:
        assert reason is not None


#: Without "minus" a quantity is a feature.
HAVE_DEFAULTS = {"memory", "channels", "mean_recall", "late_rows", "late_seconds", "minus"}


def test_no_field_can_be_left_out_unless_it_has_a_default() -> None:
    count = len(list(places(document())))
    for number in range(count):
        changed = document()
        container, key = list(places(changed))[number]
        if isinstance(container, dict) and key not in HAVE_DEFAULTS:
            del container[key]
            assert not SCHEMA.is_valid(changed)
            refusal(json.dumps(changed))


@pytest.mark.parametrize("name", ["tree", "features", "actions", "suggestions", "provenance"])
@pytest.mark.parametrize("value", [None, True, 0, 1.5, "x", [[]], {"type": "x"}, [None]])
def test_no_part_can_be_of_another_type(name: str, value: object) -> None:
    changed = document()
    changed[name] = value
    assert not SCHEMA.is_valid(changed)
    assert f"document.{name}" in refusal(json.dumps(changed))


# --- messages name the place ------------------------------------------------------------------

Change = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("tree"), "document lacks 'tree'."),
        (lambda d: d.update(extra=1), "document has the unknown field 'extra'."),
        (lambda d: d.pop("format"), "does not say that its format is 'rebt_ros/behavior_tree'"),
        (lambda d: d.update(format="bt"), "does not say that its format is"),
        (lambda d: d.update(version=4), "document lacks 'robot'."),
        (lambda d: d.update(version=5), "version 5: this release of rebt_ros reads the versions 3"),
        (lambda d: d.update(version=1), "version 1: this release of rebt_ros reads the versions 3"),
        (lambda d: d.update(version=2), "reads the versions 3 and 4."),
        (lambda d: d.pop("row_kind"), "document lacks 'row_kind'."),
        (
            lambda d: d.update(row_kind="state"),
            "document.row_kind must be one of event, sample, not 'state'.",
        ),
        (
            lambda d: d["provenance"].update(uses_last_action=True),
            "document.provenance has the unknown field 'uses_last_action'.",
        ),
        (
            lambda d: d["provenance"]["channels"][0].pop("history"),
            "document.provenance.channels[0] lacks 'history'.",
        ),
        (
            lambda d: d["provenance"].update(history="lat"),
            "document.provenance.history must be one of none, previous, last, not 'lat'.",
        ),
        (
            lambda d: d["provenance"].update(late_rows=-1),
            "document.provenance.late_rows must be a whole number of at least 0, not -1.",
        ),
        (lambda d: d["provenance"].update(late_seconds=-0.1), "document.provenance.late_seconds"),
        (
            lambda d: d["provenance"]["figures"].update(mean_recall=1.5),
            "document.provenance.figures.mean_recall must be a number from 0 to 1, not 1.5.",
        ),
        (
            lambda d: d["tree"]["children"][6]["test"].update(minus="distance"),
            "the difference of 'distance' and itself is always 0",
        ),
        (
            lambda d: d["tree"]["children"][6]["test"].update(minus="speed"),
            "feature 'speed' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][7]["test"].update(feature="speed"),
            "feature 'speed' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][9]["test"].update(minus="speed"),
            "a test on 'distance' has either 'minus', or both 'weight' and 'plus', or none",
        ),
        (
            lambda d: d["tree"]["children"][9]["test"].update(plus=[]),
            "document.tree.children[9].test.plus must be an array of at least 1 elements, not []",
        ),
        (
            lambda d: d["tree"]["children"][9]["test"].pop("plus"),
            "a test on 'distance' has either 'minus', or both 'weight' and 'plus', or none",
        ),
        (
            lambda d: d["tree"]["children"][9]["test"]["plus"][0].update(weight=0),
            "the weight of 'battery' must be finite and not 0, not 0",
        ),
        (
            lambda d: d["tree"]["children"][9]["test"]["plus"][0].update(feature="speed"),
            "'speed'",
        ),
        (
            lambda d: d["tree"]["children"][7]["test"].update(minus=None),
            "document.tree.children[7].test.minus must be a text, not None.",
        ),
        (
            lambda d: d["tree"]["children"][1]["children"][0]["child"]["test"].update(minus="x"),
            "has the unknown field 'minus'",
        ),
        (
            lambda d: d["tree"]["children"][10]["test"].update(action="fly"),
            "previous action 'fly' is not declared",
        ),
        (lambda d: d.pop("shown"), "document lacks 'shown'."),
        (
            lambda d: d["shown"][0]["leaves"][0]["values"].pop(),
            "a leaf has the values of 3 of 4 features",
        ),
        (
            lambda d: d["shown"][0]["leaves"][0]["values"].__setitem__(0, [2, 1]),
            "'distance' cannot be 2 to 1",
        ),
        (
            lambda d: d["shown"][0]["leaves"][0]["values"].__setitem__(3, [0, 1]),
            "'kind' cannot be 0 to 1",
        ),
        (
            lambda d: d["shown"][0]["leaves"][0]["values"].__setitem__(0, ["cup"]),
            "'distance' does not have all categories",
        ),
        (
            lambda d: d["shown"][0]["leaves"][0]["values"].__setitem__(0, [1, 2, 3]),
            "document.shown[0].leaves[0].values[0] must be null, two numbers or categories",
        ),
        (
            lambda d: d["shown"][0].update(leaves=d["shown"][0]["leaves"] * 251),
            "must be an array of at most 250 elements",
        ),
        (lambda d: d.update(version=True), "version True"),
        (lambda d: d.update(version="1"), "version '1'"),
        (lambda d: d.pop("version"), "version None"),
        (lambda d: d.update(actions=[]), "document.actions must be an array of at least 1"),
        (
            lambda d: d["features"][2].update(kind="text"),
            "document.features[2].kind must be one of numeric, binary, categorical, not 'text'.",
        ),
        (lambda d: d["features"][0].update(categories=["a"]), "contradicts itself"),
        (lambda d: d["features"][3].pop("categories"), "contradicts itself"),
        (lambda d: d["features"][0].update(topic="state"), "contradicts itself"),
        (lambda d: d["features"][0].update(index=1), "contradicts itself"),
        (lambda d: d["features"][0].update(lag=1), "looks back without an index"),
        (
            lambda d: d["features"][0].update(index=1, lag=0),
            "document.features[0].lag must be a whole number from 1 to 20, not 0.",
        ),
        (lambda d: d["features"][0].update(index=1, lag=21), "from 1 to 20, not 21."),
        (lambda d: d["features"][0].update(index=1, lag=True), "from 1 to 20, not True."),
        (
            lambda d: d["features"].append(dict(d["features"][0])),
            "two features have the same name",
        ),
        (
            lambda d: d["tree"].update(type="cycle"),
            "document.tree has the unknown type 'cycle'.",
        ),
        (
            lambda d: d["tree"]["children"][0]["children"][1].pop("label"),
            "document.tree.children[0].children[1] lacks 'label'.",
        ),
        (
            lambda d: d["tree"]["children"][0]["children"][0]["test"].update(at_most="near"),
            "document.tree.children[0].children[0].test.at_most must be a number, not 'near'.",
        ),
        (
            lambda d: d["tree"]["children"][0]["children"][0]["test"].update(at_most=10**400),
            "document.tree.children[0].children[0].test.at_most must be a finite number",
        ),
        (
            lambda d: d["tree"]["children"][0]["children"][0]["test"].update(feature="speed"),
            "feature 'speed' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][5]["test"].update(feature="speed"),
            "feature 'speed' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][5]["test"].update(above=None),
            "document.tree.children[5].test.above must be a number, not None.",
        ),
        (
            lambda d: d["tree"]["children"][5]["test"].update(above=0.7),
            "the interval of 'battery' must not be empty, as from 0.7 to 0.7",
        ),
        (
            lambda d: d["tree"]["children"][2]["children"][0]["test"].update(category="plate"),
            "feature 'kind' has no category 'plate'",
        ),
        (
            lambda d: d["tree"]["children"][3]["children"][0].update(label="fly"),
            "action 'fly' on 'action' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][4]["children"][0]["test"].update(action="fly"),
            "last action 'fly' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][4]["children"][0]["test"]["deciding"].append("fly"),
            "last action 'fly' is not declared",
        ),
        (
            lambda d: d["suggestions"][0]["tree"]["children"][0].update(channel="arm"),
            "action 'go' on 'arm' is not declared",
        ),
        (
            lambda d: d["tree"]["children"][1]["children"].clear(),
            "document.tree.children[1].children must be an array of at least 1 elements, not [].",
        ),
        (
            lambda d: d["tree"].update(memory=True),
            "document.tree has the unknown field 'memory'.",
        ),
        (
            lambda d: d["suggestions"][0].update(support=-1),
            "document.suggestions[0].support must be a whole number of at least 0, not -1.",
        ),
        (
            lambda d: d["provenance"].update(delta=1.5),
            "document.provenance.delta must be a number from 0 to 1, not 1.5.",
        ),
        (
            lambda d: d["provenance"]["figures"].update(own_history_agreement="all"),
            "document.provenance.figures.own_history_agreement must be a number, not 'all'.",
        ),
        (lambda d: d["actions"][0].update(label="\ud800"), "a text of whole characters"),
    ],
)
def test_a_refusal_names_the_place(change: Change, message: str) -> None:
    changed = document()
    change(changed)
    assert message in refusal(json.dumps(changed))


# --- hostile input ----------------------------------------------------------------------------


@settings(max_examples=100)
@given(st.text() | st.text(alphabet='{}[]",:0123456789.eE+-truefalsn\\u \n'))
@example("")
@example("null")
@example("[]")
@example("\ufeff{}")
@example("\ud800")
def test_any_text_is_refused(text: str) -> None:
    refusal(text)


@settings(max_examples=60)
@given(json_values)
def test_any_other_json_is_refused(value: object) -> None:
    refusal(json.dumps(value))


def test_a_document_that_was_cut_off_is_refused_wherever_it_was_cut() -> None:
    text = dumps(FULL)
    for end in range(0, len(text), 7):
        refusal(text[:end])
    refusal(text[:-1])


@settings(max_examples=100)
@given(st.integers(0, 10**6), st.characters())
def test_a_changed_character_is_refused_or_read(place: int, character: str) -> None:
    text = dumps(FULL)
    place %= len(text)
    reason = reason_against(text[:place] + character + text[place + 1 :])
    assert reason is None or reason.endswith(".")


def with_value(name: str, value: str) -> str:
    """The document with JSON text as the value of one of its fields."""
    changed = document()
    changed[name] = "@@"
    return json.dumps(changed).replace('"@@"', value)


FIELDS = ("format", "version", "features", "actions", "tree", "suggestions", "provenance", "shown")


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize(
    "value",
    [
        "[" * 100_000,
        "[" * 100_000 + "]" * 100_000,
        '{"a":' * 100_000 + "1" + "}" * 100_000,
        "9" * 4000,
        "9" * 5000,
        "-" + "9" * 5000,
        "1e999",
        "-1e999",
        "NaN",
        "Infinity",
        "-Infinity",
        '"\\ud800"',
        '"' + "x" * 100_000 + '"',
        "[" + "1," * 10_000 + "1]",
        '{"type": "' + "x" * 10_000 + '"}',
    ],
    ids=[
        "open brackets",
        "brackets",
        "braces",
        "4000 digits",
        "5000 digits",
        "-5000 digits",
        "1e999",
        "-1e999",
        "NaN",
        "Infinity",
        "-Infinity",
        "lone surrogate",
        "long text",
        "long array",
        "long type",
    ],
)
def test_a_hostile_value_is_refused_in_every_field(name: str, value: str) -> None:
    refusal(with_value(name, value))


@pytest.mark.parametrize("value", ["1e999", "NaN", "9" * 5000, "Infinity", '"0.3"', "[0.3]"])
def test_a_threshold_is_a_finite_number(value: str) -> None:
    assert isinstance(NEAR.condition, Threshold)
    refusal(dumps(FULL).replace(repr(NEAR.condition.value), value))


@pytest.mark.parametrize("name", ["version", "features", "tree", "provenance"])
def test_nesting_is_refused_also_at_the_edge_of_what_can_be_read(name: str) -> None:
    for depth in (*range(850, 1010), 3000, 10_000, 30_000):
        refusal(with_value(name, "[" * depth + "]" * depth))


def test_a_field_that_is_there_twice_does_no_harm() -> None:
    text = dumps(FULL)
    assert loads('{"version": 7,' + text[1:]) == FULL
    refusal(text[:-1] + ', "version": 7}')


def nested(levels: int) -> LearnedTree:
    tree: nodes.Node = some.action("go")
    for _ in range(levels - 1):
        tree = nodes.Inverter(tree)
    return some.learned(tree)


def test_a_tree_may_have_100_levels_and_not_one_more() -> None:
    assert DEEPEST_TREE == 100
    assert nodes.depth(loads(dumps(nested(100))).tree) == 100
    assert "more than 100 levels" in refusal(dumps(nested(101)))


def test_a_document_may_be_large_and_not_larger() -> None:
    text = dumps(FULL)
    assert loads(text + " " * (LARGEST_DOCUMENT - len(text))) == FULL
    message = refusal(text + " " * (LARGEST_DOCUMENT - len(text) + 1))
    assert f"{LARGEST_DOCUMENT + 1} characters" in message


def test_a_document_with_very_many_actions_is_read_in_reasonable_time() -> None:
    actions = tuple(some.action(str(number)) for number in range(20_000))
    features = tuple(some.FEATURES[:1])
    learned = LearnedTree(features, actions, nodes.Selector(actions), some.PROVENANCE)
    assert loads(dumps(learned)) == learned


@pytest.mark.parametrize(
    "names",
    [(), ("x", "x"), ("x",)],
)
def test_a_learned_tree_declares_what_it_tests(names: tuple[str, ...]) -> None:
    features = tuple(some.FEATURES[0].__class__(name) for name in names)
    with pytest.raises(ValueError):
        some.learned(nodes.Condition(NEAR), features)
