"""A scanning laser that ranges by time of flight (``laser.scanning``), and its ladder."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from components.atmosphere.infrared import haze_extinction_ratio_at
from components.atmosphere.visibility import KOSCHMIEDER
from components.geometry import sector_width_rad, unit_vector
from components.laser.range_equation import (
    beam_share_on_target,
    beam_share_on_wire,
    mean_shots_on_target,
    received_laser_power_w,
    scan_detection_probability,
)
from components.optical.area_of_cells import area_of_cells
from components.optical.detection import detection_probability, deviations_of_exceedance
from components.optical.weather_effects import (
    TRANSMISSION,
    CellsInTheWay,
    haze_visibility_and_rain_extinction,
)
from components.radar.beam import BeamSweep, SweepingSensor
from components.radar.measurement import range_variance
from components.sensor.cued_looks import refuse_if_cued
from components.sensor.ladder_values import make_cell_measure
from components.sensor.look import Cells, Look, effect_values_of_cells
from components.sensor.palette import LASER
from components.sensor.parameters import RangeErrorParameters, SensorParameters
from components.sensor.sensor import CUED_INPUTS
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.block.ladder import Ladder, Quantity, Rung, Unavailable

_PD = Quantity("detection_probability", "Pd")
# So many standard deviations of noise are no more than any laser's echo.
_STRONGEST = 1e12


class LaserParameters(RangeErrorParameters, SensorParameters):
    """Parameters of a scanning laser."""

    may_change: ClassVar[tuple[str, ...]] = (
        "peak_power_w", "efficiency", "noise_equivalent_power_w", "false_alarm_probability",
        "hits_needed",
    )  # fmt: skip

    errors: Literal["grid", "stated", "signal"] = Field(  # type: ignore[assignment]
        default="signal",
        description="What measured values err by: 'grid', rounding to the grid alone; 'stated', "
        "the standard deviations and biases that the scene gives; 'signal', those that follow from "
        "the pulse, the echo's strength and the beam's width, beside the stated ones.",
    )
    quantised: bool = Field(
        default=False,
        description="Whether values with errors other than 'grid' are rounded to the grid too.",
    )
    range_km: float = Field(gt=0, description="Farthest range that is looked at, km.")
    azimuth_shots: int = Field(gt=0, description="Shots across the field of view in a scan.")
    elevation_shots: int = Field(gt=0, description="Shots from its lower to its upper edge.")
    pattern: Literal["scanned", "one_shot"] = Field(
        default="scanned",
        description="Whether the shots that meet a target follow from the scan's pattern, or each "
        "scan has one shot at it.",
    )
    beam_sweep: bool = Field(
        default=False,
        description="Whether columns of shots follow each other clockwise through the scan: each "
        "target is measured at the instant at which its column is shot, which is recorded.",
    )
    wavelength_um: float = Field(
        default=1.55, ge=0.4, le=2.5, description="Wavelength, µm; for haze and fog."
    )
    divergence_mrad: float = Field(gt=0, le=100, description="Full angle of the beam, mrad.")
    peak_power_w: float = Field(gt=0, description="Peak power of a pulse, W.")
    pulse_ns: float = Field(gt=0, le=1000, description="Length of a pulse, ns.")
    aperture_mm: float = Field(gt=0, description="Diameter of the receiver, mm.")
    efficiency: float = Field(
        default=0.5, gt=0, le=1, description="Of transmitter and receiver together."
    )
    noise_equivalent_power_w: float = Field(
        gt=0, description="Standard deviation of the receiver's noise, as optical power, W."
    )
    false_alarm_probability: float = Field(
        default=1e-9, gt=0, lt=0.5, description="Probability that noise passes for an echo."
    )
    hits_needed: int = Field(
        default=1, ge=1, le=1000, description="Shots of a scan that must detect a target."
    )

    @model_validator(mode="after")
    def _check_edges(self) -> Self:
        low, high = self.azimuth_deg
        if low > 0.0 > high and high - low + 360.0 > 180.0:
            raise ValueError(
                f"azimuth_deg is [{low:g}, {high:g}]: clockwise from the first to the second that "
                f"is {high - low + 360.0:g} deg wide; allowed: [{high:g}, {low:g}], or "
                f"[{low:g}, {high + 360.0:g}] where all that is meant"
            )
        return self

    @model_validator(mode="after")
    def _check_pulse_rate(self) -> Self:
        rate_hz = float(self.scan_rate_hz) * self.azimuth_shots * self.elevation_shots
        farthest_km = 299_792.458 / (2.0 * rate_hz)
        if self.range_km > farthest_km:
            raise ValueError(
                f"range_km is {self.range_km:g}: {self.azimuth_shots} x {self.elevation_shots} "
                f"shots at {float(self.scan_rate_hz):g} scans/s are {rate_hz:,.0f} pulses/s, whose "
                f"echoes are unambiguous to {farthest_km:.4g} km; allowed: at most that"
            )
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return the base class's notes, and one more if a single shot must give several hits."""
        said = super().ineffective_key_notes()
        if self.pattern == "one_shot" and self.hits_needed > 1:
            said.append("hits_needed is more than the one shot of a scan: nothing is detected")
        return said


EXTINCTION = Hook("extinction", float, "extinction by the air at the laser's wavelength, 1/m")


def _extinction_per_m(block: Any) -> float:
    haze_m, rain_per_m = haze_visibility_and_rain_extinction(block.context.sections["weather"])
    if haze_m is None:
        return rain_per_m
    share = float(haze_extinction_ratio_at(haze_m, block.p.wavelength_um))
    return rain_per_m + KOSCHMIEDER / haze_m * share


class LaserExtinction(Effect[float]):
    """Pulse attenuation by haze, fog and rain, out and back (Kruse's law, Kim's exponent)."""

    name = "laser extinction"
    acts_on = EXTINCTION
    builds = _extinction_per_m

    def verdict(self, block: Any) -> Verdict:
        """Return whether air attenuates pulses: needs visibility, fog or rain in ``[weather]``."""
        per_m = _extinction_per_m(block)
        if not per_m:
            return Verdict(False, "[weather] has no visibility_km, no rain and no fog")
        return Verdict(True, f"[weather] takes {per_m * 1e4 / math.log(10.0):.3g} dB/km")


def _detection_probability_column(sensor: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return cells' detection probability as a column; for a range boundary 1 or 0."""
    if isinstance(sensor, ScanningLaser):
        return {_PD.name: sensor.detection_probability(cells)}
    return {_PD.name: np.where(sensor.look(cells).detected, 1.0, 0.0)}


def _boundary_settings(block: Mapping[str, Any]) -> dict[str, Any]:
    if not block.get("range_km"):
        raise Unavailable("needs range_km to put the boundary at")
    beam_deg = math.degrees(1e-3 * block["divergence_mrad"])
    return {
        "range_km": block["range_km"], "range_resolution_m": 0.15 * block["pulse_ns"],
        "azimuth_resolution_deg": beam_deg, "elevation_resolution_deg": beam_deg,
    }  # fmt: skip


SHOTS = Ladder(
    "shots",
    (
        Rung("range_boundary", "all inside range_km", "radar.range_boundary", _boundary_settings),
        Rung("one_shot", "one shot a scan at each target", parameters={"pattern": "one_shot"}),
        Rung("scanned", "the shots of the scan's pattern", parameters={"pattern": "scanned"}),
    ),
    "scanned",
    (_PD,),
    make_cell_measure(_detection_probability_column, out_of_range=0.0),
)


class ScanningLaser(SweepingSensor):
    """A laser that scans a narrow field and ranges by time of flight.

    Echoes follow the laser range equation (`components.laser.range_equation`) for a target larger
    than the beam, a small one and a wire; each aircraft's ``laser`` says what is hit. A shot's
    amplitude is detected where with Gaussian noise it reaches the threshold of
    ``false_alarm_probability``; a scan detects by ``hits_needed`` of the shots that its pattern
    puts on the target. ``snr_db`` is 20 lg of the strongest echo's amplitude over noise, confidence
    that over the threshold in dB. With ``errors = "signal"`` range errs by pulse length over
    amplitude, and angles by anywhere in the beam. Isolated false alarms are not reported: systems
    reject them pixel by pixel.
    """

    mark = LASER
    measures_range = True
    Parameters = LaserParameters
    inputs = CUED_INPUTS
    hooks = (EXTINCTION, TRANSMISSION)
    effects: ClassVar[tuple[Effect, ...]] = (LaserExtinction(), CellsInTheWay(), BeamSweep())
    ladders = (SHOTS,)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.divergence_rad = 1e-3 * parameters.divergence_mrad
        #: Amplitude that is detected, in standard deviations of the receiver's noise.
        self.threshold = deviations_of_exceedance(parameters.false_alarm_probability)
        width = sector_width_rad(*self.reach.azimuth_rad)
        height = self.reach.elevation_rad[1] - self.reach.elevation_rad[0]
        self._spacing_rad2 = width / parameters.azimuth_shots * height / parameters.elevation_shots
        self._draws = self.stream("shots")
        self._extinction_per_m = 0.0

    def setup(self) -> None:
        """Store the air's attenuation of pulses, and raise if the scanner is wired to cues."""
        refuse_if_cued(self, "its pattern is fixed, with one threshold")
        self._extinction_per_m = self.built_one(EXTINCTION) or 0.0

    def snr_and_shots(self, cells: Cells) -> tuple[FloatArray, FloatArray]:
        """Return each cell's ratio of echo amplitude to noise in a shot, and a scan's mean hits."""
        column = cells.roster.column
        thick_m = 1e-3 * cells.column_at_targets(column("laser.wire_diameter_mm"))
        wire = np.isfinite(thick_m)
        thick_m = np.where(wire, thick_m, 0.0)
        area_m2 = cells.column_at_targets(column("laser.area_m2"))
        if np.isnan(area_m2[~wire]).any():
            area_m2 = np.where(np.isnan(area_m2), area_of_cells(cells, "eo", "exact"), area_m2)
        area_m2 = np.where(wire, 0.0, area_m2)
        # A wire that runs away from us shows less of its length, and is lit at a slant.
        slant = _sine_to_wire(cells) if wire.any() else np.ones(len(cells))
        range_m, beam_rad = cells.range_m, self.divergence_rad
        share = np.where(
            wire,
            slant * beam_share_on_wire(thick_m, range_m, beam_rad),
            beam_share_on_target(area_m2, range_m, beam_rad),
        )
        power_w = received_laser_power_w(
            share, range_m, peak_power_w=self.p.peak_power_w,
            aperture_m=1e-3 * self.p.aperture_mm, efficiency=self.p.efficiency,
            reflectivity=cells.column_at_targets(column("laser.reflectivity")),
            extinction_per_m=self._extinction_per_m,
        )  # fmt: skip
        for left in self.built(TRANSMISSION):
            power_w = power_w * effect_values_of_cells(self, left, cells) ** 2
        snr = np.minimum(power_w / self.p.noise_equivalent_power_w, _STRONGEST)
        if self.p.pattern == "one_shot":
            return snr, np.ones(len(cells))
        length_m = np.where(wire, cells.column_at_targets(column("laser.wire_length_m")), 0.0)
        length_rad = slant * length_m / range_m
        # Rows of shots are as far apart everywhere, columns nearer to each other up and down.
        _, elevation = self.axes(cells.body_azimuth_rad, cells.body_elevation_rad)
        shots = mean_shots_on_target(
            np.where(wire, length_rad * thick_m / range_m, area_m2 / range_m**2),
            0.25 * math.pi * beam_rad * np.where(wire, length_rad, beam_rad),
            self._spacing_rad2 * np.maximum(np.cos(elevation), 1e-6),
        )
        return snr, shots

    def detection_probability(self, cells: Cells) -> FloatArray:
        """Return the probability that a scan detects each cell's target."""
        return self._scan_detection_probability(*self.snr_and_shots(cells))

    def _scan_detection_probability(self, snr: FloatArray, shots: FloatArray) -> FloatArray:
        pd: FloatArray = scan_detection_probability(
            snr, shots, threshold=self.threshold, needed=self.p.hits_needed
        )
        return pd

    def look(self, cells: Cells) -> Look:
        """Draw for each cell whether one scan detects the target, and the strength of its echo."""
        from scipy.special import ndtri

        snr, shots = self.snr_and_shots(cells)
        probability = self._scan_detection_probability(snr, shots)
        drawn = 1.0 - cells.draws(self._draws)
        detected = drawn <= probability
        # What crossed the threshold, by the share of such echoes that come out stronger.
        one = detection_probability(snr, self.threshold, 1.0)
        tail = one * np.where(detected, drawn / np.where(detected, probability, 1.0), 1.0)
        with np.errstate(divide="ignore"):
            strength = np.where(detected, snr - ndtri(tail), self.threshold)
        strength = np.maximum(strength, self.threshold)
        snr_db = 20.0 * np.log10(strength)
        extras: dict[str, AnyArray] = {"snr_db": snr_db}
        if self._is_every_look_recorded:
            extras["detection_probability"] = probability
        above_db = snr_db - 20.0 * math.log10(self.threshold)
        return Look(detected, above_db, extras, {"amplitude": strength})

    def _extra_columns(self, cells: Cells, look: Look) -> Mapping[str, Any]:
        """Return a detection's recorded columns, without the simulation's detection probability."""
        extras = dict(super()._extra_columns(cells, look))
        extras.pop("detection_probability", None)
        return extras

    def signal_variances(self, signal: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return variances of azimuth, elevation (beam width), range (pulse length, amplitude)."""
        amplitude = signal["amplitude"]
        angle = np.full(len(amplitude), self.divergence_rad**2 / 12.0)
        pulse_m = 0.5 * 0.299792458 * self.p.pulse_ns
        return {
            "azimuth": angle, "elevation": angle, "range": range_variance(pulse_m, amplitude**2)
        }  # fmt: skip

    def report(self) -> dict[str, Any]:
        """Return the threshold and the rate of pulses in use."""
        pulses = self.p.azimuth_shots * self.p.elevation_shots * float(self.p.scan_rate_hz)
        used = {"threshold": self.threshold, "pulse_rate_hz": pulses}
        return {**super().report(), "lasers": {self.name: used}}


def _sine_to_wire(cells: Cells) -> FloatArray:
    """Return the sine of the angle between each cell's line of sight and its wire."""
    direction, slope = (
        np.radians(cells.column_at_targets(cells.roster.column(f"laser.wire_{name}_deg")))
        for name in ("direction", "slope")
    )
    along = np.stack(unit_vector(direction, slope))
    sight = np.stack(unit_vector(cells.azimuth_rad, cells.elevation_rad))
    cosine = (along * sight).sum(axis=0)
    return np.asarray(np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))
