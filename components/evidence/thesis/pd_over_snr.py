"""Fig. 4.2: the probability of detection over SNR, exact, by table and by the thesis's series."""

from pathlib import Path
from typing import Any

import numpy as np

from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.plotting import BLUE, GREY, ORANGE, panels
from components.evidence.thesis.project_files import radar
from components.evidence.thesis.row import Row
from components.radar.detection import detection_probability, required_snr
from components.radar.detection.approximations import detection_table

MODELS = {"Swerling I": "swerling1", "Swerling V": "swerling5"}


def make() -> Made:
    """Return Pd of a fluctuating and a steady target for OASys's pulses and false alarms."""
    sensor = radar()
    detector: dict[str, Any] = {
        "pulses": sensor.pulses,
        "false_alarm_probability": sensor.false_alarm_probability,
    }
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
        with panels(path) as (axes,):
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
            axes.set_xlabel("SNR [dB]")
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
    return Made(rows, [Picture("fig_4_2", caption, draw)], {"fig_4_2": data})
