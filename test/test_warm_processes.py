"""Processes that are forked from one that has imported everything behave as others do."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from warm_processes import WarmProcess, as_begun, can_start, run


def test_what_it_writes_and_its_exit_code_are_those_of_the_module(tmp_path: Path) -> None:
    (tmp_path / "good.json").write_text('{"a": 1}')
    (tmp_path / "bad.json").write_text('{"a": ')
    good = run("json.tool", "good.json", directory=tmp_path)
    assert (good.returncode, json.loads(good.stdout), good.stderr) == (0, {"a": 1}, "")
    bad = run("json.tool", "bad.json", directory=tmp_path)
    assert (bad.returncode, bad.stdout) == (1, "")
    assert "Expecting value" in bad.stderr


def test_a_signal_ends_it_and_it_ends_by_itself() -> None:
    for number in (None, signal.SIGTERM, signal.SIGKILL):
        theirs, ours = os.pipe()
        with open(os.devnull, "w") as nothing, os.fdopen(theirs) as typed:
            files = (typed.fileno(), nothing.fileno(), nothing.fileno())
            process = WarmProcess(
                "json.tool", [], environment=as_begun(), directory=Path.cwd(), files=files
            )
        with os.fdopen(ours, "wb") as typing:
            assert process.poll() is None
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.01)
            if number is None:
                typing.write(b"[]")
            else:
                process.send_signal(number)
                assert process.wait(60) == -number
        assert process.wait(60) == (0 if number is None else -number)
        process.kill()


def test_ros_can_be_hidden() -> None:
    hidden = run("rclpy.utilities", ros=False)
    assert hidden.returncode == 1
    assert "rclpy" in hidden.stderr


def test_what_differs_from_its_first_line_on_is_started_as_usual() -> None:
    assert can_start(as_begun() | {"HOME": "/nowhere", "ROS_DOMAIN_ID": "7"})
    assert not can_start(as_begun() | {"PYTHONIOENCODING": "ascii"})
    assert not can_start(as_begun() | {"PYTHONPATH": "/somewhere/else"})
    with pytest.raises(AssertionError, match="starts as usual"):
        run("json.tool", LC_ALL="of nowhere")


#: Starts a process that waits for its input, says its number and waits, too.
_ASKS = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
import warm_processes
from warm_processes import WarmProcess, as_begun
warm_processes.use()
process = WarmProcess("json.tool", [], environment=as_begun(), directory=Path.cwd(),
                      files=(int(sys.argv[2]), 1, 2), session=True)
print(process.pid, flush=True)
sys.stdin.read()
"""


def test_none_is_left_where_whoever_started_it_was_killed() -> None:
    theirs, ours = os.pipe()
    # Its input goes on as long as this test.
    with os.fdopen(ours, "w"), os.fdopen(theirs):
        with subprocess.Popen(
            [sys.executable, "-c", _ASKS, str(Path(__file__).parent), str(theirs)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=[theirs],
        ) as asking:
            assert asking.stdout is not None
            number = int(asking.stdout.readline())
            assert _lives(number)
            asking.kill()
        end = time.monotonic() + 60
        while _lives(number):
            assert time.monotonic() < end, "it goes on"
            time.sleep(0.01)


def _lives(number: int) -> bool:
    """Whether a process has not ended, be it that nobody has asked how."""
    try:
        state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
