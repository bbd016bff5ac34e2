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


def test_the_summary_tells_bandwidths_and_closest_approaches():
    """Of the calibrated radar its bandwidth, by the radar equation; of each target its nearest."""
    import math

    import crooked
    import numpy as np

    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.5, "swerling": 1}
    table = sensor("radar.threshold", calibrate=calibrate, noise_figure_db=3.0)
    del table["bandwidth_hz"], table["threshold_db"]
    scene = chain({"one": table, "two": sensor("radar.threshold", bandwidth_hz=12345.0)})
    told = run({**scene, "duration_s": 2}).info["summary"]
    needed = math.log(1e-6) / math.log(0.5) - 1.0
    wavelength = 299_792_458.0 / 35e9
    top = 100.0 * 10 ** (6.0 + 0.5) * wavelength**2
    noise = 1.380649e-23 * 290.0 * 10**0.3
    bandwidth = top / ((4 * math.pi) ** 3 * noise * 4200.0**4 * needed)
    assert told["link_budgets"]["one"]["bandwidth_hz"] == pytest.approx(bandwidth, rel=1e-6)
    assert told["link_budgets"]["two"]["bandwidth_hz"] == 12345.0
    for target in crooked.TARGETS:
        ranges = [float(np.linalg.norm(crooked.ned(target, 0.1 * k))) for k in range(21)]
        nearest = told["targets"][target["name"]]["closest_approach"]
        assert nearest["range_m"] == pytest.approx(min(ranges), abs=0.02)
        assert nearest["time_s"] == pytest.approx(0.1 * ranges.index(min(ranges)))
