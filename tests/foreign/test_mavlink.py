"""An autopilot over MAVLink: what it is told, what comes of what it says, and when it is silent."""

import json
import math
import socket
import sys
import threading
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from covering import covers
from scipy.spatial.transform import Rotation

import dsa_des
from components.foreign import mavlink
from components.foreign.mavlink_messages import AutopilotSays, Flying, Link
from components.foreign.stand_in_autopilot import StandIn, answer_and_list_senders
from components.messages.state_tracks import StateTracks
from dsa_des.errors import BlockFailure, SceneError

common = pytest.importorskip("pymavlink.dialects.v20.common", reason="needs the extra mavlink")

#: Made by this file, run as a program: what was sent at each instant, and what came back.
EXCHANGE = Path(__file__).parent / "exchange.json"
OWN = {"lat_deg": -33.9, "lon_deg": 179.99, "alt_m": 300.0, "heading_deg": 217.0, "speed_mps": 50.0}


def scene(duration_s=30, up_m=20.0, **pilot):
    """An aircraft from the right that is where the ownship is after a minute."""
    nose = math.radians(217.0)
    east = 3000 * math.sin(nose) + 3600 * math.sin(nose + math.pi / 2)
    north = 3000 * math.cos(nose) + 3600 * math.cos(nose + math.pi / 2)
    other = {"name": "cargo 7", "up_m": up_m, "speed_mps": 60.0, "heading_deg": 127.0,
             "east_m": east, "north_m": north}  # fmt: skip
    return {
        "duration_s": duration_s, "seed": 1, "record": {"truth": True},
        "wires": [
            "traffic -> pilot",
            {"from": "pilot.manoeuvres", "to": "traffic", "delay_s": 0.5, "holds": "nothing"},
        ],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": OWN, "intruders": [other]},
            "pilot": {"type": "foreign.mavlink", "scan_rate_hz": 1, "pace": 0, **pilot},
        },
    }  # fmt: skip


class Wired:
    """A link without a network: an autopilot of this process, that answers at once."""

    def __init__(self, autopilot):
        self.autopilot, self.sent, self.waiting = autopilot, [], []

    def __call__(self, address, local_port):
        return self

    def send(self, datagrams):
        self.sent.append(datagrams)
        for datagram in datagrams:
            self.waiting += self.autopilot(datagram)

    def receive(self, wait_s):
        return self.waiting.pop(0) if self.waiting else None


def flown(monkeypatch, autopilot, **keys):
    link = Wired(autopilot)
    monkeypatch.setattr(mavlink, "UdpLink", link)
    return dsa_des.run(scene(**keys)), link


def courses(run):
    own = [row for row in run.truth.to_pylist() if row["target"] is None]
    return {
        row["time_s"]: math.degrees(math.atan2(row["velocity_east_m_s"], row["velocity_north_m_s"]))
        % 360
        for row in own
    }


def test_what_is_sent_says_where_everybody_is(monkeypatch):
    run, link = flown(monkeypatch, lambda datagram: [], duration_s=4, lost_s=60)
    parser = common.MAVLink(None)
    truth = {(row["target"], row["time_s"]): row for row in run.truth.to_pylist()}
    assert len(link.sent) == 3  # at 0 s nobody's velocity is known yet
    for second, datagrams in enumerate(link.sent, start=1):
        beat, other, own = [m for d in datagrams for m in parser.parse_buffer(d)]
        assert beat.get_type() == "HEARTBEAT"
        row = truth["cargo 7", float(second)]
        place = row["lat_deg"], row["lon_deg"]
        assert (other.lat / 1e7, other.lon / 1e7) == pytest.approx(place, abs=5.1e-8)
        assert other.altitude == pytest.approx(1e3 * row["alt_m"], abs=0.51)
        assert other.callsign == "CARGO7" and other.ICAO_address == 1
        assert other.hor_velocity == pytest.approx(6000, abs=2)
        assert other.heading / 100 == pytest.approx(127.0, abs=0.1)
        row = truth[None, float(second)]
        place = row["lat_deg"], row["lon_deg"], row["alt_m"]
        assert (own.lat / 1e7, own.lon / 1e7, own.alt / 1e3) == pytest.approx(place, abs=5e-4)
        assert (own.vx, own.vy, own.vz) == pytest.approx(
            [100 * row[f"velocity_{axis}_m_s"] for axis in ("north", "east", "down")], abs=2
        )
        assert own.time_usec == second * 10**6


def test_a_banked_attitude_goes_out_as_it_is():
    own = Flying(0, "", -33.9, -179.99, -40.0, 10.0, -20.0, 3.0, math.radians(217), 0.2, -0.6)
    (message,) = common.MAVLink(None).parse_buffer(Link().own_state(1.5, own))
    turn = Rotation.from_quat(np.roll(message.attitude_quaternion, -1))
    expected = Rotation.from_euler("ZYX", [math.radians(217), 0.2, -0.6])
    assert (turn * expected.inv()).magnitude() < 1e-6
    assert (message.alt, message.vz) == (-40_000, 300)


@covers("least_turn_deg", "rate_deg_s", of=("foreign.mavlink",))
def test_the_ownship_turns_as_the_autopilot_does(monkeypatch):
    run, _ = flown(monkeypatch, StandIn().reply)
    (turn,) = run.manoeuvres.to_pylist()
    assert math.degrees(turn["turn_rad"]) == pytest.approx(45.0, abs=0.1)
    course = courses(run)
    assert course[0.0] == pytest.approx(217.0, abs=0.01)
    assert course[29.0] == pytest.approx(262.0, abs=0.1)
    begun = turn["time_s"] + 0.5
    later = math.ceil(begun) + 2.0
    assert course[later] == pytest.approx(217.0 + 3.0 * (later - begun), abs=0.1)
    row = run.autopilot.to_pylist()[-1]
    assert row["time_s"] == row["position_s"] == row["attitude_s"] == 29.0
    assert math.degrees(row["heading_rad"]) % 360 == pytest.approx(262.0, abs=0.1)
    slow, _ = flown(monkeypatch, StandIn().reply, rate_deg_s=1)
    assert slow.manoeuvres["rate_rad_s"][0].as_py() == pytest.approx(math.radians(1))
    none, _ = flown(monkeypatch, StandIn().reply, least_turn_deg=50)
    assert none.manoeuvres.num_rows == 0


@pytest.mark.parametrize(("above_m", "turns"), [(-400, 0), (-100, 1)])
def test_who_passes_far_below_is_let_pass(monkeypatch, above_m, turns):
    run, _ = flown(monkeypatch, StandIn().reply, up_m=float(above_m), duration_s=12)
    assert run.manoeuvres.num_rows == turns


def climbing(datagram, wanders=0.0):
    """An autopilot that climbs at 2.5 m/s on the ownship's course, or turns on from it."""
    link, found = common.MAVLink(None, 1, 1), []
    for message in common.MAVLink(None).parse_buffer(datagram) or []:
        if message.get_type() == "HIL_STATE_QUATERNION":
            ms = message.time_usec // 1000
            course = math.atan2(message.vy, message.vx) + math.radians(wanders)
            north, east = round(5000 * math.cos(course)), round(5000 * math.sin(course))
            attitude = link.attitude_encode(ms, 0, 0, course, 0, 0, 0)
            place = link.global_position_int_encode(
                ms, message.lat, message.lon, message.alt, 0, north, east, -250, 0
            )
            found += [bytes(attitude.pack(link)), b"\xfd garbage", bytes(place.pack(link))]
    return found


@covers("least_climb_mps", of=("foreign.mavlink",))
def test_the_ownship_climbs_as_the_autopilot_does(monkeypatch):
    run, _ = flown(monkeypatch, climbing)
    told = [(row["time_s"], row["vertical_speed_mps"]) for row in run.manoeuvres.to_pylist()]
    assert told == [(1.0, pytest.approx(2.5, abs=0.02))]
    own = [row for row in run.truth.to_pylist() if row["target"] is None]
    assert own[-1]["velocity_down_m_s"] == pytest.approx(-2.5, abs=0.05)
    none, _ = flown(monkeypatch, climbing, least_climb_mps=3)
    assert none.manoeuvres.num_rows == 0


@covers("pause_s", of=("foreign.mavlink",))
def test_manoeuvres_have_a_pause_between_them(monkeypatch):
    """Turns of 9 degrees take 3 s; the first instant after the pause is the next."""
    for pause_s, step_s in ((7.5, 11.0), (2.5, 6.0)):
        run, _ = flown(monkeypatch, lambda d: climbing(d, 9.0), pause_s=pause_s)
        assert set(np.diff(run.manoeuvres["time_s"].to_numpy())) == {step_s}


def test_the_recorded_exchange_gives_the_recorded_flight(monkeypatch):
    """What was sent then is sent again to the bit, and what came back makes the same turn."""
    recorded = json.loads(EXCHANGE.read_text())
    back = {one["sent"][-1]: one["received"] for one in recorded}

    def autopilot(datagram):
        return [bytes.fromhex(text) for text in back.get(datagram.hex(), [])]

    run, link = flown(monkeypatch, autopilot)
    assert [[d.hex() for d in sent] for sent in link.sent] == [one["sent"] for one in recorded]
    assert courses(run)[29.0] == pytest.approx(262.0, abs=0.1)


@covers("address", "local_port", "answer_s", of=("foreign.mavlink",))
def test_over_the_loopback_it_is_the_same_flight(monkeypatch):
    near, _ = flown(monkeypatch, StandIn().reply)
    monkeypatch.undo()
    ends = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for one in ends:
        one.bind(("127.0.0.1", 0))
    port, local = (one.getsockname()[1] for one in ends)
    for one in ends:
        one.close()
    senders = set()
    autopilot = threading.Thread(target=lambda: senders.update(answer_and_list_senders(port)))
    autopilot.start()
    try:
        address = f"127.0.0.1:{port}"
        far = dsa_des.run(scene(address=address, local_port=local, answer_s=60, lost_s=600))
    finally:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
            end.sendto(b"", ("127.0.0.1", port))
        autopilot.join(300.0)
    assert not autopilot.is_alive() and ("127.0.0.1", local) in senders
    for table in ("truth", "autopilot", "manoeuvres"):
        assert far[table].to_pylist() == near[table].to_pylist()


@pytest.mark.parametrize("away_m", [900.0, 200_000.0])
def test_tracks_are_carried_on_to_the_instant(away_m):
    """Their velocities are along the axes of where they are, not of their frame's origin."""
    count = 3
    zero, whole = np.zeros(count), np.zeros(count, dtype=np.int64)
    message = StateTracks(
        tick=np.array([0]), offsets=np.array([0, count]), track=np.array([4, 5, 6]),
        track_status=np.array([1, 0, 2]), existence=zero, azimuth_rad=zero, elevation_rad=zero,
        azimuth_variance_rad2=zero, elevation_variance_rad2=zero,
        has_range=np.array([True, True, False]), age_s=zero, state_s=zero + 7.0, updated_s=zero,
        contributors=whole, updated_by=whole, own_north_m=zero, own_east_m=zero, own_down_m=zero,
        covariance={}, extras={}, sensors=(), north_m=zero + 900, east_m=zero - away_m,
        down_m=zero - 30, north_m_s=zero - 50, east_m_s=zero + 20, down_m_s=zero + 2,
        origin_lat_deg=zero - 33.9, origin_lon_deg=zero - 179.999, origin_alt_m=zero + 100,
    )  # fmt: skip
    assert (
        mavlink._extrapolated_ranged_tracks(message, np.array([0]), 30.5) == []
    )  # of half a minute ago
    (track,) = mavlink._extrapolated_ranged_tracks(message, np.array([0]), 9.5)
    assert track.age_s == 9.5
    origin = -33.9, -179.999, 100
    where = pymap3d.ned2geodetic(900 - 125, 50 - away_m, -30 + 5, *origin)
    later = pymap3d.ned2geodetic(900 - 175, 70 - away_m, -30 + 7, *origin)
    moves = track.north_mps, track.east_mps, track.down_mps
    assert moves == pytest.approx(pymap3d.geodetic2ned(*later, *where), abs=1e-3)
    assert (track.number, track.name) == (4, "T4")
    assert (track.lat_deg, track.alt_m) == pytest.approx((where[0], where[2]), abs=1e-5)
    assert (track.lon_deg - where[1] + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-9)


@covers("lost_s", of=("foreign.mavlink",))
def test_an_autopilot_that_says_nothing_is_an_error(monkeypatch):
    now = iter(np.arange(0.0, 1000.0, 0.5))
    monkeypatch.setattr(mavlink.time, "monotonic", lambda: next(now))
    with pytest.raises(BlockFailure, match=r"127\.0\.0\.1:14550 has said neither ATTITUDE nor"):
        flown(monkeypatch, lambda datagram: [b"noise"], lost_s=4)


@covers("pace", of=("foreign.mavlink",))
def test_it_waits_for_the_clock_on_the_wall(monkeypatch):
    waited = []
    monkeypatch.setattr(mavlink, "Pacer", lambda factor: lambda s: waited.append((factor, s)))
    flown(monkeypatch, climbing, duration_s=3, pace=2)
    assert waited == [(2.0, 0.0), (2.0, 1.0), (2.0, 2.0)]


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", "jitter_s", of=("foreign.mavlink",))
def test_it_has_a_clock_of_its_own(monkeypatch):
    def times(**clock):
        run, _ = flown(monkeypatch, climbing, duration_s=3, **clock)
        return run.autopilot["time_s"].to_pylist()

    assert times(scan_rate_hz=2, offset_s=0.25) == [0.75, 1.25, 1.75, 2.25, 2.75]
    assert times(rate_error_ppm=-500_000) == [2.0]
    assert any(t % 1 for t in times(jitter_s=0.01))


@pytest.mark.parametrize("address", ["14550", "host:", "host:0", "host:70000", ":1"])
def test_an_address_has_a_host_and_a_port(address):
    with pytest.raises(SceneError, match=r"address.*must be HOST:PORT"):
        dsa_des.run(scene(address=address))


def test_with_a_tracker_the_autopilot_is_told_of_its_tracks_and_of_nothing_else(monkeypatch):
    """Confirmed tracks, where they are carried on to from when they were last updated."""
    link = Wired(lambda datagram: [])
    monkeypatch.setattr(mavlink, "UdpLink", link)
    found = scene(duration_s=12, lost_s=60)
    radar = {
        "type": "radar.range_boundary", "range_km": 5.0, "scan_rate_hz": 0.7, "latency_s": 0.2,
        "azimuth_resolution_deg": 0.5, "elevation_resolution_deg": 1.0, "range_resolution_m": 20.0,
    }  # fmt: skip
    found["blocks"] |= {
        "transform": {"type": "geometry.ellipsoid"}, "radar": radar,
        "fusion": {"type": "fusion.pass_through"}, "tracker": {"type": "tracking.ekf"},
    }  # fmt: skip
    found["wires"] += [
        "traffic -> transform -> radar", "fusion -> tracker -> pilot",
        {"from": "radar", "to": "fusion", "holds": "nothing"},
    ]  # fmt: skip
    run = dsa_des.run(found)
    parser = common.MAVLink(None)
    rows = run.state_tracks.to_pylist()
    told = 0
    for second, datagrams in enumerate(link.sent, start=1):
        messages = [m for d in datagrams for m in parser.parse_buffer(d)]
        vehicles = [m for m in messages if m.get_type() == "ADSB_VEHICLE"]
        before = [row for row in rows if row["time_s"] <= second]
        known = [row for row in before if row["time_s"] == before[-1]["time_s"]
                 and row["track_status"] in ("confirmed", "coasted")]  # fmt: skip
        assert [v.callsign for v in vehicles] == [f"T{row['track']}" for row in known]
        for vehicle, row in zip(vehicles, known, strict=True):
            ahead_s = second - row["state_s"]
            assert ahead_s > 0.19
            ned = [row[f"{axis}_m"] + ahead_s * row[f"{axis}_m_s"]
                   for axis in ("north", "east", "down")]  # fmt: skip
            origin = (row[f"origin_{name}"] for name in ("lat_deg", "lon_deg", "alt_m"))
            lat, lon, alt = pymap3d.ned2geodetic(*ned, *origin)
            assert (vehicle.lat / 1e7, vehicle.lon / 1e7) == pytest.approx((lat, lon), abs=1e-7)
            assert vehicle.altitude / 1e3 == pytest.approx(alt, abs=0.01)
            told += 1
    assert told > 5


def test_a_missing_pymavlink_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20.common", None)
    with pytest.raises(Exception, match=r"needs an extra: pip install 'dsa-des\[mavlink\]'"):
        dsa_des.run(scene())


def test_any_bytes_are_taken():
    random, link, before = np.random.default_rng(2), Link(), AutopilotSays()
    for size in range(200):
        assert link.update(random.bytes(size), before) is before


if __name__ == "__main__":  # record the exchange again
    recorded: list[dict] = []

    class Recorder(Wired):
        def send(self, datagrams):
            super().send(datagrams)
            recorded.append({"sent": [d.hex() for d in datagrams],
                             "received": [d.hex() for d in self.waiting]})  # fmt: skip

    mavlink.UdpLink = Recorder(StandIn().reply)  # type: ignore[misc,assignment]
    dsa_des.run(scene())
    EXCHANGE.write_text(json.dumps(recorded, indent=0) + "\n")
