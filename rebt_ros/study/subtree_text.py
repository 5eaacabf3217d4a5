"""A subtree in one line."""

from __future__ import annotations

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.wording import Wording


def one_line(tree: nodes.Node) -> str:
    """The tree in one line, as in ``Sequence(battery ≤ 0.2, dock)``."""
    return _line(tree, Wording(tree))


def _line(node: nodes.Node, wording: Wording) -> str:
    children = nodes.children(node)
    if not children:
        return wording.node(node)
    return f"{wording.node(node)}({', '.join(_line(child, wording) for child in children)})"
