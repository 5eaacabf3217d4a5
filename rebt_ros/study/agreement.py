"""Own-history agreement of a mode's main tree on rows that it was not learned from.

The first half of the rows is learned from, the third quarter chooses the pruning level, and for the
default whether the tree may test LAT, and the last quarter judges the choice.  All modes are judged
alike; suggestions are not attached, as somebody would have to choose them.

Where several actions are done in one state, as the streams of a Parallel root do, no tree can agree
with all of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning import evaluation
from rebt_ros.study.mode import Mode
from rebt_ros.study.mode_trees import main_tree
from rebt_ros.study.results import Agreement
from rebt_ros.study.settings import MAX_DEPTH

#: Of more pruning levels, so many are tried, evenly spread.
_MOST_LEVELS = 8


def held_out_agreements(table: DemonstrationTable) -> dict[Mode, Agreement]:
    """The agreement of each mode on the last quarter of the rows.

    Returns:
        Nothing for fewer than two actions or eight rows.
    """
    if len(table.actions) < 2 or len(table) < 8:
        return {}
    part = np.arange(len(table)) * 4 // len(table)
    shown, choosing, judging = (table.where(rows) for rows in (part < 2, part == 2, part == 3))
    found = {}
    for mode in Mode:
        best = max(_trees(mode, shown), key=lambda tree: _right(tree, choosing))
        found[mode] = Agreement(_right(best, judging), len(judging))
    return found


def _trees(mode: Mode, table: DemonstrationTable) -> Iterator[nodes.Node]:
    """The main trees to choose from, the smallest first."""
    for history in (History.NONE, History.LAST) if mode is Mode.DEFAULT else (History.LAST,):
        fitted = fit(table, FitOptions(vocabulary=Vocabulary(history), max_depth=MAX_DEPTH))
        alphas = fitted.path.alphas
        even = np.linspace(0, len(alphas) - 1, min(len(alphas), _MOST_LEVELS)).astype(int)
        for alpha in reversed(alphas[even].tolist()):
            yield main_tree(mode, fitted.at(alpha))


def _right(tree: nodes.Node, rows: DemonstrationTable) -> int:
    return int(np.sum(evaluation.own_history_choices(tree, rows) == rows.chosen))
