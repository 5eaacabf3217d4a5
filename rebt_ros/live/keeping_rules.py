"""The rules of a node: read from their file, and held against trees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.storage.text import read_text
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.rules_file import loads
from rebt_ros.verification.ruling import Ruled, ruled
from rebt_ros.verification.sweep import Results


def read_rules(path: Path) -> RuleSet:
    """Reads a file of rules.

    Raises:
        InputError: There is no such text file.
        RuleError: It is malformed.
    """
    return loads(read_text(path), str(path))


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
        return Ruled(learned)
    results = Results.REPORTED if action_results else Results.AT_ONCE
    return ruled(learned, rules, tables, results=results, mend=mend)
