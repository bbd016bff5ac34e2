"""Fig. 4.18: detections thin out with range as the radar's probability of detection falls."""

from pathlib import Path

import numpy as np

from components.aircraft.aspect_tables import dbsm_to_m2
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.map_axes import draw_map, mark
from components.evidence.thesis.plotting import BLUE, ORANGE, legend_below, panels
from components.evidence.thesis.project_files import radar
from components.evidence.thesis.radar_range import CLASSES
from components.evidence.thesis.row import Row
from components.evidence.thesis.scene_run import run, scene
from components.radar.detection import detection_probability
from dsa_des.arrays.types import FloatArray

EDGES_KM = np.arange(1.0, 16.0)


def make() -> Made:
    """Return the share of scans that detect, by range, beside Pd."""
    done = run(scene("thesis/fig_4_18"))
    seen = done.rows("detections", block="radar")
    scans_s = done.rows("scans", block="radar")["time_s"]
    ranges_km = [
        np.interp(scans_s, track.time_s, track.range_m) / 1000.0 for track in done.flights.targets
    ]
    range_km = np.concatenate(ranges_km)
    pd_of_scan = _pd(range_km)
    looked = np.histogram(range_km, EDGES_KM)[0]
    found = np.histogram(seen["true_range_m"] / 1000.0, EDGES_KM)[0]
    middle_km = 0.5 * (EDGES_KM[1:] + EDGES_KM[:-1])
    share = found / looked
    # Pd falls within a bin: what is expected is its mean over the scans that fell there.
    pd = np.histogram(range_km, EDGES_KM, weights=pd_of_scan)[0] / looked
    variance = np.histogram(range_km, EDGES_KM, weights=pd_of_scan * (1.0 - pd_of_scan))[0]
    sigma = np.sqrt(variance) / looked
    source = "The scene fig_4_18, nine small targets; sensors/oasys.toml."
    rows = [
        Row(f"share of scans that detect, {low:g} to {low + 1:g} km", float(share[index]), "",
            f"{source} The mean Pd of these scans is {pd[index]:.3f}.")
        for index, low in enumerate(EDGES_KM[:-1])
        if low in (2.0, 6.0, 10.0, 14.0)
    ]  # fmt: skip
    chi_square = float(np.sum(((share - pd) / sigma) ** 2))
    expected = "Fourteen bins of 1 km; 1 is expected, 2.1 exceeded by chance in 1 %."
    rows.append(
        Row("chi-square of the shares about Pd, per bin", chi_square / len(share), "", expected)
    )

    def draw(path: Path) -> None:
        with panels(path, 1, 2, width_in=9.0, height_in=4.0) as (places, shares):
            draw_map(places, done, fields_of_view=("radar",))
            few = {name: column[seen["scan"] % 5 == 0] for name, column in seen.items()}
            mark(places, done, few, markersize=3.5, label="detected (one scan in five)")
            places.set(xlim=(-16, 16), ylim=(-6, 16))
            legend_below(places)
            curve_km = np.linspace(1.0, 15.0, 141)
            shares.plot(curve_km, _pd(curve_km), color=BLUE, label="Pd, Swerling I, 1.76 dBsm")
            shares.errorbar(middle_km, share, 2.0 * sigma, fmt="o", markersize=4, color=ORANGE,
                            label="share of scans that detect (±2σ)")  # fmt: skip
            shares.set_xlabel("range [km]")
            shares.set_ylabel("probability of detection [1]")
            shares.set(xlim=(0, 15.5), ylim=(0, 1.08))
            shares.legend(loc="lower left")

    data = {"range_km": middle_km, "share_detected": share, "pd": pd, "scans": looked}
    caption = "Scenario showing the radar probability of detection decreasing with range."
    return Made(rows, [Picture("fig_4_18", caption, draw)], {"fig_4_18": data})


def _pd(range_km: FloatArray) -> FloatArray:
    """Return the probability that the radar detects a small target at a range."""
    sensor = radar()
    snr = sensor.link_budget().snr(1000.0 * range_km, dbsm_to_m2(CLASSES["small"][0]))
    pd = detection_probability(
        snr, pulses=sensor.pulses, false_alarm_probability=sensor.false_alarm_probability
    )
    return np.asarray(pd)
