"""Radar cross-section: decibels, sampled fluctuation, tables over aspect."""

import math

import numpy as np
import pytest

from components.aircraft.aspect_tables import RcsTable, dbsm_to_m2
from components.radar.detection import detection_probability, detection_threshold
from components.radar.rcs import fluctuating_rcs


def test_decibels_of_the_thesis():
    # Thesis Table 2.3: 1.76, 3.01 and 6.99 dBsm are 1.5, 2 and 5 m².
    np.testing.assert_allclose(dbsm_to_m2([1.76, 3.01, 6.99]), [1.5, 2.0, 5.0], rtol=1e-3)
    with pytest.raises(ValueError, match="rcs_dbsm is nan"):
        dbsm_to_m2(np.nan)


# Variance of the RCS in units of its mean squared.
@pytest.mark.parametrize(
    ("model", "variance"),
    [
        ("swerling1", 1.0),
        ("swerling2", 1.0),
        ("swerling3", 0.5),
        ("swerling4", 0.5),
        ("swerling0", 0.0),
    ],
)
def test_mean_and_variance_are_those_of_the_model(model, variance):
    # Midpoints of equal slices of [0, 1): the mean over them is an integral, not a sample.
    draws = (np.arange(200_000) + 0.5) / 200_000
    rcs = fluctuating_rcs(3.0, draws, model) if model != "swerling0" else np.full(3, 3.0)
    assert np.mean(rcs) == pytest.approx(3.0, rel=1e-4)
    assert np.var(rcs) == pytest.approx(9.0 * variance, rel=2e-3, abs=1e-12)
    assert np.all(np.diff(rcs) >= 0.0)


def test_one_draw_per_scan_or_per_pulse():
    mean = np.array([1.0, 2.0])
    draws = np.random.default_rng(2).random((2, 5))
    slow = fluctuating_rcs(mean, draws[:, 0], "swerling1")
    fast = fluctuating_rcs(mean, draws, "swerling2")
    assert slow.shape == (2,)
    assert fast.shape == (2, 5)
    assert fast[:, 0].tobytes() == slow.tobytes()
    np.testing.assert_array_equal(fluctuating_rcs(mean, draws[:, 0], "swerling5"), mean)
    assert fluctuating_rcs(4.0, 0.0, "swerling1") == 0.0
    for model in ("swerling1", "swerling3"):
        draws = np.random.default_rng(3).random(10_000)
        whole = fluctuating_rcs(2.0, draws, model)
        assert fluctuating_rcs(2.0, draws[3:10].copy(), model).tobytes() == whole[3:10].tobytes()
        assert fluctuating_rcs(2.0, draws[::2], model).tobytes() == whole[::2].tobytes()


@pytest.mark.parametrize("model", ["swerling1", "swerling3"])
def test_sampled_amplitudes_reproduce_pd(model):
    """Averaging the steady Pd over sampled RCS gives the model's Pd."""
    draws = (np.arange(20_000) + 0.5) / 20_000
    echo = 2.5 * fluctuating_rcs(1.0, draws, model)
    radar = {"pulses": 3, "false_alarm_probability": 1e-4}
    steady = np.mean(detection_probability(echo, model="swerling0", **radar))
    assert steady == pytest.approx(detection_probability(2.5, model=model, **radar), abs=2e-5)


def test_sampled_pulses_reproduce_swerling_4():
    rng = np.random.default_rng(11)
    rcs = fluctuating_rcs(1.0, rng.random((40_000, 3)), "swerling4")
    amplitude = np.sqrt(1.5 * rcs)
    noise = rng.normal(size=(2, 40_000, 3)) / math.sqrt(2.0)
    power = np.sum((noise[0] + amplitude) ** 2 + noise[1] ** 2, axis=1)
    share = np.mean(power > detection_threshold(3, 0.01))
    expected = detection_probability(1.5, pulses=3, false_alarm_probability=0.01, model="swerling4")
    assert share == pytest.approx(expected, abs=4.0 * math.sqrt(0.25 / 40_000))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1.0, 1.0, "swerling1"), r"uniforms is 1: it must lie in \[0, 1\)"),
        ((1.0, -0.1, "swerling1"), r"uniforms is -0\.1"),
        ((-1.0, 0.5, "swerling1"), "mean_rcs_m2 is -1"),
        ((1.0, 0.5, "swerling2"), "uniforms is a scalar"),
        ((1.0, 0.5, "swirling1"), "nearest: 'swerling1'"),
    ],
)
def test_bad_draws_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        fluctuating_rcs(*arguments)


AZIMUTHS = [0.0, 40.0, 90.0, 200.0, 300.0]
ELEVATIONS = [-30.0, 0.0, 50.0]
VALUES = np.array([[0, 1, 2, 3, 4], [10, 12, 20, 5, 7], [3, 3, 3, 3, 3]], dtype=float)


@pytest.fixture
def table():
    return RcsTable(np.array(AZIMUTHS), np.array(ELEVATIONS), VALUES)


def test_nodes_and_midpoints_in_db(table):
    for i, el in enumerate(ELEVATIONS):
        for j, az in enumerate(AZIMUTHS):
            found = table.dbsm(math.radians(az), math.radians(el))
            assert found == pytest.approx(VALUES[i, j], abs=1e-12)
    assert table.dbsm(math.radians(20.0), 0.0) == pytest.approx(11.0)
    assert table.dbsm(math.radians(20.0), math.radians(25.0)) == pytest.approx(7.0)
    assert table.rcs_m2(0.0, 0.0) == pytest.approx(10.0)


def test_wraps_in_azimuth_and_holds_in_elevation(table):
    # 330° is half-way between the nodes 300 and 360 = 0.
    assert table.dbsm(math.radians(330.0), 0.0) == pytest.approx(8.5)
    for turn in (-2, -1, 1, 5):
        angle = math.radians(330.0) + 2.0 * math.pi * turn
        assert table.dbsm(angle, 0.0) == pytest.approx(8.5, abs=1e-12)
    assert table.dbsm(-1e-20, 0.0) == pytest.approx(10.0, abs=1e-12)
    assert table.dbsm(math.radians(90.0), -math.pi / 2) == pytest.approx(2.0)
    assert table.dbsm(math.radians(90.0), math.pi / 2) == pytest.approx(3.0)


def test_table_bits_do_not_depend_on_shape(table):
    rng = np.random.default_rng(4)
    az, el = rng.uniform(-9.0, 9.0, 5000), rng.uniform(-1.5, 1.5, 5000)
    whole = table.rcs_m2(az, el)
    assert table.rcs_m2(az[9:16].copy(), el[9:16].copy()).tobytes() == whole[9:16].tobytes()
    assert table.rcs_m2(az[::5], el[::5]).tobytes() == whole[::5].tobytes()


def test_csv_with_other_columns_order_and_comments(tmp_path, table):
    path = tmp_path / "rcs.csv"
    lines = ["# made for a test", "", "DBSM, az_deg ,note,EL_DEG"]
    for i, el in reversed(list(enumerate(ELEVATIONS))):
        lines += [
            f"{VALUES[i, j]},{az - 360 if j == 4 else az},x,{el}" for j, az in enumerate(AZIMUTHS)
        ]
    lines += [f"{VALUES[1, 0]},360,x,0"]
    path.write_text("\n".join(lines), encoding="utf-8")
    read = RcsTable.from_csv(path)
    np.testing.assert_array_equal(read.azimuth_deg, AZIMUTHS)
    np.testing.assert_array_equal(read.rcs_dbsm, VALUES)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("az_deg,el_deg,dbsm\n0,0,1\n90,0,1\n0,10,1\n", "hole: no value at az_deg 90, el_deg 10"),
        ("az_deg,el_deg,dbsm\n0,0,1\n360,0,2\n", "dbsm is 2 and 1 at az_deg 0, el_deg 0"),
        ("az_deg,el_deg,area\n0,0,1\n", "is dbsm; it must have az_deg, el_deg, dbsm"),
        ("az_deg,el_deg,dbsm\n0,0,loud\n", "line 2: it must have a number"),
        ("az_deg,el_deg,dbsm\n0,0\n", "line 2: it must have a number"),
        ("az_deg,el_deg,dbsm\n0,0,nan\n", "dbsm is nan"),
        ("az_deg,el_deg,dbsm\n0,95,1\n", "elevation_deg is 95"),
        ("az_deg,el_deg,dbsm\n", "is empty"),
        ("", "is empty"),
    ],
)
def test_bad_tables_are_named(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        RcsTable.from_csv(path)


def test_direction_beyond_the_pole_is_refused(table):
    with pytest.raises(ValueError, match="elevation_rad is 2: it must lie in"):
        table.dbsm(0.0, 2.0)
    with pytest.raises(ValueError, match="azimuth_rad is nan"):
        table.dbsm(np.nan, 0.0)
