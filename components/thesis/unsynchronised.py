"""Fig. 4.22: radar at 5 Hz, IR at 2 Hz, and which of their detections are fused."""

from pathlib import Path

import numpy as np

from components.thesis.basis import predicted
from components.thesis.made import Made, Picture
from components.thesis.map_axes import draw_map, mark
from components.thesis.plotting import FUSION, IR, RADAR, legend_below, panels
from components.thesis.printed import printed
from components.thesis.row import Row
from components.thesis.scene_run import run, scene

_MARKS = {"radar": ("s", RADAR, 3.0), "ir": ("^", IR, 5.0), "radar+ir": ("D", FUSION, 5.0)}


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
            why, printed("fig-4.22", "share"), 0.0,
            basis=predicted(
                "the printed scan rates, 5 and 2 Hz, both from time 0 (assumption)",
                "thesis/fig_4_22.toml:blocks.radar.scan_rate_hz",
                "thesis/fig_4_22.toml:blocks.ir.scan_rate_hz")),
        Row("IR detections", alone + together, "", "30 s at 2 Hz, none missed."),
        Row("radar detections", len(fused["radar"]["time_s"]) + together, "",
            "30 s at 5 Hz, none missed."),
        Row("fused detections with a coincidence gate of 0.1 s", with_gate, "",
            "A gate is one way out; the thesis leaves it to the tracker."),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path, 1, 2, width_in=9.0, height_in=3.8) as (places, times):
            draw_map(places, done)
            for height, (name, (marker, colour, size)) in enumerate(_MARKS.items()):
                label = f"{name.replace('+', ' and ')}{' fused' if '+' in name else ' alone'}"
                style = {"marker": marker, "color": colour, "markersize": size}
                first = {key: column[fused[name]["time_s"] < 10.0]
                         for key, column in fused[name].items()}  # fmt: skip
                mark(places, done, first, **style, label=label)
                times.plot(first["time_s"], np.full(len(first["time_s"]), height), **style,
                           fillstyle="none", linestyle="none")  # fmt: skip
            places.set(xlim=(-1.55, -0.45), ylim=(2.2, 2.8))
            places.set_title("Radar/IR detection, first 10 s", loc="left")
            times.set_yticks(range(len(_MARKS)), ["radar alone", "IR alone", "fused"])
            times.set_xticks(range(11))
            times.set(xlim=(-0.3, 10.3), ylim=(-0.5, len(_MARKS) - 0.5))
            times.set_title("radar scan rate 5 Hz, IR scan rate 2 Hz", loc="left")
            times.set_xlabel("time [s]")
            legend_below(places, 5, without="ownship")

    data = {
        "sensors": [name for name, rows in fused.items() for _ in rows["time_s"]],
        "time_s": np.concatenate([rows["time_s"] for rows in fused.values()]),
    }
    caption = "Scenario with two sensors with different scan rates, which are not synchronised."
    return Made(rows, [Picture("fig_4_22", caption, draw)], {"fig_4_22": data})
