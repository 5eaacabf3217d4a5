"""What a person must know about a learned tree before it drives.

recall
    The recall of an action is the share of its rows on which the tree takes it, in
    cross-validation.
conflict
    A row for which another row has an equal state and another action: no tree of states alone can
    do both.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.demonstration.equal_states import codes_of_numbers, codes_of_states
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import number_of
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import listing
from rebt_ros.learning.judged_levels import JudgedLevels
from rebt_ros.learning.sample_report import SampleReport

#: How well agreement in cross-validation ranks the trees of a task by success (Spearman's rho): 0.6
#: for trees of the same demonstrations, 0.2 over sets and numbers of demonstrations
#: (docs/driving.md).
FORECAST = "weak: rank correlation with success 0.2 to 0.6 within a task"

#: Number of actions that a sentence lists.
_LISTED = 12

#: What people put around and between words.
_QUOTES = " \t\"'`“”\u2018\u2019«»"
_BETWEEN_WORDS = re.compile(r"(?<=[^\W\d_])[-_\s]+(?=[^\W\d_])|\s+")

#: Up to this share of what there is to gain, recall is hardly above chance.
_HARDLY = 0.1

#: Conflicts are mentioned from this share of the rows on.
_MENTIONED = 0.001


@dataclass(frozen=True, slots=True)
class ActionReport:
    """How well a shown action was learned."""

    label: str
    rows: int
    """Number of rows in which it was shown."""
    recall: float | None
    """None if there were too few rows for cross-validation."""
    taken: bool
    """Whether the tree ever takes it."""


@dataclass(frozen=True, slots=True)
class LearningReport:
    """What a person must know about the policy of a channel."""

    actions: tuple[ActionReport, ...]
    mean_recall: float | None
    agreement: float | None
    """Agreement in cross-validation, after the demonstrator's actions: the forecast of success."""
    most_frequent: float
    """Weighted share of rows that always taking the most frequent action would agree with."""
    conflicts: int
    """Rows."""
    conflicts_after_history: int
    """Rows in conflict with others after the same action, if the tree may test it."""
    rows: int
    weighted: bool = False
    """Whether demonstrations have weights, which count in cross-validation."""
    sample: SampleReport | None = None
    """The sample that the structure of the tree was grown on; None for all rows."""

    @property
    def doubt(self) -> str:
        """That a simpler policy would do as well, without a full stop; empty where none would.

        Where an action is rare, a tree that knows when to take it may agree with fewer rows than
        one that never does.
        """
        agreement, recall = self.agreement, self.mean_recall
        if agreement is None or recall is None or agreement >= self.most_frequent:
            return ""
        by_chance = 1 / max(len(self.actions), 1)
        if recall > by_chance + _HARDLY * (1 - by_chance):
            return ""
        return (
            f"the forecast, {agreement:.1%} agreement, is below the {self.most_frequent:.1%} "
            "that always taking the most frequent action would reach, and mean recall "
            f"({recall:.1%}) hardly above its {by_chance:.1%}: show more before it drives"
        )

    def notes(self) -> Iterator[str]:
        """Warnings; no full stops."""
        if self.doubt:
            yield self.doubt
        if self.weighted:
            yield (
                "demonstrations have weights: trees are grown, and recalls and agreement in "
                "cross-validation are counted by them; other figures count each row once"
            )
        for action in self.actions:
            if not action.taken:
                yield (
                    f"the tree never takes {action.label!r}, which was shown {action.rows} "
                    f"{'times' if action.rows > 1 else 'time'}"
                )
        alike: dict[str | float, list[str]] = {}
        for action in self.actions:
            alike.setdefault(_as_meant(action.label), []).append(action.label)
        for same in alike.values():
            if len(same) > 1:
                looks = {unicodedata.normalize("NFKC", label) for label in same}
                # Labels that look the same are distinguished by their code points.
                shown = repr if len(looks) == len(same) else ascii
                named = ", ".join(map(shown, same))
                yield f"{named} are different actions: write them alike if they are one"
        if self.conflicts > _MENTIONED * self.rows:
            left = (
                f" ({self.conflicts_after_history} also after the same action)"
                if self.conflicts_after_history != self.conflicts
                else ""
            )
            yield (
                f"states alone do not decide: in {self.conflicts} of {self.rows} rows another "
                f"action was shown in an equal state{left}"
            )

    def in_short(self) -> str:
        """Sentences for a service's answer: recalls, the lowest first, and a baseline."""
        simplest = f"always taking the most frequent action would reach {self.most_frequent:.1%}"
        if self.mean_recall is None or self.agreement is None:
            said = f"There is no forecast, as there are too few rows; {simplest}."
        else:
            judged = [(one.recall, one.label) for one in self.actions if one.recall is not None]
            recalls = [f"{recall:.1%} of {label!r}" for recall, label in sorted(judged)]
            said = (
                f"Forecast: {self.agreement:.1%} agreement in cross-validation ({FORECAST}), where "
                f"{simplest}; mean recall {self.mean_recall:.1%}: {listing(recalls, _LISTED)}."
            )
        if self.sample is not None:
            said = f"{self.sample.sentence} {said}"
        never = [repr(one.label) for one in self.actions if not one.taken]
        return f"{said} Never taken: {listing(never, _LISTED)}." if never else said

    def as_json(self) -> dict[str, Any]:
        """For summary.json."""
        return {
            "recall": {action.label: action.recall for action in self.actions},
            "rows_of_actions": {action.label: action.rows for action in self.actions},
            "never_taken": [action.label for action in self.actions if not action.taken],
            "cross_validated_mean_recall": self.mean_recall,
            "cross_validated_agreement": self.agreement,
            "most_frequent_action": self.most_frequent,
            "weighted": self.weighted,
            "conflicting_rows": self.conflicts,
            "conflicting_rows_after_history": self.conflicts_after_history,
            "sample": None if self.sample is None else self.sample.as_json(),
        }

    def figures(self) -> Mapping[str, str]:
        """For /diagnostics."""
        found = {f"recall of {action.label}": _share(action.recall) for action in self.actions}
        return found | {
            "mean recall": _share(self.mean_recall),
            "forecast (agreement in cross-validation)": _share(self.agreement),
            "share of the most frequent action": _share(self.most_frequent),
            "never taken": ", ".join(action.label for action in self.actions if not action.taken)
            or "none",
            "rows that states alone do not decide": str(self.conflicts),
        }


def report_on(
    table: DemonstrationTable,
    tree: nodes.Node,
    history: History,
    levels: JudgedLevels | None,
    ccp_alpha: float,
    sample: SampleReport | None = None,
) -> LearningReport:
    """Reports on a policy.

    Args:
        table: The rows that it was learned from.
        tree: The behavior tree.
        history: Which earlier action it may test.
        levels: The pruning levels in cross-validation, if there was one.
        ccp_alpha: The chosen level.
        sample: The sample that the structure of the tree was grown on; None for all rows.
    """
    shown = np.bincount(table.chosen, minlength=len(table.actions))
    weighed = table.counts(table.chosen, len(table.actions))
    recalls: list[float | None] = [None] * len(shown)
    mean_recall = agreement = None
    if levels is not None:
        level = levels.at(ccp_alpha)
        mean_recall, agreement = float(levels.mean_recalls[level]), float(levels.means[level])
        recalls = [None if np.isnan(one) else one for one in levels.recalls[level].tolist()]
    taken = {action.label for action in nodes.actions(tree)}
    states = codes_of_states(table.states)
    conflicts = after_history = _conflicts(states, table.chosen)
    if history is History.PREVIOUS:
        before = states * (len(table.actions) + 1) + table.previous + 1
        after_history = _conflicts(before, table.chosen)
    return LearningReport(
        tuple(
            ActionReport(label, rows, recall, label in taken)
            for label, rows, recall in zip(table.actions, shown.tolist(), recalls, strict=True)
            if rows
        ),
        mean_recall,
        agreement,
        float(weighed.max() / weighed.sum()),
        conflicts,
        after_history,
        len(table),
        table.weights is not None,
        sample,
    )


def _conflicts(situations: IntArray, chosen: IntArray) -> int:
    """Rows whose situation has several actions."""
    of_row = codes_of_numbers(situations)
    count = int(of_row.max()) + 1
    least, most = np.full(count, np.iinfo(np.int64).max), np.full(count, -1, dtype=np.int64)
    np.minimum.at(least, of_row, chosen)
    np.maximum.at(most, of_row, chosen)
    return int(np.sum((least != most)[of_row]))


def _as_meant(label: str) -> str | float:
    """A label in a form that is the same for all ways to write it.

    It ignores case, blanks, hyphens and underscores between words, quotes, Unicode forms, and ways
    to write a number.
    """
    text = unicodedata.normalize("NFKC", label).casefold().strip(_QUOTES)
    number = number_of(text)
    return _BETWEEN_WORDS.sub(" ", text) if number is None else number


def _share(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.1%}"
