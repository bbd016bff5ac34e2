"""DEGAS's recorded bands beside ours, cell by cell: 271 directions and 6 altitudes a second."""

import gzip
import math
import tempfile
from pathlib import Path

import numpy as np

from components.alert_configuration.conf_file import read_conf
from components.arguments.units import FOOT_M
from components.guidance.bands import guidance_of_many
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State

DATA = Path(__file__).parents[4] / "shared" / "data" / "published" / "degas"
_CODE = {"NONE": 0, "RECOVERY": 1, "MID": 3, "NEAR": 4}
# An edge counts for either side of it: of positions, rad and m.
_EDGE = 1e-9

_TEXT = """
**Its bands, cell by cell.** It asks DAIDALUS 2.0.1, and recorded {of_directions:,} directions and
{of_altitudes:,} altitudes, {seconds} seconds long. With `daidalus_version = 2.0.1`
{directions:,} and {altitudes:,} of them are equal (a value on an edge has the region of either
side), given the velocity of the previous step of 0.1 s, which its logic uses; with that of the
instant itself {other} cells at edges of a turning ownship's bands differ.
"""


def equal_cells(folder: Path, lag: int) -> tuple[int, int, int, int]:
    """Return how many directions are equal and how many there are, and the same of altitudes.

    Positions are those of the second, velocities those of `lag` steps of 0.1 s before.
    """
    lines = gzip.decompress((folder / "trajectory_int_perf.csv.gz").read_bytes()).decode()
    names, *rows = lines.splitlines()
    flown = dict(zip(names.split(","), np.loadtxt(rows, delimiter=",").T, strict=True))
    told = gzip.decompress((folder / "daaGuidance_int_perf.csv.gz").read_bytes()).decode()
    recorded = np.loadtxt(told.splitlines(), delimiter=",")
    with tempfile.TemporaryDirectory() as other:
        path = Path(other) / "older.conf"
        text = (folder / "degas_noncoop_daidalus201.conf").read_text(encoding="utf-8")
        path.write_text(f"{text}\ndaidalus_version = 2.0.1\n", encoding="utf-8")
        configuration = read_conf(path)
    now = np.rint(10.0 * recorded[:, 0]).astype(int)
    before = np.maximum(now - lag, 0)

    def states(who: str) -> State:
        axes = ("east", "north", "up")
        east, north, up = (FOOT_M * flown[f"{who}_{axis}_ft"][now] for axis in axes)
        speed, track = FOOT_M * flown[f"{who}_speed_ftps"][before], flown[f"{who}_psi_rad"][before]
        return State(east, north, up, speed * np.sin(track), speed * np.cos(track), 0.0 * up)

    own, other_one = states("own"), states("int")
    other_one = other_one._replace(
        east_m=other_one.east_m - own.east_m, north_m=other_one.north_m - own.north_m
    )
    own = own._replace(east_m=0.0 * own.east_m, north_m=0.0 * own.north_m)
    nobody_turns = np.zeros(len(now), dtype=int)
    others = [GuidedIntruders(other_one, configuration.alerters[0], nobody_turns)]
    turned, climbed = (
        guidance_of_many(kind, configuration, own, others) for kind in ("hdir", "alt")
    )
    counts = np.zeros((2, 2), dtype=int)
    for line, found, level in zip(recorded, turned, climbed, strict=True):
        turns = (found.own_value + np.radians(np.arange(-135, 136))) % (2.0 * math.pi)
        each = ((found.bands, turns, line[1:272]),
                (level.bands, FOOT_M * line[272::2], line[273::2]))  # fmt: skip
        for kind, (bands, values, wanted) in enumerate(each):
            for value, want in zip(values, wanted, strict=True):
                got = {_CODE[b.region] for b in bands if b.low - _EDGE <= value <= b.high + _EDGE}
                counts[kind] += want in got, 1
    directions, altitudes = counts.tolist()
    return (*directions, *altitudes)


def text(folder: Path = DATA) -> str:
    """Compare the bands and return the text; of what is not at hand nothing is said."""
    if not folder.exists():
        return f"\nIts bands are compared where the page is made with {folder.name} at hand.\n"
    directions, of_directions, altitudes, of_altitudes = equal_cells(folder, 1)
    late = equal_cells(folder, 0)
    return _TEXT.format(
        directions=directions, of_directions=of_directions, altitudes=altitudes,
        of_altitudes=of_altitudes, seconds=of_altitudes // 6,
        other=late[1] - late[0] + late[3] - late[2],
    )  # fmt: skip
