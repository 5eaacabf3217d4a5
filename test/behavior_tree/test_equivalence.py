"""The behavior tree chooses what the decision tree predicts, wherever a state can lie.

The states tested are all feasible combinations of the decision tree's conditions, not only the
rows that were learned from: every numeric feature takes a value between each two neighbouring
thresholds, on each threshold and just beyond it, or is missing; LAT and the previous action take
every action, or none; of a difference, the one feature lies where it is just at each threshold and
just beyond it, wherever the other one lies.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import strategies as some
from algorithm_1 import algorithm_1
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pruned_trees import train

from rebt_ros.arrays import BoolArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.behavior_tree.prediction import States, choose, history_columns, triggered
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.beyond_the_paper.priority_root import reduced_tree
from rebt_ros.beyond_the_paper.reductions import Reductions
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.demonstration.last_action import NO_ACTION, ActionHistory, History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Quantity, Threshold
from rebt_ros.paper.re_bt_espresso import bt_espresso
from rebt_ros.paper.rules import delta_close, leaf_rules

FEATURES = (
    Feature("distance"),
    Feature("battery"),
    Feature("docked", FeatureKind.BINARY),
    Feature("kind", FeatureKind.CATEGORICAL, ("box", "cup", "tool")),
)
LABELS = ("go", "grasp", "turn", "wait")

#: Few distinct values make deep trees with several thresholds; tenths are not exact in binary.
numbers = st.one_of(st.integers(0, 6).map(lambda n: n / 10), st.floats(-2, 2), st.just(math.nan))
rows = st.tuples(
    numbers,
    numbers,
    st.sampled_from((0.0, 1.0)),
    st.sampled_from((0.0, 1.0, 2.0, math.nan)),
    st.sampled_from(range(len(LABELS))),
    st.booleans(),
)


@st.composite
def tables(draw: st.DrawFn) -> DemonstrationTable:
    drawn = draw(st.lists(rows, min_size=2, max_size=24))
    return DemonstrationTable(
        channel="action",
        features=FEATURES,
        states=np.array([row[:4] for row in drawn]),
        actions=LABELS,
        chosen=np.array([row[4] for row in drawn], dtype=np.int64),
        demonstrations=tuple(f"demonstration {n}" for n in range(len(drawn) + 1)),
        demonstration=np.cumsum([row[5] for row in drawn]).astype(np.int64),
        stamps=np.arange(len(drawn)),
    )


def _in_between() -> DemonstrationTable:
    places = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    return DemonstrationTable(
        channel="action",
        features=FEATURES,
        states=np.array([(place, math.nan, 0.0, 0.0) for place in places]),
        actions=LABELS,
        chosen=np.array([0, 0, 2, 2, 0, 0]),
        demonstrations=tuple(f"demonstration {n}" for n in range(len(places))),
        demonstration=np.arange(len(places)),
        stamps=np.arange(len(places)),
    )


#: Turns between two distances and goes elsewhere, whatever came before: asks for an interval.
IN_BETWEEN = _in_between()


#: Rows of states at most: with several thresholds on a difference, combinations are very many.
MOST_ROWS = 40_000


def feasible_states(tree: DecisionTree, table: DemonstrationTable) -> DemonstrationTable:
    """A table with a row for every feasible combination of the tree's conditions.

    Of very many, an even selection.
    """
    thresholds = thresholds_of(tree)
    distances, batteries = (
        [-1e30, math.nan, *beside(thresholds.get(name, set()))] for name in ("distance", "battery")
    )
    # Where a combination is about at one of its thresholds, below all and above all.
    pairs = set(itertools.product(distances, batteries))
    (_, far), (_, charged) = some.SUM.terms
    for battery in (0.0, *filter(math.isfinite, batteries)):
        for apart in beside(thresholds.get(some.DIFFERENCE, set())):
            pairs |= {(value, battery) for value in beside({battery + apart})}
        for weighed in beside(thresholds.get(some.SUM, set())):
            pairs |= {(value, battery) for value in beside({(weighed - charged * battery) / far})}
    candidates = [
        [0.0, 1.0],
        [0.0, 1.0, 2.0, math.nan],
        [float(code) for code in range(NO_ACTION, len(LABELS))],
    ]
    # A tree tests one of the histories, so that one value can stand for both.
    others = np.array(list(itertools.product(*candidates)))
    numeric = np.array(sorted(pairs, key=str))
    combinations = np.hstack(
        [np.repeat(numeric, len(others), axis=0), np.tile(others, (len(numeric), 1))]
    )
    combinations = combinations[:: -(-len(combinations) // MOST_ROWS)]
    feasible = replace(
        table,
        states=combinations[:, :4],
        chosen=np.zeros(len(combinations), dtype=np.int64),
        demonstration=np.zeros(len(combinations), dtype=np.int64),
        stamps=np.arange(len(combinations)),
        previous=np.full(len(combinations), NO_ACTION),
    )
    return with_history(feasible, combinations[:, 4].astype(np.int64))


def thresholds_of(tree: DecisionTree) -> dict[Quantity, set[float]]:
    found: dict[Quantity, set[float]] = {}
    waiting: list[DecisionNode] = [tree.root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Split):
            waiting += [node.if_true, node.if_false]
            if isinstance(node.condition, Threshold) and abs(node.condition.value) < 1e30:
                found.setdefault(node.condition.quantity, set()).add(node.condition.value)
    return found


def beside(values: set[float]) -> list[float]:
    """On each value and just beyond it."""
    return [float(one) for value in sorted(values) for one in (value, np.nextafter(value, np.inf))]


def as_learned(tree: nodes.Node, trained: TrainedTree) -> LearnedTree:
    figures = Figures(0, None, None, 0)
    history = trained.vocabulary.history
    provenance = Provenance(1, 1, 0.0, None, 0.0, Root.SELECTOR, history, figures)
    return LearnedTree(FEATURES, trained.tree.actions, tree, provenance)


def states_of(table: DemonstrationTable) -> States:
    columns = history_columns(table.actions, table.previous, table.last)
    return States(FEATURES, table.states, columns)


def predicted_by_tree(
    tree: nodes.Node, trained: TrainedTree, table: DemonstrationTable
) -> list[int]:
    return choose(tree, trained.tree.actions, states_of(table)).tolist()


class OneLastAction(ActionHistory):
    """LAT is the same from the side of every rule, as in a decision tree's column."""

    last: str | None = None

    def before(self, *deciding: str) -> str | None:
        return self.last


def ticked_by_runtime(learned: LearnedTree, table: DemonstrationTable) -> list[list[str]]:
    """What one tick takes in each row."""
    history = OneLastAction()
    runtime = TreeRuntime(learned, histories={"action": history})
    ticked = []
    for state, last in zip(table.states.tolist(), table.last.tolist(), strict=True):
        history.last = history.previous = None if last == NO_ACTION else LABELS[last]
        ticked.append([action.label for action in runtime.tick(state).actions])
    return ticked


def with_history(table: DemonstrationTable, codes: IntArray) -> DemonstrationTable:
    """The table with the given LAT, and previous action, instead of what its actions say."""
    object.__setattr__(table, "last", codes)
    object.__setattr__(table, "previous", codes)
    return table


def every(table: DemonstrationTable, step: int) -> DemonstrationTable:
    part = table.where(np.arange(len(table)) % step == 0)
    return with_history(part, table.last[::step])


VOCABULARIES = [
    pytest.param(Vocabulary(history, combinations), id=f"{history.value}, {len(combinations)}")
    for history in History
    for combinations in ((), (some.DIFFERENCE, some.SUM))
]


@pytest.mark.parametrize("root", [Root.PARALLEL, Root.SELECTOR])
@pytest.mark.parametrize("vocabulary", VOCABULARIES)
@settings(max_examples=25, deadline=None)
@given(table=tables())
def test_the_behavior_tree_chooses_what_the_decision_tree_predicts_at_every_feasible_state(
    root: Root, vocabulary: Vocabulary, table: DemonstrationTable
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=4)
    learned = as_learned(algorithm_1(trained.tree, delta=0.0, root=root), trained)
    feasible = feasible_states(trained.tree, table)
    expected = trained.predict(feasible)
    assert predicted_by_tree(learned.tree, trained, feasible) == expected.tolist()
    # Ticking is slow: a spread of the states, a different one for each table.
    step = 1 + len(feasible) // 300
    wanted = [[LABELS[code]] for code in expected[::step]]
    assert ticked_by_runtime(learned, every(feasible, step)) == wanted
    assert ticked_by_runtime(loads(dumps(learned)), every(feasible, step)) == wanted


@settings(max_examples=60, deadline=None)
@given(
    table=tables(),
    vocabulary=some.vocabularies,
    root=st.sampled_from((Root.PARALLEL, Root.SELECTOR)),
    ccp_alpha=st.sampled_from((0.0, 0.02)),
)
@example(table=IN_BETWEEN, vocabulary=some.EVERYTHING, root=Root.SELECTOR, ccp_alpha=0.0)
def test_a_tree_with_readable_thresholds_is_chosen_by_exactly(
    table: DemonstrationTable, vocabulary: Vocabulary, root: Root, ccp_alpha: float
) -> None:
    trained = fit(table, FitOptions(vocabulary=vocabulary, max_depth=4)).readable_at(
        ccp_alpha, table
    )
    feasible = feasible_states(trained.tree, table)
    expected = trained.predict(feasible)
    rules = leaf_rules(trained.tree, lambda leaf: (leaf.most_probable,))
    for tree in (
        algorithm_1(trained.tree, delta=None, root=root),
        reduced_tree(rules, root=root),
    ):
        assert predicted_by_tree(tree, trained, feasible) == expected.tolist()
    step = 1 + len(feasible) // 100
    wanted = [[LABELS[code]] for code in expected[::step]]
    learned = as_learned(reduced_tree(rules, root=root), trained)
    assert ticked_by_runtime(loads(dumps(learned)), every(feasible, step)) == wanted


@pytest.mark.parametrize("root", [Root.PARALLEL, Root.SELECTOR])
@pytest.mark.parametrize(
    "reductions", [Reductions(*flags) for flags in itertools.product((True, False), repeat=4)]
)
@settings(max_examples=6, deadline=None)
@given(table=tables(), vocabulary=some.vocabularies)
@example(table=IN_BETWEEN, vocabulary=some.LAT)
@example(table=IN_BETWEEN, vocabulary=some.EVERYTHING)
def test_a_reduced_tree_chooses_what_the_decision_tree_predicts_at_every_feasible_state(
    reductions: Reductions, root: Root, table: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=5)
    rules = leaf_rules(trained.tree, lambda leaf: (leaf.most_probable,))
    learned = as_learned(reduced_tree(rules, reductions, root), trained)
    feasible = feasible_states(trained.tree, table)
    expected = trained.predict(feasible)
    assert predicted_by_tree(learned.tree, trained, feasible) == expected.tolist()
    if root is Root.PARALLEL:
        ticked = triggered(learned.tree, states_of(feasible))
        assert (np.sum(list(ticked.values()), axis=0) == 1).all()
    step = 1 + len(feasible) // 100
    wanted = [[LABELS[code]] for code in expected[::step]]
    assert ticked_by_runtime(loads(dumps(learned)), every(feasible, step)) == wanted


@settings(max_examples=40, deadline=None)
@given(table=tables(), vocabulary=some.vocabularies)
def test_the_baseline_chooses_what_the_decision_tree_predicts_at_every_feasible_state(
    table: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=4)
    feasible = feasible_states(trained.tree, table)
    tree = bt_espresso(trained.tree)
    assert predicted_by_tree(tree, trained, feasible) == trained.predict(feasible).tolist()


@settings(max_examples=40, deadline=None)
@given(table=tables(), vocabulary=some.vocabularies, delta=st.sampled_from((0.0, 0.3, 1.0)))
def test_the_actions_offered_are_the_delta_close_ones_of_the_decision_trees_leaf(
    table: DemonstrationTable, vocabulary: Vocabulary, delta: float
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=2)
    feasible = feasible_states(trained.tree, table)
    tree = algorithm_1(trained.tree, delta=delta, root=Root.PARALLEL)
    groups = offered(tree, trained.tree.actions, feasible)
    literals_of = states_of(feasible)
    for conjunction, leaf in trained.tree.paths():
        rows = np.ones(len(feasible), dtype=bool)
        for literal in conjunction:
            rows &= literals_of.satisfy(literal)
        close = np.zeros(len(LABELS), dtype=bool)
        close[list(delta_close(leaf, delta))] = True
        assert (groups[rows] == close).all()


def offered(
    tree: nodes.Node, actions: tuple[nodes.Action, ...], table: DemonstrationTable
) -> BoolArray:
    """Which actions stand in the PSA nodes, or alone, that are reached, shape (rows, actions)."""
    ticked = triggered(reaching_all(tree), states_of(table))
    return np.column_stack(
        [ticked.get(action, np.zeros(len(table), dtype=bool)) for action in actions]
    )


def reaching_all(node: nodes.Node) -> nodes.Node:
    match node:
        case nodes.ParallelSelector(children=children):
            return nodes.Parallel(children)
        case nodes.Sequence() | nodes.Selector() | nodes.Parallel():
            return replace(node, children=tuple(map(reaching_all, node.children)))
        case _:
            return node


def test_a_tie_is_decided_as_the_decision_tree_decides_it() -> None:
    leaf = Leaf((3, 5, 5, 0))
    actions = tuple(nodes.Action(label, "action") for label in LABELS)
    tree = algorithm_1(DecisionTree(actions, leaf), delta=0.0)
    assert tree == nodes.ParallelSelector((actions[1], actions[2]))
    assert leaf.most_probable == 1
