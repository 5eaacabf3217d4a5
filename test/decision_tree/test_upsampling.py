"""Upsampling with SVM-SMOTE: rare actions count, indicators stay whole, figures stay real."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from pruned_trees import train

from rebt_ros.decision_tree import training
from rebt_ros.decision_tree.encoding import MISSING, Indicator, Number, Vocabulary, columns, encode
from rebt_ros.decision_tree.svm_smote import svm_smote
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import OptionError
from rebt_ros.learning import pipeline
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.logic.conditions import Difference, HasCategory, LastActionIs, PreviousActionIs

ROOMS = ("hall", "kitchen", "lab")
FEATURES = (
    Feature("x"),
    Feature("y"),
    Feature("on", FeatureKind.BINARY),
    Feature("room", FeatureKind.CATEGORICAL, ROOMS),
)


def table_of(
    states: np.ndarray, actions: tuple[str, ...], chosen: np.ndarray, demonstrations: int = 1
) -> DemonstrationTable:
    rows = len(chosen)
    return DemonstrationTable(
        "action",
        FEATURES,
        states,
        actions,
        chosen.astype(np.int64),
        tuple(f"d{number}" for number in range(demonstrations)),
        np.arange(rows) * demonstrations // rows,
        np.arange(rows),
    )


def rare(rows: int = 400, seed: int = 0, missing: bool = False) -> DemonstrationTable:
    """`stop` is one row of twenty, in a corner where `go` is still the more frequent one."""
    rng = np.random.default_rng(seed)
    stops = np.arange(rows) % 20 == 0
    states = np.column_stack(
        [
            np.where(stops, rng.uniform(800, 1000, rows), rng.uniform(0, 1000, rows)),
            np.where(stops, rng.uniform(0.5, 1.0, rows), rng.uniform(0, 1, rows)),
            rng.integers(0, 2, rows),
            rng.integers(0, 3, rows),
        ]
    ).astype(float)
    if missing:
        states[rng.random(rows) < 0.3, 1] = np.nan
        states[rng.random(rows) < 0.2, 3] = np.nan
    return table_of(states, ("go", "stop"), stops, demonstrations=5)


LAT = Vocabulary(History.LAST)
PREVIOUS_AND_DIFFERENCE = Vocabulary(History.PREVIOUS, (Difference("x", "y"),))


def made_up(table: DemonstrationTable, vocabulary: Vocabulary = LAT, seed: int = 0):
    """The rows that were added to the encoded table, and their actions."""
    matrix = encode(table, vocabulary)
    more = svm_smote(matrix, table.chosen, columns(table, vocabulary), seed)
    shown = len(table)
    assert more.matrix.dtype == np.float32
    np.testing.assert_array_equal(more.matrix[:shown], matrix)
    np.testing.assert_array_equal(more.chosen[:shown], table.chosen)
    return more.matrix[shown:], more.chosen[shown:], more.left


class TestWithImbalancedLearn:
    @pytest.fixture(autouse=True)
    def installed(self) -> None:
        pytest.importorskip("imblearn")

    def test_a_rare_action_is_learned(self) -> None:
        table = rare()

        def stops_found(upsample: Upsampling) -> float:
            trained = train(table, max_depth=2, upsample=upsample)
            return float(np.mean(trained.predict(table)[table.chosen == 1] == 1))

        assert stops_found(Upsampling.NONE) < 0.2
        assert stops_found(Upsampling.SVM_SMOTE) > 0.8

    @pytest.mark.parametrize("missing", [False, True])
    def test_rare_actions_get_many_more_rows_but_no_more_than_the_most_frequent_one(
        self, missing: bool
    ) -> None:
        table = rare(missing=missing)
        rows, chosen, left = made_up(table)
        assert set(chosen.tolist()) == {1}
        assert left == ()
        assert 150 < len(rows) <= 360

    @pytest.mark.parametrize("missing", [False, True])
    @pytest.mark.parametrize("vocabulary", [LAT, PREVIOUS_AND_DIFFERENCE])
    def test_indicators_stay_whole(self, missing: bool, vocabulary: Vocabulary) -> None:
        table = rare(missing=missing)
        asked = columns(table, vocabulary)
        rows, _, _ = made_up(table, vocabulary)
        indicators = [place for place, one in enumerate(asked) if isinstance(one, Indicator)]
        assert set(np.unique(rows[:, indicators]).tolist()) == {0.0, 1.0}
        for kind in (HasCategory, LastActionIs, PreviousActionIs):
            group = [
                place
                for place, one in enumerate(asked)
                if isinstance(one, Indicator) and isinstance(one.condition, kind)
            ]
            assert set(rows[:, group].sum(axis=1).tolist()) <= {0.0, 1.0}
        if not missing:
            rooms = [place for place, one in enumerate(asked) if "HasCategory" in str(one)]
            assert (rows[:, rooms].sum(axis=1) == 1).all()
        # LAT differs from the row's own action, and so it does in rows that are made up.
        if vocabulary is LAT:
            own = asked.index(Indicator(LastActionIs("stop")))
            assert (rows[:, own] == 0).all()

    def test_numbers_lie_within_what_was_shown_and_are_never_near_missing(self) -> None:
        table = rare(missing=True)
        rows, _, _ = made_up(table)
        for place in (0, 1):
            assert rows[:, place].min() >= np.float32(np.nanmin(table.states[:, place]))
            assert rows[:, place].max() <= np.float32(np.nanmax(table.states[:, place]))

    def test_differences_that_are_made_up_lie_within_those_shown(self) -> None:
        table = rare(missing=True)
        rows, _, _ = made_up(table, PREVIOUS_AND_DIFFERENCE)
        place = columns(table, PREVIOUS_AND_DIFFERENCE).index(Number(Difference("x", "y")))
        shown = table.states[:, 0] - table.states[:, 1]
        known = rows[:, place][rows[:, place] < MISSING / 3]
        assert len(known)
        assert known.min() >= np.float32(np.nanmin(shown))
        assert known.max() <= np.float32(np.nanmax(shown))

    def test_a_number_that_no_row_has_stays_missing(self) -> None:
        table = rare()
        states = table.states.copy()
        states[:, 1] = np.nan
        rows, chosen, left = made_up(replace(table, states=states))
        assert len(chosen) > 300
        assert left == ()
        assert (rows[:, 1] == np.float32(MISSING)).all()
        assert rows[:, 0].max() <= 1000

    def test_units_of_measurement_and_huge_numbers_do_not_matter(self) -> None:
        table = rare()
        rows, _, _ = made_up(table)
        # A power of two, so that nothing is rounded: 1000 becomes 8e37.
        factor = 2.0**116
        huge, _, _ = made_up(replace(table, states=table.states * [factor, 1, 1, 1]))
        assert len(rows) > 150
        np.testing.assert_array_equal(huge[:, 0] / np.float32(factor), rows[:, 0])
        np.testing.assert_array_equal(huge[:, 1:], rows[:, 1:])

    def test_the_random_state_decides_and_nothing_else(self) -> None:
        table = rare()
        first, again, other = (made_up(table, seed=seed)[0] for seed in (3, 3, 4))
        np.testing.assert_array_equal(first, again)
        assert not np.array_equal(first, other)
        trees = [
            fit(
                table, FitOptions(vocabulary=LAT, random_state=3, upsample=Upsampling.SVM_SMOTE)
            ).at(0.0)
            for _ in range(2)
        ]
        assert trees[0].tree == trees[1].tree

    def test_actions_of_the_same_frequency_are_left_alone(self) -> None:
        states = np.column_stack([np.arange(40.0), np.zeros(40), np.zeros(40), np.zeros(40)])
        table = table_of(states, ("a", "b"), np.arange(40) % 2)
        assert len(made_up(table)[0]) == 0
        assert len(made_up(table_of(states, ("a",), np.zeros(40)))[0]) == 0

    @pytest.mark.parametrize("count", [1, 2, 3, 6])
    def test_an_action_with_few_rows_neither_fails_nor_stops_the_others(self, count: int) -> None:
        table = rare()
        chosen = table.chosen.copy()
        chosen[10 : 10 + count] = 2
        table = replace(table, actions=("go", "stop", "wave"), chosen=chosen)
        _, added, left = made_up(table)
        assert 1 in added
        assert (2 in added) is not (2 in left)
        if count == 1:
            assert left == (2,)
            [_, note] = fit(table, FitOptions(upsample=Upsampling.SVM_SMOTE)).notes
            assert note == "too few rows resemble each other to upsample 'wave'"

    def test_an_action_whose_rows_all_lack_a_number_is_named(self) -> None:
        table = rare()
        states = table.states.copy()
        states[table.chosen == 1, 0] = np.nan
        rows, _, left = made_up(replace(table, states=states))
        assert (len(rows), left) == (0, (1,))

    def test_tables_of_a_few_rows_or_without_features_are_fitted(self) -> None:
        for rows in (2, 3, 5):
            states = np.zeros((rows, 4))
            table = table_of(states, ("a", "b"), np.arange(rows) == 0)
            train(table, vocabulary=LAT, upsample=Upsampling.SVM_SMOTE)
        table = replace(table, features=(), states=np.empty((5, 0)))
        train(table, upsample=Upsampling.SVM_SMOTE)

    def test_what_is_judged_is_real(self, monkeypatch: pytest.MonkeyPatch) -> None:
        table = rare()
        fitted_to: list[int] = []
        plain = svm_smote

        def watched(matrix, chosen, asked, random_state):
            fitted_to.append(len(chosen))
            return plain(matrix, chosen, asked, random_state)

        monkeypatch.setattr(training, "svm_smote", watched)
        options = LearnOptions(
            history=History.NONE,
            differences=Use.NEVER,
            refit=False,
            upsample=Upsampling.SVM_SMOTE,
        )
        learning = pipeline.learn_from(table, options)
        shown = table.where(~learning.evidence.held_out)
        # Rows that are held out, and each fold's own rows, are neither sources nor made up.
        assert len(shown) == 320
        assert fitted_to[0] == 320
        assert fitted_to[1:5] == [240] * 4
        provenance = learning.learned.provenance
        assert provenance.rows == 320
        assert provenance.figures.held_out_rows == 80
        assert provenance.figures.fidelity_mismatches == 0
        held_out = table.where(learning.evidence.held_out)
        agreement = np.mean(learning.decision_tree.predict(held_out) == held_out.chosen)
        assert provenance.figures.teacher_forced_agreement == pytest.approx(agreement)
        assert learning.notes[0].startswith("the decision tree was fitted to")
        assert learning.notes[0].endswith("made-up rows beside the 320 shown")
        # The leaves do count the rows that were made up.
        counted = sum(sum(leaf.distribution) for _, leaf in learning.decision_tree.tree.paths())
        assert counted > 400

    def test_refitting_upsamples_all_rows(self) -> None:
        options = LearnOptions(history=History.NONE, ccp_alpha=0.0, upsample=Upsampling.SVM_SMOTE)
        learning = pipeline.learn_from(rare(), options)
        assert learning.notes[0].endswith("made-up rows beside the 400 shown")
        assert learning.learned.provenance.rows == 400


@pytest.mark.parametrize(
    ("module", "said"),
    [
        (None, "which is not installed"),
        # As with a scikit-learn that it does not go with: what is wanted is not in it.
        (ModuleType("imblearn.over_sampling"), r"which cannot be imported \(cannot import name"),
    ],
)
def test_without_imbalanced_learn_one_sentence_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, module: ModuleType | None, said: str
) -> None:
    monkeypatch.setitem(sys.modules, "imblearn", ModuleType("imblearn"))
    monkeypatch.setitem(sys.modules, "imblearn.over_sampling", module)
    with pytest.raises(OptionError, match=said) as caught:
        pipeline.learn_from(rare(60), LearnOptions(upsample=Upsampling.SVM_SMOTE))
    assert str(caught.value).endswith("learn without upsampling.")
    assert str(caught.value).count(". ") == 0
    pipeline.learn_from(rare(60))
