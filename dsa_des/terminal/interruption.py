"""Ctrl-C and SIGTERM in a command: it clears up, says so in one line, and ends.

The exit code is 128 and the number of the signal, as a shell has it: 130 for ctrl-C, 143 for
SIGTERM.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_OFFSET = 128


class Terminated(KeyboardInterrupt):
    """Raised when SIGTERM or SIGHUP arrives; what cleans up after ctrl-C then does so as well."""


@contextmanager
def exit_plainly_on_signal() -> Iterator[None]:
    """Turn a signal inside the block into one line of text and the signal's exit code.

    What a signal interrupts may raise anything (an import that is broken off, a thread pool that
    is closed), so after a signal every exception is its consequence. Handlers that other code
    has installed, and signals that are ignored, stay as they are.
    """
    received: list[int] = []

    def handle(number: int, frame: FrameType | None) -> None:
        received.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else Terminated(number)

    usual = (signal.SIG_DFL, signal.default_int_handler)
    with _install_handler(handle, lambda handler: handler in usual):
        try:
            yield
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                received += error.args if isinstance(error, Terminated) else [signal.SIGINT]
            if not received:
                raise
            code = _OFFSET + received[0]
            said = isinstance(error, SystemExit) and error.code in [_OFFSET + n for n in _SIGNALS]
            if not said:
                _print_signal_line("interrupted" if received[0] == signal.SIGINT else "terminated")
            raise SystemExit(code) from None
        if received:  # and something swallowed the exception
            raise SystemExit(_OFFSET + received[0])


def _print_signal_line(what: str) -> None:
    with suppress(OSError, ValueError):  # its reader is gone
        from dsa_des.terminal.terminal import say

        if sys.stderr.isatty():  # it has just shown ^C
            say(err=True)
        say(f"stopped: {what}", err=True)


@contextmanager
def defer_signals() -> Iterator[None]:
    """Delay signals that ask the program to end until the block is done.

    For the few steps that must not be done by halves: giving results their name, clearing up.
    """
    arrived: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        arrived.append(number)

    try:
        with _install_handler(note, lambda handler: handler is not signal.SIG_IGN):
            yield
    finally:
        if arrived:
            signal.raise_signal(arrived[0])


@contextmanager
def _install_handler(handler: Any, replaces: Any) -> Iterator[None]:
    """Inside the block, handle ending signals by `handler` where `replaces` is true of the old."""
    before: dict[int, Any] = {}
    try:
        # Python hands signals to the main thread only, and lets no other one set handlers.
        with suppress(ValueError):
            for number in _SIGNALS:
                there = signal.getsignal(number)
                if there is not None and replaces(there):
                    signal.signal(number, handler)
                    before[number] = there
        yield
    finally:
        for number, there in before.items():
            signal.signal(number, there)
