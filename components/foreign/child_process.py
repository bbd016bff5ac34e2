"""A program that runs beside us and never outlives us, whatever ends us; its children neither."""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from weakref import finalize

# Waits until our end of its pipe closes, however we go; then it ends the program's group, and
# removes its folder.
_GUARD = """
import os, shutil, sys
sys.stdin.read()
try:
    os.killpg(int(sys.argv[1]), 9)
except OSError:
    pass
for folder in sys.argv[2:]:
    shutil.rmtree(folder, ignore_errors=True)
"""


class ChildProcess:
    """A program in a process group of its own, which is ended also when this process dies.

    Parameters
    ----------
    command : sequence of str
    folder : Path
        Where it runs.
    removes : Path, optional
        What goes with it: a folder of its own.
    **pipes
        As `subprocess.Popen` takes them.

    Attributes
    ----------
    process : subprocess.Popen
    end : callable
        Ends the program and all that it started, and waits for that; more than once does no harm.
    """

    def __init__(
        self, command: Sequence[str], folder: Path, removes: Path | None = None, **pipes: Any
    ) -> None:
        self.process = subprocess.Popen(
            command, cwd=folder, start_new_session=os.name == "posix", **pipes
        )
        leaves = [str(self.process.pid), *([] if removes is None else [str(removes)])]
        guard = None
        with suppress(OSError):
            guard = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _GUARD, *leaves], stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
        self.end = finalize(self, _kill_and_clean_up, self.process, guard, removes)


def describe_exit(code: int) -> str:
    """Return in words how a program ended, from its exit code as `subprocess` gives it."""
    if code < 0:
        return f"died of signal {-code} ({signal.Signals(-code).name})"
    return f"ended with exit code {code}"


def _kill_and_clean_up(process: Any, guard: Any, removes: Path | None) -> None:
    """Kill the program's process group, await its end, close its pipes, remove a given folder."""
    if os.name == "posix":
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()
    if guard is not None:
        guard.kill()
        guard.wait()
        guard.stdin.close()
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
    if removes is not None:
        import shutil

        shutil.rmtree(removes, ignore_errors=True)
