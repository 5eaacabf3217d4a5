"""The behavior tree in Graphviz's DOT language."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Kind, Wording, heading, offered, summary
from rebt_ros.drawing.node_figures import PALETTE

_SHAPES = {Kind.CONDITION: "ellipse", Kind.INVERTER: "ellipse"}
_HEAD = """\
digraph behavior_tree {
  graph [ordering=out, ranksep=0.35, nodesep=0.2, fontname="Helvetica", labelloc=t];
  node [shape=box, style="filled,rounded", fontname="Helvetica", fontsize=11, height=0.35];
  edge [color="#9aa8b6", arrowhead=none];
"""


def render_dot(learned: LearnedTree) -> str:
    """The main tree, a dashed cluster for each suggestion that is not attached, and a legend."""
    wording = Wording(learned)
    numbers = count()
    lines = [f"  label={quoted(f'Behavior tree: {summary(learned)}')};"]
    lines += _tree(learned.tree, wording, numbers, indent="  ")
    shown = [learned.tree]
    for number, suggestion in enumerate(offered(learned)):
        shown.append(suggestion.subtree)
        lines += [
            f"  subgraph cluster_suggestion_{number} {{",
            f'    label={quoted(heading(suggestion))}; style=dashed; color="#8aa2bb";',
            *_tree(suggestion.subtree, wording, numbers, indent="    "),
            "  }",
        ]
    kinds = {wording.kind(node) for tree in shown for node in nodes.walk(tree)}
    lines += ["  subgraph cluster_legend {", '    label="Legend"; color="#d5dde5";']
    lines += [
        f"    legend_{kind.name.lower()} [{looks(kind)}, label={quoted(kind.value)}];"
        for kind in Kind
        if kind in kinds
    ]
    lines.append("  }")
    return _HEAD + "\n".join(lines) + "\n}\n"


def _tree(tree: nodes.Node, wording: Wording, numbers: Iterator[int], indent: str) -> Iterator[str]:
    waiting: list[tuple[nodes.Node, str | None]] = [(tree, None)]
    while waiting:
        node, parent = waiting.pop()
        name = f"n{next(numbers)}"
        yield (
            f"{indent}{name} [{looks(wording.kind(node))}, label={quoted(wording.node(node))},"
            f" tooltip={quoted(wording.explanation(node))}];"
        )
        if parent is not None:
            yield f"{indent}{parent} -> {name};"
        waiting.extend((child, name) for child in reversed(nodes.children(node)))


def looks(kind: Kind) -> str:
    """The attributes of a node of this kind."""
    colors = PALETTE[kind]
    return (
        f'shape={_SHAPES.get(kind, "box")}, fillcolor="{colors.fill}", color="{colors.line}",'
        f' fontcolor="{colors.text}"'
    )


def quoted(text: str) -> str:
    """A double-quoted string that Graphviz shows as it is.

    Backslashes would start its escapes and ampersands its character entities; line breaks and what
    cannot be printed are left out (names arrive with both escaped).
    """
    printable = "".join(one for one in text if one.isprintable())
    escaped = printable.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
