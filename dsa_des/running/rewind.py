"""Looking ahead in a feedback loop: run a window as if nothing came back, and rewind if it did.

In a loop every way back has a delay. A window is run with its feedback wires cut: blocks see what
had come back before the window began. If then a message turns out to arrive inside the window,
everything from that instant on was wrong; the run goes back to the window's start and runs it
again up to that instant, where it was right. Windows start small after such a message and double
while nothing comes back.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

import networkx as nx
import numpy as np

from dsa_des.block.component import Component
from dsa_des.record.recording import Recorder
from dsa_des.running.channel import Channel
from dsa_des.running.rewind_check import Witness
from dsa_des.running.run_state import RewindableRun, RunningBlock
from dsa_des.scene.graph import in_cycles, window_order

# At the start, and after something came back, a window has this part of its full length.
_RESTART = 32
_CONTAINERS = (list, dict, set, deque, np.ndarray)


def cut_loops(graph: nx.DiGraph, classes: Mapping[str, type[Component]]) -> set[tuple[str, str]]:
    """Return the delayed edges whose removal leaves no loop, as few as come to hand.

    Edges into inputs that a block can do without are the first to go: that is where a loop closes.

    Parameters
    ----------
    graph : networkx.DiGraph
        From `dsa_des.scene.graph.build_graph`.
    classes : mapping
        The class of each block.
    """
    looped = in_cycles(graph)
    inside = [
        (source, target)
        for source, target in sorted(graph.edges)
        if source in looped and looped.get(target) == looped[source]
    ]
    kept = nx.DiGraph()
    kept.add_nodes_from(looped)
    kept.add_edges_from(edge for edge in inside if not graph.edges[edge]["delayed"])
    cut = set()
    delayed = (edge for edge in inside if graph.edges[edge]["delayed"])
    for edge in sorted(delayed, key=lambda edge: _optional(graph, classes, edge)):
        kept.add_edge(*edge)
        if not nx.is_directed_acyclic_graph(kept):
            kept.remove_edge(*edge)
            cut.add(edge)
    return cut


def _optional(
    graph: nx.DiGraph, classes: Mapping[str, type[Component]], edge: tuple[str, str]
) -> bool:
    """Whether the receiving block can do without what comes over an edge."""
    inputs = classes[edge[1]].inputs
    return all(not inputs[wire.input].required for wire in graph.edges[edge]["wires"])


def telling_order(graph: nx.DiGraph, classes: Mapping[str, type[Component]]) -> dict[str, int]:
    """Return the place of each block in the order in which blocks tell each other what they offer.

    Requests go the other way. Both pass over wires with and without delay; loops are opened where
    an input can be done without, and else at a delay.
    """
    looped = in_cycles(graph)
    opened = nx.DiGraph(graph)
    opened.remove_edges_from(
        edge
        for edge in graph.edges
        if edge[0] in looped
        and looped[edge[0]] == looped.get(edge[1])
        and _optional(graph, classes, edge)
    )
    return window_order(opened, set(graph), cut_loops(opened, classes))


def cannot_rewind(
    classes: Mapping[str, type[Component]], queued: Collection[str] = ()
) -> dict[str, str]:
    """Return the blocks that the engine cannot take back to an earlier state, and why each.

    Parameters
    ----------
    classes : mapping
        The class of each block.
    queued : collection of str
        Blocks on a shared processor.
    """
    found = {}
    for name, cls in sorted(classes.items()):
        if cls.process is not None:
            found[name] = "has a process of its own"
        elif not cls.windowed:
            found[name] = "runs scan by scan (windowed is False)"
        elif not cls.rewindable:
            found[name] = "does not let itself be rewound (rewindable is False)"
        elif name in queued:
            found[name] = "shares a processor"
    return found


def rewinding_windows(simulation: RewindableRun, end: int) -> Iterator[tuple[int, int]]:
    """Run and yield windows in which nothing came back unseen."""
    feedback = [
        channel
        for node in simulation.nodes.values()
        for wires in node.channels.values()
        for channel in wires
        if (channel.source, node.name) in simulation.cut_edges
    ]
    start, length = 0, max(1, simulation.window_ticks // _RESTART)
    came = 0  # when something came back last
    while start < end:
        stop = min(start + length, end, *(cut for cut in simulation.cuts if cut > start))
        checkpoint = Checkpoint(simulation.nodes.values(), simulation.recorder, simulation.trace)
        simulation.window = (start, stop)
        simulation.run_window(start, stop)
        early = checkpoint.earliest_since(feedback, stop)
        if simulation.failure is not None and (early < stop or len(simulation.failed_at) > 1):
            # What failed may never have happened: look less far.
            simulation.failure = None
            checkpoint.restore()
            middle = int(simulation.failed_at[len(simulation.failed_at) // 2])
            length = max(1, min(early, middle) - start)
            continue
        simulation.raise_failure()
        if early < stop:
            checkpoint.restore()
            stop = early
            simulation.window = (start, stop)
            simulation.run_window(start, stop)
            simulation.raise_failure()
        if simulation.witness is not None:
            _run_again(simulation, simulation.witness, checkpoint, start, stop)
        coming = checkpoint.earliest_since(feedback, -1)
        if coming < 0:
            length = min(2 * length, simulation.window_ticks)
        else:  # what comes back often comes regularly; at first, or after a hurry, start small
            small = simulation.window_ticks // _RESTART
            length = min(max(1, coming - came if came else small), simulation.window_ticks)
            came = coming
        yield start, stop
        start = stop


def _run_again(
    simulation: RewindableRun, witness: Witness, checkpoint: "Checkpoint", start: int, stop: int
) -> None:
    """Run a window a second time from its saved state; it must give the same."""
    first = witness.seen()
    checkpoint.restore()
    simulation.run_window(start, stop)
    times_s = start / simulation.ticks_per_s, stop / simulation.ticks_per_s
    witness.compare(first, simulation.failure, times_s)


class Checkpoint:
    """The state of all blocks and wires at the start of a window.

    Parameters
    ----------
    nodes : iterable of RunningBlock
    recorder : Recorder or None
    trace : list or None
    """

    def __init__(
        self,
        nodes: Iterable[RunningBlock],
        recorder: Recorder | None,
        trace: list[tuple[int, str]] | None,
    ) -> None:
        self._objects: list[tuple[Any, dict[str, Any]]] = []
        for node in nodes:
            for thing in (node.component, *node.component.context.effects.values()):
                if hasattr(thing, "__dict__"):
                    self._objects.append((thing, _copied(vars(thing))))
        channels = {
            id(channel): channel
            for node in nodes
            for wires in node.channels.values()
            for channel in wires
        }
        self._channels: list[tuple[Channel, Any]] = [(c, c.state()) for c in channels.values()]
        self._recorder, self._recorded = recorder, None if recorder is None else recorder.mark()
        self._trace, self._traced = trace, 0 if trace is None else len(trace)

    def earliest_since(self, channels: Iterable[Channel], end: int) -> int:
        """Return the first arrival over some wires of what was sent since, or `end`."""
        ticks = [channel.earliest_pushed() for channel in channels]
        return min((tick for tick in ticks if tick is not None), default=end)

    def restore(self) -> None:
        """Bring everything back to how it was."""
        for thing, state in self._objects:
            vars(thing).clear()
            vars(thing).update(_copied(state))
        for channel, state in self._channels:
            channel.set_state(state)
        if self._recorder is not None and self._recorded is not None:
            self._recorder.rewind(self._recorded)
        if self._trace is not None:
            del self._trace[self._traced :]


def _copied(state: Mapping[str, Any]) -> dict[str, Any]:
    """Copy what a block might change in place; messages and tables are never changed so."""
    return {
        name: value.copy() if isinstance(value, _CONTAINERS) else value
        for name, value in state.items()
    }
