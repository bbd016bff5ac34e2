"""The shipped studies of field and range, and of see and avoid, in short form."""

import dsa_des

TOGETHER = ("figures=[]", "runs_per_chunk=100")


def ratios(result, metric, *axes):
    rows = [row for row in result.summary.to_pylist() if row["result"] == metric]
    return {tuple(row[axis] for axis in axes): row["value"] for row in rows}


def test_a_camera_leads_out_of_what_it_sees_early_enough():
    """Six courses of 105 kt from 20 deg left to 15 deg right, straight ahead left out."""
    result = dsa_des.study(
        "configs/studies/field_and_range.toml",
        sets=[
            "replicas=6", "draws.blocks.traffic.encounter={sequence=[32, 1]}", *TOGETHER,
            "axes.blocks.camera.range_km=[0.4, 1.2]", "axes.field_of_view_deg.values=[14, 120]",
            'axes.field_of_view_deg.set."blocks.camera.azimuth_deg"=[[-7, 7], [-60, 60]]',
        ],
        workers=1,
    )  # fmt: skip
    axes = ("camera.range_km", "avoidance.direction", "field_of_view_deg")
    found = ratios(result, "nmac_risk_ratio", *axes)
    assert {key[0] for key, value in found.items() if value == 1.0} >= {0.4}
    # Seen in time, all but those outside of the narrow field (15 and 10 deg) are led out of.
    assert found[1.2, "away", 120] == found[1.2, "towards", 120] == 0.0
    assert 0.3 < found[1.2, "away", 14] < 0.9


def test_two_pilots_leave_no_more_than_one_who_looks_out_seldom():
    result = dsa_des.study(
        "configs/studies/see_and_avoid_risk.toml", sets=["replicas=12", *TOGETHER], workers=1
    )
    lost = ratios(result, "well_clear_lost_mitigated", "pilots")
    before = set(ratios(result, "well_clear_lost_nominal", "pilots").values())
    assert len(before) == 1 and len(lost) == 3
    assert lost["two",] <= lost["one, a third of the time",] <= before.pop() + 0.1
