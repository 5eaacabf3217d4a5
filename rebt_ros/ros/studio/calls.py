"""Services of other nodes, called from threads that may wait."""

from __future__ import annotations

import threading
from typing import Any, Final

from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from rebt_ros.errors import RebtError

#: For an answer (seconds).
PATIENCE: Final = 10.0
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

    def trigger(self, service: str, patience: float | None = PATIENCE) -> str:
        """Calls a service without arguments.

        Args:
            service: Its name.
            patience: How long to wait for the answer (seconds); None for however long it takes.

        Raises:
            CallError: It is not there, does not answer, or refuses.
        """
        return self._call(service, Trigger.Request(), patience)

    def _call(self, service: str, request: Any, patience: float | None) -> str:
        client = self._clients[service]
        if not client.wait_for_service(_FINDING):
            node = service.rpartition("/")[0]
            raise CallError(f"there is no {node} that answers: start it, or check its name.")
        with self._changed:
            if self._ended:
                raise CallError(_ENDING)
            future: Future = client.call_async(request)
            future.add_done_callback(self._note)
            self._changed.wait_for(lambda: future.done() or self._ended, patience)
        answer = future.result() if future.done() else None
        if answer is None:
            client.remove_pending_request(future)
            late = f"{service} did not answer within {patience or 0:.0f} s: look at its log."
            raise CallError(_ENDING if self._ended else late)
        if not answer.success:
            raise CallError(answer.message or f"{service} refused.")
        return str(answer.message) or "done."

    def _note(self, _: Future) -> None:
        with self._changed:
            self._changed.notify_all()
