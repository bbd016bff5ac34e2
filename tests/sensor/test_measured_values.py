"""What measured values can be, what their errors are keyed by, and true range rates."""

import math

import crooked
import looks
import numpy as np
import pytest
from covering import CAMERAS, LINK_BUDGETS, RADARS, SENSORS, covers
from scipy.stats import kstest, ncx2, norm
from wired import alone, chain, decided, rows, run, sensor

from components.radar.parameters import RadarParameters
from components.radar.radar import Radar
from components.sensor.look import Look
from dsa_des.errors import SceneError
from dsa_des.library.scenes import load_scene

LOUD = {"errors": "stated", "azimuth_error_deg": 60.0, "elevation_error_deg": 50.0}


def columns(kind, *names, **keys):
    """Return columns of a sensor's detections of the crooked flights."""
    found = alone(kind, **keys)["detections"]
    return [found[name].to_numpy(zero_copy_only=False) for name in names]


@pytest.mark.parametrize("quantised", [True, False])
@pytest.mark.parametrize("kind", SENSORS)
def test_however_large_errors_are_values_stay_what_they_can_be(kind, quantised):
    steps = {"azimuth_resolution_deg": 7.0, "elevation_resolution_deg": 8.0}
    radar = kind in RADARS
    if radar:
        steps |= {"range_resolution_m": 90.0, "range_error_m": 3000.0}
    keys = {**LOUD, **steps, "quantised": quantised, "scan_rate_hz": 200}
    azimuth, elevation, range_m = columns(kind, "azimuth_rad", "elevation_rad", "range_m", **keys)
    assert len(azimuth) == 400
    assert (azimuth > -math.pi).all() and (azimuth <= math.pi).all() and azimuth.std() > 1.0
    assert (np.abs(elevation) <= 0.5 * math.pi).all() and elevation.std() > 0.5
    if radar:
        nearest = 90.0 if quantised else 1e-3
        assert (range_m >= nearest).all() and (range_m == nearest).mean() < 0.1


@pytest.mark.parametrize("kind", RADARS)
def test_nothing_is_reported_at_range_0(kind):
    ranges = columns(kind, "range_m", range_resolution_m=6000.0)
    assert ranges[0].tolist() == [6000.0, 6000.0]


@pytest.mark.parametrize("kind", RADARS)
def test_errors_near_astern_and_overhead_go_the_short_way(kind):
    """A target behind us and one above: directions err by what is stated, whatever the angles."""
    place = {"speed_mps": 70.0, "heading_deg": 217.0, "yaw_deg": 217.0, "climb_mps": 3.0}
    targets = [
        {"name": "astern", "east_m": 1805.4, "north_m": 2395.9, "up_m": 0.0, **place},
        {"name": "above", "east_m": 12.0, "north_m": 10.0, "up_m": 3000.0, **place},
    ]
    ownship = {**crooked.OWNSHIP, "yaw_deg": 217.0, "pitch_deg": 0.0, "roll_deg": 0.0}
    keys = {"errors": "stated", "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5}
    block = sensor(kind, **keys, scan_rate_hz=500)
    found = run(chain({"sensor": block}, ownship=ownship, targets=targets))["detections"]
    table = {name: found[name].to_numpy(zero_copy_only=False) for name in found.column_names}
    for name in ("astern", "above"):
        mine = {key: values[table["target"] == name] for key, values in table.items()}
        angles = zip(mine["azimuth_rad"], mine["elevation_rad"], strict=True)
        seen = np.array([crooked.direction(*pair) for pair in angles])
        true = crooked.direction(mine["true_azimuth_rad"][0], mine["true_elevation_rad"][0])
        off = np.arccos(np.minimum(1.0, seen @ true))
        expected = math.radians(0.5) * math.sqrt(2.0 if name == "astern" else 1.0)
        assert np.sqrt(np.mean(np.square(off))) == pytest.approx(expected, rel=0.12)
    behind = table["azimuth_rad"][table["target"] == "astern"]
    assert (behind > 3.0).any() and (behind < -3.0).any()


@covers("measures_range_rate", of=RADARS)
@pytest.mark.parametrize("sweep", [False, True])
@pytest.mark.parametrize("kind", RADARS)
def test_range_rate_is_that_of_the_two_flights(kind, sweep):
    found = rows(alone(kind, measures_range_rate=True, scan_rate_hz=2, beam_sweep=sweep))
    assert len(found) == 4
    for row in found:
        target = next(t for t in crooked.TARGETS if t["name"] == row["target"])
        time_s = row["illuminated_s"] if sweep else row["time_s"]

        def range_m(time_s, target=target):
            return float(np.linalg.norm(crooked.ned(target, time_s)))

        expected = (range_m(time_s + 0.01) - range_m(time_s - 0.01)) / 0.02
        assert row["range_rate_m_s"] == pytest.approx(expected, abs=3e-4)
        assert row["range_rate_variance_m2_s2"] == 0.0


def test_range_rate_is_the_slope_of_the_range_to_the_last_scan():
    scene = chain({"sensor": sensor("radar.threshold", scan_rate_hz=100, measures_range_rate=True)})
    table = run(scene)["detections"]
    assert table["target"].to_pylist()[:2] == ["rolling", "diving"]
    range_m, rate = (table[n].to_numpy().reshape(-1, 2) for n in ("range_m", "range_rate_m_s"))
    slope = (8.0 * (range_m[3:-1] - range_m[1:-3]) - (range_m[4:] - range_m[:-4])) / 0.12
    np.testing.assert_allclose(rate[2:-2], slope, atol=1e-6)
    bend = np.abs(np.diff(rate, axis=0)).max()
    np.testing.assert_allclose(rate[0], 2.0 * rate[1] - rate[2], atol=bend / 20.0)
    np.testing.assert_allclose(rate[-1], 2.0 * rate[-2] - rate[-3], atol=bend / 20.0)


def test_range_rate_of_published_positions_is_that_of_the_flight():
    """Between publications positions stand still; what flies does not."""
    block = sensor("radar.threshold", scan_rate_hz=10, measures_range_rate=True)
    scene = chain({"sensor": block})
    exact = run(scene)["detections"]["range_rate_m_s"].to_numpy()
    scene["blocks"]["traffic"]["update_rate_hz"] = 2
    held = run(scene)["detections"]["range_rate_m_s"].to_numpy()
    assert (held[:10] == held[0::2][:1].repeat(10)).sum() < 10
    np.testing.assert_allclose(held[10::10], exact[10::10], rtol=1e-9)
    np.testing.assert_allclose(held[:10:2], exact[0], rtol=1e-9)


def test_range_rate_of_a_late_picture_is_that_of_its_own_instant():
    block = sensor("radar.threshold", scan_rate_hz=10, measures_range_rate=True)
    scene = chain({"sensor": block})
    exact = [row["range_rate_m_s"] for row in rows(run(scene))]
    scene["wires"] = [
        {"from": "traffic", "to": "transform", "delay_s": 0.3}, "transform -> gate -> sensor"
    ]  # fmt: skip
    late = [row["range_rate_m_s"] for row in rows(run(scene))]
    assert late == pytest.approx(exact[:-6], abs=1e-6) and len(late) == 14


def test_range_rate_begins_and_ends_with_a_flight():
    short = {**crooked.ROLLING, "start_time_s": 0.2, "end_time_s": 0.8}
    keys = {"measures_range_rate": True, "scan_rate_hz": 10}
    found = rows(alone("radar.threshold", targets=[short], **keys))
    assert [row["scan"] for row in found] == [2, 3, 4, 5, 6, 7, 8]
    rates = np.array([row["range_rate_m_s"] for row in found])
    np.testing.assert_allclose(np.diff(rates), np.diff(rates).mean(), rtol=0.1)


class PlainRadar(Radar):
    """A radar of somebody who has not heard of range rates."""

    Parameters = RadarParameters

    def look(self, cells):
        everything = np.ones(len(cells))
        return Look(everything > 0.0, everything)


def test_a_radar_of_one_s_own_measures_range_rates_too(monkeypatch):
    monkeypatch.setattr(looks, "PlainRadar", PlainRadar, raising=False)
    block = {"type": "looks:PlainRadar", "scan_rate_hz": 1, "measures_range_rate": True}
    block |= {"errors": "stated", "range_rate_error_m_s": 1e-9}
    own, ours = (
        run(chain({"sensor": keys}))["detections"]["range_rate_m_s"].to_numpy()
        for keys in (block, sensor("radar.threshold", measures_range_rate=True))
    )
    np.testing.assert_allclose(own, ours, atol=1e-8)


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_pulses_that_are_summed_make_errors_smaller(kind):
    keys = {**looks.SIGNAL_KEYS[kind], "errors": "signal", "quantised": False}
    names = "range_variance_m2", "azimuth_variance_rad2", "snr_db"
    for pulses in (1, 10):
        of_range, of_azimuth, snr_db = columns(kind, *names, **keys, pulses=pulses)
        twice = 2.0 * pulses * 10.0 ** (0.1 * snr_db)
        np.testing.assert_allclose(of_range, 40.0**2 / twice, rtol=1e-9)
        np.testing.assert_allclose(of_azimuth, math.radians(3.0) ** 2 / twice / 2.56, rtol=1e-9)


@covers("range_rate_resolution_m_s", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
def test_range_rates_are_on_their_grid(kind):
    keys = {"measures_range_rate": True, "range_rate_resolution_m_s": 7.0}
    for row, exact in zip(
        rows(alone(kind, **keys)), rows(alone(kind, measures_range_rate=True)), strict=True
    ):
        assert row["range_rate_m_s"] == 7.0 * round(exact["range_rate_m_s"] / 7.0)
        assert row["range_rate_variance_m2_s2"] == pytest.approx(49.0 / 12.0)


@covers("biases", "azimuth_bias_deg", "elevation_bias_deg", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
def test_a_drawn_bias_is_one_for_a_run_and_uniform_over_runs(kind):
    keys = {
        "errors": "stated",
        "quantised": False,
        "azimuth_bias_deg": 4.0,
        "elevation_bias_deg": 2.0,
    }
    if kind in RADARS:
        keys |= {"range_bias_m": 15.0}
    block = sensor(kind, **keys, scan_rate_hz=3)
    biases = []
    for seed in range(40 if kind == "radar.threshold" else 2):
        table = run({**chain({"sensor": block}), "seed": seed})["detections"]
        off = {
            name: table[measured].to_numpy() - table[true].to_numpy()
            for name, (measured, true, _) in looks.COLUMNS.items()
            if name != "range_rate"
        }
        assert np.ptp(off["azimuth"]) < 1e-12 and np.ptp(off["elevation"]) < 1e-12
        sizes = math.radians(4.0), math.radians(2.0), 15.0
        biases.append([values[0] / size for values, size in zip(off.values(), sizes, strict=True)])
        expected = math.radians(4.0) ** 2 / 3.0
        np.testing.assert_allclose(table["azimuth_variance_rad2"].to_numpy(), expected)
    drawn = np.array(biases)[:, : 3 if kind in RADARS else 2]
    assert (np.abs(drawn) < 1.0).all() and len(np.unique(drawn)) == drawn.size
    if len(drawn) > 2:
        share = np.sort(drawn.ravel()) / 2.0 + 0.5
        steps = np.arange(1, share.size + 1) / share.size
        assert np.abs(share - steps).max() < 1.63 / math.sqrt(share.size)  # Kolmogorov, 99 %


@covers("azimuth_beamwidth_deg", "elevation_beamwidth_deg", of=LINK_BUDGETS)
@covers("angle_measurement", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_scanning_beam_splits_worse_than_monopulse(kind):
    keys = {**looks.SIGNAL_KEYS[kind], "errors": "signal", "quantised": False}
    names = ("azimuth_variance_rad2", "elevation_variance_rad2")
    pair, scan = (columns(kind, *names, **keys, angle_measurement=m) for m in ("monopulse", "scan"))
    np.testing.assert_allclose(np.divide(scan, pair), 1.33 * (1.6 / 1.66) ** 2, rtol=1e-9)
    wide = columns(kind, *names, **{**keys, "azimuth_beamwidth_deg": 6.0})
    np.testing.assert_allclose(np.divide(wide, pair), [[4.0, 4.0], [1.0, 1.0]], rtol=1e-9)


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_range_rate_resolves_by_the_time_of_a_look(kind):
    """35 GHz for 10 ms: 0.4283 m/s."""
    keys = {**looks.SIGNAL_KEYS[kind], "errors": "signal", "measures_range_rate": True}
    found = columns(
        kind, "snr_db", "range_rate_variance_m2_s2", **keys, budget="free", dwell_s=0.01
    )
    expected = 0.428274940 / np.sqrt(2.0 * 10.0 ** (found[0] / 10.0))
    np.testing.assert_allclose(np.sqrt(found[1]), expected, rtol=1e-6)


@pytest.mark.parametrize("kind", LINK_BUDGETS)
@pytest.mark.parametrize("rate_hz", [1, 4])
def test_errors_follow_the_look_that_a_scan_leaves_time_for(kind, rate_hz):
    """Four beams share a scan: 1 / (4 rate) on each, 100 pulses a second summed in power.

    The look that the link budget states, of one pulse, has no part in it.
    """
    keys = {
        **looks.SIGNAL_KEYS[kind], "errors": "signal", "quantised": False, "scan_rate_hz": rate_hz,
        "budget": "dwell", "prf_hz": 100.0, "integration": "noncoherent",
        "azimuth_beamwidth_deg": 180.0, "elevation_beamwidth_deg": 90.0,
        "measures_range_rate": True,
    }  # fmt: skip
    names = "snr_db", "range_variance_m2", "range_rate_variance_m2_s2"
    snr_db, of_range, of_rate = columns(kind, *names, **keys)
    dwell_s = 1.0 / (4.0 * rate_hz)
    twice = 2.0 * 100.0 * dwell_s // 1.0 * 10.0 ** (0.1 * snr_db)
    assert (twice > 24.0).all()
    np.testing.assert_allclose(of_range, 40.0**2 / twice, rtol=1e-9)
    doppler_m_s = 299_792_458.0 / 35e9 / (2.0 * dwell_s)
    np.testing.assert_allclose(of_rate, doppler_m_s**2 / twice, rtol=1e-9)


@pytest.mark.parametrize("kind", ["radar.swerling", "optical.eo"])
def test_stated_errors_come_on_top_of_those_of_the_signal(kind):
    """Two errors of one size, each drawn by itself: their squares add up."""
    keys = {**looks.SIGNAL_KEYS[kind], "errors": "signal", "quantised": False}
    (alone_rad2,) = columns(kind, "azimuth_variance_rad2", **keys)
    deviation_deg = math.degrees(math.sqrt(alone_rad2.mean()))
    names = "azimuth_rad", "true_azimuth_rad", "azimuth_variance_rad2"
    measured, true, variance = columns(
        kind, *names, **keys, azimuth_error_deg=deviation_deg, scan_rate_hz=2000
    )
    off = (measured - true + math.pi) % (2.0 * math.pi) - math.pi
    assert len(off) == 4000 and variance.mean() == pytest.approx(2.0 * alone_rad2.mean(), rel=0.1)
    assert looks.mean_is(off**2 / variance, 1.0, 2)


def test_errors_in_clutter_follow_the_ratio_to_noise_and_clutter():
    """What is measured is over both; the mean SNR, by which the link budget knows it, is not."""
    keys = {**looks.SIGNAL_KEYS["radar.threshold"], "quantised": False, "scan_rate_hz": 500}
    grid = {"azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 9.0}
    terrain = {"height_m": 1850.0, "clutter_gamma_db": -45.0}
    still = {"targets": [{**crooked.DIVING, "speed_mps": 0.0, "climb_mps": 0.0}],
             "ownship": {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}}  # fmt: skip
    exact, seen = (
        read(run(chain({"sensor": sensor("radar.threshold", **keys, **grid, errors=errors)},
                       terrain=terrain, **still)))
        for errors, read in (("grid", decided), ("signal", rows))
    )  # fmt: skip
    ratio_db = exact[0]["confidence"] - 250.0
    assert 10.0 < ratio_db < exact[0]["snr_db"] - 1.0
    measured = np.array([10.0 ** (0.1 * row["snr_db"]) for row in seen])
    ratio = 10.0 ** (0.1 * ratio_db)
    spread = math.sqrt((2.0 * ratio + 1.0) / len(seen))
    assert abs(measured.mean() - ratio) < 2.58 * spread
    found = [row["range_variance_m2"] for row in seen]
    np.testing.assert_allclose(found, 40.0**2 / (2.0 * measured), rtol=1e-9)


@covers("noise_equivalent_contrast", "blur_pixels", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_camera_s_errors_grow_with_noise_and_blur(kind):
    """Thompson, Larson & Webb's term for background noise."""

    def spread(noise, blur):
        keys = {"errors": "signal", "quantised": False, "noise_equivalent_contrast": noise,
                "blur_pixels": blur, "elevation_pixels": 9000, "glint_share": 0.0}  # fmt: skip
        return columns(kind, "pixels", "azimuth_variance_rad2", "elevation_variance_rad2", **keys)

    pixel = math.radians(360.0) / 36000.0
    for noise, blur in ((0.01, 0.5), (0.04, 0.5), (0.01, 1.7)):
        pixels, across, upward = spread(noise, blur)
        s2 = blur**2 + (pixels + 1.0) / 12.0
        contrast = np.array([1.0, 1.0])
        expected = 8.0 * math.pi * s2**2 / (pixels * contrast / noise) ** 2
        np.testing.assert_allclose(across / pixel**2, expected, rtol=1e-9)
        np.testing.assert_allclose(upward / (2.0 * pixel) ** 2, expected, rtol=1e-9)


def test_a_camera_s_false_alarm_errs_like_a_target_of_its_signature():
    """Noise of signature E is of as many pixels of contrast 1 as give E, over a noise of 0.25."""
    keys = {"errors": "signal", "noise_equivalent_contrast": 0.25, "false_alarms_per_frame": 9.0,
            "glint_share": 0.0}  # fmt: skip
    run_ = alone("optical.eo", threshold=None, quantised=False, scan_rate_hz=5, **keys)
    found = rows(run_, target=None)
    pixel = math.radians(0.01)
    # A point's picture takes 4 pi (0.25 + 1/12) pixels; noise is summed over as many.
    area = 4.0 * math.pi / 3.0
    threshold = 0.3 * 0.25 * math.sqrt(area) * norm.isf(9.0 * area / (36000 * 18000))
    assert 20 < len(found) < 75
    for row in found:
        pixels = row["pixels"]
        counted = pixels / math.sqrt(1.0 + pixels / area)
        assert 0.3 * counted == pytest.approx(row["confidence"] + threshold)
        s2 = 0.25 + (pixels + 1.0) / 12.0
        expected = pixel**2 * 8.0 * math.pi * s2**2 / (pixels / 0.25) ** 2
        assert row["azimuth_variance_rad2"] == pytest.approx(expected)


ANGLE = "azimuth_error_deg"


@pytest.mark.parametrize(
    ("kind", "keys", "said"),
    [
        ("optical.eo", {"errors": "stated", ANGLE: -1.0}, "azimuth_error_deg"),
        ("optical.eo", {ANGLE: 1.0}, "errors is 'grid', which knows no errors but rounding"),
        ("optical.eo", {"errors": "stated", ANGLE: 1.0, "azimuth_correlation_time_s": 0.0},
         "azimuth_correlation_time_s"),
        ("radar.threshold", {"errors": "stated", "range_correlation_time_s": 3.0},
         "range_correlation_time_s is given and range_error_m is 0"),
        ("radar.threshold", {"errors": "stated", "range_rate_error_m_s": 3.0},
         "range_rate_error_m_s is 3 and measures_range_rate is false"),
        ("radar.range_boundary", {"errors": "signal"}, "'grid' or 'stated'"),
        ("radar.swerling", {"errors": "signal", "range_resolution_m": 10.0},
         "azimuth_beamwidth_deg is not given"),
        ("radar.swerling", {"errors": "signal", "azimuth_beamwidth_deg": 3.0,
                            "elevation_beamwidth_deg": 3.0}, "range_resolution_m is 0"),
        ("radar.swerling", {**looks.SIGNAL_KEYS["radar.swerling"], "errors": "signal",
                            "measures_range_rate": True}, "time of a look"),
        ("optical.ir", {"errors": "signal"}, "noise_equivalent_contrast is 0"),
        ("optical.eo", {"noise_equivalent_contrast": 0.1, "false_alarms_per_frame": 0.5},
         "threshold, noise_equivalent_contrast and false_alarms_per_frame are given"),
        ("optical.eo", {"errors": "gird"}, "errors"),
    ],
)  # fmt: skip
def test_what_no_sensor_can_have_is_one_clear_error(kind, keys, said):
    with pytest.raises(SceneError) as caught:
        load_scene(chain({"sensor": sensor(kind, **keys)}))
    text = str(caught.value)
    assert said in text and text.count("sensor") >= 1


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_strength_on_a_grid_is_measured_too(kind):
    """Twice the summed output is chi-square, noncentral by a steady echo: it hides the range."""
    keys = {"power_w": 5.0, "errors": "grid", "scan_rate_hz": 200, "false_alarms": False}
    if kind == "radar.swerling":
        keys["swerling"] = 0
    found = alone(kind, targets=[crooked.DIVING], duration_s=2, **keys)
    told = decided(found)
    said = np.array([10.0 ** (0.1 * row["snr_db"]) for row in rows(found)])
    mean = np.array([10.0 ** (0.1 * row["snr_db"]) for row in told])
    assert len(said) == 400 and 10.0 < mean.min() < mean.max() < 1e6
    places = ncx2.cdf(2.0 * (said + 1.0), 2.0, 2.0 * mean)
    assert kstest(places, "uniform").pvalue > 1e-3
    margins = np.array([row["confidence"] for row in rows(found)])
    assert np.ptp(margins - 10.0 * np.log10(said)) < 1e-9
    assert {row["detection_probability"] for row in rows(found)} == {None}
