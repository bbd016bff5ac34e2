"""The radar's Pd over SNR and range: Figs 4.2 to 4.5, and its range of §4.1.1."""

from pathlib import Path
from typing import Any

import numpy as np

from components.aircraft.aspect_tables import dbsm_to_m2
from components.radar.detection import detection_probability, required_snr
from components.radar.detection.approximations import detection_table
from components.radar.link_budget import LinkBudget, detection_range
from components.radar.swerling import SwerlingParameters
from components.thesis.drawing import GREY, draw_legend_below, panels_written_as_png
from components.thesis.rows import Cells, Made, Printed, Row, calibrated, predicted
from components.thesis.scenes import load_config_scene, radar_parameters, run
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import BLUE, GREEN, ORANGE

NAUTICAL_MILE_KM = 1.852
RCS_DBSM = 10.0 * float(np.log10(5.0))
STATUTE_KM, NAUTICAL_KM = 3.5 * 1.609344, 3.5 * NAUTICAL_MILE_KM

#: Class → RCS in dBsm (Table 4.1) and average detection range in km (§4.1.3). The ranges are those
#: of the flight tests in 0.1 nautical miles, printed as 6.91, 7.31 and 9.75 km.
CLASSES = {
    "small": (1.76, 22.4 / 6.0 * NAUTICAL_MILE_KM),
    "medium": (3.01, 35.5 / 9.0 * NAUTICAL_MILE_KM),
    "large": (6.99, 57.9 / 11.0 * NAUTICAL_MILE_KM),
}
MODELS = {"Swerling I": "swerling1", "Swerling V": "swerling5"}


def _detector_arguments(sensor: SwerlingParameters) -> dict[str, Any]:
    return {
        "pulses": sensor.pulses,
        "false_alarm_probability": sensor.false_alarm_probability,
    }


def swerling1_pd_at_ranges(
    sensor: SwerlingParameters, budget: LinkBudget, rcs_dbsm: float, range_km: float | FloatArray
) -> Any:
    """Return the Swerling I detection probability of a target of this RCS at given ranges."""
    snr = budget.snr(1000.0 * range_km, dbsm_to_m2(rcs_dbsm))
    return detection_probability(snr, **_detector_arguments(sensor))


def range_of_pd_km(
    sensor: SwerlingParameters, rcs_dbsm: float, pd: float = 0.9, model: str = "swerling1"
) -> float:
    """Return the range (km) at which a target with this RCS is detected with probability `pd`."""
    range_m = detection_range(
        sensor.link_budget(),
        dbsm_to_m2(rcs_dbsm),
        pd=pd,
        model=model,
        **_detector_arguments(sensor),
    )
    return float(range_m) / 1000.0


def pd_over_snr(_: Cells) -> Made:
    """Fig. 4.2: exact, by table and by the thesis's series, for OASys's pulses and false alarms."""
    sensor = radar_parameters()
    detector = _detector_arguments(sensor)
    snr_db = np.linspace(-20.0, 30.0, 501)
    snr = 10.0 ** (snr_db / 10.0)
    exact = {name: detection_probability(snr, model=m, **detector) for name, m in MODELS.items()}
    table = {
        name: detection_probability(snr, model=m, method="table", **detector)
        for name, m in MODELS.items()
    }
    series = detection_probability(snr, model="swerling5", method="gram_charlier", **detector)
    pulses, pfa = sensor.pulses, sensor.false_alarm_probability
    steady = detection_table(pulses, pfa, "swerling0")
    truncation = (steady.lowest, steady.highest)
    source = f"The radar parameters of sensors/oasys.toml: Pfa {pfa:g} per look, n_p {pulses}."
    rows = []
    for name, model in MODELS.items():
        needed = required_snr(0.9, model=model, **detector)
        rows.append(Row(f"SNR for Pd 0.9, {name}", 10.0 * np.log10(needed), "dB", source))
    rows += [
        Row(f"largest error of the lookup table, {name}",
            float(np.abs(table[name] - exact[name]).max()), "",
            "Cubic cells instead of the thesis's values at steps of SNR.")
        for name in MODELS
    ]  # fmt: skip
    rows += [
        Row("largest error of the Gram-Charlier series, Swerling V",
            float(np.abs(series - exact["Swerling V"]).max()), "",
            "Eq. 27 with its missing 1/sqrt(2π) (errata 15), an approximation, worst at one pulse.")
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path) as (axes,):
            for (name, pd), colour in zip(exact.items(), (BLUE, ORANGE), strict=True):
                axes.plot(snr_db, pd, color=colour, label=f"{name}, exact")
            axes.plot(snr_db, series, ":", color=GREY, label="Swerling V, eq. 27 (corrected)")
            for (name, model), colour in zip(MODELS.items(), (BLUE, ORANGE), strict=True):
                kept = detection_table(pulses, pfa, model.replace("5", "0"))
                inside = (snr >= kept.lowest) & (snr <= kept.highest)
                few = np.flatnonzero(inside)[::12]
                axes.plot(snr_db[few], table[name][few], linestyle="none", marker="o",
                          markersize=3.5, fillstyle="none", color=colour,
                          label=f"{name}, truncated table")  # fmt: skip
            axes.axhline(pfa, color=GREY, linewidth=0.7)
            axes.annotate(f"Pfa {pfa:g}", (29.5, pfa), fontsize=8, ha="right", va="bottom")
            axes.set_xlabel("SNR (dB)")
            axes.set_ylabel("probability of detection Pd [1]")
            axes.set(xlim=(-20, 30), ylim=(0, 1.02))
            axes.legend(loc="upper left")

    data = {
        "snr_db": snr_db,
        **{f"pd_{MODELS[name]}": pd for name, pd in exact.items()},
        **{f"pd_{MODELS[name]}_table": pd for name, pd in table.items()},
        "pd_swerling5_gram_charlier": series,
    }
    caption = (
        "Detection probabilities for the Swerling models over SNR. The table is truncated where "
        f"Pd is within 1e-8 of its ends: for Swerling V from {10 * np.log10(truncation[0]):.0f} dB "
        f"to {10 * np.log10(truncation[1]):.0f} dB (towards small SNR Pd falls to Pfa, not to 0)."
    )
    return Made.with_figure(rows, "fig_4_2", caption, draw, data)


def snr_and_pd_over_range(name: str, figure: str, thesis: Printed, _: Cells) -> Made:
    """Figs 4.3 to 4.5: rows, figure of SNR, Pd of an RCS class over range; `thesis`: §4.1.3 Pd."""
    rcs_dbsm, average_km = CLASSES[name]
    sensor = radar_parameters()
    budget = sensor.link_budget()
    range_km = np.linspace(1.0, 15.0, 281)
    snr = np.asarray(budget.snr(1000.0 * range_km, dbsm_to_m2(rcs_dbsm)))
    snr_db = 10.0 * np.log10(snr)
    fluctuating, steady = (
        np.asarray(detection_probability(snr, model=model, **_detector_arguments(sensor)))
        for model in MODELS.values()
    )
    snr_there = float(budget.snr(1000.0 * average_km, dbsm_to_m2(rcs_dbsm)))
    source = "Swerling I with sensors/oasys.toml, whose bandwidth follows from the small class."
    rows = [
        Row(f"Pd at {average_km:.2f} km", float(swerling1_pd_at_ranges(sensor, budget, rcs_dbsm,
        average_km)), "",
            f"{source} The figure prints none; §4.1.3 does, and is compared there."),
        Row(f"SNR at {average_km:.2f} km", 10.0 * np.log10(snr_there), "dB", source),
        Row("range of Pd 0.9", range_of_pd_km(sensor, rcs_dbsm), "km", source),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels_written_as_png(path, 2, 1, sharex=True, height_in=4.6) as (upper, lower):
            upper.plot(range_km, snr_db, color=BLUE, label=f"SNR, {rcs_dbsm} dBsm")
            upper.set_ylabel("SNR (dB)")
            lower.plot(range_km, fluctuating, color=BLUE, label="Pd, Swerling I")
            lower.plot(range_km, steady, "--", color=ORANGE, label="Pd, Swerling V")
            lower.plot([average_km], [thesis.value], "kx", markersize=7,
                       label=f"thesis: {thesis.text} at {average_km:.2f} km")  # fmt: skip
            lower.set_ylabel("probability of detection Pd [1]")
            lower.set_xlabel("range (km)")
            lower.set(xlim=(1, 15), ylim=(0, 1.03))
            for axes in (upper, lower):
                axes.axvline(average_km, color=GREY, linewidth=0.8, linestyle=":")
                axes.legend(loc="upper right" if axes is upper else "lower left")

    data = {
        "range_km": range_km,
        "snr_db": snr_db,
        "pd_swerling1": fluctuating,
        "pd_swerling5": steady,
    }
    caption = f"SNR and detection probability for a {name} target ({rcs_dbsm} dBsm) over range."
    return Made.with_figure(rows, figure, caption, draw, data)


def specified_range(printed: Cells) -> Made:
    """§4.1.1: rows and figure of the range of detecting 5 m², in statute and nautical miles."""
    flight, specification = radar_parameters(), radar_parameters("oasys_specification")
    nautical = radar_parameters("oasys_specification", calibrate={
        "rcs_dbsm": RCS_DBSM, "range_km": NAUTICAL_KM, "pd": 0.9})  # fmt: skip
    sensors = {
        "specification, 5.6 km": (specification, BLUE),
        "3.5 nautical miles": (nautical, ORANGE),
        "flight test": (flight, GREEN),
    }
    range_, specified, pd = (printed[name] for name in ("range_km", "specified_km", "pd"))
    seen = run(load_config_scene("thesis/sec_4_1_1")).matching_rows("detections", block="radar")
    first_km = float(seen["true_range_m"][0]) / 1000.0

    def pd_of(sensor: SwerlingParameters, range_km: float) -> float:
        return float(swerling1_pd_at_ranges(sensor, sensor.link_budget(), RCS_DBSM, range_km))

    flown = predicted("the radar calibrated to the flight tests", "sensors/oasys.toml:calibrate")
    rows = [
        range_.compare("3.5 statute miles", STATUTE_KM, "km", "",
                      predicted("1 statute mile = 1.609344 km")),
        range_.compare(
            "first detection of 5 m² by a threshold radar set to 6.48 km", first_km, "km",
            "The scene sec_4_1_1: 50 m/s and 1 Hz, so the first scan inside is up to 0.05 km "
            "nearer.", calibrated("the threshold of the radar of scene sec_4_1_1",
                                  "thesis/sec_4_1_1.toml:blocks.radar.calibrate.range_km"),
            tolerance=0.05),
        pd.compare("Pd of 5 m² at 6.48 km, nautical miles", pd_of(nautical, 6.48), "", "",
                  calibrated("the bandwidth, here to 3.5 nautical miles", "radar:NAUTICAL_KM")),
        pd.compare("Pd of 5 m² at 5.63 km, specification", pd_of(specification, STATUTE_KM), "",
                  "Calibrated to Table 2.2's 5.6 km.",
                  calibrated("the bandwidth of the specification",
                             "sensors/oasys_specification.toml:calibrate.pd")),
        specified.compare("range of Pd 0.9 for 5 m², specification",
                         range_of_pd_km(specification, RCS_DBSM), "km", "",
                         calibrated("the bandwidth of the specification",
                                    "sensors/oasys_specification.toml:calibrate.range_km")),
        specified.compare("range of Pd 0.9 for 5 m², flight test",
                         range_of_pd_km(flight, RCS_DBSM), "km",
                         "It serves every other figure.", flown),
        pd.compare("Pd of 5 m² at 6.48 km, flight test", pd_of(flight, 6.48), "", "", flown),
    ]  # fmt: skip
    rows += [
        Row(f"bandwidth, {name}", sensor.link_budget().bandwidth_hz, "Hz",
            "Table 2.2 has none: it follows from the calibration.")
        for name, (sensor, _) in sensors.items()
    ]  # fmt: skip
    range_km = np.linspace(2.0, 15.0, 261)
    curves = {
        name: swerling1_pd_at_ranges(sensor, sensor.link_budget(), RCS_DBSM, range_km)
        for name, (sensor, _) in sensors.items()
    }

    def draw(path: Path) -> None:
        with panels_written_as_png(path) as (axes,):
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
            axes.set_xlabel("range (km)")
            axes.set_ylabel("Pd of 5 m², Swerling I [1]")
            axes.set(xlim=(2, 15), ylim=(0, 1.03))
            draw_legend_below(axes, 2)

    data = {"range_km": range_km, **{f"pd, {name}": pd for name, pd in curves.items()}}
    caption = "Detection of a target of 5 m² by three calibrations of the OASys radar."
    return Made.with_figure(rows, "sec_4_1_1", caption, draw, data)
