"""A tracker of Stone Soup's that a user builds in a file of his own (``tracking.stonesoup``)."""

from dataclasses import replace
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from components.estimation.frame import SensorPose, pose_in_frame
from components.estimation.measurement import Kind, linearise
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.detections import SensorOffer, offers_of_fused_sensors
from components.messages.fused import FusedDetections
from components.messages.state_tracks import COVARIANCE, DELETED, StateTracks
from components.sensor.palette import TRACKER
from components.stone_soup.library import Repeatable, require_stone_soup
from components.stone_soup.reported_tracks import Followed, Follower
from components.tracking.due_detections import ACTS_EVERY_S, Promises
from components.tracking.out_of_sequence import LookCount, max_lateness_s
from components.tracking.reported_errors import folded_range_warnings, latency_warnings
from components.tracking.scans import Scans, looks_of_message, split_due_looks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.foreign_calls import ForeignFailure, wrap_foreign_errors
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.shadowed_packages import NotAllowed, NotImportable, import_named_object
from dsa_des.block.source_file import absolute_type_name
from dsa_des.block.wake import Wake
from dsa_des.time.randomness import key_of


def _absolute_builder_path(value: Any) -> Any:
    """Return the builder's name with absolute path; a bare ``file.py`` is in the scene's folder."""
    if not isinstance(value, str):
        return value
    file = value.rpartition(":")[0]
    if file.endswith(".py") and "/" not in file:
        folder = getattr(value, "folder", None)
        value = f"./{value}" if folder is None else f"{folder}/{value}"
    return absolute_type_name(value)


class StoneSoupParameters(Parameters):
    """What is built, and how its states are laid out."""

    builder: Annotated[str, BeforeValidator(_absolute_builder_path)] = Field(
        description="The function that builds the tracker: my_tracker.py:build, beside the scene, "
        "or module:build. It is called without arguments.",
    )
    position_mapping: tuple[int, int, int] = Field(
        default=(0, 2, 4), description="Where x, y, z (east, north, up) stand in a state, from 0."
    )
    velocity_mapping: tuple[int, int, int] = Field(
        default=(1, 3, 5), description="Where their rates stand in it."
    )
    state_size: int = Field(default=6, ge=6, le=100, description="Components of a state.")

    @model_validator(mode="after")
    def _check_places_of_state(self) -> Any:
        places = (*self.position_mapping, *self.velocity_mapping)
        if len(set(places)) != 6 or min(places) < 0 or max(places) >= self.state_size:
            raise ValueError(
                f"position_mapping = {list(self.position_mapping)} and velocity_mapping = "
                f"{list(self.velocity_mapping)} must name six components of a state, each once, "
                f"from 0 to {self.state_size - 1} (state_size = {self.state_size})"
            )
        return self


class StoneSoupTracker(Component):
    """Passes every look to a tracker built with Stone Soup, and reports its tracks.

    The tracker is whatever the builder returns that has ``update_tracker(time, detections)``, as
    Stone Soup's have. Every sensor's look is handed over by itself, in the order of instants; with
    `fusion.pass_through` also those in vain. A look waits for as long as a scene says that an older
    one may still come; one that comes later all the same is left out and counted. Tracks that a
    tracker shows count as confirmed, after a look in vain as coasted. Where nothing has come for as
    long as no sensor is silent that still sees something (6 s, or three times as long as the
    soonest promises a report in), the tracker gets looks in vain, so that its own rules end tracks.
    """

    mark = TRACKER
    inputs = {"fused": Input(FusedDetections, "trigger", "What was measured.")}
    outputs = {"tracks": Output(StateTracks, "The tracker's tracks.")}
    Parameters = StoneSoupParameters
    windowed = True

    def setup(self) -> None:
        """Build the tracker."""
        require_stone_soup("tracking.stonesoup")
        self._ahead: Scans | None = None
        self._origin: FloatArray | None = None
        self._own_m = np.zeros(3)
        self._sensors: tuple[str, ...] = ()
        # When the last look was made, and what was handed over last.
        self._looked_tick = self._newest = -1
        self._count = LookCount()
        producers = self.context.producers
        offers, ticks_per_s = offers_of_fused_sensors(producers), self.context.ticks_per_s
        self._wait_ticks = int(max_lateness_s(offers, producers) * ticks_per_s)
        promises = Promises.of(offers, tuple(offers), ticks_per_s)
        everywhere = np.full(1, np.inf)
        (self._quiet_ticks,) = promises.track_life_ticks(
            np.ones((len(offers), 1), bool), everywhere
        )
        self._masks: dict[str, int] = {}
        self._follower = Follower(self.p.position_mapping, self.p.velocity_mapping)
        self._repeatable = Repeatable(
            key_of(getattr(self.context.streams, "seed", 0), self.name, "stone soup")
        )
        self._tracker = self._build_tracker()

    def warnings(self) -> list[str]:
        """Return warnings for sensors with lasting errors, unknown latency or ambiguous ranges."""
        offers = offers_of_fused_sensors(self.context.producers)
        said = latency_warnings(offers) + folded_range_warnings(offers)
        for name, offer in sorted(offers.items()):
            lasting = offer.lasting if isinstance(offer, SensorOffer) else None
            if lasting is None or lasting:
                what = (
                    "what lasts of its errors is not said"
                    if lasting is None
                    else (f"errors of its {', '.join(sorted(lasting))} last from look to look")
                )
                said.append(f"{name}: {what}, and its variances stand for new ones: tracks are "
                             "too sure where errors are the same again")  # fmt: skip
        return super().warnings() + said

    def _build_tracker(self) -> Any:
        name = self.p.builder
        try:
            build = import_named_object(name, f"blocks.{self.name}.builder")
        except NotAllowed:
            return None  # `check --no-import` runs nothing
        except NotImportable as error:
            raise ValueError(f"builder = {name}: {error}") from error
        if not callable(build):
            raise ValueError(f"builder = {name}: is no function that builds a tracker")
        try:
            with wrap_foreign_errors(), self._repeatable.isolated_random_state():
                tracker = build()
        except ForeignFailure as error:
            raise ValueError(f"builder = {name}: failed with {error}") from error.__cause__
        if not callable(getattr(tracker, "update_tracker", None)):
            raise ValueError(
                f"builder = {name}: returned {type(tracker).__name__}, which has no "
                "update_tracker(time, detections) as Stone Soup's trackers have"
            )
        return tracker

    def acts_every_s(self) -> Fraction | None:
        """Return the interval, s, of checking whether tracks without detections must end."""
        return ACTS_EVERY_S

    def run(self, wake: Wake) -> StateTracks | None:
        """Process looks that came and looks that are missing, in order; return all tracks."""
        due = self._due_looks_by_row(wake)
        entries: list[tuple[int, FloatArray, Followed]] = []
        rows: list[int] = []
        for row, tick in enumerate(wake.ticks.tolist()):
            here: dict[int, Followed] = {}
            in_time = False
            for look, pose in due.get(row, ()):
                if look.tick[0] < self._newest:
                    self._count = self._count.add_looks(self._sensors, look, slice(0), [0])
                    continue
                in_time = True
                here |= {one.number: one for one in self._process_look(look, pose, wake)}
            if not in_time and self._is_silent(tick):
                ended = self._process_instant(tick - self._wait_ticks, wake, set())
                if any(one.status == DELETED for one in ended):
                    here, in_time = {one.number: one for one in ended}, True
            if in_time:
                rows.append(row)
                entries += [(row, self._own_m, replace(one)) for one in here.values()]
        return self._message(wake, rows, entries) if rows else None

    def _due_looks_by_row(self, wake: Wake) -> dict[int, list[tuple[Scans, SensorPose]]]:
        """Return by wake row the looks due for Stone Soup, in order, with the sensor's pose."""
        busy = wake.without_idle()
        fused = None if busy is None else busy["fused"]
        if fused is not None:
            self._sensors = fused.sensors
            came = looks_of_message(fused)
            came = replace(came, row=np.flatnonzero(~wake.idle)[came.row])
            self._count = self._count.add_looks(fused.sensors, came, slice(None), [])
        elif self._ahead is not None:
            came = self._ahead.take(np.zeros(0, dtype=np.int64))
        else:
            return {}
        scans, self._ahead = split_due_looks(came, self._ahead, wake, self._wait_ticks)
        due: dict[int, list[tuple[Scans, SensorPose]]] = {}
        if len(scans):
            if self._origin is None:
                self._origin = scans.pose[:3, 0].copy()
            origin = np.repeat(self._origin[:, np.newaxis], len(scans), axis=1)
            poses = pose_in_frame(origin, scans.pose[:3], scans.pose[3:])
            for i, row in enumerate(scans.row.tolist()):
                one = np.array([i])
                due.setdefault(row, []).append((scans.take(one), poses.take(one)))
        return due

    def _is_silent(self, tick: int) -> bool:
        """Return whether no look has arrived for so long that tracks may have to be deleted."""
        quiet = tick - self._wait_ticks - self._looked_tick
        return bool(self._follower) and self._ahead is None and quiet >= self._quiet_ticks

    def _process_look(self, look: Scans, pose: SensorPose, wake: Wake) -> "list[Followed]":
        """Pass one look to Stone Soup, and return the tracks after it."""
        from components.stone_soup.objects import Poses, make_detections, to_datetime

        (tick,) = look.tick.tolist()
        masks = look.contributors.tolist()
        names = ["+".join(n for i, n in enumerate(self._sensors) if m >> i & 1) for m in masks]
        result = make_detections(
            Poses(pose, self.p.position_mapping, self.p.state_size), [0] * len(masks),
            to_datetime(tick / wake.ticks_per_s), look.measured, look.variance,
            [{"sensor": name} for name in names],
        )  # fmt: skip
        self._masks.update(zip(names, masks, strict=True))
        self._looked_tick, self._own_m = tick, pose.position_m[:, 0]
        return self._process_instant(tick, wake, result)

    def _process_instant(self, tick: int, wake: Wake, found: "set[Any]") -> "list[Followed]":
        """Pass the detections of one instant to Stone Soup, and return the tracks after it."""
        from components.stone_soup.objects import to_datetime

        time_s = tick / wake.ticks_per_s
        when, self._newest = to_datetime(time_s), tick
        with self._repeatable.isolated_random_state():
            _, tracks = self._tracker.update_tracker(when, found)
            return self._follower.update_tracks(tracks, time_s, when, self._masks)

    def _message(
        self, wake: Wake, rows: list[int], entries: "list[tuple[int, FloatArray, Followed]]"
    ) -> StateTracks:
        """Return the message with these tracks, each given by its row, the ownship's position and
        what is to be reported.
        """
        tracks = [one for _, _, one in entries]
        count = len(tracks)
        own_m = np.array([own for _, own, _ in entries]).reshape(count, 3).T
        of_row = np.searchsorted(rows, np.array([row for row, _, _ in entries], dtype=np.int64))
        state = np.array([one.state for one in tracks], dtype=float).reshape(count, 6).T
        spread = np.array([one.covariance for one in tracks], dtype=float).reshape(count, 6, 6)
        spread = np.moveaxis(spread, 0, -1)
        at = SensorPose(
            own_m,
            np.repeat(np.eye(3)[:, :, np.newaxis], count, axis=2),
        )
        seen, by_state = linearise(Kind(False), state, at)
        angular = np.einsum("ikn,kln,iln->in", by_state, spread[:3, :3], by_state)
        ranged = np.array([one.ranged for one in tracks], dtype=bool)

        def known(values: FloatArray) -> FloatArray:
            return np.where(ranged, values, np.nan)

        def column(name: str, kind: type = float) -> Any:
            return np.array([getattr(one, name) for one in tracks], dtype=kind)

        assert self._origin is not None
        origin = (np.full(count, value) for value in self._origin)
        moments: dict[str, Any] = {
            **{name: known(values) for name, values in zip(STATE, state, strict=True)},
            **dict(zip((*OWN_POSITION, *ORIGIN), (*at.position_m, *origin), strict=True)),
            **{name: column(name) for name in ("age_s", "state_s", "updated_s")},
            **{name: column(name, np.int64) for name in ("contributors", "updated_by")},
        }
        return StateTracks(
            tick=wake.ticks[rows],
            offsets=offsets_from_entry_rows(of_row, len(rows)),
            track=column("number", np.int64),
            track_status=column("status", np.int64),
            existence=np.full(count, np.nan),
            azimuth_rad=seen[0] % (2.0 * np.pi),
            elevation_rad=seen[1],
            azimuth_variance_rad2=angular[0],
            elevation_variance_rad2=angular[1],
            has_range=ranged,
            covariance={name: known(spread[index]) for index, name in COVARIANCE.items()},
            extras={},
            sensors=self._sensors,
            **moments,
        )  # fmt: skip

    def failure_counts(self) -> dict[str, IntArray]:
        """Return how many looks came too late, of how many, by sensor."""
        return self._count.failure_counts()

    def report(self) -> dict[str, Any]:
        """Return how many looks came too late, by sensor."""
        return {"late_looks": {self.name: self._count.late_look_statistics()}}
