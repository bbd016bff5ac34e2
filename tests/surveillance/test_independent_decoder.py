"""What is sent, as a decoder reads it that shares no line with ours: message by message, exactly.

Formulas: ICAO Doc 9871, C.2.6 (compact positions), Annex 10 IV, 3.1.2.3.3 (parity).
"""

import math
from fractions import Fraction

import numpy as np
import pytest

from components.surveillance.extended_squitter import position_messages, velocity_messages

PLACES = [
    (0.0, 0.0), (0.0, 180.0), (-1e-7, -180.0), (90.0, 12.0), (-90.0, -77.0), (89.9999, 179.9999),
    (87.0, 5.0), (-87.00001, -5.0), (86.999, 179.999999), (-86.6, -179.999999), (-41.3, 173.2),
    (52.25720214, 3.91937256), (-33.9, 18.4), (10.4704713, -120.0), (59.9544, 0.0),
]  # fmt: skip


def field(message, first, count):
    return message >> (112 - first - count) & ((1 << count) - 1)


def remainder(message):
    generator = 0b1111111111111010000001001
    for bit in range(111, 23, -1):
        if message >> bit & 1:
            message ^= generator << (bit - 24)
    return message


def zones_at(lat):
    """The number of zones, by its definition: the largest whose own latitude lies beyond."""
    if abs(lat) > 87.0:
        return 1
    if abs(lat) == 87.0:
        return 2
    if lat == 0.0:
        return 59
    turn = 1.0 - (1.0 - math.cos(math.pi / 30.0)) / math.cos(math.radians(abs(lat))) ** 2
    return math.floor(2.0 * math.pi / math.acos(turn))


def decoded_near(message, lat, lon):
    """Return the place that a single message says, of those the one within half a zone."""
    odd, lat, lon = field(message, 53, 1), Fraction(lat), Fraction(lon)
    y, x = (Fraction(field(message, first, 17), 2**17) for first in (54, 71))
    height = Fraction(360, 60 - odd)
    zone = lat // height + math.floor(Fraction(1, 2) + lat % height / height - y)
    found = height * (zone + y)
    width = Fraction(360, max(zones_at(float(found)) - odd, 1))
    zone = lon // width + math.floor(Fraction(1, 2) + lon % width / width - x)
    return tuple(map(float, (found, width * (zone + x), height, width)))


def decoded_pair(even, odd):
    """Return the place of the even one of two messages, or None where zones change in between."""
    (y0, x0), (y1, x1) = ((field(m, 54, 17), field(m, 71, 17)) for m in (even, odd))
    zone = math.floor((59 * y0 - 60 * y1) / 2**17 + 0.5)
    lat0 = (6.0 * (zone % 60 + y0 / 2**17) + 180.0) % 360.0 - 180.0
    lat1 = (360.0 / 59.0 * (zone % 59 + y1 / 2**17) + 180.0) % 360.0 - 180.0
    many = zones_at(lat0)
    if many != zones_at(lat1):
        return None
    zone = math.floor((x0 * (many - 1) - x1 * many) / 2**17 + 0.5)
    count = max(many, 1)
    return lat0, 360.0 / count * (zone % count + x0 / 2**17)


def places():
    rng = np.random.default_rng(29)
    lat = np.degrees(np.arcsin(rng.uniform(-1.0, 1.0, 80)))
    return PLACES + list(zip(lat.tolist(), rng.uniform(-180.0, 180.0, 80).tolist(), strict=True))


def sent(lat, lon, odd):
    message = bytes(position_messages([0x4840D6], [lat], [lon], [12_345.0], odd, nic=8)[0])
    return int.from_bytes(message, "big")


def apart(one, other):
    return abs((one - other + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("odd", [False, True])
def test_single_messages_say_where_they_were_sent_all_over_the_globe(odd):
    for lat, lon in places():
        message = sent(lat, lon, odd)
        assert remainder(message) == 0
        assert (field(message, 0, 5), field(message, 8, 24)) == (17, 0x4840D6)
        steps = field(message, 40, 7) << 4 | field(message, 48, 4)
        assert field(message, 47, 1) == 1 and 25 * steps - 1000 == 12_350
        found, around, height, width = decoded_near(message, lat, lon)
        assert abs(found - lat) <= height / 2**18 + 1e-12, (lat, lon)
        assert apart(around, lon) <= width / 2**18 + 1e-9, (lat, lon)


def test_pairs_say_it_without_knowing_where():
    known = 0
    for lat, lon in places():
        found = decoded_pair(sent(lat, lon, False), sent(lat, lon, True))
        if found is None:
            continue
        known += 1
        width = 360.0 / max(zones_at(found[0]), 1)
        assert abs(found[0] - lat) <= 6.0 / 2**18 + 1e-9, (lat, lon)
        assert apart(found[1], lon) <= width / 2**18 + 1e-9, (lat, lon)
    assert known > 85


def test_velocities_are_read_as_they_were_sent():
    for north, east, climb in [(-123.4, 456.7, 1234.0), (0.0, -0.6, -64.0), (-1021.4, 3.0, 0.0)]:
        message = int.from_bytes(
            bytes(velocity_messages([0xABCDEF], [north], [east], [climb], nacv=2)[0]), "big"
        )
        assert remainder(message) == 0 and field(message, 32, 5) == 19
        assert (field(message, 37, 3), field(message, 42, 3)) == (1, 2)
        read = [
            (field(message, first, count) - 1) * (-1 if field(message, sign, 1) else 1) * unit
            for sign, first, count, unit in ((56, 57, 10, 1), (45, 46, 10, 1), (68, 69, 9, 64))
        ]
        assert abs(read[0] - north) <= 0.5 and abs(read[1] - east) <= 0.5
        assert abs(read[2] - climb) <= 32.0


def gray_sequence(bits):
    """Gray's code, by reflecting the list of one bit less."""
    found = [""]
    for _ in range(bits):
        found = ["0" + one for one in found] + ["1" + one for one in reversed(found)]
    return found


def test_altitudes_beyond_the_code_of_25_ft_are_in_gillham_s():
    """Rows of 500 ft by reflection, 100 ft to and fro within them: -1,200 to 126,700 ft."""
    within = ["001", "011", "010", "110", "100"]  # C1 C2 C4 of -200 to 200 ft about the row
    known = {}
    for row, code in enumerate(gray_sequence(8)):
        for place, hundreds in enumerate(within if row % 2 == 0 else within[::-1]):
            known[code + hundreds] = 500 * row + 100 * place - 1200
    assert sorted(known.values()) == list(range(-1200, 126_701, 100))
    rng = np.random.default_rng(8)
    sought = [-1200.0, -1100.0, 50_200.0, 60_000.0, 126_700.0]
    sought += rng.uniform(50_188.0, 126_700.0, 200).tolist()
    for feet in sought:
        message = int.from_bytes(
            bytes(position_messages([0xABCDEF], [48.0], [11.0], [feet], [False])[0]), "big"
        )
        assert remainder(message) == 0
        twelve = f"{field(message, 40, 12):012b}"
        c1, a1, c2, a2, c4, a4, b1, q, b2, d2, b4, d4 = twelve
        assert q == "0"
        assert abs(known[d2 + d4 + a1 + a2 + a4 + b1 + b2 + b4 + c1 + c2 + c4] - feet) <= 50.0


def test_fast_aircraft_send_the_supersonic_velocity():
    for north, east, exact in [(1166.3, -3.0, 4), (-640.0, 2200.0, 4), (1021.4, -1021.0, 1)]:
        message = int.from_bytes(
            bytes(velocity_messages([0xABCDEF], [north], [east], [0.0], nacv=2)[0]), "big"
        )
        assert field(message, 37, 3) == (2 if exact == 4 else 1)
        for value, sign, first in ((north, 56, 57), (east, 45, 46)):
            read = exact * (field(message, first, 10) - 1) * (-1 if field(message, sign, 1) else 1)
            assert abs(read - value) <= 0.5 * exact
