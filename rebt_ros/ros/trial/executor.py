"""The executor as a trial sees it: it is given a tree, drives, and stops."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from rebt_ros.ros.command_channels import DRIVING_QOS
from rebt_ros.ros.trial.peer import PATIENCE, TrialPeer
from rebt_ros.trial.candidates import Candidate
from rebt_ros.trial.errors import TrialError

_LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: What others publish is heard, and in its order.
_ALL_TREES: Final = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: The latest report is all that counts, among those of all other nodes.
_REPORTS: Final = QoSProfile(depth=100)

#: How long the executor may take over an answer (seconds).
_ANSWERING: Final = 30.0

#: How often a tree is published, and how long each time to wait for it (seconds): where others
#: publish as well, their trees may come later there than here.
_PUBLICATIONS: Final = 8
_AGAIN: Final = 4.0

#: How long a publisher may take over the tree that it has published before (seconds).
_FIRST_TREE: Final = 2.0

_REFUSED: Final = "refused trees"


class ExecutorHandle:
    """Gives trees to the executor, and lets it drive.

    Args:
        peer: Talks to it.
        name: The executor's.
    """

    def __init__(self, peer: TrialPeer, name: str) -> None:
        self._peer = peer
        self._client = peer.create_client(SetBool, f"{name}/enable")
        self._source = peer.name_of(self._client).removesuffix("/enable").lstrip("/")
        self._publisher = peer.create_publisher(String, "behavior_tree", _LATCHED)
        peer.create_subscription(String, "behavior_tree", self._on_tree, _ALL_TREES)
        peer.create_subscription(Bool, f"{name}/driving", self._on_driving, DRIVING_QOS)
        peer.create_subscription(DiagnosticArray, "/diagnostics", self._on_report, _REPORTS)
        self._current: Candidate | None = None
        self._sent: deque[str] = deque()
        self._replaced = False
        self._message = ""
        self._refused = ""
        self._values: Mapping[str, str] | None = None
        self.driving: bool | None = None
        """Whether it says to drive; None where it has not said so since it was enabled last."""
        self.before: str | None = None
        """The latest document that somebody else has published."""

    def connect(self) -> None:
        """Finds and disables it, and hears which tree was published before.

        Raises:
            TrialError: It is not there.
        """
        self._peer.find(self._client)
        self.enable(False)
        if not self._peer.wait(lambda: self._values is not None, PATIENCE):
            raise TrialError(
                f"{self._source} says nothing on /diagnostics: check that it is an executor."
            )
        topic = self._publisher.topic_name
        if self._peer.count_publishers(topic) > 1:
            self._peer.wait(lambda: self.before is not None, _FIRST_TREE)

    @property
    def present(self) -> bool:
        """Whether it is there."""
        return bool(self._client.service_is_ready())

    @property
    def replaced(self) -> bool:
        """Whether it runs, or is about to run, another tree than it was given last."""
        return self._replaced or not self._has(self._current)

    @property
    def condition(self) -> str:
        """What it said last that it does or waits for."""
        return self._message

    @property
    def waits(self) -> bool:
        """Whether it said last that it waits for something, such as the state."""
        return self._message.startswith("waiting for ")

    def give(self, candidate: Candidate) -> None:
        """Gives it a tree, and waits until it is that which runs.

        Raises:
            TrialError: It refuses the tree, or does not take it.
        """
        if self._current is candidate and not self.replaced:
            return
        refused = self._refused
        if self._replaced:
            # The latest report may be older than the other tree.
            self._values = None
        self._current, self._replaced = candidate, False
        for _ in range(_PUBLICATIONS):
            self._publish(candidate.document)
            self._peer.wait(lambda: self._has(candidate) or self._refused != refused, _AGAIN)
            if self._has(candidate):
                return
            if self._refused != refused:
                raise TrialError(f"{self._source} refuses {candidate.name}: {self._message}")
        waits = (self._values or {}).get("the next tree waits for", "")
        raise TrialError(
            f"{self._source} does not run {candidate.name}: it says {self._message!r}"
            + (f" and waits for {waits}." if waits else ".")
        )

    def enable(self, enabled: bool) -> None:
        """Lets it drive, or stops it.

        Raises:
            TrialError: It does not answer.
        """
        self.driving = None
        self._peer.call(self._client, SetBool.Request(data=enabled), _ANSWERING, again=True)

    def restore(self) -> bool:
        """Publishes again what was published before the trial, or by others meanwhile.

        Returns:
            Whether there was anything.
        """
        if self.before is None:
            return False
        if self._current is not None and self._current.document != self.before:
            self._publish(self.before)
            self._publisher.wait_for_all_acked(Duration(seconds=PATIENCE))
        return True

    def _publish(self, document: str) -> None:
        self._sent.append(document)
        self._publisher.publish(String(data=document))

    def _has(self, candidate: Candidate | None) -> bool:
        """Whether the tree that runs is a candidate's, by the latest report."""
        if self._values is None or candidate is None:
            return False
        return self._values.get("document") == candidate.fingerprint

    def _on_tree(self, message: String) -> None:
        # What is published here comes back, in its order.
        if message.data in self._sent:
            while self._sent.popleft() != message.data:
                pass
            return
        self.before = message.data
        self._replaced = True

    def _on_driving(self, message: Bool) -> None:
        self.driving = message.data

    def _on_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self._source}: execution":
                self._message = status.message
                self._values = {value.key: value.value for value in status.values}
                self._refused = self._values.get(_REFUSED, "")
