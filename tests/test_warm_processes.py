"""Processes that tests fork are what fresh ones are (`warm_process`)."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests import warm_process

ROOT = Path(__file__).parent.parent
ENDS = {
    "text": "import sys, os; print(sys.argv, os.getcwd(), os.environ['X']); sys.stderr.write('é')",
    "a number": "raise SystemExit(7)",
    "a sentence": "raise SystemExit('gone')",
    "at its end": "import atexit; atexit.register(print, 'last'); print('first')",
    "its threads": "import threading; threading.Timer(0.05, print, ['late']).start()",
    "a signal": "import os; os.kill(os.getpid(), 9)",
    "no bytecode": "import sys; print(sys.dont_write_bytecode, sys.flags.hash_randomization)",
    "the main module": "x = 5\nimport __main__; print(__main__.x, __name__)",
    "a module of its own": "import beside; print(beside.__file__)",
    "its paths": "import sys; print(sys.path[0], sys.path[-1])",
}


@pytest.mark.parametrize("kind", ENDS)
def test_it_says_and_ends_as_a_fresh_one_does(kind: str, tmp_path: Path) -> None:
    (tmp_path / "beside.py").touch()
    words = ["-B", "-c", ENDS[kind], "a", "b c"]
    env = {**os.environ, "X": "1", "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    fresh = subprocess.run(
        [sys.executable, *words], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    forked = warm_process.run(words, cwd=tmp_path, env=env)
    assert (forked.returncode, forked.stdout, forked.stderr) == (
        fresh.returncode, fresh.stdout, fresh.stderr,
    )  # fmt: skip


def test_what_is_raised_ends_it_with_1_and_ctrl_c_by_its_signal() -> None:
    failed = warm_process.run(["-c", "1 / 0"])
    assert failed.returncode == 1 and failed.stderr.endswith(
        "ZeroDivisionError: division by zero\n"
    )
    process = warm_process.start(["-c", "print('on', flush=True)\nimport time; time.sleep(60)"])
    assert process.poll() is None
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
    assert process.returncode == -signal.SIGINT


def test_processes_run_beside_each_other() -> None:
    reader, writer = os.pipe()
    with open(reader, "rb") as end:
        one = warm_process.start(["-c", "import sys; input()"], stdout=writer)
        two = warm_process.start(["-c", "print('done')"])
        assert two.communicate() == ("done\n", "")
        assert one.wait() == 1  # nothing to read
        os.close(writer)
        assert end.read() == b""


def test_a_process_that_takes_too_long_is_ended() -> None:
    with pytest.raises(subprocess.TimeoutExpired):
        warm_process.run(["-c", "import time; time.sleep(60)"], timeout=0.2)


def test_what_python_reads_at_its_start_needs_a_fresh_one() -> None:
    with pytest.raises(ValueError, match="PYTHONHASHSEED"):
        warm_process.run(["-c", ""], env={**os.environ, "PYTHONHASHSEED": "77"})
