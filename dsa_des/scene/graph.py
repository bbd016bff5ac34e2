"""The graph of a scene: its checks, and the order in which blocks run within an instant.

Depth is the longest path to a block over undelayed wires; within a depth, blocks run in the order
of their names. (A topological sort would do as well, but which of the many it gives depends on
the order in the file.)
"""

from collections.abc import Collection, Iterable, Mapping, Sequence, Set
from pathlib import Path

import networkx as nx

from dsa_des.block.component import Component
from dsa_des.scene.scene_file import SceneFile
from dsa_des.scene.wiring import Wire


def build_graph(blocks: Sequence[str], wires: Sequence[Wire]) -> nx.DiGraph:
    """Return the directed graph of the blocks, in which each edge lists its wires as ``wires``.

    An edge is ``is_delayed`` when all of its wires are.
    """
    graph = nx.DiGraph()
    graph.add_nodes_from(sorted(blocks))
    for wire in wires:
        if not graph.has_edge(wire.source, wire.target):
            graph.add_edge(wire.source, wire.target, wires=[], delayed=True)
        edge = graph.edges[wire.source, wire.target]
        edge["wires"].append(wire)
        edge["delayed"] = edge["delayed"] and wire.is_delayed
    return graph


def graph_of_undelayed_edges(graph: nx.DiGraph) -> nx.DiGraph:
    """Return a view of the graph with only those edges that act within an instant."""
    return nx.subgraph_view(graph, filter_edge=lambda a, b: not graph.edges[a, b]["delayed"])


def check_graph(
    scene: SceneFile,
    graph: nx.DiGraph,
    classes: Mapping[str, type[Component]],
    unsure: Set[str] = frozenset(),
) -> None:
    """Report all faults of the wiring as problems of the scene.

    Required inputs without a wire, blocks that no source reaches, cycles without a delay (each
    hop listed), and feedback wires that do not say what they hold before the first message.
    Blocks in `unsure`, which a faulty wire meant to feed, are not blamed for missing it.
    """
    known = {name for name, cls in classes.items() if cls is not None}
    every = [wire for _, _, wires in graph.edges(data="wires") for wire in wires]
    unfed = {
        name: unfed_required_inputs(name, classes[name], every) for name in sorted(known - unsure)
    }
    for name, ports in unfed.items():
        for port in ports:
            declared = classes[name].inputs[port]
            message = f"input {port!r} ({declared.message.__name__}) is required and has no wire"
            if scene.source_file_of(("blocks", name)) != (
                wiring := scene.source_file_of(("wires",))
            ):
                message += f"; the wires of {Path(wiring).name} take the place of those that it "
                message += "extends: repeat them there, or leave the block out: "
                message += f'blocks.remove = ["{name}"]'
            scene.report(("blocks", name), message)
    _check_cycles(scene, graph)
    if known == set(classes) and not unsure:
        _check_reach(scene, graph, classes, {name for name, ports in unfed.items() if ports})


def unfed_required_inputs(name: str, cls: type[Component], wires: Iterable[Wire]) -> list[str]:
    """Return the required inputs of a block that no wire leads to, sorted."""
    fed = {wire.input for wire in wires if wire.target == name}
    return sorted(port for port, of in cls.inputs.items() if of.required and port not in fed)


def _check_cycles(scene: SceneFile, graph: nx.DiGraph) -> None:
    now = graph_of_undelayed_edges(graph)
    for group in nx.strongly_connected_components(now):
        first = min(group)
        if len(group) == 1 and not now.has_edge(first, first):
            continue
        cycle = nx.find_cycle(now.subgraph(group), first)
        hops = [
            next(str(wire) for wire in graph.edges[a, b]["wires"] if not wire.is_delayed)
            for a, b in cycle
        ]
        message = (
            f"a cycle without delay: {'; '.join(hops)}. Give one of these wires a delay "
            '(delay_s, or delay = "1 scan")'
        )
        scene.report(("wires",), message)
    looped = loop_number_by_block(graph)
    for source, target, wires in graph.edges(data="wires"):
        if source in looped and target in looped and looped[source] == looped[target]:
            for wire in wires:
                if wire.is_delayed and wire.holds is None:
                    message = (
                        f"{wire} is a feedback wire: say what it holds before the first "
                        "message (holds = 'nothing' or a table)"
                    )
                    scene.report(("wires",), message)


def _check_reach(
    scene: SceneFile,
    graph: nx.DiGraph,
    classes: Mapping[str, type[Component]],
    unfed: Set[str],
) -> None:
    """Report blocks that no source reaches, except those in `unfed` or downstream of them."""
    sources = [
        name for name in graph if not any(port.required for port in classes[name].inputs.values())
    ]
    if not sources and len(graph):
        message = "no block is a source (has no required inputs)"
        scene.report(("blocks",), message)
        return
    begin = {*sources, *unfed}  # that nothing comes to these is said already
    reached = begin.union(*(nx.descendants(graph, name) for name in begin))
    for name in sorted(set(graph) - reached):
        message = "no source reaches this block over the wires; wire it or remove it"
        scene.report(("blocks", name), message)
    if len(graph) > 1:
        for name in sources:
            if graph.out_degree(name) == 0 and not classes[name].stands_alone:
                message = "this source is wired to nothing; wire it or remove it"
                scene.report(("blocks", name), message)


def loop_number_by_block(graph: nx.DiGraph) -> dict[str, int]:
    """Return block → the number of its feedback loop, for the blocks that are in one."""
    looped: dict[str, int] = {}
    for number, group in enumerate(nx.strongly_connected_components(graph)):
        first = next(iter(group))
        if len(group) > 1 or graph.has_edge(first, first):
            looped.update(dict.fromkeys(group, number))
    return looped


def block_depths(graph: nx.DiGraph, first: Collection[str] = ()) -> dict[str, int]:
    """Return block → depth: number of edges of the longest path to it over undelayed edges.

    Whatever the blocks in `first` do not depend on is deeper than they are.
    """
    return _longest_path_depths(graph_of_undelayed_edges(graph), first)


def _longest_path_depths(graph: nx.DiGraph, first: Collection[str]) -> dict[str, int]:
    depth: dict[str, int] = {}
    for name in nx.topological_sort(graph):
        depth[name] = max((depth[before] + 1 for before in graph.predecessors(name)), default=0)
    mine = set(first).intersection(graph)
    needed = mine.union(*(nx.ancestors(graph, name) for name in mine))
    later = 1 + max((depth[name] for name in mine), default=-1)
    return {name: index if name in needed else index + later for name, index in depth.items()}


def window_order(
    graph: nx.DiGraph,
    windowed: set[str],
    cut: Collection[tuple[str, str]] = (),
    queues: Mapping[str, Collection[str]] | None = None,
    first: Collection[str] = (),
) -> dict[str, int]:
    """Return windowed block → depth: edges of the longest path to it, delayed ones included.

    A window is handled block by block, so a sender must be done with it before its receiver
    starts, whatever the delay between them; over the edges in `cut` it need not be. A queue (name
    to the blocks that line up in it) comes after all of its blocks and before their receivers; its
    depth stands under `queue_node_name`. Whatever the blocks in `first` do not depend on is deeper.
    """
    part = nx.DiGraph(graph.subgraph(windowed))
    part.remove_edges_from(cut)
    part = graph_with_queue_nodes(part, queues or {})
    return _longest_path_depths(part, first)


def queue_node_name(name: str) -> str:
    """Return the node name of a shared processor's queue; its colon sets it apart from blocks."""
    return f"processor: {name}"


def graph_with_queue_nodes(graph: nx.DiGraph, queues: Mapping[str, Collection[str]]) -> nx.DiGraph:
    """Return a graph with shared processors' queues between their blocks and the receivers."""
    wired = nx.DiGraph()
    wired.add_nodes_from(graph)
    wired.add_nodes_from(queue_node_name(name) for name in queues)
    queue_of = {block: queue_node_name(name) for name, blocks in queues.items() for block in blocks}
    for source, target in graph.edges:
        wired.add_edge(queue_of.get(source, source), target)
    wired.add_edges_from((block, queue) for block, queue in queue_of.items() if block in graph)
    return wired
