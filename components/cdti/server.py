"""The server of the display: its page, and a socket for each browser; it lives in its own thread.

The simulation hands over pictures and never waits for a browser: each gets the newest picture when
it has drawn the one before.
"""

import asyncio
import errno
import json
import logging
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any, Protocol, cast
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from components.cdti.page import (
    LARGEST_BYTES,
    OPERATOR,
    Admission,
    Drawn,
    PageMessage,
    page_headers,
    page_html_and_script_digest,
    read_message,
)
from dsa_des.errors import UsageError
from dsa_des.terminal.terminal import say

SOCKET = "/socket"
#: Browsers at a time.
MOST_PAGES = 8
#: Pictures that a page may have without having drawn them.
_AHEAD = 2
_START_S, _END_S = 10.0, 3.0
#: Browsers open a few each; all others are a flood. Far below any limit of open files.
MOST_CONNECTIONS = 64


class Page:
    """One browser's connection."""

    def __init__(self, connection: ServerConnection, role: str) -> None:
        self.connection, self.role = connection, role
        self.chosen = -1
        self._sent, self._drawn = 0, 0
        self._free = asyncio.Event()
        self._free.set()

    def note_drawn(self, frame: int) -> None:
        """Record that a page has drawn this frame, and let it have another if not far behind."""
        self._drawn = max(self._drawn, min(frame, self._sent))
        if self._sent - self._drawn < _AHEAD:
            self._free.set()

    async def wait_until_ready(self) -> None:
        """Wait until the page can take another picture."""
        await self._free.wait()

    async def send_frame(self, content: dict[str, Any]) -> None:
        """Send a message with the newest content of the display."""
        self._sent += 1
        if self._sent - self._drawn >= _AHEAD:
            self._free.clear()
        await self.connection.send(_to_json({**content, "frame": self._sent}))

    async def send(self, content: dict[str, Any]) -> None:
        """Send a message other than a picture; nothing happens if the connection is gone."""
        with suppress(ConnectionClosed):
            await self.connection.send(_to_json(content))


class PageControl(Protocol):
    """Callbacks of `DisplayServer` to the session: messages to send, and page events."""

    def welcome(self, role: str) -> dict[str, Any]:
        """Return the first message to a new page."""

    def frame(self, chosen: int) -> dict[str, Any] | None:
        """Return a page's newest content for its chosen contact; None before the first."""

    async def on_message(self, page: Page, message: PageMessage) -> None:
        """Process a message from a page."""

    def store_operator_count(self, count: int) -> None:
        """Store how many connected pages may decide."""


class DisplayServer:
    """Serves the page at one address; port 0 takes a free one."""

    def __init__(self, host: str, port: int, admission: Admission, control: PageControl) -> None:
        self._host, self._port = host, port
        self._admission, self._control = admission, control
        self.pages: list[Page] = []
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run_server_loop, name="display", daemon=True)
        self._up, self._failed = threading.Event(), ""
        self._new: asyncio.Condition
        self._number = 0
        self._stop: asyncio.Event

    # -- other threads -----------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread that serves the page; UsageError if the address cannot be used."""
        self._thread.start()
        if not self._up.wait(_START_S) or self._failed:
            raise UsageError(f"cannot serve at {self.host_and_port}: {self._failed or 'no answer'}")

    @property
    def host_and_port(self) -> str:
        """Host and port as text, joined as in the page's address."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"{host}:{self._port}"

    def page_url(self, token: str) -> str:
        """Return the URL of the page with this token."""
        return f"http://{self.host_and_port}/?token={token}"

    def announce_picture(self) -> None:
        """Wake every page, so that each sends the new picture when its client is ready."""
        self._call_in_server_loop(self._wake_pages)

    def broadcast(self, content: dict[str, Any]) -> None:
        """Send a message to every page."""
        self._call_in_server_loop(lambda: self._send_to_all(content))

    def close(self, last: dict[str, Any]) -> None:
        """Send a last message to every page and stop the server."""
        if not self._thread.is_alive():
            return

        async def leave() -> None:
            await self._send_to_all(last)
            self._stop.set()

        self._call_in_server_loop(leave)
        self._thread.join(_END_S)

    def _call_in_server_loop(self, call: Callable[[], Awaitable[None]]) -> None:
        async def run() -> None:
            await call()

        if not self.loop.is_closed():
            asyncio.run_coroutine_threadsafe(run(), self.loop)

    # -- its own thread ----------------------------------------------------------------------------

    def _run_server_loop(self) -> None:
        asyncio.set_event_loop(self.loop)
        try:
            self.loop.run_until_complete(self._serve_until_stopped())
        finally:
            self.loop.close()
            self._up.set()

    async def _serve_until_stopped(self) -> None:
        self._new, self._stop = asyncio.Condition(), asyncio.Event()
        quiet = logging.getLogger(f"{__name__}.connections")
        quiet.setLevel(logging.CRITICAL)  # what anybody sends is no matter of the terminal's
        limit = ConnectionLimit(partial(say, err=True))
        self.loop.set_exception_handler(limit.on_error)
        try:
            server = await serve(
                self._serve_page,
                self._host,
                self._port,
                process_request=self._answer_request,
                max_size=LARGEST_BYTES,
                compression=None,
                server_header=None,
                logger=quiet,
                create_connection=cast(type[ServerConnection], limit.make_connection),
                ping_interval=10,
                ping_timeout=20,
                close_timeout=1,
            )
        except OSError as error:
            self._failed = (error.strerror or str(error)).lower()
            return
        self._port = server.sockets[0].getsockname()[1]
        self._up.set()
        await self._stop.wait()
        await _wait_closed(server)

    def _answer_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the response to an HTTP request: page or error; None lets the socket be opened."""
        parts = urlsplit(request.path)
        hosts = request.headers.get_all("Host")
        if hosts != [self.host_and_port]:  # another name for this address: a page of somewhere else
            return connection.respond(403, "not this host\n")
        if not self._admission.is_issued_token(_token_of_request(request)):
            return connection.respond(
                403, "the address lacks its token, or it is not of this run\n"
            )
        if parts.path == "/":
            text, _ = page_html_and_script_digest()
            body = text.encode("utf-8")
            sent = Headers(
                {**page_headers(f"ws://{self.host_and_port}"), "Content-Length": str(len(body))}
            )
            sent["Connection"] = "close"
            return Response(200, "OK", sent, body)
        if parts.path != SOCKET:
            return connection.respond(404, "there is nothing here\n")
        # Only our own page may open the socket, wherever it is opened from.
        if request.headers.get_all("Origin") != [f"http://{self.host_and_port}"]:
            return connection.respond(403, "not this origin\n")
        if len(self.pages) >= MOST_PAGES:
            return connection.respond(503, "too many browsers\n")
        return None

    async def _serve_page(self, connection: ServerConnection) -> None:
        """Serve one page over its socket until it closes: welcome, pictures, and its messages."""
        assert connection.request is not None
        query = parse_qs(urlsplit(connection.request.path).query)
        deciding = [page for page in self.pages if page.role == OPERATOR]
        # A browser that had the key is known by it again, but takes nobody's place.
        names = ("key",) if deciding else ("key", "before")
        known = next((query[name][0] for name in names if query.get(name)), "")
        role, key = self._admission.role_and_key(_token_of_request(connection.request), known)
        if role == OPERATOR:
            for other in deciding:
                other.role = "replaced"
                await other.connection.close(4001, "opened elsewhere")
        page = Page(connection, role)
        self.pages.append(page)
        self._store_operator_count_in_control()
        feeding = None
        try:
            await page.send(
                {"type": "welcome", "role": role, "key": key, **self._control.welcome(role)}
            )
            feeding = asyncio.create_task(self._send_pictures(page))
            async for text in connection:
                await self._handle_text(page, text)
        except ConnectionClosed:
            pass
        finally:
            if feeding is not None:
                feeding.cancel()
            self.pages.remove(page)
            self._store_operator_count_in_control()

    def _store_operator_count_in_control(self) -> None:
        self._control.store_operator_count(sum(page.role == OPERATOR for page in self.pages))

    async def _handle_text(self, page: Page, text: str | bytes) -> None:
        try:
            message = read_message(text)
        except ValueError as error:
            await page.send({"type": "refused", "id": None, "why": f"this {error}"})
            return
        if isinstance(message, Drawn):
            page.note_drawn(message.frame)
        else:
            await self._control.on_message(page, message)

    async def _send_pictures(self, page: Page) -> None:
        """Send a page the newest picture whenever it can take one."""
        seen = 0
        with suppress(ConnectionClosed):
            while True:
                await page.wait_until_ready()
                async with self._new:
                    while self._number == seen:
                        await self._new.wait()
                seen = self._number
                content = self._control.frame(page.chosen)
                if content is not None:
                    await page.send_frame(content)

    async def _wake_pages(self) -> None:
        async with self._new:
            self._number += 1
            self._new.notify_all()

    async def _send_to_all(self, content: dict[str, Any]) -> None:
        waits = [asyncio.create_task(page.send(content)) for page in self.pages]
        if waits:
            await asyncio.wait(waits, timeout=1.0)


class ConnectionLimit:
    """Drops connections beyond a limit at once, and prints one warning about it."""

    def __init__(self, say: Callable[[str], None], most: int = MOST_CONNECTIONS) -> None:
        self._say, self._most = say, most
        self._open = 0
        self._said = self._starved = False

    def make_connection(self, *given: Any, **options: Any) -> ServerConnection:
        """Return a connection for `websockets.asyncio.server.serve`, dropped beyond the limit."""
        return _Limited(self, *given, **options)

    def count_if_room(self) -> bool:
        """Count a connection that opens; return False where there is no room for it."""
        if self._open >= self._most:
            self._warn_once(f"more than {self._most} connections")
            return False
        self._open += 1
        return True

    def count_closed(self) -> None:
        """Count an accepted connection that has ended."""
        self._open -= 1

    def on_error(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle errors of the event loop; report too many open files once, not as errors."""
        error = context.get("exception")
        if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
            self._starved = True
            self._warn_once("more connections than files may be open")
        elif self._starved and isinstance(error, ValueError) and "descriptor: -1" in str(error):
            # A second later the loop listens again, to a socket that the end has closed meanwhile.
            pass
        else:
            loop.default_exception_handler(context)

    def _warn_once(self, what: str) -> None:
        if not self._said:
            self._said = True
            self._say(f"the display was sent {what}: some are dropped, the session goes on")


class _Limited(ServerConnection):
    """A connection that is closed before anything is read where there is no room for it."""

    def __init__(self, limit: ConnectionLimit, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self._limit, self._taken = limit, False

    def connection_made(self, transport: Any) -> None:
        """Accept a connection, or drop it where too many are open."""
        self._taken = self._limit.count_if_room()
        if self._taken:
            super().connection_made(transport)
        else:
            transport.abort()

    def connection_lost(self, error: Exception | None) -> None:
        """Release the place of a closed connection."""
        if self._taken:
            self._taken = False
            self._limit.count_closed()
            super().connection_lost(error)


def _token_of_request(request: Request) -> str:
    return parse_qs(urlsplit(request.path).query).get("token", [""])[0]


def _to_json(content: dict[str, Any]) -> str:
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


async def _wait_closed(server: Server) -> None:
    server.close(code=1001, reason="the run has ended")
    with suppress(TimeoutError):
        await asyncio.wait_for(server.wait_closed(), 2.0)
