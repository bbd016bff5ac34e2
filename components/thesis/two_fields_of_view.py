"""Fig. 4.20: one intruder through two fields of view, with all four combinations of detection."""

from pathlib import Path

import numpy as np

from components.thesis.made import Made, Picture
from components.thesis.map_axes import draw_map, mark, true_places
from components.thesis.plotting import EO, FUSION, RADAR, legend_below, panels
from components.thesis.row import Row
from components.thesis.scene_run import run, scene

COMBINATIONS = {"radar": ("s", RADAR), "radar+eo": ("D", FUSION), "eo": ("o", EO)}


def make() -> Made:
    """Return how many scans have which combination of detections."""
    done = run(scene("thesis/fig_4_20"))
    fused = {name: done.rows("fused", block="fusion", sensors=name) for name in COMBINATIONS}
    scans = len(done.rows("scans", block="radar")["time_s"])
    counts = {name: len(rows["time_s"]) for name, rows in fused.items()}
    counts["no detection"] = scans - sum(counts.values())
    both = np.degrees(fused["radar+eo"]["true_azimuth_rad"])
    why = "The scene fig_4_20; both sensors scan once per second."
    rows = [
        Row("combinations of detection that occur", sum(count > 0 for count in counts.values()), "",
            f"{why} The thesis lists four, and the scene is laid out so that they occur.",
            derived="4, listed"),
        *(Row(f"scans with: {name}", count, "", why) for name, count in counts.items()),
        Row("azimuth from which both detect", float(both.min()), "deg",
            "The EO camera's field of view begins at -15°."),
        Row("azimuth up to which both detect", float(both.max()), "deg",
            "The radar's field of view ends at 15°."),
        Row("share of EO-only detections without a range",
            float(np.isnan(fused["eo"]["range_m"]).mean()), "", "A camera measures none."),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, height_in=4.3) as (axes,):
            draw_map(axes, done, fields_of_view=("radar", "eo"))
            for name, (marker, colour) in COMBINATIONS.items():
                label = f"detected by {name.replace('+', ' and ')}"
                mark(axes, done, fused[name], marker=marker, color=colour, label=label)
            axes.set(xlim=(-5.4, 5.4), ylim=(-0.4, 6.2))
            legend_below(axes, 3)

    east, north = zip(*(true_places(done, rows) for rows in fused.values()), strict=True)
    data = {
        "sensors": [name for name in fused for _ in range(counts[name])],
        "time_s": np.concatenate([rows["time_s"] for rows in fused.values()]),
        "east_km": np.concatenate(east),
        "north_km": np.concatenate(north),
    }
    caption = (
        "The workings of the fusion by one intruder traversing two fields of view from left to "
        "right: no detection, radar, radar and EO, EO alone, no detection."
    )
    return Made(rows, [Picture("fig_4_20", caption, draw)], {"fig_4_20": data})
