"""What a policy was learned from, and its tree at each pruning level.

The figures of a level come from the same level of the tree that was fitted without the held-out
rows: each level is judged on rows that it was not learned from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance
from rebt_ros.decision_tree.fitted import FittedTree, TrainedTree
from rebt_ros.decision_tree.shown_rows import shown_rows
from rebt_ros.decision_tree.tree import DecisionTree
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import OptionError
from rebt_ros.learning import evaluation
from rebt_ros.learning.attaching import accept
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.conversion import (
    convert,
    convert_shown,
    kept_rows,
    leaves_out_conditions,
    own_history_choices,
)
from rebt_ros.learning.mistakes import without_mistakes
from rebt_ros.learning.options import LearnOptions
from rebt_ros.robot_file.robot_file import RobotFile

#: The first, the last, the best and the chosen level are always among them.
FEWEST_LEVELS = 4


@dataclass(frozen=True, eq=False, slots=True)
class LevelTree:
    """The tree of a pruning level, without suggestions."""

    learned: LearnedTree
    decision_tree: TrainedTree


@dataclass(frozen=True, eq=False, slots=True)
class Evidence:
    """The rows, and the trees fitted to them, with all their pruning levels."""

    table: DemonstrationTable
    """All rows, with lagged features, and with late actions moved back."""
    held_out: BoolArray
    """Rows that the tree was judged on, shape (rows,)."""
    intended: IntArray
    """The action meant in each row, shape (rows,); differs from the shown one in mistakes."""
    fitted: FittedTree
    """Tree fitted to the rows that the published tree is learned from."""
    judge: FittedTree
    """Tree fitted to the rows that were not held out, for the figures."""
    psa: bool
    """Whether the trees have PSA nodes."""
    options: LearnOptions

    @property
    def learned_from(self) -> DemonstrationTable:
        """The rows that the published tree is learned from, without mistakes."""
        if self.options.refit:
            return without_mistakes(self.table, self.intended)
        known = ~self.held_out
        return without_mistakes(self.table.where(known), self.intended[known])

    @property
    def rows_learned_from(self) -> BoolArray:
        """Which rows these are, shape (rows,)."""
        meant = np.asarray(self.intended == self.table.chosen)
        return meant if self.options.refit else meant & ~self.held_out

    def decision_tree_at(self, ccp_alpha: float) -> TrainedTree:
        """The decision tree of a pruning level, with thresholds by the options."""
        if self.options.readable_thresholds and self.options.upsample is Upsampling.NONE:
            return self.fitted.readable_at(ccp_alpha, self.learned_from)
        return self.fitted.at(ccp_alpha)

    def tree_at(self, ccp_alpha: float, *, judged_at: float | None = None) -> LevelTree:
        """The behavior tree of a pruning level, with its figures.

        Args:
            ccp_alpha: The level.
            judged_at: The level of the tree that the figures come from; None for the same level.
        """
        table = self.learned_from
        trained = self.decision_tree_at(ccp_alpha)
        tree = convert_shown(trained, self.options, table, psa=self.psa)
        figures = replace(
            self._figures(self.judge.at(ccp_alpha if judged_at is None else judged_at)),
            fidelity_mismatches=mismatches(self._kept(trained, table), trained, tree),
        )
        learned = as_learned(table, trained, tree, ccp_alpha, figures, self.options)
        return LevelTree(replace(learned, shown=(shown_rows(table, trained),)), trained)

    def _kept(self, trained: TrainedTree, shown: DemonstrationTable) -> DemonstrationTable:
        """The rows in which a behavior tree does what its decision tree does."""
        if not leaves_out_conditions(trained, self.options):
            return self.table
        return shown.where(kept_rows(trained, shown, psa=self.psa))

    def _figures(self, judge: TrainedTree) -> Figures:
        """How well the behavior tree of a decision tree does on rows that it was not learned from.

        The figures do not include fidelity, which is about the published tree (see `mismatches`).
        """
        rows, options, psa = self.table.where(self.held_out), self.options, self.psa
        if not len(rows):
            return Figures(0, None, None, 0)
        if leaves_out_conditions(judge, options):
            known = ~self.held_out & (self.intended == self.table.chosen)
            tree = convert_shown(judge, options, self.table.where(known), psa=psa)
            forced = evaluation.teacher_forced_choices(tree, rows)
            own = evaluation.own_history_choices(tree, rows)
        elif psa or judge.vocabulary.history is History.LAST:
            tree = convert(judge, options, psa=psa)
            forced = evaluation.teacher_forced_choices(tree, rows)
            own = own_history_choices(judge, rows, options, psa=psa)
        else:
            forced = judge.predict(rows)
            own = own_history_choices(judge, rows, options, psa=psa)
        shown = np.bincount(rows.chosen, minlength=len(rows.actions))
        hits = np.bincount(rows.chosen[own == rows.chosen], minlength=len(rows.actions))
        return Figures(
            0,
            evaluation.agreement(forced, rows),
            evaluation.agreement(own, rows),
            len(rows),
            float(evaluation.mean_recall(hits, shown)),
        )


@dataclass(frozen=True, slots=True)
class CrossValidated:
    """How well a level does in cross-validation."""

    recall: float
    """Mean over the actions."""
    agreement: float
    standard_error: float
    """Standard error of the agreement."""


@dataclass(frozen=True, eq=False, slots=True)
class PruningLevel:
    """A pruning level."""

    number: int
    """Its position on the pruning path; 0 is the tree as fitted."""
    ccp_alpha: float
    decision_tree: DecisionTree
    leaves: int
    """Leaves of the decision tree."""
    learned: LearnedTree
    cross_validated: CrossValidated | None
    """None if there were too few rows, or if the level was not run."""
    chosen: bool
    best: bool
    reduced: bool
    """Whether all requested reductions were made, if any were requested."""


@dataclass(frozen=True, eq=False, slots=True)
class Levels:
    """What is known of all levels before their trees are made."""

    evidence: Evidence
    policy: ChosenPolicy

    @property
    def ccp_alphas(self) -> FloatArray:
        """Ascending, shape (levels,)."""
        return self.evidence.fitted.path.alphas

    @property
    def leaves(self) -> IntArray:
        """Leaves of the decision tree at each level, shape (levels,)."""
        return self.evidence.fitted.path.leaf_counts()

    @property
    def chosen(self) -> int:
        """The chosen level, or that of the requested ``ccp_alpha``."""
        return _level_of(self.ccp_alphas, self.policy.ccp_alpha)

    @property
    def best(self) -> int | None:
        """The level with the highest agreement in cross-validation; None without it."""
        judged = self.policy.levels
        if judged is None:
            return None
        return _level_of(self.ccp_alphas, float(judged.ccp_alphas[judged.best]))

    def selected(self, most: int) -> tuple[int, ...]:
        """A limited number of levels, evenly spread, with the first, last, best and chosen ones.

        Raises:
            OptionError: The limit is below these four.
        """
        check_most_levels(most)
        last = len(self.ccp_alphas) - 1
        fixed = {0, last, self.chosen} | ({self.best} if self.best is not None else set())
        spread = set(np.linspace(0, last, min(most, last + 1)).round().astype(int).tolist())
        for level in sorted(fixed - spread):
            spread.remove(_nearest(spread - fixed, level))
            spread.add(level)
        return tuple(sorted(spread))

    def level(self, number: int) -> PruningLevel:
        """Makes a level with its trees."""
        ccp_alpha = float(self.ccp_alphas[number])
        tree = self.evidence.tree_at(ccp_alpha)
        leaves = int(self.leaves[number])
        # Suggestions belong to the published tree.
        options = replace(self.evidence.options, attach=())
        asked = options.reductions
        resolved, _ = accept(tree.learned.tree, (), options)
        return PruningLevel(
            number,
            ccp_alpha,
            tree.decision_tree.tree,
            leaves,
            replace(tree.learned, tree=resolved),
            self._cross_validated(ccp_alpha),
            number == self.chosen,
            number == self.best,
            asked is None or asked.made_in(leaves) == asked,
        )

    def _cross_validated(self, ccp_alpha: float) -> CrossValidated | None:
        judged = self.policy.levels
        if judged is None:
            return None
        places = np.flatnonzero(judged.ccp_alphas == ccp_alpha)
        if not np.isin(judged.ccp_alphas, self.ccp_alphas).all():
            # Another fit was judged: a ``ccp_alpha`` belongs to the same level there.
            places = np.array([judged.at(ccp_alpha)])
        for place in places:
            figures = (judged.mean_recalls, judged.means, judged.standard_errors)
            return CrossValidated(*(float(figure[place]) for figure in figures))
        return None


def as_learned(
    table: DemonstrationTable,
    trained: TrainedTree,
    tree: nodes.Node,
    ccp_alpha: float,
    figures: Figures,
    options: LearnOptions,
) -> LearnedTree:
    """A behavior tree with its provenance."""
    return LearnedTree(
        table.features,
        evaluation.actions_of(table),
        tree,
        Provenance(
            demonstrations=len(table.begins),
            rows=len(table),
            delta=options.delta,
            max_depth=options.max_depth,
            ccp_alpha=ccp_alpha,
            root=options.root,
            history=trained.vocabulary.history,
            figures=figures,
        ),
        row_kind=table.row_kind,
        robot=table.robot if isinstance(table.robot, RobotFile) else None,
    )


def mismatches(table: DemonstrationTable, trained: TrainedTree, tree: nodes.Node) -> int:
    """Rows on which a behavior tree and its decision tree choose different actions."""
    chosen = evaluation.teacher_forced_choices(tree, table)
    return int(np.sum(chosen != trained.predict(table)))


def check_most_levels(most: int) -> None:
    """Checks the requested number of levels, before any work is done.

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
