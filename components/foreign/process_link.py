"""A program over pipes: frames of Arrow, deadlines, its last words, and its certain end.

A frame is its length in 8 bytes, little-endian, and one Arrow IPC stream whose schema names the
table in its metadata. A call is frames and an empty one (length 0), and so is its answer.
"""

import os
import selectors
import struct
import subprocess
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from components.foreign.child_process import ChildProcess, describe_exit
from dsa_des.text.safe_text import escape_unprintable, shorten

VERSION = "1"
_HEAD = struct.Struct("<Q")
_LARGEST_FRAME = 2**31
_CHUNK = 2**20
_LAST_WORDS = 2000


class ProcessError(Exception):
    """A program ended, took too long or sent a bad message; a command then exits with code 3."""

    exit_code = 3


def frame_parts_of_batch(table: str, batch: Any, about: Mapping[str, str]) -> list[Any]:
    """Return a record batch as the two parts of a frame: its length, and an Arrow stream."""
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    schema = batch.schema.with_metadata({"table": table, **about})
    with pa.ipc.new_stream(sink, schema) as writer:
        if batch.num_rows or not len(schema):
            writer.write_batch(pa.RecordBatch.from_arrays(batch.columns, schema=schema))
    content = sink.getvalue()
    return [_HEAD.pack(len(content)), memoryview(content)]


class ProcessLink:
    """The pipes to one program, which is started by the first call.

    Parameters
    ----------
    command : list of str
        The program, as found, and its arguments.
    folder : Path
        Where it runs.
    """

    def __init__(self, command: list[str], folder: Path) -> None:
        self._command, self._folder = command, folder
        self._process: Any = None
        self._child: ChildProcess | None = None

    @property
    def runs(self) -> bool:
        """Return whether the program was started and has not ended since."""
        return self._process is not None

    def start(self) -> None:
        """Start the program in its own process group, which ends also when this process dies."""
        self._words = bytearray()
        try:
            child = ChildProcess(
                self._command, self._folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.PIPE, bufsize=0,
            )  # fmt: skip
        except OSError as error:
            raise ProcessError(f"cannot be started: {(error.strerror or '').lower()}") from None
        self._child, self._process = child, child.process
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            os.set_blocking(pipe.fileno(), False)

    def stop(self) -> None:
        """End the program, its children with it."""
        if self._child is not None:
            self._child.end()
        self._child = self._process = None

    def ask(self, parts: Iterable[Any], deadline_s: float) -> list[tuple[dict[str, str], Any]]:
        """Send frames, wait, and return the answer's frames as pairs of metadata and table.

        Raises
        ------
        ProcessError
            With its last words; the program is gone then.
        """
        try:
            return self._ask([*parts, _HEAD.pack(0)], time.monotonic() + deadline_s, deadline_s)
        except ProcessError as error:
            words = self._last_words()
            self.stop()
            raise ProcessError(f"{error}{words}") from None
        except BaseException:
            self.stop()
            raise

    def _ask(self, parts: list[Any], end_s: float, deadline_s: float) -> Any:
        process = self._process
        waiting = [memoryview(part).cast("B") for part in parts if len(part)]
        waiting.reverse()
        reader = _Frames()
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdin, selectors.EVENT_WRITE)
            selector.register(process.stdout, selectors.EVENT_READ)
            if not process.stderr.closed:
                selector.register(process.stderr, selectors.EVENT_READ)
            while not reader.done:
                left_s = end_s - time.monotonic()
                ready = selector.select(max(left_s, 0.0)) if left_s > 0 else []
                if not ready:
                    raise ProcessError(
                        f"has not answered within deadline_s = {deadline_s:g} s"
                        f"{' (half a message came)' if reader.is_partial else ''}"
                    )
                for key, _ in ready:
                    if key.fileobj is process.stdin:
                        self._write(waiting, selector)
                    elif key.fileobj is process.stderr:
                        if not self._read_stderr():
                            selector.unregister(process.stderr)
                    else:
                        self._read(reader)
        if waiting:
            raise ProcessError("answered before it had read all that it was sent")
        return reader.tables()

    def _write(self, waiting: list[memoryview], selector: Any) -> None:
        try:
            while waiting:
                count = os.write(self._process.stdin.fileno(), waiting[-1][:_CHUNK])
                rest = waiting.pop()[count:]
                if len(rest):
                    waiting.append(rest)
        except BlockingIOError:
            return
        except BrokenPipeError:
            waiting.clear()  # what it says last, and how it ended, comes by the other pipe
        selector.unregister(self._process.stdin)

    def _read(self, reader: "_Frames") -> None:
        try:
            content = os.read(self._process.stdout.fileno(), _CHUNK)
        except BlockingIOError:
            return
        if not content:
            raise ProcessError(
                self._describe_end() + (" in the middle of a message" if reader.is_partial else "")
            )
        reader.add(content)

    def _read_stderr(self) -> bool:
        """Read what has arrived on the program's standard error; return False once it is closed."""
        with suppress(BlockingIOError):
            said = os.read(self._process.stderr.fileno(), _CHUNK)
            self._words += said
            del self._words[:-_LAST_WORDS]
            return bool(said)
        return True

    def _describe_end(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            return describe_exit(self._process.wait(1.0))
        return "closed its output"

    def _last_words(self) -> str:
        with suppress(OSError, ValueError):
            for _ in range(64):  # what it has written so far is in the pipe
                before = len(self._words)
                if not self._read_stderr() or len(self._words) == before:
                    break
        said = [line.strip() for line in self._words.decode(errors="replace").splitlines()]
        said = [line for line in said if line]
        if not said:
            return "; it said nothing on standard error"
        return "; its last words: " + shorten(escape_unprintable(" | ".join(said[-5:])), 600)


class _Frames:
    """Collects the frames of an answer as their bytes arrive."""

    def __init__(self) -> None:
        self._frames: list[bytearray] = []
        self._head = bytearray()
        self._body: bytearray | None = None
        self._filled = 0
        self.done = False

    @property
    def is_partial(self) -> bool:
        """Return whether part of a frame has come, but not all."""
        return bool(self._head or self._frames or self._body is not None)

    def add(self, content: bytes) -> None:
        """Append received bytes."""
        view = memoryview(content)
        while len(view):
            if self.done:
                raise ProcessError(f"sent {len(view)} bytes that nobody asked for")
            if self._body is None:
                wanted = _HEAD.size - len(self._head)
                self._head += view[:wanted]
                view = view[wanted:]
                if len(self._head) < _HEAD.size:
                    return
                (length,) = _HEAD.unpack(self._head)
                if length > _LARGEST_FRAME:
                    raise ProcessError(f"sent what is no message: {bytes(self._head)!r} ...")
                self._head.clear()
                if not length:
                    self.done = True
                    continue
                self._body, self._filled = bytearray(length), 0
            count = min(len(view), len(self._body) - self._filled)
            self._body[self._filled : self._filled + count] = view[:count]
            self._filled += count
            view = view[count:]
            if self._filled == len(self._body):
                self._frames.append(self._body)
                self._body = None

    def tables(self) -> list[tuple[dict[str, str], Any]]:
        """Return metadata and table of each frame."""
        import pyarrow as pa

        found = []
        for content in self._frames:
            try:
                table = pa.ipc.open_stream(pa.py_buffer(content)).read_all()
                table.validate(full=True)
            except (pa.ArrowException, OSError) as error:
                text = str(error).splitlines()[0] if str(error) else type(error).__name__
                raise ProcessError(f"sent what is no Arrow stream: {text}") from None
            about = table.schema.metadata or {}
            found.append(({k.decode(): v.decode() for k, v in about.items()}, table))
        return found
