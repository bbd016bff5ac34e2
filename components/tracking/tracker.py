"""The base class of trackers that estimate states: parameters, memory, and the order of looks."""

import math
from fractions import Fraction
from typing import Any

import numpy as np

from components.estimation.batched import selected
from components.estimation.frame import place_in_frame
from components.estimation.motion import ConstantVelocity
from components.messages.detections import SensorOffer
from components.messages.fused import FusedDetections
from components.messages.reach import Reach
from components.messages.state_tracks import StateTracks
from components.sensor.marks import TRACKER
from components.tracking.filter_bank import FilterBank
from components.tracking.ladder import LADDERS
from components.tracking.lasting_errors import LastingErrors
from components.tracking.late_looks import (
    Before,
    Memory,
    Plan,
    gone_back,
    one_step_plan,
    rerun_plan,
    stores_before,
    straight_plan,
)
from components.tracking.lateness import LookCount, latest_s, left_out, may_come_late, warning
from components.tracking.one_step import late_step
from components.tracking.parameters import TrackerParameters
from components.tracking.replica_memory import Heads, Past
from components.tracking.report import Reported, state_tracks
from components.tracking.rules import TrackerRules
from components.tracking.scans import Scans, scans_of, when_made
from components.tracking.step import step
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Wake

#: Bits of a mask of sensors.
MOST_SENSORS = 62
# What a sensor that tells no reach is taken to see: all around, as far as this.
_FARTHEST_M = 20_000.0
_WHOLE_RATE_M_S = 600.0
# What makes a measured quantity exact, by the variance that then is 0.
_EXACT = {
    "azimuth_variance_rad2": "azimuth_resolution_deg",
    "elevation_variance_rad2": "elevation_resolution_deg",
    "range_variance_m2": "range_resolution_m",
}


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
    ladders = LADDERS

    def bank(self) -> FilterBank:
        """Return the filters; a subclass may say otherwise."""
        return FilterBank((ConstantVelocity(self.p.acceleration_intensity_m2_s3),))

    def setup(self) -> None:
        """Start with no tracks.

        Raises
        ------
        ValueError
            If a sensor measures an angle or a range exactly: its weight would be infinite. If there
            are more sensors than a mask has bits.
        """
        if len(self._offers()) > MOST_SENSORS:
            raise ValueError(
                f"a tracker takes at most {MOST_SENSORS} sensors, and {len(self._offers())} lead "
                "to it: let several trackers share them"
            )
        for name, offer in sorted(self._offers().items()):
            for column, key in _EXACT.items():
                if isinstance(offer, SensorOffer) and getattr(offer, column) == 0.0:
                    quantity = key.rpartition("_")[0].replace("_resolution", "")
                    raise ValueError(
                        f"{name} measures its {quantity} exactly (the {column} of its detections "
                        "is 0), and a tracker weighs measurements by their variances: they must "
                        f"be above 0, by a grid (blocks.{name}.{key}) or by errors = 'stated'"
                    )
        self.rules: TrackerRules | None = None
        self._sensors: tuple[str, ...] = ()
        self._store = TrackStore.empty(self.bank().sizes, 0)
        self._heads = Heads.none()
        self._past: Past | None = None
        self._ahead: Scans | None = None
        self._lag_ticks = int(self._lag_s() * self.context.ticks_per_s)
        # Where nothing can come late there is nothing to remember, whatever `late` says.
        self._remembers = may_come_late(self._offers(), self.context.producers)
        self._count, self._early = LookCount(), 0

    def goes_side_by_side(self) -> bool:
        """Say no where looks are worked on again: one replica's are remembered."""
        return super().goes_side_by_side() and not self._remembers

    def _lag_s(self) -> Fraction:
        if self.p.lag_s is not None:
            return Fraction(self.p.lag_s)
        return max(Fraction(1), latest_s(self._offers(), self.context.producers))

    def warnings(self) -> list[str]:
        """Say whose looks will be left out as too late, and how many."""
        lag_s, why = self._lag_s(), f"lag_s is {float(self._lag_s()):g}"
        if self.p.late == "drop":
            lag_s, why = Fraction(0), "late is 'drop'"
        shares = left_out(self._offers(), lag_s, self.context.duration_s)
        found = [warning(n, share, why) for n, share in shares.items()]
        for name, offer in sorted(self._offers().items()):
            if not isinstance(offer, SensorOffer) or offer.lasting is None:
                found.append(
                    f"{name} does not say what of its errors lasts from look to look "
                    "(SensorOffer.lasting): all are taken for new, and tracks are too sure where "
                    "they are not"
                )
        return super().warnings() + found

    def _offers(self) -> dict[str, Any]:
        offers: dict[str, Any] = {}
        for producer in self.context.producers:
            if isinstance(producer.offer, dict):
                offers |= producer.offer
        return offers

    def offer(self, port: str) -> Any:
        """Hand on what the sensors say of themselves, by name."""
        return self._offers()

    def left_out(self) -> list[str]:
        """Say whose range rates are not used, and why."""
        offers = self._offers()
        return [
            f"range rates of {name}: {why}"
            for name, offer in sorted(offers.items())
            if isinstance(offer, SensorOffer)
            and offer.measures_range_rate
            and (why := self._why_no_rates(name, offers))
        ]

    def _why_no_rates(self, name: str, offers: dict[str, Any]) -> str:
        offer = offers.get(name)
        if not self.p.use_range_rate:
            return "use_range_rate is false"
        if not isinstance(offer, SensorOffer) or not offer.measures_range_rate:
            return "it measures none"
        if offer.folds_range_rate:
            return "they fold, and are ambiguous"
        if offer.range_rate_variance_m2_s2 == 0.0:
            return "they are exact, and a tracker weighs measurements by their variances"
        return ""

    def _rules(self, sensors: tuple[str, ...]) -> TrackerRules:
        offers = self._offers()
        told = [offers.get(name) for name in sensors]
        fields = tuple(o.reach if isinstance(o, SensorOffer) else None for o in told)
        farthest = max(
            (f.range_max_m for f in fields if f is not None and f.range_max_m < math.inf),
            default=_FARTHEST_M,
        )
        assumed = self.p.assumed_range_m or 0.25 * farthest
        existence = self.p.start_existence
        untold = [o.untold_across_m2 if isinstance(o, SensorOffer) else 0.0 for o in told]
        return TrackerRules(
            bank=self.bank(),
            association=self.p.association,
            gate_probability=self.p.gate_probability,
            start_gate_probability=self.p.start_gate_probability,
            detection_probability=self.p.detection_probability,
            exact_up_to=self.p.jpda_exact_detections,
            life=self.p.life(),
            start_score=math.log(existence / (1.0 - existence)),
            start_speed_m_s=self.p.start_speed_m_s,
            start_acceleration_m_s2=getattr(self.p, "start_acceleration_m_s2", 3.0),
            start_turn_rad_s=math.radians(getattr(self.p, "start_turn_deg_s", 3.0)),
            start_range_m=(assumed, 0.5 * assumed),
            delete_above_m=self.p.delete_above_m,
            delete_after_ticks=int(self.p.delete_after_s * self.context.ticks_per_s),
            log_density=log_densities(fields, self.p.false_alarms_per_scan),
            fields=fields,
            rates_of=sum(
                1 << i for i, name in enumerate(sensors) if not self._why_no_rates(name, offers)
            ),
            ticks_per_s=self.context.ticks_per_s,
            lasting=LastingErrors.of(offers, sensors),
            untold_across_m2=None if not any(untold) else np.array(untold),
        )

    def run(self, wake: Wake) -> StateTracks | None:
        """Take in what came, look by look, and tell all tracks."""
        fused = wake["fused"]
        if fused is None:
            return None
        if self.rules is None or fused.sensors != self._sensors:
            self.rules, self._sensors = self._rules(fused.sensors), fused.sensors
            self._store = TrackStore.empty(self.rules.bank.sizes, len(fused.sensors))
        told = scans_of(fused)
        self._early += int((told.tick > wake.ticks[told.row]).sum())
        scans, self._ahead = when_made(told, self._ahead, wake)
        if len(scans) == 0:
            return None
        replica = wake.replica[scans.row]
        heads = self._heads.followed_by(replica, scans.pose[:3])
        store = self._store
        if not wake.side_by_side:
            store = store.take(np.isin(store.replica, heads.replica))
        past = self._past
        begin = 0
        before: dict[int, Before] = {}
        memory: dict[int, Memory] = {}
        if past is not None and past.replica == heads.replica[0]:
            begin, before, memory = len(past.scans), dict(past.before), {0: past.memory()}
            scans = Scans.joined([past.scans, scans])
            replica = np.concatenate([np.full(begin, past.replica), replica])
        of = np.searchsorted(heads.replica, replica)
        if not self._remembers:
            plan, left_out = straight_plan(scans, of, heads.tick)
        else:
            planned = rerun_plan if self.p.late == "rerun" else one_step_plan
            plan, left_out = planned(scans, of, begin, memory, self._lag_ticks)
        self._count = self._count.of(fused.sensors, scans.sensors[begin:], scans.sensors[left_out])
        moves = scans.velocity if self.rules.rates_of else None
        origin = selected(heads.origin, of)
        places = place_in_frame(tuple(origin), *_pose(scans.pose), moves)
        codes = scans.kinds(self.rules.rates_of)
        reported: list[Reported] = []
        for works in _turns(plan.of):
            works_now = works
            late, works_now = works[plan.since[works] >= 0], works[plan.since[works] < 0]
            if len(late):
                places_of = plan.of[late]
                replicas = heads.replica[places_of]
                old = stores_before(before, plan.since[late].tolist(), replicas.tolist())
                store, heads.next_number[places_of], gone = late_step(
                    self.rules, store, old, scans, places, codes, plan.look[late], replicas,
                    heads.next_number[places_of], unless_updated=self.p.late == "drop",
                )  # fmt: skip
                in_vain = scans.sensors[plan.look[late[gone]]]
                self._count = self._count.of(fused.sensors, in_vain[:0], in_vain)
            looks, mine = plan.look[works_now], plan.of[works_now]
            if self._remembers:
                store = self._remember(store, heads, plan, works_now, before)
            if len(looks):
                store, heads.next_number[mine] = step(
                    self.rules, store, scans, places, codes, looks, heads.replica[mine],
                    heads.next_number[mine],
                )  # fmt: skip
                heads.tick[mine] = scans.tick[looks]
            tell = plan.tells[works]
            if len(store) and tell.any():
                reported.append(
                    Reported.of(
                        store,
                        heads.replica[plan.of[works[tell]]],
                        plan.seen_from[works[tell]],
                        plan.row[works[tell]],
                    )
                )
        if wake.side_by_side:
            self._heads, self._store = self._heads.kept_with(heads), store
        else:
            self._heads = heads.take(heads.replica == heads.replica[-1])
            self._store = store.take(store.replica == heads.replica[-1])
        self._past = Past.of(scans, memory.get(len(heads.replica) - 1), before, heads.replica[-1])
        if len(plan.look) == 0:
            return None
        rows = np.unique(plan.row)
        return state_tracks(reported, places, origin, rows, wake, self._sensors)

    def _remember(
        self,
        store: TrackStore,
        heads: "Heads",
        plan: Plan,
        works: IntArray,
        before: dict[int, Before],
    ) -> TrackStore:
        """Go back where late looks ask for it, and note how things are before each look."""
        back = plan.back_to[works]
        late = np.flatnonzero(back >= 0)
        if len(late):
            replicas = heads.replica[plan.of[works[late]]].tolist()
            states = {
                number: before[look]
                for number, look in zip(replicas, back[late].tolist(), strict=True)
            }
            store = gone_back(store, states, replicas)
            heads.next_number[plan.of[works[late]]] = [states[n].next_number for n in replicas]
        for work in works.tolist():
            place = int(plan.of[work])
            before[int(plan.look[work])] = Before(store, int(heads.next_number[place]))
            for look in plan.forgotten[work]:
                before.pop(look, None)
        return store

    def report(self) -> dict[str, Any]:
        """Return whose looks came too late, and how many had to wait for their own instant."""
        late = {self.name: self._count.late()}
        return {"late_looks": late, "early_looks": {self.name: self._early}}


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


def _turns(of: IntArray) -> list[IntArray]:
    """Return the first work of every replica, then the second ones, and so on."""
    if len(of) == 0:
        return []
    counts = np.bincount(of)
    place = np.arange(len(of)) - (np.cumsum(counts) - counts)[of]
    order = np.argsort(place, kind="stable")
    return np.split(order, np.cumsum(np.bincount(place))[:-1])


def _pose(pose: FloatArray) -> tuple[Any, Any]:
    return tuple(pose[:3]), tuple(pose[3:])
