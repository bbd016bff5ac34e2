"""Operators among several aircraft: whose alert a decision answers, and what is drawn for whom."""

import math
from itertools import pairwise

import pytest
from test_avoidance_by_bands import ahead
from test_avoidance_by_bands import scene as by_bands
from test_operator import scene as stochastic
from wired import rows, run

from components.guidance.daidalus import changes_out_of_bands


def test_each_decision_answers_the_alert_of_its_own_target(tmp_path):
    """One aircraft never alerts, one does, and a third later at another level."""
    one = by_bands(tmp_path)
    one["duration_s"] = 72
    one["wires"] = one["wires"][:1]  # without a loop, all comes at once
    head_on = one["blocks"]["traffic"]["intruders"][0]
    quiet = {**head_on, "name": "quiet", **ahead(-4000.0, 3000.0), "heading_deg": 217.0,
             "speed_mps": 50.0}  # fmt: skip
    later = {**head_on, "name": "later", **ahead(10_200.0, -25.0)}
    one["blocks"]["traffic"]["intruders"] = [quiet, head_on, later]
    said = [
        (46.1, "verified", "head_on"), (46.1, "verified", "quiet"), (46.1, "looked", "later"),
        (58.3, "looked", "later"), (64.2, "rejected", "later"), (64.7, "looked", ""),
    ]  # fmt: skip
    table = "time_s,decision,target\n" + "".join(f"{t},{d},{name}\n" for t, d, name in said)
    (tmp_path / "table.csv").write_text(table, encoding="utf-8")
    one["blocks"]["avoidance"] = {
        "type": "operator.recorded", "decisions": str(tmp_path / "table.csv"), "scan_rate_hz": 10,
    }  # fmt: skip
    found = run(one)
    alerts = rows(found, "alerts")
    decided = rows(found, "decisions")
    assert [row["target"] or "" for row in decided] == [name for _, _, name in said]
    levels = []
    for row, (time_s, _, name) in zip(decided, said, strict=True):
        mine = [a for a in alerts if a["target"] == name and a["time_s"] <= time_s]
        level = mine[-1]["level"] if mine else 0
        began = None
        if level:
            on = [b["time_s"] for a, b in pairwise(mine) if a["level"] == 0 < b["level"]]
            began = on[-1]
        assert (row["level"], row["alert_s"]) == (level, began)
        levels.append(level)
    assert levels[:4] == [2, 0, 1, 2]


def test_drawn_pilots_pause_as_drawn(tmp_path):
    """An alert that stays: next decisions follow after draws, not after the mean of 15 s or 9 s."""
    keys = {"held_s": 0.0, "initial_delay_s": 0.0, "coordination_s": 0.0, "execution_delay_s": 0.0}
    pauses = set()
    for seed in (1, 2):
        loop = stochastic(tmp_path, seed=seed, deterministic=False, turn_share=0.0,
                          vertical_rate_mps=0.05, **keys)  # fmt: skip
        times = [row["time_s"] for row in rows(run(loop), "manoeuvres")]
        pauses |= {b - a for a, b in pairwise(times)}
    assert len(pauses) > 3 and min(pauses) >= 3.0


@pytest.mark.parametrize(
    ("keys", "turns"),
    [
        ({"turn_share": 0.4}, False),
        ({"turn_share": 0.6}, True),
        ({"turn_share": 0.999, "deterministic": False}, True),
        ({"turn_share": 0.001, "deterministic": False}, False),
    ],
)
def test_the_share_of_turns_is_that_of_turns(tmp_path, keys, turns):
    loop = stochastic(tmp_path, **keys)
    loop["duration_s"] = 75
    told = rows(run(loop), "manoeuvres")[0]
    assert (told["turn_rad"] != 0.0, told["climb_m"] != 0.0) == (turns, not turns)


def test_who_finds_no_way_by_altitude_turns(tmp_path):
    """Between 890 m and 915 m no altitude is clear of what is 30 m above."""
    loop = stochastic(tmp_path, turn_share=0.4)
    loop["duration_s"] = 75
    path = loop["blocks"]["avoidance"]["conf"]
    with open(path, "a", encoding="utf-8") as conf:
        conf.write("min_alt = 890 [m]\nmax_alt = 960 [m]\n")
    told = rows(run(loop), "manoeuvres")[0]
    assert told["turn_rad"] < 0.0 and told["climb_m"] == 0.0
    loop["blocks"]["avoidance"]["turn_share"] = 0.0  # who never turns stays
    assert rows(run(loop), "manoeuvres") == []


def test_an_avoidance_flies_at_the_rates_of_its_configuration(tmp_path):
    rates = "vertical_rate = 1100 [fpm]\nhorizontal_accel = 1.3 [m/s^2]\nvertical_accel = 0.1 [g]\n"
    for manoeuvre, key, rate in (
        ("climb", "climb_rate_mps", 1100 * 0.3048 / 60),
        ("speed", "acceleration_mps2", 1.3),
        ("vertical_speed", "vertical_acceleration_mps2", 0.980665),
    ):
        loop = by_bands(tmp_path, level=1, manoeuvre=manoeuvre)
        loop["duration_s"] = 60
        intruder = loop["blocks"]["traffic"]["intruders"][0]
        if manoeuvre == "speed":  # from the right
            heading = math.radians(127.0)
            place = ahead(5000.0, 0.0)
            place["east_m"] -= 6000.0 * math.sin(heading)
            place["north_m"] -= 6000.0 * math.cos(heading)
            intruder |= {**place, "heading_deg": 127.0}
        with open(loop["blocks"]["avoidance"]["conf"], "a", encoding="utf-8") as conf:
            conf.write(rates)
        assert rows(run(loop), "manoeuvres")[0][key] == pytest.approx(rate)


def test_ways_out_of_many_instants_are_those_of_each(tmp_path, monkeypatch):
    """A climbing ownship has other altitudes at every instant, a turning one other directions."""
    import components.avoidance as daidalus

    kept = []
    monkeypatch.setattr(daidalus, "changes_out_of_bands", lambda *given: kept.append(given) or
                        changes_out_of_bands(*given))  # fmt: skip
    loop = by_bands(tmp_path, level=1)
    loop["wires"] = loop["wires"][:1]
    run(loop)
    _, configuration, alerter, alerts, _ = max(kept, key=lambda given: len(given[3]))
    places = [n for n, level in enumerate(alerts.highest_levels()) if level][:12]
    assert len(places) == 12
    for kind in ("alt", "hdir"):
        each = [changes_out_of_bands(kind, configuration, alerter, alerts, [n])[0] for n in places]
        assert changes_out_of_bands(kind, configuration, alerter, alerts, places) == each
        assert len(set(each)) > 3
