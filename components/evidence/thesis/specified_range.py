"""§4.1.1: the radar's detection of 5 m² at the specified range, in either of the two miles."""

from pathlib import Path

import numpy as np

from components.aircraft.aspect_tables import dbsm_to_m2
from components.evidence.thesis.basis import calibrated, predicted
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.plotting import BLUE, GREEN, GREY, ORANGE, legend_below, panels
from components.evidence.thesis.printed import printed
from components.evidence.thesis.project_files import radar
from components.evidence.thesis.radar_range import NAUTICAL_MILE_KM, pd_at
from components.evidence.thesis.row import Row
from components.evidence.thesis.scene_run import run, scene
from components.radar.link_budget import detection_range
from components.radar.swerling import SwerlingParameters

RCS_DBSM = 10.0 * float(np.log10(5.0))
STATUTE_KM, NAUTICAL_KM = 3.5 * 1.609344, 3.5 * NAUTICAL_MILE_KM


def make() -> Made:
    """Return ranges and probabilities of the three calibrations, and of a run by threshold."""
    flight, specification = radar(), radar("oasys_specification")
    nautical = radar("oasys_specification", calibrate={
        "rcs_dbsm": RCS_DBSM, "range_km": NAUTICAL_KM, "pd": 0.9})  # fmt: skip
    sensors = {
        "specification, 5.6 km": (specification, BLUE),
        "3.5 nautical miles": (nautical, ORANGE),
        "flight test": (flight, GREEN),
    }
    seen = run(scene("thesis/sec_4_1_1")).rows("detections", block="radar")
    first_km = float(seen["true_range_m"][0]) / 1000.0
    contradict = "the flight tests saw farther than the specification (errata 6)"
    flown = predicted("the radar calibrated to the flight tests", "sensors/oasys.toml:calibrate")
    rows = [
        Row("3.5 statute miles", STATUTE_KM, "km", "", printed("sec-4.1.1", "range_km"), None,
            "6.48 km are 3.5 nautical miles (errata 7)",
            predicted("1 statute mile = 1.609344 km")),
        Row("first detection of 5 m² by a threshold radar set to 6.48 km", first_km, "km",
            "The scene sec_4_1_1: 50 m/s and 1 Hz, so the first scan inside is up to 0.05 km "
            "nearer.", printed("sec-4.1.1", "range_km"), 0.05, basis=calibrated(
                "the threshold of the radar of scene sec_4_1_1",
                "thesis/sec_4_1_1.toml:blocks.radar.calibrate.range_km")),
        Row("Pd of 5 m² at 6.48 km, nautical miles", pd_at(nautical, nautical.link_budget(),
            RCS_DBSM, 6.48), "", "", printed("sec-4.1.1", "pd"), 0.005, basis=calibrated(
                "the bandwidth, here to 3.5 nautical miles", "specified_range:NAUTICAL_KM")),
        Row("Pd of 5 m² at 5.63 km, specification", pd_at(specification,
            specification.link_budget(), RCS_DBSM, STATUTE_KM), "",
            "Calibrated to Table 2.2's 5.6 km.", printed("sec-4.1.1", "pd"), 0.005,
            basis=calibrated("the bandwidth of the specification",
                             "sensors/oasys_specification.toml:calibrate.pd")),
        Row("range of Pd 0.9 for 5 m², specification", _range_km(specification), "km",
            "", printed("sec-4.1.1", "specified_km"), basis=calibrated(
                "the bandwidth of the specification",
                "sensors/oasys_specification.toml:calibrate.range_km")),
        Row("range of Pd 0.9 for 5 m², flight test", _range_km(flight), "km",
            "It serves every other figure.", printed("sec-4.1.1", "specified_km"), None,
            contradict, flown),
        Row("Pd of 5 m² at 6.48 km, flight test", pd_at(flight, flight.link_budget(), RCS_DBSM,
            6.48), "", "", printed("sec-4.1.1", "pd"), 0.005, contradict, flown),
    ]  # fmt: skip
    rows += [
        Row(f"bandwidth, {name}", sensor.link_budget().bandwidth_hz, "Hz",
            "Table 2.2 has none: it follows from the calibration.")
        for name, (sensor, _) in sensors.items()
    ]  # fmt: skip
    range_km = np.linspace(2.0, 15.0, 261)
    curves = {
        name: np.array([pd_at(sensor, sensor.link_budget(), RCS_DBSM, km) for km in range_km])
        for name, (sensor, _) in sensors.items()
    }

    def draw(path: Path) -> None:
        with panels(path) as (axes,):
            for name, (_, colour) in sensors.items():
                axes.plot(range_km, curves[name], color=colour, label=f"calibrated to: {name}")
            for km, text, side in (
                (STATUTE_KM, "3.5 sm ", "right"),
                (NAUTICAL_KM, " 3.5 NM", "left"),
            ):
                axes.axvline(km, color=GREY, linewidth=0.8, linestyle=":")
                axes.annotate(text, (km, 0.03), fontsize=8, ha=side)
            axes.plot([first_km], [0.9], "kx", markersize=7,
                      label="threshold radar set to 6.48 km: first detection")  # fmt: skip
            axes.set_xlabel("range [km]")
            axes.set_ylabel("Pd of 5 m², Swerling I [1]")
            axes.set(xlim=(2, 15), ylim=(0, 1.03))
            legend_below(axes, 2)

    data = {"range_km": range_km, **{f"pd, {name}": pd for name, pd in curves.items()}}
    caption = "Detection of a target of 5 m² by three calibrations of the OASys radar."
    return Made(rows, [Picture("sec_4_1_1", caption, draw)], {"sec_4_1_1": data})


def _range_km(sensor: SwerlingParameters) -> float:
    range_m = detection_range(
        sensor.link_budget(),
        dbsm_to_m2(RCS_DBSM),
        pd=0.9,
        pulses=sensor.pulses,
        false_alarm_probability=sensor.false_alarm_probability,
    )
    return float(range_m) / 1000.0
