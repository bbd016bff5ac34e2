"""A run folder appears whole or not at all, and reads back as Arrow tables."""

import json
import stat

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import dsa_des
from dsa_des.errors import UsageError
from dsa_des.run_folder import (
    RUN_JSON,
    check_target,
    new_folder_name,
    read_run,
    write_json,
    writing,
)


def fill(folder, rows=3):
    write_json(folder / RUN_JSON, {"seed": 1, "counts": {"b": 2, "a": 1}})
    (folder / "scene.toml").write_text("seed = 1\n", encoding="utf-8")
    pq.write_table(pa.table({"x": list(range(rows))}), folder / "scans.parquet")


def left_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_takes_its_name_when_it_is_complete(tmp_path):
    target = tmp_path / "new" / "deep" / "run"
    with writing(target) as folder:
        assert folder != target and folder.parent == target.parent
        assert not target.exists()
        fill(folder)
    assert left_in(target.parent) == ["run"]
    run = read_run(target)
    assert run.info == {"seed": 1, "counts": {"a": 1, "b": 2}}
    assert run["scans"].column("x").to_pylist() == [0, 1, 2]
    assert run.scans is run["scans"]
    assert run.scene == "seed = 1\n"
    assert stat.S_IMODE(target.stat().st_mode) & 0o500 == 0o500


def test_nothing_is_left_when_the_run_fails(tmp_path):
    with pytest.raises(RuntimeError, match="half way"), writing(tmp_path / "a" / "b") as folder:
        fill(folder)
        raise RuntimeError("half way")
    assert left_in(tmp_path) == []


def test_an_interrupt_leaves_nothing_either(tmp_path):
    with pytest.raises(KeyboardInterrupt), writing(tmp_path / "run") as folder:
        fill(folder)
        raise KeyboardInterrupt
    assert left_in(tmp_path) == []


def test_an_earlier_run_is_replaced_only_by_a_complete_one(tmp_path):
    target = tmp_path / "run"
    with writing(target) as folder:
        fill(folder, rows=3)
    with pytest.raises(RuntimeError), writing(target) as folder:
        raise RuntimeError
    assert read_run(target)["scans"].num_rows == 3
    with writing(target) as folder:
        fill(folder, rows=5)
    assert read_run(target)["scans"].num_rows == 5
    assert left_in(tmp_path) == ["run"]


def test_a_folder_that_holds_something_else_is_never_touched(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work", encoding="utf-8")
    with pytest.raises(UsageError, match="holds something other than a run"), writing(tmp_path):
        pass
    with pytest.raises(UsageError, match="is a file"):
        check_target(tmp_path / "thesis.tex")
    assert left_in(tmp_path) == ["thesis.tex"]


def test_an_empty_folder_may_be_used(tmp_path):
    target = tmp_path / "run"
    target.mkdir()
    with writing(target) as folder:
        fill(folder)
    assert read_run(target).info["seed"] == 1


def test_a_folder_that_cannot_be_made_is_one_clear_message(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(UsageError, match="cannot be written"), writing(tmp_path / "file" / "run"):
        pass


def test_names_count_up(tmp_path):
    assert new_folder_name(tmp_path, "first_light").name == "first_light-001"
    (tmp_path / "first_light-001").mkdir()
    assert new_folder_name(tmp_path, "first_light").name == "first_light-002"


def test_json_with_equal_content_is_equal_bytes(tmp_path):
    write_json(tmp_path / "a", {"x": 1, "y": [1, 2]})
    write_json(tmp_path / "b", {"y": [1, 2], "x": 1})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert json.loads((tmp_path / "a").read_text(encoding="utf-8")) == {"x": 1, "y": [1, 2]}


def test_reading_what_is_no_run(tmp_path):
    with pytest.raises(FileNotFoundError, match="not a run folder"):
        read_run(tmp_path)
    with pytest.raises(FileNotFoundError, match="not a run folder"):
        dsa_des.read_run(tmp_path / "nowhere")
    fill(tmp_path)
    run = dsa_des.read_run(str(tmp_path))
    with pytest.raises(KeyError, match="no table 'tracks'; it has scans"):
        run["tracks"]
    with pytest.raises(AttributeError):
        _ = run.tracks


def test_a_folder_name_is_not_taken_for_a_partition(tmp_path):
    target = tmp_path / "seed=3"
    with writing(target) as folder:
        fill(folder)
    assert read_run(target)["scans"].column_names == ["x"]
