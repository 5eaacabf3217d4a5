"""The page in a real browser beside real nodes: from teaching to a corrected tree."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pytest

pytest.importorskip("aiohttp")
pytest.importorskip("selenium")

from chromium import Browser
from ros_processes import NodeProcess, Peer
from selenium.webdriver import ActionChains
from selenium.webdriver.common.keys import Keys
from std_msgs.msg import String
from studio_client import url_of

LABELS: Final = {"back": 0.2, "go": 0.6, "stop": 0.9}
NODES: Final = {
    "recorder": {"sample_rate": 0.0},
    "learner": {},
    "executor": {"rate": 20.0, "state_timeout": 600.0, "enabled": False},
    "studio": {"port": 0},
}


def state(peer: Peer, x: float) -> None:
    """Where the robot is."""
    peer.state(x, 1.0 - x, labels=["x", "y"])


def hold(page: Browser, label: str, wait: Callable[[], object]) -> None:
    """Holds the button of an action while something is waited for."""
    button = page.one(f'#takeover [data-key="{label}"]')
    page.run("arguments[0].scrollIntoView({block: 'center'})", button)
    ActionChains(page.driver).click_and_hold(button).perform()
    try:
        wait()
    finally:
        ActionChains(page.driver).release().perform()


def show(peer: Peer, offset: float) -> None:
    """A demonstration: back below a half, else go, and stop beyond three quarters."""
    for step in range(20):
        x = (step + offset) / 20
        state(peer, x)
        peer.action("back" if x < 0.5 else "go" if x < 0.75 else "stop")
    peer.deliver()


def repeated(peer: Peer, heard: list[Any], label: str) -> None:
    """Waits until an action was sent three times."""
    peer.wait_until(lambda: [message.data for message in heard].count(label) >= 3)


def keep(page: Browser, pictures: Path | None, name: str) -> None:
    """Keeps a picture of a step."""
    if pictures is not None:
        page.picture(pictures / f"{name}.png")


def test_a_person_teaches_learns_chooses_publishes_and_corrects_in_the_page(
    chromium: Browser, domain: int, peer: Peer, tmp_path: Path, pictures: Path | None
) -> None:
    page = chromium
    with ExitStack() as stack:
        nodes = {
            name: stack.enter_context(NodeProcess(name, domain, tmp_path, parameters))
            for name, parameters in NODES.items()
        }
        page.look()
        page.open(url_of(nodes["studio"]))
        page.until(lambda: len(page.all('#health li:not([data-level="GONE"])')) == 3)
        peer.connect(String, "action")

        # Teach: the first time with the buttons of the page.
        page.section("teach")
        if page.one("#recorder-buttons .primary").text == "Start recording":
            page.press("#recorder-buttons button", "Start recording")
        heard = peer.listen(String, "action")
        for label, x in LABELS.items():
            page.one("#new-action-name").send_keys(label, Keys.ENTER)
            state(peer, x)
            hold(page, label, lambda label=label: repeated(peer, heard, label))
            page.sees(f"{label} ", "#recorder-actions")
        keep(page, pictures, "1_teach")
        page.press("#recorder-buttons button", "Well done")
        for number in range(2):
            show(peer, number / 2)
            page.press("#recorder-buttons button", "Well done")
            page.until(lambda number=number: len(page.all("#demonstrations > li")) == number + 2)

        # Learn, and choose another size.
        page.section("learn")
        page.press("#learn", "Learn from 3 demonstrations")
        page.sees("Learned a behavior tree", "#toasts")
        page.until(lambda: len(page.all("#learn-levels label")) > 1)
        page.sees("The robot follows this very tree.", "#learn-changed")
        page.press("#learn-levels label:not(:has(:checked))")
        page.sees("does something else than the robot's tree", "#learn-changed")
        keep(page, pictures, "2_learn")

        # Curate: back to the larger tree, and go from 0.3 instead of 0.5.
        page.section("curate")
        page.press("#undo", "Undo: choosing level")
        page.sees("The robot follows this draft.", "#curate-state")
        path, feature = page.until(
            lambda: page.run(
                """const found = [...document.querySelectorAll('#curate-tree .kind-condition')]
                   .map(one => [one.dataset.path, /^([xy]) [≤>] 0[.](4|5)/.exec(one.textContent
                     .replace(one.querySelector('title').textContent, ''))])
                   .find(([, words]) => words);
                   return found ? [found[0], found[1][1]] : null"""
            )
        )
        page.press_node("#curate-tree", path)
        field = page.one('#editor-body input[type="number"]')
        field.clear()
        field.send_keys("0.3" if feature == "x" else "0.7")
        keep(page, pictures, "3_curate")
        page.press("#editor-body button", "Change it to")
        page.sees("does something else than the robot's tree", "#changed")
        page.one("#publish-note").send_keys("goes earlier")
        page.press("#publish")
        page.sees("The robot follows this draft.", "#curate-state")
        page.sees("goes earlier", "#versions .current")

        # The executor runs it.
        commands = peer.listen(String, "command")
        state(peer, 0.4)
        page.press("#start")
        peer.wait_until(lambda: commands and commands[-1].data == "go")
        page.section("live")
        page.sees("go", "#command")
        page.until(lambda: page.all("#live-tree .active.kind-action"))
        keep(page, pictures, "4_live")

        # A person takes over, which is a demonstration that is learned from.
        page.section("teach")
        heard.clear()
        hold(page, "stop", lambda: repeated(peer, heard, "stop"))
        page.sees("takeover", "#demonstrations")
        page.press("#recorder-buttons button", "Well done")
        page.section("learn")
        page.press("#learn", "Learn from 4 demonstrations")
        page.sees("of 4 demonstrations", "#learn-draft-summary")
