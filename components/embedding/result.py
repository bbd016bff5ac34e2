"""The result of one call: where planes were detected, by which sensors, how surely."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from components.messages.contributors import sensor_names_in_mask
from components.messages.detections import Detections
from components.messages.fused import FusedDetections
from dsa_des.arrays.types import FloatArray
from dsa_des.block.message import Message
from dsa_des.text.safe_text import shorten

_NAN = math.nan
_MOST_LINES = 9


@dataclass(frozen=True)
class Sighting:
    """What one call found of one plane, or one false alarm.

    Parameters
    ----------
    name : str
        Empty for a false alarm.
    azimuth_rad, elevation_rad : float
        In the ownship's body axes, azimuth clockwise from the nose and elevation upward; NaN when
        it was not detected.
    range_m : float
        Slant range; NaN when no contributing sensor measures it.
    sensors : tuple of str
        Those whose detections were put together; empty when it was not detected.
    confidence : dict of float
        Of each sensor that detected it in this call: its margin over the threshold, in the unit of
        the sensor (dB for radar, signature for cameras).
    """

    name: str
    azimuth_rad: float = _NAN
    elevation_rad: float = _NAN
    range_m: float = _NAN
    sensors: tuple[str, ...] = ()
    confidence: Mapping[str, float] = field(default_factory=dict)

    @property
    def detected(self) -> bool:
        """Return whether at least one sensor detected the plane in this call."""
        return bool(self.sensors)

    @property
    def polar(self) -> tuple[float, float, float]:
        """Azimuth, elevation (rad), range (m) in own body axes; NaN where not measured."""
        return self.azimuth_rad, self.elevation_rad, self.range_m


@dataclass(frozen=True, eq=False, repr=False)
class EncounterResult:
    """Result of one call of `simulate`; indexing by plane name or position gives its sighting.

    Parameters
    ----------
    time_s : float
    sightings : tuple of Sighting
        One for each plane of the call, in the order in which planes were added.
    false_alarms : tuple of Sighting
        They belong to no plane; a call for one plane reports none.
    scans : dict of int
        Number of the scan that each sensor made in this call; sensors that are not due are absent.
    missed : dict of int
        Earlier scans that fell between the calls and were not made.
    messages : dict of Message
        What each block sent, in full.
    """

    time_s: float
    sightings: tuple[Sighting, ...]
    false_alarms: tuple[Sighting, ...]
    scans: Mapping[str, int]
    missed: Mapping[str, int]
    messages: Mapping[str, Message]

    def __repr__(self) -> str:
        lines = [_sighting_text(one) for one in (*self.sightings, *self.false_alarms)]
        if len(lines) > _MOST_LINES:
            lines = [*lines[: _MOST_LINES - 1], f"... {len(lines) - _MOST_LINES + 1} more"]
        scans = ", ".join(f"{name} {number}" for name, number in self.scans.items()) or "none"
        return "\n  ".join([f"EncounterResult at {self.time_s:.10g} s, scans: {scans}", *lines])

    def __len__(self) -> int:
        return len(self.sightings)

    def __iter__(self) -> Iterator[Sighting]:
        return iter(self.sightings)

    def __getitem__(self, plane: str | int) -> Sighting:
        if isinstance(plane, int):
            return self.sightings[plane]
        for sighting in self.sightings:
            if sighting.name == plane:
                return sighting
        raise KeyError(plane)

    @cached_property
    def detected(self) -> FloatArray:
        """Azimuth, elevation (rad) and range (m) by plane, (planes, 3); NaN if not detected."""
        return np.array([sighting.polar for sighting in self.sightings]).reshape(-1, 3)


def _sighting_text(one: Sighting) -> str:
    """Return one line of text on a sighting: name, azimuth, elevation, range and sensors."""
    name = shorten(one.name) or "false alarm"
    if not one.detected:
        return f"{name}: not detected"
    azimuth, elevation = math.degrees(one.azimuth_rad), math.degrees(one.elevation_rad)
    range_m = "" if math.isnan(one.range_m) else f", range {one.range_m:,.1f} m"
    seen = ", ".join(one.sensors)
    return f"{name}: azimuth {azimuth:.2f}°, elevation {elevation:.2f}°{range_m}, by {seen}"


def sightings_and_false_alarms(
    fused: FusedDetections | None, detections: Mapping[str, Detections]
) -> tuple[dict[int, Sighting], tuple[Sighting, ...]]:
    """Return detected planes' sightings by the planes' index, and sightings that are false alarms.

    From one row of each message of a call; `fused` is None when no sensor reported.
    """
    seen: dict[int, Sighting] = {}
    false: list[Sighting] = []
    if fused is None:
        return seen, ()
    margins = {
        sensor: dict(zip(m.target.tolist(), m.confidence.tolist(), strict=True))
        for sensor, m in detections.items()
    }
    for target, p, q, r, mask in zip(
        fused.target.tolist(),
        fused.azimuth_rad.tolist(),
        fused.elevation_rad.tolist(),
        fused.range_m.tolist(),
        fused.contributors.tolist(),
        strict=True,
    ):
        sensors = sensor_names_in_mask(mask, fused.sensors)
        if target < 0:
            false.append(Sighting("", p, q, r, sensors))
            continue
        confidence = {s: m[target] for s, m in margins.items() if target in m}
        seen[target] = Sighting(fused.roster.names[target], p, q, r, sensors, confidence)
    return seen, tuple(false)
