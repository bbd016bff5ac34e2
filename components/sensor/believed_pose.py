"""What the ownship believes of its own pose at each scan of a sensor."""

from typing import Any

from components.messages.columns import POSE
from components.messages.targets import RelativeTargets
from dsa_des.arrays.types import IntArray

_BELIEVED = ("lat_deg", "lon_deg", "alt_m", "yaw_rad", "pitch_rad", "roll_rad")


def believed_pose(targets: RelativeTargets, rows: IntArray) -> dict[str, Any]:
    """Return the ownship's believed pose at each scan, by field of `Detections`.

    Parameters
    ----------
    targets : RelativeTargets
    rows : (scans,) of int
        Row of `targets` at each scan.

    Returns
    -------
    dict of (scans,) arrays
        Empty where the targets came without a belief.
    """
    believed = targets.believed
    if believed is None:
        return {}
    return {field: believed[name].take(rows) for name, field in zip(_BELIEVED, POSE, strict=True)}
