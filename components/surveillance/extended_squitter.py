"""Extended squitters: airborne position and velocity as the 112 bits of downlink format 17.

RTCA DO-260B, section 2.2.3 and appendix A; ICAO Annex 10, volume IV, 3.1.2.3.3 for the parity.
Messages are rows of 14 bytes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from components.surveillance.compact_position import encode
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Steps of altitude, of each part of a velocity, and of a vertical rate.
ALTITUDE_STEP_FT, SPEED_STEP_KT, CLIMB_STEP_FT_MIN = 25, 1, 64
#: What is coded in steps of 25 ft; lower and higher ones are in Gillham's code, of 100 ft.
LOWEST_FT, HIGHEST_FT = -1000, 50_175
GILLHAM_STEP_FT, GILLHAM_LOWEST_FT, GILLHAM_HIGHEST_FT = 100, -1200, 126_700
_FASTEST_KT, _STEEPEST = 1022, 510
#: The step of the supersonic velocity, kt, which is sent where a part is 1021.5 kt or more.
_SUPERSONIC = 4

Bytes = npt.NDArray[np.uint8]

_POLYNOMIAL = 0x1FFF409
_BITS, _WITHOUT_PARITY = 112, 88
#: Type code, and the supplement beside it, of each navigation integrity category.
_TYPE_OF_NIC = {
    11: (9, 0), 10: (10, 0), 9: (11, 1), 8: (11, 0), 7: (12, 0), 6: (13, 0), 5: (14, 0),
    4: (15, 0), 3: (16, 1), 2: (16, 0), 1: (17, 0), 0: (18, 0),
}  # fmt: skip
_TYPE_CODES, _SUPPLEMENTS = (
    np.array([_TYPE_OF_NIC[nic][part] for nic in range(12)]) for part in (0, 1)
)
_VELOCITY_TYPE = 19


def parity_bits(messages: Bytes) -> IntArray:
    """Return each message's 24 parity bits, as an integer, from its first 11 bytes.

    0 for the whole of a message whose last three bytes are its parity, see `is_intact`.
    """
    bits = np.unpackbits(np.ascontiguousarray(messages[:, :11]), axis=1).astype(np.int64)
    rest: IntArray = np.zeros(len(messages), dtype=np.int64)
    for bit in bits.T:
        top = (rest >> 23 & 1) ^ bit
        rest = (rest << 1 & 0xFFFFFF) ^ top * (_POLYNOMIAL & 0xFFFFFF)
    return rest


def is_intact(messages: Bytes) -> BoolArray:
    """Return whether each message ends in its parity."""
    return np.asarray(parity_bits(messages) == _field(messages, _WITHOUT_PARITY, 24))


def quantised_altitude_ft(altitude_ft: npt.ArrayLike, step_ft: npt.ArrayLike = 25) -> FloatArray:
    """Return altitudes on the grid that a transponder reports on, 25 or 100 ft.

    NaN where no code has them: "not available", below -1,200 and above 126,700 ft.
    """
    altitude = np.asarray(altitude_ft, np.float64)
    step = altitude_step_ft(altitude, step_ft)
    grid = np.floor(altitude / step + 0.5) * step
    coded = (grid >= GILLHAM_LOWEST_FT) & (grid <= GILLHAM_HIGHEST_FT)
    return np.asarray(np.where(coded, grid, np.nan))


def quantised_difference_ft(difference_ft: FloatArray) -> FloatArray:
    """Return geometric minus pressure altitude, ft, in steps of 25 as velocity messages have it.

    NaN where the code holds no such difference, above 3,137.5 ft either way.
    """
    steps = np.floor(difference_ft / ALTITUDE_STEP_FT + 0.5)
    return np.where(np.abs(steps) <= 125, steps * ALTITUDE_STEP_FT, np.nan)


def altitude_step_ft(altitude_ft: FloatArray, step_ft: npt.ArrayLike) -> FloatArray:
    """Return each altitude's step: `step_ft` where the 25 ft code covers it, else >= 100 ft."""
    half = 0.5 * ALTITUDE_STEP_FT
    fine = (altitude_ft >= LOWEST_FT - half) & (altitude_ft < HIGHEST_FT + half)
    return np.where(fine, step_ft, np.maximum(step_ft, GILLHAM_STEP_FT))


def quantised_velocity_kt(
    north_kt: npt.ArrayLike, east_kt: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return north, east velocity rounded as sent: to 1 kt, or 4 kt if a component is too fast.

    From 1021.5 kt on in either part the supersonic subtype is sent, whose largest part is 4088 kt.
    """
    step = speed_step_kt(north_kt, east_kt)
    north, east = (
        np.asarray(np.copysign(
            np.minimum(np.floor(np.abs(one) / step + 0.5), _FASTEST_KT) * step, one
        ))
        for one in (north_kt, east_kt)
    )  # fmt: skip
    return north, east


def speed_step_kt(north_kt: npt.ArrayLike, east_kt: npt.ArrayLike) -> FloatArray:
    """Return the step of both velocity components, 1 kt, or 4 kt where one is too fast for that."""
    fastest = np.maximum(np.abs(north_kt), np.abs(east_kt))
    return np.where(fastest >= _FASTEST_KT - 0.5, float(_SUPERSONIC), float(SPEED_STEP_KT))


def quantised_climb_ft_min(climb_ft_min: npt.ArrayLike) -> FloatArray:
    """Return climb rates, ft/min, rounded to multiples of 64 as sent, at most ±510 steps."""
    steps = np.minimum(np.floor(np.abs(climb_ft_min) / CLIMB_STEP_FT_MIN + 0.5), _STEEPEST)
    return np.asarray(np.copysign(steps * CLIMB_STEP_FT_MIN, climb_ft_min))


def position_messages(
    address: npt.ArrayLike,
    lat_deg: npt.ArrayLike,
    lon_deg: npt.ArrayLike,
    altitude_ft: npt.ArrayLike,
    odd: npt.ArrayLike,
    nic: npt.ArrayLike = 8,
) -> Bytes:
    """Return airborne position messages with barometric altitude, (n, 14) bytes.

    Parameters
    ----------
    address : (n,) of int
        24-bit ICAO addresses.
    lat_deg, lon_deg : (n,)
        Degrees on WGS 84.
    altitude_ft : (n,)
        Pressure altitude, -1200 to 126700 ft, sent in steps of 25 ft from -1000 to 50175 ft, and of
        100 ft beyond, in Gillham's code.
    odd : (n,) of bool
    nic : (n,) of int
        Navigation integrity category, 0 to 11: the type code says it.

    Raises
    ------
    ValueError
        With the quantity, its value and what is allowed.
    """
    y, x = encode(lat_deg, lon_deg, odd)
    address, feet, category, odd, y, x = np.broadcast_arrays(
        _check_between("address", address, 0, 0xFFFFFF),
        quantised_altitude_ft(
            _check_between("altitude_ft", altitude_ft, GILLHAM_LOWEST_FT, GILLHAM_HIGHEST_FT)
        ),
        _check_between("nic", nic, 0, 11).astype(np.int64), np.asarray(odd, bool), y, x,
    )  # fmt: skip
    steps = ((feet - LOWEST_FT) // ALTITUDE_STEP_FT).astype(np.int64)
    fine = (feet >= LOWEST_FT) & (feet <= HIGHEST_FT)
    altitude = np.where(fine, (steps >> 4) << 5 | 1 << 4 | (steps & 15), _gillham_code_bits(feet))
    return _assemble_squitters(address, [
        (_TYPE_CODES[category], 5), (0, 2), (_SUPPLEMENTS[category], 1), (altitude, 12), (0, 1),
        (odd, 1), (y, 17), (x, 17),
    ])  # fmt: skip


def velocity_messages(
    address: npt.ArrayLike,
    north_kt: npt.ArrayLike,
    east_kt: npt.ArrayLike,
    climb_ft_min: npt.ArrayLike,
    nacv: npt.ArrayLike = 1,
) -> Bytes:
    """Return airborne velocity messages over ground, (n, 14) bytes.

    Of subtype 1, or 2, the supersonic one, where a part is 1021.5 kt or more. `nacv` is the
    navigation accuracy category of velocity, 0 to 4; the vertical rate is barometric.
    """
    level = (
        _check_between("north_kt", north_kt, -1e5, 1e5),
        _check_between("east_kt", east_kt, -1e5, 1e5),
    )
    address, step, north, east, climb, category = np.broadcast_arrays(
        _check_between("address", address, 0, 0xFFFFFF),
        speed_step_kt(*level), *quantised_velocity_kt(*level),
        quantised_climb_ft_min(_check_between("climb_ft_min", climb_ft_min, -1e7, 1e7)),
        _check_between("nacv", nacv, 0, 4),
    )  # fmt: skip
    return _assemble_squitters(address, [
        (_VELOCITY_TYPE, 5), (np.where(step == 1, 1, 2), 3), (0, 1), (0, 1), (category, 3),
        (east < 0, 1), (np.abs(east) / step + 1, 10),
        (north < 0, 1), (np.abs(north) / step + 1, 10),
        (1, 1), (climb < 0, 1), (np.abs(climb) / CLIMB_STEP_FT_MIN + 1, 9), (0, 2), (0, 1), (0, 7),
    ])  # fmt: skip


@dataclass(frozen=True)
class PositionFields:
    """Decoded airborne position message fields, (n,) each: encoded position, altitude, quality."""

    address: IntArray
    nic: IntArray
    altitude_ft: FloatArray
    odd: BoolArray
    y: IntArray
    x: IntArray


def position_fields(messages: Bytes) -> PositionFields:
    """Return the fields of airborne position messages."""
    code, supplement = _field(messages, 32, 5), _field(messages, 39, 1)
    nic = np.full(len(messages), -1)
    for category, both in _TYPE_OF_NIC.items():
        nic[(code == both[0]) & (supplement == both[1])] = category
    bits = _field(messages, 40, 12)
    steps = (bits >> 5) << 4 | (bits & 15)
    fine = steps * float(ALTITUDE_STEP_FT) + LOWEST_FT
    return PositionFields(
        _field(messages, 8, 24), nic, np.where(bits >> 4 & 1, fine, _gillham_altitude_ft(bits)),
        _field(messages, 53, 1) == 1, _field(messages, 54, 17), _field(messages, 71, 17),
    )  # fmt: skip


def north_east_climb_nacv(messages: Bytes) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return north and east in kt, vertical rate in ft/min and NACv of velocity messages."""

    step = np.where(_field(messages, 37, 3) == 2, float(_SUPERSONIC), 1.0)

    def signed(sign: int, first: int, count: int) -> FloatArray:
        size = _field(messages, first, count) - 1.0
        return np.where(_field(messages, sign, 1) == 1, -size, size)

    climb = signed(68, 69, 9) * CLIMB_STEP_FT_MIN
    return step * signed(56, 57, 10), step * signed(45, 46, 10), climb, _field(messages, 42, 3)


#: Bits of the 12 of an altitude, from the left, C1 A1 C2 A2 C4 A4 B1 Q B2 D2 B4 D4: those of the
#: steps of 500 ft, D2 D4 A1 A2 A4 B1 B2 B4, and of 100 ft, C1 C2 C4, in Gray's code.
_OF_500, _OF_100 = (9, 11, 1, 3, 5, 6, 8, 10), (0, 2, 4)


def _gillham_code_bits(altitude_ft: FloatArray) -> IntArray:
    """Return the 12 bits of altitudes on the grid of 100 ft: ICAO Annex 10, volume IV, appendix."""
    whole = np.clip(altitude_ft, GILLHAM_LOWEST_FT, GILLHAM_HIGHEST_FT).astype(np.int64) + 1300
    coarse = (whole - GILLHAM_STEP_FT) // 500
    rest = (whole - 500 * coarse) // GILLHAM_STEP_FT
    # Steps of 100 ft run up and down by turns, and 5 is sent as 7.
    rest = np.where(coarse % 2 == 1, 6 - rest, rest)
    rest = np.where(rest == 5, 7, rest)
    bits = np.zeros_like(whole)
    for number, places in ((coarse, _OF_500), (rest, _OF_100)):
        gray = number ^ number >> 1
        for index, place in enumerate(places):
            bits |= (gray >> len(places) - 1 - index & 1) << 11 - place
    return bits


def _gillham_altitude_ft(bits: IntArray) -> FloatArray:
    """Return the altitudes in ft that 12-bit Gillham codes stand for."""
    coarse, rest = np.zeros_like(bits), np.zeros_like(bits)
    for number, places in ((coarse, _OF_500), (rest, _OF_100)):
        last = np.zeros_like(bits)
        for place in places:
            last = last ^ (bits >> 11 - place & 1)
            number <<= 1
            number |= last
    rest = np.where(rest == 7, 5, rest)
    rest = np.where(coarse % 2 == 1, 6 - rest, rest)
    return np.asarray(500.0 * coarse + GILLHAM_STEP_FT * rest - 1300.0)


def _check_between(name: str, values: npt.ArrayLike, low: float, high: float) -> FloatArray:
    array = np.asarray(values, np.float64)
    good = (array >= low) & (array <= high)
    if not good.all():
        wrong = array[~good].flat[0]
        raise ValueError(f"{name} is {wrong:g}: it must lie in [{low:g}, {high:g}]")
    return array


def _assemble_squitters(address: FloatArray, fields: list[tuple[npt.ArrayLike, int]]) -> Bytes:
    """Return messages of format 17, capability 5 (airborne), with their parity."""
    bits = np.zeros((address.size, _BITS), dtype=np.uint8)
    first = 0
    for values, count in [(17, 5), (5, 3), (address.ravel(), 24), *fields]:
        whole = np.asarray(values).astype(np.int64).reshape(-1)
        bits[:, first : first + count] = whole[:, np.newaxis] >> np.arange(count)[::-1] & 1
        first += count
    messages = np.packbits(bits, axis=1)
    rest = parity_bits(messages)
    for index, shift in ((11, 16), (12, 8), (13, 0)):
        messages[:, index] = rest >> shift & 0xFF
    return messages


def _field(messages: Bytes, first: int, count: int) -> IntArray:
    bits = np.unpackbits(np.ascontiguousarray(messages), axis=1)[:, first : first + count]
    return np.asarray((bits.astype(np.int64) << np.arange(count)[::-1]).sum(axis=1))
