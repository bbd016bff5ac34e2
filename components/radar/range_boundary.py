"""The crudest radar: all inside its range is detected (``radar.range_boundary``, §2.2.2)."""

from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from components.radar.beam_effects import BeamSweep
from components.radar.cfar_effects import Averaging, CellAveraging
from components.radar.clutter_effects import (
    BoundaryClutter,
    Echo,
    RainClutter,
    SidelobeClutter,
    terrain_of,
)
from components.radar.doppler_effects import DopplerFilter
from components.radar.ladder import DETECTION
from components.radar.parameters import RadarParameters
from components.radar.plausible import clutter_as_signal
from components.radar.radar_block import Radar
from components.radar.radar_equation import SPEED_OF_LIGHT_M_S
from components.radar.range_effects import BlindRange
from components.radar.required_snr import required_snr
from components.radar.resolution_effects import OneReportByCell
from components.radar.time_budget import unambiguous_range_m
from components.radar.weather_effects import WEATHER_EFFECTS, deaf_to_weather, said_of_rain
from components.sensor.cued_looks import CUED_INPUTS, refuse_cues
from components.sensor.look import Cells, Look
from dsa_des.arrays.types import FloatArray


class RangeBoundaryParameters(RadarParameters):
    """Parameters of a range boundary radar."""

    range_km: float = Field(gt=0, description="Range inside which every target is detected, km.")
    minimum_range_m: float | None = Field(
        default=None, gt=0, description="Closer than this nothing is detected, m; none by default."
    )
    boundary_rcs_dbsm: float = Field(
        default=0.0,
        ge=-100,
        le=100,
        description="Target that the range is stated for, dBsm; used with clutter and rain only.",
    )
    boundary_pd: float = Field(
        default=0.9,
        gt=0,
        lt=1,
        description="Pd at that range (Swerling I); used with clutter, rain and CFAR only.",
    )
    false_alarm_probability: float = Field(
        default=1e-6,
        gt=0,
        lt=1,
        description="Probability of false alarm that goes with it; used as boundary_pd is.",
    )

    frequency_hz: float | None = Field(
        default=None,
        gt=0,
        description="Carrier, Hz; for weather, a moving_target_filter and range_rate_folds.",
    )
    prf_hz: float | None = Field(
        default=None,
        gt=0,
        description="Pulse repetition frequency, Hz; as frequency_hz.",
    )

    @model_validator(mode="after")
    def _carrier(self) -> Self:
        for key, off in (("moving_target_filter", "none"), ("range_rate_folds", False)):
            if getattr(self, key) != off and self.frequency_hz is None:
                raise ValueError(
                    f"{key} is {getattr(self, key)!r} and frequency_hz is not given: blind speeds "
                    "and the unambiguous velocity follow from it"
                )
        if self.prf_hz is not None and self.range_km * 1000.0 > unambiguous_range_m(self.prf_hz):
            raise ValueError(
                f"prf_hz is {self.prf_hz:g}: echoes are unambiguous up to "
                f"{unambiguous_range_m(self.prf_hz) / 1000:.4g} km and range_km is "
                f"{self.range_km:g}; lower one of them"
            )
        return self

    @property
    def pulses_summed(self) -> int:
        """One look."""
        return 1


class RangeBoundary(Radar):
    """Detects every target inside its range, as the DUT/NLDA simulator's radar did.

    Confidence is 40·log10(range limit / range), the SNR margin in dB that a radar would have
    whose threshold lies at the limit.

    Ground clutter brings the boundary nearer: for the target that it is stated for, the noise at
    the boundary has that target's echo over the SNR that `boundary_pd` needs; the ground's echo
    comes on top of it, and a threshold from reference cells needs the CFAR loss more. A
    moving-target filter changes both echoes. With ``frequency_hz`` it obeys the weather: air and
    rain take from both, and rain echoes as the ground does.
    """

    Parameters = RangeBoundaryParameters
    inputs = CUED_INPUTS
    lockstep = True
    hooks = {
        "clutter": "(cells) -> RCS in m² of what else echoes in each cell's resolution cell",
        "threshold from reference cells": "Pd, required SNR and loss of a CFAR detector",
    }
    effects = (
        *WEATHER_EFFECTS,
        BlindRange(),
        BoundaryClutter(),
        RainClutter(),
        SidelobeClutter(),
        DopplerFilter(),
        CellAveraging(),
        OneReportByCell(),
        BeamSweep(),
    )
    ladders = (DETECTION,)
    _cfar: Averaging | None = None

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        frequency_hz = parameters.frequency_hz
        self._echoes: list[Echo] = []
        self.wavelength_m = None if frequency_hz is None else SPEED_OF_LIGHT_M_S / frequency_hz

    def setup(self) -> None:
        """Take what the scene's effects do to the boundary."""
        super().setup()
        refuse_cues(self)
        self._echoes = self.built("clutter")
        (self._cfar,) = self.built("threshold from reference cells") or [None]

    def warnings(self) -> list[str]:
        """Say that clutter counts as signal, where it does, and what it hears of the weather."""
        return [
            *super().warnings(),
            *clutter_as_signal(self.p, terrain_of(self)),
            *deaf_to_weather(self),
            *said_of_rain(self),
        ]

    def look(self, cells: Cells) -> Look:
        """Detect every cell: the gate has kept those out of range away."""
        # A metre is closer than any radar sees; it keeps the margin finite at range 0.
        ratio = self.reach.range_max_m / np.maximum(cells.range_m, 1.0)
        margin_db = 40.0 * np.log10(ratio)
        detected = np.ones(len(cells), dtype=bool)
        through = np.ones(len(cells))
        for factor in self.snr_factors:
            through = through * factor(cells)
        heard = through > 0.0
        lossy = bool((through[heard] != 1.0).any())
        if lossy or self._echoes or not (self._cfar is self.doppler is None):
            margin_db = self._margin_db(cells, margin_db, np.where(heard, through, 1.0))
            detected = margin_db >= 0.0
        detected &= heard
        # Of equal targets the nearer one has the stronger echo.
        detected &= self.resolved(cells, np.where(detected, ratio**4, 0.0)) > 0.0
        return Look(detected, margin_db)

    def _margin_db(
        self, cells: Cells, over_noise_db: FloatArray, through: FloatArray
    ) -> FloatArray:
        """Return the margin over what is in the cell, in dB, from that over noise."""
        p = self.p
        needed = required_snr(p.boundary_pd, false_alarm_probability=p.false_alarm_probability)
        signal, alone = through, 10.0 ** (-0.1 * over_noise_db)
        noise = alone
        residues: Any = [1.0] * len(self._echoes)
        if self.doppler is not None:
            passed, residues = self.doppler(cells, self._echoes)
            signal = through * passed
        for echo, residue in zip(self._echoes, residues, strict=True):
            clutter = through * residue * echo(cells) * 10.0 ** (-0.1 * p.boundary_rcs_dbsm)
            if p.clutter_threshold == "noise":
                signal = signal + clutter
            else:
                noise = noise + needed * clutter
        # Where nothing is added, no bit is: that margin is the one over noise.
        same = (signal == 1.0) & (noise == alone)
        margin_db: FloatArray = np.where(same, over_noise_db, 10.0 * np.log10(signal / noise))
        if self._cfar is not None:
            margin_db = margin_db - self._cfar.loss_db(p.boundary_pd, "swerling1")
        return margin_db
