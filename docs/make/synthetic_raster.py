"""``python -m docs.make.synthetic_raster FOLDER``: the island that is shipped.

A square degree in the style of SRTM with two ridges, a valley between them and the sea around:
``configs/terrain/S42W180.hgt``. It is no place on Earth; sums of bells in whole metres, so that
anybody can make it again to the byte.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from components.arguments.checks import FloatArray
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

NAME = "S42W180.hgt"
NODES = 241
# Middle of each ridge (share of the square from west and south), half lengths across and along,
# bearing of its crest in degrees, and height in metres.
_RIDGES = (
    (0.30, 0.55, 0.035, 0.22, 20.0, 1450.0),
    (0.62, 0.50, 0.050, 0.25, -10.0, 1900.0),
    (0.48, 0.20, 0.080, 0.10, 60.0, 700.0),
)


def synthetic_heights_m() -> FloatArray:
    """Return the heights, rows from north to south, in whole metres."""
    share = np.linspace(0.0, 1.0, NODES)
    x, y = np.meshgrid(share, share[::-1])
    height = np.zeros_like(x)
    for west, south, across, along, bearing, top in _RIDGES:
        turn = np.radians(bearing)
        east, north = x - west, y - south
        side = (east * np.cos(turn) - north * np.sin(turn)) / across
        crest = (east * np.sin(turn) + north * np.cos(turn)) / along
        height += top * np.exp(-0.5 * (side * side + crest * crest))
    # The sea is level: what would be under 1 m is 0.
    return np.where(height >= 1.0, np.round(height), 0.0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the raster into a folder; return the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    if len(given) != 1 or not Path(given[0]).is_dir():
        say("error: one argument is needed, a folder that exists", err=True)
        return 2
    path = Path(given[0]) / NAME
    path.write_bytes(synthetic_heights_m().astype(">i2").tobytes())
    say(f"{path}: {NODES} by {NODES} nodes")
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
