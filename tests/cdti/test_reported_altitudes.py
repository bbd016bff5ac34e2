"""The thesis's TRF3 (Fig. 4.15 and 4.16): a target that TCAS knows has altitude and climb shown."""

import pytest
from displayed import displayed
from wired import chain

TRF3 = {"name": "TRF3", "east_m": -4000.0, "north_m": -5500.0, "up_m": 200.0, "heading_deg": 20.0,
        "speed_mps": 80.0, "climb_mps": 4.0, "mode_s": True}  # fmt: skip
GLIDER = {"name": "glider", "east_m": -2000.0, "north_m": -3500.0, "up_m": -100.0,
          "speed_mps": 30.0, "climb_mps": -2.0}  # fmt: skip
RADAR = {"type": "radar.range_boundary", "scan_rate_hz": 2, "range_km": 20.0}


@pytest.mark.parametrize("qnh_hpa", [1013.25, 983.25])
def test_altitude_and_climb_of_who_reports_them(qnh_hpa):
    tcas = {"type": "surveillance.active", "scan_rate_hz": 1, "elevation_deg": [-60, 60]}
    scene = chain(
        {"radar": RADAR, "tcas": {**tcas, "replies": "certain", "far_every": 1}},
        targets=[TRF3, GLIDER], duration_s=12.2, fusion={"type": "fusion.pick_best"},
        tracker={"type": "tracking.stub"}, weather={"qnh_hpa": qnh_hpa},
    )  # fmt: skip
    scope, recorded = displayed(scene)
    found = {scope.name_of(row[0]): row for row in scope.page_content(12.2)["contacts"]}
    last = [row for row in recorded["detections"] if row["block"] == "tcas"][-1]
    # What the own altimeter reads, as linear as below 11 km.
    share = (qnh_hpa / 1013.25) ** 0.190263
    own_alt_m = 288.15 / 0.0065 * (1 - share) + share * scope.page_content(12.2)["own"]["alt"]
    assert last["target"] == "TRF3"
    assert found["TRF3"][3] == pytest.approx(last["reported_alt_m"] - own_alt_m, abs=0.1)
    assert found["TRF3"][8] == pytest.approx(4.0, abs=25.0 * 0.3048 / 5.0)
    assert found["glider"][6:9] == [None, None, None]
