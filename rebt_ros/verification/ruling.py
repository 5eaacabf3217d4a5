"""Trees that are let through: those that keep their rules, or are mended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification.contradictions import agreeing_demands
from rebt_ros.verification.errors import BrokenRuleError
from rebt_ros.verification.proof import check
from rebt_ros.verification.repairing import repair
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.sweep import Results
from rebt_ros.verification.verdict import Verdict, verdicts
from rebt_ros.verification.verdict_text import what_breaks


@dataclass(frozen=True, slots=True)
class Ruled:
    """A tree that is proven to keep its rules."""

    learned: LearnedTree
    verdicts: tuple[Verdict, ...]
    """Of its rules, which are all proven."""

    @property
    def rules(self) -> tuple[str, ...]:
        """Its rules, each in a line."""
        return tuple(str(verdict.demand.rule) for verdict in self.verdicts)


def ruled(
    learned: LearnedTree,
    rules: RuleSet,
    tables: Sequence[DemonstrationTable] = (),
    *,
    results: Results = Results.AT_ONCE,
    mend: bool = False,
) -> Ruled:
    """The tree if it keeps all its rules, or a mended one that does.

    Args:
        learned: The tree.
        rules: What it must keep.
        tables: What was shown, with the features of the tree.
        results: How actions end.
        mend: Whether to put guards into a tree that breaks a rule.

    Raises:
        BrokenRuleError: It is not proven to keep a rule.
        RuleError: The rules do not fit it, or guards are not enough.
    """
    asked = agreeing_demands(rules, learned)
    proofs = check(learned, asked, tables, results)
    found = verdicts(proofs, asked)
    broken = what_breaks(learned, proofs, found)
    if not broken:
        return Ruled(learned, found)
    if not mend:
        raise BrokenRuleError(f"{broken} ({rules.source}).")
    mended = repair(learned, asked, tables, results)
    return Ruled(mended.learned, mended.verdicts)
