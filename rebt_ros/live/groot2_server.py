"""Groot2's monitor watches the executor: a ZeroMQ socket, and the thread that answers on it."""

from __future__ import annotations

import threading
from typing import Any

from rebt_ros.errors import OptionError
from rebt_ros.live.groot2_protocol import Groot2Answers

#: How often the thread looks whether it is to end (milliseconds).
_PATIENCE = 100
#: Larger requests are not read (bytes); the largest one of Groot2 names blackboards.
_LARGEST_REQUEST = 64 * 1024
#: Requests, and answers, that may wait.
_MOST_WAITING = 16


class Groot2Server:
    """Answers watchers on this machine, in a thread of its own.

    Args:
        port: TCP port on the loopback interface; 0 for any that is free.

    Raises:
        OptionError: pyzmq is not installed, or the port is taken.
    """

    def __init__(self, port: int) -> None:
        try:
            import zmq
        except ImportError as err:
            raise OptionError(
                "parameter 'groot2_port' needs pyzmq, which is not installed: "
                "'apt install python3-zmq', or 'python3 -m pip install pyzmq'."
            ) from err
        self.answers = Groot2Answers()
        self._zmq: Any = zmq
        self._context = zmq.Context()
        # What pyzmq says of the types of options differs between its versions.
        socket: Any = self._context.socket(zmq.REP)
        socket.linger = 0
        socket.set_hwm(_MOST_WAITING)
        socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_REQUEST)
        socket.setsockopt(zmq.SNDTIMEO, _PATIENCE)
        try:
            socket.bind(f"tcp://127.0.0.1:{port or '*'}")
        except zmq.ZMQError as err:
            socket.close()
            self._context.term()
            raise OptionError(
                f"parameter 'groot2_port' is {port}, where nobody can listen ({err}): "
                "name another port."
            ) from err
        self.port = int(socket.getsockopt(zmq.LAST_ENDPOINT).decode().rpartition(":")[2])
        """Where it answers."""
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(socket,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Answers nobody any more; takes a tenth of a second at most."""
        self._closing.set()
        self._thread.join()
        self._context.term()

    def _run(self, socket: Any) -> None:
        with socket:
            while not self._closing.is_set():
                if socket.poll(_PATIENCE):
                    self._serve(socket)

    def _serve(self, socket: Any) -> None:
        """Answers a request; whatever becomes of it, the next one is answered."""
        try:
            socket.send_multipart(self.answers.answer(socket.recv_multipart()))
        except self._zmq.ZMQError:
            # Who asked is gone, or does not listen.
            self.answers.bad_requests += 1
