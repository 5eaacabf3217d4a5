"""A tree that runs, as programs that watch trees of BehaviorTree.CPP see it: Groot2 and others.

They get the XML once, with a number for each node (``_uid``), and then the statuses of the nodes.
The XML is for watching: unlike that of `to_btcpp` it can be made of any tree, has a node for each
node that the executor ticks, and says in words what a condition tests.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import count
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import executable
from rebt_ros.behavior_tree.wording import Wording, summary
from rebt_ros.errors import DocumentError
from rebt_ros.export.elements import TREE, action_names, add_actions, one_line

#: Nodes are numbered from 1 with 16 bits.
MOST_NODES = 2**16 - 1
#: The kind of all conditions.
_CONDITION = "Test"


class NodeStatus(IntEnum):
    """What a node did, as BehaviorTree.CPP numbers it (``basic_types.h``)."""

    IDLE = 0
    RUNNING = 1
    SUCCESS = 2
    FAILURE = 3


@dataclass(frozen=True, slots=True)
class WatchedNode:
    """A node of the XML."""

    uid: int
    """From 1, each parent before its children."""
    name: str
    place: int
    """Of the node in `nodes.walk` whose status it has."""


@dataclass(frozen=True, eq=False, slots=True)
class WatchedTree:
    """A tree that can be watched."""

    xml: str
    nodes: tuple[WatchedNode, ...]
    features: Mapping[str, int]
    """The features that it tests, with their positions in a state."""

    def statuses(self, outcomes: Mapping[int, str]) -> list[NodeStatus]:
        """The status of each of `nodes`.

        Args:
            outcomes: From `TreeRuntime.outcomes`; what is not in it was not ticked and is idle.
        """
        return [
            NodeStatus[outcome] if (outcome := outcomes.get(node.place)) else NodeStatus.IDLE
            for node in self.nodes
        ]

    def changes(
        self, before: Mapping[int, str], after: Mapping[int, str]
    ) -> Iterator[tuple[WatchedNode, NodeStatus, NodeStatus]]:
        """The nodes whose status is another one than a tick before, with both statuses."""
        statuses = zip(self.nodes, self.statuses(before), self.statuses(after), strict=True)
        return (change for change in statuses if change[1] is not change[2])


def watched(learned: LearnedTree) -> WatchedTree:
    """The learned tree as it can be watched while the executor, or a replay, runs it.

    Args:
        learned: The tree.

    Raises:
        DocumentError: It has more than 65,535 nodes, which cannot be numbered.
    """
    made = _Made(learned)
    root = Element("root", BTCPP_format="4", main_tree_to_execute=TREE)
    tree = SubElement(root, "BehaviorTree", ID=TREE, _fullpath="", _description=summary(learned))
    made.add(tree, executable(learned.tree))
    if len(made.nodes) > MOST_NODES:
        raise DocumentError(
            f"the tree has {len(made.nodes)} nodes, and what watches trees of BehaviorTree.CPP "
            f"counts to {MOST_NODES}: learn a smaller tree to watch it."
        )
    models = SubElement(root, "TreeNodesModel")
    add_actions(models, made.names)
    SubElement(models, "Condition", ID=_CONDITION)
    ElementTree.indent(root)
    tested = nodes.features(learned.tree)
    text = ElementTree.tostring(root, encoding="unicode")
    return WatchedTree(
        f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n',
        tuple(made.nodes),
        {
            feature.name: place
            for place, feature in enumerate(learned.features)
            if feature.name in tested
        },
    )


class _Made:
    """The elements of one tree."""

    def __init__(self, learned: LearnedTree) -> None:
        self.nodes: list[WatchedNode] = []
        self.names = action_names(nodes.actions(executable(learned.tree)), (_CONDITION,))
        self._wording = Wording(learned)
        self._places = count()

    def add(self, parent: Element, node: nodes.Node) -> None:
        """Adds a node and all its descendants."""
        name, place = one_line(self._wording.node(node)), next(self._places)
        match node:
            case nodes.Condition():
                kind = _CONDITION
            case nodes.Action():
                kind = self.names[node]
            case nodes.Inverter():
                kind = "Inverter"
            case nodes.Sequence(memory=remembers):
                kind = "Sequence" if remembers else "ReactiveSequence"
            case nodes.Selector(memory=remembers):
                kind = "Fallback" if remembers else "ReactiveFallback"
            case nodes.ParallelSelector():
                kind = "ReactiveFallback"
            case nodes.Parallel():
                kind = "Parallel"
            case nodes.Repeater():
                kind = "KeepRunningUntilFailure"
        element = self._element(parent, kind, name, place)
        if isinstance(node, nodes.Repeater):
            # A decorator has one child; what repeats and what is repeated act as one here.
            element = self._element(element, "Sequence", name, place)
        for child in nodes.children(node):
            self.add(element, child)

    def _element(self, parent: Element, kind: str, name: str, place: int) -> Element:
        uid = len(self.nodes) + 1
        self.nodes.append(WatchedNode(uid, name, place))
        return SubElement(parent, kind, name=name, _uid=str(uid))
