"""Every pruning level of the published tree as a learned tree of its own.

Its figures come from the same level of the tree that was fitted to the rows which were not held
out, so that each is judged on rows that it was not learned from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.beyond_the_paper.priority_root import MOST_LEAVES_BY_DOMAIN
from rebt_ros.decision_tree.shown_rows import shown_rows
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.errors import OptionError
from rebt_ros.learning.choice import convert
from rebt_ros.learning.options import LearnOptions
from rebt_ros.learning.pipeline import Learning, as_learned, figures_of, mismatches, pruned
from rebt_ros.learning.suggesting import accept

#: The first, the last, the best and the chosen level are always among them.
FEWEST_LEVELS = 4


@dataclass(frozen=True, slots=True)
class CrossValidated:
    """How well a level does in cross-validation."""

    recall: float
    """Mean over the actions."""
    agreement: float
    standard_error: float
    """Of the agreement."""


@dataclass(frozen=True, eq=False, slots=True)
class Level:
    """A pruning level."""

    number: int
    """Its place on the pruning path: 0 is the tree as it was fitted."""
    ccp_alpha: float
    decision_tree: DecisionTree
    leaves: int
    """Of the decision tree."""
    learned: LearnedTree
    cross_validated: CrossValidated | None
    """None where there were too few rows, or where the level was not run."""
    chosen: bool
    best: bool
    reduced: bool
    """Whether all reductions were made that were asked for."""


@dataclass(frozen=True, eq=False, slots=True)
class Family:
    """What is known of all levels before their trees are made."""

    learning: Learning
    options: LearnOptions

    @property
    def ccp_alphas(self) -> FloatArray:
        """Ascending, shape (levels,)."""
        return self.learning.policy.fitted.path.alphas

    @property
    def leaves(self) -> IntArray:
        """Leaves of the decision tree at each level, shape (levels,)."""
        return self.learning.policy.fitted.path.leaf_counts()

    @property
    def chosen(self) -> int:
        """The level that was chosen, or that the ``ccp_alpha`` asked for comes to."""
        return _level_of(self.ccp_alphas, self.learning.policy.ccp_alpha)

    @property
    def best(self) -> int | None:
        """The level with the highest agreement in cross-validation; None where there was none."""
        judged = self.learning.policy.levels
        if judged is None:
            return None
        return _level_of(self.ccp_alphas, float(judged.ccp_alphas[judged.best]))

    def selected(self, most: int) -> tuple[int, ...]:
        """At most so many levels, evenly spread, with the first, last, best and chosen ones.

        Raises:
            OptionError: Fewer than these four are asked for.
        """
        check_most_levels(most)
        last = len(self.ccp_alphas) - 1
        fixed = {0, last, self.chosen} | ({self.best} if self.best is not None else set())
        spread = set(np.linspace(0, last, min(most, last + 1)).round().astype(int).tolist())
        for level in sorted(fixed - spread):
            spread.remove(_nearest(spread - fixed, level))
            spread.add(level)
        return tuple(sorted(spread))

    def level(self, number: int) -> Level:
        """Makes the trees of a level."""
        learning, ccp_alpha = self.learning, float(self.ccp_alphas[number])
        table = learning.table if self.options.refit else learning.table.where(~learning.held_out)
        trained = pruned(learning.policy.fitted, ccp_alpha, table, self.options)
        leaves, chosen = int(self.leaves[number]), number == self.chosen
        # Suggestions belong to the published tree.
        whole = convert(trained, self.options, psa=learning.policy.psa)
        tree, _ = accept(whole, (), replace(self.options, attach=()))
        figures = replace(
            figures_of(
                learning.table.where(learning.held_out),
                learning.judge.at(ccp_alpha),
                self.options,
                learning.policy.psa,
            ),
            fidelity_mismatches=mismatches(learning.table, trained, tree),
        )
        learned = as_learned(table, trained, tree, ccp_alpha, figures, self.options)
        ranges = shown_rows(table, trained)
        return Level(
            number,
            ccp_alpha,
            trained.tree,
            leaves,
            replace(learned, shown=(ranges,)),
            self._cross_validated(ccp_alpha),
            chosen,
            number == self.best,
            leaves <= MOST_LEAVES_BY_DOMAIN,
        )

    def _cross_validated(self, ccp_alpha: float) -> CrossValidated | None:
        judged = self.learning.policy.levels
        if judged is None:
            return None
        places = np.flatnonzero(judged.ccp_alphas == ccp_alpha)
        if not np.isin(judged.ccp_alphas, self.ccp_alphas).all():
            # Another fit was judged: its level that a ``ccp_alpha`` comes to is the same.
            places = np.array([judged.at(ccp_alpha)])
        for place in places:
            figures = (judged.mean_recalls, judged.means, judged.standard_errors)
            return CrossValidated(*(float(one[place]) for one in figures))
        return None


def check_most_levels(most: int) -> None:
    """Checks how many levels are asked for, before any work is done.

    Raises:
        OptionError: There are too few.
    """
    if most < FEWEST_LEVELS:
        raise OptionError(
            f"most_levels must be at least {FEWEST_LEVELS}, not {most}, "
            "as the first, last, best and chosen level are always written."
        )


def _nearest(levels: set[int], to: int) -> int:
    return min(levels, key=lambda level: (abs(level - to), level))


def _level_of(ccp_alphas: FloatArray, ccp_alpha: float) -> int:
    """A level stands for all alphas from its own up to the next one's."""
    return int(np.searchsorted(ccp_alphas, ccp_alpha, side="right")) - 1
