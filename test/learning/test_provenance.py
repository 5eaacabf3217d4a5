"""Every leaf of a learned tree can be followed back to rows of files."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import strategies as some
from hypothesis import given

from rebt_ros.behavior_tree import document, nodes, paths
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.policy import Policy
from rebt_ros.offline.learning_from_files import learn
from rebt_ros.verification import tracing
from rebt_ros.verification.acting import acting_leaves
from rebt_ros.verification.tracing import trace_leaves


def write(path: Path, shift: float, *, stamped: bool) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow((*(["stamp"] * stamped), "front", "action"))
        for row in range(60):
            front = round(abs(row - 30) / 10 + shift, 3)
            action = "go" if front > 1.5 else "turn" if front > 0.6 else "stop"
            table.writerow((*([10**18 + row * 10**8] * stamped), front, action))
    return path


def provenance(out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((out / "summary.json").read_text())["provenance"]
    return found


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize(
    "options", [LearnOptions(), LearnOptions(refit=False)], ids=["all", "known"]
)
def test_a_leaf_is_followed_back_to_rows_of_a_file(
    tmp_path: Path, stamped: bool, options: LearnOptions
) -> None:
    # Two of the files have one name.
    files = [tmp_path / name / "run.csv" for name in "abc"]
    for number, file in enumerate(files):
        write(file, number / 50, stamped=stamped)
    learn(files, out=tmp_path / "out", options=options)
    learned = document.loads((tmp_path / "out" / "tree.json").read_text())
    (channel,) = provenance(tmp_path / "out")
    actions = [path for path, node in paths.walk(learned.tree) if isinstance(node, nodes.Action)]
    assert [tuple(leaf["path"]) for leaf in channel["leaves"]] == actions
    rows = sum(leaf["rows"] for leaf in channel["leaves"])
    assert rows + channel["rows_without_leaf"] == channel["rows"]
    assert channel["rows"] == learned.provenance.rows
    followed = 0
    for leaf in channel["leaves"]:
        assert leaf["stretches"]
        assert sum(leaf["actions"].values()) == leaf["rows"]
        for stretch in leaf["stretches"]:
            with Path(stretch["file"]).open(newline="") as file:
                lines = list(csv.DictReader(file))
            its = lines[stretch["row"] : stretch["row"] + stretch["rows"]]
            if stamped:
                stamps = [int(line["stamp"]) for line in its]
                assert (stamps[0], stamps[-1]) == (stretch["first_stamp"], stretch["last_stamp"])
                assert stretch["seconds"] == pytest.approx(stretch["row"] / 10)
            else:
                assert (stretch["first_stamp"], stretch["seconds"]) == (stretch["row"], None)
            policy = Policy(learned)
            for line in its:
                assert line["action"] in leaf["actions"]
                policy.reset()
                assert policy.act([float(line["front"])]) == leaf["action"]
                followed += 1
    assert followed


@given(some.tables(), some.rule_trees())
def test_every_row_is_that_of_one_leaf_or_of_none(
    table: DemonstrationTable, tree: nodes.Node
) -> None:
    rows = np.ones(len(table), dtype=bool)
    traced = trace_leaves(tree, table, table, rows, (7,))
    acting = acting_leaves(tree, table)
    assert traced.rows == len(table)
    assert traced.without == np.count_nonzero(acting < 0)
    assert [leaf.support.rows for leaf in traced.leaves] == [
        np.count_nonzero(acting == number) for number in range(len(traced.leaves))
    ]
    for number, leaf in enumerate(traced.leaves):
        assert paths.node_at(tree, leaf.path[1:]) == leaf.action
        assert bool(leaf.stretches) == bool(leaf.support.rows)
        assert len(leaf.stretches) <= tracing.MOST_STRETCHES
        seen = set[int]()
        for stretch in leaf.stretches:
            demonstration = table.demonstrations.index(stretch.demonstration)
            first = int(np.searchsorted(table.demonstration, demonstration)) + stretch.row
            part = range(first, first + stretch.rows)
            assert (acting[part] == number).all()
            assert (table.demonstration[part] == demonstration).all()
            assert not seen & set(part)
            seen.update(part)
        if len(leaf.stretches) < tracing.MOST_STRETCHES:
            assert len(seen) == leaf.support.rows


def test_of_very_many_leaves_one_stretch_of_each_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    states = [(float(row % 3), 0.0, 0.0, 0.0) for row in range(12)]
    table = some.table(states, [row % 3 for row in range(12)])
    tree = nodes.Selector((some.ACTIONS[0], some.ACTIONS[1]))
    rows = np.arange(12) % 3 != 1
    for many, named in ((250, 5), (1, 1)):
        monkeypatch.setattr(tracing, "MANY_LEAVES", many)
        first, second = trace_leaves(tree, table, table.where(rows), rows).leaves
        assert (first.support.rows, len(first.stretches)) == (8, named)
        assert (second.support.rows, second.stretches) == (0, ())
