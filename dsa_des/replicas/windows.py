"""How far replicas may run at a time: whole ones in a row, or no farther than a loop comes back.

Whatever a block sends into a loop comes back no earlier than the delays of the loop allow. A window
no longer than the delay of the wires at which loops are opened holds nothing that depends on what
is sent back in it: the lookahead of conservative parallel simulation (Chandy and Misra,
"Distributed simulation: a case study in design and verification of distributed programs", IEEE
Transactions on Software Engineering SE-5, 1979).
"""

from collections.abc import Mapping
from fractions import Fraction

import networkx as nx

from dsa_des.running.windows import EqualWindows, Window
from dsa_des.scene.graph import in_cycles
from dsa_des.scene.scene import Scene
from dsa_des.time.timeline import ReplicaTime

Edge = tuple[str, str]


def opened_loops(scene: Scene) -> set[Edge]:
    """Return delayed edges without which the scene has no loop, those of the longest delays.

    An edge is taken out only if it closes a loop of edges that are as short or shorter: so the
    shortest of those taken out is as long as can be.
    """
    looped = in_cycles(scene.graph)
    inside = [
        (source, target)
        for source, target in sorted(scene.graph.edges)
        if source in looped and looped.get(target) == looped[source]
    ]
    lasts = {edge: shortest_s(scene, edge) for edge in inside}
    kept = nx.DiGraph()
    kept.add_nodes_from(looped)
    kept.add_edges_from(edge for edge in inside if not scene.graph.edges[edge]["delayed"])
    opened = set()
    delayed = [edge for edge in inside if scene.graph.edges[edge]["delayed"]]
    for edge in sorted(delayed, key=lambda edge: (lasts[edge], edge)):
        kept.add_edge(*edge)
        if not nx.is_directed_acyclic_graph(kept):
            kept.remove_edge(*edge)
            opened.add(edge)
    return opened


def shortest_s(scene: Scene, edge: Edge) -> Fraction:
    """Return the shortest delay of the wires from one block to another, s."""
    wires = [wire for wire in scene.wires if (wire.source, wire.target) == edge]
    return min(wire.total_delay_s + wire.delay_scans * _period_s(scene, edge) for wire in wires)


def _period_s(scene: Scene, edge: Edge) -> Fraction:
    """Return the time between scans that delays on an edge count in; 0 where there are none."""
    for name in reversed(edge):
        block = scene.blocks[name]
        spec = block.cls.clock_of(block.parameters)
        if spec is not None:
            return spec.period_s
    return Fraction(0)


def lookahead_ticks(delays: Mapping[Edge, int], opened: set[Edge]) -> int:
    """Return the length of the longest window in which nothing comes back.

    Parameters
    ----------
    delays : mapping
        Shortest delay in ticks from one block to another, over all wires between them.
    opened : set of Edge
        As from `opened_loops`.
    """
    return min(delays[edge] for edge in opened)


class ReplicaWindows(EqualWindows):
    """Windows that hold many whole replicas, or a part of one.

    Parameters
    ----------
    time : ReplicaTime
    longest_ticks
        As for `EqualWindows`; the time between replicas does not count.
    """

    def __init__(self, time: ReplicaTime, longest_ticks: int) -> None:
        super().__init__(time.end_tick, longest_ticks)
        self._time = time

    def next(self) -> Window | None:
        """Return the next window; one between replicas would be empty."""
        span, length = self._time.span_ticks, self._time.run_ticks
        number, within = divmod(self.start, span)
        if within >= length:
            number, within = number + 1, 0
        if number >= self._time.replicas:
            return None
        self.start = number * span + within
        together = self.longest_ticks // length
        if together > 1 and within == 0:
            last = min(number + together, self._time.replicas) - 1
            return Window(self.start, self.end_after((last - number) * span + length))
        return Window(self.start, self.end_after(min(self.longest_ticks, length - within)))
