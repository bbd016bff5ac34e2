"""The base class of trackers that estimate states: parameters, memory, and the order of looks."""

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from components.estimation.frame import place_in_frame
from components.estimation.motion import ConstantVelocity
from components.messages.detections import FusedDetections, SensorOffer
from components.messages.reach import Reach
from components.messages.state_tracks import StateTracks
from components.sensor.marks import TRACKER
from components.tracking.filter_bank import FilterBank
from components.tracking.life import LONGEST_WINDOW, LifeRules
from components.tracking.report import Reported, state_tracks
from components.tracking.rules import TrackerRules
from components.tracking.scans import scans_of
from components.tracking.step import step
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Parameters
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Wake

# What a sensor that tells no reach is taken to see: all around, as far as this.
_FARTHEST_M = 20_000.0
_WHOLE_RATE_M_S = 600.0


class TrackerParameters(Parameters):
    """Parameters of every tracker that estimates states."""

    acceleration_intensity_m2_s3: float = Field(
        default=4.0, gt=0,
        description="Intensity of the white acceleration that targets are taken to have, m²/s³.",
    )  # fmt: skip
    association: Literal["nearest", "gnn", "jpda"] = Field(
        default="gnn",
        description="Which detection is whose: the nearest in turn, the least sum over all "
        "(global nearest neighbour), or all of them weighed (joint probabilistic).",
    )
    gate_probability: float = Field(
        default=0.997, gt=0, lt=1,
        description="Probability that a target's detection lies in its gate.",
    )  # fmt: skip
    detection_probability: float = Field(
        default=0.9, gt=0, lt=1, description="Probability that a look at a target detects it."
    )
    false_alarms_per_scan: float = Field(
        default=0.1, gt=0,
        description="False alarms that a sensor is taken to have in a scan of its whole field.",
    )  # fmt: skip
    jpda_exact_detections: int = Field(
        default=10, ge=1, le=16,
        description="Detections in a cluster up to which `jpda` is exact; belief propagation "
        "beyond.",
    )  # fmt: skip
    initiation: Literal["m_of_n", "likelihood_ratio"] = Field(
        default="m_of_n", description="The rule that confirms a track."
    )
    confirm_m: int = Field(default=3, ge=1, description="Hits that confirm a track (`m_of_n`).")
    confirm_n: int = Field(
        default=5, ge=1, le=LONGEST_WINDOW, description="Expected looks in which they must fall."
    )
    false_confirmation: float = Field(
        default=1e-4, gt=0, lt=0.5,
        description="Share of false tracks that `likelihood_ratio` confirms.",
    )  # fmt: skip
    missed_confirmation: float = Field(
        default=0.01, gt=0, lt=0.5, description="Share of true tracks that it drops."
    )
    start_existence: float = Field(
        default=0.2, gt=0, lt=1,
        description="Probability that a detection that belongs to no track is of a target.",
    )  # fmt: skip
    start_speed_m_s: float = Field(
        default=70.0, gt=0,
        description="Standard deviation of a new track's velocity along each axis, m/s.",
    )  # fmt: skip
    assumed_range_m: float | None = Field(
        default=None, gt=0,
        description="Range that is assumed, to 45 %, of what is seen without one, m; by default "
        "half of the farthest reach of the sensors.",
    )  # fmt: skip
    delete_misses: int = Field(
        default=10, ge=1, description="Expected looks in vain in a row that end a confirmed track."
    )
    delete_after_s: float = Field(
        default=6.0, gt=0, description="Time without a detection after which any track ends, s."
    )
    delete_above_m: float = Field(
        default=3000.0, gt=0,
        description="Standard deviation of a position that ends a track with a range, m.",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Any:
        if self.confirm_m > self.confirm_n:
            raise ValueError(
                f"confirm_m = {self.confirm_m} hits cannot fall in confirm_n = {self.confirm_n} "
                "looks; allowed: at most as many"
            )
        return self

    def life(self) -> LifeRules:
        """Return the rules of a track's life."""
        return LifeRules(
            self.initiation, self.confirm_m, self.confirm_n, self.false_confirmation,
            self.missed_confirmation, self.delete_misses,
        )  # fmt: skip


class Tracker(Component):
    """Estimates where targets are and how they move, from measured values alone.

    Tracks bear numbers of their own. Every look of every sensor is processed at its own instant;
    tracks are told at every instant at which something came. States are in a fixed frame: north,
    east, down where the ownship believed to be at the first look (`StateTracks`).
    """

    mark = TRACKER
    inputs = {"fused": Input(FusedDetections, "trigger", "What was measured.")}
    outputs = {"tracks": Output(StateTracks, "Estimated tracks.")}
    Parameters = TrackerParameters
    windowed = True
    rewindable = True

    def bank(self) -> FilterBank:
        """Return the filters; a subclass may say otherwise."""
        return FilterBank((ConstantVelocity(self.p.acceleration_intensity_m2_s3),))

    def setup(self) -> None:
        """Start with no tracks."""
        self.rules: TrackerRules | None = None
        self._sensors: tuple[str, ...] = ()
        self._store = TrackStore.empty(self.bank().sizes, 0)
        self._heads = _Heads.none()
        self._late = 0

    def _rules(self, sensors: tuple[str, ...]) -> TrackerRules:
        offers: dict[str, Any] = {}
        for producer in self.context.producers:
            if isinstance(producer.offer, dict):
                offers |= producer.offer
        told = [offers.get(name) for name in sensors]
        fields = tuple(o.reach if isinstance(o, SensorOffer) else None for o in told)
        farthest = max(
            (f.range_max_m for f in fields if f is not None and f.range_max_m < math.inf),
            default=_FARTHEST_M,
        )
        assumed = self.p.assumed_range_m or 0.5 * farthest
        existence = self.p.start_existence
        return TrackerRules(
            bank=self.bank(),
            association=self.p.association,
            gate_probability=self.p.gate_probability,
            detection_probability=self.p.detection_probability,
            exact_up_to=self.p.jpda_exact_detections,
            life=self.p.life(),
            start_score=math.log(existence / (1.0 - existence)),
            start_speed_m_s=self.p.start_speed_m_s,
            start_acceleration_m_s2=getattr(self.p, "start_acceleration_m_s2", 3.0),
            start_turn_rad_s=math.radians(getattr(self.p, "start_turn_deg_s", 3.0)),
            start_range_m=(assumed, 0.45 * assumed),
            delete_above_m=self.p.delete_above_m,
            delete_after_ticks=int(self.p.delete_after_s * self.context.ticks_per_s),
            log_density=log_densities(fields, self.p.false_alarms_per_scan),
            fields=fields,
            use_range_rate=False,
            ticks_per_s=self.context.ticks_per_s,
        )

    def run(self, wake: Wake) -> StateTracks | None:
        """Take in what came, look by look, and tell all tracks."""
        fused = wake["fused"]
        if fused is None:
            return None
        if self.rules is None or fused.sensors != self._sensors:
            self.rules, self._sensors = self._rules(fused.sensors), fused.sensors
            self._store = TrackStore.empty(self.rules.bank.sizes, len(fused.sensors))
        scans = scans_of(fused)
        if len(scans) == 0:
            return None
        replica = wake.replica[scans.row]
        heads = self._heads.followed_by(replica, scans.pose[:3])
        store = self._store.take(np.isin(self._store.replica, heads.replica))
        of = np.searchsorted(heads.replica, replica)
        keep = np.flatnonzero(_in_order(scans.tick, of, heads.tick))
        self._late += len(scans) - len(keep)
        if len(keep) < len(scans):
            scans, replica, of = scans.take(keep), replica[keep], of[keep]
        if len(scans) == 0:
            self._store, self._heads = store, heads
            return None
        places = place_in_frame(tuple(heads.origin[:, of]), *_pose(scans.pose))
        codes = scans.kinds(self.rules.use_range_rate)
        told = np.append(scans.row[1:] != scans.row[:-1], True)
        reported: list[Reported] = []
        for looks in _turns(of):
            mine = of[looks]
            store, heads.next_number[mine] = step(
                self.rules, store, scans, places, codes, looks, heads.replica[mine],
                heads.next_number[mine],
            )  # fmt: skip
            heads.tick[mine] = scans.tick[looks]
            tell = looks[told[looks]]
            if len(tell) and len(store):
                reported.append(Reported.of(store, heads.replica[of[tell]], tell))
        last = heads.replica == heads.replica[-1]
        self._heads = heads.take(last)
        self._store = store.take(store.replica == heads.replica[-1])
        return state_tracks(
            reported, scans, places, heads.origin[:, of], np.unique(scans.row), wake, fused.sensors
        )

    def report(self) -> dict[str, Any]:
        """Return how many looks came too late."""
        return {"late_looks": {self.name: self._late}}


class _Heads:
    """What is kept of each replica beside its tracks, replicas ascending."""

    def __init__(
        self, replica: IntArray, next_number: IntArray, tick: IntArray, origin: FloatArray
    ) -> None:
        self.replica, self.next_number, self.tick = replica, next_number, tick
        self.origin = origin

    @classmethod
    def none(cls) -> "_Heads":
        """Return those of no replica."""
        none = np.empty(0, dtype=np.int64)
        return cls(none, none, none, np.empty((3, 0)))

    def take(self, which: Any) -> "_Heads":
        """Return some of them."""
        return _Heads(
            self.replica[which], self.next_number[which], self.tick[which], self.origin[:, which]
        )

    def followed_by(self, replica: IntArray, place: FloatArray) -> "_Heads":
        """Return those of the replicas of some looks; a new one starts at its first look."""
        found, first = np.unique(replica, return_index=True)
        new = _Heads(
            found, np.ones(len(found), dtype=np.int64),
            np.full(len(found), np.iinfo(np.int64).min), place[:, first].copy(),
        )  # fmt: skip
        for old in np.flatnonzero(np.isin(self.replica, found)).tolist():
            here = int(np.searchsorted(found, self.replica[old]))
            new.next_number[here], new.tick[here] = self.next_number[old], self.tick[old]
            new.origin[:, here] = self.origin[:, old]
        return new


def log_densities(fields: tuple[Reach | None, ...], per_scan: float) -> FloatArray:
    """Return the logarithm of false alarms per unit of measured volume, (4 kinds, sensors)."""
    found = np.empty((4, len(fields)))
    for i, field in enumerate(fields):
        width, height, far = 2.0 * math.pi, math.pi, _FARTHEST_M
        if field is not None:
            low, high = field.azimuth_rad
            width = (high - low) % (2.0 * math.pi) or 2.0 * math.pi
            height = field.elevation_rad[1] - field.elevation_rad[0] or math.pi
            far = min(field.range_max_m, _FARTHEST_M)
        for code in range(4):
            volume = width * height * (far if code & 1 else 1.0)
            volume *= _WHOLE_RATE_M_S if code & 2 else 1.0
            found[code, i] = math.log(per_scan / volume)
    return found


def _in_order(tick: IntArray, of: IntArray, newest: IntArray) -> Any:
    """Return which looks are not older than one that came before, replica by replica."""
    if len(tick) == 0:
        return np.zeros(0, dtype=bool)
    # Replicas lie end to end: what is before a replica's first look is older anyway.
    return (tick >= np.maximum.accumulate(tick)) & (tick >= newest[of])


def _turns(of: IntArray) -> list[IntArray]:
    """Return the first look of every replica, then the second ones, and so on."""
    counts = np.bincount(of)
    place = np.arange(len(of)) - (np.cumsum(counts) - counts)[of]
    order = np.argsort(place, kind="stable")
    return np.split(order, np.cumsum(np.bincount(place))[:-1])


def _pose(pose: FloatArray) -> tuple[Any, Any]:
    return tuple(pose[:3]), tuple(pose[3:])
