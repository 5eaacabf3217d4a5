"""Replay of a behavior tree over recorded rows: where it agrees with what was shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.lags import with_lags
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.schema import TRUTH, Feature, FeatureKind, number_of
from rebt_ros.demonstration.table import DemonstrationTable, category, tabulate
from rebt_ros.errors import InputError
from rebt_ros.learning import evaluation
from rebt_ros.learning.late_actions import rows_in, shifted, tells_time


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A row in which the tree, with its own history, did not choose the shown action."""

    demonstration: str
    row: int
    """Position in its demonstration, from 0."""
    seconds: float
    """Seconds since the first row of its demonstration."""
    shown: str
    chosen: str | None
    """None if the tree chose no action."""


@dataclass(frozen=True, eq=False, slots=True)
class Replay:
    """The choices of a tree on the recorded rows of a channel."""

    channel: str
    rows: int
    teacher_forced_agreement: float
    own_history_agreement: float
    actions: tuple[str, ...]
    """Labels of the rows and columns of `confusion`: shown ones first, then others of the tree."""
    confusion: IntArray
    """Rows by shown action and by choice with own history, shape (actions, actions + 1); the last
    column counts rows without a choice."""
    disagreements: tuple[Disagreement, ...]
    foreign: Mapping[str, int]
    """Shown labels that are not actions of the tree, and their numbers of rows."""


def replay(learned: LearnedTree, demonstrations: Sequence[Demonstration]) -> tuple[Replay, ...]:
    """Runs a tree over recorded rows, in their order.

    If the tree was learned from late actions, the same delay is first undone in the recorded ones.

    Args:
        learned: The tree.
        demonstrations: The recorded rows.  A tree of one channel runs over a recording of one
            channel, whatever their names; otherwise channels are matched by name.

    Returns:
        One result for each channel of the tree that was recorded.

    Raises:
        InputError: There are no rows, or they lack a channel or a feature that the tree tests.
    """
    policies = nodes.policies(learned.tree)
    return tuple(
        _replay(learned, policies[table.channel], table)
        for table in rows_for(learned, demonstrations)
    )


def rows_for(
    learned: LearnedTree, demonstrations: Sequence[Demonstration]
) -> tuple[DemonstrationTable, ...]:
    """Recorded rows as a tree reads them, with its features and channels; see `replay`.

    Returns:
        One result for each channel of the tree that was recorded.

    Raises:
        InputError: There are no rows, or they lack a channel or a feature that the tree tests.
    """
    policies = nodes.policies(learned.tree)
    lags = max((feature.lag for feature in learned.features), default=0)
    tables = {
        table.channel: with_lags(shifted(table, _late(learned, table)), lags)
        for table in tabulate(demonstrations)
    }
    if len(policies) == len(tables) == 1:
        [(channel, policy)], [table] = policies.items(), tables.values()
        return (_as_the_tree_reads(learned, channel, policy, table),)
    common = [channel for channel in policies if channel in tables]
    if not common:
        raise InputError(
            f"the recording has actions on {', '.join(map(repr, tables))} but not on "
            f"{', '.join(map(repr, policies))}, for which the tree decides: "
            "choose the action topics, or the label columns of a table."
        )
    return tuple(
        _as_the_tree_reads(learned, channel, policies[channel], tables[channel])
        for channel in common
    )


def agreement_on(learned: LearnedTree, table: DemonstrationTable) -> float | None:
    """Own-history agreement of a tree with rows that another tree was judged on.

    Args:
        learned: The tree.
        table: Rows of one channel, in the form that trees are learned from.

    Returns:
        None if there are no rows, or if the tree has other channels or features.
    """
    policy = nodes.policies(learned.tree).get(table.channel)
    if policy is None or not len(table):
        return None
    try:
        rows = _as_the_tree_reads(learned, table.channel, policy, table)
    except InputError:
        return None
    return float(np.mean(evaluation.own_history_choices(policy, rows) == rows.chosen))


def _late(learned: LearnedTree, table: DemonstrationTable) -> int:
    """The delay that the tree was learned with, in rows of this recording."""
    seconds, rows = learned.provenance.late_seconds, learned.provenance.late_rows
    return rows_in(table, seconds) if seconds is not None and tells_time(table) else rows


def _replay(learned: LearnedTree, policy: nodes.Node, table: DemonstrationTable) -> Replay:
    own = evaluation.own_history_choices(policy, table)
    forced = evaluation.teacher_forced_choices(policy, table)
    confusion = np.zeros((len(table.actions), len(table.actions) + 1), dtype=np.int64)
    # NO_ACTION is -1, the last column.
    np.add.at(confusion, (table.chosen, own), 1)
    return Replay(
        table.channel,
        len(table),
        float(np.mean(forced == table.chosen)),
        float(np.mean(own == table.chosen)),
        table.actions,
        confusion,
        _disagreements(table, own),
        _foreign(learned, table),
    )


def _foreign(learned: LearnedTree, table: DemonstrationTable) -> dict[str, int]:
    """Shown labels that the tree does not have, and their numbers of rows."""
    known = {action.label for action in learned.actions if action.channel == table.channel}
    rows = np.bincount(table.chosen, minlength=len(table.actions)).tolist()
    return {
        label: count
        for label, count in zip(table.actions, rows, strict=True)
        if count and label not in known
    }


def _disagreements(table: DemonstrationTable, chosen: IntArray) -> tuple[Disagreement, ...]:
    rows = np.flatnonzero(chosen != table.chosen)
    first = np.searchsorted(table.demonstration, table.demonstration[rows])
    return tuple(
        Disagreement(
            table.demonstrations[table.demonstration[row]],
            int(row - start),
            float(table.stamps[row] - table.stamps[start]) / 1e9,
            table.actions[table.chosen[row]],
            None if chosen[row] == NO_ACTION else table.actions[chosen[row]],
        )
        for row, start in zip(rows, first, strict=True)
    )


def _as_the_tree_reads(
    learned: LearnedTree, channel: str, policy: nodes.Node, table: DemonstrationTable
) -> DemonstrationTable:
    """The rows with the features, the channel and all actions of the tree."""
    tested = nodes.features(policy)
    recorded = {feature.name: place for place, feature in enumerate(table.features)}
    missing = sorted(tested - set(recorded))
    if missing:
        names = (feature.name for feature in table.features if not feature.lag)
        raise InputError(
            f"the tree tests the feature {missing[0]!r}, which the recording lacks: "
            f"it has {', '.join(names)}."
        )
    columns = [
        _translated(feature, table.features[recorded[name]], table.states[:, recorded[name]])
        if (name := feature.name) in recorded
        else np.full(len(table), np.nan)
        for feature in learned.features
    ]
    mine = {action.label for action in learned.actions if action.channel == channel}
    others = sorted(mine - set(table.actions))
    return replace(
        table,
        channel=channel,
        features=learned.features,
        states=np.column_stack(columns) if columns else np.empty((len(table), 0)),
        actions=(*table.actions, *others),
    )


def _translated(wanted: Feature, recorded: Feature, values: FloatArray) -> FloatArray:
    if wanted.kind is not FeatureKind.CATEGORICAL:
        if recorded.kind is FeatureKind.CATEGORICAL:
            raise InputError(
                f"the feature {wanted.name!r} is {wanted.kind.value} for the tree, "
                "but the recording holds text."
            )
        return values
    position = {name: float(place) for place, name in enumerate(wanted.categories)}
    if recorded.kind is FeatureKind.BINARY and position.keys() <= TRUTH.keys():
        position = {category(TRUTH[name]): place for name, place in position.items()}
    elif not recorded.categories and all(number_of(name) is None for name in position):
        raise InputError(
            f"the feature {wanted.name!r} is text for the tree ({wanted.examples}), "
            "but the recording holds numbers."
        )
    known = ~np.isnan(values)
    translated = np.full(len(values), np.nan)
    translated[known] = [
        position.get(
            recorded.categories[int(value)] if recorded.categories else category(value), np.nan
        )
        for value in values[known]
    ]
    return translated
