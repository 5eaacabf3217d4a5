"""What the soak would notice: its judges, on made-up evidence.  The soak itself is `make soak`."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from soak import recordings
from soak.fleet import Fleet
from soak.ledger import Ledger
from soak.robot import action_in, state_of

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.storage.recording import RecordingWriter

Rows = list[tuple[tuple[float, ...], str]]

BLOCKS = 40


def rows(blocks: Sequence[int]) -> Rows:
    return [(state_of(block), action_in(state_of(block))) for block in blocks]


def judged(directory: Path, *demonstrations: Rows, acknowledged: int = 0) -> Ledger:
    """What is found in recordings of which the first was acknowledged to have so many rows."""
    ledger = Ledger()
    features = tuple(Feature(f"state[{n}]", topic="state", index=n) for n in range(24))
    for number, shown in enumerate(demonstrations):
        with RecordingWriter(directory, features, ("action",)) as writer:
            for stamp, (state, action) in enumerate(shown):
                writer.write(Row(stamp, "action", action, None, state))
        if not number:
            ledger.acknowledge(writer.path.resolve(), acknowledged)
    recordings.audit(directory, ledger, BLOCKS)
    return ledger


def test_the_robot_s_states_tell_its_actions_apart() -> None:
    states = [state_of(block) for block in range(BLOCKS)]
    assert len({state[0] for state in states}) == BLOCKS
    assert {action_in(state) for state in states} == {"go", "turn"}


def test_whole_recordings_are_no_loss(tmp_path: Path) -> None:
    ledger = judged(tmp_path, rows(range(3, 10)), rows(range(20, 30)), acknowledged=7)
    assert ledger.losses == {}
    assert ledger.report()["losses"] == 0
    assert ledger.figures["rows"] == 17


def mixed(shown: Rows) -> Rows:
    state, action = shown[2]
    return [*shown[:2], (state[:10] + shown[1][0][10:], action), *shown[3:]]


def mistaken(shown: Rows) -> Rows:
    other = {"go": "turn", "turn": "go"}
    return [*shown[:2], (shown[2][0], other[shown[2][1]]), *shown[3:]]


@pytest.mark.parametrize(
    ("harm", "loss"),
    [
        (lambda shown: shown[:-2], "acknowledged rows"),
        (mixed, "mixed rows"),
        (mistaken, "mixed rows"),
        (lambda shown: [*shown[:2], *shown[4:], *rows([30, 31])], "missing rows"),
        (lambda shown: [*shown, *rows([9])], "late states"),
        (lambda shown: [*shown, *rows([3])], "doubled rows"),
    ],
)
def test_every_loss_of_rows_is_noticed(
    tmp_path: Path, harm: Callable[[Rows], Rows], loss: str
) -> None:
    ledger = judged(tmp_path, harm(rows(range(3, 10))), acknowledged=7)
    assert loss in ledger.losses
    assert ledger.report()["losses"] > 0
    assert ledger.told


def test_a_recording_that_is_gone_is_a_loss_unless_it_was_discarded(tmp_path: Path) -> None:
    ledger = Ledger()
    ledger.acknowledge(tmp_path / "gone.rec", 5)
    recordings.audit(tmp_path, ledger, BLOCKS)
    assert ledger.losses == {"acknowledged rows": 5}
    ledger.forgive_missing_files()
    ledger.losses.clear()
    recordings.audit(tmp_path, ledger, BLOCKS)
    assert ledger.losses == {}


def test_a_node_that_ends_by_itself_or_badly_is_a_loss(tmp_path: Path) -> None:
    ledger = Ledger()
    fleet = Fleet(tmp_path, 1, {"learner": {"max_depth": "deep"}}, ledger)
    fleet.start("learner")
    try:
        fleet._lives["learner"].process.wait()
        fleet.parameters.clear()
        fleet.watch()
        assert ledger.losses["nodes ended by themselves"] == 1
        assert ledger.losses["exit codes"] == 1
        fleet.stop("learner", signal.SIGKILL)
        assert ledger.losses["exit codes"] == 2
        fleet.end()
        assert "processes left" not in ledger.losses
    finally:
        fleet.kill_all()
