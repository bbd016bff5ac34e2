"""A known range stands for power and gain: they may be left out beside it, and change nothing."""

import crooked
import pytest
from covering import covers
from wired import chain, rows, run

import dsa_des
from dsa_des.errors import SceneError

KNOWN = {"rcs_dbsm": 0.0, "range_km": 3.0, "pd": 0.9, "swerling": 1}
SHEET = {"type": "radar.swerling", "scan_rate_hz": 20, "frequency_hz": 77e9, "calibrate": KNOWN,
         "false_alarm_probability": 1e-6, "azimuth_deg": [-90, 90],
         "elevation_deg": [-60, 60]}  # fmt: skip


def looks(**keys):
    found = run(chain({"radar": {**SHEET, **keys}}, duration_s=0.3))
    return [(row["target"], row["detected"], row["snr_db"]) for row in rows(found, "looks")]


@covers("power_w", "antenna_gain_db", "calibrate", of=("radar.swerling",))
def test_power_and_gain_change_nothing_beside_a_known_range():
    sheet = looks()
    assert sum(detected for _, detected, _ in sheet) > 3
    for keys in ({"power_w": 0.01, "antenna_gain_db": 25.0}, {"power_w": 300.0},
                 {"antenna_gain_db": 10.0}):  # fmt: skip
        stated = looks(**keys)
        assert [one[:2] for one in stated] == [one[:2] for one in sheet]
        assert [one[2] for one in stated] == pytest.approx([one[2] for one in sheet], abs=1e-9)


def test_a_target_at_the_known_range_has_the_known_pd():
    level = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 900.0, "speed_mps": 0.0,
             "heading_deg": 217.0}  # fmt: skip
    target = {**crooked.ROLLING, "north_m": 3000.0, "east_m": 0.0, "up_m": 0.0, "speed_mps": 0.0,
              "climb_mps": 0.0, "rcs_dbsm": 0.0, "swerling": 1}  # fmt: skip
    wide = {**SHEET, "azimuth_deg": [-180, 180]}
    found = run(chain({"radar": wide}, ownship=level, targets=[target], duration_s=0.1))
    assert rows(found, "looks")[0]["detection_probability"] == pytest.approx(0.9, abs=1e-3)


@pytest.mark.parametrize(
    ("given", "said"),
    [({}, "power_w and antenna_gain_db are not given"),
     ({"power_w": 1.0}, "antenna_gain_db is not given")],
)  # fmt: skip
def test_without_a_known_range_they_must_be_given(given, said):
    radar = {**SHEET, "bandwidth_hz": 1e4, **given}
    del radar["calibrate"]
    with pytest.raises(SceneError, match=said):
        dsa_des.load_scene(chain({"radar": radar}))
