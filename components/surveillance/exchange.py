"""Aircraft that tell each other where they are (``surveillance.exchange``)."""

import math

import numpy as np
from pydantic import Field

from components.aircraft.known_targets import known_targets
from components.geometry import POSITION_FIELDS, line_of_sight_ned
from components.messages.alerts import AlertLevels
from components.messages.reach import FarthestLook
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import ClockedParameters, Component, Input, Output
from dsa_des.block.message import offsets_of
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, count_cases
from dsa_des.time.clock import nanosecond_of
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
    """Hears the fixes of all others at each scan, at once and without loss, and has its own.

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
        """Ask for all, and for their flights, which velocities are of."""
        return FarthestLook(math.inf, lasts_s=_STEP_S)

    def setup(self) -> None:
        """Make the draws, which are those of aircraft and not of who hears them."""
        self._errors = self.context.streams.stream("[exchange]", "fixes")
        #: How often nobody could be heard as velocities were not known, of how many scans.
        self._still = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return how often nothing moved as far as is known, as behind an FMU that flies."""
        what = "no flights are known beside the positions: nobody has a velocity and is heard"
        return {what: self._still}

    def warnings(self) -> list[str]:
        """Warn that no other aircraft exchanges positions."""
        rosters = known_targets(self.context)
        alone = rosters and not any(map(len, rosters))
        return ["nobody else flies: it hears of nobody"] if alone else []

    def run(self, wake: Wake) -> AlertLevels | None:
        """Give all fixes of every scan, relative to one's own."""
        states: TrafficStates | None = wake["states"]
        if states is None:
            return None
        self._still = count_cases(
            self._still, wake.run[: len(wake) if states.flights is None else 0], wake.run
        )
        if states.flights is None:
            return None
        everybody = _in_order(states)
        velocities, position_errors, velocity_errors = states.flights.once(
            f"fixes {self.p.position_m} {self.p.velocity_mps}",
            (wake.ticks, wake.run, states.columns, everybody),
            lambda: self._fixes(wake, states, everybody),
        )
        viewer = _place(states)
        others = np.arange(1, everybody.shape[2])
        others[viewer - 1 : viewer] = 0  # the ownship is in the place of who looks
        own_mps, velocity = velocities[:, :, viewer], velocities[:, :, others]
        position = _way(everybody[:, :, [viewer]], everybody[:, :, others])
        mine = position_errors[:, :, [viewer]], velocity_errors[:, :, [viewer]]
        theirs = position_errors[:, :, others], velocity_errors[:, :, others]
        row, column = states.present.nonzero()
        apart = [(theirs[k] - mine[k])[:, row, column] for k in range(2)]
        position = position[:, row, column] + np.stack([*apart[0], 0.0 * row])
        relative = velocity[:, row, column] - own_mps[:, row] + np.stack([*apart[1], 0.0 * row])
        east, north, up = position
        closing = -(position[:2] * relative[:2]).sum(axis=0)
        speed2 = np.maximum((relative[:2] ** 2).sum(axis=0), 1e-9)
        closest_s = np.maximum(closing / speed2, 0.0)
        miss = np.hypot(*(position[:2] + relative[:2] * closest_s))
        own_mps = own_mps + np.stack([*mine[1][:, :, 0], np.zeros(len(wake))])
        names = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")
        return AlertLevels(
            wake.ticks,
            offsets_of(row, len(wake)),
            states.columns[column],
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

    def _fixes(
        self, wake: Wake, states: TrafficStates, here: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return velocities of everybody (3, rows, aircraft), and errors of their fixes."""
        assert states.flights is not None
        flights = states.flights.seen_from(-1)
        later = flights(states.columns, (wake.time_s + _STEP_S)[:, np.newaxis])
        there = np.concatenate(
            [np.stack([getattr(of, name) for name in POSITION_FIELDS]) for of in later], axis=2
        )
        roster, viewer = states.roster, states.flights.viewer
        roster = roster if viewer < 0 else roster.seen_from(viewer)
        keys = np.append(target_keys((roster.own_name,)), roster.keys_of(states.columns))
        keys = np.broadcast_to(keys, here.shape[1:])
        position_errors, velocity_errors = self._fix_errors(wake, keys)
        return _way(here, there) / _STEP_S, position_errors, velocity_errors

    def _fix_errors(self, wake: Wake, keys: AnyArray) -> list[FloatArray]:
        """Return errors of position and of velocity, (2, rows, aircraft) each: east and north."""
        instant_ns = nanosecond_of(wake.ticks, wake.ticks_per_s)
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


def _place(states: TrafficStates) -> int:
    """Return the place of who looks among everybody, the ownship first."""
    assert states.flights is not None
    viewer = states.flights.viewer
    return 0 if viewer < 0 else int(np.searchsorted(states.columns, viewer)) + 1


def _in_order(states: TrafficStates) -> FloatArray:
    """Return positions of everybody (3, rows, aircraft), the ownship first whoever looks."""
    own = np.stack([getattr(states, f"own_{name}") for name in POSITION_FIELDS])
    targets = np.stack([getattr(states, name) for name in POSITION_FIELDS])
    everybody = np.concatenate([own[:, :, np.newaxis], targets], axis=2)
    viewer = _place(states)
    everybody[:, :, [0, viewer]] = everybody[:, :, [viewer, 0]]
    return everybody


def _way(here: FloatArray, there: FloatArray) -> FloatArray:
    """Return the way from places to others, east, north and up of the first, m."""
    north, east, down = line_of_sight_ned(*here, *there, validate=False)
    return np.stack(np.broadcast_arrays(east, north, -down))
