"""A behavior tree as a browser draws it: plain values, with the layout of every other picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, TypeAlias

from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.learned_tree import LearnedTree, SuggestionKind
from rebt_ros.behavior_tree.shown import Span
from rebt_ros.behavior_tree.wording import Kind, Wording, how_often, quantity_text, size_and_origin
from rebt_ros.drawing.shapes import Line, Node
from rebt_ros.drawing.tree_picture import drawn_tree
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    PreviousActionIs,
    Quantity,
    Threshold,
)

#: What JSON can hold.
Json: TypeAlias = Any

#: What was shown of a feature that nothing is known of.
_UNKNOWN: Final = Span(math.nan, math.nan)

_PILLS: Final = frozenset({Kind.CONDITION, Kind.INVERTER})

_SUGGESTED: Final = {
    SuggestionKind.PSA: "Parallel or Selector",
    SuggestionKind.LAT_SEQUENCE: "Sequence",
    SuggestionKind.LAT_REPEATER: "Loop",
    SuggestionKind.SEQUENCE: "Sequence",
    SuggestionKind.REPEATER: "Loop",
}


def tree_view(learned: LearnedTree, tree: nodes.Node | None = None) -> dict[str, Json]:
    """A tree with the place, the words and the meaning of each node.

    Args:
        learned: Tells how nodes are worded, and what was shown.
        tree: A suggestion, say; the learned tree itself if None.

    Returns:
        ``width``, ``height`` (pixels), ``links`` (the bends of each line), and ``nodes`` in
        preorder, as the executor's snapshots list their statuses.
    """
    tree = learned.tree if tree is None else tree
    wording = Wording(learned)
    drawing = drawn_tree(tree, wording)
    marks = [mark for mark in drawing.marks if isinstance(mark, Node)]
    spans = _spans(learned)
    return {
        "width": round(drawing.width),
        "height": round(drawing.height),
        "links": [list(map(list, mark.points)) for mark in drawing.marks if isinstance(mark, Line)],
        "nodes": [
            _node_view(path, node, mark, wording, spans)
            for (path, node), mark in zip(paths.walk(tree), marks, strict=True)
        ],
    }


def suggestion_views(learned: LearnedTree) -> list[dict[str, Json]]:
    """The suggestions, attached or not, each with its picture."""
    return [
        {
            "id": suggestion.id,
            "heading": f"{_SUGGESTED[suggestion.kind]}, shown {how_often(suggestion)}",
            "kind": suggestion.kind.value,
            "support": suggestion.support,
            "attached": suggestion.attached,
            "view": tree_view(learned, suggestion.subtree),
        }
        for suggestion in learned.suggestions
    ]


def published_view(learned: LearnedTree, document: str) -> dict[str, Json]:
    """The published tree.

    Args:
        learned: The tree.
        document: Its fingerprint.
    """
    return {
        "document": document,
        "view": tree_view(learned),
        "summary": size_and_origin(learned),
        "channels": sorted({action.channel for action in learned.actions}),
    }


def _node_view(
    path: paths.Path,
    node: nodes.Node,
    mark: Node,
    wording: Wording,
    spans: Mapping[str, Span],
) -> dict[str, Json]:
    panel = mark.panel
    kind = wording.kind(node)
    return {
        "path": paths.text_of(path),
        "parent": paths.text_of(path[:-1]) if path else None,
        "kind": kind.name.lower(),
        "text": " ".join(text.text for text in mark.texts),
        "explanation": mark.tooltip,
        "x": panel.x,
        "y": panel.y,
        "width": panel.width,
        "height": panel.height,
        "pill": kind in _PILLS,
        **_meaning(node, spans),
    }


def _meaning(node: nodes.Node, spans: Mapping[str, Span]) -> dict[str, Json]:
    """What a leaf tests or does."""
    match node:
        case nodes.Action(label=label, channel=channel):
            return {"label": label, "channel": channel}
        case nodes.Condition(literal=literal):
            tested: dict[str, Json]
            match literal.condition:
                case Threshold(quantity=quantity, value=value):
                    tested = {**_quantity(quantity, spans), "above": None, "at_most": value}
                case Interval(quantity=quantity, above=above, at_most=at_most):
                    tested = {**_quantity(quantity, spans), "above": above, "at_most": at_most}
                case IsTrue(feature=feature):
                    tested = {"feature": feature, "truth": True}
                case HasCategory(feature=feature, category=category):
                    tested = {"feature": feature, "category": category}
                case PreviousActionIs(action=action) | LastActionIs(action=action):
                    tested = {"done": action}
            return {**tested, "positive": literal.positive}
        case _:
            return {}


def _quantity(quantity: Quantity, spans: Mapping[str, Span]) -> dict[str, Json]:
    """A feature, or several with their weights, and between what numbers it was shown to lie."""
    if isinstance(quantity, str):
        span = spans.get(quantity)
        return {
            "feature": quantity,
            "low": span.low if span else None,
            "high": span.high if span else None,
        }
    low, high = 0.0, 0.0
    for name, weight in quantity.terms:
        span = spans.get(name, _UNKNOWN)
        ends = weight * span.low, weight * span.high
        low, high = low + min(ends), high + max(ends)
    known = not math.isnan(low)
    return {
        "quantity": quantity_text(quantity),
        "terms": [list(term) for term in quantity.terms],
        "low": low if known else None,
        "high": high if known else None,
    }


def _spans(learned: LearnedTree) -> dict[str, Span]:
    """The range of each feature over all that was shown, as far as the tree knows it."""
    spans: dict[str, Span] = {}
    for channel in learned.shown:
        for leaf in channel.leaves:
            for feature, values in zip(learned.features, leaf.values, strict=True):
                if isinstance(values, Span):
                    known = spans.get(feature.name, values)
                    spans[feature.name] = Span(
                        min(known.low, values.low), max(known.high, values.high)
                    )
    return spans
