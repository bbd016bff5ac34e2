"""Code that a scene or study names and this package did not write: what it raises is an error.

A module or class of another author may do anything, also call ``sys.exit``. Nothing of that may end
a command without a word. ``os._exit`` and crashes of the interpreter cannot be caught.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

from dsa_des.terminal.interruption import Terminated


def is_stop_request(error: BaseException) -> bool:
    """Return whether an exception means to stop the program, not an error in foreign code.

    Ctrl-C, and whatever this package raises itself to leave (in a handler of a signal, say).
    """
    if isinstance(error, Exception):
        return False
    if isinstance(error, KeyboardInterrupt | GeneratorExit):
        return True
    return module_of_error(error.__traceback__).startswith("dsa_des.")


def module_of_error(trace: TracebackType | None) -> str:
    """Return the name of the module in which an exception was raised."""
    name = ""
    while trace is not None:
        name = str(trace.tb_frame.f_globals.get("__name__", ""))
        trace = trace.tb_next
    return name


#: What a block raises, before anything runs, because of what its table says: nothing it can be
#: made of, or nothing that can be computed or held in memory.
REFUSALS = (ValueError, OSError, ArithmeticError, MemoryError)


def describe_error(error: BaseException) -> str:
    """Return the text of an exception; for arithmetic and memory errors with an explanation."""
    if isinstance(error, ArithmeticError):
        return f"its numbers are too large or too small to be computed with ({error})"
    if isinstance(error, MemoryError):
        return f"needs more memory than there is ({error})" if str(error) else "needs more memory"
    return str(error)


#: The exit code of what another program's failure ends.
_A_FOREIGN_PART = 3


def error_text_with_line(error: BaseException, cls: type) -> str:
    """Return an exception's type, text and innermost line in the class's own package.

    One that ends a command with 3 says all itself: a program or an FMU has failed, not the class.
    """
    if getattr(error, "exit_code", 1) == _A_FOREIGN_PART:
        return str(error) or error_text_with_type(error)
    package = cls.__module__.partition(".")[0]
    trace, place = error.__traceback__, None
    while trace is not None:
        frame = trace.tb_frame
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] == package or place is None:
            code = frame.f_code
            place = f"{code.co_filename}, line {trace.tb_lineno}, in {code.co_name}"
        trace = trace.tb_next
    return error_text_with_type(error) + ("" if place is None else f" ({place})")


def error_text_with_type(error: BaseException) -> str:
    """Return an exception's type and text, such as ``SystemExit: 0``."""
    try:
        text = str(error)
    except Exception:
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


class ForeignFailure(Exception):
    """A stranger's code raised something; the message says what, `__cause__` is that."""


@contextmanager
def wrap_foreign_errors(*expected: type[Exception]) -> Iterator[None]:
    """Turn what is raised inside into `ForeignFailure`; `expected` and stop requests pass.

    The exception itself is its ``__cause__``. Those `expected` pass.
    """
    with _watch_interrupts() as interrupted:
        try:
            yield
        except BaseException as error:
            if isinstance(error, (ForeignFailure, Terminated, *expected)):
                raise
            pressed = isinstance(error, KeyboardInterrupt) and interrupted()
            if pressed or isinstance(error, GeneratorExit):
                raise
            if not isinstance(error, KeyboardInterrupt) and is_stop_request(error):
                raise
            raise ForeignFailure(error_text_with_type(error)) from error


@contextmanager
def _watch_interrupts() -> Iterator[Any]:
    """Yield a function that returns whether ctrl-C was pressed since the context began.

    A stranger may raise KeyboardInterrupt; only the signal tells it from the user's.
    """
    pressed: list[int] = []
    handler = signal.getsignal(signal.SIGINT)
    in_main = threading.current_thread() is threading.main_thread()
    if not (in_main and callable(handler)):
        yield lambda: False
        return

    def noted(number: int, frame: FrameType | None) -> Any:
        pressed.append(number)
        return handler(number, frame)

    signal.signal(signal.SIGINT, noted)
    try:
        yield lambda: bool(pressed)
    finally:
        # A module may have put a handler of its own there.
        if signal.getsignal(signal.SIGINT) is noted:
            signal.signal(signal.SIGINT, handler)
