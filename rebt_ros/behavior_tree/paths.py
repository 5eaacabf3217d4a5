"""Paths: where a node stands in its tree, and trees that are changed there.

A node's path is the positions of its ancestors and its own among their siblings, from the root
down: ``()`` is the root, and ``(2, 0)`` the first child of the root's third one.  It is the same in
the document, whose ``children`` stand in this order, and in pictures.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TypeAlias

from rebt_ros.behavior_tree import nodes

Path: TypeAlias = tuple[int, ...]


def walk(tree: nodes.Node, path: Path = ()) -> Iterator[tuple[Path, nodes.Node]]:
    """All nodes with their paths, each parent before its children."""
    waiting = [(path, tree)]
    while waiting:
        path, node = waiting.pop()
        yield path, node
        numbered = [((*path, number), child) for number, child in enumerate(nodes.children(node))]
        waiting.extend(reversed(numbered))


def node_at(tree: nodes.Node, path: Path) -> nodes.Node:
    """The node at a path.

    Raises:
        LookupError: There is none.
    """
    for depth, number in enumerate(path):
        children = nodes.children(tree)
        if not 0 <= number < len(children):
            raise LookupError(f"there is no node at {text_of(path[: depth + 1])}")
        tree = children[number]
    return tree


def replaced(tree: nodes.Node, path: Path, node: nodes.Node) -> nodes.Node:
    """The tree with another node at a path.

    Raises:
        LookupError: There is no node at the path.
    """
    if not path:
        return node
    first, *rest = path
    child = replaced(node_at(tree, (first,)), tuple(rest), node)
    children = (*nodes.children(tree)[:first], child, *nodes.children(tree)[first + 1 :])
    return _with_children(tree, children)


def removed(tree: nodes.Node, path: Path) -> nodes.Node:
    """The tree without the node at a path; a parent that has no other child goes, too.

    Raises:
        LookupError: There is no node at the path.
        ValueError: Nothing would be left.
    """
    node_at(tree, path)
    while path:
        parent = node_at(tree, path[:-1])
        children = nodes.children(parent)
        if len(children) > 1:
            last = path[-1]
            kept = (*children[:last], *children[last + 1 :])
            return replaced(tree, path[:-1], _with_children(parent, kept))
        path = path[:-1]
    raise ValueError("the whole tree cannot be removed")


def moved(tree: nodes.Node, path: Path, by: int) -> nodes.Node:
    """The tree with a node so many places further behind its siblings, or further before them.

    Raises:
        LookupError: There is no node at the path, or no such place.
    """
    node_at(tree, path)
    if not path:
        raise LookupError("the root has no siblings")
    parent = node_at(tree, path[:-1])
    siblings, place = list(nodes.children(parent)), path[-1] + by
    if not 0 <= place < len(siblings):
        raise LookupError(f"{text_of(path)} has {len(siblings) - 1} siblings")
    siblings.insert(place, siblings.pop(path[-1]))
    return replaced(tree, path[:-1], _with_children(parent, tuple(siblings)))


def path_of(text: str) -> Path:
    """What `text_of` has written.

    >>> path_of("root"), path_of("2.0")
    ((), (2, 0))

    Raises:
        LookupError: It is no path.
    """
    steps = [] if text == "root" else text.split(".")
    if not all(step.isascii() and step.isdecimal() and len(step) < 10 for step in steps):
        raise LookupError(f"{text!r} is no path")
    return tuple(map(int, steps))


def text_of(path: Path) -> str:
    """A path as it is shown: ``root``, or positions with points between them.

    >>> text_of(()), text_of((2, 0))
    ('root', '2.0')
    """
    return ".".join(map(str, path)) or "root"


def _with_children(node: nodes.Node, children: tuple[nodes.Node, ...]) -> nodes.Node:
    match node:
        case nodes.Inverter():
            return nodes.Inverter(*children)
        case nodes.Condition() | nodes.Action():
            raise LookupError("a leaf has no children")
        case _:
            return replace(node, children=children)
