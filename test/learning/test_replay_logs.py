"""What a replay writes for Groot2 is what the tree did in each row."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import pytest
import strategies as some

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.errors import RebtError
from rebt_ros.export.watched import watched
from rebt_ros.logic.conditions import Literal, PreviousActionIs
from rebt_ros.storage.btlog import read_btlog

#: Goes and turns by turns; it begins with going.
TREE = some.learned(
    nodes.Selector(
        (some.when(Literal(PreviousActionIs("go")), then=some.action("turn")), some.action("go"))
    )
)


def _tables(directory: Path, *lengths: int) -> list[Path]:
    paths = [directory / f"{number}.csv" for number in range(len(lengths))]
    for path, length in zip(paths, lengths, strict=True):
        rows = "".join(f"0.5,{('go', 'turn')[row % 2]}\n" for row in range(length))
        path.write_text(f"distance,action\n{rows}")
    return paths


def test_each_row_has_the_statuses_that_the_tree_had_and_demonstrations_begin_anew(
    tmp_path: Path,
) -> None:
    path = tmp_path / "logs" / "one.btlog"
    tables = _tables(tmp_path, 3, 2)
    [result] = rebt_ros.replay(TREE, tables, btlog=path)
    assert result.own_history_agreement == 1.0
    log, names = read_btlog(path), {node.uid: node.name for node in watched(TREE).nodes}
    assert log.xml == watched(TREE).xml
    statuses: dict[str, int] = {}
    seen = []
    for at, changes in groupby(log.transitions, key=lambda one: one.microseconds):
        statuses |= {names[one.uid]: one.status for one in changes}
        seen.append((at / 1e6, statuses.get("go", 0), statuses.get("turn", 0)))
    assert seen == [
        (0.0, 2, 0),
        (0.1, 0, 2),
        (0.2, 2, 0),
        # Idle between demonstrations.
        (1.2, 0, 0),
        (2.2, 2, 0),
        (2.3, 0, 2),
    ]


def test_a_log_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(RebtError, match="cannot be written"):
        rebt_ros.replay(TREE, _tables(tmp_path, 2), btlog=tmp_path)
