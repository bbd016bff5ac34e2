"""A program that answers every call with empty frames, until it misbehaves: canned.py WAY CALL."""

import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

WAY, CALL, FOLDER = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
END = struct.pack("<Q", 0)
(FOLDER / "pid").write_text(str(os.getpid()))
HELLO = (FOLDER / ("hello_2" if WAY == "version" else "hello")).read_bytes()


def read(count):
    content = sys.stdin.buffer.read(count)
    if len(content) < count:
        sys.exit()
    return content


def call():
    """Return the frames of a call."""
    frames = []
    while length := struct.unpack("<Q", read(8))[0]:
        frames.append(read(length))
    return frames


def say(content):
    sys.stdout.buffer.write(content)
    sys.stdout.buffer.flush()


if WAY == "deaf":
    time.sleep(600)
if WAY == "chatty":
    sys.stderr.write("x" * 300_000 + "\n")
call()
say(HELLO + END)
marker = FOLDER / "misbehaved"
number = 0
while True:
    frames = call()
    number += 1
    if WAY == "echo":
        say(b"".join(struct.pack("<Q", len(f)) + f for f in frames) + END)
        continue
    done_once = WAY == "once" and marker.exists()
    if number == CALL and not done_once:
        marker.touch()
        print("line one\nthe engine is on fire", file=sys.stderr, flush=True)
        if WAY in ("die", "once"):
            os._exit(7)
        if WAY == "signal":
            os.kill(os.getpid(), signal.SIGSEGV)
        if WAY in ("hang", "children"):
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
            (FOLDER / "child").write_text(str(child.pid))
            if WAY == "hang":
                print(file=sys.stderr, flush=True)  # whoever waits for an answer looks up
                time.sleep(600)
        if WAY == "garbage":
            say(b"Hello, world! This is no message.")
        if WAY == "no_arrow":
            say(struct.pack("<Q", 12) + b"not an arrow" + END)
            continue
        if WAY == "half":
            say(struct.pack("<Q", 1000) + b"half")
            os._exit(0)
        if WAY == "more":
            say(END + b"and more")
            time.sleep(600)
        if WAY == "slow":
            time.sleep(0.3)
        if WAY == "table":
            say((FOLDER / "table").read_bytes())
    say(END)
