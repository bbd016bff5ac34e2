"""Fig. 4.22: radar at 5 Hz, IR at 2 Hz, and which of their detections are fused."""

from pathlib import Path

import numpy as np

from components.thesis.made import Made, Picture
from components.thesis.map_axes import draw_map, mark
from components.thesis.plotting import BLUE, GREEN, RED, panels
from components.thesis.row import Row
from components.thesis.scene_run import run, scene

_MARKS = {"radar": ("o", GREEN, 4.0), "ir": ("^", BLUE, 6.0), "radar+ir": ("s", RED, 6.0)}


def make() -> Made:
    """Return the share of IR detections that have a radar detection at the same instant."""
    done = run(scene("thesis/fig_4_22"))
    fused = {name: done.rows("fused", block="fusion", sensors=name) for name in _MARKS}
    alone, together = len(fused["ir"]["time_s"]), len(fused["radar+ir"]["time_s"])
    gated = run(scene("thesis/fig_4_22", "blocks.fusion.coincidence_s=0.1"))
    with_gate = len(gated.rows("fused", block="fusion", sensors="radar+ir")["time_s"])
    why = "Scans k/2 s and k/5 s meet every second: at every second IR scan (errata 25)."
    rows = [
        Row("share of IR detections fused with the radar's", together / (alone + together), "",
            why, "0.5", 0.0),
        Row("IR detections", alone + together, "", "30 s at 2 Hz, none missed."),
        Row("radar detections", len(fused["radar"]["time_s"]) + together, "",
            "30 s at 5 Hz, none missed."),
        Row("fused detections with a coincidence gate of 0.1 s", with_gate, "",
            "A gate is one way out; the thesis leaves it to the tracker."),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, height_in=4.2) as (axes,):
            draw_map(axes, done)
            for name, (marker, colour, size) in _MARKS.items():
                label = f"{name.replace('+', ' and ')}{' fused' if '+' in name else ' alone'}"
                mark(axes, done, fused[name], marker=marker, color=colour, markersize=size,
                     label=label)  # fmt: skip
            axes.set_aspect("auto")
            axes.set(xlim=(-1.7, 1.7), ylim=(-0.2, 3.2))
            axes.set_title("Radar/IR detection: radar at 5 Hz, IR at 2 Hz", loc="left")
            axes.legend(loc="lower right", ncols=1)

    data = {
        "sensors": [name for name, rows in fused.items() for _ in rows["time_s"]],
        "time_s": np.concatenate([rows["time_s"] for rows in fused.values()]),
    }
    caption = "Scenario with two sensors with different scan rates, which are not synchronised."
    return Made(rows, [Picture("fig_4_22", caption, draw)], {"fig_4_22": data})
