"""The demo, as it is installed."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("aiohttp")

from ros_processes import CHECKOUT, wait_until
from studio_client import StudioClient

import rebt_ros.errors

PREFIX = CHECKOUT / "install" / "rebt_ros"


@pytest.mark.skipif(
    not Path(rebt_ros.errors.__file__).is_relative_to(PREFIX),
    reason="run from the checkout, not by 'make test'",
)
def test_a_person_goes_on_in_the_studio_once_the_task_was_shown(tmp_path: Path) -> None:
    command = [PREFIX / "lib" / "rebt_ros" / "demo", "--studio", "--demonstrations", "2"]
    said = tmp_path / "said.txt"
    environment = dict(os.environ, AMENT_PREFIX_PATH=str(PREFIX), PYTHONUNBUFFERED="1")
    with said.open("wb") as output:
        demo = subprocess.Popen(
            [*command, "--out", tmp_path], env=environment, stdout=output, stderr=output
        )
    try:
        urls = wait_until(
            lambda: (
                re.findall(r"Open (http://\S+) in a browser", said.read_text())
                or demo.poll() is not None
            ),
            timeout=180,
        )
        assert isinstance(urls, list), said.read_text()
        with StudioClient(urls[0]) as client:
            client.wait(lambda: len(client.board["demonstrations"]) == 2)
            client.does("learn")
            client.does("enable", on=True)
            client.wait(lambda: client.board["run"].get("commands"))
    finally:
        demo.send_signal(signal.SIGINT)
        assert demo.wait(60) == 0
    assert "Ended; recordings, trees and logs are in" in said.read_text()
