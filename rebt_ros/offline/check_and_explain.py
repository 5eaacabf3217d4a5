"""Checks of learned trees: the Python side of the commands ``check`` and ``explain``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.table import DemonstrationTable, history_at
from rebt_ros.errors import OptionError
from rebt_ros.learning.replaying import rows_for
from rebt_ros.offline.rules_files import rules_for
from rebt_ros.offline.trees_and_rows import as_learned_tree, demonstrations_for
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.verification.comparing import Comparison, compare
from rebt_ros.verification.contradictions import agreeing_demands
from rebt_ros.verification.errors import TooManyPartsError
from rebt_ros.verification.explaining import Explanation
from rebt_ros.verification.explaining import explain as explain_state
from rebt_ros.verification.findings import Findings, find
from rebt_ros.verification.proof import check as prove
from rebt_ros.verification.repairing import Repaired, repair
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.sweep import Results
from rebt_ros.verification.verdict import Answer, ChannelProof, Verdict, verdicts


@dataclass(frozen=True, eq=False, slots=True)
class Checked:
    """What is known of a tree."""

    learned: LearnedTree
    proofs: tuple[ChannelProof, ...]
    """Of each channel."""
    verdicts: tuple[Verdict, ...]
    """Of each rule, in their order."""
    findings: tuple[Findings, ...]
    """Of each channel; none where there are too many states to look at, see `not_found`."""
    not_found: str
    """Why there are no findings; empty where there are."""
    comparisons: tuple[Comparison, ...]
    """With another tree, where one was given."""
    rows: tuple[DemonstrationTable, ...]
    """What was shown, where it was given."""
    results: Results
    """How actions were taken to end."""

    @property
    def keeps_all(self) -> bool:
        """Whether every rule is proven."""
        return all(verdict.answer is Answer.PROVEN for verdict in self.verdicts)


@dataclass(frozen=True, eq=False, slots=True)
class Situation:
    """A state, and what was done before."""

    values: tuple[float, ...]
    """One for each feature of the tree, as tables hold them."""
    histories: Mapping[str, ActionHistory]
    """By channel."""


def check(
    tree: LearnedTree | str | Path,
    rules: RuleSet | str | Path | None = None,
    inputs: Sequence[str | Path] = (),
    *,
    against: LearnedTree | str | Path | None = None,
    reading: InputOptions | None = None,
    results: Results = Results.AT_ONCE,
) -> Checked:
    """Proves or refutes rules for every state, and looks for what is noticeable about a tree.

    Args:
        tree: A learned tree, or the file of one.
        rules: Rules, or the file of some, beside those of the robot file that the tree carries.
        inputs: What was shown: bags, recordings and CSV tables.
        against: Another tree, or its file, that the tree is compared with.
        reading: How to read the inputs.
        results: How actions end.

    Raises:
        RebtError: A file cannot be used, or rules do not fit the tree or each other.
    """
    learned = as_learned_tree(tree)
    ruled = rules_for(rules, learned.robot)
    asked = () if ruled is None else agreeing_demands(ruled, learned)
    tables = _rows(learned, inputs, reading)
    proofs = prove(learned, asked, tables, results)
    findings: tuple[Findings, ...] = ()
    not_found = ""
    try:
        findings = find(learned, tables, results)
    except TooManyPartsError as err:
        # Rules are proven without looking at all parts.
        not_found = str(err)
    return Checked(
        learned,
        proofs,
        verdicts(proofs, asked),
        findings,
        not_found,
        () if against is None else compare(learned, as_learned_tree(against), tables),
        tables,
        results,
    )


def repaired(checked: Checked) -> Repaired:
    """The tree with guards that make it keep its rules.

    Raises:
        RuleError: Guards are not enough.
    """
    asked = [verdict.demand for verdict in checked.verdicts]
    return repair(checked.learned, asked, checked.rows, checked.results)


def explain(
    tree: LearnedTree | str | Path,
    values: Sequence[float],
    histories: Mapping[str, ActionHistory] | None = None,
    inputs: Sequence[str | Path] = (),
    *,
    reading: InputOptions | None = None,
) -> tuple[Explanation, ...]:
    """Why a tree does in a state what it does, channel by channel.

    Args:
        tree: A learned tree, or the file of one.
        values: One for each of its features, as tables hold them.
        histories: What was done before, by channel; nothing by default.
        inputs: What was shown: bags, recordings and CSV tables.
        reading: How to read the inputs.

    Raises:
        RebtError: A file cannot be used.
    """
    learned = as_learned_tree(tree)
    return explain_state(learned, values, histories, _rows(learned, inputs, reading))


def row_of(
    learned: LearnedTree,
    row: int,
    demonstration: str | None,
    inputs: Sequence[str | Path],
    *,
    reading: InputOptions | None = None,
) -> Situation:
    """A row of a recording as the tree met it.

    Args:
        learned: The tree.
        row: Its place in the demonstration, from 0.
        demonstration: Its name; may be None if there is only one.
        inputs: What was shown.
        reading: How to read it.

    Raises:
        RebtError: There is no such row, or an input cannot be used.
    """
    tables = _rows(learned, inputs, reading)
    if not tables:
        raise OptionError("name the INPUT that has the row.")
    names = tables[0].demonstrations
    if demonstration is None and len(names) > 1:
        raise OptionError(
            f"there are {len(names)} demonstrations ({', '.join(names[:3])}, …): name one with "
            "--demonstration."
        )
    wanted = names[0] if demonstration is None else demonstration
    if wanted not in names:
        raise OptionError(f"there is no demonstration {wanted!r}: there are {', '.join(names)}.")
    values: tuple[float, ...] = ()
    histories: dict[str, ActionHistory] = {}
    for table in tables:
        mine = np.flatnonzero(table.demonstration == names.index(wanted))
        if not 0 <= row < len(mine):
            raise OptionError(f"{wanted} has {len(mine)} rows, from 0: there is no row {row}.")
        place = int(mine[row])
        values = tuple(table.states[place].tolist())
        histories[table.channel] = history_at(table, place)
    return Situation(values, histories)


def _rows(
    learned: LearnedTree, inputs: Sequence[str | Path], reading: InputOptions | None
) -> tuple[DemonstrationTable, ...]:
    return rows_for(learned, demonstrations_for(learned, inputs, reading)) if inputs else ()
