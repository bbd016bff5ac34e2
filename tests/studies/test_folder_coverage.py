"""Studies over folders of encounters, run as a whole: their intervals hold what is known exactly.

The sensors look in a rhythm that is drawn and see by chance, whatever the geometry, so that the
truth over all encounters is known without simulation. Aircraft have the same names in every file.
"""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from dsa_des.results.summary import compare_axis, summarise
from dsa_des.studies import study as study_module
from dsa_des.studies.study_digest import result_columns_of_study
from dsa_des.studies.study_file import read_study
from tests.results.conftest import rows_of_table
from tests.support.encounter_folder import rows_of, write_encounter, write_scene

SENSOR = '''
import numpy as np
from components.sensor import Look, Sensor, SensorParameters


class ByChanceParameters(SensorParameters):
    chance: float = 0.6


class ByChance(Sensor):
    """Detects with the same chance at every look."""

    Parameters = ByChanceParameters
    lockstep = True
    measures_range = True

    def look(self, cells):
        return Look(cells.draws(self.stream("detection")) < self.p.chance, np.zeros(len(cells)))
'''
STUDY = """
scene = "small.toml"
replicas = 3
runs_per_chunk = 1000
metrics = ["first_detection", "detection_share"]
compare = { axis = "blocks.radar.chance", baseline = 0.6 }
[axes]
blocks.traffic.file = { files = "encounters/*.xyz" }
blocks.radar.chance = [0.6, 0.4]
[draws]
blocks.radar.offset_s = { uniform = [0, 0.2] }
"""
FILES, ROUNDS = 6, 24
#: Scans come every 0.2 s after the offset, and 1/p - 1 of them see nothing; the IR looks 12 times.
TRUTHS = {
    "first_detection_time_s.radar": 0.1 + 0.2 * (1 / 0.6 - 1),
    "detection_share.radar": 0.6,
    "detection_share.ir": 0.08,
    "detected.ir": 1 - 0.92**12,
}
CHANGES = {
    "first_detection_time_s.radar": 0.2 * (1 / 0.4 - 1 / 0.6),
    "detection_share.radar": -0.2,
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_scene(tmp_path)
    scene = (tmp_path / "small.toml").read_text()
    scene = scene.replace("fragile:Fragile", "by_chance:ByChance")
    scene = scene.replace("reach_km = 4.8", "chance = 0.6").replace("reach_km = 9", "chance = 0.08")
    (tmp_path / "small.toml").write_text(scene.replace('"a.xyz"', '"encounters/00.xyz"'))
    (tmp_path / "by_chance.py").write_text(SENSOR)
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def held(folder: Path, rounds: int) -> dict[str, float]:
    """Return how often intervals hold the truth, over folders of other encounters each time."""
    random = np.random.default_rng(11)
    count: dict[str, int] = {}
    for number in range(rounds):
        for file in range(FILES):
            north_m = random.uniform(4000.0, 6000.0)
            write_encounter(folder / "encounters" / f"{file:02d}.xyz", north_m)
        if number == 0:
            read = read_study(folder / "study.toml")
            results = result_columns_of_study(read)
        rows = rows_of_table(
            rows_of(dataclasses.replace(read, seed=number)),
            [axis.column for axis in read.axes],
            read.over,
        )
        assert not rows.failed
        for line in summarise(rows, results, 0.95, "t", {}):
            name, e = line.result.name, line.estimate
            if line.at == (0.6,) and name in TRUTHS:
                assert e.count == FILES
                count[name] = count.get(name, 0) + (e.low <= TRUTHS[name] <= e.high)
        for item in compare_axis(rows, "radar.chance", 0.6, results, 0.95, "t"):
            if item.result.name in CHANGES:
                name, d = f"change of {item.result.name}", item.difference.paired
                truth = CHANGES[item.result.name]
                count[name] = count.get(name, 0) + (d.low <= truth <= d.high)
    return {name: times / rounds for name, times in count.items()}


def test_folders_of_encounters_with_the_same_names_cover(folder: Path) -> None:
    found = held(folder, ROUNDS)
    assert len(found) == len(TRUTHS) + len(CHANGES)
    # Chance moves 95 % of 24 by 4.4 % (one standard deviation).
    for name, share in found.items():
        assert 0.87 <= share <= 1.0, (name, share)


def test_the_same_draws_in_every_encounter_would_be_found_out(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study_module, "member_seed", lambda seed, members: seed)
    found = held(folder, 8)
    assert found["first_detection_time_s.radar"] < 0.7
    assert found["detection_share.radar"] < 0.7
