"""Which rows of a very large table the structure of decision trees is grown on."""

from __future__ import annotations

from typing import Final

from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.sampling import Sample, sample_of
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.options import LearnOptions

#: In larger tables, trees are grown on a sample of about this many rows.
MOST_ROWS_GROWN_ON: Final = 100_000


def structure_sample(table: DemonstrationTable, options: LearnOptions) -> Sample | None:
    """The rows that choose the splits; pruning, choices and counts always use all rows.

    Args:
        table: The rows to learn from.
        options: How to learn.

    Returns:
        None if trees are grown on all rows: up to 100,000 rows, on request, and with upsampling,
        whose made-up rows would have no effect otherwise.
    """
    if options.exact or options.upsample is not Upsampling.NONE:
        return None
    return sample_of(table, MOST_ROWS_GROWN_ON) if len(table) > MOST_ROWS_GROWN_ON else None
