"""TECVOL's 100 Monte Carlo runs: what its sensors and its navigation err (thesis §2.3)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.display.flights import Flights
from components.evidence.thesis.basis import configured
from components.evidence.thesis.made import Columns, Picture
from components.evidence.thesis.plotting import EO, RADAR, legend_below, panels
from components.evidence.thesis.printed import printed
from components.evidence.thesis.row import Row
from components.evidence.thesis.scene_run import Recording, flights_of, monte_carlo, scene
from components.geometry.ellipsoid import line_of_sight_ned
from components.geometry.wrapping import wrap_by_sines
from dsa_des.arrays.types import FloatArray
from dsa_des.running.simulation import Simulation

_PLACE = ("own_lat_deg", "own_lon_deg", "own_alt_m")

REPLICAS = 100
_EDGES_KM = np.arange(0.0, 10.5, 1.0)


@dataclass
class Errors:
    """Errors of every detection of one sensor over all runs, believed minus true."""

    range_km: FloatArray
    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    east_m: FloatArray

    def by_range(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return middle of each bin of 1 km, mean and standard deviation there."""
        place = np.digitize(self.range_km, _EDGES_KM) - 1
        bins = [number for number in range(len(_EDGES_KM) - 1) if np.sum(place == number) > 1]
        mean = np.array([values[place == number].mean() for number in bins])
        spread = np.array([values[place == number].std(ddof=1) for number in bins])
        return _EDGES_KM[bins] + 0.5, mean, spread


def make() -> tuple[list[Row], Picture, Columns]:
    """Return rows, the figure and its data."""
    loaded = scene("systems/tecvol")
    runs, flights = monte_carlo(loaded, REPLICAS), flights_of(Simulation(loaded))
    errors = {name: _errors(runs, flights, name) for name in ("radar", "eo")}
    eo, radar = errors["eo"], errors["radar"]
    rows = [
        Row("Monte Carlo runs of TECVOL", len(runs), "", "", printed("table-2.4", "runs"), 0.0,
            basis=configured("seeds 0 to 99 of systems/tecvol.toml", "tecvol:REPLICAS")),
        Row("farthest EO detection of TECVOL", float(eo.range_km.max()), "km",
            "The intruder closes by 75 m per scan, which is allowed for.",
            printed("table-2.4", "eo_km"), 0.075, basis=configured(
                "the camera's range boundary", "systems/tecvol.toml:blocks.eo.range_km")),
    ]  # fmt: skip
    why = (
        "All detections of 100 runs: half a step of the grid, navigation bias 0.1° and noise "
        "0.1° (assumptions; the errors in [11] are not in the thesis)."
    )
    for name, label in (("radar", "radar"), ("eo", "EO")):
        values = errors[name].azimuth_deg
        rows += [
            Row(f"TECVOL, mean azimuth error, {label}", float(values.mean()), "deg", why),
            Row(f"TECVOL, standard deviation of the azimuth error, {label}",
                float(values.std(ddof=1)), "deg", why),
        ]  # fmt: skip
    near = radar.range_km < 3.0
    rows.append(Row("TECVOL, standard deviation of the radar's east error within 3 km",
                    float(radar.east_m[near].std(ddof=1)), "m",
                    "From believed position, angles and range; a Kalman filter would come after.",
                    ))  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, 1, 2, width_in=9.0, height_in=3.9) as (angles, places):
            for (name, colour), label in zip(
                (("radar", RADAR), ("eo", EO)), ("radar", "EO"), strict=True
            ):
                for quantity, style in (("azimuth", "o-"), ("elevation", "s--")):
                    values = getattr(errors[name], f"{quantity}_deg")
                    middle, mean, spread = errors[name].by_range(values)
                    angles.plot(middle, np.hypot(mean, spread), style, color=colour, markersize=4,
                                label=f"{label}, {quantity}")  # fmt: skip
            middle, mean, spread = radar.by_range(radar.east_m)
            places.errorbar(middle, mean, spread, fmt="o-", color=RADAR, markersize=4,
                            label="radar: mean ± standard deviation")  # fmt: skip
            angles.set_ylabel("root mean square angle error [deg]")
            places.set_ylabel("east error of the intruder's position [m]")
            angles.set_ylim(bottom=0.0)
            places.legend(loc="lower left")
            for axes in (angles, places):
                axes.set_xlabel("range [km]")
            angles.set_title("angles in north-east-down, as believed", loc="left")
            legend_below(angles)

    data: dict[str, list[float | str]] = {"sensor": [], "range_km": []}
    kinds = ("azimuth", "elevation")
    data |= {f"{kind}_{part}_deg": [] for kind in kinds for part in ("mean", "std")}
    for name, found in errors.items():
        for kind in kinds:
            middle, mean, spread = found.by_range(getattr(found, f"{kind}_deg"))
            data[f"{kind}_mean_deg"] += mean.tolist()
            data[f"{kind}_std_deg"] += spread.tolist()
        data["sensor"] += [name] * len(middle)
        data["range_km"] += middle.tolist()
    caption = (
        "TECVOL: errors of the radar and of the EO camera over 100 Monte Carlo runs, by range; the "
        "ownship's navigation has biases and white noise. All runs fly the same encounter, so the "
        "steps of the radar's grid of 1° do not average out."
    )
    return rows, Picture("table_2_4_tecvol", caption, draw), data


def _errors(runs: list[Recording], flights: Flights, name: str) -> Errors:
    """Return the errors of what a sensor reports, the ownship flying level to the north."""
    parts = [_with_place(run, name) for run in runs]
    seen = {key: np.concatenate([part[key] for part in parts])
            for key in ("time_s", "ned_azimuth_rad", "ned_elevation_rad", "true_azimuth_rad",
                        "true_elevation_rad", "true_range_m", "range_m", *_PLACE)}  # fmt: skip
    turned = seen["ned_azimuth_rad"] - seen["true_azimuth_rad"]
    return Errors(
        range_km=seen["true_range_m"] / 1000.0,
        azimuth_deg=np.degrees(wrap_by_sines(turned)),
        elevation_deg=np.degrees(seen["ned_elevation_rad"] - seen["true_elevation_rad"]),
        east_m=_east_error_m(flights, seen),
    )


def _with_place(run: Recording, name: str) -> dict[str, Any]:
    """Return what a sensor detected, and where the ownship believed to be then."""
    found, scans = run.rows("detections", block=name), run.rows("scans", block=name)
    row = np.searchsorted(scans["tick"], found["tick"])
    return {**found, **{key: scans[key][row] for key in _PLACE}}


def _east_error_m(flights: Flights, seen: dict[str, FloatArray]) -> FloatArray:
    """Return how far east of its place the ownship believes its intruder; NaN without a range."""
    target = flights.targets[0]
    start = flights.origin
    _, own_east, _ = line_of_sight_ned(
        *start, seen["own_lat_deg"], seen["own_lon_deg"], seen["own_alt_m"], validate=False
    )
    ground = seen["range_m"] * np.cos(seen["ned_elevation_rad"])
    believed = own_east + ground * np.sin(seen["ned_azimuth_rad"])
    east_km, _ = flights.at(target.name, seen["time_s"])
    return np.asarray(believed - 1000.0 * east_km)
