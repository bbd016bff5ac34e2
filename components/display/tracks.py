"""``tracks.png``: estimated tracks with their 95 % ellipses over the true flights."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from components.geometry.ellipsoid import north_east_up
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import FloatArray
from dsa_des.record.drawing import drawing, figure_text

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation

#: Table of the tracks, and what is drawn of it.
TABLE = "state_tracks"
_COLUMNS = (
    "block", "state_s", "track", "track_status", "has_range", "north_m", "east_m", "down_m",
    "covariance_00_m2", "covariance_01_m2", "covariance_11_m2", "covariance_22_m2",
    "origin_lat_deg", "origin_lon_deg", "origin_alt_m",
)  # fmt: skip
#: Okabe and Ito's colours, as in all figures, in turn.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_FALSE = "#999999"
# Chi-square quantiles of 95 % in a plane and on a line.
_PLANE, _LINE = 5.991464547107979, 3.841458820694124
_MOST_POINTS, _ELLIPSES = 400, 8
# A track that never comes so near to any target is drawn as false.
_NEAR_M = 300.0


def draw_tracks(path: Path, simulation: "Simulation", folder: Path) -> Path | None:
    """Draw confirmed tracks that have a range, on the plan and by height.

    Parameters
    ----------
    path : Path
        The PNG to write.
    simulation : Simulation
        For the true flights.
    folder : Path
        Holds the run's tables.

    Returns
    -------
    Path or None
        None where no track was confirmed.
    """
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    source = folder / f"{TABLE}.parquet"
    if not source.exists():
        return None
    table = pq.read_table(source, columns=list(_COLUMNS))
    kept = pc.and_(table["has_range"], pc.is_in(table["track_status"], _held()))
    table = table.filter(kept)
    if table.num_rows == 0:
        return None
    columns = {name: np.asarray(table[name].to_numpy(zero_copy_only=False)) for name in _COLUMNS}
    origin = tuple(float(columns[name][0]) for name in _COLUMNS[-3:])
    flights = _flights(simulation, columns["state_s"], origin)
    with drawing(7.5, 8.0, path) as figure:
        plan, height = figure.subplots(2, 1, height_ratios=(3, 1))
        for name, (time_s, place) in flights.items():
            plan.plot(place[1] / 1e3, place[0] / 1e3, color="#000000", linewidth=0.6)
            height.plot(time_s, origin[2] - place[2], color="#000000", linewidth=0.6)
            plan.annotate(figure_text(name), (place[1][-1] / 1e3, place[0][-1] / 1e3), fontsize=7)
        false = 0
        for block in sorted(set(columns["block"].tolist())):
            mine = columns["block"] == block
            for number in np.unique(columns["track"][mine]).tolist():
                rows = np.flatnonzero(mine & (columns["track"] == number))
                rows = rows[:: max(1, len(rows) // _MOST_POINTS)]
                one = {name: columns[name][rows] for name in _COLUMNS}
                wrong = bool(flights) and _nearest(one, flights) > _NEAR_M
                false += wrong
                colour = _FALSE if wrong else _COLOURS[number % len(_COLOURS)]
                _draw_one(plan, height, one, origin[2], colour, ":" if wrong else "-")
        plan.set_aspect("equal", adjustable="datalim")
        plan.set_xlabel("east of the origin [km]")
        plan.set_ylabel("north of the origin [km]")
        plan.set_title(f"Tracks with 95 % ellipses; truth thin; {false} without a target, dotted")
        height.set_xlabel("time [s]")
        height.set_ylabel("height in the frame [m]")
        figure.tight_layout()
    return path


def _held() -> Any:
    import pyarrow as pa

    return pa.array(["confirmed", "coasted"])


def _flights(
    simulation: "Simulation", time_s: FloatArray, origin: tuple[float, ...]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return times and places, north, east, down, of every target while it is there."""
    grid = np.linspace(float(time_s.min()), float(time_s.max()), _MOST_POINTS)
    here = [np.full(len(grid), value) for value in origin]
    found = {}
    for block in simulation.components.values():
        if not isinstance(block, TrafficSource):
            continue
        for target in block.targets:
            state = target.at(grid)
            there = np.broadcast_to(state.present, grid.shape)
            place = [np.ascontiguousarray(v) for v in (state.lat_deg, state.lon_deg, state.alt_m)]
            north, east, up = north_east_up(*here, *place)
            if there.any():
                found[target.name] = grid[there], np.stack([north, east, -up])[:, there]
    return found


def _nearest(
    one: dict[str, FloatArray], flights: dict[str, tuple[FloatArray, FloatArray]]
) -> float:
    """Return how near a track comes to any target at the same time, m."""
    estimate = np.stack([one["north_m"], one["east_m"], one["down_m"]])
    return min(
        float(
            np.sqrt(
                sum(
                    (estimate[i] - np.interp(one["state_s"], time_s, place[i])) ** 2
                    for i in range(3)
                )
            ).min()
        )
        for time_s, place in flights.values()
    )


def _draw_one(
    plan: Any, height: Any, one: dict[str, FloatArray], origin_alt_m: float, colour: str, line: str
) -> None:
    east, north = one["east_m"] / 1e3, one["north_m"] / 1e3
    plan.plot(east, north, color=colour, linestyle=line, linewidth=1.2)
    above = origin_alt_m - one["down_m"]
    spread = np.sqrt(_LINE * one["covariance_22_m2"])
    height.plot(one["state_s"], above, color=colour, linestyle=line, linewidth=1.2)
    height.fill_between(
        one["state_s"], above - spread, above + spread, color=colour, alpha=0.15, linewidth=0
    )
    turn = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = np.sqrt(_PLANE) * np.stack([np.cos(turn), np.sin(turn)])
    for row in range(0, len(east), max(1, len(east) // _ELLIPSES)):
        nn, ne, ee = (one[f"covariance_{ij}_m2"][row] for ij in ("00", "01", "11"))
        edge = np.linalg.cholesky(np.array([[nn, ne], [ne, ee]])) @ circle / 1e3
        plan.plot(east[row] + edge[1], north[row] + edge[0], color=colour, linewidth=0.5)
