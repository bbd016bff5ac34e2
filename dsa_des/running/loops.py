"""Feedback loops of a scene: where they are opened, and whether they can be run in windows."""

from collections.abc import Collection, Mapping

import networkx as nx

from dsa_des.block.component import Component
from dsa_des.scene.graph import in_cycles, window_order


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


def before_loops(graph: nx.DiGraph) -> set[str]:
    """Return the blocks that no loop leads to; none where there is no loop."""
    looped = in_cycles(graph)
    behind = set(looped).union(*(nx.descendants(graph, name) for name in looped))
    return set(graph) - behind if looped else set()


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
