"""One message and an exit code for every error that a user can cause."""

import functools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from dsa_des.block.foreign_calls import error_text, raised_in
from dsa_des.errors import BlockFailure, OutputError, SceneError, UsageError
from dsa_des.terminal.terminal import say, say_lines

# What may end a command; all else is a stranger's code in a place not foreseen.
_OURS = ("dsa_des", "components", "click", "rich")


def plain_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the errors a user can cause into one message without a traceback."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (SceneError, UsageError) as error:
            say_lines(f"error: {error}", err=True)
            sys.exit(2)
        except (BlockFailure, OutputError) as error:
            say_lines(f"error: {error}", err=True)
            sys.exit(getattr(error, "exit_code", 1))
        except SystemExit as error:
            module = raised_in(error.__traceback__)
            if module.partition(".")[0] in _OURS:
                raise
            say(f"error: the module {module!r} left with {error_text(error)}", err=True)
            sys.exit(2)
        except BrokenPipeError:  # the reader of our output went away
            sys.stderr.close()
            sys.exit(1)

    return guarded


@contextmanager
def plain_output() -> Iterator[None]:
    """Say in one line that a file or our own output cannot be written, and end with exit code 1."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()  # now, where it can be said, and not when Python ends
    except OSError as error:
        # What is left in the buffer is written when Python ends, and must not fail again.
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)
        if not isinstance(error, BrokenPipeError):
            what = error.filename or "the output cannot be written"
            with suppress(OSError, ValueError):
                say(f"error: {what}: {error.strerror or error}", err=True)
        sys.exit(1)
