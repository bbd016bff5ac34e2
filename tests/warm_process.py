"""Processes of tests that need not load the libraries: forked from one that has loaded them.

`run` and `start` stand for ``subprocess.run([sys.executable, ...])`` and ``Popen``: a process with
arguments, environment, working directory, outputs, signals and an end of its own, for a tenth of
the processor time. They are not for tests of what happens while Python starts: which modules are
imported, what stands in for them, and the variables that are read by then (`_AT_START`).
"""

import array
import atexit
import contextlib
import functools
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

_SERVER = Path(__file__).with_name("warm_server.py")
_AT_START = ("PYTHONHASHSEED", "PYTHONIOENCODING", "PYTHONUTF8", "PYTHONWARNINGS", "PYTHONOPTIMIZE",
             "PYTHONPYCACHEPREFIX", "MPLBACKEND", "LANG", "LC_ALL")  # fmt: skip
Where = int | IO[Any] | None


class Process:
    """A process that runs; what it writes into pipes is kept as text.

    Parameters
    ----------
    pid : int
    told : socket
        Says its exit code when it has ended.
    outputs : sequence of _Output
    """

    def __init__(self, pid: int, told: socket.socket, outputs: Sequence["_Output"]) -> None:
        self.pid, self.returncode = pid, None
        self._told, self._outputs = told, outputs

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        return self._ended(0.0)

    def wait(self, timeout: float = 300.0) -> int:
        """Return the exit code when it has ended.

        Raises
        ------
        subprocess.TimeoutExpired
        """
        code = self._ended(timeout)
        if code is None:
            raise subprocess.TimeoutExpired("a process of the tests", timeout)
        return code

    def communicate(self, timeout: float = 300.0) -> tuple[str | None, str | None]:
        """Return what it wrote when it has ended."""
        self.wait(timeout)
        stdout, stderr = (output.text() for output in self._outputs)
        return stdout, stderr

    def send_signal(self, number: int) -> None:
        """Send a signal; nothing if it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def _ended(self, timeout: float) -> int | None:
        if self.returncode is None and select.select([self._told], [], [], timeout)[0]:
            self.returncode = int(_line(self._told))
            self._told.close()
        return self.returncode


def start(
    words: Sequence[object],
    *,
    cwd: str | os.PathLike[str] | None = None,
    env: Mapping[str, str] | None = None,
    stdout: Where = subprocess.PIPE,
    stderr: Where = subprocess.PIPE,
) -> Process:
    """Start Python with these words behind ``python``.

    Parameters
    ----------
    words : sequence
        ``-m MODULE``, ``-c CODE`` or the path of a script, and its arguments; ``-B`` and ``-P`` may
        stand before.
    cwd, env, stdout, stderr
        As for `subprocess.Popen`.

    Raises
    ------
    ValueError
        If the environment differs in what Python reads while it starts.
    """
    wanted = dict(os.environ if env is None else env)
    for name in _AT_START:
        if wanted.get(name) != os.environ.get(name):
            raise ValueError(f"{name} is read while Python starts: use subprocess")
    request = {
        "words": [str(word) for word in words],
        "cwd": os.path.abspath(os.getcwd() if cwd is None else cwd),
        "env": wanted,
    }
    outputs = [_Output(stdout), _Output(stderr)]
    told = _server().ask(request, [output.end for output in outputs])
    for output in outputs:
        output.begin()
    return Process(int(_line(told)), told, outputs)


def run(
    words: Sequence[object], *, timeout: float = 300.0, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run Python with these words (see `start`) and return what came of it.

    Raises
    ------
    subprocess.TimeoutExpired
    """
    process = start(words, **options)
    try:
        stdout, stderr = process.communicate(timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        raise
    assert process.returncode is not None
    return subprocess.CompletedProcess(words, process.returncode, stdout, stderr)


class _Output:
    """Where an output of the process goes, and what it wrote if that is a pipe."""

    def __init__(self, where: Where) -> None:
        self._reader: int | None = None
        self._own = True
        if where == subprocess.PIPE:
            self._reader, self.end = os.pipe()
        elif where == subprocess.DEVNULL:
            self.end = os.open(os.devnull, os.O_WRONLY)
        else:
            assert where is not None
            self._own = False
            self.end = where if isinstance(where, int) else where.fileno()
        self._content = b""

    def begin(self) -> None:
        """Let go of the process's end, and read what comes out of the other."""
        if self._own:
            os.close(self.end)
        if self._reader is not None:
            self._thread = threading.Thread(target=self._read, daemon=True)
            self._thread.start()

    def _read(self) -> None:
        assert self._reader is not None
        with open(self._reader, "rb") as stream:
            self._content = stream.read()

    def text(self) -> str | None:
        """Return what was written, once nobody writes any more."""
        if self._reader is None:
            return None
        self._thread.join()
        return self._content.decode()


class _Server:
    """The process that has loaded the libraries."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(_SERVER), str(theirs.fileno())],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            )  # fmt: skip
        atexit.register(self.end)

    def ask(self, request: Mapping[str, Any], outputs: Sequence[int]) -> socket.socket:
        """Send a request; return where the process's number and then its end will be told."""
        ours, theirs = socket.socketpair()
        reader, writer = os.pipe()
        # The request may be longer than a packet: it goes through a pipe.
        handles = array.array("i", [*outputs, theirs.fileno(), reader])
        self._socket.sendmsg([b"."], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, handles)])
        theirs.close()
        os.close(reader)
        with open(writer, "wb") as stream:
            stream.write(json.dumps(request).encode())
        return ours

    def end(self) -> None:
        """End the process, and wait for it."""
        self._socket.close()
        self._process.wait()


@functools.cache
def _server() -> _Server:
    return _Server()


def _line(source: socket.socket) -> bytes:
    """Read up to the end of a line."""
    found = b""
    while not found.endswith(b"\n"):
        part = source.recv(1)
        assert part, "the process that forks others has ended"
        found += part
    return found
