"""Nothing but its target and its truth tells a false alarm: a trivial separator finds nothing."""

import crooked
import numpy as np
import pytest
from covering import CAMERAS, LINK_BUDGETS, covers
from scipy.stats import ks_2samp
from wired import chain, rows, run, sensor

import dsa_des

LABELS = {"target", "true_azimuth_rad", "true_elevation_rad", "true_range_m"}
MODES = ("grid", "stated", "signal")
STATED = {
    "azimuth_error_deg": 1.0, "elevation_error_deg": 0.5, "azimuth_bias_deg": 0.2,
}  # fmt: skip
#: Its cells and beams are 2 by 4 deg by 150 m; noise crosses its threshold in some 20 of 5,700.
RADAR = {
    "range_km": 6.0, "azimuth_deg": [-70, 70], "elevation_deg": [-30, 28],
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 150.0,
    "azimuth_beamwidth_deg": 2.0, "elevation_beamwidth_deg": 4.0, "budget": "free",
    "false_alarms": True, "false_alarm_probability": 1e-3, "measures_range_rate": True,
    "range_rate_resolution_m_s": 2.0, "power_w": 100.0,
}  # fmt: skip
CAMERA = {"threshold": 1.0, "false_alarms_per_frame": 0.5, "azimuth_deg": [-70, 70],
          "azimuth_pixels": 6000, "elevation_pixels": 3000,
          "noise_equivalent_contrast": None}  # fmt: skip
#: Thirty targets, of the same contrast, where radar and camera look.
CROWD = [
    {**crooked.ROLLING, "name": f"t{i}", "east_m": -2349.0 - 83.0 * i, "north_m": -1855.0,
     "up_m": 420.0 - 41.0 * i} for i in range(30)
]  # fmt: skip


def noisy(kind, mode, **keys):
    ours = dict(RADAR if kind in LINK_BUDGETS else CAMERA)
    if mode == "stated":
        ours |= STATED
    if mode == "signal" and kind in CAMERAS:
        ours |= {"noise_equivalent_contrast": 0.3, "threshold": None}
    if kind == "radar.threshold":
        ours |= {"threshold_db": 8.0, "power_w": 40.0}
    return sensor(kind, errors=mode, **{"scan_rate_hz": 10, **ours, **keys})


def both(scene, names=None):
    """Columns of true and of false detections, without labels, and the whole table."""
    table = run(scene)["detections"]
    false = np.array([name is None for name in table["target"].to_pylist()])
    columns = {name: table[name].to_pylist() for name in names or table.column_names
               if name not in LABELS}  # fmt: skip
    split = [{name: np.array(values)[part] for name, values in columns.items()}
             for part in (~false, false)]  # fmt: skip
    assert min(len(part["scan"]) for part in split) > 15
    return *split, false, table


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", (*LINK_BUDGETS, *CAMERAS))
def test_no_column_is_null_or_constant_for_one_of_them_only(kind, mode):
    scene = chain({"sensor": noisy(kind, mode)}, targets=CROWD, duration_s=4,
                  navigation={"position_bias_m": [5.0, 0.0, 0.0]})  # fmt: skip
    true, false, _, _ = both(scene)
    for name, values in true.items():
        missing = [[value is None for value in part[name]] for part in (true, false)]
        assert len({*missing[0], *missing[1]}) == 1, name
        if missing[0][0] or name in ("block", "tick", "time_s", "scan"):
            continue
        numbers = values.astype(float), false[name].astype(float)
        alike = [len(set(part.tolist())) == 1 for part in numbers]
        assert alike[0] == alike[1], name
        if alike[0]:
            assert numbers[0][0] == numbers[1][0], name
        if name not in ("azimuth_rad", "elevation_rad"):
            # Between the extremes of the true ones, or of noise, there are the others.
            assert numbers[0].min() <= numbers[1].max(), name
            assert numbers[1].min() <= numbers[0].max(), name


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_echoes_that_are_nothing_are_as_strong_as_noise(kind, mode):
    """Targets so faint that noise reports them: their strength is distributed as noise's is."""
    keys = {"power_w": 1e-12, "false_alarm_probability": 0.02, "measures_range_rate": False,
            "range_rate_resolution_m_s": 0.0, "range_resolution_m": 600.0,
            "azimuth_resolution_deg": 8.0, "elevation_resolution_deg": 8.0,
            "glint_share": 0.0}  # fmt: skip
    duration_s = 20
    if kind == "radar.threshold":
        keys["threshold_db"], duration_s = -200.0, 8  # which all of both cross
    scene = chain({"sensor": noisy(kind, mode, **keys)}, targets=CROWD, duration_s=duration_s)
    names = "scan", "snr_db", "confidence", "azimuth_variance_rad2", "range_variance_m2"
    true, false, _, _ = both(scene, names)
    for name in names[1:]:
        ours, noise = (part[name].astype(float) for part in (true, false))
        assert ks_2samp(ours, noise).pvalue > 0.001, name


@pytest.mark.parametrize("kind", (*LINK_BUDGETS, *CAMERAS))
def test_the_order_within_a_scan_tells_nothing(kind):
    """By range, azimuth and elevation as measured, whoever it is."""
    _, _, false, table = both(
        chain({"sensor": noisy(kind, "stated", quantised=False)}, targets=CROWD, duration_s=4)
    )
    measured = [np.array(table[name].to_pylist(), dtype=float)
                for name in ("elevation_rad", "azimuth_rad", "range_m", "scan")]  # fmt: skip
    assert np.array_equal(np.lexsort(measured), np.arange(len(false)))
    # Some false alarms stand before true detections of their scan.
    assert (false[:-1] & ~false[1:] & (measured[-1][:-1] == measured[-1][1:])).sum() > 5


@pytest.mark.parametrize(("noise", "gains"), [(None, {1.0}), (0.0, {0.5, 1.25})])
@pytest.mark.parametrize("kind", CAMERAS)
def test_the_pixels_of_noise_give_its_confidence_as_a_target_s_do(kind, noise, gains):
    """Eq. 18: 0.3 times pixels times contrast, less the threshold.

    What is measured with noise says nothing of a contrast, and its size brings noise: of N pixels
    sqrt(s / (s + N)) counts, where a point's picture takes s = 4 pi / 3. Else it is a target's.
    """
    spot = np.inf if noise == 0.0 else 4.0 * np.pi / 3.0
    targets = [{**target, "contrast": gain, "contrast_ir": gain}
               for target, gain in zip(CROWD, (0.5, 1.25) * 15, strict=True)]  # fmt: skip
    camera = noisy(kind, "grid", noise_equivalent_contrast=noise)
    true, false, _, _ = both(chain({"sensor": camera}, targets=targets, duration_s=20))
    for part in (true, false):
        pixels = part["pixels"].astype(float)
        counted = pixels / np.sqrt(1.0 + pixels / spot)
        gain = (part["confidence"].astype(float) + 1.0) / (0.3 * counted)
        assert {round(value, 9) for value in gain} == gains


def test_noise_of_a_camera_is_gaussian_beyond_the_threshold():
    """Half of it lies beyond the level that half as much noise crosses."""
    from scipy.stats import norm

    share = 0.02
    found = rows(run(chain({"sensor": noisy(
        "optical.eo", "grid", threshold=2.5, false_alarms_per_frame=share, scan_rate_hz=500)},
        duration_s=40)), target=None)  # fmt: skip
    pfa = share * (4.0 * np.pi / 3.0) / (6000 * 3000)
    middle = 2.5 * (norm.isf(pfa / 2) / norm.isf(pfa) - 1.0)
    above = sum(row["confidence"] > middle for row in found)
    assert abs(above - len(found) / 2) < 2.6 * np.sqrt(len(found) / 4)


@covers("marked_false_alarms", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_marked_false_alarms_come_last_without_pixels(kind):
    camera = noisy(kind, "grid", marked_false_alarms=True)
    _, false, is_false, table = both(chain({"sensor": camera}, targets=CROWD, duration_s=4))
    assert set(false["pixels"]) == {None} and set(false["confidence"]) == {0.0}
    same = np.diff(np.array(table["scan"])) == 0
    assert not (is_false[:-1] & ~is_false[1:] & same).any()


@covers("declare_by", of=(*LINK_BUDGETS, *CAMERAS, "radar.range_boundary"))
@covers("declare_by", of=("optical.range_boundary", "laser.scanning"))
def test_who_it_is_decides_no_declaration_by_place():
    """Other names and another order declare the same rows; noise takes part by its place."""
    rule = {"declare_m": 2, "declare_n": 3}
    sensors = {
        "radar": noisy("radar.swerling", "grid", power_w=2e-4, scan_rate_hz=4, **rule),
        "eye": noisy(
            "optical.eo",
            "grid",
            scan_rate_hz=4,
            threshold=8.0,
            noise_equivalent_contrast=0.0,
            **rule,
        ),
        "told": sensor("optical.range_boundary", declare_by="place", **rule),
        "laser": sensor("laser.scanning", declare_by="place", **rule),
    }
    first = run(chain(sensors, targets=CROWD, duration_s=8))["detections"]
    renamed = [{**target, "name": f"z{99 - i}"} for i, target in enumerate(CROWD)]
    shuffled = [renamed[i] for i in np.random.default_rng(3).permutation(len(renamed))]
    other = run(chain(sensors, targets=shuffled, duration_s=8))["detections"]
    mine = [row for row in first.to_pylist() if row["block"] == "eye"]
    theirs = [row for row in other.to_pylist() if row["block"] == "eye"]
    place = ("scan", "azimuth_rad", "elevation_rad", "declared")
    # A camera's targets draw nothing: whatever their names, the same places are declared.
    assert [[row[key] for key in place] for row in mine] == [
        [row[key] for key in place] for row in theirs
    ]
    noise = [row["declared"] for row in first.to_pylist()
             if row["block"] == "radar" and row["target"] is None]  # fmt: skip
    assert {*noise} == {True, False}
    by_name = dsa_des.load_scene(chain(sensors), sets=["blocks.told.declare_by=target"])
    assert by_name.blocks["told"].parameters.declares_by_target_or_place == "target"
    assert by_name.blocks["laser"].parameters.declares_by_target_or_place == "place"


def declared(duration_s=4, kind="radar.range_boundary", **keys):
    """Declarations of one exact sensor with noise nowhere, by place."""
    eye = sensor(kind, scan_rate_hz=4, declare_m=2, declare_n=2,
                 declare_by="place", **keys)  # fmt: skip
    found = rows(run(chain({"sensor": eye}, targets=[crooked.ROLLING], duration_s=duration_s)))
    return [row["declared"] for row in found]


@covers("declare_speed_m_s", "declare_rate_deg_s",
        of=(*LINK_BUDGETS, *CAMERAS, "radar.range_boundary", "optical.range_boundary",
            "laser.scanning"))  # fmt: skip
@pytest.mark.parametrize("kind", ["radar.range_boundary", "laser.scanning"])
def test_a_place_moves_no_faster_than_the_scene_says(kind):
    """The intruder comes nearer by some 114 m/s and turns by about 0.3 deg/s, seen from there."""
    start, later = (crooked.ned(crooked.ROLLING, time_s) for time_s in (0.0, 0.25))
    nearer_m_s = 4.0 * abs(np.linalg.norm(start) - np.linalg.norm(later))
    unit = [vector / np.linalg.norm(vector) for vector in (start, later)]
    turn_deg_s = 4.0 * np.degrees(np.arccos(unit[0] @ unit[1]))
    both_ways = {"declare_speed_m_s": 1.02 * nearer_m_s, "declare_rate_deg_s": 1.02 * turn_deg_s}
    assert declared(0.5, kind, **both_ways) == [False, True]
    for key, value in both_ways.items():
        assert declared(0.5, kind, **{**both_ways, key: 0.96 * value}) == [False, False], key


def test_a_turn_of_the_ownship_moves_no_place():
    """It turns by 20 deg/s; what it sees moves by far less than 2 deg/s over ground."""
    turning = {key: value for key, value in crooked.OWNSHIP.items()
               if key not in ("climb_mps", "yaw_deg", "pitch_deg", "roll_deg")}  # fmt: skip
    turning["legs"] = [{"kind": "turn", "rate_deg_s": 20.0}]
    eye = sensor("optical.range_boundary", scan_rate_hz=4, declare_m=3, declare_n=3,
                 declare_by="place", declare_rate_deg_s=2.0)  # fmt: skip
    scene = chain({"eye": eye}, ownship=turning, targets=[crooked.ROLLING], duration_s=2)
    found = rows(run(scene))
    azimuth = np.unwrap([row["azimuth_rad"] for row in found])
    assert np.ptp(azimuth) > np.radians(10.0)
    assert [row["declared"] for row in found] == [False, False] + 6 * [True]
