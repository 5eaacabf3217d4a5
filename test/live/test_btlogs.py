"""Logs that are written beside the executor's ticks."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
import strategies as some
from ros_processes import wait_until

from rebt_ros.behavior_tree import nodes
from rebt_ros.export.watched import watched
from rebt_ros.live import btlogs
from rebt_ros.live.btlogs import BtLogs
from rebt_ros.storage.btlog import BtLog, read_btlog

TREE = watched(some.learned(nodes.Selector((some.action("go"), some.action("turn")))))
OTHER = watched(some.learned(some.action("go")))


def _changes(log: BtLog) -> list[tuple[int, int]]:
    return [(one.uid, one.status) for one in log.transitions]


def test_each_tree_has_a_log_of_what_changed(tmp_path: Path) -> None:
    logs = BtLogs(tmp_path / "logs")
    logs.tick(TREE, {0: "SUCCESS", 1: "SUCCESS"})
    logs.tick(TREE, {0: "SUCCESS", 1: "SUCCESS"})
    logs.tick(TREE, {0: "RUNNING", 1: "FAILURE", 2: "RUNNING"})
    logs.tick(TREE, {})
    logs.tick(OTHER, {0: "SUCCESS"})
    logs.close()
    found = {log.xml: log for log in map(read_btlog, (tmp_path / "logs").iterdir())}
    assert found.keys() == {TREE.xml, OTHER.xml}
    first, second = found[TREE.xml], found[OTHER.xml]
    assert _changes(first) == [(1, 2), (2, 2), (1, 1), (2, 3), (3, 1), (1, 0), (2, 0), (3, 0)]
    assert _changes(second) == [(1, 2)]
    times = [one.microseconds for one in first.transitions]
    assert times == sorted(times)
    assert second.began >= first.began + times[-1] > 10**15
    assert (logs.lost, logs.fault) == (0, "")


def test_a_directory_that_cannot_be_written_is_named_and_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "logs").write_text("no directory")
    logs = BtLogs(tmp_path / "logs")
    for _ in range(3):
        logs.tick(TREE, {0: "SUCCESS"})
    wait_until(lambda: logs.fault, what="the fault")
    assert "cannot be written" in logs.fault
    # The next tree is tried again.
    (tmp_path / "logs").unlink()
    logs.tick(OTHER, {0: "SUCCESS"})
    logs.close()
    assert logs.fault == ""
    [log] = (tmp_path / "logs").iterdir()
    assert read_btlog(log).xml == OTHER.xml


def test_a_disk_that_stands_still_keeps_no_tick_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entered, goes_on = threading.Event(), threading.Event()
    writer = btlogs.BtLogWriter

    def standing(*arguments: Any, **options: Any) -> Any:
        entered.set()
        assert goes_on.wait(60)
        return writer(*arguments, **options)

    monkeypatch.setattr(btlogs, "BtLogWriter", standing)
    monkeypatch.setattr(btlogs, "_MOST_WAITING", 5)
    logs = BtLogs(tmp_path)
    logs.tick(TREE, {0: "SUCCESS"})
    assert entered.wait(60)
    for number in range(8):
        logs.tick(TREE, {0: "FAILURE"} if number % 2 else {0: "RUNNING"})
    assert logs.lost == 3
    goes_on.set()
    monkeypatch.setattr(btlogs, "_PATIENCE", 60.0)
    logs.close()
    [log] = tmp_path.iterdir()
    assert _changes(read_btlog(log)) == [(1, 2), (1, 1), (1, 3), (1, 1), (1, 3), (1, 1)]
