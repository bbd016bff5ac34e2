"""Fig. 4.17: where each of the three sensors looks and detects."""

from pathlib import Path

import numpy as np

from components.display.symbols import styles_of
from components.evidence.thesis.basis import configured
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.map_axes import draw_map, mark
from components.evidence.thesis.plotting import GREY, legend_below, panels
from components.evidence.thesis.printed import printed
from components.evidence.thesis.row import Row
from components.evidence.thesis.scene_run import run, scene

#: Sensor → where the half width of its field of view is printed.
EDGES = {
    "radar": "Table 2.2",
    "eo": "Table 2.5, 220° across",
    "ir": "Table 2.6, 100° across",
}
STEP_DEG = 100.0 / 4000.0 * 180.0 / np.pi


def make() -> Made:
    """Return the azimuths between which each sensor detects a circling intruder."""
    done = run(scene("thesis/fig_4_17"))
    seen = {name: done.rows("detections", block=name) for name in EDGES}
    rows = []
    for name, source in EDGES.items():
        edge = configured(f"the field of view of {name}, {source}",
                          f"thesis/fig_4_17.toml:blocks.{name}.azimuth_deg")  # fmt: skip
        azimuth = np.degrees(seen[name]["true_azimuth_rad"])
        for side, ours in (("right", azimuth.max()), ("left", -azimuth.min())):
            rows.append(Row(f"outermost detection to the {side}, {name}", float(ours), "deg",
                            f"The intruder moves {STEP_DEG:.2f}° per scan.",
                            printed("fig-4.17", name), STEP_DEG, basis=edge))  # fmt: skip
    rows += [
        Row(f"detections of the {name} in one circle", len(seen[name]["time_s"]), "",
            "One scan per second, the circle takes 251 s.")
        for name in EDGES
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, 1, 3, sharey=True, width_in=9.0, height_in=3.6) as axes:
            for one, name in zip(axes, EDGES, strict=True):
                draw_map(one, done, fields_of_view=(name,))
                style = styles_of([name], done.simulation.components)[name]
                mark(one, done, seen[name], markersize=3.5, color=style.colour)
                one.set_title(f"{name}: ±{printed('fig-4.17', name)}°", loc="left")
                one.set(xlim=(-6.4, 6.4), ylim=(-4.4, 6.4))
            grey = {"color": GREY, "linestyle": "none", "fillstyle": "none", "markersize": 3.5}
            axes[0].plot([], [], "o", **grey, label="detected (in the sensor's colour)")
            legend_below(axes[0], without="field of view")
            for one in axes[1:]:
                one.set_ylabel("")

    data = {
        key: np.concatenate([values[key] for values in seen.values()])
        for key in ("block", "time_s", "true_azimuth_rad", "true_range_m")
    }
    caption = (
        "All three sensors' fields of view: the ownship (star) is stationary, the intruder circles "
        "it, and circles mark where each sensor detects it. The range of a field of view is only "
        "the farthest that is looked at."
    )
    return Made(rows, [Picture("fig_4_17", caption, draw)], {"fig_4_17": data})
