"""The rules of a node, held against trees."""

from __future__ import annotations

from collections.abc import Sequence

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.ruling import Ruled, ruled
from rebt_ros.verification.sweep import Results


def kept(
    learned: LearnedTree,
    rules: RuleSet | None,
    tables: Sequence[DemonstrationTable] = (),
    *,
    action_results: bool,
    mend: bool = False,
) -> Ruled:
    """The tree if it keeps its rules, or a mended one that does.

    Args:
        learned: The tree.
        rules: What it must keep; None: nothing.
        tables: What was shown, with the features of the tree.
        action_results: Whether actions may fail or go on.
        mend: Whether to put guards into a tree that breaks a rule.

    Raises:
        RuleError: It is not proven to keep a rule, or the rules do not fit it.
    """
    if rules is None:
        return Ruled(learned, ())
    results = Results.REPORTED if action_results else Results.AT_ONCE
    return ruled(learned, rules, tables, results=results, mend=mend)
