"""Benchmarks of trees that run: one tick, and predictions on many rows at once."""

from __future__ import annotations

from collections.abc import Callable

import py_trees
from examples import table
from harness import Figure, Settings, alternate, compared, timed
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.prediction import States, choose, history_columns
from rebt_ros.behavior_tree.runtime import TreeRuntime
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, encode
from rebt_ros.decision_tree.training import fit
from rebt_ros.demonstration.last_action import History
from rebt_ros.learning.conversion import convert
from rebt_ros.learning.evaluation import actions_of
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import DEFAULTS, LearnOptions, Use
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.logic.conditions import Interval, Threshold


class State:
    """What hand-written behaviours share: the state they read and the command they set."""

    def __init__(self) -> None:
        self.values: list[float] = []
        self.command = ""


class Check(py_trees.behaviour.Behaviour):
    """One bound of one value, or two."""

    def __init__(
        self, name: str, state: State, index: int, above: float, at_most: float, positive: bool
    ) -> None:
        super().__init__(name)
        self._state, self._index, self._positive = state, index, positive
        self._above, self._at_most = above, at_most

    def update(self) -> Status:
        holds = self._above < self._state.values[self._index] <= self._at_most
        return Status.SUCCESS if holds is self._positive else Status.FAILURE


class Command(py_trees.behaviour.Behaviour):
    def __init__(self, name: str, state: State) -> None:
        super().__init__(name)
        self._state = state

    def update(self) -> Status:
        self._state.command = self.name
        return Status.SUCCESS


def by_hand(node: nodes.Node, state: State, place: dict[str, int]) -> py_trees.behaviour.Behaviour:
    """The tree as someone would write it with py_trees alone; thresholds and actions only."""
    match node:
        case nodes.Condition(literal=literal):
            match literal.condition:
                case Threshold(quantity=str(feature), value=value):
                    bounds = (float("-inf"), value)
                case Interval(quantity=str(feature), above=above, at_most=at_most):
                    bounds = (above, at_most)
                case other:
                    raise ValueError(f"{other} is not for this benchmark")
            return Check(feature, state, place[feature], *bounds, literal.positive)
        case nodes.Action(label=label):
            return Command(label, state)
        case nodes.Sequence(children=children):
            inner = [by_hand(child, state, place) for child in children]
            return py_trees.composites.Sequence("Sequence", False, inner)
        case nodes.Selector(children=children):
            inner = [by_hand(child, state, place) for child in children]
            return py_trees.composites.Selector("Selector", False, inner)
        case _:
            raise ValueError(f"{node} is not for this benchmark")


def _tree_of_about(size: int, learning: Learning) -> nodes.Node:
    """The tree of the pruning level whose size comes closest."""
    fitted = learning.policy.fitted
    levels = fitted.path.leaf_counts()
    near = [
        alpha
        for alpha, leaves in zip(fitted.path.alphas.tolist(), levels.tolist(), strict=True)
        if leaves <= size
    ]
    trees = [convert(fitted.at(alpha), DEFAULTS, psa=False) for alpha in near[:40]]
    return min(trees, key=lambda tree: abs(nodes.size(tree) - size))


def tick(settings: Settings) -> list[Figure]:
    """One tick of a learned tree with about 50 nodes."""
    options = LearnOptions(history=History.NONE, differences=Use.NEVER)
    learning = learn_from(table(settings.size(5000, 500), 20), options)
    tree = _tree_of_about(50, learning)
    runtime = TreeRuntime(learning.learned, tree=tree)
    state = State()
    place = {feature.name: index for index, feature in enumerate(learning.learned.features)}
    hand = by_hand(tree, state, place)
    states = learning.table.states[:: settings.size(5, 20)].tolist()

    def ours() -> None:
        for values in states:
            runtime.tick(values)

    def limit() -> None:
        for values in states:
            state.values = values
            hand.tick_once()

    for values in states:
        state.values = values
        hand.tick_once()
        assert runtime.tick(values).actions[0].label == state.command
    per_tick: dict[str, Callable[[], float]] = {
        "ours": lambda: 1e6 * timed(ours)() / len(states),
        "limit": lambda: 1e6 * timed(limit)() / len(states),
    }
    spreads = alternate(per_tick, 3 * settings.rounds)
    name = f"one tick, learned tree of {nodes.size(tree)} nodes / py_trees by hand"
    return [compared(name, spreads, 1.1, "µs")]


def predict(settings: Settings) -> list[Figure]:
    """The actions of a tree in a million states."""
    learning = learn_from(table(settings.size(20_000, 500), 20))
    rows = settings.size(1_000_000, 5000)
    many = table(rows, 20, seed=1)
    pruned = fit(learning.table).at(learning.policy.ccp_alpha)
    depth = pruned.tree.depth
    # scikit-learn's own tree of the same depth and leaves, without those that pruning cut off.
    from sklearn.tree import DecisionTreeClassifier

    classifier = DecisionTreeClassifier(ccp_alpha=learning.policy.ccp_alpha, random_state=0)
    classifier.fit(encode(learning.table, FEATURES_ALONE), learning.table.chosen)
    matrix = encode(many, FEATURES_ALONE)
    tree = learning.learned.tree
    columns = history_columns(many.actions, many.previous, many.last)

    def ours() -> object:
        return choose(tree, actions_of(many), States(many.features, many.states, columns))

    spreads = alternate(
        {"ours": timed(ours), "limit": timed(lambda: classifier.predict(matrix))}, settings.rounds
    )
    detail = f"{nodes.size(tree)} nodes; a decision tree of depth {depth}"
    name = f"prediction, {rows:,} rows / DecisionTreeClassifier.predict"
    return [compared(name, spreads, 2, "s", detail)]
