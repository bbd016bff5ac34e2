"""Aircraft that tell each other where they are (``surveillance.exchange``)."""

import math

import numpy as np
from pydantic import Field

from components.aircraft.known_targets import offered_rosters
from components.geometry import POSITION_FIELDS, line_of_sight_ned
from components.messages.alerts import AlertLevels
from components.messages.reach import FarthestLook
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import ClockedParameters, Component, Input, Output
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added
from dsa_des.time.clock import ticks_to_nanoseconds
from dsa_des.time.randomness import target_keys

# Velocities are differences of positions so far apart, s; a power of two.
_STEP_S = 1.0 / 1024.0
#: σ of each axis where 95 % of radial errors are within 1.
_PER_95 = 1.0 / math.sqrt(-2.0 * math.log(0.05))


class ExchangeParameters(ClockedParameters):
    """Parameters of an exchange of positions."""

    position_m: float = Field(
        default=30.0, ge=0, le=1e5, description="95 % of a fix's errors in position are within, m."
    )
    velocity_mps: float = Field(
        default=3.0, ge=0, le=1e3, description="95 % of its errors in velocity are within, m/s."
    )


class PositionExchange(Component):
    """Receives the position and velocity of all other aircraft at each scan, without delay or loss,
    each with that aircraft's own errors.

    Every aircraft fixes itself with errors of its own, new at each instant and the same to all who
    hear it; one's own fix errs like that which is broadcast. No level is judged: whoever acts on
    where others are judges by itself. Errors are normal along both axes; heights are the true ones.
    """

    inputs = {"states": Input(TrafficStates, "sampled", "Where all aircraft are.")}
    outputs = {"alerts": Output(AlertLevels, "Where the others say that they are, at level 0.")}
    Parameters = ExchangeParameters
    remembers = ("_still",)
    windowed = True
    lockstep = True
    rewindable = True

    def request(self, port: str) -> FarthestLook:
        """Return a request for all targets at any range, known also shortly after each instant."""
        return FarthestLook(math.inf, lasts_s=_STEP_S)

    def setup(self) -> None:
        """Make the draws, which are those of aircraft and not of who hears them."""
        self._errors = self.context.streams.stream("[exchange]", "fixes")
        #: How often nobody could be heard as velocities were not known, of how many scans.
        self._still = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by message, the instants per run at which unknown velocities barred reception."""
        what = "no flights are known beside the positions: nobody has a velocity and is heard"
        return {what: self._still}

    def warnings(self) -> list[str]:
        """Return a warning if the scene has no other aircraft whose position is received."""
        rosters = offered_rosters(self.context)
        alone = rosters and not any(map(len, rosters))
        return ["nobody else flies: it hears of nobody"] if alone else []

    def run(self, wake: Wake) -> AlertLevels | None:
        """Return the fixes of all targets at every scan, relative to the own fix."""
        states: TrafficStates | None = wake["states"]
        if states is None:
            return None
        self._still = counts_with_cases_added(
            self._still, wake.run[: len(wake) if states.flights is None else 0], wake.run
        )
        if states.flights is None:
            return None
        fixes = states.flights.compute_if_arrays_changed(
            f"fixes {self.p.position_m} {self.p.velocity_mps}",
            (wake.ticks, wake.run, states.tick, states.columns, states.flights.known),
            lambda: self._velocities_and_fix_errors(wake, states),
        )
        (own_mps, velocity), *errors = (
            _split_viewer_from_others(part, _viewer_index(states)) for part in fixes
        )
        own, targets = _viewer_and_other_positions(states)
        position, relative = (
            _displacement_east_north_up_m(own[:, :, np.newaxis], targets),
            velocity - own_mps,
        )
        for part, (mine, theirs) in zip((position, relative), errors, strict=True):
            part[:2] += theirs - mine
            part[2] += 0.0
        if states.present.all():
            row = np.arange(len(wake)).repeat(len(states.columns))
            target = np.tile(states.columns, len(wake))
            position, relative = position.reshape(3, -1), relative.reshape(3, -1)
        else:
            row, column = states.present.nonzero()
            target = states.columns[column]
            position, relative = position[:, row, column], relative[:, row, column]
        (east, north, up), (east_mps, north_mps, _) = position, relative
        speed2 = np.maximum(east_mps * east_mps + north_mps * north_mps, 1e-9)
        closest_s = np.maximum(-(east * east_mps + north * north_mps) / speed2, 0.0)
        miss = np.hypot(*(position[:2] + relative[:2] * closest_s))
        own_mps = own_mps[:, :, 0]
        own_mps[:2] += errors[1][0][:, :, 0]
        own_mps[2] += 0.0
        names = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")
        return AlertLevels(
            wake.ticks,
            offsets_from_entry_rows(row, len(wake)),
            target,
            np.zeros(len(row), dtype=np.int64),
            {},
            closest_s,
            miss,
            np.abs(up),
            {},
            {},
            {name: -part for name, part in zip(names, (east, north, up, *relative), strict=True)},
            {
                "alt_m": states.own_alt_m,
                **dict(zip(("east_mps", "north_mps", "climb_mps"), own_mps, strict=True)),
            },
            states.roster,
        )

    def _velocities_and_fix_errors(self, wake: Wake, states: TrafficStates) -> list[FloatArray]:
        """Return true velocities (3, rows, aircraft; ownship first), position and velocity errors.

        The ownship is the first whoever looks.
        """
        assert states.flights is not None
        own, targets = _viewer_and_other_positions(states)
        here = np.concatenate([own[:, :, np.newaxis], targets], axis=2)
        viewer = _viewer_index(states)
        here[:, :, [0, viewer]] = here[:, :, [viewer, 0]]
        flights = states.flights.seen_from(-1)
        later = flights(states.columns, (wake.time_s + _STEP_S)[:, np.newaxis])
        there = np.concatenate(
            [np.stack([getattr(of, name) for name in POSITION_FIELDS]) for of in later], axis=2
        )
        roster, viewer = states.roster, states.flights.viewer
        roster = roster if viewer < 0 else roster.seen_from(viewer)
        keys = np.append(target_keys((roster.own_name,)), roster.draw_keys_of(states.columns))
        keys = np.broadcast_to(keys, here.shape[1:])
        return [
            _displacement_east_north_up_m(here, there) / _STEP_S,
            *self._position_and_velocity_errors(wake, keys),
        ]

    def _position_and_velocity_errors(self, wake: Wake, keys: AnyArray) -> list[FloatArray]:
        """Return errors of position and of velocity, (2, rows, aircraft) each: east and north."""
        instant_ns = ticks_to_nanoseconds(wake.ticks, wake.ticks_per_s)
        run, shape = np.repeat(wake.run, keys.shape[1]), (2, *keys.shape)
        number = np.repeat(instant_ns, keys.shape[1])
        stream = self._errors.of_runs(run, number)
        scales = self.p.position_m * _PER_95, self.p.velocity_mps * _PER_95
        flat = np.ascontiguousarray(keys).reshape(-1)
        return [
            scale * np.stack([stream.normal(flat, number, 2 * k + axis) for axis in range(2)])
            .reshape(shape)
            for k, scale in enumerate(scales)
        ]  # fmt: skip


def _viewer_index(states: TrafficStates) -> int:
    """Return the index of the viewing platform among all aircraft, where 0 is the ownship."""
    assert states.flights is not None
    viewer = states.flights.viewer
    return 0 if viewer < 0 else int(np.searchsorted(states.columns, viewer)) + 1


def _viewer_and_other_positions(states: TrafficStates) -> tuple[FloatArray, FloatArray]:
    """Return the viewer's latitude, longitude, altitude (3, rows), others' (3, rows, targets)."""
    own, targets = (
        np.stack([getattr(states, f"{of}{name}") for name in POSITION_FIELDS])
        for of in ("own_", "")
    )
    return own, targets


def _split_viewer_from_others(everybody: FloatArray, viewer: int) -> tuple[FloatArray, FloatArray]:
    """Return the viewer's values (..., 1), and all others', the ownship in the viewer's place."""
    others = everybody[:, :, 1:].copy()
    if viewer:
        others[:, :, viewer - 1] = everybody[:, :, 0]
    return everybody[:, :, viewer : viewer + 1].copy(), others


def _displacement_east_north_up_m(here: FloatArray, there: FloatArray) -> FloatArray:
    """Return the displacement from positions to others, along the first's east, north, up, m."""
    north, east, down = line_of_sight_ned(*here, *there, validate=False)
    return np.stack(np.broadcast_arrays(east, north, -down))
