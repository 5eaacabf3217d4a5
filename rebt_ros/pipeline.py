"""From demonstrations to one learned tree."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from rebt_ros import evaluation
from rebt_ros.algorithms.re_bt_espresso import re_bt_espresso
from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.decision_tree.training import TrainedTree, train
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.errors import InputError, OptionError


class LastActionUse(Enum):
    """Whether the executed tree may test LAT."""

    AUTO = "auto"
    """Only if that raises own-history agreement on the held-out rows."""
    ALWAYS = "always"
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class LearnOptions:
    """What section III of the paper leaves to the user, and how to judge the result.

    Raises:
        OptionError: A value out of its range.
    """

    delta: float = 0.0
    """PSA threshold δ in [0, 1] (paper: 0.3); 0 keeps the tree equal to its decision tree."""
    max_depth: int | None = 5
    """Splits on the decision tree's longest path; None for no limit."""
    ccp_alpha: float = 0.0
    """Complexity parameter of minimal cost-complexity pruning; 0 prunes nothing."""
    root: Root = Root.SELECTOR
    last_action: LastActionUse = LastActionUse.AUTO
    test_fraction: float = 0.25
    """Share of the rows, or of the demonstrations if several, that is held out; in [0, 1)."""
    refit: bool = False
    """Whether the tree is learned from all rows in the end, once it has been judged."""
    random_state: int = 0
    """Decides between equally good splits."""

    def __post_init__(self) -> None:
        if not 0 <= self.delta <= 1:
            raise OptionError(f"delta must lie between 0 and 1, not at {self.delta:g}.")
        if self.max_depth is not None and self.max_depth < 1:
            raise OptionError(f"max_depth must be at least 1, not {self.max_depth}.")
        if not 0 <= self.ccp_alpha < math.inf:
            raise OptionError(f"ccp_alpha must be 0 or more, not {self.ccp_alpha:g}.")
        if not 0 <= self.test_fraction < 1:
            raise OptionError(
                f"test_fraction must be at least 0 and less than 1, not {self.test_fraction:g}."
            )
        if not 0 <= self.random_state < 2**32:
            raise OptionError(f"random_state must be a 32-bit number, not {self.random_state}.")


@dataclass(frozen=True, eq=False, slots=True)
class Learning:
    """A learned tree beside what it was made from."""

    learned: LearnedTree
    decision_tree: TrainedTree
    table: DemonstrationTable
    held_out: BoolArray
    """Rows that the tree was judged on, shape (rows,)."""


#: Told what is being done and which share of the work is behind.
Progress = Callable[[str, float], None]


def learn(
    demonstrations: Sequence[Demonstration],
    options: LearnOptions = LearnOptions(),
    declared: Mapping[str, FeatureKind] | None = None,
) -> LearnedTree:
    """Learns one behavior tree from all demonstrations.

    Args:
        demonstrations: What was shown, oldest first.
        options: How to learn.
        declared: Kinds of features by name, where they should not be detected.

    Raises:
        InputError: Too few rows or actions, features that differ, or more than one channel.
        OptionError: A declared kind does not fit its feature.
    """
    return learn_from(only_channel(tabulate(demonstrations, declared)), options).learned


def only_channel(tables: Sequence[DemonstrationTable]) -> DemonstrationTable:
    """The table of demonstrations whose actions came on one channel.

    Raises:
        InputError: There are several channels.
    """
    if len(tables) > 1:
        names = ", ".join(repr(table.channel) for table in tables)
        raise InputError(
            f"the demonstrations hold actions of {len(tables)} channels ({names}): "
            "record or choose one action topic, as one tree decides for one channel."
        )
    return tables[0]


def learn_from(
    table: DemonstrationTable,
    options: LearnOptions = LearnOptions(),
    progress: Progress = lambda stage, share: None,
) -> Learning:
    """Learns one behavior tree from a table; see `learn`."""
    if len(np.unique(table.chosen)) < 2:
        shown = table.actions[table.chosen[0]]
        raise InputError(
            f"the {len(table)} rows show one action only ({shown!r}): "
            "demonstrate at least two, as there is nothing to decide between."
        )
    held_out = table.held_out(options.test_fraction)
    progress("judging", 0.0)
    candidates = [
        _Candidate(table, held_out, options, uses) for uses in _candidates(options, held_out)
    ]
    # max() keeps the first of equals: a tree without LAT, unless LAT raises the agreement.
    best = max(candidates, key=lambda one: one.own_history or 0.0)
    progress("learning", 0.5)
    trained, tree = (
        (best.trained, best.tree)
        if not options.refit or not held_out.any()
        else _fit(table, options, best.trained.uses_last_action)
    )
    mismatches = int(
        np.sum(evaluation.teacher_forced_choices(tree, table) != trained.predict(table))
    )
    learned = LearnedTree(
        table.features,
        evaluation.actions_of(table),
        tree,
        Provenance(
            demonstrations=len(np.unique(table.demonstration)),
            rows=len(table),
            delta=options.delta,
            max_depth=options.max_depth,
            ccp_alpha=options.ccp_alpha,
            root=options.root,
            uses_last_action=trained.uses_last_action,
            figures=Figures(
                fidelity_mismatches=mismatches,
                teacher_forced_agreement=best.teacher_forced,
                own_history_agreement=best.own_history,
                held_out_rows=int(held_out.sum()),
            ),
        ),
    )
    progress("done", 1.0)
    return Learning(learned, trained, table, held_out)


class _Candidate:
    """A tree learned from the rows that are not held out, and judged on those that are."""

    def __init__(
        self,
        table: DemonstrationTable,
        held_out: BoolArray,
        options: LearnOptions,
        uses_last_action: bool,
    ) -> None:
        self.trained, self.tree = _fit(table.where(~held_out), options, uses_last_action)
        rows = table.where(held_out)
        teacher_forced = evaluation.teacher_forced_choices(self.tree, rows)
        own_history = evaluation.own_history_choices(self.tree, rows)
        self.teacher_forced = evaluation.agreement(teacher_forced, rows)
        self.own_history = evaluation.agreement(own_history, rows)


def _candidates(options: LearnOptions, held_out: BoolArray) -> tuple[bool, ...]:
    match options.last_action:
        case LastActionUse.ALWAYS:
            return (True,)
        case LastActionUse.NEVER:
            return (False,)
        case LastActionUse.AUTO:
            # Without held-out rows there is no telling what LAT would do to the executed tree.
            return (False, True) if held_out.any() else (False,)


def _fit(
    table: DemonstrationTable, options: LearnOptions, uses_last_action: bool
) -> tuple[TrainedTree, nodes.Node]:
    trained = train(
        table,
        last_action=uses_last_action,
        max_depth=options.max_depth,
        ccp_alpha=options.ccp_alpha,
        random_state=options.random_state,
    )
    return trained, re_bt_espresso(trained.tree, delta=options.delta, root=options.root)


def summary_sentence(learned: LearnedTree) -> str:
    """What was learned, in one sentence."""
    provenance = learned.provenance
    figures = provenance.figures
    shown = provenance.demonstrations
    judged = (
        "not judged, as no rows were held out"
        if figures.own_history_agreement is None
        else f"it agrees with {figures.own_history_agreement:.1%} of {figures.held_out_rows} "
        "held-out rows"
    )
    return (
        f"Learned a behavior tree with {nodes.size(learned.tree)} nodes and "
        f"{len(nodes.actions(learned.tree))} actions from {provenance.rows} rows of "
        f"{shown} demonstration{'s' if shown != 1 else ''}; {judged}."
    )
