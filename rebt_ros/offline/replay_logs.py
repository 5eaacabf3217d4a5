"""What every node of a tree did in recorded rows, as a log for Groot2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.export.watched import watched
from rebt_ros.learning.evaluation import ticks
from rebt_ros.learning.late_actions import tells_time
from rebt_ros.learning.replaying import rows_for
from rebt_ros.storage.btlog import BtLogWriter, Transition

#: Between rows that have no times, and between demonstrations (microseconds).
_ROW = 100_000
_PAUSE = 1_000_000


def write_btlog(learned: LearnedTree, demonstrations: Sequence[Demonstration], path: Path) -> None:
    """Runs a tree over recorded rows, and writes each change of a node's status.

    The tree has its own history, which begins anew with each demonstration.  Between two of them
    all nodes are idle for a second.  Rows of a table without times are a tenth of a second apart.
    Where several channels were recorded, the tree is ticked in the rows of the one with the most.

    Args:
        learned: The tree.
        demonstrations: What was recorded.
        path: The file, which is replaced.

    Raises:
        RebtError: The recording does not fit the tree, or the file cannot be written.
    """
    table = max(rows_for(learned, demonstrations), key=len)
    tree, runtime = watched(learned), TreeRuntime(learned, tree=executable(learned.tree))
    times, idle = _times(table), dict[int, str]()
    before: Mapping[int, str] = idle
    began = int(table.stamps[0]) // 1000
    with BtLogWriter(path, tree.xml, began) as log:

        def note(at: int, outcomes: Mapping[int, str]) -> None:
            nonlocal before
            log.write(
                Transition(at, node.uid, status)
                for node, _, status in tree.changes(before, outcomes)
            )
            before = outcomes

        for row, (starts, _) in enumerate(ticks(runtime, table)):
            if starts and row:
                note(times[row] - _PAUSE, idle)
            note(times[row], runtime.outcomes())


def _times(table: DemonstrationTable) -> list[int]:
    """When each row is ticked, from 0; microseconds."""
    gaps = np.diff(table.stamps) // 1000 if tells_time(table) else np.full(len(table) - 1, _ROW)
    ends = np.diff(table.demonstration) != 0
    gaps = np.where(ends, 2 * _PAUSE, np.maximum(gaps, 0))
    return list(accumulate(gaps.tolist(), initial=0))
