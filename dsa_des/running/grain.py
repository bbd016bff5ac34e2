"""At which grain each block of a scene runs: scan by scan, in windows, or in windows rewound."""

from collections.abc import Collection
from dataclasses import dataclass, field

from dsa_des.running.loops import before_loops, cannot_rewind, cut_loops
from dsa_des.scene.graph import in_cycles, window_order
from dsa_des.scene.scene import Scene


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
