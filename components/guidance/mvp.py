"""An avoidance that steers by velocities, as multirotors fly (``avoidance.mvp``)."""

import math

import numpy as np
from pydantic import Field

from components.geometry import enu_to_geodetic, find_plane_scale, line_of_sight_ned
from components.guidance.potential import (
    KeptApart,
    Others,
    conflict_mask,
    may_resume,
    velocity_after_push,
)
from components.messages.alerts import AlertLevels
from components.messages.reach import FarthestLook
from components.messages.state_tracks import STALE_S
from components.messages.steering import Velocities
from components.messages.targets import TrafficStates
from dsa_des.arrays.keyed_table import KeyedTable, indices_by_occurrence
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added

# Within this of its goal an aircraft stays; it flies to it no faster than in a second.
_AT_GOAL_M, _LAST_S = 0.5, 1.0


class PotentialParameters(Parameters):
    """Parameters of the modified voltage potential."""

    radius_m: float = Field(default=50.0, gt=0, description="Others are to stay so far away, m.")
    margin: float = Field(
        default=1.05, ge=1, le=10, description="Steer for a radius so many times as large."
    )
    lookahead_s: float = Field(
        default=120.0, gt=0, le=3600, description="Conflicts farther ahead do not count, s."
    )
    speed_mps: float = Field(
        gt=0, le=400, description="Speed along its own way: its first track, or to its goal, m/s."
    )
    most_mps: float = Field(default=18.0, gt=0, le=400, description="Largest speed commanded, m/s.")
    acceleration_mps2: float = Field(
        default=5.0, gt=0, le=100, description="Acceleration to a commanded velocity, m/s²."
    )
    goal_m: float | None = Field(
        default=None, gt=0, le=100_000, description="Its goal, where it stops, lies so far ahead "
        "of where it is first seen, m; by default it flies on for ever.",
    )  # fmt: skip

    def ineffective_key_notes(self) -> list[str]:
        """Return a note if ``speed_mps`` is above ``most_mps``, to which all speeds are limited."""
        said = super().ineffective_key_notes()
        if self.speed_mps <= self.most_mps:
            return said
        slower = f"most_mps is {self.most_mps:g}: it never flies its own way any faster"
        return [*said, f"speed_mps is {self.speed_mps:g} and {slower}"]


class VoltagePotential(Component):
    """Leads a multirotor out of conflicts by the modified voltage potential.

    A pair is active from its first conflict until it is past and apart, or until nothing has been
    heard of the other one for 30 s. With conflicts the velocity is the one they push to; with
    active pairs only, that of the moment is kept; else it is that of its own way: along its first
    track, or to its goal from where it truly is. Only what is another velocity than before is
    commanded. Behind a tracker that estimates, others are its tracks by their numbers, whatever
    they are of: false ones are avoided too, and two of one aircraft push twice.
    """

    inputs = {
        "alerts": Input(AlertLevels, "trigger", "Where others are, whatever their level."),
        "states": Input(TrafficStates, "sampled", "Where it is: for its own way."),
    }
    outputs = {"manoeuvres": Output(Velocities, "Velocities that it is told to fly.")}
    Parameters = PotentialParameters
    remembers = ("_known", "_contacts", "_unmoved")
    windowed = True
    lockstep = True
    rewindable = True

    @classmethod
    def may_climb(cls, parameters: PotentialParameters) -> bool:
        """Return False: this block never commands a change of altitude."""
        return False

    def request(self, port: str) -> FarthestLook | None:
        """Return a request for no targets, as only the ownship's position is read from states."""
        return FarthestLook(0.0) if port == "states" else None

    def setup(self) -> None:
        """Start without having seen anybody."""
        self._kept = KeptApart(self.p.radius_m, self.p.margin, self.p.lookahead_s)
        #: By run: which contacts are active, and since when nothing was heard of them, first track,
        #: goal, and the last velocity commanded.
        self._known = KeyedTable.empty({"replica": int})
        self._contacts: IntArray = np.empty(0, dtype=np.int64)
        #: How often its own velocity lacked.
        self._unmoved = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return how many tracks near no target were ignored, and own velocities not known."""
        return {"its own velocity is not known yet and it does not steer": self._unmoved}

    def run(self, wake: Wake) -> Velocities | None:
        """Decide at every instant, of each run one after the other."""
        alerts, states = wake["alerts"], wake["states"]
        if alerts is None or states is None:
            return None
        self._update_contacts_and_columns(alerts)
        others, own_mps, heard = _others_own_velocities_and_mask(alerts, self._contacts)
        if alerts.in_plane:
            # Else a velocity that is held would be another one at every instant.
            own_mps *= find_plane_scale(states.own_lat_deg, states.own_alt_m)
        some, still = heard.any(axis=1), np.isnan(own_mps[0])
        self._unmoved = counts_with_cases_added(
            self._unmoved, wake.run[some & still], wake.run[some]
        )
        place = np.array([states.own_lat_deg, states.own_lon_deg, states.own_alt_m])
        commanded = np.full((2, len(wake)), math.nan)
        for turn in indices_by_occurrence(wake.run):
            # Of most wakes all rows are of one turn, which need not be picked.
            rows = slice(None) if len(turn) == len(wake) else turn
            run = wake.run[rows]
            yaw = states.own_yaw_rad[rows]
            new = KeyedTable(
                replica=run,
                active=np.zeros((heard.shape[1], len(turn)), dtype=bool),
                unheard_s=np.full((heard.shape[1], len(turn)), math.nan),
                track=yaw,
                goal=place[:, rows].copy(),
                last_mps=np.full((2, len(turn)), math.nan),
            )
            if self.p.goal_m is not None and len(self._known.rows_of_runs(run)) < len(run):
                unknown = np.flatnonzero(~np.isin(run, self._known.replica))
                new.goal[:, unknown] = self._goal_positions(new.goal[:, unknown], yaw[unknown])
            known = self._known.kept_rows_or_new(new) if len(self._known) else new
            seen = Others(*(part[:, rows] for part in others))
            own = own_mps[:, rows]
            now = conflict_mask(seen, self._kept) & heard[rows]
            done = may_resume(seen, own, self._kept) | ~np.isfinite(own[0])[:, np.newaxis]
            active = now | (known.active.T & ~(done & heard[rows]))
            unheard_s = new.unheard_s
            if not heard[rows].all():
                time_s = wake.time_s[rows]
                unheard_s = np.where(heard[rows].T, math.nan, np.fmin(known.unheard_s, time_s))
                active &= ~(time_s - unheard_s > STALE_S).T
            velocity = self._undisturbed_velocity(known, place[:, rows])
            velocity = np.where(active.any(axis=1), own, velocity)
            pushed = now.any(axis=1)
            if pushed.any():
                velocity = np.where(
                    pushed, velocity_after_push(seen, own, now, self._kept), velocity
                )
            velocity = self._limit_speed(velocity)
            # Nothing is told to who has not been steered, and flies its own way without it.
            silent = np.isnan(known.last_mps[0]) & ~active.any(axis=1) & (self.p.goal_m is None)
            same = (velocity == known.last_mps).all(axis=0) | silent
            velocity = np.where(same | np.isnan(velocity[0]), known.last_mps, velocity)
            told = (velocity != known.last_mps).any(axis=0) & np.isfinite(velocity[0])
            commanded[:, turn[told]] = velocity[:, told]
            newer = known.with_columns(
                active=active.T.copy(), unheard_s=unheard_s, last_mps=velocity
            )
            self._known = self._known.replace_and_drop_earlier_runs(run, newer, wake.first_run)
        return self._message_of_finite_velocities(wake, commanded)

    def _update_contacts_and_columns(self, alerts: AlertLevels) -> None:
        """Set the contacts to those alerts may name and active tracks, and columns to match."""
        contacts = np.arange(len(alerts.roster))
        if alerts.numbers:
            active = self._known.active.any(axis=1) if len(self._known) else []
            contacts = np.union1d(self._contacts[active], alerts.contact_numbers())
        if len(self._known) and not np.array_equal(contacts, self._contacts):
            _, new, old = np.intersect1d(contacts, self._contacts, True, return_indices=True)
            shape = len(contacts), len(self._known)
            active, unheard_s = np.zeros(shape, dtype=bool), np.full(shape, math.nan)
            active[new], unheard_s[new] = self._known.active[old], self._known.unheard_s[old]
            self._known = self._known.with_columns(active=active, unheard_s=unheard_s)
        self._contacts = contacts

    def _undisturbed_velocity(self, known: KeyedTable, place: FloatArray) -> FloatArray:
        """Return the conflict-free velocity (2, n) east, north (m/s): to the goal or on track."""
        if self.p.goal_m is None:
            return self.p.speed_mps * np.stack([np.sin(known.track), np.cos(known.track)])
        north, east, _ = line_of_sight_ned(*place, *known.goal, validate=False)
        left_m = np.hypot(east, north)
        speed_mps = np.minimum(self.p.speed_mps, np.sqrt(2.0 * self.p.acceleration_mps2 * left_m))
        speed_mps = np.minimum(speed_mps, left_m / _LAST_S)
        per_m = np.where(left_m < _AT_GOAL_M, 0.0, speed_mps / np.maximum(left_m, _AT_GOAL_M))
        return np.stack([east * per_m, north * per_m])

    def _goal_positions(self, place: FloatArray, yaw: FloatArray) -> FloatArray:
        """Return goals' latitude, longitude, altitude (3, n), ``goal_m`` straight ahead."""
        goal_m = self.p.goal_m or 0.0
        return np.stack(
            enu_to_geodetic(
                goal_m * np.sin(yaw), goal_m * np.cos(yaw), np.zeros_like(yaw),
                reference_lat_deg=place[0], reference_lon_deg=place[1],
                reference_alt_m=place[2],
            )
        )  # fmt: skip

    def _limit_speed(self, velocity: FloatArray) -> FloatArray:
        """Return velocities reduced where they are faster than ``most_mps``."""
        speed_mps = np.hypot(*velocity)
        return np.asarray(velocity * np.minimum(1.0, self.p.most_mps / np.maximum(speed_mps, 1e-9)))

    def _message_of_finite_velocities(self, wake: Wake, commanded: FloatArray) -> Velocities | None:
        rows = np.flatnonzero(np.isfinite(commanded[0]))
        if not len(rows):
            return None
        told = wake.instants.take(rows)
        zero, (east, north) = np.zeros(len(rows)), commanded[:, rows].copy()
        return Velocities(
            told.tick, zero, zero, acceleration_mps2=zero + self.p.acceleration_mps2,
            velocity_east_mps=east, velocity_north_mps=north, run=told.run,
        )  # fmt: skip


def _others_own_velocities_and_mask(
    alerts: AlertLevels, contacts: IntArray
) -> tuple[Others, FloatArray, BoolArray]:
    """Return by row the relative positions and velocities of all others, NaN where unknown, the own
    velocities, and a mask of the others known.

    Positions in alerts are the ownship's less the target's.
    """
    shape, place = (len(alerts), len(contacts)), alerts.target
    if alerts.numbers:
        place = np.searchsorted(contacts, alerts.contact_numbers())
    own = np.array([alerts.own_motion[name] for name in ("east_mps", "north_mps")])
    names = ("east_m", "north_m"), ("east_mps", "north_mps")
    if len(place) == math.prod(shape) and (place.reshape(shape) == np.arange(shape[1])).all():
        every = (np.stack([-alerts.relative[of].reshape(shape) for of in two]) for two in names)
        return Others(*every), own, np.ones(shape, dtype=bool)
    at = alerts.row_of_entries, place
    heard = np.zeros(shape, dtype=bool)
    heard[at] = True
    parts = []
    for two in names:
        part = np.full((2, *shape), math.nan)
        for axis, name in zip(part, two, strict=True):
            axis[at] = -alerts.relative[name]
        parts.append(part)
    return Others(*parts), own, heard
