"""The family: one tree, its pictures and its figures for every pruning level, on disk."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper import reductions
from rebt_ros.beyond_the_paper.reductions import Reductions
from rebt_ros.commands import learn as learn_command
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import OptionError
from rebt_ros.learning import evaluation, pipeline
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.levels import Levels
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.offline import learning_from_files as offline
from rebt_ros.offline.result import OfflineLearning
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import load
from rebt_ros.storage.tree_file import read_tree

ALWAYS = ["decision_tree.dot", "decision_tree.svg", "tree.dot", "tree.json", "tree.svg"]
PNG = ["decision_tree.png", "tree.png"]
#: Fast to learn: nothing to compare.
OPTIONS = LearnOptions(history=History.NONE, psa=Use.NEVER, max_depth=4)
#: The simplest tree has levels of its own, and is pruned at one of those of the greedy tree.
GREEDY = replace(OPTIONS, simplest=False)


def rows_of(rows: int = 300, channel: str = "action", noise: float = 0.1) -> list[Row]:
    """Turns where x is positive, and stops where y is as well, but not always."""
    rng = np.random.default_rng(7)
    states = rng.normal(size=(rows, 2)).tolist()
    strange = (rng.random(rows) < noise).tolist()
    actions = [
        "go" if x < 0 or odd else "turn" if y < 0 else "stop"
        for (x, y), odd in zip(states, strange, strict=True)
    ]
    return [
        Row(t, channel, action, None, tuple(state))
        for t, (action, state) in enumerate(zip(actions, states, strict=True))
    ]


def shown(*rows: Row) -> Demonstration:
    return Demonstration.from_rows("one", (Feature("x"), Feature("y")), rows)


def family(options: LearnOptions = OPTIONS, **of: Any) -> Family:
    learning = pipeline.learn_from(tabulate([shown(*rows_of(**of))])[0], options)
    return Family(learning, learning.levels)


class Family(NamedTuple):
    """A learned policy, and its pruning levels."""

    learning: Learning
    levels: Levels

    def __getattr__(self, name: str) -> Any:
        return getattr(self.levels, name)


def csv(path: Path, rows: list[Row]) -> Path:
    lines = [f"{row.state[0]},{row.state[1]},{row.action}" for row in rows]
    path.write_text("\n".join(["x,y,action", *lines]) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, OfflineLearning]:
    """A directory with all levels, and what was learned."""
    out = tmp_path_factory.mktemp("family")
    table = csv(out / "table.csv", rows_of())
    return out, rebt_ros.learn([table], out=out, options=GREEDY, levels=True)


def entries(out: Path) -> list[dict[str, Any]]:
    summary = json.loads((out / "levels" / "summary.json").read_text(encoding="utf-8"))
    assert isinstance(summary, list)
    return summary


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


# --- what the levels are ------------------------------------------------------------------------


def test_levels_go_from_the_fitted_tree_to_a_single_action() -> None:
    every = family()
    count = len(every.ccp_alphas)
    levels = [every.level(number) for number in range(count)]
    leaves = [level.leaves for level in levels]
    assert leaves == sorted(leaves, reverse=True)
    assert leaves == [sum(1 for _ in level.decision_tree.paths()) for level in levels]
    assert leaves[-1] == 1
    assert isinstance(levels[-1].learned.tree, nodes.Action)
    assert [level.number for level in levels if level.chosen] == [every.chosen]
    assert [level.number for level in levels if level.best] == [every.best]


def test_every_level_does_what_its_decision_tree_does() -> None:
    every = family()
    table, fitted = every.learning.table, every.learning.policy.fitted
    for number, ccp_alpha in enumerate(every.ccp_alphas.tolist()):
        learned = every.level(number).learned
        chosen = evaluation.teacher_forced_choices(learned.tree, table)
        assert (chosen == fitted.at(ccp_alpha).predict(table)).all()
        assert learned.provenance.figures.fidelity_mismatches == 0


def test_the_chosen_level_is_the_tree_that_was_learned() -> None:
    every = family(replace(GREEDY, refit=False))
    level = every.level(every.chosen)
    assert level.learned == replace(every.learning.learned, suggestions=())


def test_the_chosen_level_of_the_simplest_tree_is_that_tree() -> None:
    every = family(replace(OPTIONS, refit=False))
    learned = every.learning.learned
    level = every.level(every.chosen)
    assert level.learned.tree == learned.tree
    assert level.learned.shown == learned.shown
    assert level.ccp_alpha <= learned.provenance.ccp_alpha
    assert level.learned.provenance.figures == learned.provenance.figures


def test_the_chosen_level_of_all_rows_is_judged_by_the_same_level_without_those_held_out() -> None:
    every = family(GREEDY)
    level, learning = every.level(every.chosen), every.learning
    published, origin = learning.learned, level.learned.provenance
    figures = published.provenance.figures
    assert replace(level.learned, provenance=replace(origin, figures=figures)) == replace(
        published, suggestions=()
    )
    held_out = learning.table.where(learning.evidence.held_out)
    chosen = learning.evidence.judge.at(level.ccp_alpha).predict(held_out)
    assert origin.figures.own_history_agreement == np.mean(chosen == held_out.chosen)


def test_a_level_that_is_asked_for_is_the_one_of_the_family() -> None:
    every = family()
    for number in (0, len(every.ccp_alphas) // 2, len(every.ccp_alphas) - 1):
        asked = family(replace(OPTIONS, level=number))
        assert asked.chosen == number
        assert every.level(number).learned == replace(asked.learning.learned, suggestions=())


@pytest.mark.parametrize("asked", [0.0, 0.003, 10.0])
def test_a_ccp_alpha_that_was_asked_for_chooses_the_level_that_it_comes_to(asked: float) -> None:
    every = family(replace(OPTIONS, ccp_alpha=asked))
    learned = every.learning.learned
    assert every.level(every.chosen).learned.tree == learned.tree
    assert every.ccp_alphas[every.chosen] <= asked


def test_few_rows_have_levels_without_cross_validation() -> None:
    every = family(rows=19)
    assert every.best is None
    assert every.level(0).cross_validated is None


def test_large_trees_are_made_without_the_slow_reduction_and_stay_faithful() -> None:
    every = family(LearnOptions(history=History.NONE, psa=Use.NEVER), rows=500, noise=0.5)
    level = every.level(0)
    assert level.leaves > 48
    assert not level.reduced
    assert level.learned.provenance.figures.fidelity_mismatches == 0
    assert every.level(len(every.ccp_alphas) - 1).reduced


@pytest.mark.parametrize("asked", [None, Reductions(domain=False)])
def test_what_nobody_asked_for_is_not_missing(
    asked: Reductions | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reductions, "MOST_LEAVES_BY_DOMAIN", 1)
    assert not family(rows=40).level(0).reduced
    assert family(replace(OPTIONS, reductions=asked), rows=40).level(0).reduced


# --- which levels -------------------------------------------------------------------------------


@pytest.mark.parametrize("most", [4, 5, 8, 30, 1000])
def test_at_most_so_many_levels_are_selected_and_never_without_the_important_ones(
    most: int,
) -> None:
    every = family(
        LearnOptions(history=History.NONE, psa=Use.NEVER, ccp_alpha=0.004), rows=400, noise=0.3
    )
    count = len(every.ccp_alphas)
    selected = every.selected(most)
    assert len(selected) == min(most, count)
    assert {0, count - 1, every.chosen, every.best} <= set(selected)
    gaps = np.diff(selected)
    assert gaps.min() >= 1
    assert gaps.max() <= 2 * max(1, -(-count // (most - 3)))


def test_fewer_levels_than_are_always_written_are_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="at least 4"):
        rebt_ros.learn([tmp_path / "missing"], out=tmp_path / "out", levels=True, most_levels=3)
    assert not (tmp_path / "out").exists()


# --- files --------------------------------------------------------------------------------------


def test_each_level_has_a_directory_with_its_tree_and_pictures(
    written: tuple[Path, OfflineLearning],
) -> None:
    pytest.importorskip("matplotlib")
    out, result = written
    summary = entries(out)
    assert names(out / "levels") == [*(one["level"] for one in summary), "summary.json"]
    assert summary[0]["level"] == "00"
    for one in summary:
        directory = out / "levels" / one["level"]
        assert names(directory) == sorted([*ALWAYS, *PNG])
        learned = read_tree(directory / "tree.json")
        assert nodes.size(learned.tree) == one["nodes"]
        assert nodes.depth(learned.tree) == one["depth"]
        assert learned.provenance.ccp_alpha == one["ccp_alpha"]
        ET.parse(directory / "decision_tree.svg")
    chosen = next(one for one in summary if one["chosen"])
    assert read_tree(out / "levels" / chosen["level"] / "tree.json").tree == result.learned.tree
    level = result.learnings[0].levels.level(int(chosen["level"]))
    figures = level.learned.provenance.figures
    assert chosen["own_history_agreement"] == figures.own_history_agreement


def test_the_summary_has_the_figures_of_every_level(
    written: tuple[Path, OfflineLearning],
) -> None:
    out, result = written
    judged = result.learnings[0].policy.levels
    assert judged is not None
    summary = entries(out)
    assert [one["cross_validated_agreement"] for one in summary] == judged.means.tolist()
    assert [one["cross_validated_standard_error"] for one in summary] == (
        judged.standard_errors.tolist()
    )
    assert {one["fidelity_mismatches"] for one in summary} == {0}
    assert sum(one["chosen"] for one in summary) == sum(one["best"] for one in summary) == 1
    assert summary[-1]["leaves"] == summary[-1]["nodes"] == len(summary[-1]["actions"]) == 1


def test_the_plot_stands_beside_the_levels(
    written: tuple[Path, OfflineLearning],
) -> None:
    pytest.importorskip("matplotlib")
    out, _ = written
    assert (out / "accuracy_vs_alpha.png").read_bytes().startswith(b"\x89PNG\r\n")
    ET.parse(out / "accuracy_vs_alpha.svg")


def test_learning_again_leaves_nothing_of_the_levels_before_but_what_others_put_there(
    tmp_path: Path,
) -> None:
    table = csv(tmp_path / "table.csv", rows_of(rows=80))
    out = tmp_path / "out"
    rebt_ros.learn([table], out=out, options=OPTIONS, levels=True)
    (out / "levels" / "00" / "mine.txt").write_text("keep", encoding="utf-8")
    (out / "levels" / "90").mkdir()
    (out / "levels" / "90" / "tree.json").write_text("of an earlier run", encoding="utf-8")
    rebt_ros.learn([table], out=out, options=OPTIONS)
    assert [path.name for path in (out / "levels").rglob("*")] == ["00", "mine.txt"]
    assert not list(out.glob("accuracy_vs_alpha*"))
    assert {*ALWAYS} < set(names(out))


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_levels_that_are_left_out_are_counted_in_a_note(tmp_path: Path) -> None:
    table = csv(tmp_path / "table.csv", rows_of(noise=0.3))
    result = rebt_ros.learn([table], out=tmp_path, options=OPTIONS, levels=True, most_levels=4)
    count = len(result.learnings[0].policy.fitted.path)
    assert f"4 of {count} pruning levels were written" in " ".join(result.notes)
    assert len(entries(tmp_path)) == 4
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["notes"] == list(result.notes)


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_a_family_that_takes_much_room_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = csv(tmp_path / "table.csv", rows_of(rows=40))
    result = rebt_ros.learn([table], out=tmp_path, options=OPTIONS, levels=True)
    assert "MB" not in " ".join(result.notes)
    monkeypatch.setattr("rebt_ros.offline.level_files._MENTIONED_MEGABYTES", 0.0)
    result = rebt_ros.learn([table], out=tmp_path, options=OPTIONS, levels=True)
    assert "MB" in " ".join(result.notes)


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_without_matplotlib_all_but_png_files_and_the_plot_are_written(tmp_path: Path) -> None:
    (tmp_path / "tree.png").write_bytes(b"of an earlier tree")
    table = csv(tmp_path / "table.csv", rows_of(rows=80))
    result = rebt_ros.learn([table], out=tmp_path, options=OPTIONS, levels=True)
    assert [note for note in result.notes if "pip install matplotlib" in note] == [
        note for note in result.notes if "matplotlib" in note
    ]
    assert sum("matplotlib" in note for note in result.notes) == 1
    assert names(tmp_path / "levels" / "00") == ALWAYS
    assert not list(tmp_path.rglob("*.png"))
    assert not list(tmp_path.glob("accuracy_vs_alpha*"))


def test_each_channel_has_a_directory_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Of what is read only the demonstrations matter here.
    rows = [*rows_of(rows=80, channel="/base/do it"), *rows_of(rows=80, channel="arm")]
    loaded = load([csv(tmp_path / "t.csv", rows)], InputOptions())
    monkeypatch.setattr(offline, "load", lambda *_: replace(loaded, demonstrations=(shown(*rows),)))
    rebt_ros.learn(["both"], out=tmp_path / "out", options=OPTIONS, levels=True)
    assert names(tmp_path / "out" / "channels") == ["arm", "base_do_it"]
    for name in ("arm", "base_do_it"):
        directory = tmp_path / "out" / "channels" / name
        assert (directory / "decision_tree.svg").is_file()
        assert (directory / "levels" / "summary.json").is_file()
    assert (tmp_path / "out" / "tree.svg").is_file()


def test_progress_never_goes_back(tmp_path: Path) -> None:
    shares: list[float] = []
    table = csv(tmp_path / "table.csv", rows_of(rows=80))
    rebt_ros.learn(
        [table],
        out=tmp_path,
        options=OPTIONS,
        levels=True,
        progress=lambda stage, share: shares.append(share),
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_the_command_writes_levels_on_request(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = csv(tmp_path / "table.csv", rows_of(rows=80))
    arguments = [str(table), "--out", str(tmp_path / "out"), "--max-depth", "3"]
    learn_command.main([*arguments, "--history", "none", "--levels", "--most-levels", "4"])
    assert "levels/" in capsys.readouterr().out
    assert len(entries(tmp_path / "out")) <= 4


def test_levels_are_written_and_plotted_where_a_simpler_tree_took_the_place_of_the_greedy_one(
    tmp_path: Path,
) -> None:
    # Neither half of an exclusive or tells anything alone, so that greedy splits go astray.
    source = np.random.default_rng(0)
    inputs = []
    for number in range(4):
        rows = source.random((60, 3)).round(2)
        lines = [f"{a},{b},{c},{'go' if (a > 0.5) != (b > 0.5) else 'stop'}" for a, b, c in rows]
        path = tmp_path / f"{number}.csv"
        path.write_text("\n".join(["a,b,c,action", *lines]) + "\n")
        inputs.append(path)
    result = offline.learn(inputs, out=tmp_path / "out", levels=True)
    assert any("simplest" in reason for reason in result.learnings[0].policy.reasons)
    entries = json.loads((tmp_path / "out" / "levels" / "summary.json").read_text())
    assert all(entry["cross_validated_agreement"] is not None for entry in entries)
