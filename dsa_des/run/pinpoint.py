"""Finding the instant at which a block failed inside a look-ahead window.

A block that handles a window at a time says only that something in the window went wrong. Draws
and scheduling are reproducible, so the run is repeated without recording, with the window cut at
the instants in question, until the failing call holds a single one.
"""

from dsa_des.arrays.types import IntArray
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.scene.scene import Scene


def pinpoint(scene: Scene, window: int | None, ticks: IntArray) -> BlockFailure | None:
    """Return the first failure of the scene with its exact instant, or None if it won't repeat.

    Parameters
    ----------
    scene : Scene
    window : int, optional
        As given to the run that failed.
    ticks : ndarray of int64
        The instants of the call that failed.
    """
    from dsa_des.run.simulation import Simulation

    cuts: set[int] = set()
    while not cuts.issuperset(ticks.tolist()):
        cuts.update(ticks.tolist())
        try:
            again = Simulation(scene, window=window, cuts=cuts)
        except (SceneError, BlockFailure):
            return None
        try:
            again.run()
        except BlockFailure as failure:
            if len(again.failed_at) <= 1:
                return failure
            ticks = again.failed_at
        else:
            return None
    return None
