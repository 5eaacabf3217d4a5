"""Choosing a pruning level by cross-validation and the one-standard-error rule.

A level is judged by its agreement with rows that it was not learned from.  Of all levels within
one standard error of the best one, the smallest tree is chosen (Breiman et al., 1984): where the
folds cannot tell trees apart, the one that is easiest to read is the best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.decision_tree.training import FittedTree, TrainedTree, fit_parts
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.table import DemonstrationTable

MOST_FOLDS = 5
#: A LAT-augmented tree has to be converted and run through the rows to be judged: so many levels
#: are, and no larger trees than that, which nobody could read anyway.
_MOST_LEVELS_RUN, _MOST_LEAVES_RUN = 12, 32

#: What the behavior tree of a pruned decision tree chooses in the rows of a table after its own
#: choices in the rows before: positions in the table's actions.
Choices = Callable[[TrainedTree, DemonstrationTable], IntArray]


@dataclass(frozen=True, eq=False, slots=True)
class JudgedLevels:
    """Pruning levels with their agreement in each fold."""

    ccp_alphas: FloatArray
    """Ascending, shape (levels,): larger means a smaller tree."""
    scores: FloatArray
    """Agreement with the rows of each fold, shape (folds, levels)."""

    @property
    def means(self) -> FloatArray:
        """Mean agreement of each level, shape (levels,)."""
        return np.asarray(np.mean(self.scores, axis=0))

    @property
    def standard_errors(self) -> FloatArray:
        """Standard error of each mean, shape (levels,)."""
        folds = len(self.scores)
        if folds < 2:
            return np.zeros(self.scores.shape[1])
        return np.asarray(np.std(self.scores, axis=0, ddof=1) / np.sqrt(folds))

    @property
    def best(self) -> int:
        """The level with the highest mean."""
        return int(np.argmax(self.means))

    @property
    def chosen(self) -> int:
        """The smallest tree within one standard error of the best.

        The last level, which takes one action whatever happens, is not chosen unless it is best.
        """
        enough = self.means[self.best] - self.standard_errors[self.best]
        smallest = int(np.flatnonzero(self.means >= enough)[-1])
        return smallest if smallest < len(self.means) - 1 else max(self.best, smallest - 1)


class CrossValidation:
    """One fit to all rows and one to the rows outside each fold, all with their pruning levels.

    A level's ``ccp_alpha`` stands for the range up to the next one, at whose geometric middle the
    folds' trees are pruned.

    Args:
        table: At least two rows.
        last_action: Whether the trees may test LAT.
        max_depth: Splits on the longest path; None for no limit.
        random_state: Decides between equally good splits, and which rows are made up.
        upsample: Rows to fit the trees to beside those of the table; none is judged on them.
        step: Called after each tree that was fitted, and each fold in which trees were run.
    """

    def __init__(
        self,
        table: DemonstrationTable,
        *,
        last_action: bool,
        max_depth: int | None,
        random_state: int,
        upsample: Upsampling = Upsampling.NONE,
        step: Callable[[], None] = lambda: None,
    ) -> None:
        self._step = step
        fold = folds(table)
        numbers = np.unique(fold)
        trees: list[FittedTree] = []
        for tree in fit_parts(
            table,
            [fold != number for number in numbers],
            last_action=last_action,
            max_depth=max_depth,
            random_state=random_state,
            upsample=upsample,
        ):
            trees.append(tree)
            step()
        self.fitted, *of_folds = trees
        self._folds = [
            (tree, table.where(fold == number))
            for tree, number in zip(of_folds, numbers, strict=True)
        ]
        self._middles = _middles(self.fitted.path.alphas)

    def teacher_forced(self) -> JudgedLevels:
        """All levels with their teacher-forced agreement."""
        scores = [of_fold.agreements(rows, self._middles) for of_fold, rows in self._folds]
        return JudgedLevels(self.fitted.path.alphas, np.array(scores))

    def own_history(self, choices: Choices) -> JudgedLevels:
        """Levels with their own-history agreement: all, or an even selection if LAT is tested."""
        if not self.fitted.uses_last_action:
            # Without LAT a tree's own history makes no difference.
            return self.teacher_forced()
        small = np.flatnonzero(self.fitted.path.leaf_counts() <= _MOST_LEAVES_RUN)
        even = np.linspace(0, len(small) - 1, min(len(small), _MOST_LEVELS_RUN)).astype(int)
        run = small[np.unique(even)]
        scores = [
            self._run(place, self._middles[run], choices) for place in range(len(self._folds))
        ]
        return JudgedLevels(self.fitted.path.alphas[run], np.array(scores))

    def own_history_at(self, ccp_alpha: float, choices: Choices) -> float:
        """Mean own-history agreement of the folds' trees at one level."""
        level = np.array([ccp_alpha])
        return float(
            np.mean([self._run(place, level, choices) for place in range(len(self._folds))])
        )

    def _run(self, fold: int, ccp_alphas: FloatArray, choices: Choices) -> list[float]:
        """Own-history agreement of a fold's trees at some levels."""
        fitted, rows = self._folds[fold]
        scores: dict[bytes, float] = {}
        found: list[float] = []
        for ccp_alpha in ccp_alphas.tolist():
            # The levels are those of another tree, several of which can be one level of this one.
            level = fitted.path.leaves_at(ccp_alpha).tobytes()
            if level not in scores:
                scores[level] = float(np.mean(choices(fitted.at(ccp_alpha), rows) == rows.chosen))
            found.append(scores[level])
        self._step()
        return found


def folds(table: DemonstrationTable) -> IntArray:
    """The fold of each row: whole demonstrations, or stretches of the only one, shape (rows,).

    Neighbouring rows resemble each other, so that a row whose neighbours were learned from would
    tell little.
    """
    shown, position = np.unique(table.demonstration, return_inverse=True)
    if len(shown) == 1:
        return np.arange(len(table)) * MOST_FOLDS // max(len(table), 1)
    return position * min(MOST_FOLDS, len(shown)) // len(shown)


def _middles(alphas: FloatArray) -> FloatArray:
    """Geometric middle between each ``ccp_alpha`` and the next one; the last stays."""
    following = np.append(alphas[1:], alphas[-1])
    return np.asarray(np.sqrt(alphas * following))
