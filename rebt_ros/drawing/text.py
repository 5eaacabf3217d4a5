"""The behavior tree for a terminal, with the symbols of `py_trees.display.unicode_tree`."""

from __future__ import annotations

from collections.abc import Iterator

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Kind, Wording, heading, offered

_INDENT = "│   "
_RESET = "\x1b[0m"
_FAINT = "\x1b[2m"
_BOLD = "\x1b[1m"
_COLORS = {
    Kind.CONTROL: "\x1b[1;34m",
    Kind.CONDITION: "\x1b[36m",
    Kind.INVERTER: "\x1b[31m",
    Kind.ACTION: "\x1b[1;32m",
    Kind.PSA: "\x1b[1;35m",
    Kind.LAT_SEQUENCE: "\x1b[1;33m",
    Kind.REPEATER: "\x1b[1;33m",
}


def render_text(learned: LearnedTree, *, color: bool = False) -> str:
    """The main tree, then each suggestion that is not attached under a heading of its own.

    Args:
        learned: The tree to show.
        color: Whether to color the nodes by kind with ANSI escape sequences.

    Returns:
        One line per node, each with a line break; an Inverter shares the line of its condition.
    """
    wording = Wording(learned)
    lines = list(_lines(learned.tree, wording, color))
    for suggestion in offered(learned):
        lines += ["", _painted(heading(suggestion), _BOLD if color else "")]
        lines += _lines(suggestion.subtree, wording, color)
    return "".join(f"{line}\n" for line in lines)


def _lines(tree: nodes.Node, wording: Wording, color: bool) -> Iterator[str]:
    waiting = [(0, tree)]
    while waiting:
        depth, node = waiting.pop()
        text = f"{_symbol(node)} {wording.node(node)}"
        children = nodes.children(node)
        match node:
            case nodes.Inverter(child=nodes.Condition() as condition):
                text = f"{text}: {wording.node(condition)}"
                children = ()
        guides = _painted(_INDENT * depth, _FAINT if color else "")
        yield guides + _painted(text, _COLORS[wording.kind(node)] if color else "")
        waiting.extend((depth + 1, child) for child in reversed(children))


def _painted(text: str, code: str) -> str:
    return f"{code}{text}{_RESET}" if code and text else text


def _symbol(node: nodes.Node) -> str:
    match node:
        case nodes.Sequence(memory=False):
            return "[-]"
        case nodes.Sequence() | nodes.Repeater():
            return "{-}"
        case nodes.Selector(memory=True):
            return "{o}"
        case nodes.Selector() | nodes.ParallelSelector():
            return "[o]"
        case nodes.Parallel():
            return "/_/"
        case nodes.Inverter():
            return "-^-"
        case _:
            return "-->"
