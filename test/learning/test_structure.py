"""Learning from very many rows: trees grow on a sample, and everything else is about all rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning import structure
from rebt_ros.learning.learning_file import load_learning, write_learning
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.learning.structure import structure_sample

SAMPLED = 1000


@pytest.fixture(autouse=True)
def small_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(structure, "MOST_ROWS_GROWN_ON", SAMPLED)


def _table(demonstrations: int, rare: tuple[int, ...] = ()) -> DemonstrationTable:
    """Demonstrations of 20 rows, in some of which a door is opened."""
    rows = 20 * demonstrations
    random = np.random.default_rng(7)
    states = np.round(random.normal(size=(rows, 3)), 2)
    chosen = (states[:, 0] > 0) + 1 * (states[:, 1] > 0.5)
    chosen = np.where(random.random(rows) < 0.03, random.integers(3, size=rows), chosen)
    for place in (20 * one + step for one in rare for step in range(7, 13)):
        states[place, 2], chosen[place] = 9.0 + place % 7 / 10, 3
    return DemonstrationTable(
        channel="action",
        features=tuple(map(Feature, "abc")),
        states=states,
        actions=("go", "left", "right", *(("open",) if rare else ())),
        chosen=chosen.astype(np.int64),
        demonstrations=tuple(f"d{number}" for number in range(demonstrations)),
        demonstration=np.arange(rows) // 20,
        stamps=np.arange(rows),
    )


def test_few_rows_are_learned_from_as_they_are() -> None:
    table = _table(SAMPLED // 20)
    assert structure_sample(table, LearnOptions()) is None
    learning = learn_from(table)
    assert learning.report.sample is None
    assert learning.report.as_json()["sample"] is None
    assert dumps(learning.learned) == dumps(learn_from(table, LearnOptions(exact=True)).learned)


@pytest.mark.parametrize(
    "options",
    [LearnOptions(exact=True), LearnOptions(upsample=Upsampling.SVM_SMOTE), LearnOptions.paper()],
)
def test_whoever_asks_for_it_has_trees_grown_on_all_rows(options: LearnOptions) -> None:
    assert structure_sample(_table(200), options) is None


def test_a_tree_grown_on_a_sample_is_counted_and_reported_on_all_rows() -> None:
    table = _table(300, rare=(11, 222))
    learning = learn_from(table)
    sample = learning.report.sample
    assert sample is not None
    assert sample.rows == pytest.approx(SAMPLED, abs=100)
    assert (sample.of_rows, sample.of_demonstrations) == (6000, 300)
    assert sample.demonstrations == sample.rows / 20
    assert sample.complete == ("open",)
    assert learning.learned.provenance.rows == 6000
    assert learning.decision_tree.grown.counts[0].tolist() == np.bincount(table.chosen).tolist()
    assert learning.learned.provenance.figures.fidelity_mismatches == 0
    predicted = learning.decision_tree.predict(table)
    right = predicted == table.chosen
    assert sample.whole.agreement == pytest.approx(np.mean(right))
    recalls = [np.mean(right[table.chosen == action]) for action in range(4)]
    assert sample.whole.mean_recall == pytest.approx(np.mean(recalls))
    found = structure_sample(table, learning.options)
    assert found is not None
    assert sample.sampled.agreement == pytest.approx(np.mean(right[found.rows]))
    # The rare action is learned, and the rest as well as from everything.
    assert recalls[3] == 1.0
    exact = learn_from(table, LearnOptions(exact=True)).learned.provenance.figures
    ours = learning.learned.provenance.figures
    assert ours.own_history_agreement is not None
    assert exact.own_history_agreement is not None
    assert ours.own_history_agreement == pytest.approx(exact.own_history_agreement, abs=0.01)


def test_the_answer_and_the_summary_say_so() -> None:
    learning = learn_from(_table(100, rare=(5,)))
    sample = learning.report.sample
    assert sample is not None
    said = learning.report.in_short()
    assert f"a sample of {sample.rows} of 2000 rows" in said
    assert f"({sample.demonstrations} of 100 demonstrations, all that show 'open' among" in said
    assert f"{sample.sampled.agreement:.1%} of the sample" in said
    assert f"{sample.whole.agreement:.1%} of all rows" in said
    kept = learning.report.as_json()["sample"]
    assert kept["rows"] == sample.rows
    assert kept["of_rows"] == 2000
    assert kept["complete"] == ["open"]
    assert kept["whole"]["agreement"] == sample.whole.agreement


@pytest.mark.parametrize("history", [History.NONE, History.PREVIOUS])
def test_what_was_done_before_may_be_tested(history: History) -> None:
    learning = learn_from(_table(120), LearnOptions(history=history))
    figures = learning.learned.provenance.figures
    assert learning.report.sample is not None
    assert figures.own_history_agreement is not None
    assert figures.own_history_agreement > 0.9
    assert figures.fidelity_mismatches == 0


@pytest.mark.parametrize("refit", [True, False])
def test_levels_are_of_the_counted_tree_and_are_kept(refit: bool, tmp_path: Path) -> None:
    learning = learn_from(_table(120), LearnOptions(refit=refit))
    level = learning.level(len(learning.levels.ccp_alphas) - 1)
    assert level.decision_tree.tree.leaves == 1
    assert level.report.sample is not None
    shown = np.bincount(learning.evidence.learned_from.chosen)
    assert level.report.sample.whole.agreement == pytest.approx(shown.max() / shown.sum())
    write_learning(tmp_path, learning)
    again = load_learning(tmp_path)
    assert again.report == learning.report
    assert dumps(again.learned) == dumps(learning.learned)


def test_one_long_demonstration_is_sampled_in_stretches() -> None:
    table = _table(120)
    single = replace(
        table,
        demonstrations=("only",),
        demonstration=np.zeros(len(table), dtype=np.int64),
        previous=None,
    )
    sample = learn_from(single).report.sample
    assert sample is not None
    assert (sample.demonstrations, sample.of_demonstrations) == (1, 1)
    assert sample.rows == pytest.approx(SAMPLED, abs=50)
