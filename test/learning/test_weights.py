"""Weights of demonstrations: a weight of k is as if each of its rows had been shown k times."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.arrays import IntArray
from rebt_ros.commands import learn
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.training import FitOptions, fit, fit_again, fit_parts
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.demonstration.weights import LARGEST_WEIGHT, whole_weights
from rebt_ros.errors import InputError, OptionError, RebtError
from rebt_ros.learning.cross_validation import CrossValidation, folds
from rebt_ros.learning.learning_file import load_learning
from rebt_ros.learning.mistakes import intended_actions
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import learn_from
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import load
from rebt_ros.storage.weights import weight
from rebt_ros.storage.weights_file import read_weights

VOCABULARIES = st.sampled_from((some.EVERYTHING, some.LAT, some.PREVIOUS))


def repeated(table: DemonstrationTable, weights: Sequence[int]) -> DemonstrationTable:
    """The table with each row as often as its demonstration counts."""
    times = np.array(weights)[table.demonstration]
    return replace(
        table,
        states=np.repeat(table.states, times, axis=0),
        chosen=np.repeat(table.chosen, times),
        demonstration=np.repeat(table.demonstration, times),
        stamps=np.repeat(table.stamps, times),
        previous=np.repeat(table.previous, times),
    )


@st.composite
def weighed(draw: st.DrawFn, min_rows: int = 1) -> tuple[DemonstrationTable, DemonstrationTable]:
    """A table with weights, and one with its rows repeated."""
    table = draw(some.tables(min_rows=min_rows))
    count = len(table.demonstrations)
    weights = draw(st.lists(st.integers(1, 4), min_size=count, max_size=count))
    return replace(table, weights=np.array(weights)), repeated(table, weights)


def parts(fitted: FittedTree) -> list[list[object]]:
    grown = fitted.grown
    splits = grown.left >= 0
    return [
        grown.left.tolist(),
        grown.column[splits].tolist(),
        grown.threshold[splits].tolist(),
        grown.counts.tolist(),
        grown.risk.tolist(),
        fitted.path.alphas.tolist(),
        [fitted.explanation, fitted.explaining_leaves, *fitted.explanations.tolist()],
    ]


@given(weighed(), VOCABULARIES)
def test_a_tree_of_weighed_rows_is_that_of_repeated_rows(
    tables: tuple[DemonstrationTable, DemonstrationTable], vocabulary: object
) -> None:
    weighed, again = tables
    options = FitOptions(vocabulary=vocabulary)  # type: ignore[arg-type]
    first, second = fit(weighed, options), fit(again, options)
    assert parts(first) == parts(second)
    assert parts(fit_again(weighed, first, 1, 0.6)) == parts(fit_again(again, second, 1, 0.6))
    assert np.array_equal(
        first.hits(weighed, first.path.alphas), second.hits(again, first.path.alphas)
    )


@given(weighed(), VOCABULARIES, st.data())
def test_trees_of_parts_are_those_of_tables_of_these_rows(
    tables: tuple[DemonstrationTable, DemonstrationTable], vocabulary: object, data: st.DataObject
) -> None:
    table, _ = tables
    options = FitOptions(vocabulary=vocabulary)  # type: ignore[arg-type]
    inside = data.draw(st.lists(st.booleans(), min_size=len(table), max_size=len(table)))
    rows = np.array(inside)
    if not rows.any():
        rows[0] = True
    of_all, of_part = fit_parts(table, [rows], options)
    assert parts(of_all) == parts(fit(table, options))
    assert parts(of_part) == parts(fit(table.where(rows), options))


@given(weighed(min_rows=4))
def test_levels_are_judged_by_weighed_rows(
    tables: tuple[DemonstrationTable, DemonstrationTable],
) -> None:
    table, _ = tables
    judged = CrossValidation(table).teacher_forced()
    assert table.weights is not None
    weights: IntArray = table.weights[table.demonstration]
    expected = np.bincount(table.chosen, weights, len(table.actions))
    assert judged.shown.sum(axis=0).tolist() == expected.tolist()
    assert (judged.hits <= judged.shown[:, np.newaxis]).all()
    # Which rows are in which fold does not depend on what they count.
    assert np.array_equal(folds(table), folds(replace(table, weights=None)))


@given(st.lists(st.fractions(Fraction(1, 4), 10, max_denominator=4), min_size=1, max_size=6))
def test_weights_are_ratios(weights: list[Fraction]) -> None:
    try:
        whole = whole_weights(weights)
    except OptionError:
        return
    if whole is None:
        assert len(set(weights)) == 1
        return
    assert [Fraction(int(one), int(whole[0])) for one in whole] == [
        one / weights[0] for one in weights
    ]
    assert np.gcd.reduce(whole) == 1
    doubled = whole_weights([2 * one for one in weights])
    assert doubled is not None
    assert doubled.tolist() == whole.tolist()


def test_ratios_have_an_end() -> None:
    with pytest.raises(OptionError, match="whole numbers up to 1001, and 1000 is the most"):
        whole_weights([Fraction(1), Fraction(LARGEST_WEIGHT + 1)])


def contradicting(first: int, second: int) -> DemonstrationTable:
    """Two demonstrations that do the opposite in the same states, and what each counts."""
    rows = [(x / 20, 0.5, 0.0, 0.0) for x in range(20)]
    chosen = [int(x > 9) for x in range(20)] + [int(x <= 9) for x in range(20)]
    table = some.table([*rows, *rows], chosen, [0] * 20 + [1] * 20)
    return replace(table, weights=np.array([first, second]))


def test_who_counts_more_is_learned_from() -> None:
    options = LearnOptions(test_fraction=0, leave_out_mistakes=False)
    for weights, demonstration in (((3, 1), 0), ((1, 3), 1)):
        table = contradicting(*weights)
        learning = learn_from(table, options)
        chosen = learning.decision_tree.predict(table)
        its = table.demonstration == demonstration
        assert np.array_equal(chosen[its], table.chosen[its])


def test_reports_count_rows_and_say_what_is_weighed() -> None:
    table = contradicting(3, 1)
    plain, weighed = (
        learn_from(one, LearnOptions()) for one in (replace(table, weights=None), table)
    )
    assert [one.rows for one in weighed.report.actions] == [
        one.rows for one in plain.report.actions
    ]
    assert weighed.learned.provenance.rows == plain.learned.provenance.rows == 40
    figures = [one.learned.provenance.figures.held_out_rows for one in (weighed, plain)]
    assert figures == [20, 20]
    assert (plain.report.weighted, weighed.report.weighted) == (False, True)
    assert "demonstrations have weights" in " ".join(weighed.notes)
    assert "demonstrations have weights" not in " ".join(plain.notes)
    assert np.array_equal(intended_actions(table), intended_actions(replace(table, weights=None)))


def test_made_up_rows_have_no_weights() -> None:
    with pytest.raises(OptionError, match="leave out the upsampling or the weights"):
        learn_from(contradicting(3, 1), LearnOptions(upsample=Upsampling.SVM_SMOTE))


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Four tables that agree only roughly on where to turn."""
    monkeypatch.chdir(tmp_path)
    Path("fleet").mkdir()
    for number in range(4):
        lines = (
            f"{x / 8},{(x * 7 + number) % 5},{'go' if x < 8 + number else 'turn'}"
            for x in range(20 + number)
        )
        Path(f"fleet/{number}.csv").write_text("\n".join(("front,side,action", *lines)) + "\n")
    return Path("fleet")


def learned(out: str, *options: str, weights: str | None = None) -> dict[str, object]:
    """Learns from the fleet, and gives what the summary says."""
    if weights is not None:
        Path(f"{out}.csv").write_text(weights)
        options = (*options, "--weights", f"{out}.csv")
    learn.main(["fleet", "--out", out, *options])
    summary: dict[str, object] = json.loads(Path(out, "summary.json").read_text())
    return summary


FILES = ("tree.json", "learning.npz", "decision_tree.svg")


def test_equal_weights_are_none_to_the_byte(fleet: Path) -> None:
    plain = learned("plain")
    assert learned("twos", weights="*.csv,2\n") == plain
    for name in (*FILES, "summary.json"):
        assert Path("plain", name).read_bytes() == Path("twos", name).read_bytes()


def test_what_counts_0_is_left_out_as_if_it_were_excluded(fleet: Path) -> None:
    nothing, excluded = (
        load([fleet], options)
        for options in (
            InputOptions(weights=(("*.csv", Fraction(2)), ("1.csv", Fraction(0)))),
            InputOptions(exclude=("1.csv",)),
        )
    )
    assert nothing.notes == excluded.notes
    assert nothing.paths == excluded.paths
    assert nothing.excluded == excluded.excluded == (fleet / "1.csv",)
    tables = [
        tabulate(loaded.demonstrations, weights=loaded.weights)[0] for loaded in (nothing, excluded)
    ]
    assert tables[0].demonstrations == tables[1].demonstrations
    assert tables[0].weights is tables[1].weights is None


def test_only_ratios_matter_and_the_last_line_that_fits_tells(
    fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = learned("first", weights="demonstration,weight\n# as shown\n*.csv,2\nfleet/3.csv,6\n")
    told = capsys.readouterr().out
    Path("w.json").write_text('{"fleet/[012].csv": 0.5, "3.csv": 1.5}')
    second = learned("second", "--weights", "w.json")
    assert first == second
    for name in FILES:
        assert Path("first", name).read_bytes() == Path("second", name).read_bytes()
    assert first["weights"] == {"0.csv": 1, "1.csv": 1, "2.csv": 1, "3.csv": 3}
    assert "note: each row counts once in 0.csv, 1.csv, 2.csv." in told
    assert "note: each row counts 3 times in 3.csv." in told
    assert "note: demonstrations have weights" in told
    kept = load_learning("first")
    assert kept.table.weights is not None
    assert kept.table.weights.tolist() == [1, 1, 1, 3]
    assert kept.report.weighted


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("w.csv", "", "w.csv has no weights"),
        ("w.csv", "demonstration,weight\n", "w.csv has no weights"),
        ("w.csv", "0.csv,1\n1.csv\n", "line 2: there must be a name and a weight"),
        ("w.csv", "0.csv,1\n1.csv,heavy\n", "line 2: a weight must be 0 or a number from 0.001"),
        ("w.csv", "0.csv,-1\n", "not -1."),
        ("w.csv", "0.csv,nan\n", "not nan."),
        ("w.csv", "0.csv,1e400\n", "not 1e400."),
        ("w.csv", "0.csv,0.0000000000000000000000000001e28\n", "a weight must be"),
        ("w.csv", "4.csv,1\n", "no demonstration is called '4.csv'"),
        ("w.csv", "0.csv,1\n1.csv,777.7\n", "whole numbers up to 7777"),
        ("w.json", "[1]", "must be a JSON object"),
        ("w.json", '{"0.csv": "2x"}', "w.json, '0.csv': a weight must be"),
        ("w.json", '{"0.csv": true}', "w.json, '0.csv': a weight must be"),
        ("w.json", "{", "w.json is no JSON"),
        ("w.csv", "*,0\n", "all 4 demonstrations are left out"),
    ],
)
def test_files_that_hold_no_weights_are_refused_in_a_sentence(
    fleet: Path, name: str, content: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path(name).write_text(content)
    with pytest.raises(SystemExit) as ended:
        learn.main(["fleet", "--weights", name, "--no-cache"])
    assert ended.value.code == 1
    assert said in capsys.readouterr().err.splitlines()[-1]


@given(st.text(max_size=40))
def test_whatever_a_file_says_it_is_weights_or_refused(content: str) -> None:
    for value in (content, *content.split(",")):
        try:
            assert weight(value) == 0 or Fraction(1, 1000) <= weight(value) <= 1000
        except RebtError:
            continue


def test_weights_in_python_are_numbers_by_names() -> None:
    options = InputOptions(weights={"a.csv": 2, "b.csv": 0.1})  # type: ignore[arg-type]
    assert options.weights == (("a.csv", Fraction(2)), ("b.csv", Fraction(1, 10)))
    assert replace(options, exclude="c.csv").weights == options.weights
    for wrong in (3, {"a": None}, {1: 2}, "ab"):
        with pytest.raises(OptionError):
            InputOptions(weights=wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="does not exist"):
        read_weights(Path("nowhere.csv"))
