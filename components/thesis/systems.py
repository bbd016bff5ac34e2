"""Table 2.4: the systems of the literature as scenes, and TECVOL's 100 Monte Carlo runs (§2.3)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.display.flights import Flights
from components.estimation.measurement import relative_range_deviation
from components.geometry import line_of_sight_ned, wrap_by_sines
from components.messages.state_tracks import covariance_matrices
from components.optical.detection import detection_probability
from components.thesis.cameras import KING_AIR_M2
from components.thesis.drawing import EO, GREY, RADAR, draw_legend_below, panels_written_as_png
from components.thesis.radar import NAUTICAL_MILE_KM, range_of_pd_km
from components.thesis.rows import Basis, Cells, Columns, Made, Picture, Row, configured, predicted
from components.thesis.scenes import (
    SceneRun,
    ThesisRecording,
    flights_of,
    load_config_scene,
    radar_parameters,
    read_config,
    run,
    run_replicas_of_scene,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import BLUE, GREEN, ORANGE, PINK, SKY
from dsa_des.running.simulation import Simulation

_PLACE = ("own_lat_deg", "own_lon_deg", "own_alt_m")

REPLICAS = 100
_EDGES_KM = np.arange(0.0, 10.5, 1.0)


@dataclass
class Errors:
    """Errors (measured minus true) of all detections of one sensor over all runs."""

    range_km: FloatArray
    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    east_m: FloatArray

    def mean_and_deviation_by_range(
        self, values: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return centres (km) of 1 km range bins with two values or more, mean and deviation."""
        index = np.digitize(self.range_km, _EDGES_KM) - 1
        bins = [number for number in range(len(_EDGES_KM) - 1) if np.sum(index == number) > 1]
        mean = np.array([values[index == number].mean() for number in bins])
        spread = np.array([values[index == number].std(ddof=1) for number in bins])
        return _EDGES_KM[bins] + 0.5, mean, spread


def _tecvol_errors(printed: Cells) -> tuple[list[Row], Picture, Columns]:
    """Return TECVOL's errors of sensors and navigation: rows, the figure and its data."""
    loaded = load_config_scene("systems/tecvol")
    runs, flights = run_replicas_of_scene(loaded, REPLICAS), flights_of(Simulation(loaded))
    errors = {name: _errors_of_sensor(runs, flights, name) for name in ("radar", "eo")}
    eo, radar = errors["eo"], errors["radar"]
    rows = [
        printed["runs"].compare(
            "Monte Carlo runs of TECVOL", len(runs), "", "",
            configured("seeds 0 to 99 of systems/tecvol.toml", "systems:REPLICAS")),
        printed["eo_km"].compare(
            "farthest EO detection of TECVOL", float(eo.range_km.max()), "km",
            "The intruder closes by 75 m per scan, which is allowed for.",
            configured("the camera's range boundary", "systems/tecvol.toml:blocks.eo.range_km")),
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
        with panels_written_as_png(path, 1, 2, width_in=9.0, height_in=3.9) as (angles, plan):
            for (name, colour), label in zip(
                (("radar", RADAR), ("eo", EO)), ("radar", "EO"), strict=True
            ):
                for quantity, style in (("azimuth", "o-"), ("elevation", "s--")):
                    values = getattr(errors[name], f"{quantity}_deg")
                    middle, mean, spread = errors[name].mean_and_deviation_by_range(values)
                    angles.plot(middle, np.hypot(mean, spread), style, color=colour, markersize=4,
                                label=f"{label}, {quantity}")  # fmt: skip
            middle, mean, spread = radar.mean_and_deviation_by_range(radar.east_m)
            plan.errorbar(middle, mean, spread, fmt="o-", color=RADAR, markersize=4,
                            label="radar: mean ± standard deviation")  # fmt: skip
            angles.set_ylabel("root mean square angle error (deg)")
            plan.set_ylabel("east error of the intruder's position (m)")
            angles.set_ylim(bottom=0.0)
            plan.legend(loc="lower left")
            for axes in (angles, plan):
                axes.set_xlabel("range (km)")
            angles.set_title("angles in north-east-down, as believed", loc="left")
            draw_legend_below(angles)

    data: dict[str, list[float | str]] = {"sensor": [], "range_km": []}
    kinds = ("azimuth", "elevation")
    data |= {f"{kind}_{part}_deg": [] for kind in kinds for part in ("mean", "std")}
    for name, result in errors.items():
        for kind in kinds:
            middle, mean, spread = result.mean_and_deviation_by_range(
                getattr(result, f"{kind}_deg")
            )
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


def _errors_of_sensor(runs: list[ThesisRecording], flights: Flights, name: str) -> Errors:
    """Return azimuth, elevation and east errors in all runs; the ownship flies level north."""
    parts = [_detections_with_own_position(run, name) for run in runs]
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


def _detections_with_own_position(run: ThesisRecording, name: str) -> dict[str, Any]:
    """Return a sensor's detections (columns) with the ownship's believed position at each."""
    result, scans = (
        run.matching_rows("detections", block=name),
        run.matching_rows("scans", block=name),
    )
    row = np.searchsorted(scans["tick"], result["tick"])
    return {**result, **{key: scans[key][row] for key in _PLACE}}


def _east_error_m(flights: Flights, seen: dict[str, FloatArray]) -> FloatArray:
    """Return how far east of the truth, m, detections place the intruder; NaN without range."""
    target = flights.targets[0]
    start = flights.origin
    _, own_east, _ = line_of_sight_ned(
        *start, seen["own_lat_deg"], seen["own_lon_deg"], seen["own_alt_m"], validate=False
    )
    ground = seen["range_m"] * np.cos(seen["ned_elevation_rad"])
    believed = own_east + ground * np.sin(seen["ned_azimuth_rad"])
    east_km, _ = flights.east_north_km(target.name, seen["time_s"])
    return np.asarray(believed - 1000.0 * east_km)


#: Scene in ``configs/systems`` → the project and its sensor in Table 2.4.
SYSTEMS = {
    "dut_nlda": "DUT/NLDA: range boundary, 1D projection",
    "tecvol": "TECVOL: Swerling radar, range boundary",
    "afrl": "AFRL: EO sensors",
    "afrl_low_threshold": "AFRL: EO sensors, low threshold",
    "afrl_tracked": "AFRL: EO sensors and TCAS",
    "midas": "AFRL(2): MIDAS sensor model",
    "oasys": "Amphitech: OASys, flight test",
    "oasys_specification": "Amphitech: OASys, link budget analysis",
    "smart_uav": "SmartUAV: Swerling radar",
}
#: Files of the targets of Table 2.3.
TABLE_2_3 = (
    "obstacles/power_line",
    "obstacles/building",
    "obstacles/wooden_hill",
    "aircraft/small_aircraft",
    "aircraft/medium_aircraft",
    "aircraft/large_aircraft",
)


def _target_label(target: str) -> str:
    """Return ``King Air`` for ``king_air``, ``large aircraft`` for ``large_aircraft``."""
    made_by_name = {"king_air": "King Air", "convair": "Convair", "1 m2": "1 m²"}
    return made_by_name.get(target, target.replace("_", " "))


_WITHOUT_ROW = (
    "",
    "Without a row: Table 2.1 (strengths and weaknesses in words), the CDTI's pictures (Fig. 2.1, "
    "4.15 and 4.16), the flight tests' ranges by geometry (Fig. 4.1, a plot), a block diagram and "
    "silhouettes (Fig. 4.6 and 4.7) print no number.",
)
_COLOURS = (BLUE, ORANGE, GREEN, SKY, GREY, PINK)


def systems(printed: Cells) -> Made:
    """Return rows and figures of first detection ranges, TECVOL's errors and Table 2.3's RCS."""
    # A filter takes seconds of each run and changes no detection, of which these rows are.
    swaps = {"afrl_tracked": ["tracker=tracking.hold_last"]}
    runs = {
        name: run(load_config_scene(f"systems/{name}", swaps=swaps.get(name, ())))
        for name in SYSTEMS
    }
    first = {name: first_detection_ranges_km(done) for name, done in runs.items()}
    statistics, errors, errors_data = _tecvol_errors(printed)
    rows = [
        Row(f"{name}.toml, first detection of {target}", km, "km",
            f"{runs[name].simulation.scene.description}")
        for name, result in first.items()
        for target, km in result.items()
        if name not in ("afrl", "afrl_low_threshold")
    ]  # fmt: skip
    rows += [
        *_afrl_rows(printed, runs, first["afrl"]),
        *statistics,
        *_smart_uav_rcs_rows(printed),
        *_parca_range_error_rows(printed),
    ]
    by_laser = first_detection_ranges_km(runs["smart_uav"], "laser")
    rows += [
        Row(f"smart_uav.toml, first detection of {target} by the laser", km, "km",
            "sensors/wire_laser.toml, a wire of 10 mm; published: over 10 mm from 0.6 km on.")
        for target, km in by_laser.items()
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, width_in=7.4, height_in=5.4) as (axes,):
            height, ticks, names = 0.0, [], []
            for name, result in reversed(first.items()):
                start = height
                for (target, km), colour in zip(result.items(), _COLOURS, strict=False):
                    axes.barh(height, km, 0.8, color=colour)
                    axes.annotate(
                        f" {_target_label(target)}, {km:.2f} km",
                        (km, height),
                        va="center",
                        fontsize=7,
                    )
                    height += 1.0
                ticks.append(0.5 * (start + height - 1.0))
                names.append(SYSTEMS[name].replace(": ", ":\n"))
                height += 0.7
            axes.set_yticks(ticks, names, fontsize=8)
            axes.set_xlabel("range of the first detection (km)")
            axes.set_ylabel("system (configs/systems)")
            axes.set_xlim(0, 20)

    data = {
        "system": [name for name, result in first.items() for _ in result],
        "target": [target for result in first.values() for target in result],
        "first_detection_km": [km for result in first.values() for km in result.values()],
    }
    caption = "First detection of each target by the systems of Table 2.4, in one run of each."
    lines = [f"- `configs/systems/{name}.toml`: {done.simulation.scene.description}"
             for name, done in runs.items()]  # fmt: skip
    return Made(
        rows,
        [Picture("table_2_4", caption, draw), errors],
        {"table_2_4": data, "table_2_4_tecvol": errors_data},
        note="\n".join([*lines, *_WITHOUT_ROW]),
    )


def first_detection_ranges_km(done: SceneRun, block: str = "") -> dict[str, float]:
    """Return, by target in the scene's order, the range (km) at which it was first detected.

    By any sensor, or by one.
    """
    seen = done.matching_rows("detections", **({"block": block} if block else {}))
    result: dict[str, float] = {}
    for track in done.flights.targets:
        here = np.flatnonzero(seen["target"] == track.name)
        if len(here):
            at = here[np.argmin(seen["time_s"][here])]
            result[track.name] = float(seen["true_range_m"][at]) / 1000.0
    return result


def _afrl_rows(printed: Cells, runs: dict[str, SceneRun], first: dict[str, float]) -> list[Row]:
    """Return table rows comparing section 2.4.1's AFRL cameras and flight tests with ours."""
    blocks = runs["afrl"].simulation.scene.blocks
    cameras = [blocks[name].parameters.model_dump() for name in ("left", "centre", "right")]
    low = runs["afrl_low_threshold"].simulation.scene.blocks["centre"].parameters.model_dump()
    alarms = "false_alarms_per_frame"
    why = "systems/afrl.toml, three cameras of a third of the field of view each."

    def of(key: str, file: str = "afrl") -> Basis:
        return configured("the scene's cameras", f"systems/{file}.toml:blocks.centre.{key}")

    seen = predicted("P = 1 and a = 0.3 as for Table 4.4, and Table 3.1's areas",
                     "systems/afrl.toml:blocks.centre.static_weight",
                     "systems/afrl.toml:blocks.traffic")  # fmt: skip
    return [
        printed["pixels"].compare("AFRL, pixels in azimuth",
                                 sum(c["azimuth_pixels"] for c in cameras), "", why,
                                 of("azimuth_pixels")),
        printed["field_deg"].compare(
            "AFRL, field of view in azimuth",
            sum(c["azimuth_deg"][1] - c["azimuth_deg"][0] for c in cameras), "deg", why,
            of("azimuth_deg")),
        printed["alarms_low"].compare("AFRL, false alarms per frame, low threshold",
                                     100.0 * low[alarms], "%", "Read as per frame (assumption).",
                                     of(alarms, "afrl_low_threshold")),
        printed["alarms_high"].compare("AFRL, false alarms per frame, high threshold",
                                      100.0 * cameras[1][alarms], "%",
                                      "Read as per frame (assumption).", of(alarms)),
        *(printed[f"first_{size}_nm"].compare(
            f"AFRL, first detection of the {size} aircraft", first[name] / NAUTICAL_MILE_KM, "NM",
            f"Printed of the flight tests. {why}", seen)
          for size, name in (("small", "king_air"), ("large", "convair"))),
        *_camera_pd_rows(printed, runs["afrl"]),
    ]  # fmt: skip


#: A Beech Bonanza from the nose: 10.0 m² in be35.csv of mit-ll/degas-surveillance-jwandrews.
BONANZA_M2 = 10.0


def _camera_pd_rows(printed: Cells, done: SceneRun) -> list[Row]:
    """Return rows on the cameras' range of Pd 0.9, and the Pd of a Bonanza at 2 and 3.5 NM."""
    camera: Any = done.simulation.components["centre"]
    result = camera.detector
    pixel_sr = camera.pixel_azimuth_rad * camera.pixel_elevation_rad
    nine_of_ten = result.threshold + 1.2815515655446004 * result.noise
    needed = float(camera.signal_from_signature(nine_of_ten, 1.0)["pixels"])
    rows = []
    for size, area_m2 in (("small", KING_AIR_M2["Level head-on"]), ("large", 90.0)):
        reached_km = (area_m2 / (pixel_sr * needed)) ** 0.5 / 1000.0
        rows.append(printed[f"declared_{size}_nm"].compare(
            f"AFRL, declaration of the {size} aircraft: Pd 0.9", reached_km / NAUTICAL_MILE_KM,
            "NM", f"Head-on, {area_m2:.1f} m², P = 1.",
            predicted("P = 1, Pd 0.5 at Table 4.4's ranges, and 0.01 % of false alarms a frame",
                      "systems/afrl.toml:blocks.centre.calibrate.range_km",
                      "systems/afrl.toml:blocks.centre.static_weight",
                      "systems/afrl.toml:blocks.centre.false_alarms_per_frame")))  # fmt: skip
    for cell, distance_nm in (("pd_near", 2.0), ("pd_far", 3.5)):
        pixels = BONANZA_M2 / (pixel_sr * (1000.0 * distance_nm * NAUTICAL_MILE_KM) ** 2)
        signature = camera.p.static_weight * pixels * camera.counted_signature_share(pixels)
        pd = detection_probability(signature, result.threshold, result.noise)
        rows.append(printed[cell].compare(
            f"AFRL, Pd of a Bonanza at {distance_nm:g} NM, high threshold", 100.0 * float(pd), "%",
            "Printed of an earlier study: 100 % below 3 NM, 90 % beyond.",
            predicted("the flight tests' camera", "systems:BONANZA_M2",
                      "systems/afrl.toml:blocks.centre.static_weight")))  # fmt: skip
    return rows


def _parca_range_error_rows(printed: Cells) -> list[Row]:
    """Return rows on a camera track's stated relative range error before and after S-turns."""
    tracks = run(
        load_config_scene("tracking/passive_ranging", "blocks.tracker.passive_range_share=10")
    ).matching_rows("state_tracks", track_status="confirmed")
    away = np.stack([tracks[f"{a}_m"] - tracks[f"own_{a}_m"] for a in ("north", "east", "down")])
    share = relative_range_deviation(away, covariance_matrices(tracks, slice(None), 3))
    rows = []
    for cell, when, time_s in (("parca_before", "before", 10.0), ("parca_after", "after", 46.0)):
        at = int(np.searchsorted(tracks["time_s"], time_s))
        rows.append(printed[cell].compare(
            f"PaRCA, error of the range {when} the manoeuvre", 100.0 * float(share[at]), "%",
            "The standard deviation that the track states; printed of the flight tests.",
            predicted("a camera's errors, a first guess to 50 %, and S-turns of 45 degrees",
                      "tracking/passive_ranging.toml:blocks.eo.azimuth_error_deg",
                      "tracking/passive_ranging.toml:blocks.traffic.ownship")))  # fmt: skip
    return rows


def _smart_uav_rcs_rows(printed: Cells) -> list[Row]:
    """Return table rows with the RCS of each target of Table 2.3 and its range of Pd 0.9."""
    sensor = radar_parameters()
    rows = []
    for file in TABLE_2_3:
        target = read_config(file)
        name = file.partition("/")[2]
        label, rcs_dbsm = name.replace("_", " "), target["rcs_dbsm"]
        rows += [
            printed[name].compare(f"RCS of the {label}", rcs_dbsm, "dBsm", "",
                                 configured(f"{file}.toml", f"{file}.toml:rcs_dbsm")),
            Row(f"range of Pd 0.9 for the {label}",
                range_of_pd_km(sensor, rcs_dbsm, model=f"swerling{target['swerling']}"), "km",
                "sensors/oasys.toml stands for SmartUAV's unprinted radar; beyond 15 km it does "
                "not look."),
        ]  # fmt: skip
    return rows
