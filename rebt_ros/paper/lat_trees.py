"""Last Action Taken Sequences and Repeaters (paper, Algorithm 2).

The subtrees are suggestions (SAES): they overlap with the rules of the main tree.

- A Sequence has memory: it guarantees the last action because it goes on where it was, and the
  conditions of a step are tested when the step is reached, not again while its action runs.
- Its first step has the full DNF of its rule, LAT literals included, as it can begin at any time;
  the steps after it have the conjunctions for the edge on which they are reached, without LAT
  literals.  The same holds inside a Repeater, whose first step begins the loop anew.
- After a cycle node, the edge can come from any node of the cycle: the conjunctions for the last
  actions of all its nodes count.

Differences from the printed algorithm:

- What REMOVE_CYCLES returns as a lookup table is in the cycle nodes themselves.
- The conditions of a step are factored and its Inverters are those of Algorithm 1, as line 29
  hands the factored rules to this algorithm.  Conjunctions that LAT alone told apart become one.
- A path that is one cycle node gives its Repeater without a Sequence over it, and an action without
  edges gives nothing, as its rule is in the main tree.
- The number of paths is bounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import LastActionIs, Literal
from rebt_ros.logic.dnf import Conjunction, Dnf
from rebt_ros.logic.factoring import pull_out_common
from rebt_ros.logic.float_reduction import float_reduction
from rebt_ros.paper.lat_cycles import CycleStart, remove_cycles
from rebt_ros.paper.lat_graph import generate_graph, last_action
from rebt_ros.paper.lat_nodes import ActionNode, CycleNode, GraphNode
from rebt_ros.paper.lat_occurrences import Occurrences, Runs
from rebt_ros.paper.lat_paths import source_to_sink_paths
from rebt_ros.paper.rule_trees import action_tree, condition_trees
from rebt_ros.paper.rules import Rule

#: LAT trees that are built unless told otherwise.
MOST_PATHS = 64


@dataclass(frozen=True, slots=True)
class LatTree:
    """The subtree of one path through the LAT graph."""

    path: tuple[GraphNode, ...]
    support: int
    """How often the path occurred in the demonstrations (see `lat_occurrences`)."""
    subtree: nodes.Sequence | nodes.Repeater


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What bounds have kept from becoming a tree."""

    paths: int = 0
    """Paths of the graph beyond the number, or below the support, that was asked for."""
    edges: int = 0
    """Edges of cycles that would have been nested too deep (see `lat_cycles`)."""
    self_loops: int = 0
    """PSA groups of which one member was shown after another one."""

    def __bool__(self) -> bool:
        return self != LeftOut()


@dataclass(frozen=True, slots=True)
class LatTrees:
    """The result of Algorithm 2."""

    trees: tuple[LatTree, ...]
    """The best supported first, of equals the longest path."""
    left_out: LeftOut


def gen_lat_trees(
    rules: Iterable[Rule],
    shown: Runs | Occurrences = (),
    *,
    inv_set: frozenset[Literal] = frozenset(),
    start: CycleStart = CycleStart.MOST_FREQUENT,
    most_paths: int = MOST_PATHS,
    least_support: int = 0,
) -> LatTrees:
    """GEN_LAT_TREES: a Sequence, or a Repeater, for every path of actions through the rules.

    Args:
        rules: Minimized and float-reduced, but unfactored.
        shown: The actions of each demonstration, one per row or per run.  Where several trees are
            made of the same demonstrations, `Occurrences` saves searching them again.
        inv_set: Literals to be shown as Inverters (Algorithm 1, line 3).
        start: Which node a cycle starts with; the linked code of the paper chooses arbitrarily.
        most_paths: How many trees to build at most.
        least_support: How often a path must have occurred; 0, as in the paper, also keeps those
            that the rules allow for but nobody has shown as a whole.
    """
    rules = tuple(rules)
    occurrences = shown if isinstance(shown, Occurrences) else Occurrences(shown)
    dnfs = {ActionNode(rule.actions): rule.dnf for rule in rules}
    graph = generate_graph(rules)  # line 2
    acyclic = remove_cycles(graph, occurrences, start)  # line 3
    found = source_to_sink_paths(
        acyclic.graph, occurrences, most=most_paths, least_support=least_support
    )
    return_list = []
    for path in found.paths:  # line 4
        match path.nodes:
            case (CycleNode() as cycle,):
                subtree: nodes.Sequence | nodes.Repeater = repeater(cycle, dnfs, inv_set)
            case _:
                steps = path_steps(path.nodes, dnfs, inv_set)
                subtree = nodes.Sequence(steps, memory=True)  # line 5
        return_list.append(LatTree(path.nodes, path.support, subtree))  # line 22
    left_out = LeftOut(found.left_out, acyclic.edges, acyclic.self_loops)
    return LatTrees(tuple(return_list), left_out)  # line 24


def repeater(
    cycle: CycleNode, dnfs: Mapping[ActionNode, Dnf], inv_set: frozenset[Literal]
) -> nodes.Repeater:
    """The LAT tree of the cycle's path with a Repeater in the place of its Sequence."""
    return nodes.Repeater(path_steps(cycle.path, dnfs, inv_set))


def path_steps(
    path: Sequence[GraphNode], dnfs: Mapping[ActionNode, Dnf], inv_set: frozenset[Literal]
) -> tuple[nodes.Node, ...]:
    """Lines 6 to 21: what the Sequence of a path runs, step by step."""
    children: list[nodes.Node] = []
    before: GraphNode | None = None
    for node in path:  # line 6
        if isinstance(node, CycleNode):  # line 7
            children.append(repeater(node, dnfs, inv_set))  # line 8
        else:
            if before is None:  # line 11
                rule = dnfs[node]  # line 12: GET_DNF_RULE
            else:
                rule = get_lat_conjunct(node, before, dnfs[node])  # line 14
                rule = without_lat_rules(rule)  # line 15
            children += condition_trees(pull_out_common(rule), inv_set)  # lines 17 to 19
            children.append(action_tree(node.actions))  # line 20
        before = node
    return tuple(children)


def get_lat_conjunct(node: ActionNode, before: GraphNode, rule: Dnf) -> Dnf:
    """GET_LAT_CONJUNCT: the conjunctions of the node's rule for the edge that comes from `before`.

    There are several where the action has several rules to follow the same action, and where
    `before` takes several actions, being a PSA group or a cycle.
    """
    labels = before.labels
    return Dnf(tuple(one for one in rule if last_action(one, node) in labels))


def without_lat_rules(rule: Dnf) -> Dnf:
    """The rule without its LAT literals, and without conjunctions that have thus become needless.

    >>> after_go, after_turn = Literal(LastActionIs("go")), Literal(LastActionIs("turn"))
    >>> without_lat_rules(Dnf((Conjunction((after_go,)), Conjunction((after_turn,)))))
    Dnf(conjunctions=(Conjunction(literals=()),))
    """
    return float_reduction(
        Dnf(
            tuple(
                Conjunction(
                    tuple(one for one in each if not isinstance(one.condition, LastActionIs))
                )
                for each in rule
            )
        )
    )
