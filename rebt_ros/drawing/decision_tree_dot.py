"""The decision tree in Graphviz's DOT language."""

from __future__ import annotations

from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.drawing.decision_tree_picture import decision_tree_summary, in_words
from rebt_ros.drawing.dot import looks, quoted

_HEAD = """\
digraph decision_tree {
  graph [ordering=out, ranksep=0.4, nodesep=0.2, fontname="Helvetica", labelloc=t];
  node [shape=box, style="filled,rounded", fontname="Helvetica", fontsize=11, height=0.35];
  edge [color="#9aa8b6", fontcolor="#51606f", fontname="Helvetica", fontsize=9, arrowhead=none];
"""


def render_decision_tree_dot(tree: DecisionTree) -> str:
    """Conditions and the actions that they lead to."""
    lines = [f"  label={quoted(f'Decision tree: {decision_tree_summary(tree)}')};"]
    for position, word in enumerate(in_words(tree)):
        # \\n is Graphviz's line break; it stands between two strings that are quoted for it.
        label = quoted(word.text)
        if word.detail:
            label = f"{label[:-1]}\\n{quoted(word.detail)[1:]}"
        lines.append(
            f"  n{position} [{looks(word.kind)}, label={label}, "
            f"tooltip={quoted(word.explanation)}];"
        )
        if word.parent is not None:
            lines.append(f"  n{word.parent} -> n{position} [label={quoted(word.answer)}];")
    return _HEAD + "\n".join(lines) + "\n}\n"
