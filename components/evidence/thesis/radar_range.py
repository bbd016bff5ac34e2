"""Figs 4.3 to 4.5: SNR and probability of detection over range, for the three RCS classes."""

from pathlib import Path
from typing import Any

import numpy as np

from components.aircraft.aspect_tables import dbsm_to_m2
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.plotting import BLUE, GREY, ORANGE, panels
from components.evidence.thesis.printed import printed
from components.evidence.thesis.project_files import radar
from components.evidence.thesis.row import Row
from components.radar.detection import detection_probability
from components.radar.link_budget import LinkBudget, detection_range
from components.radar.swerling import SwerlingParameters

NAUTICAL_MILE_KM = 1.852

#: Class → RCS in dBsm (Table 4.1) and average detection range in km (§4.1.3). The ranges are those
#: of the flight tests in 0.1 nautical miles, printed as 6.91, 7.31 and 9.75 km.
CLASSES = {
    "small": (1.76, 22.4 / 6.0 * NAUTICAL_MILE_KM),
    "medium": (3.01, 35.5 / 9.0 * NAUTICAL_MILE_KM),
    "large": (6.99, 57.9 / 11.0 * NAUTICAL_MILE_KM),
}
FIGURES = {"small": "fig_4_3", "medium": "fig_4_4", "large": "fig_4_5"}

ROUNDED = "The last digits of both ranges and both Pd are allowed for."

#: Why the large class differs (errata 17).
LARGE_DIFFERS = (
    "no one bandwidth gives all three printed values: small and medium agree with each other, "
    "the large class would need 10.45 km or 5.8 dBsm"
)


def small() -> Made:
    """Return the curves of the small class."""
    return _over_range("small")


def medium() -> Made:
    """Return the curves of the medium class."""
    return _over_range("medium")


def large() -> Made:
    """Return the curves of the large class."""
    return _over_range("large")


def pd_at(
    sensor: SwerlingParameters, budget: LinkBudget, rcs_dbsm: float, range_km: float
) -> float:
    """Return the Swerling I probability of detection of an RCS at a range."""
    snr = budget.snr(1000.0 * range_km, dbsm_to_m2(rcs_dbsm))
    return float(
        detection_probability(
            snr, pulses=sensor.pulses, false_alarm_probability=sensor.false_alarm_probability
        )
    )


def rounding(sensor: SwerlingParameters, rcs_dbsm: float, range_km: float) -> float:
    """Return by how much a printed Pd may differ since numbers are rounded.

    Two ranges, to 0.01 km, and two Pd, to 0.0001: the row's own and those of the calibration.
    """
    budget = sensor.link_budget()
    near, far = (pd_at(sensor, budget, rcs_dbsm, range_km + step) for step in (-0.005, 0.005))
    return abs(near - far) + 1e-4


def _over_range(name: str) -> Made:
    rcs_dbsm, average_km = CLASSES[name]
    text = printed("sec-4.1.3", f"pd_{name}")
    sensor = radar()
    budget = sensor.link_budget()
    range_km = np.linspace(1.0, 15.0, 281)
    snr = np.asarray(budget.snr(1000.0 * range_km, dbsm_to_m2(rcs_dbsm)))
    snr_db = 10.0 * np.log10(snr)
    detector: dict[str, Any] = {
        "false_alarm_probability": sensor.false_alarm_probability,
        "pulses": sensor.pulses,
    }
    fluctuating = np.asarray(detection_probability(snr, model="swerling1", **detector))
    steady = np.asarray(detection_probability(snr, model="swerling5", **detector))
    at_average = pd_at(sensor, budget, rcs_dbsm, average_km)
    snr_there = float(budget.snr(1000.0 * average_km, dbsm_to_m2(rcs_dbsm)))
    for_09 = float(detection_range(budget, dbsm_to_m2(rcs_dbsm), pd=0.9, **detector)) / 1000.0
    source = "Swerling I with sensors/oasys.toml, whose bandwidth follows from the small class."
    rows = [
        Row(f"Pd at {average_km:.2f} km", at_average, "",
            f"{source} The figure prints none; §4.1.3 does, and is compared there."),
        Row(f"SNR at {average_km:.2f} km", 10.0 * np.log10(snr_there), "dB", source),
        Row("range of Pd 0.9", for_09, "km", source),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, 2, 1, sharex=True, height_in=4.6) as (upper, lower):
            upper.plot(range_km, snr_db, color=BLUE, label=f"SNR, {rcs_dbsm} dBsm")
            upper.set_ylabel("SNR [dB]")
            lower.plot(range_km, fluctuating, color=BLUE, label="Pd, Swerling I")
            lower.plot(range_km, steady, "--", color=ORANGE, label="Pd, Swerling V")
            lower.plot([average_km], [float(text)], "kx", markersize=7,
                       label=f"thesis: {text} at {average_km:.2f} km")  # fmt: skip
            lower.set_ylabel("probability of detection Pd [1]")
            lower.set_xlabel("range [km]")
            lower.set(xlim=(1, 15), ylim=(0, 1.03))
            for axes in (upper, lower):
                axes.axvline(average_km, color=GREY, linewidth=0.8, linestyle=":")
                axes.legend(loc="upper right" if axes is upper else "lower left")

    figure = FIGURES[name]
    data = {
        "range_km": range_km,
        "snr_db": snr_db,
        "pd_swerling1": fluctuating,
        "pd_swerling5": steady,
    }
    caption = f"SNR and detection probability for a {name} target ({rcs_dbsm} dBsm) over range."
    return Made(rows, [Picture(figure, caption, draw)], {figure: data})
