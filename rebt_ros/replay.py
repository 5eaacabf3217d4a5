"""Replay of a behavior tree over recorded rows: where it would have done what was shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rebt_ros import evaluation
from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.last_action import NO_ACTION
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable, category, tabulate
from rebt_ros.errors import InputError
from rebt_ros.logic.conditions import LastActionIs


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A row in which the tree, with its own history, chose something else than was shown."""

    demonstration: str
    row: int
    """Position in its demonstration, from 0."""
    seconds: float
    """Since the first row of its demonstration."""
    shown: str
    chosen: str | None
    """None where the tree chose no action."""


@dataclass(frozen=True, eq=False, slots=True)
class Replay:
    """What a tree did on recorded rows."""

    rows: int
    teacher_forced_agreement: float
    own_history_agreement: float
    actions: tuple[str, ...]
    """Labels of the rows and columns of `confusion`: those shown, then others of the tree."""
    confusion: IntArray
    """Rows by what was shown and what was chosen with own history, shape (actions, actions + 1);
    the last column counts rows in which no action was chosen."""
    disagreements: tuple[Disagreement, ...]


def replay(learned: LearnedTree, demonstrations: Sequence[Demonstration]) -> Replay:
    """Runs a tree over recorded rows, in their order.

    Args:
        learned: The tree.
        demonstrations: What was recorded; of several channels the tree's own is taken.

    Raises:
        InputError: There are no rows, or they lack a feature that the tree tests.
    """
    table = _table_for(learned, demonstrations)
    own = evaluation.own_history_choices(learned.tree, table)
    forced = evaluation.teacher_forced_choices(learned.tree, table)
    confusion = np.zeros((len(table.actions), len(table.actions) + 1), dtype=np.int64)
    # NO_ACTION is -1 and so counts in the last column.
    np.add.at(confusion, (table.chosen, own), 1)
    return Replay(
        len(table),
        float(np.mean(forced == table.chosen)),
        float(np.mean(own == table.chosen)),
        table.actions,
        confusion,
        _disagreements(table, own),
    )


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


def _table_for(learned: LearnedTree, demonstrations: Sequence[Demonstration]) -> DemonstrationTable:
    """The rows as the tree reads them: its features, its channel, and its actions known."""
    channel = learned.actions[0].channel
    tables = {table.channel: table for table in tabulate(demonstrations)}
    if len(tables) > 1 and channel not in tables:
        raise InputError(
            f"the recording has actions on {', '.join(map(repr, sorted(tables)))} but not on "
            f"{channel!r}, for which the tree decides: choose one action topic."
        )
    table = tables[channel] if len(tables) > 1 else next(iter(tables.values()))
    tested = {
        one.literal.condition.feature
        for one in nodes.conditions(learned.tree)
        if not isinstance(one.literal.condition, LastActionIs)
    }
    recorded = {feature.name: place for place, feature in enumerate(table.features)}
    missing = sorted(tested - set(recorded))
    if missing:
        raise InputError(
            f"the tree tests the feature {missing[0]!r}, which the recording lacks: "
            f"it has {', '.join(recorded)}."
        )
    columns = [
        _as_the_tree_reads(feature, table.features[recorded[name]], table.states[:, recorded[name]])
        if (name := feature.name) in recorded
        else np.full(len(table), np.nan)
        for feature in learned.features
    ]
    others = sorted({action.label for action in learned.actions} - set(table.actions))
    return replace(
        table,
        channel=channel,
        features=learned.features,
        states=np.column_stack(columns) if columns else np.empty((len(table), 0)),
        actions=(*table.actions, *others),
    )


def _as_the_tree_reads(wanted: Feature, recorded: Feature, values: FloatArray) -> FloatArray:
    if wanted.kind is not FeatureKind.CATEGORICAL:
        if recorded.kind is FeatureKind.CATEGORICAL:
            raise InputError(
                f"the feature {wanted.name!r} is {wanted.kind.value} for the tree, "
                "but the recording holds text."
            )
        return values
    position = {name: float(place) for place, name in enumerate(wanted.categories)}
    known = ~np.isnan(values)
    translated = np.full(len(values), np.nan)
    translated[known] = [
        position.get(
            recorded.categories[int(value)] if recorded.categories else category(value), np.nan
        )
        for value in values[known]
    ]
    return translated
