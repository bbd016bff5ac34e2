"""Positions and velocities of airborne aircraft in extended squitters.

Worked examples: J. Sun, The 1090 Megahertz Riddle, 2nd ed., 2021, chapters 5 and 6; latitudes at
which zones change: RTCA DO-260B, table A-21.
"""

import numpy as np
import pytest

from components.surveillance.compact_position import (
    decode_near,
    decode_newer_of_pair,
    encode,
    number_of_longitude_zones,
)
from components.surveillance.extended_squitter import (
    is_intact,
    north_east_climb_nacv,
    position_fields,
    position_messages,
    velocity_messages,
)

EVEN, ODD = "8D40621D58C382D690C8AC2863A7", "8D40621D58C386435CC412692AD6"
VELOCITY = "8D485020994409940838175B284F"
#: Zones on the equator's side of each latitude.
CHANGES = {59: 10.47047130, 58: 14.82817437, 57: 18.18626357, 3: 86.53536998, 2: 87.0}


def bytes_of(*texts):
    return np.stack([np.frombuffer(bytes.fromhex(text), dtype=np.uint8) for text in texts])


def test_the_worked_example_of_a_position():
    both = bytes_of(EVEN, ODD)
    assert is_intact(both).all()
    found = position_fields(both)
    assert found.altitude_ft.tolist() == [38000.0, 38000.0] and found.odd.tolist() == [False, True]
    assert found.y.tolist() == [93000, 74158] and found.x.tolist() == [51372, 50194]
    y, x = found.y[:, np.newaxis], found.x[:, np.newaxis]
    lat, lon = decode_newer_of_pair((y[0], x[0]), (y[1], x[1]), False)
    assert lat[0] == pytest.approx(52.2572021484375, abs=1e-12)
    assert lon[0] == pytest.approx(3.91937255859375, abs=1e-12)
    near = decode_near(y[0], x[0], np.array([False]), 52.258, 3.918)
    assert np.concatenate(near) == pytest.approx([lat[0], lon[0]], abs=1e-12)
    again = position_messages([0x40621D], lat, lon, 38000.0, False, nic=8)
    assert bytes(again[0]).hex().upper() == EVEN


def test_the_worked_example_of_a_velocity():
    north, east, climb, nacv = north_east_climb_nacv(bytes_of(VELOCITY))
    assert np.hypot(north[0], east[0]) == pytest.approx(159.20, abs=0.005)
    assert np.degrees(np.arctan2(east[0], north[0])) % 360 == pytest.approx(182.88, abs=0.005)
    assert (climb[0], nacv[0]) == (-832.0, 0)


@pytest.mark.parametrize("bit", [0, 40, 87, 111])
def test_a_message_with_a_wrong_bit_is_not_intact(bit):
    message = bytes_of(EVEN)
    message[0, bit // 8] ^= 128 >> bit % 8
    assert not is_intact(message)[0]


def test_zones_change_at_the_latitudes_of_the_standard():
    for zones, lat in CHANGES.items():
        sides = number_of_longitude_zones(
            np.array([lat - 1e-7, lat + 1e-7, -lat + 1e-7, -lat - 1e-7])
        )
        assert sides.tolist() == [zones, zones - 1] * 2
    assert number_of_longitude_zones([0.0, 90.0, -90.0]).tolist() == [59, 1, 1]


def places():
    rng = np.random.default_rng(3)
    lat = np.degrees(np.arcsin(rng.uniform(-1, 1, 2000)))
    hard = [90.0, -90.0, 89.99999, -89.99999, 0.0, -1e-9, 87.0, -87.0, 86.5353, 10.4704, -10.4705]
    lat = np.concatenate([lat, np.repeat(hard, 4)])
    lon = np.concatenate([rng.uniform(-180, 180, 2000), np.tile([180, -180, 179.99999, 0], 11)])
    return lat, lon


@pytest.mark.parametrize("odd", [False, True])
def test_messages_decode_to_the_place_within_half_a_part(odd):
    lat, lon = places()
    altitude = np.linspace(-1000.0, 50175.0, len(lat))
    address = np.arange(len(lat)) * 8191 % 2**24
    nic = np.arange(len(lat)) % 12
    sent = position_messages(address, lat, lon, altitude, odd, nic)
    assert is_intact(sent).all()
    found = position_fields(sent)
    assert np.array_equal(found.address, address) and np.array_equal(found.nic, nic)
    assert np.abs(found.altitude_ft - altitude).max() <= 12.5
    there = decode_near(found.y, found.x, found.odd, lat + 1.0 * (np.abs(lat) < 85), lon)
    assert np.abs(there[0] - lat).max() <= 360 / (60 - odd) / 2**18 * 1.0001
    away = np.abs(np.mod(there[1] - lon + 180.0, 360.0) - 180.0)
    zones = np.maximum(number_of_longitude_zones(there[0]) - odd, 1)
    assert (away <= 360.0 / zones / 2**18 * 1.0001).all()


def test_pairs_decode_anywhere_or_say_that_they_do_not():
    lat, lon = places()
    even, odd = encode(lat, lon, False), encode(lat, lon, True)
    for newer in (False, True):
        found = decode_newer_of_pair(even, odd, newer)
        known = np.isfinite(found[0])
        assert known[:2000].mean() > 0.99
        assert np.abs(found[0] - lat)[known].max() < 3e-5
        east_m = np.mod(found[1] - lon + 180.0, 360.0) - 180.0
        assert np.abs(east_m * np.cos(np.radians(lat)))[known].max() < 1e-4


def test_velocities_decode_to_whole_knots():
    rng = np.random.default_rng(4)
    north, east = rng.uniform(-1021, 1021, (2, 500))
    climb = rng.uniform(-32000, 32000, 500)
    found = north_east_climb_nacv(velocity_messages(1, north, east, climb, 3))
    assert np.abs(found[0] - north).max() <= 0.5 and np.abs(found[1] - east).max() <= 0.5
    assert np.abs(found[2] - climb).max() <= 32.0 and set(found[3].tolist()) == {3}


def test_what_no_message_can_hold_is_refused():
    with pytest.raises(
        ValueError, match=r"altitude_ft is 130000: it must lie in \[-1200, 126700\]"
    ):
        position_messages(1, 0.0, 0.0, 130000.0, False)
    with pytest.raises(ValueError, match="lat_deg is 91: it must lie in"):
        encode([91.0], [0.0], False)
    with pytest.raises(ValueError, match="nic is 12: it must lie in"):
        position_messages(1, 0.0, 0.0, 0.0, False, nic=12)
