"""Waiting for what another process or thread does, however slow the machine is."""

import time
from collections.abc import Callable
from typing import Any

#: Longer than anything takes on a machine that is busy with much else, s.
WAIT_S = 300.0


def wait_for(look: Callable[[], Any]) -> Any:
    """What `look` gives once it gives something: what met the wait, not what is so afterwards."""
    until = time.monotonic() + WAIT_S
    while time.monotonic() < until:
        if found := look():
            return found
        time.sleep(0.01)
    raise AssertionError("it did not come")
