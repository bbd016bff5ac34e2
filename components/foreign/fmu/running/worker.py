"""The process in which FMUs run, apart from ours: it may crash, hang and print as it likes.

It is started as a program of its own and imports of ours what runs an FMU. Requests and answers are
pickles with their length before them, on standard input and what was standard output.
"""

import os
import pickle
import struct
from typing import Any

import numpy as np

from components.foreign.fmu.running.instance import Instance
from components.foreign.fmu.running.values import FmuFailure

_MOST_WORDS = 1_000_000


def answer_requests_on_stdin(folder: str) -> None:
    """Answer requests on standard input to its end, then exit; ``folder`` is the process's own."""
    requests = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what an FMU prints is no answer
    beat = np.memmap(os.path.join(folder, "beat"), dtype=np.int64, mode="r+", shape=(1,))
    instances: dict[int, Instance] = {}
    while len(head := requests.read(8)) == 8:
        request = pickle.loads(requests.read(struct.unpack("<Q", head)[0]))
        content = pickle.dumps(_answer(request, instances, folder, beat), pickle.HIGHEST_PROTOCOL)
        answers.write(struct.pack("<Q", len(content)) + content)
        answers.flush()
        if os.fstat(2).st_size > _MOST_WORDS:
            os.truncate(2, 0)
    os._exit(0)


def _answer(
    request: dict[str, Any], instances: dict[int, Instance], folder: str, beat: Any
) -> dict[str, Any]:
    number = request["instance"]
    try:
        if request["do"] == "open":
            instances[number] = Instance(os.path.join(folder, "fmu"), request["spec"])
            return {}
        return instances[number].run(request, beat)
    except Exception as error:
        words = str(error) or type(error).__name__
        if not isinstance(error, FmuFailure):
            instance = instances.get(number)
            words += "" if instance is None else instance.last_log_text()
        return {"failed": words, "at": request.get("at"), "opening": request["do"] == "open"}
