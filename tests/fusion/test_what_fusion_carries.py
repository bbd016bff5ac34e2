"""What fusion does with range rates, late reports and false alarms, in crooked flights."""

import crooked
import pytest
from wired import chain, noise_crosses, rows, run, sensor

RANGING = {"measures_range_rate": True}


def fused(sensors, delays=None, **sections):
    """Return the rows of a gated fusion of some sensors, some of whose wires are slow."""
    keys = {"type": "fusion.gated", "time_gate_s": 0.3, "angle_gate_deg": 5.0, "range_gate_m": 2.0}
    if sections.get("fusion", {}).get("type", keys["type"]) != keys["type"]:
        keys = {}
    scene = chain(sensors, fusion={**keys, **sections.pop("fusion", {})}, **sections)
    for name, delay_s in (delays or {}).items():
        scene["wires"].remove(f"{name} -> fusion")
        scene["wires"].append({"from": name, "to": "fusion", "delay_s": delay_s})
    return run(scene)


@pytest.mark.parametrize("rates", [True, False])
def test_a_range_is_carried_by_its_rate(rates):
    """In a quarter of a second it changes by 25 m and more, and the gate is 2 m wide."""
    one = sensor("radar.range_boundary", measures_range_rate=rates)
    two = sensor("radar.range_boundary", offset_s=0.25)
    own = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
    found = rows(fused({"one": one, "two": two}, ownship=own), "fused", time_s=0.25)
    assert {row["sensors"] for row in found} == {"one+two" if rates else "two"}


def test_a_rate_is_of_the_radar_whose_angles_are_the_finest():
    fine = {"azimuth_resolution_deg": 0.01, "elevation_resolution_deg": 0.01}
    coarse = {"azimuth_resolution_deg": 0.5, "elevation_resolution_deg": 0.5}
    bias = {"errors": "stated", "biases": "fixed", "range_rate_bias_m_s": 40.0}
    sensors = {
        "fine": sensor("radar.range_boundary", **fine, **RANGING),
        "coarse": sensor("radar.range_boundary", **coarse, **RANGING, **bias),
    }
    found = fused(sensors, fusion={"range_gate_m": 50.0})
    true = {row["target"]: row["range_rate_m_s"] for row in rows(found, block="fine")}
    together = rows(found, "fused", sensors="coarse+fine")
    assert len(together) == 2
    for row in together:
        assert row["range_rate_m_s"] == true[row["target"]]
        assert row["range_rate_variance_m2_s2"] == 0.0


def test_what_was_measured_later_and_came_earlier_belongs_together_too():
    """The camera's report of 0.0 s comes at 0.5 s, after the radar's of 0.25 s."""
    sensors = {"eye": sensor("optical.eo"), "radar": sensor("radar.range_boundary", offset_s=0.25)}
    found = rows(fused(sensors, {"eye": 0.5}), "fused", time_s=0.5)
    assert [(row["sensors"], row["measured_s"]) for row in found] == [("radar+eye", 0.0)] * 2


def test_a_row_bears_the_target_of_the_sensor_that_gives_its_angles():
    """A camera that sees only one of two neighbours, and a radar that sees only the other one."""
    near = {**crooked.DIVING, "name": "near"}
    far = {**crooked.DIVING, "name": "far", "north_m": -1960.0, "up_m": -526.0}
    sensors = {
        "eye": sensor("optical.eo", range_km=2.0),
        "radar": sensor("radar.range_boundary", minimum_range_m=2000.0),
    }
    found = rows(fused(sensors, targets=[near, far]), "fused")
    assert [(row["sensors"], row["target"]) for row in found] == [("radar+eye", "near")]


@pytest.mark.parametrize("kind", ["fusion.gated", "fusion.pick_best"])
def test_false_alarms_keep_their_instants_and_poses_on_a_slow_wire(kind):
    noise = {
        "azimuth_resolution_deg": 5.0, "elevation_resolution_deg": 5.0, "range_resolution_m": 500.0,
        "range_km": 4.0, "scan_rate_hz": 5, **noise_crosses("radar.threshold", 1e-3),
    }  # fmt: skip
    turning = {name: value for name, value in crooked.OWNSHIP.items()
               if name not in ("yaw_deg", "pitch_deg", "roll_deg", "climb_mps")}  # fmt: skip
    turning["legs"] = [{"kind": "turn", "rate_deg_s": 3.0}]
    found = fused(
        {"radar": sensor("radar.threshold", **noise)}, {"radar": 0.3}, ownship=turning,
        fusion={"type": kind},
        navigation={"attitude_noise_deg": [1.0, 1.0, 1.0]}, duration_s=2,
    )  # fmt: skip
    seen = {(row["time_s"], row["azimuth_rad"], row["range_m"]): row["own_heading_rad"]
            for row in rows(found, target=None)}  # fmt: skip
    false = rows(found, "fused", target=None)
    assert len(false) > 20
    for row in false:
        assert row["measured_s"] == pytest.approx(row["time_s"] - 0.3)
        told = seen[row["measured_s"], row["azimuth_rad"], row["range_m"]]
        assert row["own_heading_rad"] == told
