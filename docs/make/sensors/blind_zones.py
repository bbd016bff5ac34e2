"""``python -m docs.make.sensors.blind_zones docs/images``: draw blind zones of medium PRF."""

import argparse
import sys
from pathlib import Path

import numpy as np

from components.arguments.units import SPEED_OF_LIGHT_M_S
from components.radar.pulse_trains.ambiguity import count_clear_prfs
from components.thesis.drawing import panels_written_as_png
from dsa_des.terminal.interruption import exit_plainly_on_signal

FIGURE = "blind_zones.png"
#: The first four are those of docs/sensors.md, "Pulses".
PRFS_HZ = (8000.0, 9100.0, 10_300.0, 11_700.0, 8500.0, 9700.0, 11_000.0, 12_500.0)
NEEDED = 3
PULSE_WIDTH_S, FREQUENCY_HZ, NOTCH_M_S = 1e-6, 10e9, 15.0
FARTHEST_M, FASTEST_M_S = 40e3, 300.0


def zones(cells: int) -> dict[str, np.ndarray]:
    """Return which ranges (rows) and rates (columns) are blind to one PRF and to 3 of several."""
    middle = (np.arange(cells) + 0.5) / cells
    blind = {}
    for count, needed in ((1, 1), (4, NEEDED), (8, NEEDED)):
        seen = count_clear_prfs(
            middle[:, np.newaxis] * FARTHEST_M,
            (2.0 * middle - 1.0) * FASTEST_M_S,
            prfs_hz=PRFS_HZ[:count],
            pulse_width_s=PULSE_WIDTH_S,
            wavelength_m=SPEED_OF_LIGHT_M_S / FREQUENCY_HZ,
            notch_m_s=NOTCH_M_S,
        )
        title = f"{needed} of {count} PRFs" if count > 1 else f"{PRFS_HZ[0]:g} Hz alone"
        blind[title] = seen < needed
    return blind


def draw(file: Path) -> None:
    """Draw the zones, side by side."""
    blind = zones(1600)
    with panels_written_as_png(file, 1, len(blind), sharey=True, height_in=3.2) as each:
        for axes, (title, zone) in zip(each, blind.items(), strict=True):
            extent = (-FASTEST_M_S, FASTEST_M_S, 0.0, FARTHEST_M / 1000.0)
            axes.imshow(
                zone, origin="lower", aspect="auto", extent=extent, cmap="Greys", vmin=0, vmax=1.5,
                interpolation="nearest",
            )  # fmt: skip
            axes.grid(visible=False)
            axes.set_title(f"{title}: {100.0 * zone.mean():.0f} % blind", fontsize=9)
            axes.set_xlabel("range rate, m/s")
        each[0].set_ylabel("range, km")


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.sensors.blind_zones",
        description="Draw which ranges and range rates a radar of medium PRF is blind at.",
    )
    parser.add_argument("images", type=Path)
    draw(parser.parse_args(arguments).images / FIGURE)
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
