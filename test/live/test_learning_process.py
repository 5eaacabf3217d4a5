"""The learning process without a node: how asking ends when the process does."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.live.learning_process import (
    LearningCancelledError,
    LearningError,
    LearningProcess,
    Lesson,
    Progress,
    Request,
)
from rebt_ros.storage.recording import RecordingWriter

PATIENCE = 60.0


@pytest.fixture
def process() -> Iterator[LearningProcess]:
    one = LearningProcess()
    yield one
    one.close()


@pytest.fixture
def request_(tmp_path: Path) -> Request:
    with RecordingWriter(tmp_path, (Feature("x"),), ["action"]) as writer:
        for step in range(100):
            writer.write(Row(step, "action", "go" if step % 2 else "turn", None, (step % 2,)))
    return Request(str(tmp_path), {})


def _stuck(process: LearningProcess, request: Request, **options: float) -> Future[Lesson]:
    """The future reply of a process that was stopped before it was asked."""
    process.start()
    assert process.id is not None
    os.kill(process.id, signal.SIGSTOP)
    threads = ThreadPoolExecutor()
    asked = threads.submit(process.ask, request, cancelled=threading.Event(), **options)
    threads.shutdown(wait=False)
    end = time.monotonic() + PATIENCE
    while not process._asked and time.monotonic() < end:
        time.sleep(0.001)
    return asked


def test_learning_tells_how_far_it_is(process: LearningProcess, request_: Request) -> None:
    told: list[Progress] = []
    lesson = process.ask(request_, cancelled=threading.Event(), progress=told.append)
    assert "100 rows" in lesson.sentence
    assert told[0] == Progress("reading", 0.0)
    shares = [one.share for one in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    # Most of the work is choosing, and it is not one leap.
    assert len({one.share for one in told if one.stage == "choosing"}) > 5


def test_a_reply_that_nobody_waits_for_is_not_taken_for_the_next_one(
    process: LearningProcess, request_: Request
) -> None:
    def fail(progress: Progress) -> None:
        raise RuntimeError(progress.stage)

    with pytest.raises(RuntimeError, match="reading"):
        process.ask(request_, cancelled=threading.Event(), progress=fail)
    nowhere = Request(f"{request_.demonstrations}/nowhere", {})
    with pytest.raises(LearningError, match="does not exist"):
        process.ask(nowhere, cancelled=threading.Event())


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (signal.SIGKILL, "was killed, perhaps for lack of memory"),
        (signal.SIGSEGV, "was ended by SIGSEGV"),
        (signal.SIGABRT, "was ended by SIGABRT"),
        (signal.SIGBUS, "was ended by SIGBUS"),
    ],
)
def test_who_asked_learns_how_the_process_died(
    process: LearningProcess, request_: Request, number: signal.Signals, sentence: str
) -> None:
    asked = _stuck(process, request_)
    assert process.id is not None
    child = process.id
    os.kill(child, number)
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGCONT)
    with pytest.raises(LearningError, match=sentence):
        asked.result(PATIENCE)
    assert process.id is None


def test_a_process_that_hangs_is_ended_in_time(process: LearningProcess, request_: Request) -> None:
    asked = _stuck(process, request_, limit=0.3)
    with pytest.raises(LearningError, match=r"relearn_timeout \(0\.3 s\)"):
        asked.result(PATIENCE)
    assert process.id is None


def test_closing_ends_whoever_asks(process: LearningProcess, request_: Request) -> None:
    asked = _stuck(process, request_)
    process.close()
    with pytest.raises(LearningError, match="shutting down"):
        asked.result(PATIENCE)
    with pytest.raises(LearningError, match="shutting down"):
        process.ask(request_, cancelled=threading.Event())


def test_what_is_cancelled_before_it_began_does_not_begin(
    process: LearningProcess, request_: Request
) -> None:
    cancelled = threading.Event()
    cancelled.set()
    assert not process.cancel()
    with pytest.raises(LearningCancelledError):
        process.ask(request_, cancelled=cancelled)
    assert process.id is None


def test_a_process_that_speaks_nonsense_is_an_error(
    process: LearningProcess,
    request_: Request,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    interpreter = tmp_path / "python"
    interpreter.write_text("#!/bin/sh\nread line\necho Hello.\n")
    interpreter.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(interpreter))
    with pytest.raises(LearningError, match="ended unexpectedly with code 0"):
        process.ask(request_, cancelled=threading.Event())


def test_a_process_that_cannot_be_started_is_an_error(
    process: LearningProcess, request_: Request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nothing"))
    with pytest.raises(LearningError, match="cannot be started"):
        process.ask(request_, cancelled=threading.Event())
    monkeypatch.undo()
    assert process.ask(request_, cancelled=threading.Event()).sentence


def test_the_files_of_what_was_learned_last_are_written_once(
    process: LearningProcess, request_: Request, tmp_path: Path
) -> None:
    assert process.write(tmp_path / "out") == ()
    assert not (tmp_path / "out").exists()
    process.ask(request_, cancelled=threading.Event())
    process.write(tmp_path / "out")
    written = {one.name for one in (tmp_path / "out").iterdir()}
    assert {"tree.json", "tree.svg", "decision_tree.svg", "summary.json"} <= written
    assert process.write(tmp_path / "again") == ()
    assert not (tmp_path / "again").exists()


def test_the_tree_that_is_published_stays_while_files_are_written(
    process: LearningProcess, request_: Request, tmp_path: Path
) -> None:
    process.ask(request_, cancelled=threading.Event())
    (tmp_path / "tree.json").write_text("another one, published meanwhile")
    process.write(tmp_path)
    assert (tmp_path / "tree.json").read_text() == "another one, published meanwhile"
    assert (tmp_path / "tree.svg").exists()


def test_files_that_cannot_be_written_are_no_end_of_the_process(
    process: LearningProcess, request_: Request, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    process.ask(request_, cancelled=threading.Event())
    with pytest.raises(LearningError, match="file"):
        process.write(tmp_path / "file")
    assert process.ask(request_, cancelled=threading.Event()).sentence
