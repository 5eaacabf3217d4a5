"""The behavior tree document: one versioned JSON format for topic, disk and page.

`dumps` and `loads` are inverse to each other, to the last bit of every threshold.  What `loads`
accepts is described, for other programs, by the JSON Schema beside this module; a test holds the
two together.  A document comes from outside: it is read with bounds on its size and depth, and
anything that is not expected is refused with the place where it stands.
"""

from __future__ import annotations

import json
import math
import reprlib
from collections.abc import Callable, Mapping
from enum import Enum
from importlib import resources
from typing import Any, NoReturn, TypeAlias, TypeVar

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import (
    ChannelProvenance,
    Figures,
    LearnedTree,
    Provenance,
    Root,
    Suggestion,
    SuggestionKind,
)
from rebt_ros.behavior_tree.shown import (
    MOST_SHOWN_LEAVES,
    ShownChannel,
    ShownLeaf,
    ShownValues,
    Span,
)
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import LARGEST_LAG, Feature, FeatureKind
from rebt_ros.errors import DocumentError
from rebt_ros.logic.conditions import (
    Condition,
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
)
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.reading import robot_file_of
from rebt_ros.robot_file.robot_file import RobotFile

FORMAT = "rebt_ros/behavior_tree"
VERSION = 3
#: The same with a robot file.
ROBOT_VERSION = 4
#: The fields that each version has beside those of version 3.
_ADDED: Mapping[int, tuple[str, ...]] = {VERSION: (), ROBOT_VERSION: ("robot",)}

#: Longest document that is read, in characters.
LARGEST_DOCUMENT = 4_000_000
#: Most values that a document may hold, counted by its commas and opening brackets: a tree of about
#: 20,000 nodes.  A running executor reads documents between two ticks.
MOST_VALUES = 150_000
#: Longest way from a tree's root to a leaf, in nodes.
DEEPEST_TREE = 100

#: Shows the beginning of large values, and not more than a few levels of nested ones.
_SHORT = reprlib.Repr()
_SHORT.maxlevel = 3
_SHORT.maxstring = 60

Json: TypeAlias = dict[str, Any]
_T = TypeVar("_T")
_E = TypeVar("_E", bound=Enum)

_COMPOSITES: dict[str, type[nodes.Composite]] = {
    "sequence": nodes.Sequence,
    "selector": nodes.Selector,
    "parallel": nodes.Parallel,
    "parallel_selector": nodes.ParallelSelector,
    "repeater": nodes.Repeater,
}
_TYPE_NAMES = {kind: name for name, kind in _COMPOSITES.items()}


def json_schema() -> Json:
    """The JSON Schema (draft 2020-12) of the document."""
    source = resources.files(__package__).joinpath("behavior_tree.schema.json")
    schema: Json = json.loads(source.read_text(encoding="utf-8"))
    return schema


def dumps(learned: LearnedTree) -> str:
    """The document as JSON text."""
    return json.dumps(_encode(learned), indent=1, ensure_ascii=False, allow_nan=False)


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
        return _learned_tree(_Place(_json(text), "document"))
    except RecursionError as err:
        raise DocumentError("the document is nested too deeply to be read.") from err


def _json(text: str) -> object:
    try:
        value: object = json.loads(text, parse_constant=_refuse_constant)
    except ValueError as err:
        raise DocumentError(f"the document is not JSON: {err}.") from err
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number")


def _encode(learned: LearnedTree) -> Json:
    robot = learned.robot
    return {
        "format": FORMAT,
        "version": VERSION if robot is None else ROBOT_VERSION,
        **({} if robot is None else {"robot": robot.content}),
        "row_kind": learned.row_kind.value,
        "features": [_encode_feature(feature) for feature in learned.features],
        "actions": [
            {"label": action.label, "channel": action.channel} for action in learned.actions
        ],
        "tree": _encode_node(learned.tree),
        "suggestions": [
            {
                "id": suggestion.id,
                "kind": suggestion.kind.value,
                "support": suggestion.support,
                "attached": suggestion.attached,
                "tree": _encode_node(suggestion.subtree),
            }
            for suggestion in learned.suggestions
        ],
        "provenance": _encode_provenance(learned.provenance),
        "shown": [
            {
                "channel": one.channel,
                "leaves": [
                    {"rows": leaf.rows, "values": [_encode_shown(values) for values in leaf.values]}
                    for leaf in one.leaves
                ],
            }
            for one in learned.shown
        ],
    }


def _encode_shown(values: ShownValues) -> list[float] | list[str] | None:
    if values is None:
        return None
    return [values.low, values.high] if isinstance(values, Span) else list(values)


def _encode_provenance(provenance: Provenance) -> Json:
    encoded: Json = {
        "demonstrations": provenance.demonstrations,
        "rows": provenance.rows,
        "delta": provenance.delta,
        "max_depth": provenance.max_depth,
        "ccp_alpha": provenance.ccp_alpha,
        "root": provenance.root.value,
        "history": provenance.history.value,
        "late_rows": provenance.late_rows,
        "late_seconds": provenance.late_seconds,
        "figures": _encode_figures(provenance.figures),
    }
    if provenance.channels:
        encoded["channels"] = [
            {
                "channel": channel.channel,
                "rows": channel.rows,
                "ccp_alpha": channel.ccp_alpha,
                "history": channel.history.value,
                "figures": _encode_figures(channel.figures),
            }
            for channel in provenance.channels
        ]
    return encoded


def _encode_figures(figures: Figures) -> Json:
    return {
        "fidelity_mismatches": figures.fidelity_mismatches,
        "teacher_forced_agreement": figures.teacher_forced_agreement,
        "own_history_agreement": figures.own_history_agreement,
        "held_out_rows": figures.held_out_rows,
        "mean_recall": figures.mean_recall,
    }


def _encode_feature(feature: Feature) -> Json:
    encoded: Json = {"name": feature.name, "kind": feature.kind.value}
    if feature.categories:
        encoded["categories"] = list(feature.categories)
    if feature.topic is not None:
        encoded["topic"] = feature.topic
    if feature.index is not None:
        encoded["index"] = feature.index
    if feature.lag:
        encoded["lag"] = feature.lag
    return encoded


def _encode_node(node: nodes.Node) -> Json:
    match node:
        case nodes.Condition(literal=literal):
            test = _encode_condition(literal.condition)
            return {"type": "condition", "test": test, "positive": literal.positive}
        case nodes.Action(label=label, channel=channel):
            return {"type": "action", "label": label, "channel": channel}
        case nodes.Inverter(child=child):
            return {"type": "inverter", "child": _encode_node(child)}
        case _:
            encoded: Json = {"type": _TYPE_NAMES[type(node)]}
            if isinstance(node, nodes.Sequence | nodes.Selector) and node.memory:
                encoded["memory"] = True
            return encoded | {"children": [_encode_node(child) for child in node.children]}


def _encode_condition(condition: Condition) -> Json:
    match condition:
        case Threshold(quantity=quantity, value=value):
            return {"type": "threshold", **_encode_quantity(quantity), "at_most": value}
        case Interval(quantity=quantity, above=above, at_most=at_most):
            ends = {"above": above, "at_most": at_most}
            return {"type": "interval", **_encode_quantity(quantity), **ends}
        case IsTrue(feature=feature):
            return {"type": "is_true", "feature": feature}
        case HasCategory(feature=feature, category=category):
            return {"type": "has_category", "feature": feature, "category": category}
        case PreviousActionIs(action=action):
            return {"type": "previous_action_is", "action": action}
        case LastActionIs(action=action, deciding=deciding):
            return {"type": "last_action_is", "action": action, "deciding": list(deciding)}


def _encode_quantity(quantity: Quantity) -> Json:
    if isinstance(quantity, Difference):
        return {"feature": quantity.minuend, "minus": quantity.subtrahend}
    return {"feature": quantity}


def _abridged(value: object) -> str:
    """A value for a message, in as little room and time as it takes to recognize it."""
    return _cut(_SHORT.repr(value), 60)


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[:length]}…"


class _Place:
    """A value of the document and the way to it, for messages."""

    def __init__(self, value: object, path: str) -> None:
        self.value = value
        self.path = path

    def refuse(self, expected: str) -> NoReturn:
        raise DocumentError(f"{self.path} must be {expected}, not {_abridged(self.value)}.")

    def fields(self, *required: str, optional: tuple[str, ...] = ()) -> dict[str, _Place]:
        """The fields of an object that has all of `required` and nothing unknown."""
        if not isinstance(self.value, dict):
            self.refuse("an object")
        missing = [name for name in required if name not in self.value]
        unknown = [name for name in self.value if name not in (*required, *optional)]
        if missing:
            raise DocumentError(f"{self.path} lacks {missing[0]!r}.")
        if unknown:
            raise DocumentError(f"{self.path} has the unknown field {_abridged(unknown[0])}.")
        return {name: _Place(value, f"{self.path}.{name}") for name, value in self.value.items()}

    def items(self, read: Callable[[_Place], _T], least: int = 0) -> tuple[_T, ...]:
        """The elements of an array."""
        if not isinstance(self.value, list) or len(self.value) < least:
            self.refuse(f"an array of at least {least} elements" if least else "an array")
        return tuple(
            read(_Place(value, f"{self.path}[{index}]")) for index, value in enumerate(self.value)
        )

    def tag(self, name: str) -> str:
        """The text in field `name`, which tells what else the object holds."""
        if not isinstance(self.value, dict) or not isinstance(self.value.get(name), str):
            self.refuse(f"an object with a {name!r}")
        tag: str = self.value[name]
        return tag

    def text(self) -> str:
        if not isinstance(self.value, str):
            self.refuse("a text")
        if any("\ud800" <= one <= "\udfff" for one in self.value):
            self.refuse("a text of whole characters")
        return self.value

    def number(self, least: float = -math.inf, most: float = math.inf) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            self.refuse("a number")
        try:
            number = float(self.value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number) or not least <= number <= most:
            bounded = least > -math.inf or most < math.inf
            self.refuse(f"a number from {least:g} to {most:g}" if bounded else "a finite number")
        return number

    def whole(self, least: int = 0, most: int | None = None) -> int:
        number = self.value
        if isinstance(number, float) and number.is_integer():
            # JSON does not tell 2.0 from 2.
            number = int(number)
        expected = f"of at least {least}" if most is None else f"from {least} to {most}"
        if isinstance(number, bool) or not isinstance(number, int) or number < least:
            self.refuse(f"a whole number {expected}")
        if most is not None and number > most:
            self.refuse(f"a whole number {expected}")
        return number

    def truth(self) -> bool:
        if not isinstance(self.value, bool):
            self.refuse("true or false")
        return self.value

    def one_of(self, kind: type[_E]) -> _E:
        for member in kind:
            if member.value == self.value:
                return member
        self.refuse(f"one of {', '.join(str(member.value) for member in kind)}")

    def or_null(self, read: Callable[[], _T]) -> _T | None:
        return None if self.value is None else read()


def _learned_tree(place: _Place) -> LearnedTree:
    if not isinstance(place.value, dict) or place.value.get("format") != FORMAT:
        raise DocumentError(f"the document does not say that its format is {FORMAT!r}.")
    version = place.value.get("version")
    # JSON does not tell 3.0 from 3.
    if isinstance(version, bool) or not isinstance(version, int | float) or version not in _ADDED:
        raise DocumentError(
            f"the document has version {_abridged(version)}: "
            f"this release of rebt_ros reads the versions {' and '.join(map(str, _ADDED))}."
        )
    fields = place.fields(
        "format",
        "version",
        "features",
        "actions",
        "tree",
        "suggestions",
        "provenance",
        "shown",
        "row_kind",
        *_ADDED[int(version)],
    )
    try:
        return LearnedTree(
            features=fields["features"].items(_feature),
            actions=fields["actions"].items(_declared_action, least=1),
            tree=_node(fields["tree"], DEEPEST_TREE),
            provenance=_provenance(fields["provenance"]),
            suggestions=fields["suggestions"].items(_suggestion),
            shown=fields["shown"].items(_shown_channel),
            row_kind=fields["row_kind"].one_of(RowKind),
            robot=_robot(fields["robot"]) if "robot" in fields else None,
        )
    except ValueError as err:
        raise DocumentError(f"the document contradicts itself: {_cut(str(err), 200)}.") from err


def _robot(place: _Place) -> RobotFile:
    try:
        return robot_file_of(place.value, "the document's robot file")
    except RobotFileError as err:
        raise DocumentError(str(err)) from err


def _feature(place: _Place) -> Feature:
    fields = place.fields("name", "kind", optional=("categories", "topic", "index", "lag"))
    categories = fields["categories"].items(_Place.text) if "categories" in fields else ()
    return Feature(
        fields["name"].text(),
        fields["kind"].one_of(FeatureKind),
        categories,
        fields["topic"].text() if "topic" in fields else None,
        fields["index"].whole() if "index" in fields else None,
        fields["lag"].whole(1, LARGEST_LAG) if "lag" in fields else 0,
    )


def _declared_action(place: _Place) -> nodes.Action:
    fields = place.fields("label", "channel")
    return nodes.Action(fields["label"].text(), fields["channel"].text())


def _suggestion(place: _Place) -> Suggestion:
    fields = place.fields("id", "kind", "support", "attached", "tree")
    return Suggestion(
        fields["id"].text(),
        fields["kind"].one_of(SuggestionKind),
        fields["support"].whole(),
        _node(fields["tree"], DEEPEST_TREE),
        fields["attached"].truth(),
    )


def _shown_channel(place: _Place) -> ShownChannel:
    fields = place.fields("channel", "leaves")
    leaves = fields["leaves"].items(_shown_leaf)
    if len(leaves) > MOST_SHOWN_LEAVES:
        fields["leaves"].refuse(f"an array of at most {MOST_SHOWN_LEAVES} elements")
    return ShownChannel(fields["channel"].text(), leaves)


def _shown_leaf(place: _Place) -> ShownLeaf:
    fields = place.fields("rows", "values")
    return ShownLeaf(fields["rows"].whole(), fields["values"].items(_shown_values))


def _shown_values(place: _Place) -> ShownValues:
    if place.value is None:
        return None
    if isinstance(place.value, list) and place.value and isinstance(place.value[0], str):
        return place.items(_Place.text)
    numbers = place.items(_Place.number)
    if len(numbers) != 2:
        place.refuse("null, two numbers or categories")
    return Span(*numbers)


def _provenance(place: _Place) -> Provenance:
    fields = place.fields(
        "demonstrations",
        "rows",
        "delta",
        "max_depth",
        "ccp_alpha",
        "root",
        "history",
        "figures",
        optional=("channels", "late_rows", "late_seconds"),
    )
    late = fields.get("late_seconds")
    return Provenance(
        demonstrations=fields["demonstrations"].whole(),
        rows=fields["rows"].whole(),
        delta=fields["delta"].number(0, 1),
        max_depth=fields["max_depth"].or_null(lambda: fields["max_depth"].whole(1)),
        ccp_alpha=fields["ccp_alpha"].number(0),
        root=fields["root"].one_of(Root),
        history=fields["history"].one_of(History),
        figures=_figures(fields["figures"]),
        channels=fields["channels"].items(_channel) if "channels" in fields else (),
        late_rows=fields["late_rows"].whole() if "late_rows" in fields else 0,
        late_seconds=late.or_null(lambda: late.number(0)) if late else None,
    )


def _channel(place: _Place) -> ChannelProvenance:
    fields = place.fields("channel", "rows", "ccp_alpha", "history", "figures")
    return ChannelProvenance(
        channel=fields["channel"].text(),
        rows=fields["rows"].whole(),
        ccp_alpha=fields["ccp_alpha"].number(0),
        history=fields["history"].one_of(History),
        figures=_figures(fields["figures"]),
    )


def _figures(place: _Place) -> Figures:
    fields = place.fields(
        "fidelity_mismatches",
        "teacher_forced_agreement",
        "own_history_agreement",
        "held_out_rows",
        optional=("mean_recall",),
    )
    recall = fields.get("mean_recall")
    forced, own = fields["teacher_forced_agreement"], fields["own_history_agreement"]
    return Figures(
        fidelity_mismatches=fields["fidelity_mismatches"].whole(),
        teacher_forced_agreement=forced.or_null(lambda: forced.number(0, 1)),
        own_history_agreement=own.or_null(lambda: own.number(0, 1)),
        held_out_rows=fields["held_out_rows"].whole(),
        mean_recall=recall.or_null(lambda: recall.number(0, 1)) if recall else None,
    )


def _node(place: _Place, levels: int) -> nodes.Node:
    if levels == 0:
        raise DocumentError(f"the tree has more than {DEEPEST_TREE} levels.")
    kind = place.tag("type")
    if kind == "condition":
        fields = place.fields("type", "test", "positive")
        return nodes.Condition(Literal(_condition(fields["test"]), fields["positive"].truth()))
    if kind == "action":
        fields = place.fields("type", "label", "channel")
        return nodes.Action(fields["label"].text(), fields["channel"].text())
    if kind == "inverter":
        return nodes.Inverter(_node(place.fields("type", "child")["child"], levels - 1))
    composite = _COMPOSITES.get(kind)
    if composite is None:
        raise DocumentError(f"{place.path} has the unknown type {_abridged(kind)}.")
    remembering = composite is nodes.Sequence or composite is nodes.Selector
    fields = place.fields("type", "children", optional=("memory",) if remembering else ())
    children = fields["children"].items(lambda child: _node(child, levels - 1), least=1)
    if "memory" in fields:
        resuming: Mapping[str, type[nodes.Sequence | nodes.Selector]] = {
            "sequence": nodes.Sequence,
            "selector": nodes.Selector,
        }
        return resuming[kind](children, memory=fields["memory"].truth())
    return composite(children)


def _condition(place: _Place) -> Condition:
    match place.tag("type"):
        case "threshold":
            fields = place.fields("type", "feature", "at_most", optional=("minus",))
            return Threshold(_quantity(fields), fields["at_most"].number())
        case "interval":
            fields = place.fields("type", "feature", "above", "at_most", optional=("minus",))
            above, at_most = fields["above"].number(), fields["at_most"].number()
            return Interval(_quantity(fields), above, at_most)
        case "is_true":
            return IsTrue(place.fields("type", "feature")["feature"].text())
        case "has_category":
            fields = place.fields("type", "feature", "category")
            return HasCategory(fields["feature"].text(), fields["category"].text())
        case "previous_action_is":
            return PreviousActionIs(place.fields("type", "action")["action"].text())
        case "last_action_is":
            fields = place.fields("type", "action", "deciding")
            deciding = fields["deciding"].items(_Place.text)
            return LastActionIs(fields["action"].text(), deciding)
        case unknown:
            raise DocumentError(f"{place.path} has the unknown type {_abridged(unknown)}.")


def _quantity(fields: Mapping[str, _Place]) -> Quantity:
    feature = fields["feature"].text()
    return Difference(feature, fields["minus"].text()) if "minus" in fields else feature
