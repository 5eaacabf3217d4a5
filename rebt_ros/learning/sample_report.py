"""How well a tree that was grown on a sample agrees with the sample and with all rows."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rebt_ros.arrays import IntArray
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.demonstration.sampling import Sample
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.errors import listing
from rebt_ros.learning.evaluation import mean_recall

#: Number of actions that a sentence lists.
_LISTED = 12


@dataclass(frozen=True, slots=True)
class Fit:
    """Weighted agreement of a decision tree with rows that it was learned from."""

    agreement: float
    mean_recall: float
    """Mean over the actions."""


@dataclass(frozen=True, slots=True)
class SampleReport:
    """The sample that the structure of a tree was grown on, compared with all rows."""

    rows: int
    of_rows: int
    demonstrations: int
    of_demonstrations: int
    complete: tuple[str, ...]
    """Actions with all their rows in the sample."""
    sampled: Fit
    """Agreement with the rows of the sample."""
    whole: Fit
    """Agreement with all rows."""

    @property
    def sentence(self) -> str:
        """The report, for people."""
        named = listing([*map(repr, self.complete)], _LISTED)
        complete = f", all that show {named} among them" if self.complete else ""
        return (
            f"The tree was grown on a sample of {self.rows} of {self.of_rows} rows "
            f"({self.demonstrations} of {self.of_demonstrations} demonstrations{complete}), and "
            f"pruned, chosen and counted by all: it agrees with {self.sampled.agreement:.1%} of "
            f"the sample and {self.whole.agreement:.1%} of all rows (mean recall "
            f"{self.sampled.mean_recall:.1%} and {self.whole.mean_recall:.1%})."
        )

    def as_json(self) -> dict[str, Any]:
        """For summary.json."""
        return asdict(self) | {"complete": list(self.complete)}


def report_on_sample(
    sample: Sample, table: DemonstrationTable, trained: TrainedTree
) -> SampleReport:
    """Reports on a sample.

    Args:
        sample: The sample of the table.
        table: The rows that the tree was learned from.
        trained: The tree.
    """
    rows = table.where(sample.rows)
    actions = len(table.actions)
    right = trained.predict(rows) == rows.chosen
    hits = rows.counts(rows.chosen[right], actions, right)
    return SampleReport(
        len(rows),
        len(table),
        sample.demonstrations,
        len(table.begins),
        sample.complete,
        _fit(hits, rows.counts(rows.chosen, actions)),
        _fit(_counted_hits(trained), trained.grown.counts[0]),
    )


def _counted_hits(trained: TrainedTree) -> IntArray:
    """The counted rows of each action that the tree predicts, shape (actions,)."""
    grown = trained.grown
    leaves = np.unique(trained.standing[grown.left < 0])
    majority = grown.majority[leaves]
    hits = np.zeros(grown.counts.shape[1], dtype=np.int64)
    np.add.at(hits, majority, grown.counts[leaves, majority])
    return hits


def _fit(hits: IntArray, shown: IntArray) -> Fit:
    return Fit(float(hits.sum() / shown.sum()), float(mean_recall(hits, shown)))
