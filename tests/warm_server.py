"""Loads the libraries once and forks a process for each request of `warm_process`."""

import array
import atexit
import contextlib
import gc
import importlib
import importlib.metadata
import io
import json
import os
import pkgutil
import runpy
import signal
import socket
import sys
import tempfile
import threading
import types

from dsa_des.block.entry_points import entry_points_of

_LIBRARIES = (
    "numpy", "scipy.special", "scipy.optimize", "pydantic", "pyarrow.parquet", "simpy", "networkx",
    "rich.console", "rich.table", "click", "geographiclib.geodesic", "matplotlib.pyplot",
)  # fmt: skip
_OURS = ("dsa_des", "components")
_NOT_LOADED = ("__main__", ".thesis.", ".benchmark.", ".dask")


def load() -> None:
    """Load what most commands need."""
    for name in _LIBRARIES:
        importlib.import_module(name)
    for name in _OURS:
        package = importlib.import_module(name)
        for found in pkgutil.walk_packages(package.__path__, f"{name}."):
            if not any(part in found.name for part in _NOT_LOADED):
                with contextlib.suppress(ImportError):  # an extra that is not installed here
                    importlib.import_module(found.name)
    build_models()
    for group in importlib.metadata.entry_points().groups:
        if group.startswith("dsa_des."):
            entry_points_of(group)
    gc.collect()
    gc.freeze()


def build_models() -> None:
    """Do what each process would otherwise do by itself: parameters' schemas, and pandas for Arrow.

    Pydantic builds a schema when it is first needed; Arrow looks for pandas with its first array.
    """
    import pyarrow
    from pydantic import BaseModel

    pyarrow.array([0])
    models = BaseModel.__subclasses__()
    for model in models:
        models.extend(model.__subclasses__())
        if not model.__pydantic_complete__:
            model.model_rebuild(raise_errors=False)


def next_job(source: socket.socket) -> dict:
    """Return, in a process of its own, what it shall do; end when nobody asks any more."""
    watchers: set[int] = set()
    while True:
        data, rights, _, _ = source.recvmsg(64, socket.CMSG_SPACE(4 * 4))
        if not data:
            for watcher in watchers:
                os.waitpid(watcher, 0)
            os._exit(0)
        handles = array.array("i")
        handles.frombytes(rights[0][2])
        stdout, stderr, told, request = handles
        with open(request, "rb") as stream:
            job = json.loads(stream.read())
        watcher = os.fork()
        if watcher == 0:
            source.close()
            process = os.fork()
            if process == 0:
                os.close(told)
                _take(job, stdout, stderr)
                return job
            for handle in (stdout, stderr):
                os.close(handle)
            _watch(process, told)
        watchers.add(watcher)
        for handle in (stdout, stderr, told):
            os.close(handle)
        watchers -= {done for done in watchers if os.waitpid(done, os.WNOHANG)[0]}


def _watch(process: int, told: int) -> None:
    """Say the number of a process, wait, and say how it ended."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.write(told, b"%d\n" % process)
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    with contextlib.suppress(OSError):  # nobody waits any more
        os.write(told, b"%d\n" % code)
    os._exit(0)


def _take(job: dict, stdout: int, stderr: int) -> None:
    """Make this process the one that was asked for."""
    for handle, standard in ((stdout, 1), (stderr, 2)):
        os.dup2(handle, standard)
        os.close(handle)
    out, err = (io.FileIO(standard, "w", closefd=False) for standard in (1, 2))
    sys.stdout = sys.__stdout__ = io.TextIOWrapper(io.BufferedWriter(out), "utf-8")
    sys.stderr = sys.__stderr__ = io.TextIOWrapper(
        io.BufferedWriter(err), "utf-8", "backslashreplace", line_buffering=True
    )
    before = os.environ.get("PYTHONPATH", "")
    os.environ.clear()
    os.environ.update(job["env"])
    os.chdir(job["cwd"])
    tempfile.tempdir = None  # that of its own environment
    signal.signal(signal.SIGINT, signal.default_int_handler)
    words, safe = job["words"], bool(job["env"].get("PYTHONSAFEPATH"))
    while words[0] in ("-B", "-P"):
        safe |= words[0] == "-P"
        sys.dont_write_bytecode |= words[0] == "-B"
        del words[0]
    if job["env"].get("PYTHONDONTWRITEBYTECODE"):
        sys.dont_write_bytecode = True
    theirs = [os.path.abspath(place) for place in before.split(os.pathsep) if place]
    asked = job["env"].get("PYTHONPATH", "")
    mine = [os.path.abspath(place) for place in asked.split(os.pathsep) if place]
    # What an editable installation adds to the path is not added where it stands there already.
    path = [*mine, *(place for place in sys.path if place not in (*theirs, *mine))]
    if not safe:
        first = {"-m": os.getcwd(), "-c": ""}
        path.insert(0, first.get(words[0], os.path.dirname(os.path.abspath(words[0]))))
    sys.path[:] = path
    importlib.invalidate_caches()
    if asked != before:
        entry_points_of.cache_clear()


def begin(job: dict) -> None:
    """Do as ``python`` does with these words."""
    words = job["words"]
    if words[0] == "-m":
        sys.argv = words[1:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
        return
    main = sys.modules["__main__"] = types.ModuleType("__main__")
    if words[0] == "-c":
        sys.argv = ["-c", *words[2:]]
        exec(compile(words[1], "<string>", "exec"), main.__dict__)
    else:
        sys.argv = words
        main.__file__ = words[0]
        with open(words[0], "rb") as file:
            exec(compile(file.read(), words[0], "exec"), main.__dict__)


def end(code: int) -> None:
    """Do what Python does at its end, but for taking every module apart."""
    threading._shutdown()
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
    except OSError:
        return  # Python has words for that
    os._exit(code)


def number_of(left: SystemExit) -> int:
    """Return the exit code of what left, after saying what it says."""
    if left.code is None or isinstance(left.code, int):
        return (left.code or 0) & 0xFF
    print(left.code, file=sys.stderr)
    return 1


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # a fork has none of its parent's threads
    load()
    JOB = next_job(socket.socket(fileno=int(sys.argv[1])))
    CODE = 0
    try:
        begin(JOB)
    except SystemExit as error:
        CODE = number_of(error)
    end(CODE)
    sys.exit(CODE)
