"""How well pruning levels do in cross-validation, and which of them is chosen: pruning has to pay.

The largest tree is chosen that is not clearly worse than the best one: by more than three quarters
of a standard error of their difference, fold by fold.  Where demonstrators err, large trees are
clearly worse, and pruned.  Elsewhere the few rows that decide a task stay.

Where a small tree has few rows for each leaf, a single fold does not make that clear: what it is
judged by, such as the only row in which a door is opened, is then all that there was to learn from.

Few demonstrations judge by few rows, and rows that they hardly show, such as those that brake, may
be what a task needs.  So where leaves have few rows, only levels count that give up nothing but
what looks like mistakes.  To part a mistake from the rows of another action all around it takes two
more leaves; each step in which a tree follows a slanted or curved border takes one.

Few demonstrations often leave the level open, also where they err.  Then a tree that parts each
mistake from the rows around it has more leaves than a smaller one has leaves and exceptions.  Where
that is clear, by a standard error of such counts, the smaller one is chosen.

The usual rule of one standard error (Breiman et al., 1984) is another one: it takes the smallest
tree, and an error that measures how much demonstrations differ instead of how much trees do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray

#: Standard errors of a difference from which on it is clear.  A difference that a single fold makes
#: is one standard error large, and clear; one on which folds disagree is not.
_CLEAR = 0.75
#: ... of a small tree with few rows for each leaf: a single fold is not enough.
_CLEAR_OF_FEW = 1.0
#: With fewer rows for each leaf, the size of an explanation tells nothing.
_LEAST_ROWS_PER_LEAF = 10
#: With fewer rows for each leaf, only what looks like mistakes is given up: rows that take at least
#: this share of the leaves that mistakes would take.
_FEW_ROWS_PER_LEAF = 30
_LIKE_MISTAKES = 0.8
#: Leaves of a small tree, which a person could read without pruning.
_MOST_LEAVES = 30


@dataclass(frozen=True, eq=False, slots=True)
class JudgedLevels:
    """Pruning levels with how well the folds' trees do on the rows they were not learned from."""

    ccp_alphas: FloatArray
    """Ascending, shape (levels,): larger means a smaller tree."""
    hits: IntArray
    """Rows of each action on which a level takes it, shape (folds, levels, actions)."""
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
        """The level with the highest mean recall; of equals, the one with the largest tree."""
        # Sums of the same shares in another order may differ in the last bits.
        return int(np.argmax(np.round(self.mean_recalls, 12)))

    @property
    def best_without_mistakes(self) -> int:
        """The best of the levels that give up nothing but what looks like mistakes.

        Where leaves have many rows, it is the best of all.
        """
        recalls = np.round(self.mean_recalls, 12)
        return int(np.argmax(np.where(self._gives_up_mistakes, recalls, -np.inf)))

    @property
    def chosen(self) -> int:
        """The largest tree that is neither clearly worse nor clearly less simple than another one.

        It is not smaller than the best without mistakes.
        """
        as_good = self._as_good
        sizes = self.explanations[: len(as_good)]
        least = sizes[as_good].min()
        chosen = int(np.argmax(as_good & (sizes - least <= np.sqrt(sizes + least))))
        # Few rows are explained by many small trees, most of them by chance.
        return self.largest if self._few_rows(chosen) else chosen

    @property
    def largest(self) -> int:
        """The largest tree that is not clearly worse than the best without mistakes."""
        return int(np.argmax(self._as_good))

    @property
    def _as_good(self) -> BoolArray:
        """Whether each level, up to the best without mistakes, may be chosen.

        Those may that give up nothing but what looks like mistakes and are not clearly worse.
        """
        levels = self.best_without_mistakes + 1
        contributions = self.contributions[:, :levels]
        few = self.leaves[0] <= _MOST_LEAVES and self._few_rows(0)
        clear = _CLEAR_OF_FEW if few else _CLEAR
        worse = _clearly_above_zero(contributions[:, -1:] - contributions, clear)
        return ~worse & self._gives_up_mistakes[:levels]

    @property
    def _gives_up_mistakes(self) -> BoolArray:
        """Whether what each level gives up looks like mistakes, or rows are many, shape (levels,).

        Of rows of which a share q are mistakes, as many lie next to another one, which saves a leaf
        on each side: each takes 2 (1 - q) leaves.
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
        """The level that a ``ccp_alpha`` comes to."""
        return max(int(np.searchsorted(self.ccp_alphas, ccp_alpha, side="right")) - 1, 0)

    @property
    def contributions(self) -> FloatArray:
        """What each fold adds to the mean recall, shape (folds, levels)."""
        shown = self.shown.sum(axis=0)
        return np.asarray(np.mean(self.hits[..., shown > 0] / shown[shown > 0], axis=2))


def clearly_raised(before: JudgedLevels, after: JudgedLevels) -> bool:
    """Whether the first level's mean recall is clearly higher in `after`, which has equal folds."""
    gains = after.contributions[:, :1] - before.contributions[:, :1]
    return bool(_clearly_above_zero(gains, _CLEAR)[0])


def _clearly_above_zero(gains: FloatArray, standard_errors: float) -> BoolArray:
    """Of sums over folds, shape (levels,), where there are so many gains as folds and levels."""
    clearly = standard_errors * len(gains) * _standard_error(gains)
    return np.asarray(np.round(gains.sum(axis=0) - clearly, 12) > 0)


def _standard_error(values: FloatArray) -> FloatArray:
    """Of the mean over the first axis; 0 where there is one value only."""
    if len(values) < 2:
        return np.zeros(values.shape[1:])
    return np.asarray(np.std(values, axis=0, ddof=1) / np.sqrt(len(values)))
