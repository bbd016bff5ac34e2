"""What aircraft know and say of themselves: position, velocity and altitude with their errors.

The errors belong to the aircraft: all that receive it have the same, and so have its replies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from components.aircraft.equipage import Equipage
from components.arguments.units import FOOT_M, FOOT_PER_MINUTE_M_S, KNOT_M_S
from components.geometry import NEAR_A_POLE_DEG, north_east_parts, rotate_to_meridian
from components.navigation.errors import displaced_lat_lon_alt
from components.sensor.look import Cells
from components.surveillance.altimetry import altimetry_error_ft, laplace_draws_from_uniform
from components.surveillance.compact_position import decode_near, encode
from components.surveillance.extended_squitter import (
    quantised_altitude_ft,
    quantised_climb_ft_min,
    quantised_difference_ft,
    quantised_velocity_kt,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.time.gauss_markov import GaussMarkov
from dsa_des.time.randomness import Streams

#: Correlation time of horizontal position and velocity errors, s (RTCA DO-365, appendix Q).
CORRELATION_TIME_S = 300.0
#: Scale of the Laplace distribution of vertical rates, new with each message (the same source).
CLIMB_SCALE_M_S = 2.02 * FOOT_M
#: Draws are those of aircraft, not of the block that looks.
_OWNER = "[equipage]"


@dataclass(frozen=True)
class Transponders:
    """Transponders of some aircraft, (n,): random number key, run, and row in equipage."""

    keys: npt.NDArray[np.uint64]
    run: IntArray
    craft: IntArray

    @classmethod
    def from_cells(
        cls, cells: Cells, which: IntArray, instant_ns: IntArray | None = None
    ) -> Transponders:
        """Return the targets' transponders, equipped as at `instant_ns`, by default at the look."""
        keys = cells.roster.draw_keys_of(cells.target[which])
        craft = cells.equipage_rows[which]
        if instant_ns is not None:
            craft = cells.roster.equipage_rows(cells.craft[which], instant_ns)
        return cls(keys, cells.run[which], craft)


class Altimeters:
    """Draws the altimeter errors of all aircraft, one per aircraft and run."""

    def __init__(self, streams: Streams) -> None:
        self._stream = streams.stream(_OWNER, "altimetry")

    def reported_altitude_ft(
        self,
        transponders: Transponders,
        altitude_m: FloatArray,
        step_ft: npt.ArrayLike,
        errs: bool = True,
    ) -> FloatArray:
        """Return reported altitudes, ft, with altimeter error, rounded to `step_ft` (not if 0).

        NaN where no code has them.
        """
        altitude = altitude_m / FOOT_M
        if errs:
            stream = self._stream.of_runs(transponders.run)
            first = np.zeros(len(transponders.run), dtype=np.int64)
            laplace, kind = (stream.uniform(transponders.keys, first, draw) for draw in (0, 1))
            altitude = altitude + altimetry_error_ft(
                altitude, laplace_draws_from_uniform(laplace), kind
            )
        step = np.broadcast_to(np.asarray(step_ft, np.float64), altitude.shape)
        rounded = quantised_altitude_ft(altitude, np.where(step > 0.0, step, 1.0))
        return np.where(step > 0.0, rounded, altitude)


@dataclass(frozen=True)
class Sent:
    """True position and velocity of the sender at the instant for which each message holds.

    The altitude is what altimeters read there.
    """

    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    height_m: FloatArray
    north_east_up_m_s: FloatArray
    message: IntArray
    instant_ns: IntArray


class Broadcasts:
    """Simulates what aircraft broadcast: their true states with errors and rounding.

    Errors are ``none``, ``white`` (new with every message) or ``gauss_markov``: those of position
    and velocity then last `CORRELATION_TIME_S`.
    """

    def __init__(self, streams: Streams, errors: str, quantised: bool) -> None:
        self._errors, self._quantised = errors, quantised
        self._altimeters = Altimeters(streams)
        names = "position", "velocity", "height"
        self._streams = {name: streams.stream(_OWNER, name) for name in names}
        self._climbs = streams.stream(_OWNER, "climb")
        self._lasting = {
            name: GaussMarkov(stream, CORRELATION_TIME_S) for name, stream in self._streams.items()
        }

    def horizontal_errors(
        self,
        name: str,
        deviation: FloatArray,
        transponders: Transponders,
        message: IntArray,
        instant_ns: IntArray,
        lat_deg: npt.ArrayLike = 0.0,
        lon_deg: npt.ArrayLike = 0.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the north and east errors (n,) of broadcasts (m or m/s), scaled by `deviation`.

        They last along three axes that are fixed to the Earth: near a pole, where north turns
        about, the error does not.
        """
        keys, run = transponders.keys, transponders.run
        if self._errors == "none":
            return np.zeros(len(deviation)), np.zeros(len(deviation))
        if self._errors == "white":
            stream = self._streams[name].of_runs(run, instant_ns)
            draws = [stream.normal(keys, message, axis + 60_000) for axis in range(3)]
        else:
            # What is sent before the run begins is of instants before 0.
            draws = [self._lasting[name](keys, instant_ns, axis, run) for axis in range(3)]
        axis, sideways, outward = draws
        north, east = north_east_parts(axis, sideways, outward, lat_deg, lon_deg)
        return deviation * north, deviation * east

    def _climb_errors(self, transponders: Transponders, message: IntArray) -> FloatArray:
        """Return each message's error of vertical rate, m/s, drawn from a Laplace distribution."""
        if self._errors == "none":
            return np.zeros(len(message))
        uniform = self._climbs.of_runs(transponders.run).uniform(transponders.keys, message)
        return CLIMB_SCALE_M_S * laplace_draws_from_uniform(uniform)

    def broadcast_height_difference_m(
        self, equipage: Equipage, transponders: Transponders, sent: Sent
    ) -> FloatArray:
        """Return the broadcast difference geometric height minus pressure altitude, m.

        NaN of who sends no geometric height, and where the code does not reach.
        """
        messages = transponders, sent.message, sent.instant_ns
        deviation = equipage.height_deviation_m[transponders.craft]
        if np.isnan(deviation).all():
            return deviation
        # Along one of the axes that errors last in; at the equator it is north.
        error, _ = self.horizontal_errors("height", deviation, *messages)
        error = np.where(np.isnan(deviation), np.nan, error)
        errs = self._errors != "none"
        altitude = self._altimeters.reported_altitude_ft(transponders, sent.alt_m, 0.0, errs)
        difference = (sent.height_m + error) / FOOT_M - altitude
        if self._quantised:
            difference = quantised_difference_ft(difference)
        return np.asarray(difference * FOOT_M)

    def broadcast_velocity(
        self, equipage: Equipage, transponders: Transponders, sent: Sent
    ) -> FloatArray:
        """Return the decoded broadcast velocities along north, east and up, (3, n), m/s."""
        deviation = equipage.velocity_deviation_m_s[transponders.craft]
        messages = transponders, sent.message
        level = self.horizontal_errors(
            "velocity", deviation, *messages, sent.instant_ns, sent.lat_deg, sent.lon_deg
        )
        moved = sent.north_east_up_m_s + np.stack([*level, self._climb_errors(*messages)])
        near = np.flatnonzero(np.abs(sent.lat_deg) > NEAR_A_POLE_DEG)
        if len(near):
            moved[:, near] = self._velocity_in_believed_axes(
                equipage, transponders, sent, near, moved[:, near]
            )
        if not self._quantised:
            return np.asarray(moved)
        north, east = quantised_velocity_kt(moved[0] / KNOT_M_S, moved[1] / KNOT_M_S)
        climb = quantised_climb_ft_min(moved[2] / FOOT_PER_MINUTE_M_S) * FOOT_PER_MINUTE_M_S
        return np.stack([north * KNOT_M_S, east * KNOT_M_S, climb])

    def _velocity_in_believed_axes(
        self, equipage: Equipage, transponders: Transponders, sent: Sent, which: IntArray,
        moved: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """Return velocities along the north and east of the position that each aircraft believes to
        have, which near a pole differ from the true ones.
        """
        some = Transponders(
            transponders.keys[which], transponders.run[which], transponders.craft[which]
        )
        true = sent.lat_deg[which], sent.lon_deg[which]
        errors = self.horizontal_errors(
            "position", equipage.position_deviation_m[some.craft], some, sent.message[which],
            sent.instant_ns[which], *true,
        )  # fmt: skip
        none = np.zeros_like(errors[0])
        lat, lon, _ = displaced_lat_lon_alt(*true, sent.alt_m[which], *errors, none)
        return rotate_to_meridian(moved, true, (lat, lon))

    def broadcast_position(
        self, equipage: Equipage, transponders: Transponders, sent: Sent
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the decoded broadcast latitudes, longitudes (deg) and altitudes (m).

        Latency is compensated by the aircraft's own velocity. An altitude that no code has is NaN.
        """
        craft = transponders.craft
        deviation = equipage.position_deviation_m[craft]
        errors = self.horizontal_errors(
            "position", deviation, transponders, sent.message, sent.instant_ns,
            sent.lat_deg, sent.lon_deg,
        )  # fmt: skip
        spoofed, ahead_s = equipage.spoofed_m[:, craft], equipage.compensated_s[craft]
        north, east, up = errors[0] + spoofed[0], errors[1] + spoofed[1], spoofed[2]
        if ahead_s.any():
            moved = self.broadcast_velocity(equipage, transponders, sent) * ahead_s
            north, east, up = north + moved[0], east + moved[1], up + moved[2]
        lat, lon, _ = displaced_lat_lon_alt(
            sent.lat_deg, sent.lon_deg, sent.alt_m, north, east, np.zeros_like(north)
        )
        step_ft, errs = 25.0 if self._quantised else 0.0, self._errors != "none"
        feet = self._altimeters.reported_altitude_ft(transponders, sent.alt_m + up, step_ft, errs)
        if not self._quantised:
            return lat, lon, feet * FOOT_M
        odd: BoolArray = sent.message % 2 == 1
        y, x = encode(lat, lon, odd)
        lat, lon = decode_near(y, x, odd, lat, lon)
        return lat, lon, feet * FOOT_M


def velocity_in_axes_of_later_position(
    position: list[FloatArray], north_east_down: FloatArray, later_s: FloatArray
) -> FloatArray:
    """Return velocities (3, n) of `later_s` earlier, turned to north and east of these positions.

    North turns with the meridians, within a mile of a pole by degrees from message to message.
    """
    turned = north_east_down
    for _ in range(3):
        back = np.nan_to_num(turned * -later_s)
        lat, lon, _ = displaced_lat_lon_alt(*position, *back)
        turned = rotate_to_meridian(north_east_down, (lat, lon), (position[0], position[1]))
    return turned
