"""How many connections the display holds at a time, whoever opens them."""

import asyncio
import errno
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection

#: Browsers open a few each; all others are a flood. Far below any limit of open files.
MOST_CONNECTIONS = 64


class ConnectionLimit:
    """Drops connections beyond a limit at once, and says so in one line.

    Parameters
    ----------
    say : callable
        Takes the line.
    most : int
    """

    def __init__(self, say: Callable[[str], None], most: int = MOST_CONNECTIONS) -> None:
        self._say, self._most = say, most
        self._open = 0
        self._said = self._starved = False

    def connection(self, *given: Any, **options: Any) -> ServerConnection:
        """Return what `websockets.asyncio.server.serve` makes of a new connection."""
        return _Limited(self, *given, **options)

    def take(self) -> bool:
        """Count a connection that opens; return False where there is no room for it."""
        if self._open >= self._most:
            self._tell(f"more than {self._most} connections")
            return False
        self._open += 1
        return True

    def give_back(self) -> None:
        """Count a connection that was taken and is gone."""
        self._open -= 1

    def on_error(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle what the loop could not: connections may come faster than they can be dropped."""
        error = context.get("exception")
        if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
            self._starved = True
            self._tell("more connections than files may be open")
        elif self._starved and isinstance(error, ValueError) and "descriptor: -1" in str(error):
            # A second later the loop listens again, to a socket that the end has closed meanwhile.
            pass
        else:
            loop.default_exception_handler(context)

    def _tell(self, what: str) -> None:
        if not self._said:
            self._said = True
            self._say(f"the display was sent {what}: some are dropped, the session goes on")


class _Limited(ServerConnection):
    """A connection that is closed before anything is read where there is no room for it."""

    def __init__(self, limit: ConnectionLimit, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self._limit, self._taken = limit, False

    def connection_made(self, transport: Any) -> None:
        """Take it, or drop it."""
        self._taken = self._limit.take()
        if self._taken:
            super().connection_made(transport)
        else:
            transport.abort()

    def connection_lost(self, error: Exception | None) -> None:
        """Give its place back."""
        if self._taken:
            self._taken = False
            self._limit.give_back()
            super().connection_lost(error)
