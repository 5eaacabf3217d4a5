"""A learned policy that can be inspected and changed without learning again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.demonstration.table import DemonstrationTable, history_at
from rebt_ros.errors import OptionError
from rebt_ros.learning import evaluation
from rebt_ros.learning.attaching import accept
from rebt_ros.learning.chosen_policy import ChosenPolicy
from rebt_ros.learning.levels import Evidence, Levels
from rebt_ros.learning.options import ALL, LearnOptions, PsaChoice
from rebt_ros.learning.report import LearningReport, report_on
from rebt_ros.learning.sample_report import report_on_sample
from rebt_ros.learning.structure import structure_sample
from rebt_ros.verification.explaining import Explanation, explain


@dataclass(frozen=True, eq=False, slots=True)
class Learning:
    """The policy of a channel, with what it was made from.

    Each method returns another `Learning` and leaves this one unchanged.
    """

    learned: LearnedTree
    """The published tree."""
    plain: LearnedTree
    """The tree before anything was attached or resolved, with all suggestions."""
    decision_tree: TrainedTree
    policy: ChosenPolicy
    """The choices made, and their reasons."""
    evidence: Evidence
    """What it was learned from."""
    report: LearningReport
    """What a person must know before it drives."""
    late: tuple[str, ...] = ()
    """A sentence if actions were late; no full stop."""
    further: tuple[str, ...] = ()
    """Further notes, besides those of the report; no full stops."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know about it; no full stops."""
        return (*self.late, *self.report.notes(), *self.further)

    @property
    def table(self) -> DemonstrationTable:
        """All rows."""
        return self.evidence.table

    @property
    def options(self) -> LearnOptions:
        """How it was learned, with the suggestions that are now attached."""
        return self.evidence.options

    @property
    def levels(self) -> Levels:
        """All pruning levels."""
        return Levels(self.evidence, self.policy)

    def level(self, number: int) -> Learning:
        """The policy at another pruning level, without suggestions, which belong to a single tree.

        Args:
            number: The level; 0 is unpruned.

        Raises:
            OptionError: There is no such level.
        """
        last = len(self.levels.ccp_alphas) - 1
        if not 0 <= number <= last:
            raise OptionError(f"there is no pruning level {number}: choose one of 0 to {last}.")
        ccp_alpha = float(self.levels.ccp_alphas[number])
        tree = self.evidence.tree_at(ccp_alpha)
        before = self.learned.provenance
        provenance = replace(
            tree.learned.provenance, late_rows=before.late_rows, late_seconds=before.late_seconds
        )
        return replace(
            self,
            plain=replace(tree.learned, provenance=provenance),
            decision_tree=tree.decision_tree,
            policy=replace(self.policy, ccp_alpha=ccp_alpha),
        )._accepting((), self.options.psa_choice)

    def with_attached(self, *ids: str) -> Learning:
        """The policy with further suggestions attached.

        Args:
            ids: Ids of the suggestions; `ALL` for all.

        Raises:
            OptionError: There is no suggestion with this id.
        """
        attach = tuple(dict.fromkeys((*self.options.attach, *ids)))
        return self._accepting(attach, self.options.psa_choice)

    def without(self, *ids: str) -> Learning:
        """The policy with suggestions detached.

        Args:
            ids: Ids of attached suggestions; `ALL` for all.

        Raises:
            OptionError: One of them is not attached.
        """
        attached = [suggestion.id for suggestion in self.learned.suggestions if suggestion.attached]
        gone = attached if ALL in ids else ids
        for name in gone:
            if name not in attached:
                known = f"attached are {', '.join(attached)}" if attached else "none is"
                raise OptionError(f"suggestion {name!r} is not attached: {known}.")
        kept = tuple(name for name in attached if name not in gone)
        return self._accepting(kept, self.options.psa_choice)

    def resolved(self, choice: PsaChoice | None) -> Learning:
        """The policy with all PSA nodes turned into the chosen node; None leaves them."""
        return self._accepting(self.options.attach, choice)

    def edited(self, edit: Callable[[nodes.Node], nodes.Node]) -> Learning:
        """The policy with a tree that a person changed (see `behavior_tree.paths`).

        Later attachments and resolutions apply to the changed tree.

        Args:
            edit: A function from the tree to the changed one.

        Raises:
            ValueError: The changed tree has undeclared features or actions.
        """
        learned = _changed(self.learned, edit(self.learned.tree), self.evidence)
        offered = tuple(suggestion for suggestion in learned.suggestions if not suggestion.attached)
        plain = replace(learned, suggestions=offered)
        return replace(self, plain=plain)._accepting((), None)

    def explain(self, row: int) -> Explanation:
        """Why the tree does what it does in a row: the branch, and the rows that taught it.

        Args:
            row: Position in the table, whose earlier actions count.  For states that nobody showed,
                see `verification.explaining.explain`.

        Raises:
            OptionError: There is no such row.
            RuleError: The tree cannot be explained.
        """
        table = self.table
        if not 0 <= row < len(table):
            raise OptionError(f"there is no row {row}: choose one of 0 to {len(table) - 1}.")
        values = table.states[row].tolist()
        (explanation,) = explain(
            self.learned, values, {table.channel: history_at(table, row)}, [table]
        )
        return explanation

    def _accepting(self, attach: tuple[str, ...], choice: PsaChoice | None) -> Learning:
        options = replace(self.options, attach=attach, psa_choice=choice)
        return learned_as_asked(
            self.plain,
            self.decision_tree,
            self.policy,
            replace(self.evidence, options=options),
            late=self.late,
            further=self.further,
        )


def learned_as_asked(
    plain: LearnedTree,
    decision_tree: TrainedTree,
    policy: ChosenPolicy,
    evidence: Evidence,
    *,
    late: tuple[str, ...] = (),
    further: tuple[str, ...] = (),
) -> Learning:
    """A policy with suggestions attached and PSA nodes resolved as its options say.

    Raises:
        OptionError: There is no suggestion with this id.
    """
    options = evidence.options
    tree, suggestions = accept(plain.tree, plain.suggestions, options)
    table = evidence.learned_from
    sample = structure_sample(table, options)
    report = report_on(
        table,
        tree,
        decision_tree.vocabulary.history,
        policy.levels,
        policy.ccp_alpha,
        None if sample is None else report_on_sample(sample, table, decision_tree),
    )
    return Learning(
        replace(_changed(plain, tree, evidence), suggestions=suggestions),
        plain,
        decision_tree,
        policy,
        evidence,
        report,
        late,
        further,
    )


def _changed(learned: LearnedTree, tree: nodes.Node, evidence: Evidence) -> LearnedTree:
    """A policy with another tree; without its figures, where that does something else."""
    if evaluation.does_the_same(learned.tree, tree, evidence.table, evidence.held_out):
        return replace(learned, tree=tree)
    origin = learned.provenance
    provenance = replace(origin, figures=origin.figures.forgotten())
    return replace(learned, tree=tree, provenance=provenance)
