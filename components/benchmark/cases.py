"""The benchmark's scenes: what is run, and how long the yardstick takes part."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from components.examples import folder
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.time.randomness import Streams

SCENES = folder() / "benchmark"
CLOCKED = ("eo", "ir", "radar")


@dataclass(frozen=True)
class BenchmarkCase:
    """One line of the benchmark.

    Parameters
    ----------
    name : str
        Also the scene's file name in ``configs/benchmark``.
    what : str
        Said in the table.
    wanted : float
        The ratio to the yardstick that we want to reach.
    every : int
        The yardstick takes every so many instants (of a replica, for replicas).
    replicas : int
        0 for a single run.
    quick : tuple of str
        Overrides for ``--quick``.
    quick_replicas : int
    """

    name: str
    what: str
    wanted: float
    every: int = 1
    replicas: int = 0
    quick: tuple[str, ...] = ()
    quick_replicas: int = 0


CASES = (
    BenchmarkCase("thesis", "4 intruders, 3 sensors at 1 Hz, 1800 s", 3.0),
    BenchmarkCase("clocks", "4 intruders, 5, 20 and 2 Hz, 600 s", 2.5, every=3),
    BenchmarkCase("hundred", "100 intruders, 3 sensors at 1 Hz, 1800 s", 14.0, every=6),
    BenchmarkCase(
        "ten_thousand",
        "10,000 intruders, 3 sensors at 1 Hz, 180 s",
        20.0,
        every=30,
        quick=("duration_s=30",),
    ),
    BenchmarkCase(
        "sparse",
        "10,000 intruders, 97 % never in reach, 180 s",
        100.0,
        every=30,
        quick=("duration_s=60",),
    ),
    BenchmarkCase(
        "manoeuvres", "100 intruders, the ownship turns away every 60 s, 1800 s", 5.0, every=6
    ),
    BenchmarkCase(
        "monte_carlo",
        "1000 replicas of 120 s, 1 intruder, 5, 20 and 2 Hz",
        10.0,
        every=1,
        replicas=1000,
        quick_replicas=100,
    ),
)


def chosen(names: Sequence[str]) -> list[BenchmarkCase]:
    """Return the cases of these names, all for none.

    Raises
    ------
    UsageError
        If a name is unknown.
    """
    known = {case.name: case for case in CASES}
    for name in names:
        if name not in known:
            raise UsageError(f"there is no benchmark scene {name!r}{did_you_mean(name, known)}")
    return [known[name] for name in names] if names else list(CASES)


def scene_of(
    case: BenchmarkCase, *, quick: bool, duration_s: str | None = None, sets: tuple[str, ...] = ()
) -> Scene:
    """Load a case's scene, perhaps shortened or changed."""
    sets = (*case.quick, *sets) if quick else sets
    return load_scene(SCENES / f"{case.name}.toml", sets=sets, duration_s=duration_s)


def replicas_of(scene: Scene, count: int) -> list[Scene]:
    """Return replicas of a scene: other seeds, and random phases of the three clocks."""
    stream = Streams(scene.seed).stream("benchmark", "phase")
    found = []
    for number in range(count):
        blocks = dict(scene.blocks)
        for place, name in enumerate(CLOCKED):
            block = blocks[name]
            draw = float(stream.uniform(0, number, place))
            period_ns = int(10**9 / block.parameters.scan_rate_hz)  # type: ignore[attr-defined]
            offset_s = Fraction(int(draw * period_ns), 10**9)
            parameters = block.parameters.model_copy(update={"offset_s": offset_s})
            blocks[name] = replace(block, parameters=parameters)
        found.append(replace(scene, seed=scene.seed + 1 + number, blocks=blocks))
    return found
