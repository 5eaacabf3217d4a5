"""A browser without a page: what a test says to a studio, and what it is told."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable
from typing import Any

import aiohttp
from ros_processes import PATIENCE, NodeProcess, wait_until

from rebt_ros.studio.access import COOKIE


def url_of(studio: NodeProcess) -> str:
    """The address that a studio prints when it is ready."""
    studio.says("open http://")
    found = re.search(r"open (http://\S+) in a browser", studio.stderr)
    assert found
    return found[1]


class StudioClient:
    """Opens the page, and speaks over its WebSocket.

    Args:
        url: Of the page.
    """

    def __init__(self, url: str) -> None:
        self.url = url.split("/?")[0]
        self.board: dict[str, dict[str, Any]] = {}
        self._answers: dict[int, dict[str, Any]] = {}
        self._asked = 0
        self._loop = asyncio.new_event_loop()
        self._do(self._open(url))
        self.wait(lambda: self.board)

    def close(self) -> None:
        """Leaves."""
        self._do(self._session.close())
        self._loop.close()

    def __enter__(self) -> StudioClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, verb: str, **arguments: Any) -> dict[str, Any]:
        """Asks for something and waits for the answer."""
        number = self.begin(verb, **arguments)
        return self.answer(number)

    def begin(self, verb: str, **arguments: Any) -> int:
        """Asks for something; `answer` waits for the answer."""
        self._asked += 1
        self.send({"id": self._asked, "do": verb, **arguments})
        return self._asked

    def send(self, message: Any) -> None:
        """Sends what need not be a request."""
        self._do(self._socket.send_json(message))

    def answer(self, number: int | None) -> dict[str, Any]:
        """Waits for an answer."""
        self.wait(lambda: number in self._answers)
        return self._answers.pop(number)  # type: ignore[arg-type]

    def does(self, verb: str, **arguments: Any) -> dict[str, Any]:
        """Asks for something that must succeed."""
        answer = self.ask(verb, **arguments)
        assert answer["ok"], answer
        return answer

    def wait(self, condition: Callable[[], Any], timeout: float = PATIENCE) -> Any:
        """Listens until a condition holds."""
        return wait_until(condition, timeout, meanwhile=self.listen)

    def listen(self, seconds: float = 0.05) -> None:
        """Takes what has come."""
        self._do(self._listen(seconds))

    def _do(self, work: Any) -> Any:
        return self._loop.run_until_complete(work)

    async def _open(self, url: str) -> None:
        self._session = aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True))
        async with self._session.get(url) as response:
            assert response.status == 200, await response.text()
        assert COOKIE in {cookie.key for cookie in self._session.cookie_jar}
        self._socket = await self._session.ws_connect(
            f"{self.url}/live", headers={"Origin": self.url}
        )

    async def _listen(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            try:
                message = await self._socket.receive(timeout=left)
            except TimeoutError:
                return
            if message.type is not aiohttp.WSMsgType.TEXT:
                raise ConnectionError(f"the studio is gone: {message}")
            self._take(message.json())

    def _take(self, message: dict[str, Any]) -> None:
        if "snapshot" in message:
            self.board = message["snapshot"]
        if "answer" in message:
            self._answers[message["answer"]] = message
        for section, values in message.get("changes", {}).items():
            known = self.board.setdefault(section, {})
            for key, value in values.items():
                if value is None:
                    known.pop(key, None)
                else:
                    known[key] = value
