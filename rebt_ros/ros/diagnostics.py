"""What a node says about itself on ``/diagnostics``, and how it counts and reports faults."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

from rebt_ros.ros.quiet_events import create_publisher

#: How long a fault counts as recent, and stays quiet after it was logged (seconds).
_RECENT = 5.0
_QUIET = 10.0


class Level(Enum):
    """How well a node is."""

    OK = DiagnosticStatus.OK
    WARN = DiagnosticStatus.WARN
    ERROR = DiagnosticStatus.ERROR


@dataclass(frozen=True, slots=True)
class Report:
    """The state of a node at one moment."""

    level: Level
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


class Diagnostics:
    """Publishes a node's report once per second, also where simulated time stands still.

    Args:
        node: The node.
        task: What the report is about, in one word.
        report: Makes the report.
        group: Callback group of the timer; the node's default group if None.
    """

    def __init__(
        self,
        node: Node,
        task: str,
        report: Callable[[], Report],
        group: CallbackGroup | None = None,
    ) -> None:
        self._node = node
        self._source = node.get_fully_qualified_name().lstrip("/")
        self._task = task
        self._report = report
        self._publisher = create_publisher(node, DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(1.0, self.publish, callback_group=group, clock=steady)

    def publish(self) -> None:
        """Publishes a report now."""
        report = self._report()
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.status = [
            DiagnosticStatus(
                level=report.level.value,
                name=f"{self._source}: {self._task}",
                message=report.message,
                hardware_id=self._source,
                values=[
                    KeyValue(key=key, value=str(value)) for key, value in report.values.items()
                ],
            )
        ]
        self._publisher.publish(message)


class Faults:
    """Counts faults by kind and warns of each kind once in a while."""

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._logged: dict[str, float] = {}
        self._latest = ("", -math.inf)
        self.counts: Counter[str] = Counter()

    def note(self, kind: str, sentence: str, *, severe: bool = False) -> None:
        """Counts a fault, and logs it unless its kind was logged just before.

        Args:
            kind: What to count it as.
            sentence: What happened.
            severe: Whether it is logged as an error, not as a warning.
        """
        now = time.monotonic()
        self.counts[kind] += 1
        self._latest = (sentence, now)
        if now - self._logged.get(kind, -math.inf) >= _QUIET:
            self._logged[kind] = now
            # On two lines: rclpy refuses another severity from the same one.
            if severe:
                self._logger.error(sentence)
            else:
                self._logger.warning(sentence)

    @property
    def recent(self) -> str:
        """The latest fault, if it happened within the last seconds; else empty."""
        sentence, when = self._latest
        return sentence if time.monotonic() - when < _RECENT else ""
