"""Errors of tracks at a range, against pymap3d and known biases; the ownship banks in the south."""

import math

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from test_tracking_metric import FINE, scene
from wired import measured, rows, run

import dsa_des
from dsa_des.studies.draws import replica_seed

KIND = ("[metric track_errors_by_range]",)
MILE_M = 1852.0


def at(range_nmi: float, built=None, **keys) -> dict[str, float]:
    metric = {"metric": "track_errors_by_range", "ranges_nmi": [range_nmi], "from_s": 2, **keys}
    found = measured(built or scene(**FINE), {"step_s": 0.25, **metric})
    return {name.removesuffix(f".{range_nmi:g}"): value for name, value in found.items()}


def here_nmi() -> float:
    """Range at which the first track is confirmed, once three looks have been."""
    return round(at(1.0)["first_track_range_nmi"], 1)


def by_hand(range_nmi: float, built) -> dict[str, float]:
    """Errors at a range from the rows of the same run, by pymap3d."""
    same = run({**built, "seed": replica_seed(0, 0)})
    told = rows(same, "state_tracks", track_status="confirmed")
    times = np.arange(2.0, 6.01, 0.25)
    sight = [crooked.ned(crooked.ROLLING, t) for t in times]
    k = int(np.argmin([abs(np.linalg.norm(v) - range_nmi * MILE_M) for v in sight]))
    row = [r for r in told if times[k] - 0.5 < r["time_s"] <= times[k]][-1]
    origin = row["origin_lat_deg"], row["origin_lon_deg"], row["origin_alt_m"]
    place = [np.array(pymap3d.ecef2ned(*crooked.position(crooked.ROLLING, t), *origin))
             for t in (row["state_s"], row["state_s"] + 0.01)]  # fmt: skip
    apart = np.array([row["north_m"], row["east_m"], row["down_m"]]) - place[0]
    rate = np.array([row[f"{axis}_m_s"] for axis in ("north", "east", "down")])
    rate -= (place[1] - place[0]) / 0.01
    north, east, _ = crooked.ned(crooked.ROLLING, row["state_s"])
    return {
        "error_across_m": abs(apart[0] * east - apart[1] * north) / math.hypot(north, east),
        "error_horizontal_m": math.hypot(*apart[:2]), "error_vertical_m": abs(apart[2]),
        "error_horizontal_rate_m_s": math.hypot(*rate[:2]), "error_vertical_rate_m_s": abs(rate[2]),
    }  # fmt: skip


@covers("ranges_nmi", of=KIND)
@pytest.mark.parametrize("bias", [{}, {"range_bias_m": 0.0, "azimuth_bias_deg": 2.0}])
def test_errors_are_those_of_the_track_at_that_range(bias):
    built = scene(**{**FINE, **bias})
    for range_nmi in (here_nmi(), here_nmi() - 0.15):
        found = at(range_nmi, built)
        assert found["tracked"] == 1.0
        for name, value in by_hand(range_nmi, built).items():
            assert found[name] == pytest.approx(value, rel=1e-3, abs=0.02), name
    far = at(50.0)
    assert math.isnan(far["tracked"]) and math.isnan(far["error_across_m"])
    assert far["first_track_range_nmi"] == pytest.approx(here_nmi(), abs=0.1)


def test_a_bias_of_azimuth_lies_across_it():
    keys = {**FINE, "range_bias_m": 0.0, "elevation_bias_deg": 0.0, "azimuth_bias_deg": 2.0}
    found = at(here_nmi(), scene(**keys))
    # In the banked body's axes: across the beam, some of it up.
    apart = math.hypot(found["error_horizontal_m"], found["error_vertical_m"])
    assert found["error_across_m"] == pytest.approx(found["error_horizontal_m"], rel=0.05)
    assert apart == pytest.approx(math.radians(2.0) * here_nmi() * MILE_M, rel=0.2)
    assert found["error_horizontal_rate_m_s"] > 0.0


@covers("from_s", of=KIND)
def test_what_was_near_at_the_start_counts_later():
    assert at(here_nmi(), from_s=0.0)["tracked"] in (0.0, 1.0)
    assert math.isnan(at(here_nmi(), from_s=6.5)["tracked"])


@covers("within_m", of=KIND)
def test_a_track_that_is_too_far_off_is_nobody_s():
    found = at(here_nmi(), within_m=60.0)
    assert found["tracked"] == 0.0 and math.isnan(found["first_track_range_nmi"])
    assert at(here_nmi(), within_m=160.0)["tracked"] == 1.0


@covers("step_s", of=KIND)
def test_a_track_is_at_most_two_steps_old():
    """Told every second; instants a tenth of a second apart, of which two reach back 0.2 s."""
    slow = scene(**FINE, scan_rate_hz=1, offset_s=0.55)
    late = at(here_nmi(), slow, step_s=0.1, from_s=5.4, ranges_nmi=[here_nmi()])
    soon = at(here_nmi(), slow, step_s=1.0, from_s=5.4, ranges_nmi=[here_nmi()])
    assert (late["tracked"], soon["tracked"]) == (0.0, 1.0) or late["tracked"] == 1.0


@covers("quantile", of=KIND)
def test_the_quantile_is_that_of_the_runs():
    metric = {"metric": "track_errors_by_range", "ranges_nmi": [here_nmi()], "from_s": 2,
              "step_s": 0.25, "quantile": 0.75}  # fmt: skip
    noisy = scene((crooked.ROLLING,), azimuth_error_deg=1.0)
    result = dsa_des.study(noisy, metrics=[metric], replicas=24, seed=3, workers=1,
                           runs_per_chunk=24)  # fmt: skip
    name = f"error_across_m.{here_nmi():g}"
    values = np.sort(result.runs.column(name).to_numpy())
    (line,) = [row for row in result.summary.to_pylist() if row["result"] == name]
    assert line["value"] == values[17] and line["low"] < values[17] < line["high"]
    assert {line["low"], line["high"]} <= set(values)


def test_bad_ranges_are_refused():
    for ranges, said in ([0.0], "must lie above 0"), ([2.0, 2.0], "names a range twice"):
        with pytest.raises(Exception, match=f"ranges_nmi: {said}"):
            measured(scene(), {"metric": "track_errors_by_range", "ranges_nmi": ranges})


def test_errors_are_those_of_the_target_that_is_at_the_range():
    """Two targets, some 1.5 km apart: whoever is nearest to the range, with its own track."""
    both = scene((crooked.DIVING, crooked.ROLLING), **FINE)
    for target in (crooked.ROLLING, crooked.DIVING):
        range_nmi = round(float(np.linalg.norm(crooked.ned(target, 3.0))) / MILE_M, 2)
        alone, found = at(range_nmi, scene((target,), **FINE)), at(range_nmi, both)
        assert found["tracked"] == 1.0
        assert found["error_horizontal_m"] == pytest.approx(alone["error_horizontal_m"], abs=5.0)
        assert found["error_horizontal_rate_m_s"] < 20.0
