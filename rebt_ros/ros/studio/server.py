"""The web server of the studio: a page, and one WebSocket for each browser that shows it."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from aiohttp import WSMsgType, web

from rebt_ros.errors import OptionError
from rebt_ros.studio import access
from rebt_ros.studio.access import Access
from rebt_ros.studio.board import Board, Changes
from rebt_ros.studio.verbs import Reply

#: Answers a request; runs in a thread and may take its time.
Ask = Callable[[Any], Reply]

#: Between two messages to a browser (seconds).
_PERIOD: Final = 0.1
#: Longest message of a browser (bytes).
_LONGEST: Final = 1 << 16
#: Requests of one browser that are under way at a time; others wait.
_AT_A_TIME: Final = 4
#: Requests of all browsers that are under way at a time: learning alone takes one for minutes.
_THREADS: Final = 16
#: Between two signs of life (seconds); a browser that gives none is gone.
_HEARTBEAT: Final = 20.0

_TYPES: Final = {
    ".css": "text/css",
    ".html": "text/html",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}

_PAGE: Final = Path(__file__).parents[2] / "studio" / "page"


class Server:
    """Serves one board in a thread of its own.

    Args:
        board: What browsers show.
        ask: Does what they ask for.
        host: Address to listen on.
        port: Port; 0 for any that is free.

    Raises:
        OptionError: The address cannot be listened on, or plotly is not installed.
    """

    def __init__(self, board: Board, ask: Ask, host: str, port: int) -> None:
        self._board = board
        self._ask = ask
        self._socket = _listening(host, port)
        self.access = Access(host, self._socket.getsockname()[1])
        """Who may see and change what."""
        self._files = _files()
        self._browsers: set[_Browser] = set()
        self._loop = asyncio.new_event_loop()
        self._loop.set_default_executor(ThreadPoolExecutor(_THREADS, "request"))
        self._changed = asyncio.Event()
        self._stopped = asyncio.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="web server")
        self._thread.start()
        board.listen(self._note_change)

    @property
    def browsers(self) -> int:
        """How many show the page."""
        return len(self._browsers)

    def close(self) -> None:
        """Says goodbye to all browsers and ends."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join(timeout=5.0)

    def _note_change(self) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._changed.set)

    # --- the thread ---

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        application = web.Application(middlewares=[self._guard], client_max_size=1 << 10)
        application.add_routes(
            [
                web.get("/", self._index),
                web.get("/live", self._live),
                web.get("/{name:.+}", self._file),
            ]
        )
        runner = web.AppRunner(
            application, access_log=None, handle_signals=False, shutdown_timeout=1.0
        )
        await runner.setup()
        await web.SockSite(runner, self._socket).start()
        telling = asyncio.create_task(self._tell())
        await self._stopped.wait()
        telling.cancel()
        for browser in list(self._browsers):
            await browser.close()
        await runner.cleanup()

    async def _tell(self) -> None:
        """Tells all browsers what has changed."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            changes = self._board.take_changes()
            for browser in self._browsers:
                browser.tell(changes)
            await asyncio.sleep(_PERIOD)

    # --- requests ---

    @web.middleware
    async def _guard(
        self,
        request: web.Request,
        handler: Callable[[web.Request], Awaitable[web.StreamResponse]],
    ) -> web.StreamResponse:
        """Refuses what does not come from a page of this studio."""
        if not self.access.knows_host(request.headers.get("Host")):
            return _refused("this is not the address of the studio: open the one that it prints.")
        origin = request.headers.get("Origin")
        if origin is not None and not self._is_own(request):
            return _refused("pages of other sites may not ask for anything here.")
        try:
            response = await handler(request)
        except web.HTTPException as err:
            response = web.Response(status=err.status, text=err.reason)
        if not response.prepared:
            response.headers.update(access.HEADERS)
        return response

    def _is_own(self, request: web.Request) -> bool:
        headers = request.headers
        return self.access.knows_origin(headers.get("Origin"), headers.get("Host"))

    def _may(self, request: web.Request) -> bool:
        return self.access.has_token(request.cookies.get(access.COOKIE))

    async def _index(self, request: web.Request) -> web.StreamResponse:
        if "token" in request.query:
            if not self.access.has_token(request.query["token"]):
                return _refused("the token is wrong: open the URL that the studio printed last.")
            response: web.Response = web.Response(status=303, headers={"Location": "/"})
        elif self.access.is_local or self._may(request):
            response = self._answer("index.html")
        else:
            return _refused("the URL has no token: open the one that the studio printed.")
        response.set_cookie(
            access.COOKIE, self.access.token, httponly=True, samesite="Strict", path="/"
        )
        return response

    async def _file(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info["name"].removeprefix("page/")
        if name not in self._files:
            raise web.HTTPNotFound
        if not self._may(request):
            return _refused("open the page first, at its own address.")
        return self._answer(name)

    def _answer(self, name: str) -> web.Response:
        path = self._files[name]
        return web.Response(
            body=path.read_bytes(), content_type=_TYPES[path.suffix], charset="utf-8"
        )

    async def _live(self, request: web.Request) -> web.StreamResponse:
        if not self._is_own(request) or not self._may(request):
            return _refused("open the page first, at its own address.")
        socket = web.WebSocketResponse(heartbeat=_HEARTBEAT, max_msg_size=_LONGEST)
        await socket.prepare(request)
        browser = _Browser(socket, self._board.snapshot())
        self._browsers.add(browser)
        try:
            await browser.serve(self._ask)
        finally:
            self._browsers.discard(browser)
        return socket


class _Browser:
    """One that shows the page."""

    def __init__(self, connection: web.WebSocketResponse, snapshot: Changes) -> None:
        self._connection = connection
        self._snapshot: Changes | None = snapshot
        # What a slow one has not got yet: of each key the newest value, so that it cannot pile up.
        self._changes: Changes = {}
        self._due = asyncio.Event()
        self._due.set()
        self._free = asyncio.Semaphore(_AT_A_TIME)
        self._asking: set[asyncio.Task[None]] = set()

    def tell(self, changes: Changes) -> None:
        """Has changes sent as soon as it is ready for them."""
        for section, values in changes.items():
            self._changes.setdefault(section, {}).update(values)
        self._due.set()

    async def serve(self, ask: Ask) -> None:
        """Sends what changes, and answers, until it goes."""
        sending = asyncio.create_task(self._send_all())
        try:
            async for message in self._connection:
                if message.type is not WSMsgType.TEXT:
                    continue
                await self._free.acquire()
                task = asyncio.create_task(self._answer(ask, message.data))
                self._asking.add(task)
                task.add_done_callback(self._asking.discard)
        finally:
            sending.cancel()

    async def close(self) -> None:
        """Says goodbye."""
        await self._connection.close(code=1001, message=b"the studio has ended")

    async def _send_all(self) -> None:
        while True:
            await self._due.wait()
            self._due.clear()
            if self._snapshot is not None:
                snapshot, self._snapshot = self._snapshot, None
                await self._send({"snapshot": snapshot, "now": time.time()})
            changes, self._changes = self._changes, {}
            if changes:
                await self._send({"changes": changes})

    async def _answer(self, ask: Ask, text: str) -> None:
        try:
            try:
                request = json.loads(text)
            except (ValueError, RecursionError):
                request = None
            reply = await asyncio.to_thread(ask, request)
            await self._send(reply.as_json())
        finally:
            self._free.release()

    async def _send(self, message: Mapping[str, Any]) -> None:
        if not self._connection.closed:
            try:
                await self._connection.send_str(json.dumps(message, ensure_ascii=False))
            except ConnectionError:
                return


def _refused(why: str) -> web.Response:
    return web.Response(status=403, text=why, headers=access.HEADERS)


def _files() -> dict[str, Path]:
    """All that is ever served, by name: a request can name nothing else.

    Raises:
        OptionError: plotly is not installed.
    """
    plotly = importlib.util.find_spec("plotly")
    if plotly is None or plotly.origin is None:
        raise OptionError(
            "the studio draws its charts with plotly, which is not installed: "
            "pip install 'rebt_ros[studio]', or pip install plotly."
        )
    files = {path.name: path for path in sorted(_PAGE.iterdir()) if path.suffix in _TYPES}
    return files | {"plotly.js": Path(plotly.origin).parent / "package_data" / "plotly.min.js"}


def _listening(host: str, port: int) -> socket.socket:
    try:
        found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM)
        # Browsers that are told "localhost" try both kinds of addresses, and people type 127.0.0.1.
        family, *_, address = min(found, key=lambda info: info[0] != socket.AF_INET)
        return socket.create_server(address[:2], family=family)
    except (OSError, UnicodeError) as err:
        reason = getattr(err, "strerror", None) or str(err)
        raise OptionError(
            f"the studio cannot listen on port {port} of {host or 'all addresses'} ({reason}): "
            "stop the studio that has it, or choose another with -p port:=8971."
        ) from err
