"""The behavior tree as a picture, whatever it is written as."""

from __future__ import annotations

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Wording, heading, offered, summary
from rebt_ros.drawing.node_figures import Cell, Figure, drawn, legend
from rebt_ros.drawing.shapes import PAGE_WIDTH, Drawing, Page, framed, page, shelves


def behavior_tree_page(learned: LearnedTree) -> Page:
    """The main tree and each suggestion that is not attached, with a title and a legend."""
    wording = Wording(learned)
    main = drawn_tree(learned.tree, wording)
    suggestions = [
        framed(drawn_tree(suggestion.subtree, wording), heading(suggestion))
        for suggestion in offered(learned)
    ]
    shown = [learned.tree, *(suggestion.subtree for suggestion in offered(learned))]
    kinds = {wording.kind(node) for tree in shown for node in nodes.walk(tree)}
    width = max(main.width, PAGE_WIDTH)
    parts: list[Drawing] = [legend(kinds, width), main]
    if suggestions:
        parts.append(shelves(suggestions, width))
    return page("Behavior tree", summary(learned), parts)


def drawn_tree(tree: nodes.Node, wording: Wording) -> Drawing:
    """A tree alone; its nodes are marks in preorder, one each."""
    return drawn(_figures(tree, wording))


def _figures(tree: nodes.Node, wording: Wording) -> list[Figure]:
    """A figure for each node; an Inverter shares that of its condition."""
    figures: list[Figure] = []
    waiting: list[tuple[nodes.Node, int | None]] = [(tree, None)]
    while waiting:
        node, parent = waiting.pop()
        together: list[nodes.Node] = [node]
        children = nodes.children(node)
        match node:
            case nodes.Inverter(child=nodes.Condition() as condition):
                together.append(condition)
                children = ()
        waiting.extend((child, len(figures)) for child in reversed(children))
        cells = (
            Cell(_label(one, wording), wording.kind(one), wording.explanation(one))
            for one in together
        )
        figures.append(Figure(tuple(cells), parent))
    return figures


def _label(node: nodes.Node, wording: Wording) -> str:
    """The words, and for control nodes the usual symbol before them; * means with memory."""
    match node:
        case nodes.Sequence(memory=memory):
            symbol = "→* " if memory else "→ "
        case nodes.Selector(memory=memory):
            symbol = "?* " if memory else "? "
        case nodes.Parallel():
            symbol = "⇉ "
        case nodes.Repeater():
            symbol = "↻ "
        case _:
            symbol = ""
    return symbol + wording.node(node)
