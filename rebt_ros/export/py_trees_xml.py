"""Learned trees as XML for the parser of py_trees, from the version that has one.

The XML has a node for each node of the tree as it is run.  py_trees has its composites and
decorators built in; conditions and actions are numbered (``place``), and `py_trees_nodes` says what
they do.
"""

from __future__ import annotations

from collections import Counter
from itertools import count
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import executable
from rebt_ros.behavior_tree.wording import Wording, summary
from rebt_ros.export.elements import TREE, one_line

#: What is ticked around a learned tree: reads the state before, and notes afterwards what was done.
WHOLE: Final = "LearnedTree"
CONDITION: Final = "LearnedCondition"
ACTION: Final = "LearnedAction"
#: A Parallel whose children go on with what they have begun when others are done.
PARALLEL: Final = "LearnedParallel"


def to_py_trees_xml(learned: LearnedTree) -> str:
    """A learned tree as XML that ``py_trees.parsers`` reads, with the nodes of `py_trees_nodes`.

    Args:
        learned: The tree.
    """
    root = Element("root", main_tree_to_execute=TREE)
    # The parser takes attributes of the tree for ports.
    root.append(ElementTree.Comment(f" {one_line(summary(learned)).replace('--', '- -')} "))
    tree = SubElement(root, "BehaviorTree", ID=TREE)
    _Made(learned).add_root(SubElement(tree, WHOLE), executable(learned.tree))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


class _Made:
    """The elements of one tree."""

    def __init__(self, learned: LearnedTree) -> None:
        self._wording = Wording(learned)
        self._places = count()
        self._named: Counter[str] = Counter()

    def add_root(self, parent: Element, tree: nodes.Node) -> None:
        """Adds the tree; channels that have nothing to do do not halt each other."""
        side_by_side = nodes.policies(tree)
        if len(side_by_side) < 2:
            self.add(parent, tree)
            return
        next(self._places)
        both = SubElement(parent, PARALLEL)
        for child in side_by_side.values():
            self.add(SubElement(both, "FailureIsSuccess"), child)

    def add(self, parent: Element, node: nodes.Node) -> None:
        """Adds a node and all its descendants."""
        place = str(next(self._places))
        match node:
            case nodes.Condition():
                element = SubElement(parent, CONDITION, name=self._name(node), place=place)
            case nodes.Action():
                element = SubElement(parent, ACTION, name=self._name(node), place=place)
            case nodes.Inverter():
                element = SubElement(parent, "Inverter")
            case nodes.Sequence(memory=memory):
                element = SubElement(parent, "Sequence", memory=str(memory).lower())
            case nodes.Selector(memory=memory):
                element = SubElement(parent, "Selector", memory=str(memory).lower())
            case nodes.ParallelSelector():
                element = SubElement(parent, "Selector", memory="false")
            case nodes.Parallel():
                element = SubElement(parent, PARALLEL)
            case nodes.Repeater():
                repeat = SubElement(parent, "Repeat", num_success="-1")
                element = SubElement(repeat, "Sequence", memory="true")
        for child in nodes.children(node):
            self.add(element, child)

    def _name(self, leaf: nodes.Condition | nodes.Action) -> str:
        """The words of a leaf, and a number where another one has the same: the parser wants that.

        Nodes above have no names, which it would put before those of the leaves.
        """
        text = one_line(self._wording.node(leaf)) or "node"
        self._named[text] += 1
        return f"{text} #{self._named[text]}" if self._named[text] > 1 else text
