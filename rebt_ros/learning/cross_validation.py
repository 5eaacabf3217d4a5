"""Cross-validation of pruning levels.

recall
    The recall of an action is the share of its rows on which a tree takes it, among rows that the
    tree was not learned from.

A level is judged by its mean recall over all actions: an action that is rare but decisive counts as
much as a frequent one (see `judged_levels`).  Rows count by the weights of their demonstrations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.decision_tree.counting import fit_parts_by_sample
from rebt_ros.decision_tree.fitted import FittedTree, TrainedTree
from rebt_ros.decision_tree.training import PLAIN, FitOptions, fit_parts
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.evaluation import decision_tree_choices
from rebt_ros.learning.judged_levels import JudgedLevels

MOST_FOLDS = 5
#: Number of folds of large tables, each of which has enough rows.
_FEW_FOLDS, _MANY_ROWS = 3, 8_000
#: A tree that may test LAT must be converted and run over the rows to be judged: the maximum number
#: of levels for which this is done, and of leaves, beyond which nobody could read a tree anyway.
_MOST_LEVELS_RUN, _MOST_LEAVES_RUN = 12, 32

#: What the behavior tree of a pruned decision tree chooses in the rows of a table, after its own
#: choices in earlier rows: positions in the table's actions.
Choices = Callable[[TrainedTree, DemonstrationTable], IntArray]


class CrossValidation:
    """A fit to all rows, and one to the rows outside each fold, with all their pruning levels.

    The ``ccp_alpha`` of a level stands for the range up to the next one; the trees of the folds are
    pruned at the geometric mean of this range.

    Args:
        table: At least two rows.
        options: How the trees are fitted; none is judged on made-up rows.
        step: Called after each fit, and after each fold in which trees were run.
        held_out: Rows that are in no fold, and that no fold's tree is fitted to, shape (rows,).
        grown_on: The rows that choose the splits, shape (rows,); None for all.
    """

    def __init__(
        self,
        table: DemonstrationTable,
        options: FitOptions = PLAIN,
        *,
        step: Callable[[], None] = lambda: None,
        held_out: BoolArray | None = None,
        grown_on: BoolArray | None = None,
    ) -> None:
        self._step = step
        self._actions = len(table.actions)
        inside = np.ones(len(table), dtype=bool) if held_out is None else ~held_out
        fold = np.full(len(table), -1)
        fold[inside] = folds(table.where(inside))
        numbers = np.unique(fold[inside])
        trees: list[FittedTree] = []
        # The largest first: no core then waits for the last one.
        parts = [
            *([] if held_out is None else [inside]),
            *(inside & (fold != number) for number in numbers),
        ]
        for tree in (
            fit_parts(table, parts, options)
            if grown_on is None
            else fit_parts_by_sample(table, parts, grown_on, options)
        ):
            trees.append(tree)
            step()
        self.of_all = trees[0]
        """The tree fitted to all rows."""
        self.fitted, *of_folds = trees if held_out is None else trees[1:]
        self._folds = [
            (tree, table.where(fold == number))
            for tree, number in zip(of_folds, numbers, strict=True)
        ]
        self._middles = self.fitted.path.middles

    def teacher_forced(self) -> JudgedLevels:
        """All levels, after the actions of the demonstrator."""
        hits = [fitted.hits(rows, self._middles) for fitted, rows in self._folds]
        return self._judged(self.fitted.path.alphas, hits)

    def levels(self, choices: Choices) -> JudgedLevels:
        """The levels to choose from: all, or an even selection if LAT is tested.

        Previous actions are those of the demonstrator.  LAT knows the action of its own row, so
        trees that test LAT are judged after their own choices.
        """
        if self.fitted.vocabulary.history is not History.LAST:
            return self.teacher_forced()
        small = np.flatnonzero(self.fitted.path.leaf_counts() <= _MOST_LEAVES_RUN)
        even = np.linspace(0, len(small) - 1, min(len(small), _MOST_LEVELS_RUN)).astype(int)
        run = small[np.unique(even)]
        hits = [self._run(place, self._middles[run], choices) for place in range(len(self._folds))]
        return self._judged(self.fitted.path.alphas[run], hits)

    def unpruned(self) -> JudgedLevels:
        """A single level: the unpruned trees of the folds, after their own choices."""
        unpruned = np.zeros(1)

        def choices(trained: TrainedTree, table: DemonstrationTable) -> IntArray:
            return decision_tree_choices(trained.predict, trained.vocabulary.history, table)

        hits = [self._run(place, unpruned, choices) for place in range(len(self._folds))]
        return self._judged(unpruned, hits)

    def own_history_at(self, ccp_alpha: float, choices: Choices) -> float:
        """Mean own-history agreement of the folds' trees at a level."""
        level = np.array([ccp_alpha])
        hits = [self._run(place, level, choices) for place in range(len(self._folds))]
        return float(self._judged(level, hits).means[0])

    @property
    def _shown(self) -> IntArray:
        counts = [rows.counts(rows.chosen, self._actions) for _, rows in self._folds]
        return np.array(counts)

    def _judged(self, ccp_alphas: FloatArray, hits: list[IntArray]) -> JudgedLevels:
        fitted = self.fitted
        level = np.searchsorted(fitted.path.alphas, ccp_alphas, side="right") - 1
        leaves, explanations = fitted.path.leaf_counts()[level], fitted.explanations[level]
        return JudgedLevels(ccp_alphas, np.array(hits), self._shown, leaves, explanations)

    def _run(self, fold: int, ccp_alphas: FloatArray, choices: Choices) -> IntArray:
        """The hits of a fold's trees at some levels, after their own choices."""
        fitted, rows = self._folds[fold]
        known: dict[bytes, IntArray] = {}
        found: list[IntArray] = []
        for ccp_alpha in ccp_alphas.tolist():
            # The levels are those of another tree; several of them may be one level of this tree.
            level = fitted.path.leaves_at(ccp_alpha).tobytes()
            if level not in known:
                right = choices(fitted.at(ccp_alpha), rows) == rows.chosen
                known[level] = rows.counts(rows.chosen[right], self._actions, right)
            found.append(known[level])
        self._step()
        return np.array(found)


def folds(table: DemonstrationTable) -> IntArray:
    """The fold of each row: whole demonstrations, or stretches of the only one, shape (rows,).

    Neighboring rows resemble each other, so a row whose neighbors were learned from says little.
    """
    most = MOST_FOLDS if len(table) < _MANY_ROWS else _FEW_FOLDS
    begins = table.begins
    shown = len(begins)
    if shown == 1:
        return np.arange(len(table)) * most // max(len(table), 1)
    fold = np.arange(shown) * min(most, shown) // max(shown, 1)
    return np.repeat(fold, np.diff(begins, append=len(table)))
