"""Small vocabulary for tests of the LAT graph and its trees."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import strategies as some
from hypothesis import strategies as st

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import IsTrue, LastActionIs, Literal
from rebt_ros.paper.lat_nodes import ActionNode, CycleNode, GraphNode, LatGraph
from rebt_ros.paper.lat_occurrences import Runs
from rebt_ros.paper.rule_trees import reduce_floats
from rebt_ros.paper.rules import Rule, in_its_own_words


def c(number: int) -> Literal:
    """The paper's condition C_n."""
    return Literal(IsTrue(f"C_{number}"))


def lat(label: str) -> Literal:
    return Literal(LastActionIs(label))


def rule(labels: str | tuple[str, ...], *conjunctions: Sequence[Literal], support: int = 1) -> Rule:
    """A rule whose LAT literals decide its own actions, as Algorithm 1 makes them."""
    group = (labels,) if isinstance(labels, str) else labels
    actions = tuple(map(some.action, group))
    return in_its_own_words(Rule(actions, some.dnf(*conjunctions), support))


def node(*labels: str) -> ActionNode:
    return ActionNode(tuple(map(some.action, labels)))


def cycle(*path: GraphNode | str) -> CycleNode:
    return CycleNode(tuple(node(one) if isinstance(one, str) else one for one in path))


def pairs(graph: LatGraph) -> set[tuple[GraphNode, GraphNode]]:
    return set(graph.pairs())


def followers(after: dict[str, Iterable[str]]) -> list[Rule]:
    """One rule per action: a conjunction for each action that it may follow, or none at all."""
    return [
        rule(label, *([lat(before), c(place)] for place, before in enumerate(befores)))
        if befores
        else rule(label, [c(9)])
        for label, befores in ((label, list(befores)) for label, befores in after.items())
    ]


def complete(size: int) -> list[Rule]:
    """Every action follows every other one."""
    labels = [f"a{place}" for place in range(size)]
    return followers({one: [other for other in labels if other != one] for one in labels})


def flat(nodes_: Iterable[GraphNode]) -> list[ActionNode]:
    """The action nodes inside, in order."""
    return [
        one
        for each in nodes_
        for one in ([each] if isinstance(each, ActionNode) else flat(each.path))
    ]


def tests(tree: nodes.Node) -> list[Literal]:
    return [one.literal for one in nodes.conditions(tree)]


# --- what occurrences are, spelt out ------------------------------------------------------------


def ends_of(path: Sequence[GraphNode], shown: Sequence[str], start: int) -> set[int]:
    """Where occurrences of the path end that begin at `start`, by the definition."""
    ends = {start}
    for one in path:
        ends = {end for begin in ends for end in _ends_of_node(one, shown, begin)}
    return ends


def _ends_of_node(one: GraphNode, shown: Sequence[str], start: int) -> set[int]:
    if isinstance(one, ActionNode):
        return {start + 1} if start < len(shown) and shown[start] in one.labels else set()
    full: set[int] = set()
    new = ends_of(one.path, shown, start)
    while new:
        full |= new
        new = {end for begin in new for end in ends_of(one.path, shown, begin)} - full
    return full | {
        end
        for begin in full
        for length in range(1, len(one.path))
        for end in ends_of(one.path[:length], shown, begin)
    }


def occurrences_of(path: Sequence[GraphNode], runs: Runs) -> int:
    """The longest occurrences from left to right, without overlaps."""
    total = 0
    for shown in runs:
        shown = [label for label, _ in itertools.groupby(shown)]
        free = 0
        for start in range(len(shown)):
            ends = ends_of(path, shown, start) if start >= free else None
            if ends:
                total, free = total + 1, max(ends)
    return total


# --- anything -----------------------------------------------------------------------------------

LABELS = ("a", "b", "c", "d", "e")

#: Also runs of equal actions, and demonstrations of none.
shown_runs: st.SearchStrategy[Runs] = st.lists(
    st.lists(st.sampled_from(LABELS), max_size=14).map(tuple), max_size=3
).map(tuple)


@st.composite
def rule_lists(draw: st.DrawFn) -> list[Rule]:
    """Rules with PSA groups that share actions, with LAT literals of both signs, also absurd ones.

    As Algorithm 1 leaves them, no conjunction implies another.
    """
    groups = draw(
        st.lists(
            st.lists(st.sampled_from(LABELS), min_size=1, max_size=2, unique=True).map(tuple),
            min_size=1,
            max_size=6,
            unique_by=lambda group: frozenset(group),
        )
    )
    literal = st.one_of(
        st.sampled_from(LABELS).map(lat),
        st.sampled_from(LABELS).map(lat).map(lambda one: ~one),
        st.integers(0, 2).map(c),
    )
    conjunction = st.lists(literal, min_size=1, max_size=3, unique_by=lambda one: one.condition)
    rules = [
        rule(group, *draw(st.lists(conjunction, min_size=1, max_size=3, unique_by=frozenset)))
        for group in groups
    ]
    return list(reduce_floats(rules))


def renamed(rules: Iterable[Rule], names: dict[str, str]) -> list[Rule]:
    """The same rules about actions of other names."""

    def literal(one: Literal) -> Literal:
        if not isinstance(one.condition, LastActionIs):
            return one
        return Literal(LastActionIs(names[one.condition.action]), one.positive)

    return [
        rule(
            tuple(names[label] for label in one.labels),
            *([literal(each) for each in conjunction] for conjunction in one.dnf),
            support=one.support,
        )
        for one in rules
    ]
