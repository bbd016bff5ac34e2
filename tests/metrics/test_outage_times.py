"""Shares of time that sensors are out, and alerts that are missed meanwhile, by hand."""

import math
from typing import Any

import numpy as np
import pytest
from test_alert_time_metric import BEHIND_M, CONF, behind
from wired import chain

import dsa_des
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.outage_times import outage_times_of_seeds
from dsa_des.running.simulation import Simulation
from dsa_des.stretches.outage import Outage

#: What sees the intruder 100 m away: well clear is lost long before.
NEAR_RADAR = {
    "type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 0.1, "range_cell_m": 76.2,
    "azimuth_beamwidth_deg": 5.8, "elevation_beamwidth_deg": 5.8,
}  # fmt: skip


def watched(conf: Any, **tables: Any) -> dict[str, Any]:
    """Return a radar, tracks, and alerts of these and of the truth; well clear is lost at 30 s."""
    scene = chain(
        {"radar": NEAR_RADAR, "aside": NEAR_RADAR}, targets=[behind("near", BEHIND_M, 60.0)],
        duration_s=40, tracker={"type": "tracking.stub"}, fusion={"type": "fusion.pick_best"},
        **tables,
    )  # fmt: skip
    alarm = {"type": "alerting.daidalus", "scan_rate_hz": 4, "conf": str(conf), "fit_s": 8}
    scene["blocks"] |= {"alarm": alarm, "true_alarm": {**alarm}}
    del scene["blocks"]["true_alarm"]["fit_s"]
    scene["wires"].remove("aside -> fusion")
    scene["wires"] += ["traffic -> alarm", "tracker -> alarm", "traffic -> true_alarm"]
    return scene


@pytest.fixture
def conf(tmp_path):
    path = tmp_path / "one.conf"
    path.write_text(CONF, encoding="utf-8")
    return path


ALERTS = {
    "metric": "alert_times", "horizontal_m": 500, "vertical_m": 150, "nmac_horizontal_m": 300,
    "nmac_vertical_m": 150, "late_s": 15,
}  # fmt: skip


def off(block: str, from_s: float, to_s: float) -> dict[str, Any]:
    return {"from_s": from_s, "to_s": to_s, "set": {f"blocks.{block}.enabled": False}}


def found(scene: dict[str, Any], *metrics: Any, **keys: Any) -> dict[str, Any]:
    result = dsa_des.study(scene, metrics=list(metrics), workers=1, **{"replicas": 1, **keys})
    return {row["result"]: row["value"] for row in result.summary.to_pylist()}


@pytest.mark.parametrize(
    ("block", "from_s", "to_s", "counts"),
    [
        ("radar", 0, 14, False),  # long before it was due, from 15 s to 30 s
        ("radar", 16, 18, True),
        ("radar", 29, 35, True),
        ("radar", 31, 40, False),
        ("aside", 16, 18, None),  # no alert is made of it
    ],
)
def test_alerts_that_are_missed_while_something_behind_them_is_out(
    conf, block, from_s, to_s, counts
):
    got = found(watched(conf, changes=[off(block, from_s, to_s)]), ALERTS)
    assert (got["alert_missed.alarm"], got["alert_missed.true_alarm"]) == (1, 0)
    assert "alert_missed_while_out.true_alarm" not in got  # it hears of nothing that fails
    assert got.get("alert_missed_while_out.alarm") == counts


def test_a_change_switches_a_sensor_off_for_its_share_of_the_run(conf):
    changes = [off("radar", 3, 17), off("radar", 30, 36)]
    got = found(watched(conf, changes=changes), "detection_share")
    assert got["out_share.radar"] == pytest.approx(20 / 40, abs=1e-9)
    assert "out_share.aside" not in got


@pytest.mark.parametrize(("between_s", "repair_s", "lasts_s"), [(60, 20, 90), (20, 60, 40)])
def test_the_share_out_is_that_of_a_renewal_process(conf, between_s, repair_s, lasts_s):
    """Up at 0 s, it is out at t with a chance of (1 - exp(-(λ + μ) t)) λ / (λ + μ)."""
    failing = {"blocks": ["radar"], "mean_between_s": between_s, "mean_repair_s": repair_s}
    scene = dsa_des.load_scene(watched(conf, outages=[failing]))
    spans = outage_times_of_seeds(scene, range(1500), np.full(1500, float(lasts_s)))["radar"]
    shares = np.array([(s[:, 1] - s[:, 0]).sum() for s in spans]) / lasts_s
    fails, mends = 1 / between_s, 1 / repair_s
    rate = fails + mends
    expected = fails / rate * (1 - (1 - math.exp(-rate * lasts_s)) / (rate * lasts_s))
    assert shares.mean() == pytest.approx(expected, abs=4 * shares.std() / math.sqrt(1500))
    assert all((s[1:, 0] > s[:-1, 1]).all() and (s[:, 1] > s[:, 0]).all() for s in spans)


def test_each_run_is_out_when_its_simulation_is_whatever_runs_beside_it(conf):
    failing = [
        {"blocks": ["radar", "tracker"], "mean_between_s": 9, "mean_repair_s": 5, "name": "bus"},
        {"blocks": ["radar"], "mean_between_s": 7, "mean_repair_s": 3, "restart_s": 1},
        {"blocks": ["fusion"], "mean_between_s": 5, "mean_repair_s": 5},
    ]
    scene = dsa_des.load_scene(watched(conf, outages=failing, changes=[off("radar", 3, 9)]))
    assert scene.outages == [Outage(**one) for one in failing]
    seeds = [5, 6, 7]
    together = outage_times_of_seeds(scene, seeds, np.full(3, 40.0))["radar"]
    for seed, spans in zip(seeds, together, strict=True):
        one = replica_scene(scene, Replica(seed))
        (alone,) = outage_times_of_seeds(one, [seed], np.array([40.0]))["radar"]
        assert np.array_equal(alone, spans)
        simulation = Simulation(one)
        simulation.run()
        ticks = np.arange(0, simulation.runs.run_ticks, simulation.ticks_per_s // 100)
        up = simulation.timeline.outages("radar").is_up(RunTicks.of_run(0, ticks))
        time_s = ticks / simulation.ticks_per_s
        up &= (time_s < 3) | (time_s >= 9)
        inside = ((time_s[:, None] >= spans[:, 0]) & (time_s[:, None] < spans[:, 1])).any(axis=1)
        assert np.count_nonzero(inside == up) == 0
        assert (spans[1:, 0] > spans[:-1, 1]).all()  # spans that touch are one


def test_a_run_that_is_switched_off_by_its_own_draw_is_out_until_it_is_switched_on(conf):
    on = {"at_s": 10, "set": {"blocks.radar.enabled": True}}
    scene = watched(conf, changes=[on])
    drawn = {"blocks.radar.enabled": {"choice": [True, False]}}
    shares = dsa_des.study(
        scene, metrics=["detection_share"], replicas=8, workers=1, draws=drawn
    ).runs.to_pandas()
    is_off = ~shares["draw.radar.enabled"].astype(bool)
    assert 0 < is_off.sum() < 8
    assert np.allclose(shares["out_share.radar"], np.where(is_off, 0.25, 0.0))
