"""How well pruning levels do in cross-validation, and which of them is chosen: pruning has to pay.

The choice is the largest tree that is not clearly worse than the best one.  Clearly means by more
than three quarters of a standard error of their difference, fold by fold.  If demonstrators err,
large trees are clearly worse, and are pruned.  Otherwise the few rows that decide a task stay.

If a small tree has few rows per leaf, a single fold is not enough: the rows that judge it, such as
the only one in which a door is opened, may be the only ones to learn from.

Few demonstrations judge by few rows.  Those that they hardly show, such as the ones that brake, may
be what the task needs.  So if leaves have few rows, a level may only give up what looks like
mistakes.  Separating a mistake from the rows of another action all around it takes two more leaves;
each step in which a tree follows a slanted or curved border takes one.

Few demonstrations often leave the level open, even if they contain mistakes.  A tree that separates
each mistake from the rows around it then has more leaves than a smaller tree has leaves and
exceptions.  If this is clear, by a standard error of such counts, the smaller one is chosen.

This differs from the usual rule of one standard error (Breiman et al., 1984), which takes the
smallest tree, and an error that measures how much demonstrations differ, not how much trees do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray

#: A difference is clear from this many standard errors on.  A difference in a single fold is one
#: standard error, and so clear; one on which folds disagree is not.
_CLEAR = 0.75
#: ... for a small tree with few rows per leaf: a single fold is not enough.
_CLEAR_OF_FEW = 1.0
#: With fewer rows per leaf, the size of an explanation says nothing.
_LEAST_ROWS_PER_LEAF = 10
#: With fewer rows per leaf, a level may only give up what looks like mistakes: rows that take at
#: least this share of the leaves that mistakes would take.
_FEW_ROWS_PER_LEAF = 30
_LIKE_MISTAKES = 0.8
#: Maximum number of leaves of a small tree, which a person could read unpruned.
_MOST_LEAVES = 30


@dataclass(frozen=True, eq=False, slots=True)
class JudgedLevels:
    """Pruning levels, and how well the folds' trees do on rows they were not learned from."""

    ccp_alphas: FloatArray
    """Ascending, shape (levels,); a larger one means a smaller tree."""
    hits: IntArray
    """Rows of each action that a level predicts, shape (folds, levels, actions)."""
    shown: IntArray
    """Rows of each action, shape (folds, actions)."""
    leaves: IntArray
    """Leaves of the tree of all rows, shape (levels,)."""
    explanations: IntArray
    """Leaves and exceptions of that tree, shape (levels,); see `FittedTree.explanation`."""

    @property
    def scores(self) -> FloatArray:
        """Agreement with the rows of each fold, shape (folds, levels)."""
        return np.asarray(self.hits.sum(axis=2) / self.shown.sum(axis=1)[:, np.newaxis])

    @property
    def means(self) -> FloatArray:
        """Mean agreement of each level, shape (levels,)."""
        return np.asarray(np.mean(self.scores, axis=0))

    @property
    def standard_errors(self) -> FloatArray:
        """Standard error of each mean agreement, shape (levels,)."""
        return _standard_error(self.scores)

    @property
    def recalls(self) -> FloatArray:
        """Recall of each action over all folds, NaN where it was not shown: (levels, actions)."""
        shown = self.shown.sum(axis=0)
        with np.errstate(invalid="ignore"):
            return np.asarray(self.hits.sum(axis=0) / shown)

    @property
    def mean_recalls(self) -> FloatArray:
        """Mean recall of the actions at each level, shape (levels,)."""
        return np.asarray(self.contributions.sum(axis=0))

    @property
    def best(self) -> int:
        """The level with the highest mean recall; of equals, the largest tree."""
        # Sums of the same shares in a different order may differ in the last bits.
        return int(np.argmax(np.round(self.mean_recalls, 12)))

    @property
    def best_without_mistakes(self) -> int:
        """The best of the levels that give up nothing but what looks like mistakes.

        If leaves have many rows, the best of all levels.
        """
        recalls = np.round(self.mean_recalls, 12)
        return int(np.argmax(np.where(self._gives_up_mistakes, recalls, -np.inf)))

    @property
    def chosen(self) -> int:
        """The largest tree that is neither clearly worse nor clearly less simple than another one.

        It is never smaller than the best without mistakes.
        """
        as_good = self._as_good
        sizes = self.explanations[: len(as_good)]
        least = sizes[as_good].min()
        chosen = int(np.argmax(as_good & (sizes - least <= np.sqrt(sizes + least))))
        # Many small trees explain a few rows, most of them by chance.
        return self.largest if self._few_rows(chosen) else chosen

    @property
    def largest(self) -> int:
        """The largest tree that is not clearly worse than the best without mistakes."""
        return int(np.argmax(self._as_good))

    @property
    def _as_good(self) -> BoolArray:
        """Whether each level up to the best without mistakes is as good: shape (levels,).

        That is, not clearly worse, and giving up nothing but what looks like mistakes.
        """
        levels = self.best_without_mistakes + 1
        contributions = self.contributions[:, :levels]
        few = self.leaves[0] <= _MOST_LEAVES and self._few_rows(0)
        clear = _CLEAR_OF_FEW if few else _CLEAR
        worse = _clearly_above_zero(contributions[:, -1:] - contributions, clear)
        return ~worse & self._gives_up_mistakes[:levels]

    @property
    def _gives_up_mistakes(self) -> BoolArray:
        """Whether what each level gives up looks like mistakes, or rows are many; shape (levels,).

        If a share q of the rows are mistakes, a mistake has another one next to it with probability
        q on each side, which saves a leaf.  So each takes 2 (1 - q) leaves.
        """
        rows = int(self.shown.sum())
        if rows >= _FEW_ROWS_PER_LEAF * self.leaves[0]:
            return np.ones(len(self.leaves), dtype=bool)
        exceptions = self.explanations - self.leaves
        given_up = exceptions - exceptions[0]
        of_mistakes = 2 * (1 - given_up / rows) * given_up
        return np.asarray(self.leaves[0] - self.leaves >= _LIKE_MISTAKES * of_mistakes)

    def _few_rows(self, level: int) -> bool:
        return bool(self.shown.sum() < _LEAST_ROWS_PER_LEAF * self.leaves[level])

    def at(self, ccp_alpha: float) -> int:
        """The level that a ``ccp_alpha`` belongs to."""
        return max(int(np.searchsorted(self.ccp_alphas, ccp_alpha, side="right")) - 1, 0)

    @property
    def contributions(self) -> FloatArray:
        """Contribution of each fold to the mean recall, shape (folds, levels)."""
        shown = self.shown.sum(axis=0)
        return np.asarray(np.mean(self.hits[..., shown > 0] / shown[shown > 0], axis=2))


def clearly_raised(before: JudgedLevels, after: JudgedLevels) -> bool:
    """Whether the first level has clearly higher mean recall in `after`, which has equal folds."""
    gains = after.contributions[:, :1] - before.contributions[:, :1]
    return bool(_clearly_above_zero(gains, _CLEAR)[0])


def _clearly_above_zero(gains: FloatArray, standard_errors: float) -> BoolArray:
    """Whether sums of gains (folds, levels) over the folds are clearly above 0, shape (levels,)."""
    clearly = standard_errors * len(gains) * _standard_error(gains)
    return np.asarray(np.round(gains.sum(axis=0) - clearly, 12) > 0)


def _standard_error(values: FloatArray) -> FloatArray:
    """Standard error of the mean over the first axis; 0 for a single value."""
    if len(values) < 2:
        return np.zeros(values.shape[1:])
    return np.asarray(np.std(values, axis=0, ddof=1) / np.sqrt(len(values)))
