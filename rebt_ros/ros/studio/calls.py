"""Services of other nodes, called from threads that may wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Final

from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from rebt_ros.errors import RebtError

#: For an answer (seconds).
PATIENCE: Final = 10.0
#: Between two looks at whether a node is still at work (seconds).
_LOOK: Final = 0.5
#: For a service that was not seen yet (seconds).
_FINDING: Final = 2.0

_ENDING: Final = "the studio is ending."


class CallError(RebtError):
    """A node did not do what it was asked."""


class Calls:
    """Calls services; the node is spun by another thread.

    Args:
        node: The studio's.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Client] = {}
        self._changed = threading.Condition()
        self._ended = False

    def prepare(self, switches: list[str], triggers: list[str]) -> None:
        """Makes the clients, so that services are known by the time they are called."""
        for name in switches:
            self._clients[name] = self._node.create_client(SetBool, name)
        for name in triggers:
            self._clients[name] = self._node.create_client(Trigger, name)

    def close(self) -> None:
        """Ends all waiting."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def switch(self, service: str, on: bool) -> str:
        """Calls a service that switches something.

        Raises:
            CallError: It is not there, does not answer, or refuses.
        """
        return self._call(service, SetBool.Request(data=on), PATIENCE)

    def trigger(
        self,
        service: str,
        patience: float = PATIENCE,
        works: Callable[[], bool] = lambda: False,
    ) -> str:
        """Calls a service without arguments.

        Args:
            service: Its name.
            patience: How long to wait for the answer (seconds).
            works: Whether the node is seen to work on it, for which it has all the time it needs.
                A node that was killed and started again knows nothing of the call, and rests.

        Raises:
            CallError: It is not there, does not answer, or refuses.
        """
        return self._call(service, Trigger.Request(), patience, works)

    def _call(
        self,
        service: str,
        request: Any,
        patience: float,
        works: Callable[[], bool] = lambda: False,
    ) -> str:
        client = self._clients[service]
        if not client.wait_for_service(_FINDING):
            node = service.rpartition("/")[0]
            raise CallError(f"there is no {node} that answers: start it, or check its name.")
        with self._changed:
            if self._ended:
                raise CallError(_ENDING)
            future: Future = client.call_async(request)
            future.add_done_callback(self._note)
        answer = self._answer(future, patience, works)
        if answer is None:
            client.remove_pending_request(future)
            late = (
                f"{service} did not answer within {patience:.0f} s: ask again, or look at its log."
            )
            raise CallError(_ENDING if self._ended else late)
        if not answer.success:
            raise CallError(answer.message or f"{service} refused.")
        return str(answer.message) or "done."

    def _answer(self, future: Future, patience: float, works: Callable[[], bool]) -> Any:
        """What was answered; None if nothing was for as long as it is waited for."""
        left = patience
        while left > 0 and not (future.done() or self._ended):
            # Counted in looks: time in which this machine stood still is no waiting.
            with self._changed:
                self._changed.wait_for(lambda: future.done() or self._ended, min(_LOOK, left))
            left = patience if works() else left - _LOOK
        return future.result() if future.done() else None

    def _note(self, _: Future) -> None:
        with self._changed:
            self._changed.notify_all()
