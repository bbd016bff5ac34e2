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
LOWEST_FT, HIGHEST_FT = -1000, 50_175
_FASTEST_KT, _STEEPEST = 1022, 510

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


def parity(messages: Bytes) -> IntArray:
    """Return the 24 bits of parity of messages, (n, 14) or (n, 11) bytes; the last 3 do not count.

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
    return np.asarray(parity(messages) == _field(messages, _WITHOUT_PARITY, 24))


def quantised_altitude_ft(altitude_ft: npt.ArrayLike, step_ft: npt.ArrayLike = 25) -> FloatArray:
    """Return altitudes on the grid that a transponder reports on, 25 or 100 ft."""
    step = np.asarray(step_ft, np.float64)
    return np.asarray(np.floor(np.asarray(altitude_ft, np.float64) / step + 0.5) * step)


def quantised_speed_kt(speed_kt: npt.ArrayLike) -> FloatArray:
    """Return parts of velocities in whole knots, up to 1022, which says 1021.5 or more."""
    size = np.minimum(np.floor(np.abs(speed_kt) + 0.5), _FASTEST_KT)
    return np.asarray(np.copysign(size, speed_kt))


def quantised_climb_ft_min(climb_ft_min: npt.ArrayLike) -> FloatArray:
    """Return vertical rates in whole steps of 64 ft/min, at most 510 of them."""
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
        Pressure altitude, -1000 to 50175 ft, sent in steps of 25 ft.
    odd : (n,) of bool
    nic : (n,) of int
        Navigation integrity category, 0 to 11: the type code says it.

    Raises
    ------
    ValueError
        With the quantity, its value and what is allowed.
    """
    y, x = encode(lat_deg, lon_deg, odd)
    address, steps, category, odd, y, x = np.broadcast_arrays(
        _within("address", address, 0, 0xFFFFFF),
        _within("altitude_ft", altitude_ft, LOWEST_FT, HIGHEST_FT + 12.5),
        _within("nic", nic, 0, 11).astype(np.int64), np.asarray(odd, bool), y, x,
    )  # fmt: skip
    steps = np.floor((steps - LOWEST_FT) / ALTITUDE_STEP_FT + 0.5).astype(np.int64)
    altitude = (steps >> 4) << 5 | 1 << 4 | (steps & 15)
    return _squitters(address, [
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
    """Return airborne velocity messages, subtype 1: over ground, up to 1022 kt each; (n, 14) bytes.

    `nacv` is the navigation accuracy category of velocity, 0 to 4; the vertical rate is barometric.
    """
    address, north, east, climb, category = np.broadcast_arrays(
        _within("address", address, 0, 0xFFFFFF),
        quantised_speed_kt(_within("north_kt", north_kt, -1e5, 1e5)),
        quantised_speed_kt(_within("east_kt", east_kt, -1e5, 1e5)),
        quantised_climb_ft_min(_within("climb_ft_min", climb_ft_min, -1e7, 1e7)),
        _within("nacv", nacv, 0, 4),
    )
    return _squitters(address, [
        (_VELOCITY_TYPE, 5), (1, 3), (0, 1), (0, 1), (category, 3),
        (east < 0, 1), (np.abs(east) + 1, 10), (north < 0, 1), (np.abs(north) + 1, 10),
        (1, 1), (climb < 0, 1), (np.abs(climb) / CLIMB_STEP_FT_MIN + 1, 9), (0, 2), (0, 1), (0, 7),
    ])  # fmt: skip


@dataclass(frozen=True)
class PositionFields:
    """What position messages hold, (n,) each: encoded position, altitude, and categories."""

    address: IntArray
    nic: IntArray
    altitude_ft: FloatArray
    odd: BoolArray
    y: IntArray
    x: IntArray


def position_fields(messages: Bytes) -> PositionFields:
    """Return what airborne position messages hold."""
    code, supplement = _field(messages, 32, 5), _field(messages, 39, 1)
    nic = np.full(len(messages), -1)
    for category, both in _TYPE_OF_NIC.items():
        nic[(code == both[0]) & (supplement == both[1])] = category
    bits = _field(messages, 40, 12)
    steps = (bits >> 5) << 4 | (bits & 15)
    return PositionFields(
        _field(messages, 8, 24), nic, np.asarray(steps * float(ALTITUDE_STEP_FT) + LOWEST_FT),
        _field(messages, 53, 1) == 1, _field(messages, 54, 17), _field(messages, 71, 17),
    )  # fmt: skip


def velocity_fields(messages: Bytes) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return north and east in kt, vertical rate in ft/min and NACv of velocity messages."""

    def signed(sign: int, first: int, count: int) -> FloatArray:
        size = _field(messages, first, count) - 1.0
        return np.where(_field(messages, sign, 1) == 1, -size, size)

    climb = signed(68, 69, 9) * CLIMB_STEP_FT_MIN
    return signed(56, 57, 10), signed(45, 46, 10), climb, _field(messages, 42, 3)


def _within(name: str, values: npt.ArrayLike, low: float, high: float) -> FloatArray:
    array = np.asarray(values, np.float64)
    good = (array >= low) & (array <= high)
    if not good.all():
        wrong = array[~good].flat[0]
        raise ValueError(f"{name} is {wrong:g}: it must lie in [{low:g}, {high:g}]")
    return array


def _squitters(address: FloatArray, fields: list[tuple[npt.ArrayLike, int]]) -> Bytes:
    """Return messages of format 17, capability 5 (airborne), with their parity."""
    bits = np.zeros((address.size, _BITS), dtype=np.uint8)
    first = 0
    for values, count in [(17, 5), (5, 3), (address.ravel(), 24), *fields]:
        whole = np.asarray(values).astype(np.int64).reshape(-1)
        bits[:, first : first + count] = whole[:, np.newaxis] >> np.arange(count)[::-1] & 1
        first += count
    messages = np.packbits(bits, axis=1)
    rest = parity(messages)
    for index, shift in ((11, 16), (12, 8), (13, 0)):
        messages[:, index] = rest >> shift & 0xFF
    return messages


def _field(messages: Bytes, first: int, count: int) -> IntArray:
    bits = np.unpackbits(np.ascontiguousarray(messages), axis=1)[:, first : first + count]
    return np.asarray((bits.astype(np.int64) << np.arange(count)[::-1]).sum(axis=1))
