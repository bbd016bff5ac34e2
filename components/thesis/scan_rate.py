"""Fig. 4.21: two scan rates of the same scene, and how long its 1800 steps take."""

from pathlib import Path

import numpy as np

from components.thesis.basis import configured, predicted
from components.thesis.made import Made, Picture
from components.thesis.map_axes import draw_map, mark
from components.thesis.plotting import legend_below, panels
from components.thesis.printed import printed
from components.thesis.row import Row
from components.thesis.scene_run import run, scene

#: Scan rates of the two panels, Hz.
RATES_HZ = ("0.5", "0.1")
STEPS, INTRUDERS, SENSORS = 1800, 4, 3


def make() -> Made:
    """Return detections at two scan rates, and the time of the whole scene at 10 Hz."""
    loaded = scene("thesis/fig_4_21")
    run(loaded)  # the first run also loads what Python has not loaded yet
    timed = min((run(loaded) for _ in range(3)), key=lambda one: one.wall_s)
    scans = len(timed.rows("scans", block="radar")["time_s"])
    quick = (
        "NumPy computes look-ahead windows of scans at once on a newer processor; the thesis ran "
        "Matlab at 2.1 GHz, one target and step at a time"
    )
    runs = {rate: run(scene("thesis/fig_4_21", f"blocks.radar.scan_rate_hz={rate}"))
            for rate in RATES_HZ}  # fmt: skip
    seen = {rate: one.rows("detections", block="radar") for rate, one in runs.items()}
    why = "The fastest of three runs in memory, every sensor at every step; read from the clock."
    clock = predicted("a run on this machine", "thesis/fig_4_21.toml:blocks")
    rows = [
        Row("steps of the timed scene", scans, "", "", printed("fig-4.21", "steps"), 0.0,
            basis=configured("180 s at 10 Hz", "thesis/fig_4_21.toml:duration_s",
                             "thesis/fig_4_21.toml:blocks.radar.scan_rate_hz")),
        Row("intruders of the timed scene", len(timed.flights.targets), "", "",
            printed("fig-4.21", "intruders"), 0.0, basis=configured(
                "the scene's traffic", "thesis/fig_4_21.toml:blocks.traffic.intruders")),
        Row("time of the whole simulation, against §4.5", timed.wall_s, "s", why,
            printed("fig-4.21", "wall_s"), None, quick, clock),
        Row("time of the whole simulation, against §5.1.3", timed.wall_s, "s", why,
            printed("fig-4.21", "wall_later_s"), None, quick, clock,
            again="time of the whole simulation, against §4.5"),
        Row("target-scans per second", STEPS * INTRUDERS * SENSORS / timed.wall_s, "1/s",
            "4 × 1800 × 3 sensors over our time; 7200: over the thesis's 3 s (errata 24).",
            derived="7200"),
        *(Row(f"detections of the radar at {rate} Hz", len(rows["time_s"]), "",
              "The scene fig_4_21 with that scan rate.") for rate, rows in seen.items()),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, 1, 2, sharey=True, width_in=9.0, height_in=4.0) as axes:
            for one, rate in zip(axes, RATES_HZ, strict=True):
                draw_map(one, runs[rate])
                mark(one, runs[rate], seen[rate], markersize=3.5, label="detected by radar")
                one.set_title(f"Radar detection: scan rate {rate} Hz", loc="left")
            axes[1].set_ylabel("")
            legend_below(axes[0])

    data = {
        "scan_rate_hz": [rate for rate, rows in seen.items() for _ in rows["time_s"]],
        **{
            key: np.concatenate([rows[key] for rows in seen.values()])
            for key in ("target", "time_s", "true_azimuth_rad", "true_range_m")
        },
    }
    caption = (
        "Influence of the scan rate: four intruders, radar at two scan rates. The thesis timed "
        "this scenario over 1800 time steps."
    )
    return Made(rows, [Picture("fig_4_21", caption, draw)], {"fig_4_21": data})
