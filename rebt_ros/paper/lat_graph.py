"""The graph of actions and last actions taken (Algorithm 2, line 2: GENERATE_GRAPH).

node
    An action of a rule, or its PSA group of actions (`ActionNode`); once cycles are removed, also
    a cycle of such nodes (`CycleNode`).
edge
    From u to v if the rule of v has a conjunction with the literal ``LAT = a``, where a is an
    action of u: it was shown that v follows u.

A PSA group is one node and stands for each of its members.  If a member is the last action taken,
there is an edge from every node that has it: from the group, from the action's own rule if it has
one, and from other groups that contain it, since LAT does not tell which rule took it.
"""

from __future__ import annotations

from collections.abc import Iterable

from rebt_ros.logic.conditions import LastActionIs
from rebt_ros.logic.dnf import Conjunction
from rebt_ros.paper.lat_nodes import ActionNode, LatGraph
from rebt_ros.paper.rules import Rule


def generate_graph(rules: Iterable[Rule]) -> LatGraph:
    """GENERATE_GRAPH: one node per rule, an edge per LAT action of its conjunctions.

    Args:
        rules: With minimized, unfactored DNFs: factoring can move a LAT literal out of its
            conjunction.  No two rules trigger the same actions.

    Returns:
        The graph in the order of the rules, with self-loops: a PSA group leads to itself if one of
        its members was shown after another.  A LAT action that no rule triggers has no node, and so
        no edges.
    """
    rules = [rule for rule in rules if rule.dnf.conjunctions]
    nodes = tuple(ActionNode(rule.actions) for rule in rules)
    if len(set(nodes)) != len(nodes):
        raise ValueError("two rules trigger the same actions: join them")
    having: dict[str, list[int]] = {}
    for place, node in enumerate(nodes):
        for label in node.labels:
            having.setdefault(label, []).append(place)
    edges = {
        (before, after)
        for after, rule in enumerate(rules)
        for conjunction in rule.dnf
        if (last := last_action(conjunction, nodes[after])) is not None
        for before in having.get(last, ())
    }
    return LatGraph(nodes, tuple(sorted(edges)))


def last_action(conjunction: Conjunction, node: ActionNode) -> str | None:
    """The LAT action of a conjunction of the node's rule.

    None if there is no positive LAT literal, or if the conjunction can never hold: LAT is one
    action at a time, and differs from the action being decided.
    """
    named = {
        literal.condition.action
        for literal in conjunction
        if literal.positive and isinstance(literal.condition, LastActionIs)
    }
    if len(named) != 1 or named == set(node.labels):
        return None
    return named.pop()
