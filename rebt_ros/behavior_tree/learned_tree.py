"""A learned behavior tree with everything that is needed to run, judge and edit it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.shown import ShownChannel, problems
from rebt_ros.codec.bounds import Bounds, Count, Share
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, number_of
from rebt_ros.logic.conditions import (
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    PreviousActionIs,
    Threshold,
    features_of,
)
from rebt_ros.robot_file.robot_file import RobotFile


class Unit(Enum):
    """What is counted."""

    ROW = "row"
    """A row of a demonstration in which any of the actions was done."""
    TIME = "time"
    """An occurrence from the first action to the last one."""


class SuggestionKind(Enum):
    """Kinds of suggested alternate expressive subtrees (SAES)."""

    PSA = "psa"
    LAT_SEQUENCE = "lat_sequence"
    LAT_REPEATER = "lat_repeater"
    SEQUENCE = "sequence"
    """A routine, found in rows that share one state."""
    REPEATER = "repeater"
    """A routine that is gone through again and again."""

    @property
    def unit(self) -> Unit:
        """What the support of such a suggestion counts."""
        return Unit.ROW if self is SuggestionKind.PSA else Unit.TIME


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A subtree that the user may attach."""

    id: str
    kind: SuggestionKind
    support: Count
    """How much of the demonstrations shows it, in the unit of its kind."""
    subtree: nodes.Node
    attached: bool = False

    @property
    def rows(self) -> int:
        """In how many rows it was shown at least: each time, each of its actions took a row."""
        if self.kind.unit is Unit.ROW:
            return self.support
        return self.support * sum(
            isinstance(node, nodes.Action) for node in nodes.walk(self.subtree)
        )


class Root(Enum):
    """Kind of the main tree's root node."""

    PARALLEL = "parallel"
    SELECTOR = "selector"
    SEQUENCE = "sequence"


@dataclass(frozen=True, slots=True)
class Figures:
    """How well the tree does; agreements are None where no row was held out for them.

    Of a tree that was changed since, so that it does something else, they are all None.
    """

    fidelity_mismatches: Count | None
    """Rows, of all there were, on which the tree differs from its decision tree."""
    teacher_forced_agreement: Share | None
    """Share of held-out rows on which it agrees, after what the demonstrator did before."""
    own_history_agreement: Share | None
    """Share of held-out rows on which it agrees, after its own earlier choices."""
    held_out_rows: Count
    mean_recall: Share | None = None
    """Mean, over the actions of the held-out rows, of the share of each one's rows on which the
    tree takes it, after its own earlier choices."""

    def forgotten(self) -> Figures:
        """What is left of them where the tree does something else now."""
        return Figures(None, None, None, self.held_out_rows)


@dataclass(frozen=True, slots=True)
class ChannelProvenance:
    """Where the policy of one channel came from, if there are several."""

    channel: str
    rows: Count
    ccp_alpha: Annotated[float, Bounds(0)]
    history: History
    figures: Figures


@dataclass(frozen=True, slots=True)
class Mended:
    """What guards have changed of a tree that broke a rule."""

    added: int
    """How many nodes it has more."""
    rows: Count
    """How many rows that were shown were at hand."""
    changed: Count
    """In how many of them it does something else."""
    agreement: tuple[Share, Share] | None
    """With these rows, teacher-forced, before and after; None without rows."""
    mean_recall: tuple[Share, Share] | None
    """The same of their actions, each as much as the others."""

    def __str__(self) -> str:
        added = f"{self.added:+d} node{'' if abs(self.added) == 1 else 's'}"
        if self.agreement is None or self.mean_recall is None:
            return added
        changed = f"{added}, {self.changed} of {self.rows} rows changed"
        if not self.changed:
            return changed
        before, after = (f"{share:.1%}" for share in self.agreement)
        recalls = " to ".join(f"{share:.1%}" for share in self.mean_recall)
        return f"{changed}, agreement with them from {before} to {after}, mean recall {recalls}"


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a tree came from; with several channels, figures are over all of them."""

    demonstrations: Count
    rows: Count
    delta: Share
    max_depth: Annotated[int, Bounds(1)] | None
    ccp_alpha: Annotated[float, Bounds(0)]
    root: Root
    history: History
    """What the decision tree could test of what was done before; of several channels, any one."""
    figures: Figures
    channels: tuple[ChannelProvenance, ...] = ()
    """Of each channel, where there are several."""
    late_rows: Count = 0
    """How late the demonstrator acted: actions were learned as of so many rows before."""
    late_seconds: Annotated[float, Bounds(0)] | None = None
    """The same in seconds, where stamps tell the time."""
    mended: Mended | None = None
    """What guards have changed, if there are any: all other figures are of the tree before."""

    @property
    def uses_last_action(self) -> bool:
        """Whether the decision tree could test what was done before."""
        return self.history is not History.NONE


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
    row_kind: RowKind = RowKind.EVENT
    """What the previous action is when the tree runs: see `TreeRuntime`."""
    robot: RobotFile | None = None
    """Where its features are in messages of any type; None where topics carry them as they are."""

    def __post_init__(self) -> None:
        for problem in self._problems():
            raise ValueError(problem)

    def _problems(self) -> Iterator[str]:
        # Documents come from outside, so looking up must not take long however much they declare.
        actions = frozenset(self.actions)
        labels = {action.label for action in actions}
        categories = {feature.name: frozenset(feature.categories) for feature in self.features}
        if len(categories) != len(self.features):
            yield "two features have the same name"
        for tree in (self.tree, *(suggestion.subtree for suggestion in self.suggestions)):
            for action in nodes.actions(tree):
                if action not in actions:
                    yield f"action {action.label!r} on {action.channel!r} is not declared"
            for condition in nodes.conditions(tree):
                yield from _problems_of(condition, categories, labels)
        yield from problems(self.shown, self.features)


def unmeasurable(learned: LearnedTree) -> tuple[Feature, ...]:
    """The features that the tree tests for a text, which no topic of numbers can carry.

    None where the tree says where they are in messages of any type.
    """
    if learned.robot is not None:
        return ()
    tested = {
        (condition.feature, condition.category)
        for node in nodes.conditions(learned.tree)
        if isinstance(condition := node.literal.condition, HasCategory)
    }
    texts = {feature for feature, category in tested if number_of(category) is None}
    return tuple(feature for feature in learned.features if feature.name in texts)


def _problems_of(
    node: nodes.Condition, categories: dict[str, frozenset[str]], labels: set[str]
) -> Iterator[str]:
    match node.literal.condition:
        case Threshold() | Interval() | IsTrue() as condition:
            for name in features_of(condition):
                if name not in categories:
                    yield f"feature {name!r} is not declared"
        case HasCategory(feature=name, category=category):
            if name not in categories:
                yield f"feature {name!r} is not declared"
            elif category not in categories[name]:
                yield f"feature {name!r} has no category {category!r}"
        case PreviousActionIs(action=action):
            if action not in labels:
                yield f"previous action {action!r} is not declared"
        case LastActionIs(action=action, deciding=deciding):
            for label in (action, *deciding):
                if label not in labels:
                    yield f"last action {label!r} is not declared"
