"""The decision tree as a picture, whatever it is written as, with the words of a behavior tree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.wording import Kind, Wording
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.drawing.node_figures import Cell, Figure, drawn, legend
from rebt_ros.drawing.shapes import Page, page
from rebt_ros.logic.conditions import Literal


@dataclass(frozen=True, slots=True)
class Step:
    """A node of the decision tree in words."""

    kind: Kind
    text: str
    detail: str
    """Of a leaf, how many of its rows have its action."""
    explanation: str
    parent: int | None
    """Position of the split that leads here; None for the root."""
    answer: str
    """Whether that split's condition holds here: "yes", "no", or "" for the root."""


def decision_tree_page(tree: DecisionTree) -> Page:
    """Conditions and the actions that they lead to, with a title and a legend."""
    steps = list(in_words(tree))
    figures = [
        Figure(
            (Cell(step.text, step.kind, step.explanation, step.detail),),
            step.parent,
            step.answer,
        )
        for step in steps
    ]
    parts = (legend(step.kind for step in steps), drawn(figures))
    return page("Decision tree", decision_tree_summary(tree), parts)


def decision_tree_summary(tree: DecisionTree) -> str:
    """A line about the tree: its size and what it was learned from."""
    leaves = [node for node in tree.walk() if isinstance(node, Leaf)]
    rows = sum(sum(leaf.distribution) for leaf in leaves)
    actions = len({leaf.most_probable for leaf in leaves})
    return (
        f"{_count(len(leaves), 'leaf', 'leaves')} · {_count(tree.depth, 'split')} deep · "
        f"{_count(actions, 'action')} · learned from {_count(rows, 'row')}"
    )


def in_words(tree: DecisionTree) -> Iterator[Step]:
    """Every node before its children; where a condition holds comes first."""
    wording = _wording(tree)
    waiting: list[tuple[DecisionNode, int | None, str]] = [(tree.root, None, "")]
    position = 0
    while waiting:
        node, parent, answer = waiting.pop()
        if isinstance(node, Split):
            condition = nodes.Condition(Literal(node.condition))
            text, explanation = wording.node(condition), wording.explanation(condition)
            yield Step(Kind.CONDITION, text, "", explanation, parent, answer)
            waiting += [(node.if_false, position, "no"), (node.if_true, position, "yes")]
        else:
            text = wording.node(tree.actions[node.most_probable])
            shares = _shares(node, tree, wording)
            yield Step(Kind.ACTION, text, _share(node), shares, parent, answer)
        position += 1


def _wording(tree: DecisionTree) -> Wording:
    """The words for all conditions and actions of the tree, as if a behavior tree had them."""
    conditions = (
        nodes.Condition(Literal(node.condition)) for node in tree.walk() if isinstance(node, Split)
    )
    return Wording(nodes.Selector((*conditions, *tree.actions)))


def _share(leaf: Leaf) -> str:
    rows, most = sum(leaf.distribution), max(leaf.distribution)
    if most == rows:
        return f"all of {rows}" if rows > 1 else "1 row"
    return f"{_percent(most, rows)} of {rows}"


def _shares(leaf: Leaf, tree: DecisionTree, wording: Wording) -> str:
    rows = sum(leaf.distribution)
    shown = sorted(
        (-count, wording.node(action))
        for count, action in zip(leaf.distribution, tree.actions, strict=True)
        if count
    )
    each = ", ".join(f"{name} {-count} ({_percent(-count, rows)})" for count, name in shown)
    return f"Leaf: {_count(rows, 'row')}: {each}"


def _percent(part: int, whole: int) -> str:
    """The share, never rounded to all or nothing."""
    share = part / whole
    return f"{share:.0%}" if 0.01 <= share < 0.995 or part == whole else f"{share:.2%}"


def _count(number: int, noun: str, several: str = "") -> str:
    return f"{number} {noun if number == 1 else several or noun + 's'}"
