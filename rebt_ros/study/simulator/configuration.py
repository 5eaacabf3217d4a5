"""Configuration files of the paper's experiments (IV-B), as its authors published them.

check
    A leaf that compares an environment variable with a threshold.
act
    A leaf that tries an action.
group
    A node over an ordered list of others.
environment variable
    A number in [0, 1] that checks read.

A file is one JSON object per node: ``type_``, ``name``, and ``child_list`` for groups,
``target_state`` and ``threshold`` for checks; ``p_success`` and ``inverted`` for any node.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, NoReturn, TypeAlias

from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.errors import InputError
from rebt_ros.logic.conditions import Literal, Threshold

#: Longest file that is read, in characters.
LARGEST_CONFIGURATION = 1_000_000
#: Longest way from the root to a leaf, in nodes.
DEEPEST_CONFIGURATION = 100

#: What the authors' generator leaves where it has run out of actions to choose from.
_LEFT_OVER = "DEFAULT"
_KNOWN_FIELDS = frozenset(
    {"type_", "name", "child_list", "target_state", "threshold", "p_success", "inverted"}
)


class GroupKind(Enum):
    """How a group runs its children; the values are those of the files."""

    SEQUENCE = "sequence"
    """In order until one fails; resumes at the child that runs."""
    SELECTOR = "selector"
    """In order until one succeeds; begins with the first at every tick."""
    PARALLEL = "parallel"
    """All, each until it has succeeded; fails, and halts them, once one fails."""
    PARALLEL_SELECTOR = "parsel"
    """A Parallel/Selector node: simulated as a Parallel."""
    REPEATER = "repeater"
    """As a Sequence, several times."""


@dataclass(frozen=True, slots=True)
class Check:
    """Succeeds where the variable is below the threshold."""

    variable: str
    threshold: float
    p_correct: float = 1.0
    """Probability of the right answer; otherwise the opposite one is given."""


@dataclass(frozen=True, slots=True)
class Act:
    """Tries an action."""

    label: str
    p_success: float = 1.0
    """Probability that it succeeds, once it is done."""


@dataclass(frozen=True, slots=True)
class Inverted:
    """Turns success into failure, and failure into success."""

    child: SimulatedNode


@dataclass(frozen=True, slots=True)
class Group:
    """A node with children."""

    kind: GroupKind
    children: tuple[SimulatedNode, ...]

    def __post_init__(self) -> None:
        if not self.children:
            raise ValueError(f"a {self.kind.value} needs children")


SimulatedNode: TypeAlias = Check | Act | Inverted | Group


@dataclass(frozen=True, slots=True)
class ExperimentConfig:
    """A behavior tree to simulate."""

    name: str
    """Where it came from, for messages."""
    root: Group
    notes: tuple[str, ...] = ()
    """What was skipped, one clause each."""

    @property
    def variables(self) -> tuple[str, ...]:
        """The environment variables that checks read, sorted."""
        return tuple(
            sorted({leaf.variable for leaf in leaves(self.root) if isinstance(leaf, Check)})
        )

    @property
    def actions(self) -> tuple[str, ...]:
        """The labels of the actions, sorted."""
        return tuple(sorted({leaf.label for leaf in leaves(self.root) if isinstance(leaf, Act)}))

    @property
    def subtrees(self) -> tuple[SimulatedNode, ...]:
        """What stands under the root: what an experiment looks for in the learned trees."""
        return self.root.children


def leaves(node: SimulatedNode) -> Iterator[Check | Act]:
    """The leaves of a tree from left to right."""
    match node:
        case Group(children=children):
            for child in children:
                yield from leaves(child)
        case Inverted(child=child):
            yield from leaves(child)
        case _:
            yield node


def as_behavior_tree(node: SimulatedNode) -> nodes.Node:
    """The tree in the words of learned ones, without probabilities.

    A check ``variable < threshold`` becomes ``variable <= threshold``: for numbers that are drawn
    at random they are the same.
    """
    match node:
        case Check(variable=variable, threshold=threshold):
            return nodes.Condition(Literal(Threshold(variable, threshold)))
        case Act(label=label):
            return nodes.Action(label, DEFAULT_CHANNEL)
        case Inverted(child=child):
            return nodes.Inverter(as_behavior_tree(child))
        case Group(kind=kind, children=children):
            subtrees = tuple(map(as_behavior_tree, children))
            match kind:
                case GroupKind.SEQUENCE:
                    return nodes.Sequence(subtrees, memory=True)
                case GroupKind.SELECTOR:
                    return nodes.Selector(subtrees)
                case GroupKind.PARALLEL:
                    return nodes.Parallel(subtrees)
                case GroupKind.PARALLEL_SELECTOR:
                    return nodes.ParallelSelector(subtrees)
                case GroupKind.REPEATER:
                    return nodes.Repeater(subtrees)


def parse_config(text: str, name: str) -> ExperimentConfig:
    """Reads a configuration file.

    Args:
        text: Content of the file.
        name: What to call it.

    Raises:
        InputError: It is not such a file; the message says where and why.
    """
    if len(text) > LARGEST_CONFIGURATION:
        raise InputError(
            f"{name} has {len(text)} characters: at most {LARGEST_CONFIGURATION} are read."
        )
    try:
        value = json.loads(text)
    except RecursionError as err:
        raise InputError(f"{name} is nested too deeply to be read.") from err
    except ValueError as err:
        raise InputError(f"{name} is not JSON: {err}.") from err
    reader = _Reader(name)
    root = reader.node(value, "the root", DEEPEST_CONFIGURATION)
    if not isinstance(root, Group):
        raise InputError(f"{name}: the root must be a group of nodes that mean something.")
    return ExperimentConfig(name, root, tuple(reader.notes))


class _Reader:
    """Reads the nodes of one file and notes what it skips."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.notes: list[str] = []

    def node(self, value: object, place: str, levels: int) -> SimulatedNode | None:
        """The node at a place of the file; None where it means nothing."""
        if levels == 0:
            self._refuse(place, f"lies below more than {DEEPEST_CONFIGURATION - 1} others")
        if not isinstance(value, dict):
            self._refuse(place, "must be an object")
        unknown = sorted(set(value) - _KNOWN_FIELDS)
        if unknown:
            self._refuse(place, f"has the unknown field {unknown[0]!r}")
        kind = self._text(value, "type_", place)
        if kind == _LEFT_OVER:
            self.notes.append(f"{self._name}: {place} has type {_LEFT_OVER} and is skipped")
            return None
        node = self._upright(kind, value, place, levels)
        inverted = value.get("inverted", False)
        if not isinstance(inverted, bool):
            self._refuse(place, f"has inverted {inverted!r}, which must be true or false")
        return Inverted(node) if inverted and node is not None else node

    def _upright(
        self, kind: str, value: dict[str, Any], place: str, levels: int
    ) -> SimulatedNode | None:
        if kind == "condition":
            variable = self._text(value, "target_state", place)
            threshold = self._number(value, "threshold", None, place)
            return Check(variable, threshold, self._probability(value, place))
        if kind == "action":
            return Act(self._text(value, "name", place), self._probability(value, place))
        if kind not in {known.value for known in GroupKind}:
            self._refuse(place, f"has the unknown type {kind!r}")
        if self._probability(value, place) != 1:
            self._refuse(place, f"is a {kind}, whose p_success can only be 1")
        listed = value.get("child_list")
        if not isinstance(listed, list):
            self._refuse(place, f"is a {kind} without a child_list")
        read = [
            self.node(child, f"child {number} of {place}", levels - 1)
            for number, child in enumerate(listed, start=1)
        ]
        children = tuple(child for child in read if child is not None)
        if not children:
            self.notes.append(f"{self._name}: {place} is a {kind} of nothing and is skipped")
            return None
        return Group(GroupKind(kind), children)

    def _text(self, value: dict[str, Any], field: str, place: str) -> str:
        text = value.get(field)
        if not isinstance(text, str) or not text:
            self._refuse(place, f"needs a text as {field}")
        if not text.isprintable() or text != text.strip():
            self._refuse(place, f"has the {field} {text!r}: write it with printable characters")
        return text

    def _probability(self, value: dict[str, Any], place: str) -> float:
        probability = self._number(value, "p_success", 1.0, place)
        if not 0 <= probability <= 1:
            self._refuse(place, f"has p_success {probability:g}, which must be from 0 to 1")
        return probability

    def _number(
        self, value: dict[str, Any], field: str, default: float | None, place: str
    ) -> float:
        number = value.get(field, default)
        if isinstance(number, bool) or not isinstance(number, int | float):
            self._refuse(place, f"needs a number as {field}")
        # Also true of whole numbers beyond the largest float.
        if not abs(number) < math.inf or abs(number) > 1e300:
            self._refuse(place, f"needs a finite number as {field}")
        return float(number)

    def _refuse(self, place: str, why: str) -> NoReturn:
        raise InputError(f"{self._name}: {place} {why}.")
