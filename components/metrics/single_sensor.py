"""The sensor that alone feeds the fusion, and its scans that come through, analytically."""

from dataclasses import dataclass

from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.studies.metric import recorded_by
from dsa_des.time.clock import ClockSpec


@dataclass(frozen=True)
class Feed:
    """A sensor's way to a block.

    Parameters
    ----------
    clock : ClockSpec
    through : float
        Share of its messages that the wire does not lose.
    delay_s : float
        From the scan to the arrival, wire and latency.
    """

    clock: ClockSpec
    through: float
    delay_s: float


def only_feed(scene: Scene, block: str) -> Feed | None:
    """Return the way of the one sensor that feeds a block, directly; None if there are several.

    None also where lateness is random or queues decide about it: no formula is known then.
    """
    sensors = {
        name
        for name in recorded_by(scene, "detections")
        if getattr(scene.blocks[name].parameters, "enabled", True)
    }
    wires = [wire for wire in scene.wires if wire.target == block and wire.source in sensors]
    if len(wires) != 1 or not _plain(wires[0]):
        return None
    name = wires[0].source
    clock = scene.blocks[name].cls.clock_of(scene.blocks[name].parameters)
    through = 1.0 - wires[0].drop_probability
    if clock is None or through <= 0:
        return None
    return Feed(clock, through, float(wires[0].total_delay_s))


def _plain(wire: Wire) -> bool:
    return not (wire.jitter_s or wire.queued or wire.delay_scans)
