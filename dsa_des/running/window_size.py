"""How many scans a run has, and how long its look-ahead windows are."""

from collections.abc import Iterable, Mapping
from fractions import Fraction

from dsa_des.errors import SceneError
from dsa_des.errors.budgets import MOST_SCANS
from dsa_des.running.node import Node
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import ScanClock
from dsa_des.time.timeline import ReplicaTime

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
