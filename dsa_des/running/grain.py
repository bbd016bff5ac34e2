"""At which grain blocks run, and how long look-ahead windows are."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

import networkx as nx

from dsa_des.block.component import Component, may_end_its_run
from dsa_des.errors import SceneError
from dsa_des.errors.budgets import MOST_SCANS
from dsa_des.running.loops import (
    Edge,
    blocks_not_behind_loops,
    longest_delay_cut_edges,
    loop_cut_edges,
    shortest_delay_s,
)
from dsa_des.running.node import Node
from dsa_des.scene.graph import (
    graph_with_queue_nodes,
    loop_number_by_block,
    queue_node_name,
    window_order,
)
from dsa_des.scene.queue_policy import QueuePolicy, find_policy
from dsa_des.scene.scene import Scene
from dsa_des.time.run_clock import RunClock
from dsa_des.time.timeline_runs import Runs


def _blocks_without_windows(scene: Scene) -> dict[str, str]:
    """Return block → why it cannot run in windows: own process, scan by scan, shared processor."""
    reasons = {}
    for name, block in sorted(scene.blocks.items()):
        if block.cls.process is not None:
            reasons[name] = "has a process of its own"
        elif not block.cls.windowed:
            reasons[name] = "runs scan by scan (windowed is False)"
        elif block.options.processor:
            reasons[name] = "shares a processor"
    return reasons


def _explain_fast_feedback(scene: Scene, opened: Collection[Edge]) -> dict[str, str]:
    """Return block → reason, for blocks in loops whose feedback comes before the next scan."""
    stuck = sorted(name for name, cls in scene.classes.items() if not cls.rewindable)
    clocks = [block.cls.clock_of(block.parameters) for block in scene.blocks.values()]
    per_s = sum((clock.rate_hz for clock in clocks if clock is not None), Fraction(0))
    return {
        edge[0]: "sends back sooner than the next scan, and not all blocks can be rewound: "
        f"{', '.join(stuck)}"
        for edge in sorted(opened)
        if shortest_delay_s(scene, edge) * per_s < 1
    }


def windowed_blocks(scene: Scene, queues: Collection[str]) -> set[str]:
    """Return the blocks outside of loops that may handle a whole look-ahead window in one go.

    A block runs at the widest grain that it and everything upstream allow: it must declare
    itself windowed, have no process of its own, queue for no shared processor but those in
    `queues`, be in no feedback loop, and be fed by windowed blocks only.
    """
    looped = loop_number_by_block(scene.graph)
    windowed: set[str] = set()
    for name in nx.topological_sort(scene.graph.subgraph(set(scene.graph) - looped.keys())):
        processor = scene.blocks[name].options.processor
        alone = not processor or processor in queues
        before = scene.graph.predecessors(name)
        if alone and _can_take_windows(scene.classes[name]) and windowed.issuperset(before):
            windowed.add(name)
    return windowed


def windowed_queues(scene: Scene) -> set[str]:
    """Return the shared processors that can serve all messages of a look-ahead window in one go.

    Their blocks must run in look-ahead windows, and none of them may wait for what comes out of
    the queue, through whichever blocks or other queues.
    """
    queues = scene.blocks_by_shared_processor
    # Who leaves out scans must know of each whether the processor is busy.
    policies = {name: find_policy(p.when_busy) for name, p in scene.processors.items()}
    able = {name for name, policy in policies.items() if policy.skips is QueuePolicy.skips}
    while able:
        looped = loop_number_by_block(
            graph_with_queue_nodes(scene.graph, {name: queues[name] for name in able})
        )
        windowed = windowed_blocks(scene, able)
        left = {
            n for n in able if queue_node_name(n) not in looped and windowed.issuperset(queues[n])
        }
        if left == able:
            break
        able = left
    return able


@dataclass(frozen=True)
class Grain:
    """Which of a run's blocks handle whole windows or run scan by scan, and where loops are cut.

    Parameters
    ----------
    windowed : set of str
        Blocks that handle a whole window at its start; the others run at their own ticks in it.
    rewinds : bool
        Whether windows are run as if nothing came back, and undone if something did.
    cut_edges : set of (source, target)
        Over which something may come back.
    slow : dict
        Where blocks run scan by scan that others keep from looking ahead: which are the reason, and
        why each.
    queues : dict
        Shared processors that serve a window at once, and the blocks that line up at each.
    ahead : set of str
        Blocks that no loop leads to: what comes back is nothing to them, and they run ahead in
        longer windows.
    """

    windowed: set[str]
    rewinds: bool
    cut_edges: set[tuple[str, str]]
    slow: dict[str, str]
    queues: dict[str, list[str]] = field(default_factory=dict)
    ahead: set[str] = field(default_factory=set)

    def window_handling_order(self, scene: Scene, first: Collection[str] = ()) -> dict[str, int]:
        """Return block or queue → its place in order of handling a window (`window_order`)."""
        return window_order(scene.graph, self.windowed, self.cut_edges, self.queues, first)


def choose_grain(scene: Scene, window: int | None) -> Grain:
    """Return which blocks run in windows or scan by scan; `window` is as for `Simulation`.

    Loops run in windows: as long as an open loop's, which are undone if something came back, where
    all blocks let themselves be rewound; else no longer than what is sent takes to come back.
    """
    if window == 1:
        return Grain(set(), False, set(), {})
    slow: dict[str, str] = {}
    if loop_number_by_block(scene.graph):
        slow, opened, every = (
            _blocks_without_windows(scene),
            longest_delay_cut_edges(scene),
            set(scene.blocks),
        )
        # Who looks ahead of a run's end must not fail there.
        ending = any(may_end_its_run(cls) for cls in scene.classes.values())
        ahead = blocks_not_behind_loops(scene.graph)
        if not slow and all(cls.rewindable for cls in scene.classes.values()):
            return Grain(every, True, loop_cut_edges(scene.graph, scene.classes), {}, ahead=ahead)
        slow = slow or _explain_fast_feedback(scene, opened)
        if not slow:
            return Grain(every, False, opened, {}, ahead=set() if ending else ahead)
    queues = {
        name: scene.blocks_by_shared_processor[name] for name in sorted(windowed_queues(scene))
    }
    windowed = windowed_blocks(scene, queues)
    return Grain(
        windowed, False, set(), slow or _blocks_that_prevent_windows(scene, windowed), queues
    )


def blocks_held_back_from_windows(scene: Scene, windowed: Collection[str]) -> list[str]:
    """Return, sorted, the blocks that could run in windows but do not because of other blocks."""
    classes = scene.classes
    return sorted(n for n in scene.blocks if _can_take_windows(classes[n]) and n not in windowed)


def _blocks_that_prevent_windows(scene: Scene, windowed: Collection[str]) -> dict[str, str]:
    """Return block → reason, for blocks that run scan by scan and make those they feed do so."""
    kept = set(blocks_held_back_from_windows(scene, windowed))
    return {
        name: why
        for name, why in _blocks_without_windows(scene).items()
        if name not in windowed
        and not _can_take_windows(scene.classes[name])
        and kept & nx.descendants(scene.graph, name)
    }


def _can_take_windows(cls: type[Component]) -> bool:
    return cls.windowed and cls.process is None


# A window of about this many target-scans keeps NumPy's calls long and its arrays in cache.
CELLS_PER_WINDOW = 131072


def scans_per_run(nodes: Mapping[str, Node], runs: Runs) -> float:
    """Return about how many scans each run has, summed over all clocks."""
    return float(sum(runs.run_ticks / clock.period for clock in _clocks(nodes.values())))


def refuse_endless_work(scene: Scene, scans: float, duration_s: float) -> None:
    """Raise SceneError if a run has more scans than are ever simulated."""
    if scans > MOST_SCANS:
        message = (
            f"is {duration_s:.4g} s, in which the clocks of this scene make "
            f"{scans:.2g} scans: at most {MOST_SCANS:.0e} are simulated"
        )
        raise SceneError([scene.problem("duration_s", message)])


def window_length_ticks(nodes: Mapping[str, Node], runs: Runs, window: int | None) -> int:
    """Return the length of a window, in ticks, that holds about the wanted number of scans.

    `window` are scans of all clocks together; by default, and where blocks run scan by scan anyway,
    as many as make a window of `CELLS_PER_WINDOW`.
    """
    components = [node.component for node in nodes.values()]
    width = max(1, *(component.width for component in components))
    if runs.count == 1:  # which may be long
        width = max(width, *(component.least_width for component in components))
    scans = window if window not in (None, 1) else max(1, CELLS_PER_WINDOW // width)
    per_tick = sum((1 / clock.period for clock in _clocks(nodes.values())), Fraction(0))
    return max(1, int(scans / per_tick)) if per_tick else runs.run_ticks


def _clocks(nodes: Iterable[Node]) -> list[RunClock]:
    return [node.clock for node in nodes if node.clock is not None]
