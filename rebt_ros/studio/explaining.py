"""Why a tree does what it does: now, some minutes ago, or at a moment of a demonstration."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import name_text
from rebt_ros.demonstration.last_action import ActionHistory
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import OptionError
from rebt_ros.learning.learning import Learning
from rebt_ros.studio.timeline import Moment, Timeline
from rebt_ros.studio.tree_view import Json
from rebt_ros.studio.verbs import Answer, Arguments
from rebt_ros.verification.acting import Step, acting_leaves, commanding
from rebt_ros.verification.explaining import Explanation, explain
from rebt_ros.verification.explanation_text import lines
from rebt_ros.verification.support import Support, support_of


class Explaining:
    """Answers questions about moments.

    Args:
        learning: Gives the policy of the draft; raises `OptionError` where there is none.
        published: Gives the tree that is published.
        timeline: Has the last minutes.
    """

    def __init__(
        self,
        learning: Callable[[], Learning],
        published: Callable[[], LearnedTree | None],
        timeline: Timeline,
    ) -> None:
        self._learning = learning
        self._published = published
        self._timeline = timeline

    def moment(self, seconds: float) -> Answer:
        """What was so at a time (seconds since the epoch).

        Raises:
            OptionError: It is too long ago, or nothing was known then.
        """
        moment = self._timeline.at(seconds)
        if moment is None:
            raise OptionError("nothing is known of that time: the last ten minutes are kept.")
        return "then", {
            "t": moment.time,
            "document": moment.document,
            "statuses": list(moment.statuses),
            "values": dict(moment.values),
            "commands": dict(moment.commands),
        }

    def explain(self, asked: Arguments) -> Answer:
        """Why a tree does what it does: the draft at a moment of a demonstration, else what runs.

        Raises:
            RebtError: There is no such moment, or the tree cannot be explained.
        """
        demonstration = asked.optional_text("demonstration")
        if demonstration:
            return self._of_demonstration(demonstration, asked.number("seconds"))
        seconds = asked.optional_number("t")
        now = time.time() if seconds is None else seconds
        moment = self._timeline.at(now)
        if moment is None:
            raise OptionError("nothing is known of that time: the last ten minutes are kept.")
        return self._of_moment(moment)

    def branch(self, asked: Arguments) -> Answer:
        """In which demonstrations a branch acts: of the draft, or of the robot's tree.

        Raises:
            RebtError: There is no such branch, or its tree was learned from something else.
        """
        learning = self._learning()
        learned = self._published() if asked.flag("robot") else learning.learned
        if learned is None:
            raise OptionError("no tree is published yet.")
        try:
            path = paths.path_of(asked.text("path"))
            paths.node_at(learned.tree, path)
        except LookupError as err:
            raise OptionError(f"{err}: the tree has changed since; try again.") from err
        table = learning.table
        channels = {action.channel for action in nodes.actions(learned.tree)}
        if learned.features != table.features or channels - {table.channel}:
            raise OptionError("this tree was not learned from the demonstrations that are here.")
        # A condition acts with the branch that it is in.
        while path and not any(nodes.actions(paths.node_at(learned.tree, path))):
            path = path[:-1]
        support = support_of(table, _rows_of(learned.tree, path, table))
        shown = ", ".join(f"{name_text(label)} {rows}" for label, rows in support.actions)
        words = f"{support.rows} of {len(table)} rows that were shown"
        return (
            f"its branch acts in {words}: {shown}." if shown else f"its branch acts in {words}.",
            {"from": _visits(support)},
        )

    def _of_demonstration(self, name: str, seconds: float) -> Answer:
        learning = self._learning()
        table = learning.table
        row = _row(table, name, seconds)
        values = table.states[row].tolist()
        explanation = learning.explain(row)
        told = _told(learning.learned, values, [explanation])
        done = table.actions[int(table.chosen[row])]
        told["lines"] = [f"shown: {name_text(done)}", *told["lines"]]
        return f"row {row}", told

    def _of_moment(self, moment: Moment) -> Answer:
        learned = self._published()
        if learned is None:
            raise OptionError("no tree is published yet.")
        values = [_coded(feature, moment.values) for feature in learned.features]
        histories = {
            channel: ActionHistory(self._timeline.done_before(moment.time, channel))
            for channel in moment.commands
        }
        try:
            tables = [self._learning().table]
        except OptionError:
            tables = []
        tables = [table for table in tables if table.features == learned.features]
        return "then", _told(learned, values, explain(learned, values, histories, tables))


def _rows_of(tree: nodes.Node, path: paths.Path, table: DemonstrationTable) -> IntArray:
    """The rows in which an action of a branch acts."""
    leaves = [where for where, node in paths.walk(tree) if isinstance(node, nodes.Action)]
    its = [place for place, where in enumerate(leaves) if where[: len(path)] == path]
    return np.flatnonzero(np.isin(acting_leaves(tree, table), its))


def _visits(support: Support) -> list[dict[str, Json]]:
    """The demonstrations with most rows, and where in them the first one is."""
    return [
        {"demonstration": name, "rows": rows, "seconds": seconds}
        for name, rows, seconds in support.demonstrations
    ]


def _told(
    learned: LearnedTree, values: Sequence[float], explanations: Sequence[Explanation]
) -> dict[str, Json]:
    told: list[str] = []
    sources: list[dict[str, Json]] = []
    acting: str | None = None
    for explanation in explanations:
        if len(explanations) > 1:
            told.append(f"Channel {explanation.channel}:")
        its = _visits(explanation.support) if explanation.support is not None else []
        named = tuple(f"{visit['demonstration']}: " for visit in its)
        # The demonstrations are told by buttons that lead to them.
        told += [
            line
            for line in lines(learned, values, explanation)
            if not line.lstrip().startswith(named)
        ]
        sources += its
        acting = acting or _acting(learned, explanation)
    return {
        "lines": told,
        "values": {
            feature.name: _plain(feature, value)
            for feature, value in zip(learned.features, values, strict=True)
        },
        "acting": acting,
        "statuses": _statuses(learned, explanations),
        "from": sources,
    }


def _statuses(learned: LearnedTree, explanations: Sequence[Explanation]) -> list[str] | None:
    """The status of each node in preorder; None for several channels, which tick by themselves."""
    if len(explanations) > 1:
        return None
    statuses: list[str] = []

    def note(node: nodes.Node, step: Step | None) -> None:
        statuses.append("INVALID" if step is None else step.outcome.name)
        ticked = step.children if step else ()
        for child, below in zip_longest(nodes.children(node), ticked):
            note(child, below)

    note(learned.tree, explanations[0].trace)
    return statuses


def _acting(learned: LearnedTree, explanation: Explanation) -> str | None:
    """The path of the action that is commanded; None if there is none, or several like it."""
    step = commanding(explanation.trace, learned.tree)
    if step is None:
        return None
    actions = [path for path, node in paths.walk(learned.tree) if isinstance(node, nodes.Action)]
    return paths.text_of(actions[step.leaf]) if step.leaf < len(actions) else None


def _row(table: DemonstrationTable, name: str, seconds: float) -> int:
    """The last row of a demonstration up to a time since its first one."""
    for number, known in enumerate(table.demonstrations):
        if known == name or known.removesuffix(".rec") == name:
            rows = np.flatnonzero(table.demonstration == number)
            if len(rows):
                since = (table.stamps[rows] - table.stamps[rows[0]]) / 1e9
                place = int(np.searchsorted(since, seconds, side="right")) - 1
                return int(rows[max(place, 0)])
    raise OptionError(
        f"the tree was not learned from {name!r}: learn again, with this demonstration."
    )


def _plain(feature: Feature, value: float) -> float | str | None:
    """A value as the board has it, the reverse of `_coded`; None where it is missing."""
    if not math.isfinite(value):
        return None
    return feature.categories[int(value)] if feature.kind is FeatureKind.CATEGORICAL else value


def _coded(feature: Feature, values: Mapping[str, Any]) -> float:
    """A value as trees have it; NaN where it is missing."""
    value = values.get(feature.name)
    if value is None:
        return math.nan
    if feature.kind is not FeatureKind.CATEGORICAL:
        return float(value)
    name = value if isinstance(value, str) else f"{value:g}"
    return float(feature.categories.index(name)) if name in feature.categories else math.nan
