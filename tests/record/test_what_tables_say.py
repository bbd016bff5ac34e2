"""Recorded tables say which run they are of, and what each column is."""

import hashlib
import json

import pyarrow.parquet as pq
from matplotlib.figure import Figure

import dsa_des
from docs.make.reference.__main__ import recorded_tables
from dsa_des.block.recorded_columns import LEADING
from dsa_des.record.drawing import _make_plain

QUICK = {"sets": ["record.looks=true"], "duration_s": 6, "seed": 11}


def test_files_carry_version_seed_scene_and_the_unit_and_frame_of_each_column(tmp_path):
    dsa_des.run(dsa_des.load_scene("first_light", **QUICK), out=tmp_path / "r")
    info = json.loads((tmp_path / "r" / "run.json").read_text())
    scene = (tmp_path / "r" / "scene.toml").read_bytes()
    files = sorted((tmp_path / "r").glob("*.parquet"))
    assert {file.stem for file in files} >= {"detections", "looks", "scans", "truth"}
    for file in files:
        schema = pq.read_schema(file)
        said = {key.decode(): value.decode() for key, value in schema.metadata.items()}
        assert said == {
            "table": file.stem,
            "dsa_des_version": dsa_des.__version__,
            "seed": "11",
            "scene_sha256": hashlib.sha256(scene).hexdigest(),
            "ticks_per_s": str(info["ticks_per_s"]),
        }
        assert said["scene_sha256"] == info["scene_sha256"]
        for field in schema:
            column = {**LEADING, **recorded_tables()[file.stem]}[field.name]
            own = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
            pose = file.stem == "scans" and field.name.startswith("own_")
            assert own.pop("of_rows", "") == ("detections" if pose else "")
            names = ("unit", "frame", "meaning")
            assert own == {n: text for n, text in zip(names, column[:3], strict=True) if text}
            assert own["meaning"]
    azimuth = pq.read_schema(tmp_path / "r" / "detections.parquet").field("azimuth_rad").metadata
    assert azimuth[b"unit"] == b"rad" and b"body" in azimuth[b"frame"]


def test_tables_in_memory_say_the_same(tmp_path):
    scene = dsa_des.load_scene("first_light", **QUICK)
    dsa_des.run(scene, out=tmp_path / "r")
    for name, table in dsa_des.run(scene).tables.items():
        assert table.schema.equals(pq.read_schema(tmp_path / "r" / f"{name}.parquet"), True), name


def test_long_and_hostile_words_are_cut_wherever_they_stand_in_a_figure():
    figure = Figure()
    axes = figure.add_subplot()
    axes.set_title("\x1b[2J" + "long " * 90 + "$x^2$")
    axes.set_xlabel("two\nlines")
    axes.set_ylabel("plain")
    axes.text(0.5, 0.5, "\n".join("many"))
    _make_plain(figure)
    shown = axes.get_title()
    assert len(shown) <= 200 + len(r"\x1b") and "\x1b" not in shown and "$x" not in shown[:100]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("two\nlines", "plain")
    assert not axes.title.get_parse_math()
