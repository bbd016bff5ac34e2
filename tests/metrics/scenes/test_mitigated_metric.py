"""Events as flown and as they would have been, against the recorded truth of the same run."""

from typing import Any

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from test_alert_time_metric import behind
from wired import chain, measured, rows, run, sensor

import dsa_des

KIND = ("[metric mitigated]",)
RADAR = sensor("radar.range_boundary", scan_rate_hz=20)
SIZES = {"horizontal_m": 600.0, "vertical_m": 100.0, "nmac_horizontal_m": 150.0,
         "nmac_vertical_m": 60.0}  # fmt: skip


def scene(**wire: Any) -> dict[str, Any]:
    """An aircraft catches up 50 m above, and is turned away from when it is 800 m near."""
    found = chain(
        {"radar": RADAR}, targets=[behind("near", 1500.0, 50.0)], duration_s=60,
        fusion={"type": "fusion.pick_best"}, tracker={"type": "tracking.stub"},
    )  # fmt: skip
    found["blocks"]["avoidance"] = {
        "type": "avoidance.turn_away", "range_km": 0.8, "turn_deg": 40, "pause_s": 100,
    }  # fmt: skip
    found["wires"] += [
        "tracker -> avoidance",
        {"from": "avoidance", "to": "traffic", "delay_s": 1.5, "holds": "nothing", **wire},
    ]
    return found


@pytest.fixture(scope="module")
def flown() -> np.ndarray:
    """Horizontal and vertical distance over time, from the truth that the run records."""
    truth = rows(run(scene()), "truth")
    own = {row["time_s"]: row for row in truth if row["target"] is None}
    found = []
    for row in truth:
        if row["target"] is not None:
            here = (own[row["time_s"]][name] for name in ("lat_deg", "lon_deg", "alt_m"))
            e, n, _ = pymap3d.geodetic2enu(row["lat_deg"], row["lon_deg"], row["alt_m"], *here)
            found.append((np.hypot(e, n), abs(row["alt_m"] - own[row["time_s"]]["alt_m"])))
    return np.array(found)


def events(**keys: Any) -> dict[str, Any]:
    return measured(scene(), {"metric": "mitigated", **SIZES, **keys})


@covers("horizontal_m", "nmac_horizontal_m", of=KIND)
def test_what_is_flown_is_what_the_truth_says(flown):
    nearest = flown[:, 0].min()
    assert 200 < nearest < 590  # it would have flown right under
    for factor, happens in ((0.99, 0), (1.01, 1)):
        size = nearest * factor
        got = events(horizontal_m=size, nmac_horizontal_m=size, nmac_vertical_m=100.0)
        assert (got["well_clear_lost_nominal"], got["nmac_nominal"]) == (1, 1)
        assert (got["well_clear_lost_mitigated"], got["nmac_mitigated"]) == (happens, happens)


@covers("vertical_m", "nmac_vertical_m", of=KIND)
def test_heights_count_in_both():
    got = events(vertical_m=45.0)
    assert (got["well_clear_lost_nominal"], got["well_clear_lost_mitigated"]) == (0, 0)
    assert (got["nmac_nominal"], got["nmac_mitigated"]) == (1, 0)
    got = events(nmac_vertical_m=45.0)
    assert (got["nmac_nominal"], got["well_clear_lost_mitigated"]) == (0, 1)


@covers("step_s", of=KIND)
def test_a_coarse_step_steps_over_a_short_event():
    """Within 20 m for a second, which steps of 10 s do not see."""
    sparse = scene()
    sparse["blocks"]["traffic"]["sample_interval_s"] = 100.0
    keys = {"metric": "mitigated", **SIZES, "nmac_horizontal_m": 20.0}
    found = [measured(sparse, {**keys, "step_s": s})["nmac_nominal"] for s in (0.1, 10.0)]
    assert found == [1, 0]


@pytest.mark.parametrize("wire", [{"jitter_s": 0.1}, {"drop_probability": 0.1}])
def test_a_wire_whose_delay_is_not_known_is_refused(wire):
    with pytest.raises(Exception, match="must have a fixed delay in"):
        measured(scene(**wire), {"metric": "mitigated"})


def test_replicas_measured_together_have_their_own_manoeuvres(flown):
    """Whoever turns at 200 m turns too late, and whoever does at 800 m flies as above."""
    size = flown[:, 0].min() * 0.99
    sizes = {**SIZES, "horizontal_m": size, "nmac_horizontal_m": size, "nmac_vertical_m": 100.0}
    runs = dsa_des.study(
        scene(), metrics=[{"metric": "mitigated", **sizes}], replicas=3, workers=1,
        draws={"blocks.avoidance.range_km": {"choice": [0.8, 0.2]}}, runs_per_chunk=3,
    ).runs.to_pylist()  # fmt: skip
    late = [row["draw.avoidance.range_km"] == 0.2 for row in runs]
    assert any(late) and not all(late[1:])
    for event in ("well_clear_lost", "nmac"):
        assert [row[f"{event}_nominal"] for row in runs] == [1, 1, 1]
        assert [row[f"{event}_mitigated"] for row in runs] == late


def test_without_a_loop_there_is_nothing_to_compare():
    open_loop = chain({"radar": RADAR}, targets=[crooked.ROLLING], duration_s=2)
    with pytest.raises(Exception, match="manoeuvres"):
        measured(open_loop, {"metric": "mitigated"})


def test_other_metrics_are_of_the_flights_as_flown(flown):
    """Loss, closest approach and severity of the steered flight, by the truth of its run."""
    nearest = flown[:, 0].min()
    sizes = {**SIZES, "horizontal_m": nearest * 1.01, "nmac_horizontal_m": nearest * 0.99}
    lost = measured(scene(), {"metric": "well_clear", **sizes})
    assert (lost["well_clear_lost"], lost["nmac"]) == (1, 0)
    assert measured(scene(), "closest_approach")["closest_approach_m"] == pytest.approx(
        np.hypot(*flown.T).min(), abs=0.5
    )
    alone = scene()
    alone["wires"] = alone["wires"][:-1]
    del alone["blocks"]["avoidance"]
    alone["wires"] = [wire for wire in alone["wires"] if wire != "tracker -> avoidance"]
    severe, less = (
        measured(one, {"metric": "severity", "horizontal_m": 600.0, "tau_s": 0.0})["slowc_percent"]
        for one in (alone, scene())
    )
    assert severe > less + 5.0 > 5.0


@covers("tau_s", of=KIND)
def test_time_counts_in_both():
    """Passed too far aside to be within 300 m, but so fast at first that tau is short."""
    assert events(horizontal_m=100.0)["well_clear_lost_mitigated"] == 0
    assert events(horizontal_m=100.0, tau_s=60.0)["well_clear_lost_mitigated"] == 1


def test_where_nobody_is_told_anything_events_are_those_without_manoeuvres():
    quiet = scene()
    quiet["duration_s"] = 3
    found = measured(quiet, {"metric": "mitigated", **SIZES, "horizontal_m": 3000.0})
    assert found["well_clear_lost_mitigated"] == found["well_clear_lost_nominal"] == 1.0
    assert found["nmac_mitigated"] == found["nmac_nominal"] == 0.0
