"""The true flights of a run as ``.daa`` and ``.xyz``, at even steps of time."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables
from components.flights.sampled_flight import SampledTrajectory
from components.geometry import east_north_up_axes, line_of_sight_ned
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import UsageError

#: Of the rows of a file, unless something else is asked for.
STEP_S = 1.0
_SAME = 1e-7
_DAA_HEAD = (
    "NAME, lat, lon, alt, trk, gs, vs, heading, time",
    "[], [deg], [deg], [m], [deg], [m/s], [m/s], [deg], [s]",
)
_XYZ_HEAD = (
    "NAME, sx, sy, sz, vx, vy, vz, heading, time",
    "[], [m], [m], [m], [m/s], [m/s], [m/s], [deg], [s]",
)


def daa_text(run: RecordedTables, step_s: float = STEP_S) -> str:
    """Return true flights as `.daa` text in order of time, as DAIDALUS and `traffic.daa_file` read.

    The ownship comes first; a name that such a file cannot hold is refused. Rows are at multiples
    of `step_s` while an aircraft flies, with 0 at the instants that were recorded: a run records
    every scan, and scans of several sensors are not at even steps.
    """

    def columns(flight: Mapping[str, FloatArray]) -> list[FloatArray]:
        north, east = flight["velocity_north_m_s"], flight["velocity_east_m_s"]
        return [
            flight["lat_deg"], flight["lon_deg"], flight["alt_m"],
            np.degrees(np.arctan2(east, north)) % 360.0, np.hypot(north, east),
            -flight["velocity_down_m_s"], np.degrees(flight["heading_rad"]) % 360.0,
        ]  # fmt: skip

    return "\n".join([*_DAA_HEAD, *_text_rows(run, step_s, columns)]) + "\n"


def xyz_text(run: RecordedTables, step_s: float = STEP_S) -> str:
    """Return true flights as the text of a `.xyz` file: east, north of a point and altitude (m).

    The point is where the ownship is first, at altitude 0; a comment says it. `read_daa` with that
    reference gives the flights again. Steps are those of `daa_text`.
    """
    own = next(iter(run.true_flights().values()))
    lat, lon = float(own["lat_deg"][0]), float(own["lon_deg"][0])
    there = east_north_up_axes(np.array([lat]), np.array([lon]))

    def columns(flight: Mapping[str, FloatArray]) -> list[FloatArray]:
        position = flight["lat_deg"], flight["lon_deg"]
        here = east_north_up_axes(*position)
        # Altitudes stay what they are; east and north are those of the point of the tangent plane's
        # frame that lies so high above the plane, straight above or below the place.
        _, _, down = line_of_sight_ned(lat, lon, 0.0, *position, np.zeros_like(position[0]))
        height = (flight["alt_m"] + down) / _dot(here[2], there[2])
        north, east, _ = line_of_sight_ned(lat, lon, 0.0, *position, height)
        moves = (
            flight["velocity_east_m_s"], flight["velocity_north_m_s"], -flight["velocity_down_m_s"],
        )  # fmt: skip
        earth = [sum(v * axis[i] for v, axis in zip(moves, here, strict=True)) for i in range(3)]
        # The heading whose line above the plane, seen along the aircraft's own horizon, is its own.
        s, c = np.sin(flight["heading_rad"]), np.cos(flight["heading_rad"])
        nose = np.arctan2(
            s * _dot(here[1], there[1]) - c * _dot(here[0], there[1]),
            c * _dot(here[0], there[0]) - s * _dot(here[1], there[0]),
        )
        along = [_dot(earth, axis) for axis in there]
        return [east, north, flight["alt_m"], *along, np.degrees(nose) % 360.0]

    head = f"# reference point: lat {lat!r} deg, lon {lon!r} deg, alt 0 m"
    return "\n".join([head, *_XYZ_HEAD, *_text_rows(run, step_s, columns)]) + "\n"


def _resample(name: str, flight: Mapping[str, FloatArray], step_s: float) -> dict[str, FloatArray]:
    """Return a flight at multiples of a step, by cubics through recorded positions, velocities.

    Velocities are straight between those of the neighbours.
    """
    first, last = (float(flight["time_s"][end]) / step_s for end in (0, -1))
    # A recorded instant may differ in its last digit from the multiple that it is.
    numbers = np.arange(math.ceil(first - _SAME), math.floor(last + _SAME) + 1)
    time_s = np.round(numbers * step_s, 9)
    if len(time_s) == 0:
        return {key: values[:0] for key, values in flight.items()}
    within = np.clip(time_s, *flight["time_s"][[0, -1]])
    state = SampledTrajectory(
        name, flight["time_s"], flight["lat_deg"], flight["lon_deg"], flight["alt_m"],
        velocity_enu_mps=(
            flight["velocity_east_m_s"], flight["velocity_north_m_s"],
            -flight["velocity_down_m_s"],
        ),
        yaw_rad=flight["heading_rad"], pitch_rad=flight["pitch_rad"], roll_rad=flight["roll_rad"],
    ).at(within)  # fmt: skip
    velocity = {
        key: np.interp(within, flight["time_s"], flight[key])
        for key in ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s")
    }
    return {
        "time_s": time_s, "lat_deg": state.lat_deg, "lon_deg": state.lon_deg,
        "alt_m": state.alt_m, "heading_rad": state.yaw_rad, **velocity,
    }  # fmt: skip


def _dot(one: Sequence[Any], other: Sequence[Any]) -> Any:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _text_rows(
    run: RecordedTables,
    step_s: float,
    columns: Callable[[Mapping[str, FloatArray]], Sequence[FloatArray]],
) -> list[str]:
    """Return a line per aircraft and time, in order of time: name, columns of its flight, time."""
    rows: list[tuple[float, int, str]] = []
    for number, (name, flight) in enumerate(run.true_flights().items()):
        if any(c in name for c in ",;\t\n\r ") or not name:
            raise UsageError(f"{run.folder}: the name {name!r} holds what separates cells: rename")
        if step_s:
            flight = _resample(name, flight, step_s)
        if number == 0 and len(flight["time_s"]) == 0:
            raise UsageError(
                f"{run.folder}: --step-s {step_s:g}: the ownship flies at no multiple of it: give "
                "a shorter one, or 0 for the recorded instants"
            )
        made = (*columns(flight), flight["time_s"])
        for cells in zip(*(column.tolist() for column in made), strict=True):
            text = ", ".join([name, *(repr(cell) for cell in cells)])
            rows.append((cells[-1], number, text))
    rows.sort(key=lambda row: row[:2])
    return [text for _, _, text in rows]
