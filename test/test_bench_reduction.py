"""``make bench-reduction`` on small experiments."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rebt_ros.behavior_tree import nodes
from rebt_ros.commands import bench_reduction
from rebt_ros.study.configurations import read_configs

CHOICE = {
    "name": "root",
    "type_": "parallel",
    "child_list": [
        {
            "name": "sequence",
            "type_": "sequence",
            "child_list": [
                {"name": "x", "type_": "condition", "target_state": "x", "threshold": 0.5},
                {"name": "go", "type_": "action"},
            ],
        },
        {"name": "stop", "type_": "action"},
    ],
}


@pytest.fixture
def experiments(tmp_path: Path) -> Path:
    folder = tmp_path / "experiments"
    folder.mkdir()
    for number in (10, 9):
        (folder / f"expr{number}.json").write_text(json.dumps(CHOICE))
    return folder


def test_the_figures_are_printed_and_written(
    experiments: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results" / "reduction.json"
    arguments = [str(experiments), "--ticks", "300", "--jobs", "1", "--out", str(out)]
    bench_reduction.main(arguments)
    written = json.loads(out.read_text())
    for mode in ("paper", "default"):
        figures = written[mode]
        assert {"median", "maximum", "share_reduced", "mismatches"} <= set(figures)
        assert figures["mismatches"] == 0
        assert figures["trees"] > 0
    assert written["default"]["median"] > written["paper"]["median"]
    printed = capsys.readouterr().out
    assert f"{written['default']['median']:.2f} %" in printed
    bench_reduction.main(arguments)
    again = json.loads(out.read_text())
    assert again | {"seconds": 0} == written | {"seconds": 0}


def test_configurations_stand_in_the_order_of_their_numbers(experiments: Path) -> None:
    names = [config.name for config in read_configs(experiments)]
    assert names == ["expr9", "expr10"]


def test_a_tree_that_differs_from_the_decision_tree_is_counted_as_mismatches(
    experiments: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    always_go = nodes.Action("go", "action")
    monkeypatch.setitem(bench_reduction._MODES, "paper", lambda tree: always_go)
    (config, _) = read_configs(experiments)
    result = bench_reduction.compare(config, ticks=300, seed=0)
    assert all(one.mismatches == 0 for one in result.comparisons["default"])
    assert all(0 < one.mismatches < result.rows for one in result.comparisons["paper"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{empty}"], "has no configuration files"),
        (["{experiments}", "--jobs", "0"], "jobs is 0"),
        (["{experiments}", "--ticks", "0", "--jobs", "1"], "ticks is 0"),
    ],
)
def test_bad_arguments_get_one_sentence(
    arguments: list[str],
    message: str,
    experiments: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    given = [one.format(empty=tmp_path, experiments=experiments) for one in arguments]
    with pytest.raises(SystemExit) as ended:
        bench_reduction.main([*given, "--out", str(tmp_path / "out.json")])
    assert ended.value.code == 1
    assert message in capsys.readouterr().err
