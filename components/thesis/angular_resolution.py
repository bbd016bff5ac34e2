"""Fig. 4.19: what a coarser azimuth grid does to what the radar reports."""

from pathlib import Path

import numpy as np

from components.thesis.basis import configured
from components.thesis.made import Made, Picture
from components.thesis.map_axes import draw_map, ray, reported_places
from components.thesis.plotting import RADAR, legend_below, panels
from components.thesis.printed import printed
from components.thesis.row import Row
from components.thesis.scene_run import run, scene

#: The panel's title in the thesis, and Table 2.2's own.
RESOLUTIONS_DEG = (1.0, 2.5)


def make() -> Made:
    """Return spacing and errors of the reported azimuths at both resolutions."""
    runs, seen = {}, {}
    for step in RESOLUTIONS_DEG:
        loaded = scene("thesis/fig_4_19", f"blocks.radar.azimuth_resolution_deg={step}")
        runs[step] = run(loaded)
        seen[step] = runs[step].rows("detections", block="radar")
    rows = []
    for step in RESOLUTIONS_DEG:
        reported = np.unique(np.round(np.degrees(seen[step]["azimuth_rad"]), 9))
        error = np.degrees(seen[step]["azimuth_rad"] - seen[step]["true_azimuth_rad"])
        grid = configured(
            "the azimuth grid of scene fig_4_19", "angular_resolution:RESOLUTIONS_DEG"
        )
        rows += [
            Row(f"spacing of the reported azimuths at {step:g}°", float(np.diff(reported).min()),
                "deg", "Rounded to the sensor's grid (§3.5.1).",
                printed("fig-4.19", "coarse_deg" if step == 2.5 else "fine_deg"), 1e-6,
                basis=grid),
            Row(f"largest azimuth error at {step:g}°", float(np.abs(error).max()), "deg",
                "At most half a step of the grid."),
        ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, 1, 2, sharey=True, width_in=9.0, height_in=3.9) as axes:
            for one, step in zip(axes, RESOLUTIONS_DEG, strict=True):
                draw_map(one, runs[step])
                for azimuth in np.unique(np.round(np.degrees(seen[step]["azimuth_rad"]), 6)):
                    one.plot(*ray(azimuth, 6.0), color="#BBBBBB", linewidth=0.5, zorder=0.5)
                east, north = reported_places(seen[step])
                one.plot(east, north, "o", color=RADAR, fillstyle="none", markersize=4.5,
                         label="reported by radar")  # fmt: skip
                one.set_title(f"Radar detection: azimuth resolution {step:g}°", loc="left")
                one.set(xlim=(-4.2, 4.2), ylim=(-0.4, 5.0))
            axes[1].set_ylabel("")
            legend_below(axes[0])

    data = {
        "resolution_deg": np.concatenate([np.full(len(v["scan"]), k) for k, v in seen.items()]),
        **{
            key: np.concatenate([values[key] for values in seen.values()])
            for key in ("time_s", "azimuth_rad", "true_azimuth_rad", "range_m", "true_range_m")
        },
    }
    caption = (
        "What happens when the angular resolution of a sensor is changed: reported positions lie "
        "on rays of the grid (grey)."
    )
    return Made(rows, [Picture("fig_4_19", caption, draw)], {"fig_4_19": data})
