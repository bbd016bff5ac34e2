"""The range of a camera errs by a share of it: moments, what is stated of them, what lasts."""

import math

import numpy as np
import pytest
import wired
from covering import covers
from looks import mean_is, ring

import dsa_des
from docs.make.track_consistency import Case, nees_of, summary
from docs.make.track_consistency.cases import STILL
from dsa_des.running.simulation import Simulation

KIND = "optical.range_boundary"
SHARE, TAU_S, RATE_HZ, SCANS = 0.03, 5.0, 50, 3000
STATED = {"errors": "stated", "quantised": False, "range_error_share": SHARE,
          "azimuth_error_deg": 0.06, "elevation_error_deg": 0.06}  # fmt: skip


def looks(**keys) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return measured, true range and stated variance of 20 targets' looks, (targets, scans)."""
    eye = wired.sensor(KIND, scan_rate_hz=RATE_HZ, **STATED, **keys)
    scene = wired.chain({"eye": eye}, targets=ring(), duration_s=SCANS / RATE_HZ)
    table = wired.run(scene)["detections"].sort_by([("target", "ascending"), ("scan", "ascending")])
    columns = ("range_m", "true_range_m", "range_variance_m2")
    return tuple(table[name].to_numpy().reshape(20, -1) for name in columns)  # type: ignore[return-value]


@covers("range_error_share", of=(KIND,))
def test_an_error_is_a_share_of_the_range():
    measured, true, variance = looks()
    assert true.shape == (20, SCANS) and true.max() > 2.5 * true.min()
    share = measured / true - 1.0
    assert mean_is(share, 0.0, 5) and mean_is((share / SHARE) ** 2, 1.0, 5)
    assert mean_is((share / SHARE) ** 4, 3.0, 5)
    assert mean_is(share[:, 1:] * share[:, :-1], 0.0, 5)
    assert mean_is(share[1:] * share[:-1], 0.0, 5)
    # What is stated goes by what is measured: nobody knows the true range.
    np.testing.assert_allclose(variance, (SHARE * measured) ** 2, rtol=1e-12)


@covers("range_correlation_time_s", of=(KIND,))
def test_what_is_new_of_a_lasting_one_is_white():
    measured, true, _ = looks(range_correlation_time_s=TAU_S)
    share = measured / true - 1.0
    rho = math.exp(-1.0 / RATE_HZ / TAU_S)
    new = (share[:, 1:] - rho * share[:, :-1]) / (SHARE * math.sqrt(1.0 - rho**2))
    assert mean_is(new, 0.0, 3) and mean_is(new**2, 1.0, 3)
    assert mean_is(new[:, 1:] * new[:, :-1], 0.0, 3)


@covers("range_bias_share", of=(KIND,))
def test_a_bias_is_a_share_too():
    measured, true, variance = looks(range_bias_share=-0.1, biases="fixed")
    assert mean_is(measured / true - 0.9, 0.0, 1)
    np.testing.assert_allclose(variance, (SHARE**2 + 0.01) * measured**2, rtol=1e-12)


def test_trackers_are_told_how_long_each_part_of_it_lasts():
    # Of the mean square of the share, 0.03² is forgotten in 5 s, and never a bias within ±0.1.
    eye = wired.sensor(KIND, **STATED, range_correlation_time_s=TAU_S, range_bias_share=0.1)
    scene = dsa_des.load_scene(wired.chain({"eye": eye}, targets=ring(), duration_s=1.0))
    told = Simulation(scene).components["eye"].offer("detections").lasting["range"]
    shares = {part.lasts_s: part.share for part in told.parts}
    assert shares == pytest.approx({TAU_S: 27 / 127, math.inf: 100 / 127})
    assert [part.variance for part in told.parts] == [0.0, 0.0] and told.step == 0.0


def test_without_it_a_camera_measures_no_range():
    table = wired.alone(KIND)["detections"]
    assert table["range_m"].null_count == table.num_rows > 0


@pytest.mark.parametrize(("keys", "said"), [
    ({"errors": "grid"}, "range_error_share is 0.03 and errors is 'grid'"),
    ({"range_error_share": 0.0, "range_bias_share": 0.1}, "range_bias_share is 0.1"),
    ({"range_error_share": 0.0, "range_correlation_time_s": 5.0}, "range_error_share is 0"),
    ({"range_error_share": 3.0}, "range_error_share = 3.0"),
])  # fmt: skip
def test_what_cannot_be(keys, said):
    plain = {"errors": "stated", "range_error_share": 0.03}
    with pytest.raises(Exception, match="range") as caught:
        wired.alone(KIND, **{**plain, **keys})
    assert said in str(caught.value)


@pytest.mark.parametrize("lasts", [{}, {"range_correlation_time_s": TAU_S}])
def test_tracks_of_such_a_camera_are_as_wrong_as_they_say(lasts):
    """40 runs of a banked ownship in the south, at ten looks a second, of 3 %."""
    eye = {"type": KIND, "range_km": 12.0, "scan_rate_hz": 10, **STATED, **lasts}
    case = Case("", {"type": "tracking.ekf", **STILL}, sensors={"eye": eye}, within_m=600.0)
    found = summary(nees_of(case, 40))
    assert found["lost"] == 0.0 and found["inside"] >= 0.9
    assert found["low"] < found["mean"] < found["high"]
