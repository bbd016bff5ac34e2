"""With several intruders a figure sets the alert and the declaration of one against its own loss.

One aircraft is seen from the start and alerted to, and passes 2 km away; another comes up from
behind, out of the radar's field, at 40 m/s, and flies over the ownship at 100 s.
"""

import math
from typing import Any

import pytest
from test_alert_time_metric import CONF
from wired import chain, measured

import dsa_des

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000.0, "heading_deg": 0.0, "speed_mps": 30.0}
AHEAD = {
    "name": "oncoming", "east_m": 1200.0, "north_m": 9000.0, "up_m": 120.0, "heading_deg": 180.0,
    "speed_mps": 60.0, "legs": [
        {"kind": "straight", "duration_s": 50}, {"kind": "turn", "rate_deg_s": 3, "angle_deg": 90},
        {"kind": "straight"},
    ],
}  # fmt: skip
BEHIND = {"name": "behind", "east_m": 0.0, "north_m": -4000.0, "up_m": 0.0, "heading_deg": 0.0,
          "speed_mps": 70.0}  # fmt: skip
FORWARD = {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 15,
           "azimuth_deg": [-60, 60]}  # fmt: skip
#: Of cylinders of 700 ft, half a mile and 75 ft at the least, DO-365's well clear by distances.
SIZES = {"horizontal_m": 609.6, "vertical_m": 76.2}
LOST_S = (4000.0 - 609.6) / 40.0


def scene(targets: Any = (AHEAD, BEHIND)) -> dict[str, Any]:
    return chain({"radar": FORWARD}, ownship=OWN, targets=targets, duration_s=120)


@pytest.mark.parametrize("targets", [(AHEAD, BEHIND), (BEHIND, AHEAD)])
def test_detections_are_those_of_the_aircraft_that_comes_near(targets):
    """It comes into the field as it passes: first seen at 101 s."""
    found = measured(scene(targets), {"metric": "well_clear", **SIZES}, "closest_approach")
    assert found["closest_approach_time_s"] == pytest.approx(100.0, abs=0.1)
    assert found["well_clear_loss_time_s"] == pytest.approx(LOST_S, abs=0.3)
    for name in ("radar", "any"):
        assert found[f"detection_to_closest_s.{name}"] == pytest.approx(-1.0, abs=0.1)
        assert found[f"declaration_to_closest_s.{name}"] == pytest.approx(-1.0, abs=0.1)
        assert found[f"warning_time_s.{name}"] == pytest.approx(LOST_S - 101.0, abs=0.3)
    alone = {
        key: measured(scene(), {"metric": metric, "target": "behind", **keys})
        for key, metric, keys in (("lost", "well_clear", SIZES), ("near", "closest_approach", {}))
    }
    assert found == {**alone["lost"], **alone["near"]}


def test_of_two_losses_the_shorter_warning_counts():
    """Both lost; a third, also from behind, is declared by nobody: then there is no warning."""
    near = {**AHEAD, "east_m": 100.0, "up_m": 20.0, "legs": [{"kind": "straight"}]}
    sizes = {"metric": "well_clear", **SIZES}
    two = measured(scene((near, BEHIND)), sizes)
    each = [measured(scene((near, BEHIND)), {**sizes, "target": n}) for n in ("oncoming", "behind")]
    warnings = [one["warning_time_s.radar"] for one in each]
    assert warnings[0] > 80.0 > 0.0 > warnings[1] == two["warning_time_s.radar"]
    assert two["well_clear_loss_time_s"] == min(one["well_clear_loss_time_s"] for one in each)
    ends = {**BEHIND, "name": "gone", "end_time_s": 95.0}
    assert math.isnan(measured(scene((near, ends)), sizes)["warning_time_s.radar"])
    study = dsa_des.study(scene((near, BEHIND)), metrics=[sizes], replicas=1, workers=1)
    (row,) = study.runs.to_pylist()
    # The one ahead was declared in the first scan; the warning that counts was not cut off.
    assert row["warning_cut_off.radar"] is None


@pytest.mark.parametrize("who", ["behind", "oncoming", None])
def test_an_alert_of_another_aircraft_is_no_warning(tmp_path, who):
    """Alerts of the one ahead alone: the one behind is hidden from the alerting by its height."""
    path = tmp_path / "one.conf"
    path.write_text(CONF.replace("= 250 [m]", "= 100 [m]").replace("12 [s]", "18 [s]"))
    ahead = {**AHEAD, "east_m": 650.0, "up_m": 90.0, "legs": [{"kind": "straight"}]}
    behind = {**BEHIND, "up_m": 110.0}
    built = scene((ahead, behind))
    built["blocks"] = {
        "traffic": built["blocks"]["traffic"],
        "alarm": {"type": "alerting.daidalus", "scan_rate_hz": 1, "conf": str(path)},
    }
    built["wires"] = ["traffic -> alarm"]
    keys = {"metric": "alert_times", "horizontal_m": 600, "vertical_m": 130, "surprise_s": 3.0}
    found = measured(built, {**keys, **({} if who is None else {"target": who})})
    found = {name.removesuffix(".alarm"): value for name, value in found.items()}
    events = [found[f"alert_{what}"] for what in ("missed", "late", "nuisance", "surprise")]
    # Head-on at 90 m/s, it is within 700 m at 92 s or so, and never within 600 m.
    assert events == {"behind": [1, 1, 0, 0], "oncoming": [0, 0, 1, 1], None: [1, 1, 1, 1]}[who]
    assert math.isnan(found["alert_to_loss_s"])
    assert math.isnan(found["first_alert_time_s"]) == (who == "behind")
    # Both lost, the one ahead after an alert: of both together there is no lead, one has none.
    wider = measured(
        built, {**keys, "horizontal_m": 680, **({} if who is None else {"target": who})}
    )
    assert math.isnan(wider["alert_to_loss_s.alarm"]) == (who != "oncoming")
    assert wider["alert_missed.alarm"] == (who != "oncoming")


def test_a_delay_is_from_the_detection_of_the_aircraft_that_is_declared():
    """One is seen once at 0 s, and again from 60 s on; the other, seen later, is declared first."""
    once = {**AHEAD, "name": "once", "end_time_s": 0.5, "legs": [{"kind": "straight"}]}
    later = {**AHEAD, "name": "later", "start_time_s": 19.5, "legs": [{"kind": "straight"}]}
    found = measured(scene((once, later)), {"metric": "declaration", "m": 2, "n": 3})
    assert found["declaration_time_s.radar"] == 21.0
    assert found["declaration_delay_s.radar"] == found["declaration_delay_s.any"] == 1.0
