"""Signs in an imported flight that no aircraft shows, and the error of units they look like."""

from collections.abc import Sequence

import numpy as np

from components.geometry.ellipsoid import line_of_sight_ned
from components.traffic.traffic_file import TrafficFile
from components.traffic.trajectory import SampledTrajectory
from dsa_des.arrays.types import FloatArray

#: Beyond any aircraft: m/s along the path and upward, m/s², and metres above the ellipsoid.
FASTEST_MPS, CLIMB_MPS, ACCELERATION_MPS2, HIGHEST_M = 1000.0, 200.0, 150.0, 25_000.0
#: No aircraft in flight is slower on the whole, but for balloons and helicopters.
_SLOWEST_MPS = 3.0
#: Shares of the run that may be missing without a word.
_MISSING = 0.02
_RADIANS = ("latitude", 1.6, "longitude", 3.2)


def suspicions(content: TrafficFile, duration_s: float) -> list[str]:
    """Return what is suspicious about the flights of a file, one sentence for each kind.

    Parameters
    ----------
    content : TrafficFile
    duration_s : float
        Of the run.
    """
    found: dict[str, list[str]] = {}
    for craft in content.aircraft:
        for what, hint in _of_one(craft):
            found.setdefault(hint, []).append(f"{craft.name}: {what}")
    lines = [f"{_few(cases)}; {hint}" for hint, cases in found.items()]
    return lines + _coverage(content, duration_s)


def _few(cases: Sequence[str]) -> str:
    more = f" (and {len(cases) - 1} more aircraft)" if len(cases) > 1 else ""
    return cases[0] + more


def _of_one(craft: SampledTrajectory) -> list[tuple[str, str]]:
    """Return (what an aircraft does, what it looks like)."""
    found: list[tuple[str, str]] = []
    highest = float(np.max(craft.alt_m))
    if highest > HIGHEST_M:
        found.append((f"it flies at {highest:,.0f} m", "are altitudes in feet read as metres?"))
    if craft.velocity_was_ignored:
        found.append(
            (
                "its velocities are not those of its path and are not used",
                "are knots read as m/s, or feet as metres?",
            )
        )
    time_s = craft.sample_times_s
    if len(time_s) < 2:
        return found
    velocity = _velocities(craft)
    speed = np.linalg.norm(velocity, axis=0)
    fastest, climb = float(speed.max()), float(np.abs(velocity[2]).max())
    if climb > CLIMB_MPS and fastest <= FASTEST_MPS:
        hint = "are altitudes in feet read as metres, or times in minutes as seconds?"
        found.append((f"it climbs or sinks at {climb:,.0f} m/s", hint))
    if fastest > FASTEST_MPS:
        what = f"its positions imply {fastest:,.0f} m/s"
        found.append((what, _fast_hint(float(np.median(speed)))))
    elif len(time_s) > 2:
        change = np.linalg.norm(np.diff(velocity, axis=1), axis=0)
        per_s2 = change / (0.5 * (time_s[2:] - time_s[:-2]))
        sharpest = float(per_s2.max())
        if sharpest > ACCELERATION_MPS2:
            hint = "are times rounded, positions of two aircraft mixed, or feet read as metres?"
            found.append((f"its positions imply {sharpest:,.0f} m/s²", hint))
    _, most_lat, _, most_lon = _RADIANS
    near_zero = np.abs(craft.lat_deg).max() < most_lat and np.abs(craft.lon_deg).max() < most_lon
    slow = 0.0 < float(np.median(speed)) < _SLOWEST_MPS
    if slow and near_zero:
        what = f"its positions imply {float(np.median(speed)):.2g} m/s near 0° N 0° E"
        found.append((what, "are latitude and longitude in radians read as degrees?"))
    return found


def _fast_hint(typical_mps: float) -> str:
    if typical_mps <= FASTEST_MPS:
        return "are positions of two aircraft mixed, or single ones wrong?"
    return (
        "are positions in degrees read as radians, nautical miles as metres, or times in s as ms?"
    )


def _velocities(craft: SampledTrajectory) -> FloatArray:
    """Return north, east and down velocities (3, n - 1) between samples, m/s."""
    lat, lon, alt = craft.lat_deg, craft.lon_deg, craft.alt_m
    steps = line_of_sight_ned(lat[:-1], lon[:-1], alt[:-1], lat[1:], lon[1:], alt[1:])
    return np.asarray(np.stack(steps) / np.diff(craft.sample_times_s))


def _coverage(content: TrafficFile, duration_s: float) -> list[str]:
    """Say which aircraft are there for only a part of the run."""
    lines = []
    first, last = content.ownship.interval_present()
    shared = max(0.0, min(last, duration_s) - max(first, 0.0))
    hint = "is time in ms, min or h read as s, or duration_s not that of the file?"
    if shared < (1.0 - _MISSING) * duration_s:
        lines.append(
            f"the ownship {content.ownship.name} is there for {shared:g} s of the run's "
            f"{duration_s:g} s; {hint}"
        )
        return lines
    parts = []
    for craft in content.intruders:
        first, last = craft.interval_present()
        there = max(0.0, min(last, duration_s) - max(first, 0.0))
        if there < (1.0 - _MISSING) * duration_s:
            parts.append(f"{craft.name} for {there:g} s")
    if parts:
        shown = ", ".join(parts[:3]) + (", ..." if len(parts) > 3 else "")
        lines.append(
            f"{len(parts)} of {len(content.intruders)} intruders are there for only a part of the "
            f"run's {duration_s:g} s ({shown}); where that is not so, {hint}"
        )
    return lines
