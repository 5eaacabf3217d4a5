"""Choosing what to learn: the pruning level, LAT, and PSA nodes.

All is decided by own-history agreement in cross-validation: how often a tree does what the
demonstrator did, on rows that it was not learned from, when LAT is what it chose itself before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from rebt_ros import evaluation
from rebt_ros.algorithms.priority_root import reduced_tree
from rebt_ros.algorithms.re_bt_espresso import re_bt_espresso
from rebt_ros.algorithms.rules import delta_close, leaf_rules
from rebt_ros.arrays import IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.decision_tree.training import FittedTree, TrainedTree, fit
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.options import LearnOptions, Use
from rebt_ros.selection import MOST_FOLDS, CrossValidation, JudgedLevels

#: With fewer rows the folds are too small to tell levels apart.
_FEWEST_ROWS = 50

#: Steps of two cross-validations, of running the trees of one, and of running them with PSA nodes
#: and without.
_MOST_STEPS = 2 * (MOST_FOLDS + 1) + MOST_FOLDS + 2 * MOST_FOLDS


@dataclass(frozen=True, eq=False, slots=True)
class Policy:
    """What was chosen, and why."""

    fitted: FittedTree
    ccp_alpha: float
    psa: bool
    """Whether PSA nodes stand in the tree."""
    levels: JudgedLevels | None
    """The pruning levels that were chosen from; None where there was no choice."""
    reasons: tuple[str, ...]
    """A sentence for each choice."""
    with_last_action: FittedTree | None = None
    """The tree of all rows that may test LAT, if there is one; `fitted` is it, or is preferred."""


class _Steps:
    """Counts steps of the work and tells which share of it is behind at most."""

    def __init__(self, advance: Callable[[float], None]) -> None:
        self._advance = advance
        self._taken = 0

    def __call__(self) -> None:
        self._taken += 1
        self._advance(self._taken / _MOST_STEPS)


def choose(
    table: DemonstrationTable,
    options: LearnOptions,
    advance: Callable[[float], None] = lambda share: None,
) -> Policy:
    """Chooses a policy.

    Args:
        table: By its rows alone.
        options: What is left to choose.
        advance: Told which share of the work is behind; there may be less of it.
    """
    if len(table) < _FEWEST_ROWS:
        return _unjudged(table, options)
    judged, level, reasons, with_lat = _last_action_and_level(table, options, _Steps(advance))
    ccp_alpha = options.ccp_alpha
    if ccp_alpha is None:
        ccp_alpha = float(level.ccp_alphas[level.chosen])
        reasons.append(
            f"Of {len(level.ccp_alphas)} pruning levels, ccp_alpha = {ccp_alpha:.3g} makes the "
            f"smallest tree whose agreement ({level.means[level.chosen]:.1%}) is within one "
            f"standard error ({level.standard_errors[level.best]:.1%}) of the best "
            f"({level.means[level.best]:.1%})."
        )
    psa, reason = _choose_psa(judged, ccp_alpha, options)
    return Policy(judged.fitted, ccp_alpha, psa, level, (*reasons, reason), with_lat)


def convert(trained: TrainedTree, options: LearnOptions, *, psa: bool) -> nodes.Node:
    """The behavior tree of a decision tree.

    Raises:
        OptionError: The root asked for makes no sense.
    """
    delta = options.delta if psa else None
    if options.reductions is None:
        return re_bt_espresso(trained.tree, delta=delta, root=options.root)
    rules = leaf_rules(
        trained.tree,
        lambda leaf: (leaf.most_probable,) if delta is None else delta_close(leaf, delta),
    )
    return reduced_tree(rules, options.reductions, options.root)


def own_history_choices(
    trained: TrainedTree, table: DemonstrationTable, options: LearnOptions, *, psa: bool
) -> IntArray:
    """What the behavior tree of a decision tree chooses, LAT being what it chose before.

    Without LAT there is no need for the behavior tree, whose minimization takes long: it chooses
    what the leaf of the decision tree does, or the best supported one of the leaf's PSA group.
    """
    if trained.uses_last_action:
        return evaluation.own_history_choices(convert(trained, options, psa=psa), table)
    if not psa:
        return trained.predict(table)
    rules = leaf_rules(trained.tree, lambda leaf: delta_close(leaf, options.delta))
    place = {action: position for position, action in enumerate(trained.tree.actions)}
    first = {
        frozenset(place[one] for one in rule.actions): place[rule.actions[0]] for rule in rules
    }
    leaves, of_row = trained.deciding(table)
    chosen = [first[frozenset(delta_close(leaf, options.delta))] for leaf in leaves]
    return np.array(chosen, dtype=np.int64)[of_row]


def _unjudged(table: DemonstrationTable, options: LearnOptions) -> Policy:
    """Without cross-validation: no pruning, LAT and PSA only where they are asked for."""
    fitted = fit(
        table,
        last_action=options.last_action is Use.ALWAYS,
        max_depth=options.max_depth,
        random_state=options.random_state,
        upsample=options.upsample,
    )
    reason = f"{len(table)} rows are too few to choose by: the tree is not pruned."
    ccp_alpha = options.ccp_alpha or 0.0
    return Policy(fitted, ccp_alpha, options.psa is Use.ALWAYS, None, (reason,))


def _last_action_and_level(
    table: DemonstrationTable, options: LearnOptions, step: Callable[[], None]
) -> tuple[CrossValidation, JudgedLevels, list[str], FittedTree | None]:
    def cross_validation(last_action: bool) -> CrossValidation:
        return CrossValidation(
            table,
            last_action=last_action,
            max_depth=options.max_depth,
            random_state=options.random_state,
            upsample=options.upsample,
            step=step,
        )

    def run(judged: CrossValidation) -> JudgedLevels:
        return judged.own_history(partial(own_history_choices, options=options, psa=False))

    if options.last_action is Use.ALWAYS:
        with_lat = cross_validation(last_action=True)
        return with_lat, run(with_lat), [], with_lat.fitted
    without = cross_validation(last_action=False)
    plain = run(without)
    if options.last_action is Use.NEVER:
        return without, plain, [], None
    with_lat = cross_validation(last_action=True)
    forced = with_lat.teacher_forced().means.max()
    if forced <= plain.means[plain.best]:
        # Its own history cannot be expected to do better than the demonstrator's.
        reason = f"{forced:.1%} even with the demonstrator's own"
        own = None
    else:
        own = run(with_lat)
        reason = f"{own.means[own.best]:.1%} with its own history"
    compared = f"({reason}, {plain.means[plain.best]:.1%} without)"
    if own is None or own.means[own.best] <= plain.means[plain.best]:
        reasons = [f"The last action taken does not raise agreement {compared}."]
        return without, plain, reasons, with_lat.fitted
    reasons = [f"Testing the last action taken raises agreement {compared}."]
    return with_lat, own, reasons, with_lat.fitted


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
