"""Many recordings, as the recorder writes them, of a policy that can be learned."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from examples import demonstration
from numpy.typing import NDArray

from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.storage.recording_head import head_line
from rebt_ros.storage.recording_rows import RowEncoder, record_type

#: Rows of a recording.
ROWS: Final = 1000
#: Features of a row.
WIDTH: Final = 24
_WORD: Final = np.uint32(2**32 - 1)


def write_recordings(directory: Path, first: int, count: int, rows: int = ROWS) -> None:
    """Writes recordings, whose content and names follow from their numbers.

    Args:
        directory: Where to.
        first: Number of the first one.
        count: How many.
        rows: Of each.
    """
    directory.mkdir(parents=True, exist_ok=True)
    for number in range(first, first + count):
        shown = demonstration(rows, WIDTH, seed=number)
        (directory / f"{number:08}.rec").write_bytes(recorded(shown))


def recorded(shown: Demonstration) -> bytes:
    """The bytes of a recording of one channel, whose first rows take each action in turn."""
    head = head_line(shown.features, shown.channels, 10.0)
    encoder = RowEncoder(shown.channels, len(shown.features))
    labels = len(shown.actions)
    first = b"".join(
        encoder.encode(
            Row(
                int(shown.stamps[row]),
                shown.channels[0],
                shown.actions[shown.chosen[row]],
                None,
                tuple(shown.states[row].tolist()),
            )
        )
        for row in range(labels)
    )
    records: NDArray[np.void] = np.zeros(
        len(shown) - labels, dtype=record_type(len(shown.features))
    )
    records["stamp"] = shown.stamps[labels:]
    # The first rows number the actions in the order of their labels.
    records["action"] = shown.chosen[labels:] + 1
    records["state"] = shown.states[labels:]
    words: NDArray[np.uint32] = records.view("<u4").reshape(len(records), -1)
    records["checksum"] = _WORD - words.sum(axis=1, dtype=np.uint32)
    return head + first + records.tobytes()
