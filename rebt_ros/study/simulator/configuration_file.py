"""Configuration files of the paper's experiments, as its authors published them.

A file is one JSON object per node: ``type_``, ``name``, and ``child_list`` for groups,
``target_state`` and ``threshold`` for checks; ``p_success`` and ``inverted`` for any node.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Final, NoReturn

from rebt_ros.codec.containers import Array, Named
from rebt_ros.codec.form import MisfitError, abridged
from rebt_ros.codec.hints import record
from rebt_ros.codec.record import Field
from rebt_ros.codec.scalars import Number, Text, Truth
from rebt_ros.codec.text import parsed
from rebt_ros.errors import InputError
from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    ExperimentConfig,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
)

#: Longest file that is read, in characters.
LARGEST_CONFIGURATION = 1_000_000
#: Longest way from the root to a leaf, in nodes.
DEEPEST_CONFIGURATION = 100
#: Thresholds beyond, or below its negative, are none.
_LARGEST: Final = 1e300

#: What the authors' generator leaves where it has run out of actions to choose from.
_LEFT_OVER: Final = "DEFAULT"


@dataclass(frozen=True, slots=True)
class _FileNode:
    """A node as a file has it; None where the file is silent."""

    type_: str
    name: str | None = None
    p_success: float | None = None
    children: tuple[_FileNode, ...] | None = None
    inverted: bool | None = None
    threshold: float | None = None
    target_state: str | None = None


_FILE_NODE: Final[Named[_FileNode]] = Named("node")
_FILE_NODE.define(
    record(
        _FileNode,
        Field("name", Text(), omitted=True),
        "type_",
        Field("p_success", Number(0, 1), omitted=True),
        Field("child_list", Array(_FILE_NODE), "children", omitted=True),
        Field("inverted", Truth(), omitted=True),
        Field("threshold", Number(-_LARGEST, _LARGEST), omitted=True),
        Field("target_state", Text(), omitted=True),
    )
)


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
        file_node = _FILE_NODE.decode(parsed(text))
    except RecursionError as err:
        raise InputError(f"{name} is nested too deeply to be read.") from err
    except MisfitError as err:
        raise InputError(err.sentence(f"{name}: the root")) from err
    except ValueError as err:
        raise InputError(f"{name} is not JSON: {err}.") from err
    reader = _Reader(name)
    root = reader.node(file_node, "the root", DEEPEST_CONFIGURATION)
    if not isinstance(root, Group):
        raise InputError(f"{name}: the root must be a group of nodes that mean something.")
    return ExperimentConfig(name, root, tuple(reader.notes))


def format_config(root: Group) -> str:
    """The text of a configuration file, as the paper's authors write them.

    Raises:
        ValueError: A node is inverted twice, which the files cannot say.
    """
    node = _as_in_files(root)
    # Their roots are named so; nobody reads the names of groups.
    encoded = _FILE_NODE.encode(replace(node, name=f"{node.name}_root"))
    return json.dumps(encoded, indent=4, ensure_ascii=False) + "\n"


class _Reader:
    """Says what the nodes of one file mean, and notes what it skips."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.notes: list[str] = []

    def node(self, node: _FileNode, place: str, levels: int) -> SimulatedNode | None:
        """What a node at a place of the file means; None where it means nothing."""
        if levels == 0:
            self._refuse(place, f"lies below more than {DEEPEST_CONFIGURATION - 1} others")
        if node.type_ == _LEFT_OVER:
            self.notes.append(f"{self._name}: {place} has type {_LEFT_OVER} and is skipped")
            return None
        upright = self._upright(node, place, levels)
        return Inverted(upright) if node.inverted and upright is not None else upright

    def _upright(self, node: _FileNode, place: str, levels: int) -> SimulatedNode | None:
        probability = 1.0 if node.p_success is None else node.p_success
        if node.type_ == "condition":
            if node.threshold is None:
                self._refuse(place, "lacks 'threshold'")
            variable = self._printable("target_state", node.target_state, place)
            return Check(variable, node.threshold, probability)
        if node.type_ == "action":
            return Act(self._printable("name", node.name, place), probability)
        if node.type_ not in {known.value for known in GroupKind}:
            self._refuse(place, f"has the unknown type {abridged(node.type_)}")
        if probability != 1:
            self._refuse(place, f"is a {node.type_}, whose p_success can only be 1")
        if node.children is None:
            self._refuse(place, f"is a {node.type_} without a child_list")
        read = [
            self.node(child, f"{place}.child_list[{index}]", levels - 1)
            for index, child in enumerate(node.children)
        ]
        children = tuple(child for child in read if child is not None)
        if not children:
            self.notes.append(f"{self._name}: {place} is a {node.type_} of nothing and is skipped")
            return None
        return Group(GroupKind(node.type_), children)

    def _printable(self, field: str, text: str | None, place: str) -> str:
        if not text:
            self._refuse(place, f"lacks {field!r}")
        if not text.isprintable() or text != text.strip():
            self._refuse(place, f"has the {field} {text!r}: write it with printable characters")
        return text

    def _refuse(self, place: str, why: str) -> NoReturn:
        raise InputError(f"{self._name}: {place} {why}.")


def _as_in_files(node: SimulatedNode) -> _FileNode:
    match node:
        case Check(variable=variable, threshold=threshold, p_correct=probability):
            leaf = _FileNode("condition", variable, probability, inverted=False)
            return replace(leaf, threshold=threshold, target_state=variable)
        case Act(label=label, p_success=probability):
            return _FileNode("action", label, probability, inverted=False)
        case Group(kind=kind, children=children):
            return _FileNode(kind.value, kind.value, children=tuple(map(_as_in_files, children)))
        case Inverted(child=Inverted()):
            raise ValueError("a configuration file cannot say that a node is inverted twice")
        case Inverted(child=child):
            return replace(_as_in_files(child), inverted=True)
