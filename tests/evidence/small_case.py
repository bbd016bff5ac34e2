"""A small case, and the command that makes its pack."""

import json
from pathlib import Path
from typing import NamedTuple

from click.testing import CliRunner

from dsa_des.cli import main

SCENE = """
extends = "avoidance/airspace"
[blocks.radar]
range_km = 3
[blocks.avoidance]
range_km = 1.2
"""
STUDY = """
title = "small"
scene = "scene.toml"
replicas = 24
runs_per_chunk = 24
seed = 3
metrics = [
  { metric = "risk_ratio", horizontal_m = 800, vertical_m = 150, by = [], needless = true },
]
[draws]
blocks.traffic.encounter = { sequence = [7, 1] }
"""
CASE = """
title = "A small case"
study = "study.toml"
also = ["needless_manoeuvre_share"]
sensitivity_replicas = 6

[system]
name = "a system"
version = "7b"

[[requirements]]
name = "lost"
text = "Little is lost."
source = "a test"
result = "well_clear_lost_risk_ratio"
most = 2
unit = "of what is lost without"

[[requirements]]
name = "turns"
text = "It turns now and then."
source = "a test"
result = "manoeuvred"
least = 0.01
unit = "of the encounters"

[convergence]
share = 1
of = "estimate"
over_last = 0.25

[[beside]]
name = "slow"
study = "slow.toml"
about = "The same with a slow radar."

[[sensitivity]]
key = "blocks.avoidance.range_km"
unit = "km"
values = [1.6, 9]

[[sensitivity]]
key = "blocks.radar.declare_speed_m_s"
unit = "m/s"
values = [200]

[sample]
model = "light aircraft"
licence = "ours"
weights = "undone"

[sources]
traffic = "us"
radar = "a sheet"
"radar.range_cell_m" = "another sheet"
avoidance = "a report"
wires = "a guess"

[[left_out]]
what = "weather"
why = "it is fine"
"""


class Made(NamedTuple):
    """A pack and what was said when it was made."""

    folder: Path
    output: str
    code: int

    @property
    def evidence(self) -> dict:
        return json.loads((self.folder / "evidence.json").read_text(encoding="utf-8"))


def evidence(*words: object) -> tuple[str, int]:
    """Run the command in this process; return what it said, on one line, and its exit code."""
    result = CliRunner().invoke(main, ["evidence", *map(str, words)])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return " ".join(result.output.split()), result.exit_code


def made(case: Path, out: Path, *words: object) -> Made:
    return Made(out, *evidence(case, "--out", out, "--workers", 1, *words))


def write_case(folder: Path) -> Path:
    """Write the small case into a folder and return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    slow = (
        STUDY + "[set]\nblocks.radar.scan_rate_hz = 0.1\nblocks.radar.azimuth_deg = [-180, 180]\n"
    )
    (folder / "slow.toml").write_text(slow.replace("replicas = 24", "replicas = 8"))
    (folder / "case.toml").write_text(CASE, encoding="utf-8")
    return folder / "case.toml"
