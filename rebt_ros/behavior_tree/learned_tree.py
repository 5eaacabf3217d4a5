"""A learned behavior tree with everything that is needed to run, judge and edit it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.shown import ShownChannel, problems
from rebt_ros.demonstration.schema import Feature
from rebt_ros.logic.conditions import HasCategory, Interval, IsTrue, LastActionIs, Threshold


class SuggestionKind(Enum):
    """Kinds of suggested alternate expressive subtrees (SAES)."""

    PSA = "psa"
    LAT_SEQUENCE = "lat_sequence"
    LAT_REPEATER = "lat_repeater"
    SEQUENCE = "sequence"
    """A routine, found in rows that share one state."""
    REPEATER = "repeater"
    """A routine that is gone through again and again."""


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A subtree that the user may attach."""

    id: str
    kind: SuggestionKind
    support: int
    """How often it occurred in the demonstrations."""
    subtree: nodes.Node
    attached: bool = False


class Root(Enum):
    """Kind of the main tree's root node."""

    PARALLEL = "parallel"
    SELECTOR = "selector"
    SEQUENCE = "sequence"


@dataclass(frozen=True, slots=True)
class Figures:
    """How well the tree does; agreements are None where no row was held out for them."""

    fidelity_mismatches: int
    """Rows, of all there were, on which the tree differs from its decision tree."""
    teacher_forced_agreement: float | None
    """Share of held-out rows on which it agrees, LAT being the demonstrator's."""
    own_history_agreement: float | None
    """Share of held-out rows on which it agrees, LAT being its own earlier choices."""
    held_out_rows: int


@dataclass(frozen=True, slots=True)
class ChannelProvenance:
    """Where the policy of one channel came from, if there are several."""

    channel: str
    rows: int
    ccp_alpha: float
    uses_last_action: bool
    figures: Figures


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a tree came from; with several channels, figures are over all of them."""

    demonstrations: int
    rows: int
    delta: float
    max_depth: int | None
    ccp_alpha: float
    root: Root
    uses_last_action: bool
    """Whether the decision tree was shown LAT."""
    figures: Figures
    channels: tuple[ChannelProvenance, ...] = ()
    """Of each channel, where there are several."""


@dataclass(frozen=True, slots=True)
class LearnedTree:
    """The value of a behavior tree document.

    Raises:
        ValueError: The tree tests a feature, category or action, or takes an action, that is not
            declared, or what was shown does not fit the features.
    """

    features: tuple[Feature, ...]
    actions: tuple[nodes.Action, ...]
    """Every action that was shown, also those that the tree never takes."""
    tree: nodes.Node
    provenance: Provenance
    suggestions: tuple[Suggestion, ...] = field(default=())
    shown: tuple[ShownChannel, ...] = ()
    """What each channel was learned from, leaf by leaf; empty where that is not known."""

    def __post_init__(self) -> None:
        for problem in self._problems():
            raise ValueError(problem)

    def _problems(self) -> Iterator[str]:
        # Documents come from outside, so looking up must not take long however much they declare.
        actions = frozenset(self.actions)
        labels = {action.label for action in actions}
        categories = {one.name: frozenset(one.categories) for one in self.features}
        if len(categories) != len(self.features):
            yield "two features have the same name"
        for tree in (self.tree, *(suggestion.subtree for suggestion in self.suggestions)):
            for action in nodes.actions(tree):
                if action not in actions:
                    yield f"action {action.label!r} on {action.channel!r} is not declared"
            for condition in nodes.conditions(tree):
                yield from _problems_of(condition, categories, labels)
        yield from problems(self.shown, self.features)


def _problems_of(
    node: nodes.Condition, categories: dict[str, frozenset[str]], labels: set[str]
) -> Iterator[str]:
    match node.literal.condition:
        case Threshold(feature=name) | Interval(feature=name) | IsTrue(feature=name):
            if name not in categories:
                yield f"feature {name!r} is not declared"
        case HasCategory(feature=name, category=category):
            if name not in categories:
                yield f"feature {name!r} is not declared"
            elif category not in categories[name]:
                yield f"feature {name!r} has no category {category!r}"
        case LastActionIs(action=action, deciding=deciding):
            for label in (action, *deciding):
                if label not in labels:
                    yield f"last action {label!r} is not declared"
