"""What came since the scan before, whatever the clock; the same alone and beside other runs."""

import crooked
import numpy as np
import pytest
from same_runs import same_as_alone, same_in_any_window, tables_of
from wired import chain, rows, run

import dsa_des
from components.surveillance.ads_b import AdsB
from components.surveillance.squitter_clock import SquitterClocks
from dsa_des.time.randomness import Streams, target_keys

ADS_B = {"type": "surveillance.ads_b", "scan_rate_hz": 10, "reception": "certain"}
ACTIVE = {"type": "surveillance.active", "scan_rate_hz": 1, "elevation_deg": [-90, 90]}
TARGETS = [{**target, "mode_s": True, "ads_b": {"nacp": 9}} for target in crooked.TARGETS]


def recorded(scene):
    return tables_of(dsa_des.load_scene(scene))[1]


@pytest.mark.parametrize(
    "clock", [{}, {"jitter_s": 0.04}, {"rate_error_ppm": 90_000}, {"rate_error_ppm": -50_000}]
)
def test_every_position_is_reported_once(clock):
    """At ten scans a second each message is the newest at one scan, early or late as that is."""
    duration_s = 40
    scene = chain({"ether": {**ADS_B, **clock}}, targets=TARGETS, duration_s=duration_s)
    scans = recorded(scene)
    last_s = max(scans["scans"]["time_s"].to_pylist())
    clocks = SquitterClocks(Streams(scene["seed"]).stream("[equipage]", "position messages"))
    for target in TARGETS:
        name = target["name"]
        key = target_keys((name,))
        sent = np.concatenate([
            clocks.latest_messages(key, np.zeros(1, int), np.array([until_s * 10**9]), 14)[1][0]
            for until_s in range(1, duration_s + 1)
        ])  # fmt: skip
        sent = np.unique(sent) / 1e9
        rows = [row for row in scans["detections"].to_pylist() if row["target"] == name]
        told = [row["reported_s"] for row in rows]
        assert told == pytest.approx(sent[sent <= last_s].tolist())


class OwnReceiver(AdsB):
    """One that says nothing of replicas: each has an instance of its own."""


SPLIT = {**ADS_B, "type": f"{__name__}:OwnReceiver"}


@pytest.mark.parametrize("sensor", [ADS_B, ACTIVE, SPLIT], ids=["ads_b", "active", "split"])
def test_replicas_together_are_those_alone(sensor):
    """Other seeds, and clocks that differ in all that clocks may differ in."""
    sensor = {**sensor, "reception": "fitted"} if sensor is ADS_B else sensor
    scenes = []
    for seed, clock in enumerate(({}, {"jitter_s": 0.03}, {"offset_s": 0.25}, {})):
        one = chain({"one": {**sensor, **clock}}, targets=TARGETS, duration_s=15)
        one["blocks"]["traffic"]["ownship"] = dict(crooked.OWNSHIP)
        scenes.append(dsa_des.load_scene({**one, "seed": 11 * seed}))
    same_as_alone(scenes)
    for scene in scenes[1:3]:
        assert same_in_any_window(scene, (3,))["detections"].num_rows > 10


def test_latency_hides_nobody_at_the_start():
    """What is sent in the first second is of before the run: the aircraft flew on towards there."""
    sensor = {**ADS_B, "position_errors": "none", "compact": False}
    north = {
        "name": "kea", "north_m": 9000, "east_m": 3000, "up_m": 0, "heading_deg": 0,
        "speed_mps": 100, "ads_b": {"latency_s": 2.0, "compensated_s": 0.5},
    }  # fmt: skip
    ownship = {"lat_deg": -42.0, "lon_deg": 179.99, "alt_m": 1200, "heading_deg": 217,
               "speed_mps": 50, "roll_deg": 25}  # fmt: skip
    scene = chain({"ether": sensor}, ownship=ownship, targets=[north], duration_s=6)
    rows = recorded(scene)["detections"].to_pylist()
    first_s = min(row["reported_s"] for row in rows)
    assert first_s < 0.6
    # Northward at 100 m/s, 150 m behind: the same line in time before 2 s as after.
    degree_m = 6_357_000 * np.pi / 180
    said = np.array([(row["reported_s"], row["reported_lat_deg"]) for row in rows])
    at_start = said[:, 1] - 100.0 * said[:, 0] / degree_m
    assert np.abs(at_start - at_start[-1]).max() * degree_m < 1.5


def test_what_is_sent_behind_the_limb_is_not_received():
    """Thirty climb from the sea 130 km away: at the first scan some have sent nothing in view."""
    toward, range_m = np.radians(217.0), 130_000.0
    craft = {
        "east_m": range_m * np.sin(toward), "north_m": range_m * np.cos(toward),
        "up_m": -(range_m**2) / 2 / 6.37e6 - 900.0, "heading_deg": 37.0, "speed_mps": 90.0,
        "climb_mps": 8.5, "ads_b": {},
    }  # fmt: skip
    block = {"type": "surveillance.ads_b", "reception": "certain"}
    scene = chain(
        {"slow": {**block, "scan_rate_hz": 1}, "fast": {**block, "scan_rate_hz": 50}},
        ownship={"lat_deg": -41.3, "lon_deg": 3.0, "alt_m": 900.0, "heading_deg": 217.0,
                 "speed_mps": 60.0},
        targets=[{**craft, "name": f"t{i}"} for i in range(30)], duration_s=7,
        terrain={"horizon": True},
    )  # fmt: skip
    done = run(scene)
    free = [row["time_s"] for row in rows(done, "scans", block="fast") if not row["skipped_hidden"]]
    heard = rows(done, block="slow")
    first = min(row["time_s"] for row in heard)
    assert 0.1 < first - free[0] < 0.5
    assert min(row["reported_s"] for row in heard) > free[0] - 0.03
    assert 5 < sum(row["time_s"] == first for row in heard) < 28
