"""From the blocks and wires of a scene to running blocks with channels between them."""

import random
from collections.abc import Callable, Collection, Mapping, Sequence

import simpy

from dsa_des.block.component import Component, may_end_its_run
from dsa_des.block.message import Message
from dsa_des.errors import SceneError
from dsa_des.running.events import DEPTH_PRIORITY, WINDOW_PRIORITY, RunState
from dsa_des.running.grain import Grain
from dsa_des.running.loops import Edge
from dsa_des.running.node import Node
from dsa_des.running.processors import Processor, Service
from dsa_des.running.timeline import Timeline
from dsa_des.running.windows import Demand
from dsa_des.scene.graph import block_depths, queue_node_name
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.time.clock import MAX_TICK
from dsa_des.time.randomness import Streams


def build_nodes(
    run: RunState,
    timeline: Timeline,
    stretches: Sequence[Mapping[str, Component]],
    grain: Grain,
    processors: Mapping[str, Processor],
    shuffle_ties: int | None,
) -> dict[str, Node]:
    """Return name → node running the block, for all blocks of a scene; wires not connected yet."""
    scene, components = timeline.scene, stretches[0]
    # Who ends runs comes before all that it does not depend on: that is not run beyond the end.
    ending = [name for name, block in components.items() if may_end_its_run(type(block))]
    depth, order = block_depths(scene.graph, ending), grain.window_handling_order(scene, ending)
    shuffle = None if shuffle_ties is None else random.Random(shuffle_ties)
    nodes = {}
    for number, (name, component) in enumerate(sorted(components.items())):
        windowed = name in grain.windowed
        base = WINDOW_PRIORITY + order[name] if windowed else DEPTH_PRIORITY + depth[name]
        by_name = base + number / (len(components) + 1)
        node = Node(run, component, windowed, _make_priority(base, by_name, shuffle))
        node.runner = timeline.runner(component)
        node.stretched = timeline.block_switching_by_stretch([of[name] for of in stretches])
        node.clock = timeline.clock(name, component)
        node.pulse = timeline.periodic_wake_clock(component)
        node.processor = processors.get(scene.blocks[name].options.processor or "")
        node.ahead = name in grain.ahead
        node.outages = timeline.outages(name)
        node.on_demand = component.clocked == "demand" and node.clock is None
        nodes[name] = node
    return nodes


def build_processors(
    timeline: Timeline,
    grain: Grain,
    env: simpy.Environment,
    record: Callable[[str, Message], None],
) -> dict[str, Processor]:
    """Return name → shared processor, for those of a scene.

    A `SceneError` says which parameters make no sense.
    """
    scene = timeline.scene
    streams = Streams(scene.seed)
    order = grain.window_handling_order(scene)
    ticks_per_s = scene.ticks_per_s
    processors: dict[str, Processor] = {}
    for name, p in scene.processors.items():
        try:
            of_stretches = [p, *(one.scene.processors[name] for one in scene.stretches)]
            draws = streams.stream(name, "service time")
            service = Service(name, of_stretches, timeline.stretch_start_ticks, ticks_per_s, draws)
        except ValueError as error:
            raise SceneError([scene.problem("processors", str(error))]) from error
        at_once = WINDOW_PRIORITY + order[queue_node_name(name)] if name in grain.queues else None
        processors[name] = Processor(name, p, service, env, ticks_per_s, record, at_once)
    return processors


def _make_priority(
    base: float, by_name: float, shuffle: random.Random | None
) -> Callable[[], float]:
    if shuffle is None:
        return lambda: by_name
    return lambda: base + shuffle.random()


def connect_nodes(scene: Scene, nodes: Mapping[str, Node], timeline: Timeline) -> None:
    """Make a channel for every wire, and tell each node which blocks' scans need its rows.

    A `SceneError` says which delay makes no sense, or which block that runs on demand has nobody to
    demand anything.
    """
    of_stretches = [scene.wires, *(stretch.scene.wires for stretch in scene.stretches)]
    for wires in zip(*of_stretches, strict=True):
        wire = wires[0]
        channel = timeline.channel_of_wire(wires, _scan_delay_ticks(scene, wire, nodes))
        if isinstance(wire.holds, dict):
            declared = nodes[wire.target].component.inputs[wire.input].message
            channel.set_held_message(declared.make_initial(wire.holds), 0)
        target = nodes[wire.target]
        carrying = target.component.context.platform
        if carrying in nodes[wire.source].component.platforms():
            channel.platform = carrying
        target.channels.setdefault(wire.input, []).append(channel)
        nodes[wire.source].subscribers.setdefault(wire.output, []).append(
            (channel, target, wire.input)
        )
    for wires in zip(*of_stretches, strict=True):
        if len({wire.total_delay_s for wire in wires}) > 1 and _carries_demanded_rows(
            nodes, wires[0]
        ):
            message = (
                f"{wires[0]}: its delay cannot change while a run lasts: {wires[0].source} runs on "
                "demand, ahead of scans by so much"
            )
            raise SceneError([scene.problem("changes", message)])
    for name, node in nodes.items():
        node.demands = demands_of_clocks_downstream(nodes, name)
        if node.on_demand and not node.demands:
            message = "runs when blocks downstream scan, and none of them has a scan clock"
            raise SceneError([scene.problem(f"blocks.{name}", message)])


def demands_of_clocks_downstream(nodes: Mapping[str, Node], name: str) -> list[Demand]:
    """Return the nearest blocks with scan clocks on each path downstream, and the delay to each.

    What comes back to it around a loop asks nothing new of it: each turn would, one delay earlier.
    """
    demands: dict[tuple[str, int], Demand] = {}
    seen = {(name, 0)}
    todo = [(name, 0)]
    while todo:
        block, lead = todo.pop()
        for channel, node, _ in (
            item for items in nodes[block].subscribers.values() for item in items
        ):
            reached = (node.name, lead + channel.delay_ticks)
            if node.clock is not None:
                demands[reached] = Demand(node.name, node.clock, reached[1])
            elif node.name != name and reached not in seen and len(seen) < 1000:
                seen.add(reached)
                todo.append(reached)
    return [demands[key] for key in sorted(demands)]


def _carries_demanded_rows(nodes: Mapping[str, Node], wire: Wire) -> bool:
    """Return whether a wire carries an on-demand block's rows that a downstream scan needs."""
    target, todo, seen = nodes[wire.target], [wire.source], {wire.source}
    if target.clock is None and not demands_of_clocks_downstream(nodes, wire.target):
        return False
    while todo:
        node = nodes[todo.pop()]
        if node.on_demand:
            return True
        before = {channel.source for channel in node.wires} - seen if node.clock is None else set()
        seen |= before
        todo += before
    return False


def shortest_delay_ticks(nodes: Mapping[str, Node], opened: Collection[Edge]) -> int | None:
    """Return the shortest delay of the wires over some edges, in ticks; None if there are none."""
    delays = (
        channel.delay_ticks
        for name, node in nodes.items()
        for channel in node.wires
        if (channel.source, name) in opened
    )
    return min(delays, default=None)


def check_latest_arrival_fits(scene: Scene, nodes: Mapping[str, Node], run_ticks: int) -> None:
    """Raise SceneError if a message could arrive at an instant beyond the range of 64-bit ticks."""
    delays = sum(channel.delay_ticks for node in nodes.values() for channel in node.wires)
    jitter = sum(round(wire.jitter_s * scene.ticks_per_s) for wire in scene.wires)
    if run_ticks + delays + jitter >= MAX_TICK:
        longest_s = MAX_TICK / scene.ticks_per_s
        message = (
            f"the run lasts {run_ticks / scene.ticks_per_s:.4g} s and the wires take up to "
            f"{(delays + jitter) / scene.ticks_per_s:.4g} s: this scene's ticks reach "
            f"{longest_s:.4g} s"
        )
        raise SceneError([scene.problem("duration_s", message)])


def _scan_delay_ticks(scene: Scene, wire: Wire, nodes: Mapping[str, Node]) -> int:
    if not wire.delay_scans:
        return 0
    clock = nodes[wire.target].clock or nodes[wire.source].clock
    if clock is None:
        message = f"{wire}: a delay in scans needs a scan clock at one of its ends"
        raise SceneError([scene.problem("wires", message)])
    if clock.changes:
        message = f"{wire}: a delay in scans needs a scan clock that does not change"
        raise SceneError([scene.problem("changes", message)])
    # Rounded down: a message must not arrive a tick after the scan it was sent for.
    delay = wire.delay_scans * int(clock.period)
    if delay >= MAX_TICK:
        message = (
            f"{wire}: {wire.delay_scans} scans take longer than this scene's ticks reach, "
            f"{MAX_TICK / scene.ticks_per_s:.4g} s"
        )
        raise SceneError([scene.problem("wires", message)])
    return delay
