"""Folders of small encounters whose aircraft all bear the same names, and studies over them."""

import io
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from dsa_des.studies.chunk import run_chunk
from dsa_des.studies.study import Study
from tests.studies.conftest import FRAGILE, SCENE

ENCOUNTER = """NAME, sx, sy, sz, vx, vy, vz, time
unitless, [m], [m], [m], [m/s], [m/s], [m/s], [s]
OWN, 0, 0, 1000, 0, 50, 0, 0
INTRUDER, 100, {north}, 1010, 0, -60, 0, 0
OWN, 0, 500, 1000, 0, 50, 0, 10
INTRUDER, 100, {later}, 1010, 0, -60, 0, 10
"""
STUDY = """
scene = "small.toml"
seed = 4
replicas = 3
metrics = ["detection_share", "first_detection"]
[axes]
blocks.traffic.file = {{ files = {files} }}
blocks.radar.reach_km = [4.8, 4.9]
[draws]
blocks.radar.offset_s = {{ uniform = [0, 0.2] }}
"""


def write_scene(folder: Path) -> None:
    """Write a scene that replays a file, and its sensor."""
    start, end = SCENE.index("[blocks.traffic]"), SCENE.index("[blocks.transform]")
    traffic = '[blocks.traffic]\ntype = "traffic.daa_file"\nfile = "a.xyz"\n'
    (folder / "small.toml").write_text(SCENE[:start] + traffic + SCENE[end:])
    (folder / "fragile.py").write_text(FRAGILE)


def write_encounter(path: Path, north_m: float = 5000.0) -> None:
    """Write an encounter whose intruder begins that far ahead."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(ENCOUNTER.format(north=north_m, later=north_m - 600))


def write_study(folder: Path, files: str, more: str = "") -> Path:
    """Write a study over files."""
    path = folder / "study.toml"
    path.write_text(more + STUDY.format(files=files))
    return path


def rows_of(study: Study) -> pa.Table:
    """Return the rows of all runs of a study."""
    chunks = study.chunks(0, range(len(study.cells)))
    parts = [io.BytesIO(run_chunk(study, chunk).content) for chunk in chunks]
    return pa.concat_tables([pq.read_table(part) for part in parts])
