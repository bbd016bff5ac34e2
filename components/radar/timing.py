"""The time that a scan takes, beam by beam, and the energy that is left for a look."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from components.arguments.units import SPEED_OF_LIGHT_M_S
from components.radar.pulse_trains.ambiguity import unambiguous_range_m
from components.radar.pulse_trains.keys import PulseTrainParameters
from components.radar.resolution import ResolutionParameters, steps_across
from dsa_des.block.effect import Effect, Hook, Verdict

# A dwell that is a whole number of pulses up to rounding has that many.
_ROUNDING = 1e-9


class BeamPositions(NamedTuple):
    """How many beams fill a field of view, side by side and one above the other."""

    azimuth: int
    elevation: int

    @property
    def number(self) -> int:
        """Number of beam positions of a scan."""
        return self.azimuth * self.elevation


def whole_pulses_in_dwell(dwell_s: float, prf_hz: float) -> int:
    """Return the number of whole pulse intervals in a dwell, 0 or more."""
    return math.floor(dwell_s * prf_hz * (1.0 + _ROUNDING))


def check_unambiguous(prf_hz: float, range_km: float) -> None:
    """Raise ValueError if echoes from a range come after the next pulse has left."""
    reach_m = unambiguous_range_m(prf_hz)
    if range_km * 1000.0 > reach_m:
        highest_hz = 1.0 / round_trip_s(range_km * 1000.0)
        raise ValueError(
            f"prf_hz is {prf_hz:g}: echoes are unambiguous up to {reach_m / 1000:.4g} km "
            f"and range_km is {range_km:g}; it must be at most {_format_rounded_down(highest_hz)}"
        )


def round_trip_s(range_m: float) -> float:
    """Return the time an echo takes from a range, s."""
    return 2.0 * range_m / SPEED_OF_LIGHT_M_S


#: More pulses than this are not summed: Pd was checked up to here.
MOST_PULSES_SUMMED = 1000
# 7 dB are the 5 pulses of which they are 6.99 dB.
_ROUNDED_DB = 0.05


@dataclass(frozen=True)
class LookEnergy:
    """The beams, time and pulses of one look at a target.

    `pulses` is None without a PRF. `gain` is that of the energy added up coherently over that of
    the look which the link budget is for, 1 where pulses are summed non-coherently, `summed` of
    them.
    """

    beams: BeamPositions
    dwell_s: float
    pulses: int | None
    gain: float
    summed: int


class TimeBudgetParameters(PulseTrainParameters, ResolutionParameters):
    """Parameters of how a radar's scan time is divided among its beams."""

    budget: Literal["free", "dwell"] | None = Field(
        default=None,
        description="'dwell': the time that a scan leaves each beam makes the energy of a look; "
        "'free': a scan takes no time (the thesis's). By default free, but a scan rate that the "
        "stated beams and dwell cannot do is refused.",
    )
    beam_spacing: float = Field(
        default=1.0, gt=0, le=2, description="From beam to beam of a scan, in beamwidths."
    )
    beam_shape_loss: bool = Field(
        default=False,
        description="Whether a target loses what lies off the beam's axis: that between the "
        "scan's beam positions, and the mean over a sweep. The link budget, and a range that "
        "calibrates it, are of a target amid the beam.",
    )
    dwell_s: float | None = Field(
        default=None,
        gt=0,
        description="Time on one beam of the look that the link budget describes, s.",
    )
    pulses_per_dwell: int | None = Field(
        default=None,
        ge=1,
        le=1_000_000,
        description="Pulses of that look instead of its time; with budget = 'dwell' 1 by default.",
    )
    integration: Literal["coherent", "noncoherent"] = Field(
        default="coherent",
        description="How budget = 'dwell' adds up the pulses of a look: in amplitude (gain n), or "
        "in power (Pd of n pulses).",
    )

    @model_validator(mode="after")
    def _check_scan_time_keys(self) -> Self:
        if self.beam_shape_loss and self.beams is None:
            raise ValueError(
                "beam_shape_loss is true and azimuth_beamwidth_deg and elevation_beamwidth_deg "
                "are not given: the loss is that of a beam"
            )
        if self.dwell_s is not None and self.pulses_per_dwell is not None:
            raise ValueError("dwell_s and pulses_per_dwell say the same: give one of them")
        if self.pulses_per_dwell is not None and self.prf_hz is None:
            raise ValueError("pulses_per_dwell is given and prf_hz is not: how long is the dwell?")
        self._check_pulse_interval()
        beams = self.beams
        if self.budget == "dwell":
            self._check_dwell_budget()
        if self.budget != "free" and beams is not None:
            self._check_scan_rate(beams)
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of a time budget or of beams that are switched off."""
        said = super().ineffective_key_notes()
        if self.budget != "dwell":
            because = f"budget is {'not given' if self.budget is None else repr(self.budget)}"
            said += self.note_ineffective("integration", because=because)
        if self.azimuth_beamwidth_deg is None:
            said += self.note_ineffective(
                "beam_spacing", because="azimuth_beamwidth_deg is not given"
            )
        return said

    @property
    def beams(self) -> BeamPositions | None:
        """The beam positions that search the field of view, where beamwidths are given.

        Their number is the solid angle searched over that of a beam, ``n_B = (Θ_A Θ_E) / (θ_a
        θ_e)``, and a scan takes ``T = n_B · dwell``: B. R. Mahafza and A. Z. Elsherbeni, *MATLAB
        Simulations for Radar Systems Design*, 2004, section 1.8, eq. 1.61-1.65. Here each axis is
        rounded up to whole beams, as a radar steps them. A beam that sweeps goes through one column
        of beams after the other, so that it lights an azimuth once per scan.
        """
        if self.azimuth_beamwidth_deg is None or self.elevation_beamwidth_deg is None:
            return None
        beams_deg = self.azimuth_beamwidth_deg, self.elevation_beamwidth_deg
        axes = zip(self.reach().width_rad, map(math.radians, beams_deg), strict=True)
        return BeamPositions(*(steps_across(width, self.beam_spacing * one) for width, one in axes))

    def _dwell_s(self, beams: BeamPositions) -> float:
        """Return the dwell time on each beam position if a scan visits each once, s."""
        return 1.0 / (float(self.scan_rate_hz) * beams.number)

    @property
    def stated_dwell_s(self) -> float | None:
        """Dwell time of the look for which the link budget is stated, s; None if not stated."""
        if self.pulses_per_dwell is not None and self.prf_hz is not None:
            return self.pulses_per_dwell / self.prf_hz
        return self.dwell_s

    @property
    def stated_pulses(self) -> int | None:
        """Number of pulses in the look for which the link budget is stated; None if not known."""
        if self.pulses_per_dwell is not None or self.prf_hz is None:
            return self.pulses_per_dwell
        if self.dwell_s is not None:
            return whole_pulses_in_dwell(self.dwell_s, self.prf_hz)
        return 1 if self.budget == "dwell" else None

    @property
    def look_energy(self) -> LookEnergy | None:
        """Beams, dwell time and pulses of a look with ``budget = 'dwell'``; else None."""
        beams = self.beams
        if self.budget != "dwell" or beams is None:
            return None
        # Each PRF has a dwell of its own.
        dwell_s = self._dwell_s(beams) / (1 + len(self.other_prfs_hz))
        if self.prf_hz is None or self.stated_pulses is None:
            return LookEnergy(beams, dwell_s, None, dwell_s / (self.dwell_s or dwell_s), 1)
        pulses = whole_pulses_in_dwell(dwell_s, self.prf_hz)
        if self.integration == "noncoherent":
            return LookEnergy(beams, dwell_s, pulses, 1.0, pulses)
        return LookEnergy(beams, dwell_s, pulses, pulses / self.stated_pulses, 1)

    def _check_pulse_interval(self) -> None:
        if self.prf_hz is None:
            return
        if self.range_km is not None and not self.range_folds:
            check_unambiguous(self.prf_hz, self.range_km)
        if self.dwell_s is not None and whole_pulses_in_dwell(self.dwell_s, self.prf_hz) < 1:
            raise ValueError(
                f"dwell_s is {self.dwell_s:g}: it must hold a pulse, so with prf_hz "
                f"{self.prf_hz:g} be at least {1.0 / self.prf_hz:g}"
            )

    def _check_dwell_budget(self) -> None:
        if self.azimuth_beamwidth_deg is None:
            raise ValueError(
                "budget is 'dwell' and azimuth_beamwidth_deg and elevation_beamwidth_deg are not "
                "given: how many beams share a scan?"
            )
        if self.prf_hz is None and self.dwell_s is None:
            raise ValueError(
                "budget is 'dwell' and neither prf_hz nor dwell_s is given: which look does the "
                "link budget describe?"
            )
        if self.integration == "noncoherent" and self.prf_hz is None:
            raise ValueError(
                "integration is 'noncoherent' and prf_hz is not given: how many pulses are summed?"
            )

    def _shortest_dwell_and_reason(self) -> tuple[float, str] | None:
        """Return the shortest time on a beam (s) and its reason; None if none is known."""
        if self.budget is None and (stated_s := self.stated_dwell_s) is not None:
            return stated_s, "its dwell"
        if self.prf_hz is not None:
            return 1.0 / self.prf_hz, "one pulse interval"
        if self.budget == "dwell" and self.range_km is not None:
            return round_trip_s(self.range_km * 1000.0), "one echo from range_km"
        return None

    def _check_scan_rate(self, beams: BeamPositions) -> None:
        if (least := self._shortest_dwell_and_reason()) is None:
            return
        least_s, what = least
        if self.other_prfs_hz:
            least_s, what = least_s * len(self.prfs_hz), f"{what} at each PRF"
        available_s = self._dwell_s(beams)
        if available_s * (1.0 + 1e-9) < least_s:
            free = "" if self.budget == "dwell" else ", or budget 'free' for a scan without cost"
            raise ValueError(
                f"scan_rate_hz is {float(self.scan_rate_hz):g}: {beams.azimuth} x "
                f"{beams.elevation} beams of {least_s:.4g} s ({what}) take "
                f"{least_s * beams.number:.4g} s, and a scan has "
                f"{1.0 / float(self.scan_rate_hz):.4g} s; it must be at most "
                f"{_format_rounded_down(1.0 / (least_s * beams.number))}{free}"
            )
        look = self.look_energy
        if look is not None and look.summed > MOST_PULSES_SUMMED:
            raise ValueError(
                f"integration is 'noncoherent' and a look has {look.summed} pulses: at most "
                f"{MOST_PULSES_SUMMED} can be summed; lower prf_hz or raise scan_rate_hz"
            )

    def check_pulses_once(self, pulses: int, integration_gain_db: float) -> None:
        """Raise ValueError if pulses count twice or exceed the stated look's (errata 6)."""
        if self.budget == "dwell" and pulses > 1:
            raise ValueError(
                f"pulses is {pulses} and budget is 'dwell', which counts the pulses of a look "
                "itself: leave pulses out, with integration = 'noncoherent' to have them summed"
            )
        if self.budget == "dwell" and self.integration == "noncoherent" and integration_gain_db > 0:
            raise ValueError(
                f"integration_gain_db is {integration_gain_db:g} and integration is 'noncoherent': "
                "that would count the same pulses twice; set it to 0"
            )
        if self.budget == "free" or (known := self.stated_pulses) is None:
            return
        most_db = 10.0 * math.log10(known)
        if integration_gain_db > most_db + _ROUNDED_DB:
            hint = "; budget 'dwell' adds the gain of a look's pulses by itself"
            raise ValueError(
                f"integration_gain_db is {integration_gain_db:g}: the look that the link budget "
                f"describes has {known} pulse{'s' * (known > 1)}, which give at most "
                f"{most_db:.3g} dB{hint if self.budget == 'dwell' else ''}"
            )
        if pulses > known:
            raise ValueError(
                f"pulses is {pulses}: a dwell at prf_hz {self.prf_hz:g} has {known}; it must be at "
                "most that"
            )


def _format_rounded_down(value: float) -> str:
    """Return a number with four digits, rounded down, so that it still satisfies the limit."""
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return f"{math.floor(value / step) * step:.4g}"


LOOK_ENERGY = Hook("energy of a look", LookEnergy, "what the time of a scan leaves for each beam")


class TimeBudget(Effect[LookEnergy]):
    """Energy of a look from the time that a scan leaves for each beam.

    A radar's link budget then differs with its scan rate, so replicas that differ in it have
    instances of their own.
    """

    name = "time budget"
    acts_on = LOOK_ENERGY
    outside_the_proof = "with it the link budget is that of another look"

    def verdict(self, block: Any) -> Verdict:
        """Return whether the scan's time is shared among beams: needs ``budget = 'dwell'``."""
        p = block.p
        if (look := p.look_energy) is not None:
            pulses = "" if look.pulses is None else f", pulses in it: {look.pulses}"
            return Verdict(
                True,
                f"budget is 'dwell': {look.beams.azimuth} x {look.beams.elevation} beams of "
                f"{look.dwell_s * 1000:.4g} ms each{pulses}",
            )
        if p.budget == "free":
            return Verdict(False, "budget is 'free'")
        beams, dwell_s = p.beams, p.stated_dwell_s
        if beams is None or dwell_s is None:
            return Verdict(False, "beams and dwell are not given, a scan takes no time")
        return Verdict(
            False,
            f"every look has the stated dwell: {beams.azimuth} x {beams.elevation} beams of "
            f"{dwell_s * 1000:.4g} ms fit into a scan",
        )

    def build(self, block: Any) -> LookEnergy:
        """Return the pulses and energy of a look."""
        look: LookEnergy = block.p.look_energy
        return look


def time_report(name: str, parameters: Any) -> dict[str, Any]:
    """Return the section of the run's summary that says what a scan's time is spent on."""
    if (look := parameters.look_energy) is None:
        return {}
    return {
        "time_budgets": {
            name: {
                "beams": look.beams.number,
                "dwell_s": look.dwell_s,
                "pulses": look.pulses,
                "summed": look.summed,
                "gain": look.gain,
            }
        }
    }
