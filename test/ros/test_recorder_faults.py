"""What the recorder promises under kills, full disks, company and load, over real DDS.

`make bench-recorder` runs the long form of these trials.
"""

from __future__ import annotations

import random
import resource
import shutil
import signal
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from recorder_trials import (
    RECORDER,
    kill_recorders,
    large_recording,
    load_recorder,
    relearn_meanwhile,
)
from ros_processes import NodeProcess, Peer, values_of

from rebt_ros.storage.recording import read_recording
from rebt_ros.storage.recording_files import recordings

#: So many that the first line of a recording alone is longer than the smallest limit below.
WIDE = 400


def test_kills_lose_no_acknowledged_row_and_recording_goes_on(tmp_path: Path) -> None:
    result = kill_recorders(3, tmp_path, random.Random())
    assert result.acknowledged > 0
    assert result.files == 3
    assert result.readable >= result.acknowledged
    assert (result.lost, result.gaps) == (0, 0), result
    assert result.torn == result.noticed > 0


def test_load_loses_no_message_and_no_row(tmp_path: Path) -> None:
    # A recorder that gets no time for seconds loses messages, and says so; but not every time.
    for attempt in range(4):
        (tmp_path / str(attempt)).mkdir()
        result = load_recorder(4.0, tmp_path / str(attempt))
        if not result.lost_messages:
            break
    assert result.messages == result.states + result.actions, result
    assert result.rows == result.actions
    assert (result.gaps, result.lost_messages, result.faults) == (0, 0, [])
    assert result.memory[-1] < result.memory[len(result.memory) // 3] + 20


def test_what_the_transport_drops_comes_late_and_finds_its_state(tmp_path: Path) -> None:
    result = load_recorder(6.0, tmp_path, freezes=(0.7, 0.7))
    assert (result.rows, result.gaps) == (result.actions, 0), result
    assert result.misplaced == 0


def test_a_relearn_costs_no_row_and_no_command(tmp_path: Path) -> None:
    table = tmp_path / "table"
    table.mkdir()
    large_recording(100_000, table)
    result = relearn_meanwhile(6.0, tmp_path, table, state_rate=500, rate=50)
    assert (result.rows, result.misplaced) == (result.actions, 0)
    assert (result.ticks_without_command, result.missed) == (0, 0)
    assert len(result.learning) > 10


def _limit_files(process: NodeProcess, size: int) -> None:
    """Files can grow no larger: a full disk of the process's own, for which nobody must be root."""
    pid = process.process.pid
    _, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, most))


def test_a_full_disk_is_an_error_until_there_is_room(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    directory = tmp_path / "demonstrations"

    def counts() -> dict[str, str]:
        return values_of(peer.diagnostics[RECORDER])

    def failing() -> bool:
        status = peer.diagnostics[RECORDER]
        return status.level == b"\2" and "cannot be" in status.message

    with NodeProcess("recorder_node", domain, tmp_path) as recorder:
        peer.state(*[0.5] * WIDE)
        for _ in range(10):
            peer.action("first")
        peer.wait_until(lambda: RECORDER in peer.diagnostics and counts()["rows"] == "10")
        (path,) = recordings(directory)
        size = path.stat().st_size
        # There is room for a part of a row, and none for another file.
        _limit_files(recorder, size + 1000)
        peer.action("torn")
        peer.wait_until(lambda: path.stat().st_size == size and failing())
        _limit_files(recorder, 10_000)

        def refused() -> bool:
            peer.action("refused")
            return int(counts()["rows lost"]) > 10 and failing()

        peer.wait_until(refused)
        assert recorder.stderr.count("[ERROR]") == 1
        _limit_files(recorder, resource.RLIM_INFINITY)

        def resumed() -> bool:
            peer.action("last")
            return int(counts()["rows"]) > 12 and not failing()

        peer.wait_until(resumed)
        assert recorder.stop() == 0
    first, last = map(read_recording, recordings(directory))
    assert (first.notes, last.notes) == ((), ())
    assert first.demonstration.actions == ("first",)
    assert len(first.demonstration) == 10
    assert last.demonstration.actions[-1] in ("last", "refused")
    assert len(recordings(directory)) == len(list(directory.iterdir()))


def test_a_directory_that_is_moved_or_removed_while_it_is_written_to_costs_no_row(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    directory, moved = tmp_path / "demonstrations", tmp_path / "moved"

    def says(what: str) -> bool:
        status = peer.diagnostics[RECORDER]
        return status.level != b"\0" and what in status.message

    def rows() -> int:
        return int(values_of(peer.diagnostics[RECORDER])["rows"])

    with NodeProcess("recorder_node", domain, tmp_path) as recorder:
        peer.state(0.5)
        peer.action("first")
        peer.wait_until(lambda: RECORDER in peer.diagnostics and rows() == 1)
        directory.rename(moved)
        peer.wait_until(lambda: says(f"was moved while it was written: its 1 rows are in {moved}"))
        peer.action("second")
        peer.wait_until(lambda: rows() == 2)
        shutil.rmtree(directory)
        peer.wait_until(lambda: says("was removed while it was written: its 1 rows are in"))
        peer.action("third")
        peer.wait_until(lambda: rows() == 3)
        assert recorder.stop() == 0
    ((first,), (second,)) = (recordings(one) for one in (moved, directory))
    assert read_recording(first).demonstration.actions == ("first",)
    assert read_recording(second).demonstration.actions == ("second", "third")


def test_lost_messages_are_counted_and_warned_of(domain: int, peer: Peer, tmp_path: Path) -> None:
    with NodeProcess("recorder_node", domain, tmp_path) as recorder:
        peer.state(0.0)
        # Two reports with one publisher, between which gaps count.
        peer.wait_until(lambda: RECORDER in peer.diagnostics)
        peer.diagnostics.clear()
        peer.wait_until(lambda: RECORDER in peer.diagnostics)
        recorder.process.send_signal(signal.SIGSTOP)
        for number in range(8000):
            peer.state(float(number))
        recorder.process.send_signal(signal.SIGCONT)

        def told() -> bool:
            peer.state(0.0)
            return int(values_of(peer.diagnostics[RECORDER])["messages lost"]) > 0

        peer.wait_until(told)
        assert peer.diagnostics[RECORDER].level == b"\1"
        assert "were lost" in peer.diagnostics[RECORDER].message
        assert recorder.stop() == 0


def test_two_recorders_in_one_directory_do_not_mix_rows(
    domain: int, peer: Peer, tmp_path: Path
) -> None:
    arguments = ["-r", "__ns:=/other", "-p", f"demonstrations:={tmp_path}/demonstrations"]
    with (
        NodeProcess("recorder_node", domain, tmp_path) as one,
        NodeProcess("recorder_node", domain, tmp_path, arguments=arguments) as other,
    ):
        for prefix in ("", "/other/"):
            peer.state(len(prefix), topic=f"{prefix}state")
        for _ in range(50):
            peer.action("go", topic="action")
            peer.action("turn", topic="/other/action")
        peer.wait_until(
            lambda: all(
                name in peer.diagnostics and values_of(peer.diagnostics[name])["rows"] == "50"
                for name in (RECORDER, f"other/{RECORDER}")
            )
        )
        for recorder in (one, other):
            recorder.says(f"another recorder writes to {tmp_path}/demonstrations")
        assert (one.stop(), other.stop()) == (0, 0)
    reads = [read_recording(path) for path in recordings(tmp_path / "demonstrations")]
    shown = sorted((read.demonstration.actions, len(read.demonstration)) for read in reads)
    assert shown == [(("go",), 50), (("turn",), 50)]
    assert {read.demonstration.states.min() for read in reads} == {0.0, 7.0}
