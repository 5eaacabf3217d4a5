"""Services of other nodes, called from threads that may wait.

A node that was killed is known to the middleware for some seconds more, and one that has just
started may not know yet where to answer.  Both lose calls without a word, so calls are made again:
at once where that does no harm, otherwise only to a node that has started since and so cannot have
got the call.
"""

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
#: Looks in vain after which a call is made again.
_LOOKS: Final = 4
#: For a service that was not seen yet (seconds).
_FINDING: Final = 2.0

_ENDING: Final = "the studio is ending."


class CallError(RebtError):
    """A node did not do what it was asked."""


def _done(sent: list[Future]) -> Any:
    """The first answer to what was sent; None as long as there is none."""
    return next((future.result() for future in sent if future.done()), None)


def _never() -> bool:
    """Nothing is seen of it."""
    return False


class Newcomers:
    """Whether somebody has come since who cannot have heard what was said before.

    Args:
        count: Counts who is there; the middleware counts who was killed for some seconds more.
    """

    def __init__(self, count: Callable[[], int]) -> None:
        self._count = count
        self._there = 0

    def begin(self) -> None:
        """Says it, to all who are there."""
        self._there = self._count()

    @property
    def have_come(self) -> bool:
        """Whether one has come since the last look; look often, since others go meanwhile."""
        before, self._there = self._there, self._count()
        return self._there > before


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
        return self._call(service, SetBool.Request(data=on), PATIENCE, _never, twice=True)

    def trigger(
        self,
        service: str,
        patience: float = PATIENCE,
        works: Callable[[], bool] = _never,
    ) -> str:
        """Calls a service without arguments; again only where its node has started since.

        Args:
            service: Its name.
            patience: How long to wait for the answer (seconds).
            works: Whether the node is seen to work on it, for which it has all the time it needs.
                A node that was killed and started again knows nothing of the call, and rests.

        Raises:
            CallError: It is not there, does not answer, or refuses.
        """
        return self._call(service, Trigger.Request(), patience, works, twice=False)

    def _call(
        self,
        service: str,
        request: Any,
        patience: float,
        works: Callable[[], bool],
        *,
        twice: bool,
    ) -> str:
        client = self._clients[service]
        if not client.wait_for_service(_FINDING):
            node = service.rpartition("/")[0]
            raise CallError(f"there is no {node} that answers: start it, or check its name.")
        servers = Newcomers(lambda: self._node.count_services(client.srv_name))
        sent: list[Future] = []
        # Counted in looks: time in which this machine stood still is no waiting.
        left, looks, due = patience, 0, 0
        try:
            while not (self._ended or _done(sent)):
                if looks == due:
                    servers.begin()
                    sent.append(self._send(client, request))
                    due = looks + _LOOKS if twice else -1
                if left <= 0:
                    break
                with self._changed:
                    self._changed.wait_for(lambda: self._ended or _done(sent), min(_LOOK, left))
                busy = works()
                left = patience if busy else left - _LOOK
                looks += 1
                if servers.have_come:
                    # It has all the time that it needs, and some to find out about the studio.
                    left, due = patience, looks + _LOOKS
                elif busy:
                    due = -1
        finally:
            for future in sent:
                client.remove_pending_request(future)
        answer = _done(sent)
        if answer is None:
            late = (
                f"{service} did not answer within {patience:.0f} s: ask again, or look at its log."
            )
            raise CallError(_ENDING if self._ended else late)
        if not answer.success:
            raise CallError(answer.message or f"{service} refused.")
        return str(answer.message) or "done."

    def _send(self, client: Client, request: Any) -> Future:
        future: Future = client.call_async(request)
        future.add_done_callback(self._note)
        return future

    def _note(self, _: Future) -> None:
        with self._changed:
            self._changed.notify_all()
