"""No column but the truth tells echoes as faint as noise from noise, nor where a target truly is.

The setting is fair: the targets are spread as noise is, over the field of view, over ranges and
over range rates, and so faint that noise alone makes their detections. Strong targets stand out by
what they are; of them nothing is left once what was measured is known.
"""

import math

import crooked
import numpy as np
import pytest
import separators
from covering import LINK_BUDGETS
from wired import chain, rows, run, sensor

MODES = ("grid", "stated", "signal")
LABELS = {"target", "true_azimuth_rad", "true_elevation_rad", "true_range_m"}
#: Eight by eight by ten cells, all of the field of view; the beam sweeps 120 deg in a scan.
RADAR = {
    "azimuth_deg": [-60, 60], "elevation_deg": [-24, 24], "range_km": 4.0, "minimum_range_m": 200.0,
    "azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 3.0, "range_resolution_m": 95.0,
    "azimuth_beamwidth_deg": 15.0, "elevation_beamwidth_deg": 6.0, "budget": "free",
    "false_alarms": True, "false_alarm_probability": 0.05, "scan_rate_hz": 20, "beam_sweep": True,
    "measures_range_rate": True, "range_rate_resolution_m_s": 1.0,
}  # fmt: skip
STATED = {
    "azimuth_error_deg": 1.0, "elevation_error_deg": 0.5, "range_error_m": 40.0,
    "range_rate_error_m_s": 3.0, "azimuth_bias_deg": 0.2,
}  # fmt: skip
NAVIGATION = {"attitude_noise_deg": [0.3, 0.2, 0.1], "position_noise_m": [3.0, 2.0, 4.0]}
LEVEL = {**crooked.OWNSHIP, "yaw_deg": 217.0, "pitch_deg": 0.0, "roll_deg": 0.0, "climb_mps": 0.0}


def spread_as_noise(count, draws):
    """Targets anywhere in the field of view, whose speeds towards us are those of noise."""
    found = []
    for number in range(count):
        azimuth, elevation = (
            math.radians(draws.uniform(-60, 60)),
            math.radians(draws.uniform(-24, 24)),
        )
        range_m, rate_m_s = draws.uniform(200.0, 4000.0), draws.uniform(-250.0, 250.0)
        bearing = azimuth + math.radians(217.0)
        level_m = range_m * math.cos(elevation)
        found.append({
            "name": f"t{number}", "east_m": level_m * math.sin(bearing),
            "north_m": level_m * math.cos(bearing), "up_m": range_m * math.sin(elevation),
            "heading_deg": math.degrees(bearing) + (180.0 if rate_m_s < 0.0 else 0.0),
            "speed_mps": abs(rate_m_s) / math.cos(elevation), "climb_mps": 0.0,
            "rcs_dbsm": -200.0,
        })  # fmt: skip
    return found


def noisy(kind, mode, **keys):
    stated = STATED if mode == "stated" else {}
    low = {"threshold_db": -300.0, "scan_rate_hz": 40} if kind == "radar.threshold" else {}
    return sensor(kind, errors=mode, **{**RADAR, **stated, **low, **keys})


def features(table):
    """Every public column, and what is left of it once what was measured is known."""
    found = {}
    for name in table.column_names:
        if name not in LABELS and name not in ("block", "tick", "time_s", "scan"):
            values = np.array(table[name].to_pylist(), dtype=float)
            if not np.isnan(values).all():
                found[name] = values
    time_s = np.array(table["time_s"].to_pylist(), dtype=float)
    strength = 10.0 ** (0.1 * found["snr_db"])
    found["lit later"] = found["illuminated_s"] - time_s
    found["lit beside"] = found["lit later"] - found["azimuth_rad"] / found["azimuth_rad"].std()
    found["margin"] = found["confidence"] - found["snr_db"]
    for name in ("azimuth", "elevation", "range", "range_rate"):
        (column,) = (key for key in found if key.startswith(f"{name}_variance"))
        found[f"{name} by strength"] = found[column] * strength
        found[f"{name} by range"] = found[column] * found["range_m"] ** 2
    found["as if seen"] = found["snr_db"] + 40.0 * np.log10(found["range_m"])
    ahead = np.cos(found["azimuth_rad"]) * np.cos(found["elevation_rad"])
    found["over ground"] = found["range_rate_m_s"] + LEVEL["speed_mps"] * ahead
    return found


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_tree_finds_nothing_beyond_chance(kind, mode):
    targets = spread_as_noise(1500, np.random.default_rng(11))
    scans = 1 if kind == "radar.threshold" else 10
    block = noisy(kind, mode)
    scene = chain({"sensor": block}, ownship=LEVEL, targets=targets, navigation=NAVIGATION,
                  duration_s=scans / block["scan_rate_hz"])  # fmt: skip
    table = run(scene)["detections"]
    labels = np.array([name is None for name in table["target"].to_pylist()]).astype(int)
    assert min(labels.sum(), len(labels) - labels.sum()) > 200
    values = np.column_stack(list(features(table).values()))
    found = [separators.separation(values, labels, seed) for seed in range(3)]
    assert max(found) < 3.5 and np.mean(found) < 2.5
    # It would find a column in which a quarter of the false ones lies apart.
    part = np.random.default_rng(1).uniform(size=len(labels)) < 0.25 * labels
    assert separators.separation(np.column_stack([values, part]), labels) > 5.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_what_is_told_of_a_strong_echo_follows_from_what_is_measured(kind, mode):
    """To the last digits, of targets as of noise; and none of it gives the truth."""
    keys = {"power_w": 3.0, "false_alarm_probability": 0.01, "quantised": False, "glint_share": 0.0}
    if kind == "radar.threshold":
        keys["threshold_db"] = 5.0
    draws = np.random.default_rng(3)
    targets = [{**one, "rcs_dbsm": 10.0, "swerling": 0} for one in spread_as_noise(60, draws)]
    block = noisy(kind, mode, **keys)
    scene = chain({"sensor": block}, ownship=LEVEL, targets=targets, duration_s=0.5)
    found = rows(run(scene))
    true = np.array([row["target"] is not None for row in found])
    assert min(true.sum(), (~true).sum()) > 50

    def column(name):
        return np.array([row[name] for row in found], dtype=float)

    period_s = 1.0 / block["scan_rate_hz"]
    swept = np.clip((np.degrees(column("azimuth_rad")) + 60.0) / 120.0, 0.0, 1.0)
    np.testing.assert_allclose(
        column("illuminated_s"), column("time_s") + period_s * swept, rtol=0, atol=1e-12
    )
    assert np.ptp(column("confidence") - column("snr_db")) < 1e-9
    twice = 2.0 * 10.0 ** (0.1 * column("snr_db"))
    if mode == "signal":
        of_range = np.minimum(95.0**2 / twice, 95.0**2 / 12.0)
        np.testing.assert_allclose(column("range_variance_m2"), of_range, rtol=1e-9)
    else:
        assert np.ptp(column("range_variance_m2")) == 0.0
    # The range that an SNR gives by the radar equation is off by what the noise makes of a steady
    # echo, 4.3 dB by the root of half its SNR; a true SNR gave it to the last digit.
    level_db = (column("snr_db") + 40.0 * np.log10(column("true_range_m")))[true]
    expected_db = 10.0 / math.log(10.0) * np.sqrt(2.0 / (0.5 * twice[true]))
    assert np.std(level_db) == pytest.approx(math.sqrt(np.mean(expected_db**2)), rel=0.35)
