"""The command `simulate`: its table and its bag are the simulation, row for row."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from rebt_ros.commands.simulate import main
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.fields import Dimension, dimension_labels_of, fields_of
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import tabulate
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.offline import learning_from_files as offline
from rebt_ros.storage.inputs import load
from rebt_ros.study.simulator.configuration import Act, Check, Group, GroupKind, Inverted
from rebt_ros.study.simulator.configuration_file import format_config, parse_config
from rebt_ros.study.simulator.synthetic_robot import ExperimentRobot, SimulatedRun, simulate

SEQUENCE, SELECTOR, PARALLEL = GroupKind.SEQUENCE, GroupKind.SELECTOR, GroupKind.PARALLEL
X, Y = Check("/x", 0.6, 0.9), Check("/y", 0.3)

#: Every kind of node, with conditions and actions that err.
TREE = Group(
    PARALLEL,
    (
        Group(
            GroupKind.REPEATER,
            (Group(SELECTOR, (Inverted(X), Y)), Act("grab, then turn"), Act("b")),
        ),
        Group(
            SEQUENCE,
            (Y, Group(GroupKind.PARALLEL_SELECTOR, (Act("b", 0.7), Act("c"))), Act('say "ö"')),
        ),
    ),
)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return write(tmp_path, TREE)


def write(directory: Path, root: Group, name: str = "tree") -> Path:
    path = directory / f"{name}.json"
    path.write_text(format_config(root), encoding="utf-8")
    return path


def run(*arguments: str | Path) -> None:
    main(list(map(str, arguments)))


def in_memory(path: Path, seed: int, ticks: int, **options: Any) -> SimulatedRun:
    read = parse_config(path.read_text(encoding="utf-8"), path.stem)
    return simulate(ExperimentRobot(read, seed, **options), ticks)


def rows(shown: Demonstration) -> list[tuple[int, str, list[float]]]:
    labels = [shown.actions[code] for code in shown.chosen.tolist()]
    return list(zip(shown.stamps.tolist(), labels, shown.states.tolist(), strict=True))


BAG_TOPICS = ("/state", "/action", "/outcome")


def messages(bag: Path, topic: str) -> list[tuple[int, Any]]:
    """Stamp and message of everything on a topic."""
    types = get_typestore(Stores.ROS2_JAZZY)
    with Reader(bag) as reader:
        return [
            (stamp, types.deserialize_cdr(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
            if connection.topic == topic
        ]


def demonstration(path: Path) -> Demonstration:
    (shown,) = load([path]).demonstrations
    return shown


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_table_the_bag_and_the_simulation_are_the_same_row_for_row(
    config: Path, tmp_path: Path, storage: str
) -> None:
    out = tmp_path / "out"
    run(config, "--ticks", "1500", "--seed", "8", "--out", out, "--bag", storage)
    simulated = in_memory(config, 8, 1500).demonstration
    table, bag = demonstration(out / "table.csv"), demonstration(out / "bag")
    assert len(simulated) > 500
    assert rows(table) == rows(bag) == rows(simulated)
    for one in (table, bag):
        assert [feature.name for feature in one.features] == ["/x", "/y"]
    tables = [tabulate([one])[0] for one in (simulated, table, bag)]
    for other in tables[1:]:
        assert other.actions == tables[0].actions
        for column in ("states", "chosen", "last", "stamps"):
            np.testing.assert_array_equal(getattr(other, column), getattr(tables[0], column))


def test_the_bag_has_the_state_of_every_tick_and_every_outcome(
    config: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run(config, "--ticks", "50", "--out", out, "--bag")
    assert (out / "bag" / "bag.mcap").is_file()
    states, actions, outcomes = (messages(out / "bag", name) for name in BAG_TOPICS)
    ticks: list[tuple[int, list[float]]] = []
    robot = ExperimentRobot(parse_config(config.read_text(encoding="utf-8"), "tree"), 0)
    result = simulate(robot, 50, watch=lambda stamp, state, _: ticks.append((stamp, list(state))))
    assert [(stamp, one.data.tolist()) for stamp, one in states] == ticks
    assert [one.data for _, one in outcomes] == result.succeeded.tolist()
    assert [stamp for stamp, _ in outcomes] == [stamp for stamp, _ in actions]
    assert {stamp for stamp, _ in actions} <= {stamp for stamp, _ in states}


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_equal_seeds_give_equal_bytes(config: Path, tmp_path: Path, storage: str) -> None:
    def files(name: str, seed: int) -> dict[str, bytes]:
        out = tmp_path / name
        run(config, "--ticks", "400", "--seed", str(seed), "--out", out, "--bag", storage)
        found = (path for path in sorted(out.rglob("*")) if path.is_file())
        return {str(path.relative_to(out)): path.read_bytes() for path in found}

    first, again, other = files("a", 1), files("b", 1), files("c", 2)
    assert first == again
    assert set(first) >= {"table.csv", "summary.json", "bag/metadata.yaml"}
    assert first["table.csv"] != other["table.csv"]


def test_outcome_and_clock_are_in_the_table_but_are_no_features(
    config: Path, tmp_path: Path
) -> None:
    run(config, "--ticks", "600", "--out", tmp_path)
    result = in_memory(config, 0, 600)
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        records = list(csv.DictReader(file))
    assert list(records[0]) == ["stamp", "/x", "/y", "action.outcome", "action"]
    outcomes = [record["action.outcome"] == "success" for record in records]
    assert outcomes == result.succeeded.tolist()
    assert 0 < sum(outcomes) < len(outcomes)
    assert [int(record["stamp"]) for record in records] == result.demonstration.stamps.tolist()


def test_learn_reads_the_table_as_it_is(tmp_path: Path) -> None:
    tree = Group(SEQUENCE, (Group(SELECTOR, (Y, Inverted(Check("/x", 0.6)))), Act("a"), Act("b")))
    run(write(tmp_path, tree), "--ticks", "300", "--out", tmp_path / "out")
    options = LearnOptions(history=History.NONE, psa=Use.NEVER, max_depth=3, ccp_alpha=0.0)
    learned = offline.learn([tmp_path / "out" / "table.csv"], options=options).learned
    assert [feature.name for feature in learned.features] == ["/x", "/y"]
    assert sorted(action.label for action in learned.actions) == ["a", "b"]


def test_settings_hold_and_are_written_down(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ("--ticks", "300", "--seed", "-3", "--running-chance", "0.1", "--repeats", "2")
    run(config, *settings, "--out", tmp_path)
    result = in_memory(config, -3, 300, running_chance=0.1, repeats=2)
    assert rows(demonstration(tmp_path / "table.csv")) == rows(result.demonstration)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["configuration"] == "tree"
    assert (summary["ticks"], summary["seed"]) == (300, -3)
    assert (summary["running_chance"], summary["repeats"]) == (0.1, 2)
    assert summary["rows"] == len(result.demonstration)
    assert sum(one["done"] for one in summary["actions"].values()) == summary["rows"]
    assert sum(one["succeeded"] for one in summary["actions"].values()) == result.succeeded.sum()
    assert f"tree: 300 ticks, {summary['rows']} actions." in capsys.readouterr().out


def test_nodes_without_meaning_are_skipped_with_a_warning_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    value = json.loads(format_config(TREE))
    value["child_list"].append({"name": "DEFAULT", "type_": "DEFAULT"})
    (tmp_path / "tree.json").write_text(json.dumps(value))
    run(tmp_path / "tree.json", "--ticks", "20", "--out", tmp_path)
    assert capsys.readouterr().err == (
        "warning: tree: the root.child_list[2] has type DEFAULT and is skipped.\n"
    )
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["notes"] == ["tree: the root.child_list[2] has type DEFAULT and is skipped"]


def test_a_configuration_without_conditions_gets_a_state_that_no_node_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    path = write(tmp_path, Group(SEQUENCE, (Act("a"), Act("b"))))
    run(path, "--ticks", "100", "--out", out, "--bag", "mcap")
    assert "tree has no conditions" in capsys.readouterr().out
    for source in (out / "table.csv", out / "bag"):
        assert [feature.name for feature in demonstration(source).features] == ["/unread"]


def test_actions_that_are_never_done_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, Group(SEQUENCE, (Act("a"), Check("/x", -1.0), Act("b"))))
    run(path, "--ticks", "30", "--out", tmp_path)
    assert "note: never done: b.\n" in capsys.readouterr().out


def test_names_with_commas_survive_table_and_bag(tmp_path: Path) -> None:
    names = ["left, front", "right"]
    tree = Group(SEQUENCE, (*(Check(name, 0.9) for name in names), Act("a")))
    run(write(tmp_path, tree), "--ticks", "50", "--out", tmp_path, "--bag", "mcap")
    for source in (tmp_path / "table.csv", tmp_path / "bag"):
        assert [feature.name for feature in demonstration(source).features] == names
    assert fields_of([*map(Dimension, dimension_labels_of(names))], 2) == tuple(names)


@pytest.mark.parametrize("again", [(), ("--bag", "mcap")])
def test_a_bag_that_is_there_is_not_touched(
    config: Path, tmp_path: Path, again: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "out" / "bag"
    bag.mkdir(parents=True)
    (bag / "mine").write_text("precious")
    with pytest.raises(SystemExit) as exited:
        run(config, "--ticks", "20", "--out", tmp_path / "out", *again)
    assert exited.value.code == 1
    assert f"{bag} exists already: remove it" in capsys.readouterr().err
    assert [path.name for path in bag.iterdir()] == ["mine"]
    assert not (tmp_path / "out" / "table.csv").exists()


def test_other_files_of_the_directory_stay(config: Path, tmp_path: Path) -> None:
    (tmp_path / "tree.csv").write_text("mine")
    run(config, "--ticks", "20", "--out", tmp_path)
    run(config, "--ticks", "30", "--out", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "tree.json",
        "tree.csv",
        "table.csv",
        "summary.json",
    }
    assert (tmp_path / "tree.csv").read_text() == "mine"
    assert rows(demonstration(tmp_path / "table.csv")) == rows(
        in_memory(config, 0, 30).demonstration
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--ticks", "0"), "simulate: ticks is 0: simulate at least 1.\n"),
        (("--repeats", "0"), "simulate: repeats is 0: it must be at least 1.\n"),
        (
            ("--running-chance", "1"),
            "simulate: the running chance is 1: it must be at least 0 and below 1.\n",
        ),
    ],
)
def test_settings_that_make_no_sense_are_one_sentence_and_leave_nothing(
    config: Path,
    tmp_path: Path,
    arguments: tuple[str, ...],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as exited:
        run(config, *arguments, "--out", tmp_path / "out", "--bag", "sqlite3")
    assert exited.value.code == 1
    assert capsys.readouterr().err == message
    out = tmp_path / "out"
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.parametrize(
    ("root", "message"),
    [
        (Group(SEQUENCE, (Check("/x", 0.5),)), "simulate: tree has no action: "),
        (
            Group(SEQUENCE, (Check("stamp", 0.5), Act("a"))),
            "simulate: tree: 'stamp' is the name of a column that every table has: ",
        ),
    ],
)
def test_trees_that_cannot_become_a_table_are_refused(
    tmp_path: Path, root: Group, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, root)
    with pytest.raises(SystemExit):
        run(path, "--ticks", "20", "--out", tmp_path / "out", "--bag", "mcap")
    assert capsys.readouterr().err.startswith(message)
    out = tmp_path / "out"
    assert not out.exists() or not list(out.iterdir())


def test_a_place_that_cannot_be_written_is_one_sentence(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    for bag in ((), ("--bag", "mcap")):
        with pytest.raises(SystemExit) as exited:
            run(config, "--ticks", "20", "--out", tmp_path / "file", *bag)
        assert exited.value.code == 2
        assert "file is no directory: name another place" in capsys.readouterr().err
