"""Flown intercepts tracked by radar and camera, as in the table of docs/tracking.md."""

import pytest

import dsa_des
from tests.alerting.reference_data import reference_file

#: Beginning of each flight, s: the whole of them is in the table of docs/tracking.md.
BEGINNING_S = 20


#: As the scene has it, by two models, and with all that `tracking.imm` has by default.
TRACKERS = {"two models": [], "defaults": ["blocks.tracker={type='tracking.imm'}"]}


@pytest.mark.parametrize("tracker", TRACKERS)
@pytest.mark.parametrize("flight", [3, 23, 51])
def test_a_flown_intercept_is_tracked_from_its_first_second_on(flight, tracker):
    path = reference_file(f"nrc_intercepts/NRC_Intercept{flight}.daa")
    scene = dsa_des.load_scene(
        "configs/tracking/flown_intercept.toml",
        sets=[f"blocks.traffic.file='{path}'", f"duration_s={BEGINNING_S}", *TRACKERS[tracker]],
    )
    study = dsa_des.study(scene, metrics=["tracking"], replicas=1, workers=1)
    found = {row["result"]: row["value"] for row in study.summary.to_pylist()}
    assert found["track_confirmed_share"] == 1.0 and found["track_confirmation_s"] < 2.0
    assert found["track_completeness"] > 0.9 and found["track_spuriousness"] < 0.05
    assert found["track_position_error_m"] < 120.0
    assert found["track_swapped"] == 0.0 and found["track_ambiguity"] < 1.05
    # Modest rather than too sure: interacting models allow for turns at any time.
    assert 1.5 < found["track_nees_mean"] < 9.0
    assert found["track_nis_per_freedom"] == pytest.approx(1.0, abs=0.15)
