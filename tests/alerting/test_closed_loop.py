"""The shipped closed loops: seen early the aircraft stay apart, seen late they do not."""

from pathlib import Path

import dsa_des

CONFIGS = Path(__file__).parents[2] / "configs" / "avoidance"
EN_ROUTE_M = 0.66 * 1852


def closest_m(scene: str, *sets: str) -> float:
    """Smallest slant range of the true flights, which would meet at 120 s."""
    found = dsa_des.run(dsa_des.load_scene(CONFIGS / scene, sets=sets, duration_s="130"))
    return float(found.info["summary"]["targets"]["crossing"]["closest_approach"]["range_m"])


def test_the_ownship_turns_out_of_the_way():
    assert closest_m("crossing.toml") > 2 * EN_ROUTE_M


def test_a_pilot_keeps_clear_later():
    found = dsa_des.run(dsa_des.load_scene(CONFIGS / "crossing_pilot.toml", duration_s="130"))
    manoeuvres = found.tables["manoeuvres"].to_pylist()
    assert manoeuvres[0]["time_s"] > 30.0
    closest = found.info["summary"]["targets"]["crossing"]["closest_approach"]["range_m"]
    assert closest > EN_ROUTE_M


def test_seen_too_late_well_clear_is_lost():
    assert closest_m("crossing_seen_late.toml") < 0.5 * EN_ROUTE_M


def test_without_a_turn_they_would_have_met():
    assert closest_m("crossing.toml", "blocks.avoidance.level=9") < 40.0


def test_a_line_through_coarse_bearings_alerts_of_who_passes_by_and_a_filter_does_not():
    """The page says so; by the truth the fighter of first light never has an alert."""
    scene, ekf = CONFIGS.parent / "alerting" / "first_light.toml", "tracker=tracking.ekf"
    first: dict[int, dict] = {}
    for swaps in ((), (ekf, "fusion=fusion.pass_through")):
        found = dsa_des.run(dsa_des.load_scene(scene, swaps=swaps, duration_s="60"))
        rows = found.tables["alerts"].to_pylist()
        first[len(swaps)] = {}
        for row in rows:
            if row["level"] > 1:
                first[len(swaps)].setdefault((row["target"], row["level"]), row["time_s"])
    assert first[0] == {("crossing", 2): 14.0, ("head_on", 2): 18.0, ("head_on", 3): 51.0}
    assert first[2] == {("head_on", 2): 17.0, ("head_on", 3): 47.0}


def test_a_filter_s_estimates_lead_out_of_the_way():
    """Its margins make the alert come before that of the truth, which is certain."""
    found = dsa_des.run(dsa_des.load_scene(CONFIGS / "crossing_tracked.toml"))
    closest = found.info["summary"]["targets"]["crossing"]["closest_approach"]["range_m"]
    assert closest > 2 * EN_ROUTE_M
    first = {
        block: min(
            row["time_s"]
            for row in found.tables["alerts"].to_pylist()
            if row["block"] == block and row["level"] >= 2
        )
        for block in ("alerting", "true_alerting")
    }
    assert first["true_alerting"] - 10.0 < first["alerting"] < first["true_alerting"]


def test_estimates_that_come_too_late():
    assert closest_m("crossing_tracked_late.toml") < 0.2 * EN_ROUTE_M
