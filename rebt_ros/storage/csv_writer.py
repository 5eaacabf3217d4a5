"""Demonstrations as CSV tables that `read_csv` reads as they are."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from rebt_ros.arrays import BoolArray
from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL, Demonstration
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import InputError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.csv_table import OUTCOME_SUFFIX, STAMP

_OUTCOME = DEFAULT_CHANNEL + OUTCOME_SUFFIX
_RESERVED = (STAMP, _OUTCOME, DEFAULT_CHANNEL)


def write_csv(path: Path, demonstration: Demonstration, succeeded: BoolArray) -> None:
    """Writes a demonstration of a single channel, whose features are numbers.

    The columns are the stamp (nanoseconds), the features, how the action ended, and the action.
    Numbers keep every bit.

    Args:
        path: File to create or replace.
        demonstration: What was shown.
        succeeded: Whether each row's action succeeded, shape (rows,).

    Raises:
        InputError: A feature has the name of another column.
        StorageError: The file cannot be written.
        ValueError: The demonstration has several channels or other features.
    """
    features = demonstration.features
    if len(demonstration.channels) != 1 or any(
        feature.kind is not FeatureKind.NUMERIC for feature in features
    ):
        raise ValueError("only numbers and the actions of one channel can be written")
    names = [feature.name for feature in features]
    taken = next((name for name in names if name in _RESERVED), None)
    if taken is not None:
        raise InputError(
            f"{demonstration.name}: {taken!r} is the name of a column that every table has: "
            "rename the variable."
        )
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow((STAMP, *names, _OUTCOME, DEFAULT_CHANNEL))
    writer.writerows(
        (stamp, *map(repr, state), "success" if success else "failure", demonstration.actions[code])
        for stamp, state, success, code in zip(
            demonstration.stamps.tolist(),
            demonstration.states.tolist(),
            succeeded.tolist(),
            demonstration.chosen.tolist(),
            strict=True,
        )
    )
    write_text_atomically(path, buffer.getvalue())
