"""The behavior tree document: one versioned JSON format for topic, disk and page.

`dumps` and `loads` are inverse to each other, to the last bit of every threshold.  Both, and the
JSON Schema for other programs, follow from the forms declared here.  A document comes from
outside: it is read with bounds on its size and depth, and anything that is not expected is refused
with the place where it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import (
    ChannelProvenance,
    Figures,
    LearnedTree,
    Mended,
    Provenance,
    Suggestion,
)
from rebt_ros.behavior_tree.shown import ShownChannel, ShownValues, Span
from rebt_ros.codec.containers import Array, Named, Tagged
from rebt_ros.codec.form import Definitions, Form, Json, MisfitError, abridged
from rebt_ros.codec.hints import form_of, record
from rebt_ros.codec.record import Field, Record
from rebt_ros.codec.scalars import Number, Text, Truth, Whole
from rebt_ros.codec.text import indented, parsed
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import LARGEST_LAG, Feature
from rebt_ros.errors import DocumentError
from rebt_ros.logic.conditions import (
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
    WeightedSum,
    features_in,
)
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.reading import CarriedRobotFile

FORMAT: Final = "rebt_ros/behavior_tree"
VERSION: Final = 3
#: The same with a robot file.
ROBOT_VERSION: Final = 4

#: Longest document that is read, in characters.
LARGEST_DOCUMENT: Final = 4_000_000
#: Most values that a document may hold, counted by its commas and opening brackets: a tree of about
#: 20,000 nodes.  A running executor reads documents between two ticks.
MOST_VALUES: Final = 150_000
#: Longest way from a tree's root to a leaf, in nodes.
DEEPEST_TREE: Final = 100


def json_schema() -> Json:
    """The JSON Schema (draft 2020-12) of the document."""
    definitions: Definitions = {}
    schema = _DOCUMENTS[ROBOT_VERSION].schema(definitions)
    properties = schema["properties"] | {"version": {"enum": list(_DOCUMENTS)}}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "rebt_ros behavior tree document, versions 3 and 4",
        "description": "A behavior tree learned from demonstrations. Texts are UTF-8; numbers are "
        "finite and keep every bit of a double. Beyond this schema: trees have at most "
        f"{DEEPEST_TREE} levels, intervals are not empty, trees test and take only declared "
        "features, categories and actions, and what was shown fits the features. Version 4 is "
        "version 3 with a robot file.",
        **schema,
        "properties": properties,
        "required": [name for name in schema["required"] if name != "robot"],
        "if": {"properties": {"version": {"const": ROBOT_VERSION}}},
        "then": {"required": ["robot"]},
        "else": {"properties": {"robot": False}},
        "$defs": definitions,
    }


def dumps(learned: LearnedTree) -> str:
    """The document as JSON text."""
    form = _DOCUMENTS[VERSION if learned.robot is None else ROBOT_VERSION]
    return indented(form.encode(learned))


def loads(text: str) -> LearnedTree:
    """The learned tree of a document.

    Raises:
        DocumentError: The text is not such a document; the message says where and why.
    """
    if len(text) > LARGEST_DOCUMENT:
        raise DocumentError(
            f"the document has {len(text)} characters: at most {LARGEST_DOCUMENT} are read."
        )
    values = sum(map(text.count, ",[{"))
    if values > MOST_VALUES:
        raise DocumentError(f"the document has {values} values: at most {MOST_VALUES} are read.")
    try:
        return _learned_tree(_json(text))
    except RecursionError as err:
        raise DocumentError("the document is nested too deeply to be read.") from err


def _json(text: str) -> Json:
    try:
        return parsed(text)
    except ValueError as err:
        raise DocumentError(f"the document is not JSON: {err}.") from err


def _learned_tree(value: Json) -> LearnedTree:
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        raise DocumentError(f"the document does not say that its format is {FORMAT!r}.")
    version = value.get("version")
    # JSON does not tell 3.0 from 3.
    if isinstance(version, bool) or version not in list(_DOCUMENTS):
        raise DocumentError(
            f"the document has version {abridged(version)}: "
            f"this release of rebt_ros reads the versions {' and '.join(map(str, _DOCUMENTS))}."
        )
    try:
        learned = _DOCUMENTS[int(version)].decode(value)
    except MisfitError as err:
        raise DocumentError(err.sentence("document")) from err
    except RobotFileError as err:
        raise DocumentError(str(err)) from err
    except ValueError as err:
        raise DocumentError(f"the document contradicts itself: {_beginning(str(err))}.") from err
    for tree in (learned.tree, *(suggestion.subtree for suggestion in learned.suggestions)):
        if nodes.depth(tree) > DEEPEST_TREE:
            raise DocumentError(f"the tree has more than {DEEPEST_TREE} levels.")
    return learned


def _beginning(text: str) -> str:
    return text if len(text) <= 200 else f"{text[:200]}…"


class _SpanOrCategories(Form[ShownValues]):
    """The smallest and the largest value, or categories, or null."""

    _SPAN = Array(Number())
    _CATEGORIES = Array(Text(), 1)

    def decode(self, value: Json) -> ShownValues:
        if value is None:
            return None
        if isinstance(value, list) and value and isinstance(value[0], str):
            return self._CATEGORIES.decode(value)
        numbers = self._SPAN.decode(value)
        if len(numbers) != 2:
            raise MisfitError.instead_of("null, two numbers or categories", value)
        return Span(*numbers)

    def encode(self, value: ShownValues) -> Json:
        if value is None:
            return None
        return [value.low, value.high] if isinstance(value, Span) else list(value)

    def schema(self, definitions: Definitions) -> Json:
        span = self._SPAN.schema(definitions) | {"minItems": 2, "maxItems": 2}
        return {"oneOf": [{"type": "null"}, span, self._CATEGORIES.schema(definitions)]}


def _comparison(kind: type[Any], *ends: Field[Any]) -> Record[Any]:
    """The form of a test on a quantity: one feature, one less another, or a weighted sum."""

    def make(
        feature: str,
        minus: str | None = None,
        weight: float | None = None,
        plus: tuple[tuple[str, float], ...] | None = None,
        **bounds: float,
    ) -> Any:
        if weight is None and plus is None:
            return kind(feature if minus is None else Difference(feature, minus), **bounds)
        if weight is None or plus is None or minus is not None:
            raise ValueError(
                f"a test on {feature!r} has either 'minus', or both 'weight' and 'plus', or none"
            )
        return kind(WeightedSum(((feature, weight), *plus)), **bounds)

    return Record(
        kind,
        (
            Field("feature", Text(), get=lambda test: features_in(test.quantity)[0]),
            Field(
                "minus",
                Text(),
                get=lambda test: _subtrahend(test.quantity),
                default=None,
                omitted=True,
                description="The test is about the feature less this other one.",
            ),
            Field(
                "weight",
                Number(),
                get=lambda test: _weight(test.quantity),
                default=None,
                omitted=True,
                description="Of the feature in a weighted sum; not 0.",
            ),
            Field(
                "plus",
                Array(_TERM, 1),
                get=lambda test: _further(test.quantity),
                default=None,
                omitted=True,
                description="The test is about the feature times its weight, plus each of these "
                "times its own, in this order.",
            ),
            *ends,
        ),
        make=make,
        rules={
            "dependentRequired": {"weight": ["plus"], "plus": ["weight"]},
            "not": {"required": ["minus", "plus"]},
        },
    )


_TERM: Final[Form[tuple[str, float]]] = Named(
    "term",
    Record(
        tuple,
        (
            Field("feature", Text(), get=lambda term: term[0]),
            Field("weight", Number(), get=lambda term: term[1], description="Not 0."),
        ),
        make=lambda feature, weight: (feature, weight),
    ),
)


def _subtrahend(quantity: Quantity) -> str | None:
    return quantity.subtrahend if isinstance(quantity, Difference) else None


def _weight(quantity: Quantity) -> float | None:
    return quantity.terms[0][1] if isinstance(quantity, WeightedSum) else None


def _further(quantity: Quantity) -> tuple[tuple[str, float], ...] | None:
    return quantity.terms[1:] if isinstance(quantity, WeightedSum) else None


_TEST: Final[Form[Any]] = Named(
    "test",
    Tagged(
        "type",
        {
            "threshold": _comparison(Threshold, Field("at_most", Number(), "value")),
            "interval": _comparison(
                Interval,
                Field("above", Number(), description="Less than at_most."),
                Field("at_most", Number()),
            ),
            "is_true": record(IsTrue),
            "has_category": record(HasCategory),
            "previous_action_is": record(
                PreviousActionIs,
                Field("action", description="That of the row, or tick, before."),
            ),
            "last_action_is": record(
                LastActionIs,
                "action",
                Field(
                    "deciding",
                    description="Actions of the rule it stands in: LAT is the most recent other "
                    "one.",
                ),
            ),
        },
    ),
)

_NODE: Final[Named[nodes.Node]] = Named("node")
_CHILDREN: Final[Field[Any]] = Field("children", Named("children", Array(_NODE, 1)))
_MEMORY: Final[Field[Any]] = Field(
    "memory", Truth(), omitted=True, description="Resumes at the child that was running."
)
_NODE.define(
    Tagged(
        "type",
        {
            "sequence": record(nodes.Sequence, _MEMORY, _CHILDREN),
            "selector": record(nodes.Selector, _MEMORY, _CHILDREN),
            "parallel": record(nodes.Parallel, _CHILDREN),
            "parallel_selector": record(nodes.ParallelSelector, _CHILDREN),
            "repeater": record(nodes.Repeater, _CHILDREN),
            "inverter": record(nodes.Inverter, Field("child", _NODE)),
            "condition": Record(
                nodes.Condition,
                (
                    Field("test", _TEST, get=lambda node: node.literal.condition),
                    Field(
                        "positive",
                        Truth(),
                        get=lambda node: node.literal.positive,
                        description="false: holds where the test does not.",
                    ),
                ),
                make=lambda test, positive: nodes.Condition(Literal(test, positive)),
            ),
            "action": record(nodes.Action),
        },
    )
)

_FEATURE: Final = Named(
    "feature",
    record(
        Feature,
        Field("name"),
        Field("kind"),
        Field("categories", omitted=True),
        Field(
            "topic",
            Text(),
            omitted=True,
            description="State topic that carries it; absent for tables.",
        ),
        Field(
            "index",
            Whole(0),
            omitted=True,
            description="Position in the topic's array; with a lag and no topic, in the table.",
        ),
        Field(
            "lag",
            Whole(1, LARGEST_LAG),
            omitted=True,
            description="Its value is that of the topic and index so many rows, or ticks, before; "
            "absent for the present value.",
        ),
        rules={
            "dependentRequired": {"topic": ["index"], "lag": ["index"]},
            "dependentSchemas": {
                "index": {"anyOf": [{"required": ["topic"]}, {"required": ["lag"]}]}
            },
            "if": {"properties": {"kind": {"const": "categorical"}}},
            "then": {"required": ["categories"], "properties": {"categories": {"minItems": 1}}},
            "else": {"properties": {"categories": {"maxItems": 0}}},
        },
    ),
)

_KNOWN: Final[Mapping[Any, Form[Any]]] = {
    nodes.Node: _NODE,
    Feature: _FEATURE,
    ShownValues: _SpanOrCategories(),
    History: Named("history", form_of(History)),
    Figures: Named("figures", record(Figures)),
}

_MENDED: Final = record(
    Mended,
    Field("added", description="How many nodes the tree has more."),
    Field("rows", description="How many rows were at hand."),
    Field("changed", description="In how many of them the tree does something else."),
    Field("agreement", description="With these rows, before and after; null without rows."),
    Field("mean_recall", description="Of their actions, before and after."),
)

_PROVENANCE: Final = record(
    Provenance,
    "demonstrations",
    "rows",
    "delta",
    "max_depth",
    "ccp_alpha",
    "root",
    Field(
        "history",
        description="What the tree could test of what was done before: nothing, the previous "
        "action, or the paper's last action taken.",
    ),
    Field(
        "late_rows",
        default=0,
        description="How late the demonstrator acted; undone before learning.",
    ),
    Field(
        "late_seconds",
        default=None,
        description="The same in seconds; null where stamps do not tell the time.",
    ),
    "figures",
    Field(
        "channels",
        Array(record(ChannelProvenance, known=_KNOWN)),
        omitted=True,
        description="Of each channel, where there are several.",
    ),
    Field(
        "mended",
        _MENDED,
        omitted=True,
        description="What guards have changed, so that the tree keeps its rules; all other "
        "figures are of the tree before.",
    ),
    known=_KNOWN,
)

_SUGGESTION: Final = record(
    Suggestion,
    "id",
    "kind",
    "support",
    Field("attached"),
    Field("tree", _NODE, "subtree"),
)


def _document(version: int, *further: Field[LearnedTree]) -> Record[LearnedTree]:
    return record(
        LearnedTree,
        *further,
        Field(
            "row_kind",
            description="What the tree was learned from, which decides what the previous action "
            "is: that which ended last, or what was done at the last tick.",
        ),
        Field("features", description="Columns of the state, in the order of the learned table."),
        Field(
            "actions",
            Array(record(nodes.Action), 1),
            description="Every action that was shown.",
        ),
        Field("tree", _NODE),
        Field(
            "suggestions",
            Array(_SUGGESTION),
            description="Subtrees that the user may attach to the root.",
        ),
        Field("provenance", _PROVENANCE),
        Field(
            "shown",
            Array(record(ShownChannel, known=_KNOWN)),
            description="The rows that each channel was learned from, leaf by leaf of its "
            "decision tree.",
        ),
        known=_KNOWN,
    ).with_constants({"format": FORMAT, "version": version})


_DOCUMENTS: Final[Mapping[int, Record[LearnedTree]]] = {
    VERSION: _document(VERSION),
    ROBOT_VERSION: _document(
        ROBOT_VERSION,
        Field(
            "robot",
            CarriedRobotFile("the document's robot file"),
            description="The robot file that the tree was learned by, as its own schema "
            "describes it; in version 4 alone.",
        ),
    ),
}
