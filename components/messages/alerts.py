"""The messages of alerting: the alert level of each target, and the bands of guidance."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import target_name_of_each_entry
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Producer
from dsa_des.block.message import Column, Message, Text, column, columns, per_entry, per_row, static

#: Most levels of an alerter whose times are recorded.
MOST_LEVELS = 4
#: A tracker's own numbers stand above those of the scene's targets, where both name contacts.
TRACKS_FROM = 1_000_000
_TIMES = {
    f"time_to_level_{level}_s": Column(
        "s", "", f"time to the volume of level {level} in straight flight, 0 inside; null where "
        "it is not met within the lookahead",
    )
    for level in range(1, MOST_LEVELS + 1)
}  # fmt: skip
_TRACK = {
    "track": Column("", "", "the tracker's number, from 1; 0 where tracks have none", "int64"),
    "track_age_s": Column("s", "", "time since the last measurement of that track, if it has one"),
}


@dataclass(eq=False)
class AlertLevels(Message):
    """Alert levels of targets, at each instant at which the alerting looks at them.

    Parameters
    ----------
    target : (entries,) of int
        Index into the roster, -1 for none: of a tracker's states the target that they are nearest
        to, for evaluation.
    times, numbers : dict of (entries,)
        Columns that are recorded where they are known: NaN is a level that is not met within the
        lookahead; ``track`` is the tracker's own number, and ``track_age_s`` how old its last
        measurement is.
    deviations : dict of (entries,)
        Standard deviations of the state, where they are known: ``position_m``, ``height_m``,
        ``velocity_mps``, ``climb_mps``.
    relative : dict of (entries,)
        What the levels rest on, ownship less target: ``east_m``, ``north_m``, ``up_m`` and
        ``east_mps``, ``north_mps``, ``climb_mps``.
    own_motion : dict of (rows,)
        The ownship's ``alt_m``, ``east_mps``, ``north_mps``, ``climb_mps``; NaN where unknown yet.
    """

    entry_table = "alerts"

    offsets: IntArray
    target: IntArray = column(
        "", "", "name of the target; of a track, the nearest one, null if far from all", "text",
        value=target_name_of_each_entry,
    )  # fmt: skip
    level: IntArray = column("", "", "alert level, 0 without an alert", "int64")
    times: dict[str, FloatArray] = columns(_TIMES)
    time_to_closest_s: FloatArray = column(
        "s", "", "time to the horizontal closest approach, 0 if past"
    )
    closest_horizontal_m: FloatArray = column("m", "", "projected horizontal distance there")
    closest_vertical_m: FloatArray = column("m", "", "projected least difference in height")
    numbers: dict[str, AnyArray] = columns(_TRACK)
    deviations: dict[str, FloatArray] = per_entry()
    relative: dict[str, FloatArray] = per_entry()
    own_motion: dict[str, FloatArray] = per_row()
    roster: Roster = static()
    #: Whether lengths are those of the plane of `east_north_m`, not of the ground.
    in_plane: bool = static(default=False, kw_only=True)

    def highest_levels(self) -> IntArray:
        """Return the highest alert level in each row, 0 in rows without entries, (rows,)."""
        levels = np.zeros(len(self), dtype=np.int64)
        np.maximum.at(levels, self.row_of_entries, self.level)
        return levels

    def contact_numbers(self) -> IntArray:
        """Return each entry's contact number, (entries,).

        The index of the target; where a tracker's states are believed, which know no targets,
        `TRACKS_FROM` and the track's number.
        """
        return TRACKS_FROM + self.numbers["track"] if "track" in self.numbers else self.target


def contact_name(names: tuple[str, ...], contact: int) -> str | None:
    """Return the target's name, or `track 7` for a track; empty for -1, None if unknown."""
    if contact >= TRACKS_FROM:
        return f"track {contact - TRACKS_FROM}"
    if contact < 0:
        return ""
    return names[contact] if contact < len(names) else None


class AlertsOffered(NamedTuple):
    """How many alert levels a block sends, and the time between its scans."""

    levels: int  # Of the alerter, which is the highest that may come
    period_s: float  # Between its scans


def unreached_level_notes(key: str, level: int, producers: Iterable[Producer]) -> list[str]:
    """Return a list of one sentence if a key asks for a level no producer sends, else empty."""
    offered = [p.offer.levels for p in producers if isinstance(p.offer, AlertsOffered)]
    if not offered or level <= max(offered):
        return []
    return [f"{key} is {level}: the alerts it gets have {max(offered)} levels, so it does nothing"]


#: What bands are of, and the regions they are painted with.
BAND_KINDS = ("direction", "altitude", "speed")
BAND_REGIONS = ("NONE", "FAR", "MID", "NEAR", "RECOVERY", "UNKNOWN")


@dataclass(eq=False)
class GuidanceBands(Message):
    """Bands of guidance at each instant with an alert; stretches that are clear are left out.

    Band and region are indices into `BAND_KINDS` and `BAND_REGIONS`; the bounds (radians, metres,
    m/s) are NaN in bands of another kind.
    """

    entry_table = "bands"

    offsets: IntArray
    band: IntArray = column(
        "", "", "direction, altitude or speed: what it is a stretch of", "text",
        value=lambda m: Text(m.band, BAND_KINDS),
    )  # fmt: skip
    region: IntArray = column(
        "", "", "FAR, MID or NEAR: whose volumes are met; RECOVERY: what leads out", "text",
        value=lambda m: Text(m.region, BAND_REGIONS),
    )  # fmt: skip
    low_rad: FloatArray = column(
        "rad", "", "direction over the ground from north at which it begins"
    )
    high_rad: FloatArray = column("rad", "", "direction, clockwise, at which it ends")
    low_m: FloatArray = column("m", "", "altitude at which it begins")
    high_m: FloatArray = column("m", "", "altitude at which it ends")
    low_mps: FloatArray = column("m/s", "", "speed over the ground at which it begins")
    high_mps: FloatArray = column("m/s", "", "speed over the ground at which it ends")
