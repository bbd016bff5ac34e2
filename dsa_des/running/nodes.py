"""The running blocks of a simulation: each with its place in an instant, clock and processor."""

import random
from collections.abc import Callable, Mapping

import simpy

from dsa_des.block.component import Component
from dsa_des.block.message import Message
from dsa_des.block.run_end import ends_its_run
from dsa_des.errors import SceneError
from dsa_des.running.grain import Grain
from dsa_des.running.node import DEPTH_PRIORITY, WINDOW_PRIORITY, Node
from dsa_des.running.processors import Processor, Service
from dsa_des.running.run_state import RunState
from dsa_des.running.timeline import Timeline
from dsa_des.running.windowed_queue import WindowedQueue
from dsa_des.scene.graph import depths, queue_key
from dsa_des.scene.scene import Scene
from dsa_des.time.randomness import Streams


def build_nodes(
    run: RunState,
    timeline: Timeline,
    components: Mapping[str, Component],
    grain: Grain,
    processors: Mapping[str, Processor | WindowedQueue],
    shuffle_ties: int | None,
) -> dict[str, Node]:
    """Return the running blocks, which no wire connects yet.

    Parameters
    ----------
    run : RunState
    timeline : Timeline
        Has been laid.
    components : mapping
    grain : Grain
    processors : mapping
        Shared processors by name.
    shuffle_ties : int, optional
        See `Simulation`.
    """
    scene = timeline.scene
    # Who ends runs comes before all that it does not depend on: that is not run beyond the end.
    ending = [name for name, block in components.items() if ends_its_run(type(block))]
    depth, order = depths(scene.graph, ending), grain.order(scene, ending)
    shuffle = None if shuffle_ties is None else random.Random(shuffle_ties)
    nodes = {}
    for number, (name, component) in enumerate(sorted(components.items())):
        windowed = name in grain.windowed
        base = WINDOW_PRIORITY + order[name] if windowed else DEPTH_PRIORITY + depth[name]
        by_name = base + number / (len(components) + 1)
        node = Node(run, component, windowed, _priority(base, by_name, shuffle))
        node.runner = timeline.runner(component)
        node.clock = timeline.clock(name, component)
        node.processor = processors.get(scene.blocks[name].options.processor or "")
        node.ahead = name in grain.ahead
        node.on_demand = component.clocked == "demand" and node.clock is None
        nodes[name] = node
    return nodes


def start_processors(
    scene: Scene,
    grain: Grain,
    end_tick: int,
    env: simpy.Environment,
    record: Callable[[str, Message], None],
) -> dict[str, Processor | WindowedQueue]:
    """Start the shared processors of a scene: message by message, or a window at once.

    Raises
    ------
    SceneError
        If the parameters of one make no sense.
    """
    streams = Streams(scene.seed)
    order = grain.order(scene)
    ticks_per_s = scene.ticks_per_s
    processors: dict[str, Processor | WindowedQueue] = {}
    for name, p in scene.processors.items():
        try:
            service = Service(name, p, ticks_per_s, streams.stream(name, "service time"))
        except ValueError as error:
            raise SceneError([scene.problem("processors", str(error))]) from error
        if name in grain.queues:
            processors[name] = WindowedQueue(
                name,
                service,
                p.when_busy == "drop_oldest",
                env,
                ticks_per_s,
                end_tick,
                record,
                WINDOW_PRIORITY + order[queue_key(name)],
            )
        else:
            processors[name] = Processor(name, p, service, env, ticks_per_s, record)
        processors[name].start()
    return processors


def _priority(base: float, by_name: float, shuffle: random.Random | None) -> Callable[[], float]:
    if shuffle is None:
        return lambda: by_name
    return lambda: base + shuffle.random()
