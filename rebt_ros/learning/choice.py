"""Choosing what to learn: the pruning level, what a tree may test besides features, PSA nodes.

Cross-validation judges on rows that a tree was not learned from.  These are the choices:

- whether the tree may test the previous action.  It may if this makes the explanation of the rows
  much simpler (see `FittedTree.explanation`), whatever cross-validation says.  Each explanation may
  use differences of features if that makes it smaller: otherwise, "go on" looks simpler than the
  staircase of splits that stands for a difference.  Between explanations
  of equal size, the size of the behavior trees decides, then the number of comparisons.  Otherwise
  it may if the explanation is no larger and the mean recall of unpruned trees after their own
  choices is higher.  Events that are sent when the action changes always differ from the previous
  one; there it may only if states hardly determine what to do;
- whether it may test weighted sums of features: if they shorten the description of the rows (see
  `weighted_sums`), unless that costs both agreement and mean recall;
- whether it may test differences of features, by agreement and size, or where they clearly raise
  mean recall and make the explanation no larger;
- the pruning level, by mean recall, and by the size of the explanation if recall leaves much open:
  pruning has to pay (see `judged_levels`);
- PSA nodes, by own-history agreement.

Of the trees that fit the rows equally well, the simplest one is taken (see `simplest`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.wording import quantity_text
from rebt_ros.beyond_the_paper.reductions import MOST_LEAVES_BY_DOMAIN
from rebt_ros.decision_tree.differences import likely_differences
from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.fitted import FittedTree
from rebt_ros.decision_tree.simplest import simplest
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.decision_tree.weighted_sums import likely_sums
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.demonstration.last_action import NO_ACTION, History
from rebt_ros.demonstration.table import DemonstrationTable, part_of
from rebt_ros.errors import OptionError
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.conversion import convert_shown, own_history_choices
from rebt_ros.learning.cross_validation import MOST_FOLDS, CrossValidation
from rebt_ros.learning.fitting import fit_options
from rebt_ros.learning.judged_levels import JudgedLevels, clearly_raised
from rebt_ros.learning.options import LearnOptions, Use
from rebt_ros.learning.structure import structure_sample
from rebt_ros.logic.conditions import Difference
from rebt_ros.paper.rules import delta_close

#: With fewer rows, the folds are too small to judge anything.
_FEWEST_ROWS = 20

#: In larger tables, about this many rows, in whole demonstrations, decide what a tree may test; all
#: rows choose the level.
_LARGE, _ROWS_THAT_TELL = 6_000, 2_000

#: Factor by which the previous action has to shrink the explanation.
_MUCH_SIMPLER = 0.875

#: What is compared.
_HISTORIES = (History.NONE, History.PREVIOUS)

#: Up to this share of events, an action hardly ever follows itself.
_HARDLY = 0.1

#: How much agreement differences may cost, and by which factor they have to reduce the leaves.
#: Weighted sums may cost the same amount of agreement or of mean recall.
_DEARER, _SMALLER = 0.005, 0.75

#: Steps of six cross-validations, of running the trees of two of them, and of running them with and
#: without PSA nodes.
_MOST_STEPS = 6 * (MOST_FOLDS + 1) + 2 * MOST_FOLDS + 2 * MOST_FOLDS


class _Steps:
    """Counts steps of the work, and reports at most which share of it is done."""

    def __init__(self, advance: Callable[[float], None]) -> None:
        self._advance = advance
        self._taken = 0

    def __call__(self) -> None:
        self._taken += 1
        self._advance(min(self._taken / _MOST_STEPS, 1.0))


def choose(
    table: DemonstrationTable,
    options: LearnOptions,
    advance: Callable[[float], None] = lambda share: None,
    held_out: BoolArray | None = None,
) -> ChosenPolicy:
    """Chooses a policy.

    Args:
        table: The rows.
        options: What is left to choose.
        advance: Called with the share of the work that is done; there may be less work.
        held_out: Rows that are not used, shape (rows,).

    Raises:
        OptionError: The requested pruning level does not exist.
    """
    choice = _Choice(table, options, _Steps(advance), held_out)
    if len(table) < _FEWEST_ROWS:
        return _unjudged(table, options, choice)
    vocabulary = choice.vocabulary()
    judged = choice.judged(vocabulary)
    levels = judged.levels(partial(own_history_choices, options=options, psa=False))
    ccp_alpha, reasons = _asked_for(judged.fitted, options), choice.reasons
    if ccp_alpha is None:
        ccp_alpha, reason = _level(levels, choice.shown)
        reasons.append(reason)
    psa, reason = _choose_psa(judged, ccp_alpha, options)
    fitted = judged.fitted
    if options.simplest and options.upsample is Upsampling.NONE:
        other = simplest(choice.shown, fitted)
        its = _of_another_fit(fitted, ccp_alpha, other, options)
        asked = _asked_for(fitted, options) is not None
        # If it is pruned, its size before pruning is not what makes it simple.
        if other is not fitted and (asked or _leaves(other, its) <= _leaves(fitted, ccp_alpha)):
            reasons.append(
                f"Of the trees that fit the rows, one with {_size(other)} is the simplest "
                f"({_size(fitted)} where splits are chosen greedily)."
            )
            fitted, ccp_alpha = other, its
    return ChosenPolicy(fitted, ccp_alpha, psa, levels, (*reasons, reason), judged.of_all)


def _asked_for(fitted: FittedTree, options: LearnOptions) -> float | None:
    """The ``ccp_alpha`` that the options ask for; None if it is left to choose."""
    if options.level is None:
        return options.ccp_alpha
    if options.level >= len(fitted.path):
        raise OptionError(
            f"there is no pruning level {options.level}: the last one is {len(fitted.path) - 1}, "
            "a tree that always does the same."
        )
    return float(fitted.path.alphas[options.level])


def _level(levels: JudgedLevels, shown: DemonstrationTable) -> tuple[float, str]:
    """The ``ccp_alpha`` to prune at, and why."""
    begun = int(np.count_nonzero(shown.previous != shown.chosen))
    # Each stretch of a demonstration may be a part of the task that no other stretch shows.
    if len(shown.begins) == 1 and begun < levels.shown.size:
        return 0.0, (
            f"One demonstration in which actions are begun {begun} times does not tell how far to "
            "prune: the tree is not pruned."
        )
    recalls, chosen, largest = levels.mean_recalls, levels.chosen, levels.largest
    best = levels.best_without_mistakes
    kind = "" if best == levels.best else " of those that give up only what looks like mistakes"
    ccp_alpha = float(levels.ccp_alphas[chosen])
    simpler = ""
    if chosen != largest:
        size, larger = levels.explanations[chosen], levels.explanations[largest]
        simpler = (
            ", without those that take clearly more leaves and exceptions to explain the rows "
            f"({larger} instead of {size})"
        )
    return ccp_alpha, (
        f"Of {len(recalls)} pruning levels, ccp_alpha = {ccp_alpha:.3g} makes the largest tree "
        f"whose mean recall ({recalls[chosen]:.1%}) is not clearly below the best{kind} "
        f"({recalls[best]:.1%}; {recalls[0]:.1%} unpruned){simpler}."
    )


def _of_another_fit(
    judged: FittedTree, ccp_alpha: float, fitted: FittedTree, options: LearnOptions
) -> float:
    """Where to prune another fit to the same rows, given a judged fit and its level."""
    asked = _asked_for(fitted, options)
    # Its levels are elsewhere: the choice stands for the range up to the next level.
    return judged.path.middle(ccp_alpha) if asked is None else asked


def _unjudged(table: DemonstrationTable, options: LearnOptions, choice: _Choice) -> ChosenPolicy:
    """Without cross-validation: no pruning, and PSA nodes only on request.

    The previous action is tested if that makes the explanation simpler.
    """
    history = choice.history_of_explanations()
    fitted = fit(table, fit_options(options, Vocabulary(history)))
    reason = f"{len(table)} rows are too few to choose by: the tree is not pruned."
    ccp_alpha = _asked_for(fitted, options) or 0.0
    reasons = (*choice.reasons, reason)
    return ChosenPolicy(fitted, ccp_alpha, options.psa is Use.ALWAYS, None, reasons)


def _leaves(fitted: FittedTree, ccp_alpha: float) -> int:
    return fitted.at(ccp_alpha).tree.leaves


def _size(fitted: FittedTree) -> str:
    return f"{fitted.leaves} leaves and {fitted.comparisons} comparisons of numbers"


@dataclass(frozen=True, slots=True)
class _Explanation:
    """An explanation of the rows."""

    fitted: FittedTree
    differences: int
    """Offered ones, each of which counts as a leaf."""

    @property
    def size(self) -> int:
        return self.fitted.explanation + self.differences


def _in_words(before: _Explanation, after: _Explanation) -> str:
    """Sizes of explanations without the previous action and with it."""
    of = "leaves and exceptions"
    if before.differences or after.differences:
        of = "leaves, exceptions and differences of features"
    return f"{after.size} {of} explain the rows, {before.size} without it"


def _always_changes(table: DemonstrationTable) -> bool:
    """Whether rows are events in which an action hardly ever follows itself: changes of action.

    The tree is ticked while an action lasts; these rows do not show for how long.
    """
    if table.row_kind is not RowKind.EVENT:
        return False
    follows = int(np.count_nonzero(table.previous != NO_ACTION))
    return int(np.count_nonzero(table.previous == table.chosen)) < _HARDLY * follows


def _simpler(first: FittedTree, second: FittedTree) -> bool:
    """Whether the first tree has fewer comparisons of numbers, and no more leaves."""
    return first.leaves <= second.leaves and first.comparisons < second.comparisons


class _Choice:
    """Cross-validations of one table, each made once."""

    def __init__(
        self,
        table: DemonstrationTable,
        options: LearnOptions,
        step: Callable[[], None],
        held_out: BoolArray | None,
    ) -> None:
        self._table, self._options, self._step = table, options, step
        self._held_out = held_out
        self.shown = table if held_out is None else table.where(~held_out)
        """The rows that choose."""
        self._sample = structure_sample(table, options)
        large = len(self.shown) > _LARGE
        self._telling = part_of(self.shown, _ROWS_THAT_TELL) if large else self.shown
        self._made: dict[tuple[bool, Vocabulary], CrossValidation] = {}
        self._likely: dict[Vocabulary, tuple[Difference, ...]] = {}
        self._fits: dict[FitOptions, FittedTree] = {}
        self.reasons: list[str] = []

    def judged(self, vocabulary: Vocabulary, *, telling: bool = False) -> CrossValidation:
        """The cross-validation of all rows, or of those that decide what a tree may test."""
        telling = telling and self._telling is not self.shown
        key = telling, vocabulary
        if key not in self._made:
            self._made[key] = CrossValidation(
                self._telling if telling else self._table,
                fit_options(self._options, vocabulary),
                step=self._step,
                held_out=None if telling else self._held_out,
                grown_on=None if telling or self._sample is None else self._sample.rows,
            )
        return self._made[key]

    def vocabulary(self) -> Vocabulary:
        """What the tree may test besides features."""
        states_alone = self._with_sums(FEATURES_ALONE)
        vocabulary = replace(states_alone, history=self._history(states_alone))
        if not vocabulary.combinations and vocabulary.history is not History.NONE:
            # If equal states have different actions, a line between these shows only with history.
            vocabulary = self._with_sums(vocabulary)
        return self._with_differences(vocabulary)

    def _with_sums(self, vocabulary: Vocabulary) -> Vocabulary:
        """The vocabulary with the weighted sums that are worth it."""
        options = self._options
        if options.sums is Use.NEVER:
            return vocabulary
        # A difference needs no weights.
        at_hand = vocabulary.with_more(self._likely_differences(vocabulary))
        how = replace(fit_options(options, at_hand), upsample=Upsampling.NONE)
        sums = likely_sums(self._telling, self._fit(how), how)
        with_them = vocabulary.with_more(sums)
        if not sums or options.sums is Use.ALWAYS:
            return with_them
        choices = partial(own_history_choices, options=options, psa=False)
        # Lines were fitted to the rows of all folds, which flatters them a little: this rejects
        # only sums that are worse nevertheless.
        before, after = (
            self.judged(one, telling=True).levels(choices) for one in (vocabulary, with_them)
        )
        agreements = float(before.means[before.chosen]), float(after.means[after.chosen])
        recalls = before.mean_recalls[before.chosen], after.mean_recalls[after.chosen]
        compared = (
            f"{', '.join(map(quantity_text, sums))}: agreement {agreements[1]:.1%} instead of "
            f"{agreements[0]:.1%}, mean recall {recalls[1]:.1%} instead of {recalls[0]:.1%}"
        )
        if all(now < then - _DEARER for then, now in (agreements, recalls)):
            self.reasons.append(f"Weighted sums of features make no better tree ({compared}).")
            return vocabulary
        self.reasons.append(f"Weighted sums of features make a simpler tree ({compared}).")
        return with_them

    def history_of_explanations(self) -> History:
        """Whether the tree may test the previous action, where nothing else can be judged."""
        if self._options.history is not None:
            return self._options.history
        if _always_changes(self._telling):
            return History.NONE
        told, reason = self._explained(
            *(self._explanation(replace(FEATURES_ALONE, history=one)) for one in _HISTORIES)
        )
        if told is None:
            return History.NONE
        self.reasons.append(reason)
        return told

    def _history(self, states_alone: Vocabulary) -> History:
        asked = self._options.history
        if asked is not None:
            return asked
        differences = self._likely_differences(states_alone)
        before, after = (
            min(
                self._explanation(one),
                self._explanation(one, differences),
                key=lambda its: its.size,
            )
            for one in (replace(states_alone, history=history) for history in _HISTORIES)
        )
        if _always_changes(self._telling):
            return self._history_of_changes(before, after)
        told, reason = self._explained(before, after)
        if told is not None:
            self.reasons.append(reason)
            return told
        judged = self._unpruned(before), self._unpruned(after)
        raised = clearly_raised(*judged)
        without, recall = (levels.mean_recalls[0] for levels in judged)
        self.reasons.append(
            f"The previous action is {'tested' if raised else 'not tested'}: "
            f"{_in_words(before, after)}, and mean recall after its own choices is "
            f"{'' if raised else 'not '}clearly higher ({recall:.1%}, {without:.1%} without it)."
        )
        return History.PREVIOUS if raised else History.NONE

    def _explanation(
        self, vocabulary: Vocabulary, differences: tuple[Difference, ...] = ()
    ) -> _Explanation:
        """With further differences that are offered, if any."""
        return _Explanation(self._fitted(vocabulary.with_more(differences)), len(differences))

    def _explained(self, before: _Explanation, after: _Explanation) -> tuple[History | None, str]:
        """What explanations say about the previous action, and why; None where they leave it open.

        Args:
            before: Without it.
            after: With it.
        """
        compared = _in_words(before, after)
        if after.size <= _MUCH_SIMPLER * before.size:
            return History.PREVIOUS, f"The previous action is tested: {compared}."
        if after.size > before.size:
            return History.NONE, f"The previous action is not tested: {compared}."
        if after.size < before.size:
            return None, ""
        without_it, with_previous = (simplest(self._telling, one.fitted) for one in (before, after))
        sizes = self._sizes(without_it, with_previous)
        if sizes[0] != sizes[1]:
            tested = sizes[1] < sizes[0]
            return History.PREVIOUS if tested else History.NONE, (
                f"The previous action is {'tested' if tested else 'not tested'}: {compared}, "
                f"and the behavior tree has {sizes[1]} nodes with it, {sizes[0]} without."
            )
        if _simpler(with_previous, without_it):
            return History.PREVIOUS, (
                f"The previous action is tested: {compared}, and {with_previous.comparisons} "
                f"comparisons of numbers do instead of {without_it.comparisons}."
            )
        return None, ""

    def _history_of_changes(self, before: _Explanation, after: _Explanation) -> History:
        """Whether to test the previous action if each row has another action than the one before.

        The previous action then reveals something about each row whatever the state; with two
        actions, everything.  So the size of the explanation says nothing, and the previous action
        is tested only if states hardly determine what to do.
        """
        without, recall = (self._unpruned(one).mean_recalls[0] for one in (before, after))
        by_chance = 1 / len(np.unique(self._telling.chosen))
        tested = without < (by_chance + recall) / 2
        self.reasons.append(
            f"The previous action is {'tested' if tested else 'not tested'}: "
            f"{_in_words(before, after)}; each row is another action than the one before, and "
            f"states alone {'hardly ' if tested else ''}tell which (mean recall {without:.1%}, "
            f"{recall:.1%} with it)."
        )
        return History.PREVIOUS if tested else History.NONE

    def _unpruned(self, explanation: _Explanation) -> JudgedLevels:
        """How good unpruned trees are that may test what an explanation tests."""
        return self.judged(explanation.fitted.vocabulary, telling=True).unpruned()

    def _fitted(self, vocabulary: Vocabulary) -> FittedTree:
        """A tree fitted to the rows that decide what a tree may test."""
        return self._fit(fit_options(self._options, vocabulary))

    def _fit(self, how: FitOptions) -> FittedTree:
        if how not in self._fits:
            self._fits[how] = fit(self._telling, how)
        return self._fits[how]

    def _sizes(self, *fits: FittedTree) -> tuple[int, ...]:
        """Sizes of the unpruned behavior trees; 0 for all if one of them is very large."""
        if any(fitted.leaves > MOST_LEAVES_BY_DOMAIN for fitted in fits):
            return (0,) * len(fits)
        trees = (
            convert_shown(fitted.at(0.0), self._options, self._telling, psa=False)
            for fitted in fits
        )
        return tuple(map(nodes.size, trees))

    def _likely_differences(self, vocabulary: Vocabulary) -> tuple[Difference, ...]:
        options = self._options
        if options.differences is Use.NEVER:
            return ()
        if vocabulary not in self._likely:
            self._likely[vocabulary] = likely_differences(
                self._telling, vocabulary, options.units, options.random_state
            )
        return self._likely[vocabulary]

    def _with_differences(self, vocabulary: Vocabulary) -> Vocabulary:
        """The vocabulary with the differences that are worth it."""
        options = self._options
        differences = self._likely_differences(vocabulary)
        more = vocabulary.with_more(differences)
        if options.differences is Use.ALWAYS or not differences:
            return more
        choices = partial(own_history_choices, options=options, psa=False)
        without = self.judged(vocabulary, telling=True)
        with_them = self.judged(more, telling=True)
        before, after = without.levels(choices), with_them.levels(choices)
        counts = [one.fitted.path.leaf_counts() for one in (without, with_them)]
        leaves = [
            int(count[levels.chosen]) for count, levels in zip(counts, (before, after), strict=True)
        ]
        # Pruned trees can differ in size because one of them is pruned more.  If differences
        # replace many tests by one, unpruned trees differ too.
        smaller = all(
            one <= _SMALLER * other
            for one, other in ((leaves[1], leaves[0]), (counts[1][0], counts[0][0]))
        )
        agreements = [float(levels.means[levels.chosen]) for levels in (before, after)]
        compared = (
            f"{leaves[1]} instead of {leaves[0]} leaves, agreement {agreements[1]:.1%} instead of "
            f"{agreements[0]:.1%}"
        )
        if smaller and agreements[1] >= agreements[0] - _DEARER:
            self.reasons.append(f"Differences of features make a smaller tree ({compared}).")
            return more
        if (
            clearly_raised(before, after)
            and agreements[1] >= agreements[0]
            and (
                self._explanation(vocabulary, differences).size
                <= self._explanation(vocabulary).size
            )
        ):
            self.reasons.append(f"Differences of features make a better tree ({compared}).")
            return more
        self.reasons.append(f"Differences of features make no better tree ({compared}).")
        return vocabulary


def _choose_psa(
    judged: CrossValidation, ccp_alpha: float, options: LearnOptions
) -> tuple[bool, str]:
    if options.psa is not Use.AUTO:
        return options.psa is Use.ALWAYS, f"PSA nodes: {options.psa.value}, as asked."
    leaves = [leaf for _, leaf in judged.fitted.at(ccp_alpha).tree.paths()]
    if all(len(delta_close(leaf, options.delta)) == 1 for leaf in leaves):
        return False, f"No leaf has several actions within delta = {options.delta:g}."

    def agreement(psa: bool) -> float:
        return judged.own_history_at(
            ccp_alpha, partial(own_history_choices, options=options, psa=psa)
        )

    with_psa, without = agreement(psa=True), agreement(psa=False)
    compared = f"agreement ({with_psa:.1%} with them, {without:.1%} without)"
    if with_psa > without:
        return True, f"PSA nodes raise {compared}."
    return False, f"PSA nodes do not raise {compared}."
