"""Where feedback loops are opened: to run in windows, to look ahead, and to tell neighbours."""

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import networkx as nx

from dsa_des.block.component import Component
from dsa_des.scene.graph import loop_number_by_block, window_order
from dsa_des.scene.scene import Scene

#: From which block to which.
Edge = tuple[str, str]


def _edges_closing_loops(graph: nx.DiGraph, rank: Callable[[Edge], Any]) -> set[Edge]:
    """Return delayed edges whose removal leaves no loops, from each loop one of highest `rank`.

    An edge is taken out only if it closes a loop of edges of its rank or lower ones.
    """
    looped = loop_number_by_block(graph)
    kept = nx.DiGraph()
    kept.add_nodes_from(looped)
    delayed = []
    for edge in sorted(graph.edges):
        if edge[0] in looped and looped.get(edge[1]) == looped[edge[0]]:
            if graph.edges[edge]["delayed"]:
                delayed.append(edge)
            else:
                kept.add_edge(*edge)
    closing = set()
    for edge in sorted(delayed, key=rank):
        kept.add_edge(*edge)
        if not nx.is_directed_acyclic_graph(kept):
            kept.remove_edge(*edge)
            closing.add(edge)
    return closing


def loop_cut_edges(graph: nx.DiGraph, classes: Mapping[str, type[Component]]) -> set[Edge]:
    """Return a small set of delayed edges whose removal leaves the graph without loops.

    Edges into inputs that a block can do without are the first to go: that is where a loop closes.
    """
    return _edges_closing_loops(graph, lambda edge: _is_optional_edge(graph, classes, edge))


def blocks_not_behind_loops(graph: nx.DiGraph) -> set[str]:
    """Return the blocks neither in a loop nor downstream of one; none if the graph has no loop."""
    looped = loop_number_by_block(graph)
    behind = set(looped).union(*(nx.descendants(graph, name) for name in looped))
    return set(graph) - behind if looped else set()


def _is_optional_edge(
    graph: nx.DiGraph, classes: Mapping[str, type[Component]], edge: Edge
) -> bool:
    """Return whether the receiving block can run without what arrives over an edge."""
    inputs = classes[edge[1]].inputs
    return all(not inputs[wire.input].required for wire in graph.edges[edge]["wires"])


def longest_delay_cut_edges(scene: Scene) -> set[Edge]:
    """Return delayed edges whose removal leaves no loops in the scene, with the longest delays.

    The shortest of those taken out is as long as can be.
    """
    return _edges_closing_loops(scene.graph, lambda edge: shortest_delay_s(scene, edge))


def shortest_delay_s(scene: Scene, edge: Edge) -> Fraction:
    """Return the shortest delay of the wires from one block to another, s."""
    wires = [wire for wire in scene.wires if (wire.source, wire.target) == edge]
    return min(
        wire.total_delay_s + wire.delay_scans * _scan_period_s(scene, edge) for wire in wires
    )


def _scan_period_s(scene: Scene, edge: Edge) -> Fraction:
    """Return the scan period, s, in which a delay counts: the receiver's, the sender's or 0."""
    for name in reversed(edge):
        block = scene.blocks[name]
        spec = block.cls.clock_of(block.parameters)
        if spec is not None:
            return spec.period_s
    return Fraction(0)


def offer_order(graph: nx.DiGraph, classes: Mapping[str, type[Component]]) -> dict[str, int]:
    """Return block → its place in the order in which blocks pass on what they offer.

    Requests go the other way. Both pass over wires with and without delay; loops are opened at
    their sources, which tell without having heard anything, else where an input can be done
    without, and else at a delay.
    """

    def leads_into_source(edge: Edge) -> bool:
        return not any(port.required for port in classes[edge[1]].inputs.values())

    opened = nx.DiGraph(graph)
    for opens in (leads_into_source, lambda edge: _is_optional_edge(graph, classes, edge)):
        if not (looped := loop_number_by_block(opened)):
            break
        inside = [e for e in opened.edges if looped.get(e[0], -1) == looped.get(e[1], -2)]
        opened.remove_edges_from([edge for edge in inside if opens(edge)])
    return window_order(opened, set(graph), loop_cut_edges(opened, classes))
