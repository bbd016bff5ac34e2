"""How far replicas in a feedback loop may run side by side: the smallest delay of the loop.

Whatever a block sends into a loop comes back no earlier than the delays of the loop allow. A window
no longer than the delay of the wires at which loops are opened holds nothing that depends on what
is sent back in it: the lookahead of conservative parallel simulation (Chandy and Misra,
"Distributed simulation: a case study in design and verification of distributed programs", IEEE
Transactions on Software Engineering SE-5, 1979).
"""

from collections.abc import Mapping
from fractions import Fraction

import networkx as nx

from dsa_des.scene.graph import in_cycles
from dsa_des.scene.scene import Scene

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
