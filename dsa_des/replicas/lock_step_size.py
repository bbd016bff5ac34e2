"""How many runs a lock step holds: as many as memory does, and what is recorded of them."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene

#: Bytes that runs which run together hold, about: while they do, and then while they are measured.
#: A feedback loop goes through as many windows whatever they hold: with these they take an eighth
#: of the time.
MOST_BYTES = 360e6
# What a run holds of each aircraft: tracks and tables whatever it is, samples, what a scan makes.
# 25 to 84 kB were measured of two in four loops of 120 and 180 s and 360 to 3240 scans; of nine
# 106 to 341 kB in 120 s and 600 scans, and of eight platforms 280 kB in 250 s and 2250 scans.
_BYTES, _BYTES_PER_S, _BYTES_PER_SCAN = 12.5e3, 137.5, 12.5
#: How often what is recorded is there: as it came, in order, and some of it as a metric has it.
_COPIES = 2.4
#: So few runs are together whatever they hold, where two aircraft hold little of the limit.
FEW = 64
_SMALL_SHARE = 0.02
_A_LONG_RUN_S = 3600.0


@dataclass(frozen=True)
class RunSize:
    """How many bytes a run needs while it lasts, and how many are recorded of it."""

    held: float
    recorded: float = 0.0

    @classmethod
    def estimate(cls, scene: Scene, wanted: Mapping[str, Collection[str]]) -> "RunSize":
        """Return the estimated size of the scene's run, recording the `wanted` columns.

        Of these there is hardly more than a row of every target at every scan, or one of them all
        where a table has no targets. What is wrong with the scene is raised.
        """
        simulation = Simulation(scene)
        components = simulation.components.values()
        targets = max(1, *(component.width for component in components))
        held = _estimate_held_bytes(float(simulation.duration_s), simulation.scans, 1 + targets)
        sent = [output.message for of in components for output in of.outputs.values()]
        of_no_target = {message.row_table for message in sent}
        columns = sum(
            len(some) * (1 if table in of_no_target else targets) for table, some in wanted.items()
        )
        return cls(held, 8.0 * columns * simulation.scans)

    @property
    def largest_run_count(self) -> int:
        """The number of such runs that fit into memory in one lock-step simulation."""
        return max(1, int(MOST_BYTES / max(self.held, _COPIES * self.recorded)))


def surely_fit_in_memory(scene: Scene, runs: int) -> bool:
    """Return whether so many runs surely fit into memory: at most a hundred short ones."""
    specs = [block.cls.clock_of(block.parameters) for block in scene.blocks.values()]
    per_s = float(sum(spec.rate_hz for spec in specs if spec is not None))
    duration_s = float(scene.duration_s or _A_LONG_RUN_S)
    held = runs * _estimate_held_bytes(duration_s, per_s * duration_s, 2)
    return runs <= FEW and held <= _SMALL_SHARE * MOST_BYTES


def _estimate_held_bytes(duration_s: float, scans: float, aircraft: int) -> float:
    return aircraft * (_BYTES + _BYTES_PER_S * duration_s + _BYTES_PER_SCAN * scans)
