"""A study with one encounter per replica: its weight stands beside what came of it."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import dsa_des
from components.formats.set_file import read_set
from dsa_des.studies.draws import parse_draw
from tests.encounters.test_pairing import TURNS
from tests.encounters.test_set_file import call

ROOT = Path(__file__).parents[2]
STUDY = """\
scene = "scene.toml"
replicas = 6
metrics = ["encounter_weight", "well_clear", "closest_approach"]
[draws]
blocks.traffic.encounter = { sequence = [1, 1] }
"""


def test_a_sequence_gives_each_replica_the_next_number() -> None:
    draw = parse_draw("blocks.traffic.encounter", {"sequence": [10, 3]})
    assert [draw.value(seed, k, 5) for seed in (1, 2) for k in range(3)] == [10, 13, 16] * 2
    for wrong in ([1.5, 1], [1], {"normal": [1, 2]}, [True, 1], [2**50, 1]):
        with pytest.raises(ValueError, match="sequence"):
            parse_draw("blocks.traffic.encounter", {"sequence": wrong})


def made(folder: Path, count: int, more: str = "") -> tuple[Path, Path]:
    """Return a set, and a scene that flies one of its encounters."""
    (folder / "model.txt").write_text(TURNS, encoding="utf-8")
    file, scene = folder / "set.parquet", folder / "scene.toml"
    call("generate", "--model", folder / "model.txt", "--count", count, "--out", file)
    scene.write_text(
        f'extends = "{ROOT}/configs/detect_and_sense.toml"\nduration_s = 180\n'
        f'[blocks.traffic]\ntype = "traffic.encounters"\nfile = "{file}"\n{more}',
        encoding="utf-8",
    )
    return file, scene


def test_a_sequence_beyond_the_end_of_a_set_is_one_error_before_any_run(tmp_path: Path) -> None:
    file, _ = made(tmp_path, 6)  # numbered from 0: the sixth replica has none
    study = tmp_path / "study.toml"
    study.write_text(STUDY, encoding="utf-8")
    with pytest.raises(dsa_des.SceneError) as error:
        dsa_des.study(study, out=tmp_path / "out", workers=1)
    (problem,) = error.value.problems
    for said in ("last of 6 replicas", f"{file}: there is no encounter 6", "holds 6,", "0 to 5"):
        assert said in str(problem)
    assert "draws.blocks.traffic.encounter" in str(problem)
    assert not (tmp_path / "out").exists()


def test_every_replica_flies_its_encounter_and_says_its_weight(tmp_path: Path) -> None:
    file, _ = made(tmp_path, 8)
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    dsa_des.study(tmp_path / "study.toml", out=tmp_path / "out", workers=1)
    table = pq.read_table(tmp_path / "out" / "parts").to_pydict()
    assert table["error"] == [None] * 6
    found = read_set(file)
    assert table["encounter"] == [1, 2, 3, 4, 5, 6]
    assert table["encounter_weight"] == pytest.approx(found.weights[1:7])
    # Numbers that are names have no mean.
    summed = pq.read_table(tmp_path / "out" / "summary.parquet")["result"].to_pylist()
    assert "encounter_weight" in summed
    assert not {"encounter", "encounter_family"} & {*summed}
    # Closest approaches are those of the set: its own geometry, by straight paths between seconds.
    for k, (number, closest) in enumerate(
        zip(range(1, 7), table["closest_approach_m"], strict=True)
    ):
        paths = [np.array(found.path(int(found.first_rows[number]) + a)[1:]) for a in (0, 1)]
        apart = np.sqrt(((paths[1] - paths[0]) ** 2).sum(axis=0)).min()
        assert closest == pytest.approx(apart, rel=0.02, abs=30.0), k


def test_a_number_that_the_set_does_not_hold_is_said(tmp_path: Path) -> None:
    _, scene = made(tmp_path, 2, "encounter = 7\n")
    with pytest.raises(Exception, match="there is no encounter 7; it holds 2, numbered from 0 to"):
        dsa_des.run(scene)
