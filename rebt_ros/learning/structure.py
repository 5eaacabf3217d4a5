"""Which rows the structure of decision trees is grown on, where there are very many."""

from __future__ import annotations

from typing import Final

from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.sampling import Sample, sample_of
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.learning.options import LearnOptions

#: In larger tables, trees are grown on a sample of about so many rows.
MOST_ROWS_GROWN_ON: Final = 100_000


def structure_sample(table: DemonstrationTable, options: LearnOptions) -> Sample | None:
    """The rows that splits are chosen by; all rows prune, choose and are counted in any case.

    Args:
        table: What is learned from.
        options: How.

    Returns:
        None where trees are grown on all rows: of 100,000 at most, where that is asked for, and
        where rows are made up for rare actions, which would count for nothing otherwise.
    """
    if options.exact or options.upsample is not Upsampling.NONE:
        return None
    return sample_of(table, MOST_ROWS_GROWN_ON) if len(table) > MOST_ROWS_GROWN_ON else None
