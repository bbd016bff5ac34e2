"""Recorded measurements in a simulated sensor's place (``sensor.recorded``)."""

import math
from collections.abc import Generator
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.aircraft import Aircraft, Roster
from components.aircraft.known_targets import offered_rosters
from components.atmosphere.pressure_altitude import scene_air
from components.foreign.reported_look import detections_of_reports
from components.formats.measurement_file import Measurements, read_measurements
from components.formats.recorded.known_kinds import asterix_blocks_of_capture
from components.messages.columns import OWN_VELOCITY, POSE
from components.messages.detections import (
    EXTRAS,
    Detections,
    SensorOffer,
    range_and_report_interval_pairs,
)
from components.messages.targets import RelativeTargets
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import (
    Component,
    Input,
    Output,
    Parameters,
    PositiveRational,
    ScenePath,
)
from dsa_des.errors import Disagreements, did_you_mean
from dsa_des.text.safe_text import shorten
from dsa_des.time.clock import ClockSpec

_FLAGS = ("declared", "cued")
_DEG = math.radians(1.0)
#: Endings of files with plots of radars, plain or captured.
_RADARS = (".ast", ".pcap", ".pcapng", ".cap")
_VARIANCES = (
    "azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2",
    "range_rate_variance_m2_s2",
)  # fmt: skip


class RecordedSensorParameters(Parameters):
    """Parameters of recorded measurements."""

    file: ScenePath = Field(
        description="Parquet or CSV file with time_s, azimuth_rad and elevation_rad of every "
        "detection (body axes), and what else of a run's detections.parquet there is; arrival_s "
        "says when it came. A row without angles is a look that saw nothing. Or a run's folder, "
        "or plots in ASTERIX (.ast, .pcap, .pcapng), whose angles are from north and level."
    )
    block: str | None = Field(
        None, description="Whose rows are read, where the file has a column block."
    )
    model: ScenePath | None = Field(
        None,
        description="Scene whose block of the name `block`, for ASTERIX of this block's own name, "
        "says the sensor's reach and which of its errors last; by default a run folder's "
        "scene.toml, and nothing is said for a file.",
    )
    azimuth_error_deg: float | None = Field(
        None, gt=0, description="Standard deviation, where the file says no variance."
    )
    elevation_error_deg: float | None = Field(None, gt=0, description="The same of elevations.")
    range_error_m: float | None = Field(None, gt=0, description="The same of ranges.")
    radar_lat_deg: float | None = Field(
        None, ge=-90, le=90,
        description="Where a radar of ASTERIX is that does not say it: latitude, WGS-84.",
    )  # fmt: skip
    radar_lon_deg: float | None = Field(None, ge=-180, le=360, description="Its longitude.")
    radar_alt_m: float | None = Field(None, description="Its altitude above the ellipsoid.")
    scan_rate_hz: PositiveRational | None = Field(
        None,
        description="Nominal rate at which blocks upstream are asked for rows, where the traffic "
        "is to fly beside the recording. Looks are at their own instants in any case.",
    )

    @property
    def place(self) -> tuple[float, float, float] | None:
        """The radar's latitude, longitude (deg), altitude (m) as the scene states, or None."""
        lat, lon, alt = self.radar_lat_deg, self.radar_lon_deg, self.radar_alt_m
        return None if lat is None or lon is None or alt is None else (lat, lon, alt)

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        keys = ("radar_lat_deg", "radar_lon_deg", "radar_alt_m")
        missing = [key for key in keys if getattr(self, key) is None]
        if 0 < len(missing) < len(keys):
            raise Disagreements([f"{missing[0]}: needed with the other two of {', '.join(keys)}"])
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key that has no effect."""
        if self.place is None or self.file.suffix in _RADARS:
            return []
        keys = ("radar_lat_deg", "radar_lon_deg", "radar_alt_m")
        return self.note_ineffective(*keys, because="the file is no ASTERIX")


class RecordedSensor(Component):
    """Sends recorded measurements at the times they were made, to arrive as late as they did.

    Rows are dated with ``time_s`` and arrive at ``arrival_s`` (``latency_s`` and delays of wires
    come on top), so what comes after it runs as after the sensor itself. Looks wait their turn one
    by one: all behind this block runs scan by scan. Angles are in radians, in the ownship's body
    axes; the scene's traffic, where it is wired to `targets`, says which targets there are.
    """

    inputs = {
        "targets": Input(RelativeTargets, "sampled", "Says the names of targets.", required=False)
    }
    outputs = {"detections": Output(Detections, "What was measured, look by look.")}
    Parameters = RecordedSensorParameters

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return the nominal clock of the measurements, or None where there is none."""
        return None if parameters.scan_rate_hz is None else ClockSpec(parameters.scan_rate_hz)

    @cached_property
    def _read_measurements(self) -> Measurements:
        measured = read_measurements(
            self.p.file, self.p.block, self.p.place, asterix_blocks_of_capture(self.p.file)
        )
        p, entries = self.p, measured.entries
        stated = (p.azimuth_error_deg, p.elevation_error_deg, p.range_error_m)
        for name, error, unit in zip(_VARIANCES[:3], stated, (_DEG, _DEG, 1.0), strict=True):
            if error is not None:
                values = entries.get(name, np.full(len(measured.target), np.nan))
                entries[name] = np.where(np.isnan(values), (error * unit) ** 2, values)
        return measured

    def natural_duration_s(self) -> Fraction:
        """Return the duration in whole seconds by which the last recorded look has arrived."""
        return Fraction(math.floor(self._read_measurements.arrival_s.max()) + 1)

    def offer(self, port: str) -> SensorOffer:
        """Return what the recorded sensor measures, its errors, and its latency."""
        late = self._ticks(self._read_measurements.arrival_s) - self._ticks(
            self._read_measurements.time_s
        )
        per_s = self.context.ticks_per_s
        stated = self._sensor_offer or self._offer_from_measurements()
        return replace(
            stated,
            clock=None,
            latest_s=Fraction(int(late.max()), per_s),
            jitter_s=Fraction(int(late.max() - late.min()), per_s),
        )

    @cached_property
    def _sensor_offer(self) -> SensorOffer | None:
        """Return the declaration of the sensor's model, or None without a model."""
        path, block = self.p.model, self.p.block
        if path is None:
            path = Path(self.p.file) / "scene.toml"
            if block is None or not path.is_file():
                return None
        from dsa_des.library.scenes import load_scene
        from dsa_des.running.simulation import Simulation

        components = Simulation(load_scene(path)).components
        if block not in components and (block is None or "/" in block):
            block = self.name  # a radar of ASTERIX has a number where the model has a name
        if block not in components:
            hint = did_you_mean(str(block), components)
            raise ValueError(f"block is {block!r}: {path} has no such block{hint}")
        offer = components[block].offer("detections")
        if not isinstance(offer, SensorOffer):
            raise ValueError(f"block is {block!r}: in {path} it is no sensor")
        return offer

    def _offer_from_measurements(self) -> SensorOffer:
        entries = self._read_measurements.entries
        same: dict[str, Any] = {}
        for name in _VARIANCES:
            values = entries.get(name, np.empty(0))
            one = len(values) and bool((values == values[0]).all())
            same[name] = float(values[0]) if one else None
        angles = [entries[name] for name in _VARIANCES[:2] if name in entries]
        known = [np.nanmedian(v) for v in angles if not np.isnan(v).all()]
        return SensorOffer(
            self._has_measured_values("range_m"), math.sqrt(12.0 * max(known, default=0.0)),
            self._has_measured_values("range_rate_m_s"), promises=self._promises_of_looks(), **same,
        )  # fmt: skip

    def _promises_of_looks(self) -> tuple[tuple[float, float], ...]:
        """Return `SensorOffer.promises` by the median interval of the looks; empty for one look."""
        apart_s = np.diff(np.sort(self._read_measurements.time_s))
        return range_and_report_interval_pairs(float(np.median(apart_s))) if len(apart_s) else ()

    def _has_measured_values(self, name: str) -> bool:
        values = self._read_measurements.entries.get(name)
        return values is not None and not np.isnan(values).all()

    def _ticks(self, time_s: FloatArray) -> IntArray:
        return np.rint(time_s * self.context.ticks_per_s).astype(np.int64)

    def setup(self) -> None:
        """Name the targets, and date the looks."""
        measured = self._read_measurements
        self._tick, self._arrives = self._ticks(measured.time_s), self._ticks(measured.arrival_s)
        if len(near := np.flatnonzero(np.diff(self._tick) == 0)):
            raise ValueError(
                f"{self.p.file}: looks at {measured.time_s[near[0]]:.12g} s and "
                f"{measured.time_s[near[0] + 1]:.12g} s fall on one tick of the scene"
            )
        names = dict.fromkeys(name for name in measured.target if name is not None)
        rosters = offered_rosters(self.context)
        self._roster = (
            rosters[0] if rosters else Roster.from_pairs([(n, Aircraft()) for n in names])
        )
        place = {name: number for number, name in enumerate(self._roster.names)}
        wrong = [
            f"{where}: target {shorten(str(name))!r} is not in the scene"
            f"{did_you_mean(str(name), place)}"
            for name, where in zip(measured.target, measured.where, strict=True)
            if name is not None and name not in place
        ]
        if wrong:
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            raise ValueError(f"{self.p.file}: {wrong[0]}{more}")
        self._target = np.array([place.get(name or "", -1) for name in measured.target], np.int64)
        self._extras = [n for n in EXTRAS if n in _FLAGS or self._has_measured_values(n)]
        for name in _FLAGS:
            # Whoever does not say declares all that it reports, and was not cued.
            said = measured.entries.get(name, np.full(len(measured.target), np.nan))
            measured.entries[name] = np.nan_to_num(said, nan=name == "declared") > 0.5
        self._sweeps = self._has_measured_values("illuminated_s")
        self._rates = self._has_measured_values("range_rate_m_s") and set(OWN_VELOCITY) <= set(
            measured.looks
        )

    def process(self, env: Any) -> Generator[Any, None, None]:
        """Send every recorded look at its own time, to arrive when it arrived in the recording."""
        for number, (tick, arrives) in enumerate(
            zip(self._tick.tolist(), self._arrives.tolist(), strict=True)
        ):
            yield env.timeout(tick - env.now)
            env.send(self._detections_of_look(number), leaves=arrives)

    def _detections_of_look(self, number: int) -> Detections:
        measured = self._read_measurements
        rows = slice(int(measured.offsets[number]), int(measured.offsets[number + 1]))
        entries = {name: values[rows] for name, values in measured.entries.items()}
        look = {name: values[number : number + 1] for name, values in measured.looks.items()}
        tick = self._tick[number : number + 1]
        more: dict[str, Any] = {}
        if self._rates:
            more["own_velocity"] = {name: look[name] for name in OWN_VELOCITY}
        if self._sweeps:
            more["ticks_after"] = self._ticks(entries["illuminated_s"]) - tick[0]
            if set(POSE) <= set(entries):
                more["own_of_entries"] = {name: entries[name] for name in POSE}
        unsaid = set(EXTRAS) - set(self._extras)
        return detections_of_reports(
            tick, measured.scan[number : number + 1], np.array([0, len(self._target[rows])]),
            {name: values for name, values in entries.items() if name not in unsaid},
            look, self._target[rows], self._roster, **more,
        )  # fmt: skip

    def warnings(self) -> list[str]:
        """Return warnings on rows that were left out, and on looks that come after the end."""
        late = int(
            np.count_nonzero(self._read_measurements.arrival_s >= float(self.context.duration_s))
        )
        total = len(self._tick)
        lines = [f"file: {note}" for note in self._read_measurements.notes]
        if self.p.file.suffix in _RADARS and scene_air(self.context.sections) is not None:
            lines.append("file: elevations are those of its flight levels, taken for heights")
        return lines + ([f"file: {late} of {total} looks come after the end"] if late else [])
