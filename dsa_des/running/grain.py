"""At which grain blocks run, where loops are opened, and how long look-ahead windows are."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

import networkx as nx

from dsa_des.block.component import Component
from dsa_des.errors import SceneError
from dsa_des.errors.budgets import MOST_SCANS
from dsa_des.running.node import Node
from dsa_des.scene.graph import in_cycles, window_order
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import ScanClock
from dsa_des.time.timeline import ReplicaTime


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


@dataclass(frozen=True)
class Grain:
    """How the blocks of a run take windows.

    Parameters
    ----------
    windowed : set of str
        Blocks that handle a whole window at its start; the others run at their own ticks in it.
    rewinds : bool
        Whether windows are run as if nothing came back, and undone if something did.
    cut_edges : set of (source, target)
        Over which something may come back.
    unwound : dict
        Blocks that cannot be rewound, and why: with one of them, loops run scan by scan.
    queues : dict
        Shared processors that serve a window at once, and the blocks that line up at each.
    ahead : set of str
        Blocks that no loop leads to: what comes back is nothing to them, and they run ahead in
        longer windows.
    """

    windowed: set[str]
    rewinds: bool
    cut_edges: set[tuple[str, str]]
    unwound: dict[str, str]
    queues: dict[str, list[str]] = field(default_factory=dict)
    ahead: set[str] = field(default_factory=set)

    def order(self, scene: Scene, first: Collection[str] = ()) -> dict[str, int]:
        """Return the place of each block and each queue in a window (`window_order`)."""
        return window_order(scene.graph, self.windowed, self.cut_edges, self.queues, first)


def grain_of(scene: Scene, window: int | None) -> Grain:
    """Return at which grain the blocks of a scene run; `window` is that of `Simulation`."""
    queued = {name for name, block in scene.blocks.items() if block.options.processor}
    unwound = cannot_rewind(scene.classes, queued)
    if window == 1:
        return Grain(set(), False, set(), unwound)
    if not unwound and in_cycles(scene.graph):
        return Grain(
            set(scene.blocks), True, cut_loops(scene.graph, scene.classes), unwound,
            ahead=before_loops(scene.graph),
        )  # fmt: skip
    queues = {name: scene.queues[name] for name in sorted(scene.windowed_queues())}
    return Grain(scene.look_ahead_blocks(), False, set(), unwound, queues)


# A window of about this many target-scans keeps NumPy's calls long and its arrays in cache.
CELLS_PER_WINDOW = 131072


def scans_of(nodes: Mapping[str, Node], time: ReplicaTime) -> float:
    """Return how many scans of all clocks together each run has, about."""
    return float(sum(time.run_ticks / clock.period for clock in _clocks(nodes.values())))


def refuse_endless_work(scene: Scene, scans: float, duration_s: float) -> None:
    """Raise SceneError if a run has more scans than are ever simulated."""
    if scans > MOST_SCANS:
        message = (
            f"is {duration_s:.4g} s, in which the clocks of this scene make "
            f"{scans:.2g} scans: at most {MOST_SCANS:.0e} are simulated"
        )
        raise SceneError([scene.problem("duration_s", message)])


def longest_window(nodes: Mapping[str, Node], time: ReplicaTime, window: int | None) -> int:
    """Return the ticks of a window that holds about the wanted number of scans.

    Parameters
    ----------
    nodes : mapping
    time : ReplicaTime
    window : int, optional
        Scans of all clocks together; by default, and where blocks run scan by scan anyway, as
        many as make a window of `CELLS_PER_WINDOW`.
    """
    width = max(node.component.width for node in nodes.values())
    scans = window if window not in (None, 1) else max(1, CELLS_PER_WINDOW // max(1, width))
    per_tick = sum((1 / clock.period for clock in _clocks(nodes.values())), Fraction(0))
    if time.side_by_side and window is None:  # each of them makes these scans
        per_tick *= time.replicas
    return max(1, int(scans / per_tick)) if per_tick else time.end_tick


def _clocks(nodes: Iterable[Node]) -> list[ScanClock]:
    return [node.clock for node in nodes if node.clock is not None]
