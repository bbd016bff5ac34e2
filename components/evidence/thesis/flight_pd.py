"""§4.1.3: the three probabilities at the average detection ranges, and what no fit removes."""

import math
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from components.aircraft.aspect_tables import dbsm_to_m2
from components.evidence.thesis.basis import Basis, calibrated, predicted
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.plotting import BLUE, GREY, ORANGE, panels
from components.evidence.thesis.printed import printed
from components.evidence.thesis.project_files import radar
from components.evidence.thesis.radar_range import CLASSES, LARGE_DIFFERS, ROUNDED, pd_at, rounding
from components.evidence.thesis.row import Row
from components.radar.link_budget import LinkBudget, with_bandwidth
from components.radar.required_snr import required_snr


def make() -> Made:
    """Return Pd by the configured bandwidth, and the residuals of the best single bandwidth."""
    sensor = radar()
    budget = sensor.link_budget()

    def probabilities(bandwidth_hz: float) -> list[float]:
        chosen = with_bandwidth(budget, bandwidth_hz)
        return [pd_at(sensor, chosen, dbsm, km) for dbsm, km in CLASSES.values()]

    pds = [float(printed("sec-4.1.3", f"pd_{name}")) for name in CLASSES]

    def misfit(log_bandwidth: float) -> float:
        ours = probabilities(math.exp(log_bandwidth))
        return math.fsum((a - b) ** 2 for a, b in zip(ours, pds, strict=True))

    best = minimize_scalar(misfit, bounds=(math.log(100.0), math.log(2000.0)), method="bounded",
                           options={"xatol": 1e-10})  # fmt: skip
    fitted_hz = math.exp(float(best.x))
    configured = probabilities(budget.bandwidth_hz)
    fitted = probabilities(fitted_hz)
    rows, off = [], []
    for (name, (dbsm, km)), ours in zip(CLASSES.items(), configured, strict=True):
        basis = _basis(name)
        because = LARGE_DIFFERS if name == "large" else ""
        quantity = f"Pd of the {name} class at {km:.2f} km"
        allowed = rounding(sensor, dbsm, km)
        rows.append(Row(quantity, ours, "", ROUNDED, printed("sec-4.1.3", f"pd_{name}"), allowed,
                        because, basis))  # fmt: skip
        off.append(
            Row(f"how far Pd of the {name} class is off 0.9 (§5.1.3)", 100.0 * abs(ours - 0.9), "%",
                "Percentage points, as there.", printed("sec-4.1.3", f"off_{name}"), None, because,
                basis, again=quantity)
        )  # fmt: skip
    rows += off
    to_all = calibrated(f"one bandwidth, {fitted_hz:.0f} Hz, fitted to all three values")
    for (name, (_, km)), ours in zip(CLASSES.items(), fitted, strict=True):
        rows.append(Row(f"the same by one least-squares bandwidth, {name} at {km:.2f} km", ours, "",
                        "The residuals are reported and not used.",
                        printed("sec-4.1.3", f"pd_{name}"), None,
                        "the three printed values contradict one another (errata 17)", to_all,
                        ))  # fmt: skip
    rows += [
        Row("bandwidth from the small class", budget.bandwidth_hz, "Hz",
            "Not printed; from 0.9114 at 6.91 km (errata 6)."),
        Row("bandwidth by least squares over the three classes", fitted_hz, "Hz",
            "For the residuals only."),
        *_what_large_would_need(sensor.false_alarm_probability, budget),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        place = np.arange(3.0)
        with panels(path) as (axes,):
            axes.bar(place - 0.27, pds, 0.25, color=GREY, label="thesis")
            axes.bar(
                place,
                configured,
                0.25,
                color=BLUE,
                label=f"ours, {budget.bandwidth_hz:.0f} Hz (small class)",
            )
            axes.bar(place + 0.27, fitted, 0.25, color=ORANGE,
                     label=f"least squares, {fitted_hz:.0f} Hz")  # fmt: skip
            for bars in axes.containers:
                axes.bar_label(bars, fmt="%.4f", fontsize=8)
            names = [f"{name}, {dbsm} dBsm\nat {km:.2f} km" for name, (dbsm, km) in CLASSES.items()]
            axes.set_xticks(place, names)
            axes.set_xlabel("RCS class and its average detection range in the flight tests")
            axes.set_ylabel("probability of detection Pd [1]")
            axes.set_ylim(0.84, 0.95)
            axes.legend(loc="upper right", ncols=3)

    data = {
        "class": list(CLASSES),
        "range_km": [km for _, km in CLASSES.values()],
        "printed": pds,
        "ours": configured,
        "least_squares": fitted,
    }
    caption = "Probabilities of detection at the average ranges of the flight tests (from 0.84)."
    return Made(rows, [Picture("sec_4_1_3", caption, draw)], {"sec_4_1_3": data})


def _what_large_would_need(pfa: float, budget: LinkBudget) -> list[Row]:
    """Return at which range, or with which RCS, the large class would have the printed Pd."""
    dbsm, km = CLASSES["large"]
    needed = required_snr(float(printed("sec-4.1.3", "pd_large")), false_alarm_probability=pfa)
    range_m = float(budget.range_for_snr(needed, dbsm_to_m2(dbsm)))
    there = float(budget.snr(1000.0 * km, 1.0))
    why = "Where our curve has 0.8668 (errata 17)."
    said = f"Pd of the large class at {km:.2f} km"
    return [
        Row("range at which the large class has Pd 0.8668", range_m / 1000.0, "km", why,
            printed("sec-4.1.3", "range_large"), None, LARGE_DIFFERS, _basis("large"), again=said),
        Row("RCS that has Pd 0.8668 at 9.75 km", 10.0 * math.log10(needed / there), "dBsm", why,
            printed("sec-4.1.3", "rcs_large"), None, LARGE_DIFFERS, _basis("large"), again=said),
    ]  # fmt: skip


def _basis(name: str) -> Basis:
    """Return where Pd of a class comes from: the bandwidth was set from the small class."""
    if name == "small":
        return calibrated("the radar's bandwidth", "sensors/oasys.toml:calibrate.pd")
    return predicted(
        f"the bandwidth of the small class, the RCS and range of the {name} one, Swerling I",
        "sensors/oasys.toml:calibrate",
        "radar_range:CLASSES",
    )
