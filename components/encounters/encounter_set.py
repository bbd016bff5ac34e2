"""Sets of encounters as arrays: who flies where in each of thousands, and what each weighs.

An aircraft is a row; rows of an encounter stand together, the ownship's first. A row holds either
an initial state and *events* (climb, turn and acceleration, held from an instant on), or a sampled
*track*. Lists of all rows lie end to end in flat arrays, cut by `starts`.
"""

from dataclasses import dataclass, field

import numpy as np

from components.encounters.motion import fly_euler, fly_point_mass
from components.geometry.enu import enu_to_geodetic
from components.traffic.trajectory import SampledTrajectory
from components.well_clear.volume import FOOT_M
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.errors import nearest

EVENTS, TRACKS = "events", "tracks"
STATE = ("north_m", "east_m", "altitude_m", "speed_mps", "heading_rad", "duration_s")
LISTS = {
    EVENTS: ("time_s", "climb_mps", "turn_rad_s", "acceleration_mps2"),
    TRACKS: ("time_s", "north_m", "east_m", "altitude_m"),
}
DYNAMICS = ("euler", "point_mass")


class NoSuchEncounter(ValueError):
    """A set holds no encounter of that number."""


@dataclass(frozen=True)
class EncounterSet:
    """Encounters; arrays over encounters (n), over aircraft (rows) and over list entries.

    Parameters
    ----------
    source : str
        The file, for messages.
    kind : {"events", "tracks"}
    numbers : (n,)
        Rising.
    weights : (n,)
    first_rows : (n + 1,)
        The rows of encounter k are ``first_rows[k]`` up to ``first_rows[k + 1]``.
    names : tuple of str
        Of the aircraft, (rows,).
    state : dict of str to (rows,)
        Of events: `STATE`.
    starts : (rows + 1,)
        Where the lists of each row begin.
    lists : dict of str to (entries,)
        `LISTS`.
    reference_deg : (latitude, longitude)
        Where the origin is put; altitudes are above the ellipsoid.
    extra : dict of str to (n,)
        Geometry and classes of encounters, as far as the file gives them.
    skipped : int
        Damaged encounters that were left out.
    """

    source: str
    kind: str
    numbers: IntArray
    weights: FloatArray
    first_rows: IntArray
    names: tuple[str, ...]
    state: dict[str, FloatArray]
    starts: IntArray
    lists: dict[str, FloatArray]
    reference_deg: tuple[float, float] = (0.0, 0.0)
    extra: dict[str, AnyArray] = field(default_factory=dict)
    skipped: int = 0

    def __len__(self) -> int:
        return len(self.numbers)

    def place(self, number: int) -> int:
        """Return where an encounter stands.

        Raises
        ------
        NoSuchEncounter
        """
        at = int(np.searchsorted(self.numbers, number))
        if at < len(self) and self.numbers[at] == number:
            return at
        close = nearest(str(number), [str(n) for n in self.numbers[:2000]])
        hint = f"; did you mean {close}?" if close else ""
        raise NoSuchEncounter(
            f"{self.source}: there is no encounter {number}; it holds {len(self)}, numbered from "
            f"{self.numbers[0]} to {self.numbers[-1]}{hint}"
        )

    def flights(self, place: int, dynamics: str = "euler") -> list[SampledTrajectory]:
        """Return the flights of one encounter, the ownship's first.

        Parameters
        ----------
        place : int
            Of the encounter, from 0.
        dynamics : {"euler", "point_mass"}
            How events are flown.
        """
        rows = range(self.first_rows[place], self.first_rows[place + 1])
        found = []
        for row in rows:
            time_s, north, east, altitude = self.path(row, dynamics)
            lat, lon, _ = enu_to_geodetic(
                east,
                north,
                0.0,
                reference_lat_deg=self.reference_deg[0],
                reference_lon_deg=self.reference_deg[1],
                reference_alt_m=0.0,
            )
            found.append(SampledTrajectory(self.names[row], time_s, lat, lon, altitude))
        return found

    def path(
        self, row: int, dynamics: str = "euler"
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return time (s), north, east and altitude (m) along the path of one aircraft."""
        entries = slice(int(self.starts[row]), int(self.starts[row + 1]))
        lists = {name: values[entries] for name, values in self.lists.items()}
        if self.kind == TRACKS:
            return lists["time_s"], lists["north_m"], lists["east_m"], lists["altitude_m"]
        one = {name: float(values[row]) for name, values in self.state.items()}
        seconds = int(np.ceil(one["duration_s"]))
        at = np.searchsorted(lists["time_s"], np.arange(seconds + 1.0), side="right") - 1
        feet = {
            "acceleration_ft_s2": lists["acceleration_mps2"][at, np.newaxis] / FOOT_M,
            "climb_ft_s": lists["climb_mps"][at, np.newaxis] / FOOT_M,
            "turn_rad_s": lists["turn_rad_s"][at, np.newaxis],
        }
        fly = {"euler": fly_euler, "point_mass": fly_point_mass}[dynamics]
        flown = fly(
            np.array([one["altitude_m"] / FOOT_M]),
            np.array([one["speed_mps"] / FOOT_M]),
            **feet,
            start_heading_rad=one["heading_rad"],
        )
        time_s: FloatArray = np.arange(float(len(flown.up_ft))) * flown.step_s
        return (
            time_s,
            one["north_m"] + flown.north_ft[:, 0] * FOOT_M,
            one["east_m"] + flown.east_ft[:, 0] * FOOT_M,
            flown.up_ft[:, 0] * FOOT_M,
        )
