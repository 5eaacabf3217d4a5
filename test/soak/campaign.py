"""A soak from start to end: nodes and robot, faults at random, and what is checked all the time."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from fuzz import corpus
from recorder_trials import cpu_seconds
from ros_processes import LATCHED, Peer, own_domain, values_of
from std_msgs.msg import Float64MultiArray, String

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.errors import RebtError
from rebt_ros.storage.tree_file import read_tree
from soak import recordings
from soak.faults import FAULTS
from soak.fleet import Fleet, RobotProcess
from soak.ledger import Ledger
from soak.robot import BLOCK, LABELS

#: How long something that must happen may take before it counts as a loss (seconds).
_PATIENCE: Final = 60.0

#: How much later than an answer was received it may have been sent (seconds).
_ANSWERED: Final = 0.1

#: How long a message may be under way where one was lost and is sent again (seconds).
_UNDER_WAY: Final = 10.0

#: Pause for discovery after a start, so that no command is sent before the robot can hear it.
_DISCOVERY: Final = 2.0

_TASKS: Final = {"recorder": "recording", "learner": "learning", "executor": "execution"}


@dataclass(frozen=True, slots=True)
class Plan:
    """What a soak does."""

    seconds: float
    seed: int
    state_rate: float
    """States per second; a tenth of them comes with an action."""
    tick_rate: float
    """Ticks, and so commands, per second."""


class Soak:
    """Everything that runs, and what is known of it."""

    def __init__(self, directory: Path, domain: int, plan: Plan, peer: Peer) -> None:
        self.plan = plan
        self.peer = peer
        self.ledger = Ledger()
        self.directory = directory
        self.demonstrations = directory / "demonstrations"
        parameters: dict[str, dict[str, object]] = {
            # What is lost on the way of a busy machine is sent again every three seconds, and may
            # be lost again.
            "recorder": {"demonstrations": self.demonstrations, "state_wait": 30.0},
            "learner": {
                "demonstrations": self.demonstrations,
                "output": directory / "learned",
                "max_depth": 4,
            },
            # The demonstrator goes on while the tree drives, and does not take over by that.
            "executor": {"rate": plan.tick_rate, "takeover_topics": ["takeover"]},
        }
        self.fleet = Fleet(directory, domain, parameters, self.ledger)
        self.robot = RobotProcess(directory, domain, plan.state_rate)
        self.documents: list[str] = [dumps(corpus.simple())]
        """The tree that is swapped for others; of the learner once there is one."""
        self.swaps = 0
        self._tree = ""
        """The last one that the learner has said is learned."""
        self._published: set[str] = set()
        self._marks: tuple[int, int] | None = None
        """Commands heard and sent when the executor rested last, in the same life."""
        self._disabled_since: float | None = None
        peer.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_report, 10)
        peer.node.create_subscription(String, "behavior_tree", self._on_tree, LATCHED)
        self._next_watch = 0.0

    def begin(self) -> None:
        """Starts everything, while the robot moves."""
        for name in _TASKS:
            self.fleet.start(name)
        self.trees = self.peer.connect(String, "behavior_tree", LATCHED)
        self.states = self.peer.connect(Float64MultiArray, "state")
        self.actions = self.peer.connect(String, "action")
        for name in _TASKS:
            self.status(name)
        self.publish_good_tree()
        self.expect_rows()
        self._enable_fresh()

    # --- waiting ------------------------------------------------------------------------------

    def _meanwhile(self) -> None:
        self.peer.spin_once()
        now = time.monotonic()
        if now > self._next_watch:
            self._next_watch = now + 1.0
            self.fleet.watch()
            self._listen()

    def wait(self, seconds: float) -> None:
        """Lets time pass; messages are taken."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._meanwhile()

    def expect(self, condition: Callable[[], Any], what: str) -> Any:
        """Waits for what must happen; that it does not is a loss."""
        began = time.monotonic()
        while True:
            value = condition()
            if value:
                self.ledger.raise_to("longest_wait_s", time.monotonic() - began)
                return value
            if time.monotonic() - began > _PATIENCE:
                self.ledger.lose("hangs", f"waited {_PATIENCE:.0f} s in vain for {what}")
                return None
            self._meanwhile()

    def expect_relearn(self, call: Any, what: str = "the answer to a relearn") -> None:
        """Waits for the answer of ~/relearn.

        Learning stands back for all else, and on a busy machine it is slow: it hangs where it has
        no more of the processor's time for so long, or has had so much of it.
        """
        used, since = self._learning_time(), time.monotonic()
        first = used
        while not call.done() and time.monotonic() - since < _PATIENCE:
            self._meanwhile()
            now = self._learning_time()
            if now != used and now - first < _PATIENCE:
                used, since = now, time.monotonic()
        self.expect(call.done, what)

    def _learning_time(self) -> float:
        """What the learning process has had of the processor (seconds); 0 if there is none."""
        status = self.peer.diagnostics.get("learner: learning")
        pid = values_of(status)["learning process"] if status else ""
        try:
            return cpu_seconds(int(pid))
        except (ValueError, OSError):
            return 0.0

    @contextlib.contextmanager
    def forgiving(self, *errors: type[Exception]) -> Iterator[None]:
        """For what may have ended by itself."""
        with contextlib.suppress(*errors):
            yield

    # --- what nodes say -----------------------------------------------------------------------

    def status(self, name: str) -> Any:
        """The next report of a node."""
        key = f"{name}: {_TASKS[name]}"
        self.peer.diagnostics.pop(key, None)
        return self.expect(lambda: self.peer.diagnostics.get(key), f"a report of the {name}")

    def expect_condition(self, condition: str) -> None:
        """Waits until the executor says so."""
        key = "executor: execution"
        self.peer.diagnostics.pop(key, None)

        def reported() -> bool:
            status = self.peer.diagnostics.get(key)
            return status is not None and values_of(status)["condition"] == condition

        self.expect(reported, f"the executor's condition {condition!r}")

    def expect_rows(self) -> None:
        """Waits until the recorder writes rows."""

        def rows() -> int:
            status = self.peer.diagnostics.get("recorder: recording")
            return int(values_of(status)["rows of the demonstration"]) if status else 0

        self.status("recorder")
        before = rows()
        self.expect(lambda: rows() not in (0, before), "rows of the recorder")

    def answer(self, service: str, data: bool | None = None) -> Any:
        """Calls a service and waits for its answer."""
        call = self.peer.begin(service, data)
        return self.expect(call.done, f"the answer of {service}") and call.result()

    def _on_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "recorder: recording":
                values = values_of(status)
                rows = int(values["rows of the demonstration"])
                path = Path(values["demonstration"]).resolve()
                if rows:
                    self.ledger.acknowledge(path, rows)
            elif status.name == "executor: execution":
                longest = float(values_of(status)["longest tick (ms)"])
                self.ledger.raise_to("longest_tick_ms", longest)

    def _on_tree(self, message: String) -> None:
        self._published.add(message.data)

    # --- the learner --------------------------------------------------------------------------

    def note_tree(self, call: Any) -> None:
        """Takes note of an answer to a relearn: what is learned is on disk and on the topic."""
        if not call.done() or not call.result().success:
            return
        path = self.directory / "learned" / "tree.json"
        try:
            read_tree(path)
        except RebtError as err:
            self.ledger.lose("last good tree", f"after a relearn: {err}")
            return
        self.ledger.figures["trees_learned"] = self.ledger.figures.get("trees_learned", 0) + 1
        self._tree = path.read_text(encoding="utf-8")
        self.documents[0] = self._tree
        self._expect_tree()

    def _expect_tree(self) -> None:
        self.expect(lambda: self._tree in self._published, "the last good tree on its topic")

    # --- the executor -------------------------------------------------------------------------

    def publish_good_tree(self) -> None:
        """What an executor that starts later hears from here, where the learner has no tree."""
        self.trees.publish(String(data=self.documents[0]))

    def restart(self, name: str) -> None:
        """Starts a node that has ended; waits until it does its work."""
        if name == "executor":
            self._listen()
            # Whatever comes from its next life before it is enabled is a loss.
            self._disabled_since = self._disabled_since or time.time()
            self._marks = None
        if name == "learner":
            self._published.clear()
        self.fleet.start(name)
        self.status(name)
        match name:
            case "executor":
                self._enable_fresh()
            case "learner" if self._tree:
                self._expect_tree()
            case "recorder":
                # The robot has gone on meanwhile.
                self.expect_rows()

    def _enable_fresh(self) -> None:
        self.wait(_DISCOVERY)
        self.expect(
            lambda: "nodes" in values_of(self.status("executor")), "a tree in a fresh executor"
        )
        self._marks = self._resting()
        self.enable(True)

    def enable(self, data: bool) -> None:
        """Enables or disables; what it commands meanwhile is judged later."""
        began = time.time()
        if data:
            self._listen(until=began)
            self._disabled_since = None
        self.answer("/executor/enable", data)
        if not data:
            self._disabled_since = time.time()

    def audit_commands(self) -> None:
        """Disables, and compares what was sent with what was heard and ticked."""
        if self._disabled_since is None:
            self.enable(False)
        before = self._marks
        self._marks = self._resting()
        if before is not None and self._marks is not None:
            heard, sent = (after - one for after, one in zip(self._marks, before, strict=True))
            if heard != sent:
                kind = "missed commands" if heard < sent else "doubled commands"
                self.ledger.lose(kind, f"{heard} heard of {sent} sent", abs(heard - sent))
        self.enable(True)
        self.expect_condition("running")

    def _resting(self) -> tuple[int, int] | None:
        """Commands heard and sent, while it is disabled."""
        self.wait(_ANSWERED)
        status = self.status("executor")
        if status is None:
            return None
        values = values_of(status)
        if values["ticks"] != values["commands"]:
            self.ledger.lose(
                "missed commands", f"{values['ticks']} ticks, {values['commands']} commands"
            )
        sent = int(values["commands"])
        if self._marks is not None:
            wanted = self._marks[0] + sent - self._marks[1]
            end = time.monotonic() + _UNDER_WAY
            while self.robot.listen() < wanted and time.monotonic() < end:
                self._meanwhile()
            # One more than was sent would come now.
            self.wait(_ANSWERED)
        return self.robot.listen(), sent

    def _listen(self, until: float | None = None) -> None:
        """Judges what the robot has heard since it was judged last."""
        count = len(self.robot.commands)
        self.robot.listen()
        for stamp, label in self.robot.commands[count:]:
            if label not in LABELS:
                self.ledger.lose("wrong commands", label)
            since = self._disabled_since
            late = since is not None and stamp > since + _UNDER_WAY
            if late and (until is None or stamp < until):
                self.ledger.lose(
                    "commands while disabled", f"{stamp - since:.2f} s after the answer"
                )

    # --- the end ------------------------------------------------------------------------------

    def end(self) -> None:
        """Stops everything, then looks at what is there."""
        self.audit_commands()
        self.fleet.end()
        sent = self.robot.end()
        self._listen()
        figures = self.ledger.figures
        figures["states"], figures["actions"] = sent["states"], sent["actions"]
        figures["messages"] = sent["states"] + sent["actions"]
        figures["commands"] = len(self.robot.commands)
        figures["swaps"] = self.swaps
        recordings.audit(self.demonstrations, self.ledger, sent["states"] // BLOCK + 1)


def run(directory: Path, plan: Plan, told: Callable[[str], object]) -> Ledger:
    """Soaks.

    Args:
        directory: An empty one, for recordings, trees and logs.
        plan: What to do.
        told: Told of each fault.
    """
    random = Random(plan.seed)
    with own_domain() as domain, Peer(domain) as peer:
        soak = Soak(directory, domain, plan, peer)
        try:
            soak.begin()
            end = time.monotonic() + plan.seconds
            while time.monotonic() < end:
                began = time.monotonic()
                what = random.choice(FAULTS)(soak, random)
                soak.ledger.faults[what] += 1
                told(f"{what} ({time.monotonic() - began:.1f} s)")
                soak.wait(random.uniform(0.0, 1.0))
            soak.end()
        finally:
            soak.robot.kill()
            soak.fleet.kill_all()
        return soak.ledger
