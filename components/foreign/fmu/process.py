"""Our side of the process in which an FMU runs: starts it, watches it, ends it."""

import os
import pickle
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from components.foreign.child_process import ChildProcess, describe_exit
from dsa_des.text.safe_text import escape_unprintable, shorten

_ROOT = Path(__file__).parents[3]
# Ours is looked for last: what runs the FMU finds it where it is not installed, too.
_WORKER = """
import sys
sys.path.append(sys.argv[1])
from components.foreign.fmu.running.worker import answer_requests_on_stdin
answer_requests_on_stdin(sys.argv[2])
"""
_LOOK_S = 0.05


class FmuError(Exception):
    """An FMU failed, crashed or did not answer in time."""

    exit_code = 3


class FmuProcess:
    """One process for all instances of one FMU file.

    Parameters
    ----------
    path : Path
        The FMU.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        folder = Path(tempfile.mkdtemp(prefix="dsa_des_fmu_"))
        try:
            _extract(path, folder / "fmu")
            np.zeros(1, dtype=np.int64).tofile(folder / "beat")
            # Appended to, so that it can be cut off while it is written.
            with open(folder / "words", "ab") as words:
                child = ChildProcess(
                    [sys.executable, "-P", "-c", _WORKER, str(_ROOT), str(folder)], folder, folder,
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words,
                )  # fmt: skip
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self._folder, self._child, self._process = folder, child, child.process
        self._beat = np.memmap(folder / "beat", dtype=np.int64, mode="r", shape=(1,))
        self._count = 0
        self.close = child.end

    def create_instance(self, spec: dict[str, Any], deadline_s: float) -> int:
        """Create an instance of the FMU in the process and return its number."""
        self._count += 1
        self.ask({"do": "open", "instance": self._count, "spec": spec}, max(deadline_s, 10.0))
        return self._count

    def ask(self, request: dict[str, Any], deadline_s: float) -> dict[str, Any]:
        """Send a request and return the answer.

        Raises
        ------
        FmuError
            If the FMU refuses, its process ends, or no communication point is done within the
            deadline. The process is gone then.
        """
        content = pickle.dumps(request, protocol=pickle.HIGHEST_PROTOCOL)
        watch = _Watch(self._process, self._beat, deadline_s)
        process: Any = self._process
        try:
            watch.start()
            process.stdin.write(struct.pack("<Q", len(content)) + content)
            process.stdin.flush()
            head = process.stdout.read(8)
            size = struct.unpack("<Q", head)[0] if len(head) == 8 else 0
            content = process.stdout.read(size)
        except (OSError, ValueError):  # it is gone
            head = b""
        except BaseException:
            self.close()
            raise
        finally:
            watch.stop()
        if len(head) < 8 or len(content) < size:
            raise self._make_end_error(watch, deadline_s)
        answer: dict[str, Any] = pickle.loads(content)
        if "failed" in answer:
            words = self._last_words()
            self.close()
            at = "" if answer["at"] is None else f" at {answer['at']:g} s"
            error = FmuError(f"{self.path.name}{at}: {escape_unprintable(answer['failed'])}{words}")
            if answer["opening"]:  # it says itself that it cannot be used
                error.exit_code = 2
            raise error
        return answer

    def _make_end_error(self, watch: "_Watch", deadline_s: float) -> FmuError:
        self._process.kill()
        code = self._process.wait()
        words = self._last_words()
        self.close()
        if watch.late:
            why = f"did not answer within {deadline_s:g} s (deadline_s)"
        else:
            why = f"its process {describe_exit(code)}"
        return FmuError(f"{self.path.name}: {why}{words}")

    def _last_words(self) -> str:
        try:
            text = (self._folder / "words").read_text(errors="replace")[-2000:]
        except OSError:
            return ""
        lines = [escape_unprintable(line) for line in text.splitlines() if line.strip()]
        return f"; it printed: {shorten(' | '.join(lines[-3:]), 300)}" if lines else ""


class _Watch:
    """Kills an FMU's process that reaches no communication point for longer than its deadline."""

    _thread: threading.Thread | None = None
    _all: "set[_Watch]" = set()

    def __init__(self, process: Any, beat: Any, deadline_s: float) -> None:
        self._process, self._beat, self._deadline_s = process, beat, deadline_s
        self.late = False

    def start(self) -> None:
        self._seen, self._since = int(self._beat[0]), time.monotonic()
        cls = type(self)
        cls._all.add(self)
        if cls._thread is None or not cls._thread.is_alive():
            cls._thread = threading.Thread(target=cls._watch, name="fmu watch", daemon=True)
            cls._thread.start()

    def stop(self) -> None:
        type(self)._all.discard(self)

    @classmethod
    def _watch(cls) -> None:
        while True:
            time.sleep(_LOOK_S)
            for watch in list(cls._all):
                watch.kill_if_late()

    def kill_if_late(self) -> None:
        """Kill the process if it has reached no communication point within its deadline."""
        beat, now = int(self._beat[0]), time.monotonic()
        if beat != self._seen:
            self._seen, self._since = beat, now
        elif now - self._since > self._deadline_s:
            self.late = True
            self._process.kill()


def _extract(path: Path, folder: Path) -> None:
    """Unpack an FMU, nothing of it outside the folder."""
    with zipfile.ZipFile(path) as archive:
        root = folder.resolve()
        for name in archive.namelist():
            if "\\" in name or not (root / name).resolve().is_relative_to(root):
                raise FmuError(f"{path.name} holds the path {escape_unprintable(name)!r}")
        archive.extractall(folder)


_RUNNING: "WeakValueDictionary[tuple[str, int, int], FmuProcess]" = WeakValueDictionary()


def process_for(path: Path, *, alone: bool) -> FmuProcess:
    """Return the process for an FMU's instances: a shared one, or a new one if ``alone``."""
    state = path.stat()
    key = str(path), state.st_mtime_ns, os.getpid()
    found = None if alone else _RUNNING.get(key)
    if found is None or not found.close.alive:
        found = FmuProcess(path)
        if not alone:
            _RUNNING[key] = found
    return found
