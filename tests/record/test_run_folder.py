"""A run folder reads back as Arrow tables, and knows which files are its own."""

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure

import dsa_des
from dsa_des.files.output_folder import RUN_JSON, OutputFolder, foreign_or_changed_files
from dsa_des.record.drawing import _shorten_and_escape_texts
from dsa_des.record.run_folder import _matching_rows, read_run, write_json, write_run_json


def fill(folder, rows=3):
    (folder / "scene.toml").write_text("seed = 1\n", encoding="utf-8")
    pq.write_table(pa.table({"x": list(range(rows))}), folder / "scans.parquet")
    write_run_json(folder, {"seed": 1, "counts": {"b": 2, "a": 1}})


def test_a_run_reads_back(tmp_path):
    target = tmp_path / "run"
    with OutputFolder(target).write_then_rename() as folder:
        fill(folder)
    run = read_run(target)
    files = run.info.pop("files")
    assert run.info == {"seed": 1, "counts": {"a": 1, "b": 2}}
    assert set(files) == {"scene.toml", "scans.parquet"}
    assert run["scans"].column("x").to_pylist() == [0, 1, 2]
    assert run.scans is run["scans"]
    assert run.scene == "seed = 1\n"


def test_the_scene_of_a_run_finds_its_files_from_where_it_lies(tmp_path, monkeypatch):
    """The scene was named, and names its file, from the working folder."""
    configs = Path(__file__).parents[2] / "configs"
    shutil.copy(configs / "encounters/crossing.daa", tmp_path / "crossing.daa")
    (tmp_path / "replay.toml").write_text(
        f'extends = "{(configs / "replay_daa.toml").as_posix()}"\n'
        'duration_s = 2\nblocks.traffic.file = "crossing.daa"\n'
    )
    monkeypatch.chdir(tmp_path)
    dsa_des.run(dsa_des.load_scene("replay.toml"), out="one")
    dsa_des.run(dsa_des.load_scene("one/scene.toml"), out="two")
    for name in ("scene.toml", "scans.parquet"):
        assert Path("one", name).read_bytes() == Path("two", name).read_bytes()


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
    with OutputFolder(target).write_then_rename() as folder:
        fill(folder)
    assert read_run(target)["scans"].column_names == ["x"]


def test_what_a_run_wrote_is_its_own_and_nothing_else(tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "one.png").write_bytes(b"PNG")
    fill(tmp_path)
    assert foreign_or_changed_files(tmp_path) == []
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "empty").mkdir()
    (tmp_path / "figures" / "two.png").symlink_to("one.png")
    assert foreign_or_changed_files(tmp_path) == ["empty", "figures/two.png", "notes.txt"]


def test_a_file_that_was_changed_since_is_no_longer_the_run_s(tmp_path):
    fill(tmp_path)
    (tmp_path / "scene.toml").write_text("seed = 2\n", encoding="utf-8")  # of the same length
    assert foreign_or_changed_files(tmp_path) == ["scene.toml"]


@pytest.mark.parametrize(
    "text", ["{}", "[]", "", "{", '{"files": 3}', '{"title": "x", "seed": 1}', "[" * 5000]
)
def test_a_run_json_of_somebody_else_makes_nothing_ours(text, tmp_path):
    (tmp_path / RUN_JSON).write_text(text)
    (tmp_path / "scans.parquet").write_bytes(b"")
    assert foreign_or_changed_files(tmp_path) == [RUN_JSON, "scans.parquet"]


def test_a_link_named_run_json_makes_nothing_ours(tmp_path):
    (tmp_path / "run").mkdir()
    fill(tmp_path / "run")
    other = tmp_path / "other"
    other.mkdir()
    (other / RUN_JSON).symlink_to(tmp_path / "run" / RUN_JSON)
    assert foreign_or_changed_files(other) == [RUN_JSON]


@pytest.mark.parametrize("is_dictionary", [False, True])
def test_rows_of_another_table_are_found_by_block_tick_and_replica(is_dictionary):
    def table(keys):
        replica, tick, block = zip(*keys, strict=True)
        block = pa.array(block)
        block = block.dictionary_encode() if is_dictionary else block
        return pa.table({"replica": replica, "tick": tick, "block": block})

    mine = [(r, t, b) for b in "cab" for t in (9, 0, 4, 7) for r in (0, 2, 1)]
    theirs = [(r, t, b) for r in (1, 0) for b in "bdc" for t in (4, 9, 8)]
    wanted = [theirs.index(key) if key in theirs else -1 for key in mine]
    assert _matching_rows(table(mine), table(theirs)).tolist() == wanted
    assert _matching_rows(table(mine), table(theirs).slice(0, 0)).tolist() == [-1] * len(mine)


def test_long_and_hostile_words_are_cut_wherever_they_stand_in_a_figure():
    figure = Figure()
    axes = figure.add_subplot()
    axes.set_title("\x1b[2J" + "long " * 90 + "$x^2$")
    axes.set_xlabel("two\nlines")
    axes.set_ylabel("plain")
    axes.text(0.5, 0.5, "\n".join("many"))
    _shorten_and_escape_texts(figure)
    shown = axes.get_title()
    assert len(shown) <= 200 + len(r"\x1b") and "\x1b" not in shown and "$x" not in shown[:100]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("two\nlines", "plain")
    assert not axes.title.get_parse_math()
