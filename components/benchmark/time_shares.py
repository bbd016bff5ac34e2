"""Which share of the processor's time blocks take of what is run."""

import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from dsa_des.running.node import Node


def cpu_shares_by_block(do: Callable[[], object]) -> dict[str, float]:
    """Call a function and return each block's share (0 to 1) of its CPU time, largest first.

    A block's is that of its wakes: what it reads, does and sends. What is missing to 1 are the
    making of runs, the engine between wakes, and metrics.
    """
    spent, plain = Counter[str](), Node._run

    def timed(node: Node, *given: Any, **named: Any) -> None:
        began_s = time.process_time()
        try:
            plain(node, *given, **named)
        finally:
            spent[node.name] += time.process_time() - began_s  # type: ignore[assignment]

    Node._run = timed  # type: ignore[method-assign, assignment]
    try:
        began_s = time.process_time()
        do()
        whole_s = time.process_time() - began_s
    finally:
        Node._run = plain  # type: ignore[method-assign]
    return {name: cpu_s / whole_s for name, cpu_s in spent.most_common()}
