"""Random values of the package's vocabulary, for tests of laws; and what they mean, spelt out.

The small vocabulary (`FEATURES`, `LABELS`) makes coincidences likely: several thresholds on one
feature, conditions that occur in many conjunctions, equal states with different actions.
`learned_trees` and `features` draw names and numbers from everything that is allowed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from py_trees.common import Status

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import (
    ChannelProvenance,
    Figures,
    LearnedTree,
    Mended,
    Provenance,
    Root,
    Suggestion,
    SuggestionKind,
)
from rebt_ros.behavior_tree.shown import ShownChannel, ShownLeaf, Span
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import LARGEST_LAG, Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import (
    Condition,
    Difference,
    HasCategory,
    Interval,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Quantity,
    Threshold,
    WeightedSum,
    features_of,
)
from rebt_ros.logic.dnf import Conjunction, Dnf, conditions_of

CHANNEL = "action"
FEATURES = (
    Feature("distance"),
    Feature("battery"),
    Feature("docked", FeatureKind.BINARY),
    Feature("kind", FeatureKind.CATEGORICAL, ("box", "cup", "tool")),
)
#: What remains to be driven with the charge that is left, say.
DIFFERENCE = Difference("distance", "battery")
#: What the way is worth, say, of which charge takes a part.
SUM = WeightedSum((("distance", -0.7), ("battery", 1.3)))
#: What trees may test beside `FEATURES`.
LAT, PREVIOUS = Vocabulary(History.LAST), Vocabulary(History.PREVIOUS)
EVERYTHING = Vocabulary(History.PREVIOUS, (DIFFERENCE, SUM))
LABELS = ("go", "grasp", "turn", "wait")
ACTIONS = tuple(nodes.Action(label, CHANNEL) for label in LABELS)
#: Tenths are not exact in binary.
THRESHOLDS = (-0.5, 0.0, 0.1, 0.2, 0.3, 0.5)

PROVENANCE = Provenance(
    1, 1, 0.3, None, 0.0, Root.SELECTOR, History.LAST, Figures(0, None, None, 0)
)


# --- small builders ---------------------------------------------------------------------------


def at_most(quantity: Quantity, value: float) -> Literal:
    return Literal(Threshold(quantity, value))


def conjunction(*literals: Literal) -> Conjunction:
    return Conjunction(literals)


def dnf(*conjunctions: Sequence[Literal]) -> Dnf:
    return Dnf(tuple(Conjunction(tuple(literals)) for literals in conjunctions))


def action(label: str) -> nodes.Action:
    return nodes.Action(label, CHANNEL)


def when(*literals: Literal, then: nodes.Node) -> nodes.Sequence:
    """The tree of a rule."""
    return nodes.Sequence((*map(nodes.Condition, literals), then))


def learned(
    tree: nodes.Node,
    features: Sequence[Feature] = FEATURES,
    row_kind: RowKind = RowKind.EVENT,
) -> LearnedTree:
    """The tree over the small vocabulary, and over any other action that it takes."""
    actions = dict.fromkeys((*ACTIONS, *nodes.actions(tree)))
    return LearnedTree(tuple(features), tuple(actions), tree, PROVENANCE, row_kind=row_kind)


def table(
    states: Sequence[Sequence[float]],
    chosen: Sequence[int],
    demonstration: Sequence[int] | None = None,
    features: Sequence[Feature] = FEATURES,
) -> DemonstrationTable:
    """A table over `LABELS`; one demonstration unless told otherwise."""
    rows = len(chosen)
    number = np.zeros(rows, dtype=np.int64) if demonstration is None else np.array(demonstration)
    return DemonstrationTable(
        channel=CHANNEL,
        features=tuple(features),
        states=np.array(states, dtype=np.float64).reshape(rows, len(features)),
        actions=LABELS,
        chosen=np.array(chosen, dtype=np.int64),
        demonstrations=tuple(f"demonstration {n}" for n in range(int(max(number, default=0)) + 1)),
        demonstration=number.astype(np.int64),
        stamps=np.arange(rows, dtype=np.int64),
    )


# --- what conditions mean ---------------------------------------------------------------------


def holds(
    literal: Literal,
    state: Sequence[float],
    last_action: str | None = None,
    previous: str | None = None,
) -> bool:
    """Whether a literal over `FEATURES` holds, read from the definitions alone."""
    return _satisfied(literal.condition, state, last_action, previous) is literal.positive


def computed(condition: Condition, values: Sequence[Any]) -> Any:
    """What a condition compares, of the values of its features, read from the definitions alone."""
    match condition:
        case Threshold(quantity=Difference()) | Interval(quantity=Difference()):
            return values[0] - values[1]
        case (
            Threshold(quantity=WeightedSum(terms=((_, first), (_, second))))
            | Interval(quantity=WeightedSum(terms=((_, first), (_, second))))
        ):
            return first * values[0] + second * values[1]
    return values[0]


def _satisfied(
    condition: Condition, state: Sequence[float], last_action: str | None, previous: str | None
) -> bool:
    match condition:
        case LastActionIs(action=action):
            return last_action == action
        case PreviousActionIs(action=action):
            return previous == action
    places = [[feature.name for feature in FEATURES].index(name) for name in features_of(condition)]
    values = [state[place] for place in places]
    if any(map(math.isnan, values)):
        return False
    value = computed(condition, values)
    match condition:
        case Threshold(value=threshold):
            return value <= threshold
        case Interval(above=above, at_most=most):
            return above < value <= most
        case IsTrue():
            return value == 1
        case HasCategory(category=category):
            return FEATURES[places[0]].categories[int(value)] == category


def truth(rule: Dnf, true: frozenset[Condition] | set[Condition]) -> bool:
    """The value of the rule where exactly the conditions in `true` hold."""
    return any(all((one.condition in true) is one.positive for one in each) for each in rule)


def assignments(*rules: Dnf) -> Iterator[frozenset[Condition]]:
    """Every way to let the conditions of the rules hold or not, free of each other."""
    conditions = conditions_of(Dnf(tuple(one for rule in rules for one in rule)))
    for values in itertools.product((False, True), repeat=len(conditions)):
        yield frozenset(itertools.compress(conditions, values))


# --- logic ------------------------------------------------------------------------------------


#: Numeric features, and what is computed from them.
quantities: st.SearchStrategy[Quantity] = st.sampled_from(("distance", "battery", DIFFERENCE, SUM))


def thresholds(quantity: Quantity | None = None) -> st.SearchStrategy[Threshold]:
    compared = quantities if quantity is None else st.just(quantity)
    return st.builds(Threshold, compared, st.sampled_from(THRESHOLDS))


def intervals(quantity: Quantity | None = None) -> st.SearchStrategy[Interval]:
    compared = quantities if quantity is None else st.just(quantity)
    ends = st.sampled_from(tuple(itertools.combinations(THRESHOLDS, 2)))
    return st.builds(lambda its, between: Interval(its, *between), compared, ends)


def last_actions(deciding: bool = True) -> st.SearchStrategy[LastActionIs]:
    groups = st.lists(st.sampled_from(LABELS), unique=True, max_size=3 if deciding else 0)
    return st.builds(LastActionIs, st.sampled_from(LABELS), groups.map(tuple))


previous_actions = st.builds(PreviousActionIs, st.sampled_from(LABELS))


def conditions(history: bool = True, deciding: bool = True) -> st.SearchStrategy[Condition]:
    """Conditions on `FEATURES` and, unless told otherwise, on what was done before."""
    kinds: list[st.SearchStrategy[Condition]] = [
        thresholds(),
        intervals(),
        st.just(IsTrue("docked")),
        st.sampled_from(FEATURES[3].categories).map(lambda name: HasCategory("kind", name)),
    ]
    return st.one_of(*kinds, *([last_actions(deciding), previous_actions] if history else []))


def literals(
    of: st.SearchStrategy[Condition] | None = None,
) -> st.SearchStrategy[Literal]:
    return st.builds(Literal, conditions() if of is None else of, st.booleans())


def conjunctions(
    of: st.SearchStrategy[Condition] | None = None, min_size: int = 0, max_size: int = 4
) -> st.SearchStrategy[Conjunction]:
    return st.lists(
        literals(of), min_size=min_size, max_size=max_size, unique_by=lambda one: one.condition
    ).map(lambda drawn: Conjunction(tuple(drawn)))


def dnfs(
    of: st.SearchStrategy[Condition] | None = None,
    min_size: int = 0,
    max_size: int = 5,
    least_literals: int = 0,
) -> st.SearchStrategy[Dnf]:
    return st.lists(
        conjunctions(of, min_size=least_literals), min_size=min_size, max_size=max_size
    ).map(lambda drawn: Dnf(tuple(drawn)))


#: Nine conditions: all their assignments can be looked at.
few_conditions = st.sampled_from(
    (
        Threshold("distance", 0.1),
        Threshold("distance", 0.3),
        Threshold("distance", 0.5),
        IsTrue("docked"),
        HasCategory("kind", "cup"),
        LastActionIs("go", ("turn",)),
        Threshold(DIFFERENCE, 0.0),
        Threshold(DIFFERENCE, 0.3),
        PreviousActionIs("go"),
    )
)

#: Thresholds only, as float reduction is about them.
threshold_dnfs = dnfs(st.one_of(thresholds(), thresholds("distance"), st.just(IsTrue("docked"))))


vocabularies = st.builds(
    Vocabulary, st.sampled_from(History), st.sampled_from(((), (DIFFERENCE,), (SUM, DIFFERENCE)))
)


# --- states and tables ------------------------------------------------------------------------


def _around(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(
        float(one)
        for value in values
        for one in (np.nextafter(value, -np.inf), value, np.nextafter(value, np.inf))
    )


#: On every threshold and right beside it, far away, or missing.
numbers = st.one_of(
    st.sampled_from((*_around(THRESHOLDS), -1e30, 1e30, math.nan)), st.floats(-1, 1)
)
#: Values of `FEATURES`.
states = st.tuples(
    numbers,
    numbers,
    st.sampled_from((0.0, 1.0, math.nan)),
    st.sampled_from((0.0, 1.0, 2.0, math.nan)),
)


@st.composite
def tables(
    draw: st.DrawFn, min_rows: int = 1, max_rows: int = 20, max_demonstrations: int = 4
) -> DemonstrationTable:
    """Tables over `FEATURES` and `LABELS`, whose rows are of one or several demonstrations."""
    row = st.tuples(states, st.sampled_from(range(len(LABELS))))
    rows = draw(st.lists(row, min_size=min_rows, max_size=max_rows))
    borders = st.lists(
        st.integers(0, max_demonstrations - 1), min_size=len(rows), max_size=len(rows)
    )
    return table([state for state, _ in rows], [code for _, code in rows], sorted(draw(borders)))


# --- behavior trees ---------------------------------------------------------------------------

condition_nodes = st.builds(nodes.Condition, literals())


def on_channel(channel: str, node: nodes.Node) -> nodes.Node:
    """The tree with its actions on a channel."""
    if isinstance(node, nodes.Action):
        return nodes.Action(node.label, channel)
    children = (on_channel(channel, child) for child in nodes.children(node))
    return nodes.with_children(node, tuple(children))


def trees(
    leaves: st.SearchStrategy[nodes.Node] | None = None,
    *,
    repeaters: bool = True,
    memory: bool = True,
    max_leaves: int = 12,
) -> st.SearchStrategy[nodes.Node]:
    """Trees of nodes of every kind; with `repeaters` and `memory` or without."""
    if leaves is None:
        leaves = st.one_of(condition_nodes, st.sampled_from(ACTIONS))
    remembers = st.booleans() if memory else st.just(False)

    def parents(inner: st.SearchStrategy[nodes.Node]) -> st.SearchStrategy[nodes.Node]:
        families = st.lists(inner, min_size=1, max_size=4).map(tuple)
        kinds: list[st.SearchStrategy[nodes.Node]] = [
            st.builds(nodes.Sequence, families, remembers),
            st.builds(nodes.Selector, families, remembers),
            st.builds(nodes.Parallel, families),
            st.builds(nodes.ParallelSelector, families),
            st.builds(nodes.Inverter, inner),
        ]
        return st.one_of(*kinds, *([st.builds(nodes.Repeater, families)] if repeaters else []))

    return st.recursive(leaves, parents, max_leaves=max_leaves)


@st.composite
def rule_trees(draw: st.DrawFn) -> nodes.Node:
    """Trees that take at most one action per tick: a Selector over rules with conditions."""
    asked = st.lists(
        st.one_of(condition_nodes, st.builds(nodes.Inverter, condition_nodes)),
        min_size=1,
        max_size=3,
    )
    rules = draw(st.lists(st.tuples(asked, st.sampled_from(ACTIONS)), min_size=1, max_size=5))
    return nodes.Selector(tuple(nodes.Sequence((*tests, then)) for tests, then in rules))


# --- learned trees ----------------------------------------------------------------------------

#: Anything that can be encoded.
names = st.text(st.characters(exclude_categories=("Cs",)), max_size=6)
finite = st.floats(allow_nan=False, allow_infinity=False)
#: Of intervals.
ends = st.lists(finite, min_size=2, max_size=2, unique=True).map(sorted)


@st.composite
def features(draw: st.DrawFn, name: str | None = None) -> Feature:
    kind = draw(st.sampled_from(FeatureKind))
    least, most = (1, 3) if kind is FeatureKind.CATEGORICAL else (0, 0)
    categories = draw(st.lists(names, min_size=least, max_size=most, unique=True))
    source = draw(st.none() | st.tuples(names, st.integers(0, 1000)))
    topic, index = (None, None) if source is None else source
    lag = 0 if index is None else draw(st.integers(0, LARGEST_LAG))
    if lag and draw(st.booleans()):
        topic = None
    called = draw(names) if name is None else name
    return Feature(called, kind, tuple(categories), topic, index, lag)


def _conditions_on(
    declared: Sequence[Feature], labels: Sequence[str]
) -> st.SearchStrategy[Condition]:
    kinds: list[st.SearchStrategy[Condition]] = [
        st.builds(
            LastActionIs,
            st.sampled_from(labels),
            st.lists(st.sampled_from(labels), max_size=2).map(tuple),
        ),
        st.builds(PreviousActionIs, st.sampled_from(labels)),
    ]
    called = [one.name for one in declared]
    pairs = _pairs(called)
    compared: list[Quantity] = [*called, *itertools.starmap(Difference, pairs)]
    compared += [WeightedSum(((one, 0.1), (other, -2.5))) for one, other in pairs]
    if len(called) > 2:
        weights = itertools.cycle((-1.0, 1e-9))
        compared.append(WeightedSum(tuple(zip(called, weights, strict=False))))
    for quantity in compared:
        kinds.append(st.builds(Threshold, st.just(quantity), finite))
        kinds.append(ends.map(lambda between, its=quantity: Interval(its, *between)))
    for one in declared:
        kinds.append(st.just(IsTrue(one.name)))
        if one.categories:
            category = st.sampled_from(one.categories)
            kinds.append(st.builds(HasCategory, st.just(one.name), category))
    return st.one_of(kinds)


def _pairs(called: Sequence[str]) -> list[tuple[str, str]]:
    return list(itertools.permutations(called, 2))


shares = st.floats(0, 1)
figures = st.builds(
    Figures,
    fidelity_mismatches=st.integers(0, 10**9),
    teacher_forced_agreement=st.none() | shares,
    own_history_agreement=st.none() | shares,
    held_out_rows=st.integers(0, 10**9),
    mean_recall=st.none() | shares,
)
ccp_alphas = st.floats(0, allow_nan=False, allow_infinity=False)
_before_and_after = st.none() | st.tuples(shares, shares)
mended = st.builds(
    Mended,
    added=st.integers(-(10**6), 10**6),
    rows=st.integers(0, 10**9),
    changed=st.integers(0, 10**9),
    agreement=_before_and_after,
    mean_recall=_before_and_after,
)
channel_provenances = st.builds(
    ChannelProvenance,
    channel=names,
    rows=st.integers(0, 10**30),
    ccp_alpha=ccp_alphas,
    history=st.sampled_from(History),
    figures=figures,
)
provenances = st.builds(
    Provenance,
    demonstrations=st.integers(0, 10**9),
    rows=st.integers(0, 10**30),
    delta=shares,
    max_depth=st.none() | st.integers(1, 100),
    ccp_alpha=ccp_alphas,
    root=st.sampled_from(Root),
    history=st.sampled_from(History),
    figures=figures,
    channels=st.lists(channel_provenances, max_size=2).map(tuple),
    late_rows=st.integers(0, 10**6),
    late_seconds=st.none() | ccp_alphas,
    mended=st.none() | mended,
)


@st.composite
def learned_trees(draw: st.DrawFn) -> LearnedTree:
    """Learned trees with every kind of feature, condition, node and suggestion."""
    called = draw(st.lists(names, max_size=4, unique=True))
    declared = tuple(draw(features(name)) for name in called)
    actions = draw(
        st.lists(st.builds(nodes.Action, names, names), min_size=1, max_size=4, unique=True)
    )
    tested = _conditions_on(declared, [one.label for one in actions])
    leaves = st.one_of(st.builds(nodes.Condition, literals(tested)), st.sampled_from(actions))
    suggestions = st.builds(
        Suggestion,
        names,
        st.sampled_from(SuggestionKind),
        st.integers(0, 10**6),
        trees(leaves, max_leaves=3),
        st.booleans(),
    )
    shown = st.builds(ShownChannel, names, st.lists(_shown_leaves(declared), max_size=2).map(tuple))
    return LearnedTree(
        declared,
        tuple(actions),
        draw(trees(leaves, max_leaves=8)),
        draw(provenances),
        tuple(draw(st.lists(suggestions, max_size=2))),
        tuple(draw(st.lists(shown, max_size=2))),
        draw(st.sampled_from(RowKind)),
    )


def _shown_leaves(declared: Sequence[Feature]) -> st.SearchStrategy[ShownLeaf]:
    spans = st.lists(finite, min_size=2, max_size=2).map(lambda ends: Span(*sorted(ends)))
    values = [
        st.none()
        | (
            st.lists(st.sampled_from(one.categories), min_size=1, unique=True).map(tuple)
            if one.categories
            else spans
        )
        for one in declared
    ]
    return st.builds(ShownLeaf, st.integers(0, 10**6), st.tuples(*values))


#: What holds in every state.
TRUE = Dnf((Conjunction(),))


def implies(stronger: Literal, weaker: Literal) -> bool:
    """Whether every state that satisfies `stronger` satisfies `weaker`.

    >>> near, reachable = Literal(Threshold("x", 0.3)), Literal(Threshold("x", 0.5))
    >>> implies(near, reachable), implies(reachable, near), implies(~reachable, ~near)
    (True, False, True)
    """
    a, b = stronger.condition, weaker.condition
    if (
        isinstance(a, Threshold)
        and isinstance(b, Threshold)
        and a.quantity == b.quantity
        and stronger.positive == weaker.positive
    ):
        return a.value <= b.value if stronger.positive else a.value >= b.value
    return stronger == weaker


class EndsInTurn:
    """A commander whose actions end one after the other as a list says, and then go on."""

    def __init__(self, statuses: list[Status]) -> None:
        self._statuses = iter(statuses)

    def update(self, action: nodes.Action) -> Status:
        return next(self._statuses, Status.RUNNING)

    def halt(self, action: nodes.Action) -> None:
        pass
