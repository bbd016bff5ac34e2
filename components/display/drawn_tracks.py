"""What figures show of estimated tracks: their states over time, and whose they are."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from components.geometry.ellipsoid import north_east_up
from components.messages.state_tracks import COVARIANCE
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation

#: Table of the tracks.
TABLE = "state_tracks"
#: A track that never comes so near to any target is drawn as false.
NEAR_M = 300.0
STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")
_COLUMNS = (
    "block", "state_s", "track", "track_status", "has_range", "nis", "nis_freedom", *STATE,
    *_ORIGIN, *COVARIANCE.values(),
)  # fmt: skip
# Rows that are read of a table, at most; of a larger one, groups of rows spread over it.
_MOST_ROWS = 1_000_000
# Velocities are differences of positions so long apart, s.
_STEP_S = 0.02


@dataclass(frozen=True, eq=False)
class DrawnTrack:
    """One confirmed track.

    Parameters
    ----------
    block : str
    number : int
    columns : dict of (rows,)
        In order of time.
    false : bool
        Whether it never comes near any target.
    """

    block: str
    number: int
    columns: dict[str, Any]
    false: bool


class Targets:
    """Where the targets of a run are, in the frame of its tracks.

    Parameters
    ----------
    simulation : Simulation
    origin : (latitude, longitude, height)
        In deg and m.
    """

    def __init__(self, simulation: "Simulation", origin: tuple[float, ...]) -> None:
        self._origin = origin
        self._targets: list[Any] = []
        self._own: list[Any] = []
        for block in simulation.components.values():
            if isinstance(block, TrafficSource):
                self._targets += block.targets
                self._own.append(block.own)
        self.names = [target.name for target in self._targets]

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return where the targets are, (targets, 3, n), north, east, down; NaN if not there."""
        found = [self._place(target, time_s) for target in self._targets]
        return np.array(found).reshape(len(found), 3, len(time_s))

    def own(self, time_s: FloatArray) -> FloatArray:
        """Return where the ownship is, (3, n); NaN if it is not there."""
        return self._place(self._own[0], time_s)

    def states(self, time_s: FloatArray) -> FloatArray:
        """Return positions and velocities, (targets, 6, n)."""
        before = np.maximum(time_s - _STEP_S, 0.0)
        after = before + 2.0 * _STEP_S
        velocity = (self.at(after) - self.at(before)) / (2.0 * _STEP_S)
        return np.concatenate([self.at(time_s), velocity], axis=1)

    def _place(self, flight: Any, time_s: FloatArray) -> FloatArray:
        state = flight.at(time_s)
        here = [np.full(len(time_s), value) for value in self._origin]
        place = [np.ascontiguousarray(v) for v in (state.lat_deg, state.lon_deg, state.alt_m)]
        north, east, up = north_east_up(*here, *place)
        there = np.broadcast_to(state.present, time_s.shape)
        return np.where(there, np.stack([north, east, -up]), np.nan)


class DrawnTracks:
    """Confirmed tracks that have a range, and the targets.

    Parameters
    ----------
    simulation : Simulation
        For the true flights.
    columns : dict of arrays
        Of the table.
    """

    def __init__(self, simulation: "Simulation", columns: dict[str, Any]) -> None:
        self.origin = tuple(float(columns[name][0]) for name in _ORIGIN)
        self.time_s = float(columns["state_s"].min()), float(columns["state_s"].max())
        self.targets = Targets(simulation, self.origin)
        self.tracks = []
        for block in sorted(set(columns["block"].tolist())):
            mine = columns["block"] == block
            for number in np.unique(columns["track"][mine]).tolist():
                rows = np.flatnonzero(mine & (columns["track"] == number))
                one = {name: columns[name][rows] for name in _COLUMNS}
                near = distances(one, self.targets.at(one["state_s"]))
                # A comparison with nothing, as with what is not there, is false.
                false = bool(len(self.targets.names)) and not bool((near < NEAR_M).any())
                self.tracks.append(DrawnTrack(block, number, one, false))

    @classmethod
    def read(cls, simulation: "Simulation", folder: Path) -> "DrawnTracks | None":
        """Read the tracks of a run's folder; None where none was confirmed."""
        source = folder / f"{TABLE}.parquet"
        columns = _read(source) if source.exists() else None
        return None if columns is None else cls(simulation, columns)


def distances(one: dict[str, Any], place: FloatArray) -> FloatArray:
    """Return how far a track is from the targets at the same times, (targets, rows), m."""
    estimate = np.stack([one[name] for name in STATE[:3]])
    return np.asarray(np.sqrt(((place - estimate) ** 2).sum(axis=1)))


def errors_squared(one: dict[str, Any], states: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return normalised errors squared of a track to the nearest target, and where it has one.

    Parameters
    ----------
    one : dict of (rows,)
    states : (targets, 6, rows)
        Of the targets at the same times.
    """
    count = len(one["state_s"])
    if len(states) == 0:
        return np.full(count, np.nan), np.zeros(count, dtype=bool)
    apart = distances(one, states[:, :3])
    apart = np.where(np.isnan(apart), np.inf, apart)
    nearest: IntArray = apart.argmin(axis=0)
    rows = np.arange(count)
    known = apart[nearest, rows] < NEAR_M
    error = np.stack([one[name] for name in STATE]) - states[nearest, :, rows].T
    spread = np.empty((count, 6, 6))
    for (i, j), name in COVARIANCE.items():
        spread[:, i, j] = spread[:, j, i] = one[name]
    found = np.full(count, np.nan)
    solved = np.linalg.solve(spread[known], error.T[known][:, :, np.newaxis])[:, :, 0]
    found[known] = (error.T[known] * solved).sum(axis=1)
    return found, known


def _read(source: Path) -> dict[str, Any] | None:
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    file = pq.ParquetFile(source)
    groups = file.metadata.num_row_groups
    step = -(-file.metadata.num_rows // _MOST_ROWS)
    table = file.read_row_groups(list(range(0, groups, max(step, 1))), columns=list(_COLUMNS))
    held = pa.array(["confirmed", "coasted"])
    status = table["track_status"]
    if pa.types.is_dictionary(status.type):
        status = status.cast(status.type.value_type)
    table = table.filter(pc.and_(table["has_range"], pc.is_in(status, held)))
    if table.num_rows == 0:
        return None
    return {name: np.asarray(table[name].to_numpy(zero_copy_only=False)) for name in _COLUMNS}
