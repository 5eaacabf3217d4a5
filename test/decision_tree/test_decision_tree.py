"""Decision trees as data decide exactly as scikit-learn's do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
import strategies as some
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pruned_trees import train
from sklearn.tree import DecisionTreeClassifier

from rebt_ros.behavior_tree.nodes import Action
from rebt_ros.decision_tree.encoding import (
    FEATURES_ALONE,
    Indicator,
    Number,
    Vocabulary,
    columns,
    encode,
    exact_threshold,
)
from rebt_ros.decision_tree.fitted import FittedTree, TrainedTree
from rebt_ros.decision_tree.simplest import simplest
from rebt_ros.decision_tree.training import FitOptions, fit, fit_again
from rebt_ros.decision_tree.tree import DecisionNode, DecisionTree, Leaf, Split
from rebt_ros.demonstration.last_action import NO_ACTION, History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import (
    KNOWN,
    Condition,
    HasCategory,
    IsTrue,
    LastActionIs,
    Literal,
    PreviousActionIs,
    Threshold,
)
from rebt_ros.logic.dnf import Conjunction

# --- the exact threshold ----------------------------------------------------------------------

SMALLEST = float(np.finfo(np.float32).smallest_subnormal)
LARGEST = float(np.nextafter(np.float32(1e38), np.float32(0)))
single = st.floats(-LARGEST, LARGEST, width=32)
#: What scikit-learn makes: single-precision numbers, and middles between two of them.
middles = st.tuples(single, single).map(lambda pair: pair[0] / 2 + pair[1] / 2)
doubles = st.floats(-1e38, 1e38)
tiny = st.floats(-1e-37, 1e-37)


def sides(threshold: float) -> list[float]:
    """Doubles where the decision could go wrong: around each single-precision neighbour, around
    the middles between those, around both thresholds, and around zero."""
    exact = exact_threshold(threshold)
    near = np.float32(threshold)
    below, above = (np.nextafter(near, np.float32(end)) for end in (-np.inf, np.inf))
    places = [threshold, exact, 0.0, float(below), float(near), float(above)]
    places += [(float(below) + float(near)) / 2, (float(near) + float(above)) / 2]
    return [
        float(place)
        for one in places
        for place in (np.nextafter(one, -np.inf), one, np.nextafter(one, np.inf))
    ]


@settings(max_examples=300)
@given(st.one_of(single, middles, doubles, tiny), doubles)
@example(0.0, 0.0)
@example(-0.0, -0.0)
@example(SMALLEST, SMALLEST / 2)
@example(-SMALLEST, -SMALLEST / 2)
@example(-1e-50, -SMALLEST / 2)
@example(1e-50, SMALLEST / 2)
@example(1e38, 1e38)
@example(-1e38, -1e38)
@example(0.1, 0.1)
@example(16777217.0, 16777217.0)
def test_the_exact_threshold_decides_as_single_precision_does(threshold: float, x: float) -> None:
    exact = exact_threshold(threshold)
    for value in (x, *sides(threshold)):
        with np.errstate(over="ignore"):
            wanted = float(np.float32(value)) <= threshold
        assert (value <= exact) is wanted


@given(single)
def test_the_exact_threshold_is_finite_and_near(threshold: float) -> None:
    exact = exact_threshold(threshold)
    assert type(exact) is float
    assert math.isfinite(exact)
    spacing = abs(float(np.spacing(np.float32(threshold))))
    assert threshold <= exact <= threshold + spacing


@given(single, single)
def test_exact_thresholds_keep_the_order(one: float, other: float) -> None:
    if one < other:
        assert exact_threshold(one) < exact_threshold(other)


# --- encoding ---------------------------------------------------------------------------------


def test_columns_and_their_values() -> None:
    table = some.table(
        [(0.25, math.nan, 1, 2), (math.nan, 1e38, math.nan, math.nan), (0.1, -1e38, 0, 0)],
        [0, 2, 2],
    )
    asked = columns(table, some.LAT)
    assert asked == (
        Number("distance"),
        Number("battery"),
        Indicator(IsTrue("docked")),
        *(Indicator(HasCategory("kind", one)) for one in ("box", "cup", "tool")),
        *(Indicator(LastActionIs(one)) for one in some.LABELS),
    )
    missing = np.finfo(np.float32).max
    assert np.array_equal(
        encode(table, some.LAT),
        np.array(
            [
                [0.25, missing, 1, 0, 0, 1, 0, 0, 0, 0],
                [missing, np.float32(1e38), 0, 0, 0, 0, 1, 0, 0, 0],
                [np.float32(0.1), np.float32(-1e38), 0, 1, 0, 0, 1, 0, 0, 0],
            ],
            dtype=np.float32,
        ),
    )
    assert columns(table, FEATURES_ALONE) == asked[:6]
    assert (encode(table, FEATURES_ALONE) == encode(table, some.LAT)[:, :6]).all()


def test_combinations_and_the_previous_action_have_columns_of_their_own() -> None:
    table = some.table(
        [(0.5, 0.25, 1, 2), (math.nan, 1e38, 0, 0), (1e38, -1e38, 0, 0), (0.3, 0.1, 0, 1)],
        [0, 2, 2, 3],
        [0, 0, 0, 1],
    )
    asked = columns(table, some.EVERYTHING)
    assert asked[:6] == columns(table, FEATURES_ALONE)
    assert asked[6:] == (
        Number(some.DIFFERENCE),
        Number(some.SUM),
        *(Indicator(PreviousActionIs(one)) for one in some.LABELS),
    )
    matrix = encode(table, some.EVERYTHING)
    assert (matrix[:, :6] == encode(table, FEATURES_ALONE)).all()
    missing = np.finfo(np.float32).max
    # Combinations are computed in double precision and rounded once; all are known, so none comes
    # near to what stands for missing ones.
    far = 0.3 * float(missing)
    assert np.array_equal(
        matrix[:, 6:],
        np.array(
            [
                [0.25, -0.7 * 0.5 + 1.3 * 0.25, 0, 0, 0, 0],
                [missing, missing, 1, 0, 0, 0],
                [far, -far, 0, 0, 1, 0],
                [0.3 - 0.1, -0.7 * 0.3 + 1.3 * 0.1, 0, 0, 0, 0],
            ],
            dtype=np.float32,
        ),
    )


@settings(max_examples=60)
@given(some.tables(), some.vocabularies)
def test_an_indicator_is_1_exactly_where_its_condition_holds(
    table: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    matrix = encode(table, vocabulary)
    assert matrix.dtype == np.float32
    assert np.isfinite(matrix).all()
    asked = columns(table, vocabulary)
    assert matrix.shape == (len(table), len(asked))
    for place, column in enumerate(asked):
        if isinstance(column, Indicator):
            at_most_half = column.at_most(0.5)
            for row, value in enumerate(matrix[:, place]):
                wanted = holds(at_most_half, table, row)
                assert (value <= 0.5) is np.True_ if wanted else value == 1


def test_a_split_behind_all_known_values_asks_whether_the_value_is_known() -> None:
    assert Number("x").at_most(2.2e38) == Literal(Threshold("x", KNOWN))
    assert Number("x").at_most(1e38) == Literal(Threshold("x", exact_threshold(1e38)))


# --- training ---------------------------------------------------------------------------------


def holds(literal: Literal, table: DemonstrationTable, row: int) -> bool:
    last, previous = (
        None if code == NO_ACTION else table.actions[code]
        for code in (int(table.last[row]), int(table.previous[row]))
    )
    return some.holds(literal, table.states[row].tolist(), last, previous)


def walk(tree: DecisionTree, table: DemonstrationTable, row: int) -> Leaf:
    node: DecisionNode = tree.root
    while isinstance(node, Split):
        satisfied = holds(Literal(node.condition), table, row)
        node = node.if_true if satisfied else node.if_false
    return node


def walked(tree: DecisionTree, table: DemonstrationTable) -> list[int]:
    return [walk(tree, table, row).most_probable for row in range(len(table))]


depths = st.sampled_from((None, 1, 2, 4))


@settings(max_examples=80)
@given(some.tables(max_rows=30), some.tables(max_rows=30), some.vocabularies, depths)
def test_the_data_decides_as_scikit_learn_predicts_on_seen_and_unseen_rows(
    table: DemonstrationTable,
    unseen: DemonstrationTable,
    vocabulary: Vocabulary,
    max_depth: int | None,
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=max_depth)
    assert trained.vocabulary == vocabulary
    for rows in (table, unseen):
        assert walked(trained.tree, rows) == trained.predict(rows).tolist()


@settings(max_examples=60)
@given(st.lists(st.tuples(doubles | some.numbers, st.integers(0, 3)), min_size=2, max_size=25))
def test_numbers_of_every_size_are_split_as_scikit_learn_splits_them(
    rows: list[tuple[float, int]],
) -> None:
    table = some.table(
        [(value, math.nan, 0, 0) for value, _ in rows], [action for _, action in rows]
    )
    trained = train(table)
    assert walked(trained.tree, table) == trained.predict(table).tolist()
    beside = [
        (float(place), math.nan, 0.0, 0.0)
        for value in _thresholds(trained)
        if value < 1e38
        for place in (np.nextafter(value, -np.inf), value, np.nextafter(value, np.inf))
    ]
    if beside:
        probes = some.table(beside, [0] * len(beside))
        assert walked(trained.tree, probes) == trained.predict(probes).tolist()


@settings(max_examples=50)
@given(some.tables(max_rows=30), some.tables(max_rows=30), some.vocabularies, st.data())
def test_a_pruned_tree_predicts_as_scikit_learns_own_pruned_tree(
    table: DemonstrationTable,
    unseen: DemonstrationTable,
    vocabulary: Vocabulary,
    data: st.DataObject,
) -> None:
    matrix = encode(table, vocabulary)
    path = DecisionTreeClassifier(random_state=0).cost_complexity_pruning_path(matrix, table.chosen)
    steps = [0.0, *path.ccp_alphas.tolist(), 1.0]
    # On a step itself the last bit decides; between two steps the tree is well defined.
    below, above = data.draw(st.sampled_from([*pairwise(steps)]))
    ccp_alpha = (below + above) / 2
    trained = train(table, vocabulary=vocabulary, ccp_alpha=ccp_alpha)
    reference = DecisionTreeClassifier(random_state=0, ccp_alpha=ccp_alpha)
    reference.fit(matrix, table.chosen)
    for rows in (table, unseen):
        wanted = reference.predict(encode(rows, vocabulary)).tolist()
        assert trained.predict(rows).tolist() == wanted
        assert walked(trained.tree, rows) == wanted


def _thresholds(trained: TrainedTree) -> list[float]:
    return sorted(
        {
            literal.condition.value
            for conjunction, _ in trained.tree.paths()
            for literal in conjunction
            if isinstance(literal.condition, Threshold)
        }
    )


@settings(max_examples=60)
@given(some.tables(max_rows=30), some.vocabularies, depths)
def test_leaves_count_the_training_rows_that_reach_them(
    table: DemonstrationTable, vocabulary: Vocabulary, max_depth: int | None
) -> None:
    trained = train(table, vocabulary=vocabulary, max_depth=max_depth)
    reached: dict[int, list[int]] = {}
    leaves: dict[int, Leaf] = {}
    for row, action in enumerate(table.chosen.tolist()):
        leaf = walk(trained.tree, table, row)
        leaves[id(leaf)] = leaf
        reached.setdefault(id(leaf), [0] * len(some.LABELS))[action] += 1
    for key, leaf in leaves.items():
        assert list(leaf.distribution) == reached[key]
    assert sum(sum(leaf.distribution) for _, leaf in trained.tree.paths()) == len(table)


@settings(max_examples=40)
@given(some.tables(max_rows=30), some.tables(max_rows=30), some.vocabularies)
def test_every_state_takes_exactly_one_path(
    table: DemonstrationTable, unseen: DemonstrationTable, vocabulary: Vocabulary
) -> None:
    tree = train(table, vocabulary=vocabulary).tree
    paths = list(tree.paths())
    for row in range(len(unseen)):
        taken = [
            leaf
            for conjunction, leaf in paths
            if all(holds(literal, unseen, row) for literal in conjunction)
        ]
        assert taken == [walk(tree, unseen, row)]


@settings(max_examples=30)
@given(some.tables(max_rows=30), some.vocabularies, st.integers(0, 3))
def test_training_again_gives_the_same_tree(
    table: DemonstrationTable, vocabulary: Vocabulary, seed: int
) -> None:
    trained = train(table, vocabulary=vocabulary, random_state=seed)
    train(table, random_state=seed + 1)
    assert train(table, vocabulary=vocabulary, random_state=seed).tree == trained.tree


def test_a_single_action_gives_a_single_leaf() -> None:
    table = some.table([(0.1, 0, 0, 0), (0.9, 0, 0, 0)], [2, 2])
    trained = train(table, vocabulary=some.LAT)
    assert trained.tree.root == Leaf((0, 0, 2, 0))
    assert trained.tree.root.most_probable == 2
    assert trained.predict(table).tolist() == [2, 2]
    assert list(trained.tree.paths()) == [(Conjunction(), trained.tree.root)]


@pytest.mark.parametrize("history", History)
def test_a_table_without_features_gives_a_tree_all_the_same(history: History) -> None:
    table = some.table([(), (), ()], [1, 3, 3], features=())
    trained = train(table, vocabulary=Vocabulary(history))
    assert walked(trained.tree, table) == trained.predict(table).tolist()
    if history is History.NONE:
        assert trained.tree.root == Leaf((0, 1, 0, 2))


def test_a_tie_goes_to_the_first_action_as_in_scikit_learn() -> None:
    # Rows that cannot be told apart, in an order that puts the later actions first.
    table = some.table([(0.5, 0, 0, 0)] * 7, [3, 3, 1, 2, 1, 2, 0])
    trained = train(table)
    assert trained.tree.root == Leaf((1, 2, 2, 2))
    assert walked(trained.tree, table) == trained.predict(table).tolist() == [1] * 7


@settings(max_examples=30)
@given(st.lists(st.integers(0, 400), min_size=4, max_size=4).filter(any))
def test_counts_are_whole_also_in_large_leaves(counts: list[int]) -> None:
    chosen = [action for action, rows in enumerate(counts) for _ in range(rows)]
    table = some.table([(0.0,) * 4] * len(chosen), chosen)
    trained = train(table)
    assert trained.tree.root == Leaf(tuple(counts))
    assert set(trained.predict(table).tolist()) == {trained.tree.root.most_probable}


def test_actions_of_the_tree_are_on_the_tables_channel() -> None:
    table = some.table([(0.1, 0, 0, 0)], [0])
    assert train(table).tree.actions == tuple(Action(label, some.CHANNEL) for label in some.LABELS)


def test_max_depth_and_ccp_alpha_make_smaller_trees() -> None:
    values = [float(n) for n in range(16)]
    table = some.table([(value, 0, 0, 0) for value in values], [n % 4 for n in range(16)])

    def leaves(max_depth: int | None = None, ccp_alpha: float = 0.0) -> int:
        trained = train(table, max_depth=max_depth, ccp_alpha=ccp_alpha)
        return sum(1 for _ in trained.tree.paths())

    assert leaves() == 16
    assert leaves(max_depth=2) <= 4
    assert leaves(ccp_alpha=1.0) == 1


def test_missing_numbers_are_told_from_all_known_ones() -> None:
    # Only a missing value calls for the other action.
    values: Sequence[float] = (-1e38, 0.0, 1e38, math.nan, math.nan)
    table = some.table([(value, 0, 0, 0) for value in values], [0, 0, 0, 1, 1])
    trained = train(table)
    assert trained.tree.root == Split(
        Threshold("distance", KNOWN), Leaf((3, 0, 0, 0)), Leaf((0, 2, 0, 0))
    )


# --- readable thresholds ----------------------------------------------------------------------


@settings(max_examples=80)
@given(
    some.tables(max_rows=30),
    some.tables(max_rows=30),
    some.vocabularies,
    depths,
    st.sampled_from((0.0, 0.01, 0.05)),
)
def test_moved_thresholds_change_no_row_that_was_shown_and_decide_in_double_precision(
    table: DemonstrationTable,
    unseen: DemonstrationTable,
    vocabulary: Vocabulary,
    max_depth: int | None,
    ccp_alpha: float,
) -> None:
    fitted = fit(table, FitOptions(vocabulary=vocabulary, max_depth=max_depth))
    exact, moved = fitted.at(ccp_alpha), fitted.readable_at(ccp_alpha, table)
    assert exact.thresholds is None
    assert moved.thresholds is not None
    # Every row that was shown reaches the leaf that it reached.
    assert moved.leaves(table).tolist() == exact.leaves(table).tolist()
    assert moved.predict(table).tolist() == exact.predict(table).tolist()
    assert [leaf for _, leaf in moved.tree.paths()] == [leaf for _, leaf in exact.tree.paths()]
    # Only numbers change, and whether something is known is not one.
    for one, other in zip(splits_of(moved.tree), splits_of(exact.tree), strict=True):
        if isinstance(other, Threshold) and other.value != KNOWN:
            assert isinstance(one, Threshold)
            assert one.quantity == other.quantity
        else:
            assert one == other
    # On, and right beside, each threshold, too.
    beside = [
        (float(place), battery, 0.0, 1.0)
        for threshold in splits_of(moved.tree)
        if isinstance(threshold, Threshold) and abs(threshold.value) < 1e30
        for battery in (0.0, threshold.value, math.nan)
        for value in (threshold.value, battery + threshold.value)
        if not math.isnan(value)
        for place in (np.nextafter(value, -np.inf), value, np.nextafter(value, np.inf))
    ]
    probes = some.table(beside, [n % 4 for n in range(len(beside))])
    for rows in (table, unseen, probes):
        assert walked(moved.tree, rows) == moved.predict(rows).tolist()


def splits_of(tree: DecisionTree) -> list[Condition]:
    """The conditions of all splits, from left to right."""
    found: list[Condition] = []
    waiting: list[DecisionNode] = [tree.root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Split):
            found.append(node.condition)
            waiting += [node.if_false, node.if_true]
    return found


def test_a_threshold_is_moved_to_a_round_value_between_the_rows() -> None:
    table = some.table([(value, 0, 0, 0) for value in (0.123, 0.284, 0.317, 0.412)], [0, 0, 2, 2])
    assert train(table).tree.root != Split(
        Threshold("distance", 0.3), Leaf((2, 0, 0, 0)), Leaf((0, 0, 2, 0))
    )
    assert fit(table).readable_at(0.0, table).tree.root == Split(
        Threshold("distance", 0.3), Leaf((2, 0, 0, 0)), Leaf((0, 0, 2, 0))
    )


def test_splits_on_one_quantity_share_a_threshold_where_their_gaps_allow_it() -> None:
    # Docked or not, it turns beyond 0.2; the rows lie differently.
    places = {0.0: (0.15, 0.19, 0.21, 0.3), 1.0: (0.1, 0.18, 0.23, 0.25)}
    states = [(place, 0, docked, 0) for docked, its in places.items() for place in its]
    table = some.table(states, [0, 0, 2, 2, 1, 1, 3, 3])
    tree = fit(table).readable_at(0.0, table).tree
    values = {one.value for one in splits_of(tree) if isinstance(one, Threshold)}
    assert values == {0.2}


# --- the simplest tree ------------------------------------------------------------------------


@settings(max_examples=8)
@given(
    some.tables(min_rows=40, max_rows=60),
    some.tables(max_rows=20),
    some.vocabularies,
    st.sampled_from((1, 2)),
)
def test_the_simplest_tree_explains_as_much_with_no_more_leaves(
    table: DemonstrationTable,
    unseen: DemonstrationTable,
    vocabulary: Vocabulary,
    max_depth: int,
) -> None:
    greedy = fit(table, FitOptions(vocabulary=vocabulary, max_depth=max_depth))
    simple = simplest(table, greedy)
    assert simple is greedy or (simple.leaves, simple.comparisons) < (
        greedy.leaves,
        greedy.comparisons,
    )
    assert simple.right(table) >= greedy.right(table)
    assert simple.right(table) == np.sum(simple.at(0.0).predict(table) == table.chosen)
    assert simple.vocabulary == vocabulary
    assert simplest(table, greedy).at(0.0).tree == simple.at(0.0).tree
    for rows in (table, unseen):
        for trained in (simple.at(0.0), simple.at(0.05), simple.readable_at(0.0, table)):
            assert walked(trained.tree, rows) == trained.predict(rows).tolist()


def either_but_not_both(rows: int) -> DemonstrationTable:
    """Turns where one of two numbers is low, and not both; neither alone tells anything.

    So the greedy tree first asks for what differs by chance.
    """
    random = np.random.default_rng(4)
    sides = np.tile([(0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75)], (rows // 4, 1))
    by_chance = np.stack([random.integers(0, 2, rows), np.zeros(rows)], axis=1)
    turns = (sides[:, 0] < 0.5) ^ (sides[:, 1] < 0.5)
    return some.table(np.hstack([sides, by_chance]).tolist(), (2 * turns).tolist())


def test_a_simpler_tree_than_the_greedy_one_is_found() -> None:
    table = either_but_not_both(200)
    greedy = fit(table)
    assert greedy.leaves > 4
    simple = simplest(table, greedy)
    assert simple.leaves == 4
    assert simple.right(table) == 200
    conditions = {getattr(one, "quantity", None) for one in splits_of(simple.at(0.0).tree)}
    assert conditions == {"distance", "battery"}


def test_there_is_no_search_where_a_tree_has_very_many_leaves_or_few_rows_for_each() -> None:
    few = either_but_not_both(12)
    greedy = fit(few)
    assert greedy.leaves > 4
    assert simplest(few, greedy) is greedy
    values = [float(n // 20) for n in range(800)]
    many = some.table(
        [(value, 0, 0, 0) for value in values], [2 * (n // 20 % 2) for n in range(800)]
    )
    greedy = fit(many)
    assert greedy.leaves == 40
    assert simplest(many, greedy) is greedy


def test_no_tree_is_grown_twice_or_where_none_can_be_simpler(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[tuple[int, int]] = []

    def again(table: DemonstrationTable, fitted: FittedTree, number: int, among: int) -> FittedTree:
        drawn.append((number, among))
        return fit_again(table, fitted, number, among)

    monkeypatch.setattr("rebt_ros.decision_tree.simplest.fit_again", again)
    numbers = some.FEATURES[:2]
    turns = [0, 2, 0, 2, 0, 2] * 4
    three = some.table([(n % 6, n % 6) for n in range(24)], turns, features=numbers)
    assert simplest(three, fit(three)).leaves == 6
    # One of two columns, whatever the share.
    assert drawn == [(number, 1) for number in range(30)]
    drawn.clear()
    one = some.table(
        [(n, n) for n in range(24)], [2 * (n > 9) for n in range(24)], features=numbers
    )
    greedy = fit(one)
    assert greedy.leaves == 2
    assert simplest(one, greedy) is greedy
    assert not drawn
    # A question with the answers yes and no is simpler than a number.
    docked = some.table([(n, n, n > 9, 0) for n in range(24)], [2 * (n > 9) for n in range(24)])
    number = fit(docked, FitOptions(random_state=1))
    assert simplest(docked, number).comparisons == 0


# --- paths ------------------------------------------------------------------------------------


def test_paths_come_from_left_to_right_and_hold_each_condition_once() -> None:
    low, high = Threshold("distance", 0.1), Threshold("distance", 0.5)
    one, two, three = Leaf((1, 0)), Leaf((0, 1)), Leaf((1, 1))
    actions = (Action("go", "m"), Action("turn", "m"))
    tree = DecisionTree(actions, Split(high, Split(low, one, two), three))
    assert list(tree.paths()) == [
        (some.conjunction(Literal(high), Literal(low)), one),
        (some.conjunction(Literal(high), ~Literal(low)), two),
        (some.conjunction(~Literal(high)), three),
    ]


def test_a_condition_that_is_tested_again_stands_once_and_contradictions_are_left_out() -> None:
    again = Threshold("distance", 0.5)
    one, two, three, four = (Leaf((n,)) for n in range(1, 5))
    tree = DecisionTree(
        (Action("go", "m"),), Split(again, Split(again, one, two), Split(again, three, four))
    )
    assert list(tree.paths()) == [
        (some.conjunction(Literal(again)), one),
        (some.conjunction(~Literal(again)), four),
    ]


def test_features_may_be_of_one_kind_only() -> None:
    binary = (Feature("docked", FeatureKind.BINARY),)
    table = some.table([(0,), (1,), (math.nan,)], [0, 1, 0], features=binary)
    trained = train(table)
    assert trained.tree.root == Split(IsTrue("docked"), Leaf((0, 1, 0, 0)), Leaf((2, 0, 0, 0)))
