"""Splitting by its options: the seed, the least score of each encounter, heights; what is told."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from components.encounters.splitting import least_miss_in_nmac_sizes
from components.formats.set_file import read_set
from dsa_des.cli import main
from tests.encounters.scenes.test_risk_of_a_set import SCENE, table
from tests.encounters.test_set_file import call


@pytest.fixture
def file(tmp_path: Path) -> Path:
    import pyarrow.parquet as pq

    where = {b"dsa_des.encounters": b'{"reference_deg": [-41.3, 174.2]}'}
    pq.write_table(table().replace_schema_metadata(where), tmp_path / "set.parquet")
    return tmp_path / "set.parquet"


def split(file: Path, *words: object) -> list[float]:
    """Families of the copies."""
    out = file.parent / "out.parquet"
    out.unlink(missing_ok=True)
    done = call("split", file, "--out", out, *words)
    assert done.exit_code == 0, done.stderr
    return read_set(out).extra["family"].tolist()


def test_another_seed_is_another_lot(file: Path) -> None:
    words = ("--levels", "1e9", "--copies", "1,2.5")
    one, again, other = (split(file, *words, "--seed", seed) for seed in (1, 1, 2))
    assert one == again
    lots = [split(file, *words, "--seed", seed) for seed in range(3, 7)]
    assert any(lot != one for lot in [other, *lots])


def test_the_least_score_of_an_encounter_counts(file: Path) -> None:
    """It stands in the first, the middle or the last of its rows."""
    scores = {0: (9, 9, 9), 1: (2, 9, 9), 2: (9, 2, 9), 3: (9, 9, 2), 4: (7, 8, 9),
              5: (6, 6, 6)}  # fmt: skip
    lines = [f"{number},{score}" for number, row in scores.items() for score in row]
    (file.parent / "s.csv").write_text("encounter,near\n" + "\n".join(lines) + "\n", "utf-8")
    found = split(file, "--levels", "5", "--copies", "1,3", "--scores", file.parent / "s.csv",
                  "--score", "near")  # fmt: skip
    assert read_set(file.parent / "out.parquet").reference_deg == (-41.3, 174.2)
    assert found == [3, 1, 1, 1, 2, 2, 2, 2, 2, 2, 0, 5]  # families of encounters 0 to 5


def test_nearness_is_in_sizes_of_the_cylinder(file: Path) -> None:
    """Straight flights that meet above each other: by time steps of their own paths."""
    found = read_set(file)
    for place in range(len(found)):
        own, other = found.path(2 * place), found.path(2 * place + 1)
        assert np.array_equal(own[0], other[0])
        across = np.hypot(own[1] - other[1], own[2] - other[2]) / (500 * 0.3048)
        height = np.abs(own[3] - other[3]) / (100 * 0.3048)
        assert np.ptp(height) == pytest.approx(0.0, abs=1e-9) and height[0] > 0.5
        assert least_miss_in_nmac_sizes(found, place) == pytest.approx(
            np.maximum(across, height).min()
        )
    assert least_miss_in_nmac_sizes(found, 5) == pytest.approx(400.0 / 30.48)  # by its height alone


def test_a_run_tells_the_number_and_weight_of_its_encounter(file: Path) -> None:
    import json

    (file.parent / "scene.toml").write_text(SCENE, encoding="utf-8")
    out = file.parent / "run"
    words = ["run", str(file.parent / "scene.toml"), "--out", str(out), "--no-figures", "--quiet",
             "--set", "blocks.traffic.encounter=2", "--set", "duration_s=1"]  # fmt: skip
    done = CliRunner().invoke(main, words, catch_exceptions=False)
    assert done.exit_code == 0
    told = json.loads((out / "run.json").read_text("utf-8"))
    assert _found(told, "encounter") == {"number": 2, "weight": 3.0}


def _found(told: object, name: str) -> object:
    """The mapping of a name, wherever it stands."""
    if isinstance(told, dict):
        if isinstance(told.get(name), dict):
            return told[name]
        told = list(told.values())
    if isinstance(told, list):
        return next((one for part in told if (one := _found(part, name)) is not None), None)
    return None
