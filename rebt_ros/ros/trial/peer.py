"""The node of a trial: waits for what others do, and calls their services."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from rebt_ros.trial.errors import TrialError

#: For what is there unless it was not started (seconds).
PATIENCE: Final = 10.0

#: When a call is made again that may be made often: an answer is lost where a service does not
#: know yet who asks (seconds).
_AGAIN: Final = 3.0

#: How long to sleep at most while nothing happens (seconds).
_NAP: Final = 0.02


class TrialPeer(Node):
    """Spins only while it waits; all that waits raises KeyboardInterrupt when a signal has come.

    Args:
        signals: Those that have come; an exception that is raised by a signal itself would leave
            rclpy in the middle of something.
    """

    def __init__(self, signals: list[int]) -> None:
        super().__init__("trial")
        self._signals = signals
        self._spinner = SingleThreadedExecutor(context=self.context)
        self._spinner.add_node(self)

    def close(self) -> None:
        """Ends it."""
        self._spinner.shutdown()
        self.destroy_node()

    @property
    def seconds(self) -> float:
        """Simulated time where that is used; else a clock that nobody sets."""
        if self.get_parameter("use_sim_time").value:
            return float(self.get_clock().now().nanoseconds) / 1e9
        return time.monotonic()

    def spin_once(self) -> None:
        """Takes what has come, or waits a moment for it."""
        self._spinner.spin_once(timeout_sec=_NAP)
        if self._signals:
            self._signals.clear()
            raise KeyboardInterrupt

    def wait(self, condition: Callable[[], object], timeout: float) -> bool:
        """Waits until a condition holds.

        Args:
            condition: Is asked again and again.
            timeout: Seconds, not simulated.

        Returns:
            Whether it holds.
        """
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > deadline:
                return False
            self.spin_once()
        return True

    def name_of(self, client: Client) -> str:
        """The full name of a client's service."""
        return str(self.resolve_service_name(client.srv_name))

    def find(self, client: Client) -> None:
        """Waits for a service.

        Raises:
            TrialError: There is none.
        """
        if not self.wait(client.service_is_ready, PATIENCE):
            raise TrialError(
                f"there is no service {self.name_of(client)}: start the node that offers it, or "
                "check its name."
            )

    def call(self, client: Client, request: Any, timeout: float, *, again: bool) -> Any:
        """Calls a service and waits for its answer.

        Args:
            client: Of the service.
            request: What to ask.
            timeout: Seconds, not simulated.
            again: Whether it makes no difference how often it is called.

        Raises:
            TrialError: There is no answer.
        """
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0:
            future = client.call_async(request)
            if self.wait(future.done, min(_AGAIN, left) if again else left):
                return future.result()
            client.remove_pending_request(future)
        raise TrialError(
            f"service {self.name_of(client)} did not answer within {timeout:.0f} s: look at the "
            "log of its node."
        )
