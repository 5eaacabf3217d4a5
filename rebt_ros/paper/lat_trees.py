"""Last Action Taken Sequences and Repeaters (paper, Algorithm 2).

The subtrees are suggestions (SAES): they overlap with the rules of the main tree.

- A Sequence has memory: it guarantees the last action by continuing where it was.  The conditions
  of a step are tested when the step is reached, and not again while its action runs.
- Its first step has the full DNF of its rule, with LAT literals, since it can begin at any time.
  Each later step has the conjunctions for the edge on which it is reached, without LAT literals.
  The same holds inside a Repeater, whose first step begins the loop again.
- After a cycle node, the edge can come from any node of the cycle: the conjunctions for the last
  actions of all its nodes count.

Differences from the printed algorithm:

- The cycle nodes themselves hold what REMOVE_CYCLES returns as a lookup table.
- The conditions of a step are factored, and its Inverters are those of Algorithm 1, since line 29
  passes the factored rules to this algorithm.  Conjunctions that differ only in LAT become one.
- A path of a single cycle node gives its Repeater without a Sequence over it.  An action without
  edges gives nothing, since its rule is in the main tree.
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

#: Number of LAT trees built by default.
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
    """What did not become a tree because of a bound."""

    paths: int = 0
    """Paths of the graph beyond the requested number, or below the requested support."""
    edges: int = 0
    """Edges of cycles that would have been nested too deep (see `lat_cycles`)."""
    self_loops: int = 0
    """PSA groups with a member that was shown after another one."""

    def __bool__(self) -> bool:
        return self != LeftOut()


@dataclass(frozen=True, slots=True)
class LatTrees:
    """The result of Algorithm 2."""

    trees: tuple[LatTree, ...]
    """The best supported first; of equals, the longest path."""
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
        shown: The actions of each demonstration, one per row or per run.  Pass `Occurrences` to
            search the same demonstrations only once for several trees.
        inv_set: Literals to show as Inverters (Algorithm 1, line 3).
        start: Which node a cycle starts with; the code linked in the paper chooses arbitrarily.
        most_paths: Maximum number of trees.
        least_support: How often a path must have occurred; 0, as in the paper, also keeps paths
            that the rules allow but nobody has shown as a whole.
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
    """The LAT tree of the cycle's path, with a Repeater instead of its Sequence."""
    return nodes.Repeater(path_steps(cycle.path, dnfs, inv_set))


def path_steps(
    path: Sequence[GraphNode], dnfs: Mapping[ActionNode, Dnf], inv_set: frozenset[Literal]
) -> tuple[nodes.Node, ...]:
    """Lines 6 to 21: the children of the Sequence of a path, step by step."""
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
    """GET_LAT_CONJUNCT: the conjunctions of the node's rule for the edge from `before`.

    There are several if several conjunctions follow the same action, or if `before` takes several
    actions, as a PSA group or a cycle does.
    """
    labels = before.labels
    return Dnf(tuple(one for one in rule if last_action(one, node) in labels))


def without_lat_rules(rule: Dnf) -> Dnf:
    """The rule without its LAT literals, and without conjunctions that became redundant.

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
