"""A sensor that reports late, beside one that looks often: at one of two targets in vain."""

import crooked
import pytest
from covering import covers
from wired import chain, rows, run

import dsa_des
from components.display.terminal import outcome_lines
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

STATED = {"errors": "stated", "quantised": False, "azimuth_error_deg": 0.3,
          "elevation_error_deg": 0.4}  # fmt: skip
#: Sees both all the time.
PULSE = {**STATED, "type": "radar.range_boundary", "range_km": 20.0, "range_error_m": 15.0,
         "scan_rate_hz": 5}  # fmt: skip
#: Looks 20 times a second and sees the near one alone.
EYE = {**STATED, "type": "optical.range_boundary", "range_km": 2.0, "scan_rate_hz": 20,
       "offset_s": "0.03"}  # fmt: skip
NEAR = {**crooked.ROLLING, "name": "near", "east_m": -900.0, "north_m": -600.0,
        "heading_deg": 217.0, "speed_mps": 70.0}  # fmt: skip
#: 2.5 km away, and no nearer in time.
FAR = {**crooked.ROLLING, "heading_deg": 217.0, "speed_mps": 70.0}


def scene(latency_s="0", kind="tracking.ekf", *, eye=None, fusion=None, duration_s=4, **tracker):
    sensors = {"a_pulse": {**PULSE, "latency_s": latency_s}, "eye": {**EYE, **(eye or {})}}
    return chain(
        sensors, targets=[FAR, NEAR], duration_s=duration_s,
        fusion=fusion or {"type": "fusion.pass_through"}, tracker={"type": kind, **tracker},
    )  # fmt: skip


def settled(*arguments, **keys):
    """Return when as many tracks as targets are confirmed with a range, and the share that has one.

    Of all confirmed rows, from then on.
    """
    found = rows(run(scene(*arguments, **keys)), "state_tracks")
    held = [r for r in found if r["track_status"] in ("confirmed", "coasted")]
    first = {}
    for row in held:
        if row["has_range"]:
            first.setdefault(row["track"], row["time_s"])
    assert len(first) >= 2, "a target has no track with a range"
    both = sorted(first.values())[1]
    later = [r for r in held if r["time_s"] >= both]
    return both, sum(r["has_range"] for r in later) / len(later), later


@covers("late", of=("tracking.ekf", "tracking.ukf", "tracking.imm"))
@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.ukf", "tracking.imm"])
@pytest.mark.parametrize("latency_s", ["0.25", "0.5"])
def test_both_are_found_as_soon_as_without_but_for_the_latency(kind, latency_s):
    soon, share, _ = settled("0", kind)
    late, share_late, rows_late = settled(latency_s, kind)
    assert share > 0.9 and late <= soon + float(latency_s) + 0.2 and share_late > 0.9
    # The radar goes on updating both, though the camera has looked since.
    newest = {r["track"]: r for r in rows_late if r["time_s"] > 3.7}
    assert all("a_pulse" in r["contributors"] for r in newest.values())


def test_a_look_in_vain_makes_no_look_late_even_where_late_ones_are_dropped():
    """Of the far target nothing is dropped; of the near one, which the camera sees, all is."""
    found = rows(run(scene("0.25", late="drop")), "state_tracks", time_s=3.98)
    (far,) = [row for row in found if row["contributors"] == "a_pulse"]
    assert far["has_range"] and far["updated_s"] > 3.5
    near = [row for row in found if "eye" in row["contributors"]]
    assert near and all(row["updated_by"] == "eye" for row in near)


@pytest.mark.parametrize(
    "keys",
    [
        {"eye": {"latency_s": "0.4"}},
        {"eye": {"latency_s": "0.1"}, "late": "rerun"},
        {"fusion": {"type": "fusion.gated", "time_gate_s": 0.1, "angle_gate_deg": 3,
                    "range_gate_m": 300}},
    ],
    ids=["both late", "worked on again", "gated"],
)  # fmt: skip
def test_whatever_else_is_late_or_put_together(keys):
    late, share, _ = settled("0.5", **keys)
    assert late < 2.0 and share > 0.9


def shares(*arguments, **keys):
    found = notes_of_scene(Simulation(dsa_des.load_scene(scene(*arguments, **keys))))
    return [text for text in found if "too late" in text]


def test_what_a_policy_drops_is_said_with_its_share():
    """Of looks each 0.2 s at 0, 0.2, ... and 0.03, 0.08, ...: all with 0.25 s."""
    assert shares("0.25") == shares("0.5", late="rerun") == []
    (said,) = shares("0.25", late="drop")
    assert "100% of the looks of a_pulse" in said and "late is 'drop'" in said
    # The camera looks 0.03 s after it: what comes at that instant, with its look, is not late.
    assert shares("0.03", late="drop") == [] != shares("0.031", late="drop")
    simulation = Simulation(dsa_des.load_scene(scene("0.03", late="drop", duration_s=1)))
    assert simulation.run().report["late_looks"] == {"tracker": {}}
    (half,) = shares("0.02", late="drop", eye={"offset_s": "0.01", "scan_rate_hz": "2.5"})
    assert "50% of the looks of a_pulse" in half
    (lag,) = shares("0.5", lag_s=0.2)
    assert "lag_s is 0.2" in lag and "100%" in lag


def test_what_a_run_left_out_is_said_with_its_sensor_and_share():
    """The radar's looks at 0, 0.2, ... come 0.25 s later, by when the camera has seen the near."""
    simulation = Simulation(dsa_des.load_scene(scene("0.25", late="drop")))
    summary = simulation.run().report
    ((tracker, late),) = summary["late_looks"].items()
    (told,) = late.values()
    assert list(late) == ["a_pulse"] and told["looks"] == 19 and told["left_out"] >= 17
    assert told["share"] == told["left_out"] / 19
    (line,) = outcome_lines({"late_looks": summary["late_looks"]})
    assert line == (
        f"{tracker}: {told['left_out']} of 19 looks of a_pulse ({told['share']:.0%}) "
        "came too late and were left out"
    )
