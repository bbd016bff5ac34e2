"""One message and an exit code for every error that a user can cause."""

import functools
import sys
from collections.abc import Callable
from typing import Any

from dsa_des.errors import BlockFailure, SceneError, UsageError
from dsa_des.strangers import raised_in, told
from dsa_des.terminal import say, say_lines

# Who may end a command; whoever else does is a stranger's code in a place not foreseen.
_OURS = ("dsa_des", "components", "click")


def plain_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the errors a user can cause into one message without a traceback."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (SceneError, UsageError) as error:
            say_lines(f"error: {error}", err=True)
            sys.exit(2)
        except BlockFailure as error:
            say_lines(f"error: {error}", err=True)
            sys.exit(error.exit_code)
        except SystemExit as error:
            module = raised_in(error.__traceback__)
            if module.partition(".")[0] in _OURS:
                raise
            say(f"error: the module {module!r} left with {told(error)}", err=True)
            sys.exit(2)
        except BrokenPipeError:  # the reader of our output went away
            sys.stderr.close()
            sys.exit(1)

    return guarded
