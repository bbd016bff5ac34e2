"""Metrics tell targets, alerting blocks and manoeuvres apart."""

import math
from pathlib import Path
from typing import Any

import crooked
import numpy as np
import pymap3d
import pytest
from test_alert_time_metric import BEHIND_M, CONF, behind
from test_alert_time_metric import found as alert_times
from test_mitigated_metric import scene as closed_loop
from test_severity_metric import encounter as severity
from wired import HEARS_ALL, chain, measured, rows, run

from components.well_clear.severity import collision_probability

SIZES_OF_ALERTS = {
    "metric": "alert_times", "horizontal_m": 500, "vertical_m": 150, "nmac_horizontal_m": 300,
    "nmac_vertical_m": 150,
}  # fmt: skip


def test_the_loss_is_that_of_the_target_that_counts(tmp_path: Path) -> None:
    """The far one comes 4 s later, and so does its alert."""
    two = behind("near", BEHIND_M, 60.0), behind("far", BEHIND_M + 150.0, 60.0)
    near, far = (alert_times(tmp_path, *two, target=name) for name in ("near", "far"))
    for name in ("alert_to_loss_s", "alert_to_nmac_s"):
        assert far[name] == pytest.approx(near[name], abs=0.3)


def test_each_alerting_block_has_its_own_times(tmp_path: Path) -> None:
    """The second has both levels at once: 5 s sooner, and as a surprise."""
    scene = chain({}, targets=[behind("near", BEHIND_M, 60.0)], duration_s=40)
    scene["blocks"] = {"traffic": scene["blocks"]["traffic"]}
    for name, alerting_s in (("alarm", 12), ("both", 17)):
        path = tmp_path / f"{name}.conf"
        text = CONF.replace("alerting_time = 12", f"alerting_time = {alerting_s}")
        if name == "both":
            text = text.replace("alerting_time = 20", "alerting_time = 17")
        path.write_text(text, encoding="utf-8")
        scene["blocks"][name] = {"type": "alerting.daidalus", "scan_rate_hz": 4, "conf": str(path)}
    scene["wires"] = ["traffic -> alarm", "traffic -> both"]
    got = measured(scene, SIZES_OF_ALERTS)
    first = {name: got[f"first_alert_time_s.{name}"] for name in ("alarm", "both")}
    assert first["both"] == pytest.approx(first["alarm"] - 5.0, abs=0.26)
    for name, sudden in (("alarm", 0), ("both", 1)):
        assert got[f"alert_surprise.{name}"] == sudden
        assert got[f"alert_to_loss_s.{name}"] == pytest.approx(30.0 - first[name], abs=0.3)


def passing(name: str, side_m: float, up_m: float) -> dict[str, Any]:
    """From ahead, some metres to the right and above after 20 s."""
    heading = math.radians(217.0)
    return {
        "name": name, "heading_deg": 37.0, "speed_mps": 30.0, "up_m": up_m,
        "east_m": 2000.0 * math.sin(heading) + side_m * math.cos(heading),
        "north_m": 2000.0 * math.cos(heading) - side_m * math.sin(heading),
        "climb_mps": crooked.OWNSHIP["climb_mps"],
    }  # fmt: skip


def test_the_most_severe_may_be_any_target() -> None:
    """Each value is the worse of both: one passes nearer, the other at less height."""
    near, level = passing("near", 100.0, 75.0), passing("level", 240.0, 12.0)
    scene = chain({"radar": HEARS_ALL}, targets=[near, level], duration_s=40)
    each = [
        measured(scene, {"metric": "severity", "target": name, "horizontal_m": 700.0})
        for name in ("near", "level")
    ]
    both = measured(scene, {"metric": "severity", "horizontal_m": 700.0})
    assert each[0]["pnmac"] > each[1]["pnmac"] == 0.0
    assert each[1]["slowc_percent"] > each[0]["slowc_percent"] + 5.0
    assert both == {key: max(one[key] for one in each) for key in both}


def test_each_altimeter_is_at_its_own_altitude() -> None:
    """The ownship at 8,070 ft with Mode C, the other 900 m higher, where errors are larger."""
    keys = {"mode_c_own": True, "nmac_vertical_m": 910.0}
    found = severity(120.0, 900.0, **keys)["pnmac"]
    target = passing("passing", 120.0, 900.0)
    altitudes = [
        crooked.geodetic(crooked.position(flight, 20.0))[2] for flight in (crooked.OWNSHIP, target)
    ]
    height_m = altitudes[1] - altitudes[0]
    right, swapped = (
        float(collision_probability(120.0, -height_m, order, (True, False), vertical_m=910.0))
        for order in (altitudes, altitudes[::-1])
    )
    assert abs(right - swapped) > 0.005
    assert found == pytest.approx(right, abs=0.001)


def test_height_counts_where_time_does() -> None:
    """60 m higher: within 70 m of height tau loses well clear, within 50 m nothing does."""
    crossing = {
        "name": "crossing", "east_m": -2500.0, "north_m": -2300.0, "up_m": 60.0,
        "heading_deg": 60.0, "speed_mps": 55.0, "climb_mps": 3.0,
    }  # fmt: skip
    scene = chain({"radar": HEARS_ALL}, targets=[crossing], duration_s=30)
    keys = {"metric": "well_clear", "horizontal_m": 400.0, "tau_s": 9.0}
    lost = [measured(scene, {**keys, "vertical_m": v})["well_clear_lost"] for v in (50.0, 70.0)]
    assert lost == [0, 1]


def test_the_class_is_that_of_the_nearest() -> None:
    """Whichever stands first: one comes from ahead, the other stays far behind."""
    near = passing("near", 50.0, 40.0)
    far = {**behind("far", 3000.0, 50.0), "speed_mps": crooked.OWNSHIP["speed_mps"]}
    for targets in ([near, far], [far, near]):
        scene = closed_loop()
        scene["blocks"]["traffic"]["intruders"] = targets
        sizes = {"horizontal_m": 9e3, "vertical_m": 900.0}
        got = measured(scene, {"metric": "risk_ratio", **sizes})
        begin = "well_clear_lost_risk_ratio."
        classes = {n for n, value in got.items() if n.startswith(begin) and not math.isnan(value)}
        assert classes == {"well_clear_lost_risk_ratio.head-on"}


def test_flights_are_those_of_who_is_wired_by_latency_and_wire() -> None:
    """One turns late, after its own time and that of the wire; another one is wired to nobody."""
    scene = closed_loop()
    blocks = scene["blocks"]
    blocks["idle"] = {**blocks["avoidance"], "range_km": 1.4, "turn_deg": 90}
    blocks["avoidance"]["latency_s"] = 4
    scene["wires"].append("tracker -> idle")
    found = run(scene)
    told = {row["block"]: row["time_s"] for row in rows(found, "manoeuvres")}
    assert told["idle"] < told["avoidance"]
    truth = rows(found, "truth")
    own = {row["time_s"]: row for row in truth if row["target"] is None}
    apart = []
    for row in truth:
        if row["target"] is not None:
            here = (own[row["time_s"]][name] for name in ("lat_deg", "lon_deg", "alt_m"))
            apart.append(np.linalg.norm(
                pymap3d.geodetic2enu(row["lat_deg"], row["lon_deg"], row["alt_m"], *here)
            ))  # fmt: skip
    got = measured(scene, "closest_approach")["closest_approach_m"]
    assert got == pytest.approx(min(apart), abs=0.5)
