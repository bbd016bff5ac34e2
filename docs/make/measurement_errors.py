"""``python -m docs.make.measurement_errors docs/images``: draw errors over range.

The head-on intruder of ``first_light``, measured with errors that follow from the signal: every
look's error, and the standard deviation that its detection states.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

import dsa_des
from components.thesis.drawing import EO, RADAR, panels_written_as_png
from dsa_des.terminal.interruption import exit_plainly_on_signal

FIGURE = "measurement_errors.png"
BY_SIGNAL = (
    "blocks.radar.errors=signal", "blocks.radar.quantised=false", "blocks.radar.budget=free",
    "blocks.radar.azimuth_beamwidth_deg=5", "blocks.radar.elevation_beamwidth_deg=5",
    "blocks.eo.errors=signal", "blocks.eo.quantised=false",
    "blocks.eo.noise_equivalent_contrast=0.1",
)  # fmt: skip


def looks(block: str, *sets: str) -> dict[str, Any]:
    """Return the columns of a sensor's detections of the intruder."""
    table = dsa_des.run(dsa_des.load_scene("first_light", sets=sets)).detections
    columns = {n: table[n].to_numpy(zero_copy_only=False) for n in table.column_names}
    mine = (columns["block"] == block) & (columns["target"] == "head_on")
    return {name: values[mine] for name, values in columns.items()}


def draw(path: Path) -> None:
    """Draw azimuth and range of the radar, and azimuth of the camera, over range."""
    shown = (
        ("radar", RADAR, "azimuth_rad", "azimuth_variance_rad2", np.degrees(1.0), "azimuth, deg"),
        ("radar", RADAR, "range_m", "range_variance_m2", 1.0, "range, m"),
        ("eo", EO, "azimuth_rad", "azimuth_variance_rad2", np.degrees(1.0), "azimuth, deg"),
    )
    with panels_written_as_png(path, 1, 3, height_in=2.6) as axes:
        for one, (block, colour, name, variance, unit, text) in zip(axes, shown, strict=True):
            found, grid = looks(block, *BY_SIGNAL), looks(block)
            range_km = found["true_range_m"] / 1000.0
            error = np.abs(found[name] - found[f"true_{name}"]) * unit
            one.semilogy(range_km, error, ".", color=colour, alpha=0.4, markersize=3)
            one.semilogy(range_km, np.sqrt(found[variance]) * unit, color=colour, linewidth=1.5)
            one.axhline(np.sqrt(grid[variance][0]) * unit, color="black", linestyle=":")
            one.set_ylim(np.sqrt(found[variance].min()) * unit / 30.0, None)
            one.set_xlabel("range, km")
            one.set_title(f"{'EO' if block == 'eo' else block}: {text}", fontsize=9)


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.measurement_errors",
        description="Draw the errors of measured values over range.",
    )
    parser.add_argument("images", type=Path)
    draw(parser.parse_args(arguments).images / FIGURE)
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
