"""From demonstrations to one learned tree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rebt_ros import evaluation
from rebt_ros.arrays import BoolArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance
from rebt_ros.choosing import Policy, choose, convert
from rebt_ros.decision_tree.training import TrainedTree, train
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.errors import InputError
from rebt_ros.options import DEFAULTS, LearnOptions, Use

#: Former name of `Use`.
LastActionUse = Use


@dataclass(frozen=True, eq=False, slots=True)
class Learning:
    """A learned tree beside what it was made from."""

    learned: LearnedTree
    decision_tree: TrainedTree
    table: DemonstrationTable
    held_out: BoolArray
    """Rows that the tree was judged on, shape (rows,)."""
    policy: Policy
    """What was chosen to learn, and why."""


#: Told what is being done and which share of the work is behind.
Progress = Callable[[str, float], None]


def learn(
    demonstrations: Sequence[Demonstration],
    options: LearnOptions = DEFAULTS,
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
    options: LearnOptions = DEFAULTS,
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
    shown = table.where(~held_out)
    progress("choosing", 0.1)
    policy = choose(shown, options)
    progress("judging", 0.8)
    trained = policy.fitted.at(policy.ccp_alpha)
    tree = convert(trained, options, psa=policy.psa)
    rows = table.where(held_out)
    forced = evaluation.agreement(evaluation.teacher_forced_choices(tree, rows), rows)
    own = evaluation.agreement(evaluation.own_history_choices(tree, rows), rows)
    if options.refit and held_out.any():
        progress("refitting", 0.9)
        trained = _refit(table, options, policy)
        tree = convert(trained, options, psa=policy.psa)
    mismatches = np.sum(evaluation.teacher_forced_choices(tree, table) != trained.predict(table))
    figures = Figures(int(mismatches), forced, own, int(held_out.sum()))
    learned = LearnedTree(
        table.features,
        evaluation.actions_of(table),
        tree,
        Provenance(
            demonstrations=len(np.unique(table.demonstration)),
            rows=len(table),
            delta=options.delta,
            max_depth=options.max_depth,
            ccp_alpha=policy.ccp_alpha,
            root=options.root,
            uses_last_action=trained.uses_last_action,
            figures=figures,
        ),
    )
    progress("done", 1.0)
    return Learning(learned, trained, table, held_out, policy)


def _refit(table: DemonstrationTable, options: LearnOptions, policy: Policy) -> TrainedTree:
    return train(
        table,
        last_action=policy.fitted.uses_last_action,
        max_depth=options.max_depth,
        ccp_alpha=policy.ccp_alpha,
        random_state=options.random_state,
    )


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
