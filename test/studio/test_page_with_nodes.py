"""The page in a real browser beside real nodes: from teaching to a corrected tree."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import pytest

pytest.importorskip("aiohttp")
pytest.importorskip("selenium")

from chromium import Browser
from ros_processes import LATCHED, NodeProcess, Peer
from selenium.webdriver import ActionChains
from selenium.webdriver.common.keys import Keys
from std_msgs.msg import String
from studio_client import url_of

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import loads
from rebt_ros.logic.conditions import Threshold

LABELS: Final = {"back": 0.2, "go": 0.6, "stop": 0.9}
NODES: Final = {
    "recorder": {"sample_rate": 0.0},
    # Two actions are done at random in the end: as a suggestion, not in the tree.  How late a test
    # is says nothing.
    "learner": {"psa": "never", "reaction_time": 0.0},
    "executor": {"rate": 20.0, "state_timeout": 600.0, "enabled": False},
    "studio": {"port": 0},
}
#: Where they are done, and in which order in two demonstrations: neither state nor previous action
#: tells which comes.
END: Final = 1.2
MIDDLE: Final = ("x ≤ 0.4", "x ≤ 0.5", "x > 0.4", "x > 0.5")
AT_RANDOM: Final = (
    ("wave", "wave", "honk", "honk", "wave"),
    ("honk", "honk", "wave", "wave", "honk"),
)


def state(peer: Peer, x: float) -> None:
    """Where the robot is."""
    peer.state(x, labels=["x"])


def hold(page: Browser, label: str, wait: Callable[[], object]) -> None:
    """Holds the button of an action while something is waited for."""
    button = page.one(f'#takeover [data-key="{label}"]')
    page.run("arguments[0].scrollIntoView({block: 'center'})", button)
    ActionChains(page.driver).click_and_hold(button).perform()
    try:
        wait()
    finally:
        ActionChains(page.driver).release().perform()


def show(peer: Peer, number: int) -> None:
    """A demonstration: back below a half, else go, stop beyond three quarters, and at random."""
    for step in range(20):
        x = (step + number / 2) / 20
        state(peer, x)
        peer.action("back" if x < 0.5 else "go" if x < 0.75 else "stop")
    for label in AT_RANDOM[number]:
        state(peer, END)
        peer.action(label)
    peer.deliver()


def repeated(peer: Peer, heard: list[Any], label: str) -> None:
    """Waits until an action was sent three times."""
    peer.wait_until(lambda: [message.data for message in heard].count(label) >= 3)


class Journey:
    """Real nodes, and a person at the page.

    Args:
        page: The browser.
        peer: The robot.
        start: Starts a node with its parameters.
        pictures: Where a picture of each step is kept.
    """

    def __init__(
        self,
        page: Browser,
        peer: Peer,
        start: Callable[[str, dict[str, Any]], NodeProcess],
        pictures: Path,
    ) -> None:
        self.page, self.peer, self._start, self._pictures = page, peer, start, pictures
        self._steps = 0
        self._nodes = {name: start(name, parameters) for name, parameters in NODES.items()}
        self._url = url_of(self._nodes["studio"])
        page.look()
        page.open(self._url)
        page.run("window.untouched = true")
        self.everybody_is_there()
        self.trees = peer.listen(String, "behavior_tree", LATCHED)
        self.commands = peer.listen(String, "command")
        self.by_hand = peer.listen(String, "action")
        peer.connect(String, "action")

    def everybody_is_there(self) -> None:
        """Waits until the top line says so of all nodes."""
        self.page.until(lambda: len(self.page.all('#health li:not([data-level="GONE"])')) == 3)

    def kept(self, name: str, around: str = "header") -> None:
        """Keeps a picture of a step, around an element."""
        self._steps += 1
        self.page.run("arguments[0].scrollIntoView({block: 'center'})", self.page.one(around))
        self.page.picture(self._pictures / f"step_{self._steps}_{name}.png")

    def commands_are(self, label: str, x: float) -> None:
        """Waits until the executor commands an action where the robot is."""
        self.commands.clear()

        def commanded() -> bool:
            # Again and again: an executor that has just started may not know the robot yet.
            state(self.peer, x)
            return [message.data for message in self.commands[-3:]] == [label] * 3

        self.peer.wait_until(commanded, what=f"the command {label} at {x}")

    def teach(self) -> None:
        """The first time with the buttons of the page."""
        page, peer = self.page, self.peer
        page.section("teach")
        if page.one("#recorder-buttons .primary").text == "Start recording":
            page.press("#recorder-buttons button", "Start recording")
        for label, x in LABELS.items():
            page.one("#new-action-name").send_keys(label, Keys.ENTER)
            state(peer, x)
            hold(page, label, lambda label=label: repeated(peer, self.by_hand, label))
            page.sees(f"{label} ", "#recorder-actions")
        self.kept("teach")
        page.press("#recorder-buttons button", "Well done")
        for number in range(2):
            show(peer, number)
            page.press("#recorder-buttons button", "Well done")
            page.until(lambda number=number: len(page.all("#demonstrations > li")) == number + 2)

    def learn(self) -> None:
        """Makes a tree, and chooses another size."""
        page = self.page
        page.section("learn")
        page.press("#learn", "Learn from 3 demonstrations")
        page.sees("Learned a behavior tree", "#toasts")
        page.until(lambda: len(page.all("#learn-levels label")) > 1)
        page.sees("The robot follows this tree.", "#learn-changed")
        page.press("#learn-levels label:not(:has(:checked))")
        page.sees("acts differently from the robot's tree", "#learn-changed")
        page.until(lambda: page.all("#learn-chart .point"))
        self.kept("another_size", "#learn-chart")

    def curate(self) -> None:
        """The larger tree again, with a suggestion, a choice and another threshold."""
        page = self.page
        page.section("curate")
        page.press("#undo", "Undo: choosing the tree with")
        page.sees("The robot follows this draft.", "#curate-state")
        page.press('#suggestions [data-key="psa-1"] button', "Put it into the draft")
        page.until(lambda: page.all("#curate-tree .kind-psa"))
        self.kept("suggestion", "#suggestions")
        page.press_node("#curate-tree", self._found(".kind-psa", "Parallel/Selector"))
        page.press("#editor-body button", "The first one that can")
        page.until(lambda: not page.all("#curate-tree .kind-psa"))
        self.kept("selector", "#curate-tree")
        page.press_node("#curate-tree", self._found(".kind-condition", *MIDDLE))
        self._drag(-0.2)
        self.kept("threshold", "#editor")
        page.press("#editor-body button", "Change it to")
        page.sees("acts differently from the robot's tree", "#changed")

    def publish(self) -> None:
        """The executor gets the draft, and runs it."""
        page, peer = self.page, self.peer
        page.one("#publish-note").send_keys("goes earlier")
        page.press("#publish")
        page.sees("The robot follows this draft.", "#curate-state")
        page.sees("goes earlier", "#versions .current")
        self.kept("published")
        peer.wait_until(lambda: any(one.data for one in self.trees))
        tree = peer.wait_until(
            lambda: next((tree for tree in map(_tree, self.trees[-1:]) if _is_edited(tree)), None),
            what="the edited tree on behavior_tree",
        )
        first = next(node.label for node in nodes.actions(tree))
        page.press("#start")
        self.commands_are("go", 0.4)
        self.commands_are(first, END)
        page.section("live")
        page.sees(first, "#command")
        page.until(lambda: page.all("#live-tree .active.kind-action"))
        self.kept("driving")

    def correct(self) -> None:
        """A person takes over, which is a demonstration that is learned from."""
        page, peer = self.page, self.peer
        page.section("teach")
        if page.one("#recorder-buttons .primary").text == "Start recording":
            page.press("#recorder-buttons button", "Start recording")
        self.by_hand.clear()
        hold(page, "stop", lambda: repeated(peer, self.by_hand, "stop"))
        page.sees("takeover", "#demonstrations")
        self.kept("takeover")
        page.press("#recorder-buttons button", "Well done")
        page.section("learn")
        page.press("#learn", "Learn from 4 demonstrations")
        page.sees("of 4 demonstrations", "#learn-published-summary")
        self.kept("learned_again", "#learn-chart")

    def all_are_killed(self) -> None:
        """All nodes are killed and start again; the page stays open and heals."""
        page = self.page
        for node in self._nodes.values():
            node.process.send_signal(signal.SIGKILL)
        page.sees("The studio cannot be reached", "#banner")
        self.kept("lost")
        port = urlsplit(self._url).port
        for name, parameters in NODES.items():
            self._nodes[name].wait()
            again = {"port": port} if name == "studio" else parameters
            self._nodes[name] = self._start(name, again)
        page.until(lambda: not page.one("#banner").is_displayed(), "the studio is not reached")
        self.everybody_is_there()
        # It was not enabled when it started: the page says so, and lets it drive.
        page.press("#start")
        self.commands_are("back", 0.05)
        page.section("live")
        page.sees("back", "#command")
        self.kept("healed")
        assert page.run("return window.untouched")

    def _found(self, kind: str, *words: str) -> str:
        """The path of the node of the draft whose words begin so."""
        path = self.page.until(
            lambda: self.page.run(_FIND, f"#curate-tree {kind}", words),
            lambda: f"there is no {words}, but {self.page.text('#curate-tree')}",
        )
        return str(path)

    def _drag(self, by: float) -> None:
        """Drags the threshold of the condition that was pressed."""
        page = self.page
        handle = page.one("#editor .handle")
        before, low, high = (
            float(handle.get_attribute(f"aria-value{what}") or "nan")
            for what in ("now", "min", "max")
        )
        page.run("arguments[0].scrollIntoView({block: 'center'})", handle)
        width = page.run("return arguments[0].closest('svg').getBoundingClientRect().width", handle)
        offset = round(by / (high - low) * width)
        ActionChains(page.driver).drag_and_drop_by_offset(handle, offset, 0).perform()
        after = float(handle.get_attribute("aria-valuenow") or "nan")
        assert abs(after - (before + by)) < 0.05


#: The first node of a selector whose words, without its tooltip, begin like one of those given.
_FIND: Final = """const said = (node) => [...node.querySelectorAll('text')]
      .map((text) => text.textContent).join(' ');
    return [...document.querySelectorAll(arguments[0])]
      .find((node) => arguments[1].some((words) => said(node).startsWith(words)))
      ?.dataset.path ?? null;"""


def _tree(message: String) -> nodes.Node:
    return loads(message.data).tree


def _is_edited(tree: nodes.Node) -> bool:
    """Whether it has what was attached, as a Selector, and the threshold that was dragged."""
    children = nodes.children(tree)
    attached = nodes.children(children[0]) if children else ()
    literals = [node.literal for node in nodes.walk(tree) if isinstance(node, nodes.Condition)]
    dragged = any(
        isinstance(literal.condition, Threshold) and 0.2 < literal.condition.value < 0.4
        for literal in literals
    )
    chosen = any(
        isinstance(node, nodes.Selector)
        and {one.label for one in nodes.actions(node)} == {"honk", "wave"}
        for node in attached
    )
    return dragged and chosen


def test_a_person_teaches_learns_curates_publishes_and_corrects_in_the_page(
    chromium: Browser, domain: int, peer: Peer, tmp_path: Path, pictures: Path
) -> None:
    with ExitStack() as stack:

        def start(name: str, parameters: dict[str, Any]) -> NodeProcess:
            return stack.enter_context(NodeProcess(name, domain, tmp_path, parameters))

        journey = Journey(chromium, peer, start, pictures)
        journey.teach()
        journey.learn()
        journey.curate()
        journey.publish()
        journey.correct()
        journey.all_are_killed()
