"""The keys at the top of a scene, and those that put scenes together from files."""

import pytest
from covering import covers
from wired import chain, rows, run, sensor

import dsa_des

RADAR = sensor("radar.swerling", power_w=2.0, false_alarm_probability=1e-4, scan_rate_hz=20)


@covers("title", "description", of=("[scene]",))
def test_a_title_and_a_description_are_told():
    plain = run(chain({"radar": RADAR}))
    named = run({**chain({"radar": RADAR}), "title": "A title", "description": "More of it."})
    assert named.info["title"] == "A title" != plain.info["title"]
    assert 'description = "More of it."' in named.scene
    assert named.detections.equals(plain.detections)


@covers("seed", of=("[scene]",))
def test_a_seed_draws_other_detections_of_the_same_share():
    found = [rows(run({**chain({"radar": RADAR}), "seed": seed})) for seed in (1, 1, 2)]
    scans = [[(row["scan"], row["target"]) for row in detections] for detections in found]
    assert scans[0] == scans[1] != scans[2]
    assert len(scans[2]) == pytest.approx(len(scans[0]), abs=15)


@covers("blocks", of=("[scene]",))
def test_blocks_are_named_by_their_tables():
    found = run(chain({"one": RADAR, "two": {**RADAR, "offset_s": 0.01}}))
    assert {row["block"] for row in rows(found)} == {"one", "two"}
    # Draws are keyed by the name: other names, other draws.
    assert [r["scan"] for r in rows(found, block="one")] != [
        r["scan"] for r in rows(found, block="two")
    ]


@covers("extends", "remove", of=("[extends]",))
def test_files_come_first_and_what_is_removed_is_gone(tmp_path):
    (tmp_path / "radar.toml").write_text(
        'type = "radar.range_boundary"\nscan_rate_hz = 2\nrange_km = 3\noffset_s = 0.1\n'
    )
    scene = chain({"radar": {"extends": str(tmp_path / "radar.toml"), "scan_rate_hz": 4}})
    times = [row["time_s"] for row in rows(run(scene), "scans")]
    assert times == pytest.approx([0.1, 0.35, 0.6, 0.85])
    scene["blocks"]["radar"]["remove"] = ["offset_s"]
    times = [row["time_s"] for row in rows(run(scene), "scans")]
    assert times == pytest.approx([0.0, 0.25, 0.5, 0.75])
    with pytest.raises(dsa_des.SceneError, match="range_km"):
        scene["blocks"]["radar"]["remove"] = ["range_km"]
        dsa_des.load_scene(scene)
