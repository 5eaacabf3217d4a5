"""The ``experiment`` command on small configurations: what it writes, resumes and refuses."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from rebt_ros import workers
from rebt_ros.behavior_tree import nodes
from rebt_ros.commands import experiment
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.errors import OptionError
from rebt_ros.study import experiment as study_experiment
from rebt_ros.study.configurations import Lost, configuration_paths, read_where_possible
from rebt_ros.study.experiment import run_experiment
from rebt_ros.study.mode import Mode
from rebt_ros.study.settings import Settings
from rebt_ros.study.simulator.configuration import ExperimentConfig

MODULE = "rebt_ros.commands.experiment"
SETTINGS = Settings(ticks=200)

#: So many configurations that a run of them is stopped before its end, however late it is stopped.
MANY = 150


def condition(variable: str) -> dict[str, Any]:
    return {"name": variable, "type_": "condition", "target_state": variable, "threshold": 0.5}


def action(label: str) -> dict[str, Any]:
    return {"name": label, "type_": "action"}


def group(kind: str, *children: Any) -> dict[str, Any]:
    return {"name": kind, "type_": kind, "child_list": list(children)}


def fetch(number: int) -> dict[str, Any]:
    """A tree with a Repeater, and a PSA node."""
    return group(
        "sequence",
        group("repeater", condition(f"x{number}"), action("reach"), action("grasp")),
        group("sequence", condition("y"), group("parsel", action("lift"), action("nod"))),
    )


@pytest.fixture
def configurations(tmp_path: Path) -> Path:
    folder = tmp_path / "configurations"
    folder.mkdir()
    for number in (2, 10, 9):
        (folder / f"expr{number}.json").write_text(json.dumps(fetch(number)))
    return folder


def copies(configurations: Path, count: int) -> None:
    """Makes it so many configurations, all different."""
    for number in range(100, 100 + count - len(list(configurations.iterdir()))):
        (configurations / f"expr{number}.json").write_text(json.dumps(fetch(number)))


@contextmanager
def started(*arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    """The command, with a group of processes for itself; killed in the end."""
    running = subprocess.Popen(
        [sys.executable, "-m", MODULE, *map(str, arguments), "--ticks", str(SETTINGS.ticks)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield running
    finally:
        with suppress(ProcessLookupError):
            running.kill()
        running.wait()


def wait_for(condition: Callable[[], bool], running: subprocess.Popen[str] | None = None) -> None:
    deadline = time.monotonic() + 90
    while not condition():
        assert running is None or running.poll() is None, "it ended before"
        assert time.monotonic() < deadline
        time.sleep(0.05)


def group_exists(group: int) -> bool:
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, found, *_ = path.read_text().rpartition(")")[2].split()
            if int(found) == group and state != "Z":
                return True
    return False


def report(directory: Path) -> dict[str, Any]:
    """The report without what a clock measured."""
    value: dict[str, Any] = json.loads((directory / "report.json").read_text())
    assert value.pop("seconds") >= 0
    assert value.pop("seconds_of_configurations") > 0
    return value


def test_all_figures_are_written_and_printed(
    configurations: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    experiment.main(
        [str(configurations), "--out", str(out), "--ticks", str(SETTINGS.ticks), "--jobs", "1"]
    )
    printed = capsys.readouterr().out
    found = report(out)
    assert set(found["modes"]) == {"baseline", "paper", "default"}
    for figures in found["modes"].values():
        assert figures["subtrees"] == 6
        assert figures["wins"] + figures["ties"] + figures["losses"] == 6
        assert figures["repeater"][1] == 3
        assert figures["psa"][1] == 3
        assert 0 <= figures["exact"] <= 6
        assert figures["offered"]["maximum"] > 0
        for reduction in ("node_reduction", "node_reduction_with_inverters"):
            assert {"median", "maximum", "share_reduced"} <= set(figures[reduction])
        assert figures["mismatches"] == 0
        assert 0 <= figures["own_history_agreement"] <= 1
    assert found["modes"]["default"]["suggestions"]["maximum"] <= 12
    assert found["lost_configurations"] == []
    assert found["seed"] == 0
    assert {"python", "numpy", "scikit-learn", "rebt_ros"} <= set(found["versions"])
    assert found["paper"]["repeater"] == [106, 125]
    lines = list(csv.DictReader((out / "report.csv").read_text().splitlines()))
    assert len(lines) == 6 * 3
    assert [line["configuration"] for line in lines[::6]] == ["expr2", "expr9", "expr10"]
    wins = sum(line["mode"] == "default" and line["outcome_of_minimum"] == "win" for line in lines)
    assert wins == found["modes"]["default"]["wins"]
    assert "106 of 125" in printed
    assert "3 of 3 configurations" in printed
    assert "<svg" in (out / "index.html").read_text()


def test_what_is_finished_is_not_run_again(
    configurations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, straight = tmp_path / "out", tmp_path / "straight"
    run_experiment(configurations, out, SETTINGS, experiment.Chosen(limit=2), jobs=1)
    ran = []

    def attempt(config: ExperimentConfig, settings: Settings) -> Any:
        ran.append(config.name)
        return original(config, settings)

    original = study_experiment.attempt
    monkeypatch.setattr(study_experiment, "attempt", attempt)
    run_experiment(configurations, out, SETTINGS, jobs=1)
    assert ran == ["expr10"]
    run_experiment(configurations, straight, SETTINGS, jobs=1)
    assert report(out) == report(straight)
    # A configuration that is another one by now is run again.
    (configurations / "expr9.json").write_text(json.dumps(fetch(3)))
    ran.clear()
    run_experiment(configurations, out, SETTINGS, jobs=1)
    assert ran == ["expr9"]


def test_results_of_other_options_are_not_mixed(configurations: Path, tmp_path: Path) -> None:
    some = experiment.Chosen(("expr9",))
    run_experiment(configurations, tmp_path / "out", SETTINGS, some, jobs=1)
    before = report(tmp_path / "out")
    with pytest.raises(OptionError, match=r"other options or versions \(seed 0 instead of 1\)"):
        run_experiment(
            configurations, tmp_path / "out", Settings(ticks=SETTINGS.ticks, seed=1), some
        )
    assert report(tmp_path / "out") == before


def test_a_configuration_that_fails_is_lost_and_does_not_stop_the_others(
    configurations: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from rebt_ros.study import running

    original = running.run_configuration

    def fails_for_one(config: ExperimentConfig, settings: Settings) -> Any:
        if config.name == "expr9":
            raise ZeroDivisionError("division by zero")
        return original(config, settings)

    monkeypatch.setattr(running, "run_configuration", fails_for_one)
    (configurations / "expr1.json").write_text("{")
    idle = group("sequence", condition("x"), action("never"))
    idle["child_list"][0]["threshold"] = -1
    (configurations / "expr3.json").write_text(json.dumps(idle))
    out = tmp_path / "out"
    experiment.main(
        [str(configurations), "--out", str(out), "--ticks", str(SETTINGS.ticks), "--jobs", "1"]
    )
    lost = {one["configuration"]: one["reason"] for one in report(out)["lost_configurations"]}
    assert list(lost) == ["expr1", "expr3", "expr9"]
    assert "is not JSON" in lost["expr1"]
    assert "did nothing in 200 ticks" in lost["expr3"]
    assert lost["expr9"] == "ZeroDivisionError: division by zero"
    assert "expr9 is lost: ZeroDivisionError: division by zero" in capsys.readouterr().out


def test_rows_where_a_tree_differs_from_the_decision_tree_are_counted(
    configurations: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rebt_ros.study import running

    original = running.plain_tree

    def reaches_only(mode: Mode, tree: DecisionTree, main: nodes.Node) -> nodes.Node:
        if mode is Mode.PAPER:
            return nodes.Action("reach", DEFAULT_CHANNEL)
        return original(mode, tree, main)

    monkeypatch.setattr(running, "plain_tree", reaches_only)
    (config, *_), _ = read_where_possible(configuration_paths(configurations))
    result = running.run_configuration(config, SETTINGS)
    compared = len(result.modes[Mode.PAPER].sizes)
    assert 0 < result.modes[Mode.PAPER].mismatches < compared * result.rows
    assert result.modes[Mode.DEFAULT].mismatches == 0


def test_a_configuration_of_one_action_is_not_compared_and_not_lost(
    configurations: Path, tmp_path: Path
) -> None:
    single = group("sequence", group("sequence", condition("x"), action("reach")))
    (configurations / "expr1.json").write_text(json.dumps(single))
    run_experiment(configurations, tmp_path / "out", SETTINGS, jobs=1)
    found = report(tmp_path / "out")
    assert found["lost_configurations"] == []
    assert found["not_comparable"] == 1
    assert found["configurations"] == 4
    assert found["modes"]["default"]["subtrees"] == 6


def test_a_worker_of_other_versions_is_refused(
    configurations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rebt_ros.study import running

    monkeypatch.setattr(running, "fingerprint", lambda settings: "another")
    with pytest.raises(OptionError, match="other versions"):
        run_experiment(configurations, tmp_path / "out", SETTINGS, jobs=1)


def test_a_killed_run_leaves_no_process_and_is_resumed_to_the_same_report(
    configurations: Path, tmp_path: Path
) -> None:
    copies(configurations, MANY)
    out, straight = tmp_path / "out", tmp_path / "straight"
    with started(configurations, "--out", out, "--jobs", "2") as running:
        wait_for(lambda: any((out / "results").glob("*.json")), running)
        running.kill()
    wait_for(lambda: not group_exists(running.pid))
    assert not (out / "report.json").exists()
    kept = {path: path.read_bytes() for path in (out / "results").glob("*.json")}
    assert 1 <= len(kept) < MANY
    # A few of the others are enough.
    others = [path for path in configurations.iterdir() if out / "results" / path.name not in kept]
    for path in others[3:]:
        path.unlink()
    run_experiment(configurations, out, SETTINGS, jobs=1)
    assert {path: path.read_bytes() for path in kept} == kept
    run_experiment(configurations, straight, SETTINGS, jobs=1)
    assert report(out) == report(straight)
    for name in ("report.csv", "index.html"):
        assert (out / name).read_bytes() == (straight / name).read_bytes()


def test_ctrl_c_keeps_what_is_finished_and_leaves_no_process(
    configurations: Path, tmp_path: Path
) -> None:
    copies(configurations, MANY)
    out = tmp_path / "out"
    with started(configurations, "--out", out, "--jobs", "2") as running:
        wait_for(lambda: any((out / "results").glob("*.json")), running)
        # As in a terminal, all its processes get the signal.
        os.killpg(running.pid, signal.SIGINT)
        _, errors = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "Traceback" not in errors
    wait_for(lambda: not group_exists(running.pid))
    assert any((out / "results").glob("*.json"))
    assert not (out / "report.json").exists()


def test_a_dask_cluster_of_two_processes_gives_the_same_results(
    configurations: Path, tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed")
    alone, together = tmp_path / "alone", tmp_path / "together"
    settings = Settings(ticks=SETTINGS.ticks, networkx_pairs=1, pair_seconds=60)
    two = experiment.Chosen(limit=2)
    run_experiment(configurations, alone, settings, two, jobs=1)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        found = run_experiment(
            configurations, together, settings, two, scheduler=cluster.scheduler_address
        )
    assert len(found.results) == 2
    assert report(together) == report(alone)
    assert (together / "report.csv").read_bytes() == (alone / "report.csv").read_bytes()
    assert report(alone)["measure"]["networkx_tried"] == 2
    assert report(alone)["measure"]["at_most_networkx"] == [2, 2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{empty}"], "has no configuration files"),
        (["{configurations}", "--jobs", "0"], "jobs is 0"),
        (["{configurations}", "--ticks", "0"], "ticks is 0"),
        (["{configurations}", "--limit", "0"], "the limit is 0"),
        (["{configurations}", "--configs", "expr9,expr7"], "no configuration 'expr7'"),
        (["{configurations}", "--networkx-pairs", "-1"], "networkx_pairs is -1"),
        (["{configurations}", "--pair-seconds", "nan"], "pair_seconds is nan"),
        (["{configurations}", "--scheduler", "here"], "the scheduler 'here' is no address"),
        (["{configurations}", "--scheduler", "tcp://127.0.0.1:9"], "no Dask scheduler answers"),
    ],
)
def test_bad_arguments_get_one_sentence(
    arguments: list[str],
    message: str,
    configurations: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "_PATIENCE", 1.0)
    if "--scheduler" in arguments:
        pytest.importorskip("distributed")
    empty = tmp_path / "empty"
    empty.mkdir()
    given = [one.format(empty=empty, configurations=configurations) for one in arguments]
    with pytest.raises(SystemExit) as ended:
        experiment.main([*given, "--out", str(tmp_path / "out")])
    assert ended.value.code == 1
    errors = capsys.readouterr().err
    assert errors.startswith("experiment: ")
    assert message in errors


def test_without_distributed_a_cluster_is_refused_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch, configurations: Path, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(workers.WorkerError, match="pip install distributed"):
        run_experiment(configurations, tmp_path, SETTINGS, scheduler="tcp://127.0.0.1:9")


def test_when_nothing_is_left_to_report_the_first_reason_is_given(
    configurations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        study_experiment, "attempt", lambda config, _: Lost(config.name, "it broke")
    )
    with pytest.raises(Exception, match="nothing to report: it broke"):
        run_experiment(configurations, tmp_path, SETTINGS, jobs=1)
