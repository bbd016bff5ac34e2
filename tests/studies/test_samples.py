"""Members of a sample have seeds and draws of their own; compared conditions share them."""

import shlex
from pathlib import Path
from typing import Any

import pytest

from dsa_des.studies.draws import axis_value_identity, member_seed
from dsa_des.studies.study_digest import record_of
from dsa_des.studies.study_file import read_study
from tests.support.encounter_folder import rows_of, write_encounter, write_scene, write_study


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene and encounters with the same aircraft; a, b and c hold the same to the byte."""
    write_scene(tmp_path)
    for name in "abc":
        write_encounter(tmp_path / f"{name}.xyz")
    write_encounter(tmp_path / "other" / "a.xyz", 4990)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def by_file(path: Path, *sets: str) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of each file of a study, without the numbers of cells."""
    found: dict[str, list[dict[str, Any]]] = {}
    for row in rows_of(read_study(path, sets=sets)).to_pylist():
        assert row["error"] is None
        del row["cell"]
        found.setdefault(row.pop("traffic.file"), []).append(row)
    return found


def test_encounters_with_aircraft_of_the_same_names_meet_other_chances(folder: Path) -> None:
    found = by_file(write_study(folder, '"*.xyz"'))
    assert list(found) == ["a.xyz", "b.xyz", "c.xyz"]
    for key in ("seed", "draw.radar.offset_s", "detection_share.radar"):
        values = {tuple(row[key] for row in rows) for rows in found.values()}
        assert len(values) == 3, key


def test_compared_values_meet_the_same_chances_in_the_same_encounter(folder: Path) -> None:
    for rows in by_file(write_study(folder, '"*.xyz"')).values():
        near, far = rows[:3], rows[3:]
        assert [r["radar.reach_km"] for r in rows] == [4.8] * 3 + [4.9] * 3
        for key in ("seed", "draw.radar.offset_s"):
            assert [row[key] for row in near] == [row[key] for row in far]
            assert len({row[key] for row in near}) == 3


def test_other_files_their_order_and_their_folder_change_no_file(folder: Path) -> None:
    study = write_study(folder, '["a.xyz", "b.xyz", "c.xyz"]')
    all_three = by_file(study)
    turned = by_file(study, 'axes.blocks.traffic.file.files=["c.xyz", "a.xyz"]')
    assert turned == {name: all_three[name] for name in ("c.xyz", "a.xyz")}
    moved = folder / "moved"
    for name in "ab":
        write_encounter(moved / f"{name}.xyz")
    assert by_file(study, f"axes.blocks.traffic.file.files='{moved}/*.xyz'") == {
        name: all_three[name] for name in ("a.xyz", "b.xyz")
    }


def test_files_of_one_name_in_two_folders_are_two_encounters(folder: Path) -> None:
    alone = by_file(write_study(folder, '"a.xyz"'))["a.xyz"]
    both = by_file(write_study(folder, '["a.xyz", "other/a.xyz"]'))
    first, second = both.values()
    assert first == alone
    assert {row["seed"] for row in first}.isdisjoint(row["seed"] for row in second)


def test_a_study_without_a_sample_keeps_its_seed_in_every_cell(folder: Path) -> None:
    study = read_study(write_study(folder, '"*.xyz"', more="over = []\n"))
    assert [study.member_seed(cell) for cell in range(6)] == [4] * 6
    rows = rows_of(study).to_pylist()
    assert len({row["seed"] for row in rows}) == 3
    sampled = read_study(write_study(folder, '"*.xyz"'))
    assert record_of(study).study_sha256 != record_of(sampled).study_sha256


def test_any_axis_can_be_a_sample_and_its_values_are_told_by_themselves(folder: Path) -> None:
    text = write_study(folder, '"a.xyz"', more='over = "blocks.radar.reach_km"\n')
    study = read_study(text, sets=["axes.blocks.radar.reach_km=[4, 4.5, 5.0]"])
    seeds = {study.labels(c)["radar.reach_km"]: study.member_seed(c) for c in range(3)}
    assert len({*seeds.values()}) == 3
    turned = read_study(text, sets=["axes.blocks.radar.reach_km=[5, 4.0]"])
    assert {turned.labels(c)["radar.reach_km"]: turned.member_seed(c) for c in range(2)} == {
        5: seeds[5.0],
        4.0: seeds[4],
    }
    file, reach = study.axes
    assert axis_value_identity(reach, 0) == ("4",)
    assert member_seed(4, [(file, 0), (reach, 1)]) == member_seed(4, [(reach, 1), (file, 0)])
    assert member_seed(4, []) == 4


def test_the_command_of_a_run_has_the_seed_and_draws_of_its_encounter(folder: Path) -> None:
    study = read_study(write_study(folder, '"*.xyz"'))
    row = rows_of(study).to_pylist()[4 * 3 + 1]
    words = shlex.split(study.command(4, 1))
    assert words[words.index("--seed") + 1] == str(row["seed"])
    drawn = next(word for word in words if word.startswith("blocks.radar.offset_s="))
    assert float(drawn.partition("=")[2]) == pytest.approx(row["draw.radar.offset_s"])
    assert any(word.endswith("c.xyz") for word in words)


def test_a_file_that_cannot_be_read_fails_alone(folder: Path) -> None:
    study = read_study(write_study(folder, '"*.xyz"'))
    (folder / "b.xyz").unlink()
    status = {r["traffic.file"]: r["status"] for r in rows_of(study).to_pylist()}
    assert status == {"a.xyz": "done", "b.xyz": "failed", "c.xyz": "done"}
