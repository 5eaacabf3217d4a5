"""What the recorder has left: every row is judged by itself and beside its neighbours."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.errors import RebtError
from rebt_ros.storage.recording import read_recording
from rebt_ros.storage.recording_files import SUFFIX
from soak.ledger import Ledger
from soak.robot import action_in, state_of, values_from


def audit(directory: Path, ledger: Ledger, blocks: int) -> None:
    """Reads all recordings and enters what they lack.

    Args:
        directory: Of the recordings.
        ledger: Knows how many rows each must have at least.
        blocks: How many blocks the robot went through.
    """
    block_of = {state_of(block)[0]: block for block in range(blocks)}
    seen: set[int] = set()
    rows = 0
    files = {one.resolve() for one in directory.iterdir() if one.suffix == SUFFIX}
    for path in sorted(files | ledger.acknowledged.keys()):
        wanted = ledger.acknowledged.get(path, 0)
        try:
            demonstration = read_recording(path).demonstration
        except RebtError as err:
            # One whose recorder was killed before its first row may have no head.
            if wanted:
                ledger.lose("acknowledged rows", f"{wanted} in {path.name}: {err}", wanted)
            continue
        rows += len(demonstration)
        if len(demonstration) < wanted:
            missing = wanted - len(demonstration)
            ledger.lose("acknowledged rows", f"{missing} of {wanted} in {path.name}", missing)
        _audit_rows(demonstration, ledger, block_of, seen)
    ledger.figures["rows"] = rows
    ledger.figures["demonstrations"] = len(files)


def _audit_rows(
    demonstration: Demonstration,
    ledger: Ledger,
    block_of: dict[float, int],
    seen: set[int],
) -> None:
    before: int | None = None
    for row, (state, code) in enumerate(
        zip(demonstration.states.tolist(), demonstration.chosen.tolist(), strict=True)
    ):
        where = f"row {row} of {demonstration.name}"
        block = block_of.get(state[0])
        if block is None or tuple(state) != values_from(state[0]):
            ledger.lose("mixed rows", f"{where} has values of several states")
            continue
        if block == before:
            ledger.lose("late states", f"{where} has the state of the row before")
            continue
        if demonstration.actions[code] != action_in(state):
            ledger.lose("mixed rows", f"{where} has the action of another state")
        if block in seen:
            ledger.lose("doubled rows", where)
        seen.add(block)
        if before is not None and block != before + 1:
            ledger.lose("missing rows", f"{where} follows on block {before}, not {block - 1}")
        before = block
