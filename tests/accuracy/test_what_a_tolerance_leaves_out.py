"""What an effect is said to change at most is more than it changes, and not much more."""

import math

import pytest

import dsa_des
from dsa_des.library.scenes import load_scene
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 1000.0, "heading_deg": 0.0}
RANGE_M = 7900.0


def scene(**sections) -> dict:
    """Steady targets of many sizes just within the reach, over the whole rise of Pd."""
    targets = [
        {"name": f"t{number}", "east_m": 20.0 * number, "north_m": RANGE_M, "up_m": 5.0,
         "rcs_dbsm": -15.0 + number, "swerling": 0} for number in range(24)
    ]  # fmt: skip
    radar = {
        "type": "radar.swerling", "scan_rate_hz": 40, "power_w": 100.0, "antenna_gain_db": 30.0,
        "frequency_hz": 10e9, "bandwidth_hz": 2e6, "false_alarm_probability": 1e-4, "range_km": 8,
    }  # fmt: skip
    return {
        "duration_s": 2, "seed": 1, "wires": ["traffic -> transform -> gate -> radar"],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": OWN, "intruders": targets},
            "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"}, "radar": radar,
        },
        **sections,
    }  # fmt: skip


def probabilities(given: dict) -> dict[str, float]:
    found = dsa_des.run({**given, "record": {"looks": True}})["looks"].to_pylist()
    return {row["target"]: row["detection_probability"] for row in found}


@pytest.mark.parametrize(
    "weather", [{"rain_rate_mm_h": 2.0}, {"fog_water_g_m3": 0.2, "fog_top_m": 5e3}]
)
def test_a_bound_holds_and_is_of_the_size_of_the_influence(weather):
    rainy = scene(weather={**weather, "rain_top_m": 9000.0})
    simulation = Simulation(load_scene(rainy))
    bounds = [item.verdict.bound for item in simulation.plan if item.effect.name in ("rain", "fog")]
    (bound,) = (found["detection_probability"] for found in bounds if found)
    clear, dimmed = probabilities(scene()), probabilities(rainy)
    change = max(abs(clear[name] - dimmed[name]) for name in clear.keys() & dimmed)
    assert 0.005 < change <= bound < 4.0 * change
    # What is left out is taken off what the scene allows.
    for allowed, left_out in ((0.9 * bound, False), (1.1 * bound + 1e-5, True)):
        tolerant = scene(weather={**weather, "rain_top_m": 9000.0},
                         accuracy={"detection_probability": allowed})  # fmt: skip
        built = Simulation(load_scene(tolerant))
        plan = {item.effect.name: item for item in built.plan if item.block == "radar"}
        name = "rain" if "rain_rate_mm_h" in weather else "fog"
        assert plan[name].built is not left_out
        left = built.components["radar"].context.tolerance["detection_probability"]
        spent = sum(
            item.verdict.bound["detection_probability"]
            for item in plan.values() if item.verdict.simulated and not item.built
        )  # fmt: skip
        assert left == pytest.approx(allowed - spent)
        assert math.isclose(spent, bound, rel_tol=0.01) is left_out


@pytest.mark.parametrize(
    ("pulses", "swerling", "built"),
    [(1, 1, True), (1, 2, True), (1, 3, False), (5, 1, False), (5, 2, False)],
)
def test_only_one_pulse_of_swerling_one_or_two_is_closed(pulses, swerling, built):
    given = scene(accuracy={"detection_probability": 1e-3})
    given["blocks"]["radar"] |= {"pulses": pulses, "swerling": swerling}
    plan = {item.effect.name: item for item in Simulation(load_scene(given)).plan}
    assert plan["exact Pd"].built is built
