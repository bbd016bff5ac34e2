"""A radar that detects with the probability its SNR gives (``radar.swerling``, thesis §4.1.2)."""

import math
from functools import lru_cache, partial
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from components.radar.detection.clutter import clutter_detection_probability
from components.radar.detection.ladder import PD_METHOD, ExactDetection, method_reasons
from components.radar.detection.probability import detection_probability, probability_of_cells
from components.radar.detection.threshold import Crossing
from components.radar.ground_clutter import Clutter, terrain_of
from components.radar.measurement import noise_report_warnings, signal_over_noise_and_clutter
from components.radar.parameters import LinkBudgetParameters
from components.radar.rcs import (
    FADING,
    FLUCTUATION,
    Fading,
    LastingFluctuation,
    ModelsOfCells,
    RcsFluctuation,
    make_swerling_model_lookup,
    sampled_scan_rcs_m2,
    steady_models,
)
from components.radar.threshold_radar import LinkBudgetRadar
from components.radar.weather import WEATHER_EFFECTS
from components.sensor.cued_looks import CUE
from components.sensor.look import Cells, Look, effect_values_of_cells
from dsa_des.arrays.types import FloatArray
from dsa_des.time.gauss_markov import LONGEST_S


class SwerlingParameters(LinkBudgetParameters):
    """Parameters of a radar with probabilistic detection."""

    may_change: ClassVar[tuple[str, ...]] = ("cued_false_alarm_probability", "reference_pd")

    swerling: Literal[0, 1, 2, 3, 4, 5] | None = Field(
        default=None, description="Fluctuation model for all targets; by default each its own."
    )
    fluctuation: Literal["probability", "sampled"] = Field(
        default="probability",
        description="Fluctuation inside Pd, or a sampled RCS (per scan for I and III, per pulse "
        "for II and IV) and a steady target's Pd at it; the same share of detections.",
    )
    fluctuation_correlation_s: float | None = Field(
        default=None,
        gt=0,
        le=LONGEST_S,
        description="How long a sampled RCS lasts, s: the correlation of its power falls as "
        "exp(-2 |dt| / it), whenever it is looked at. By default each scan draws its own.",
    )
    scintillation_extent_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="Extent of a target's scatterers, m: the sampled RCS changes with the aspect, "
        "within about wavelength / (2 extent). By default aspect changes the mean only.",
    )
    model: Literal["auto"] | None = Field(
        default=None,
        description="'auto' has `detection` picked by error and cost, and `explain` say why.",
    )
    detection: Literal["exact", "table", "gram_charlier"] = Field(
        default="exact",
        description="How Pd is computed: exactly, by table (error < 1e-6), or by the thesis's "
        "series (error < 0.03; steady targets only).",
    )
    cued_pulses: int | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="Pulses integrated non-coherently within a cue cone; by default as usual.",
    )
    cued_false_alarm_probability: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Probability of false alarm per look within a cue cone: a larger one lowers "
        "the threshold. By default as usual.",
    )
    reference_pd: float = Field(
        default=0.9, gt=0, lt=1, description="Pd whose SNR is the zero of the confidence."
    )

    @model_validator(mode="after")
    def _check_reference_pd(self) -> Self:
        if self.reference_pd <= self.false_alarm_probability:
            raise ValueError(
                f"reference_pd is {self.reference_pd:g}: it must be above false_alarm_probability, "
                f"{self.false_alarm_probability:g}, which noise alone reaches"
            )
        if self.model == "auto" and self.detection != "exact":
            raise ValueError(
                f"model is 'auto' and detection is {self.detection!r}: leave one of them out"
            )
        if self.cfar_reference_cells is not None and self.detection != "exact":
            raise ValueError(
                f"cfar_reference_cells is {self.cfar_reference_cells} and detection is "
                f"{self.detection!r}: Pd with CFAR is computed exactly; leave one of them out"
            )
        steady = self.samples_rcs or self.swerling in (0, 5)
        if self.detection == "gram_charlier" and not steady:
            raise ValueError(
                f"detection is 'gram_charlier' and swerling is {self.swerling}: the series covers "
                "steady targets only; set swerling to 0, or fluctuation to 'sampled'"
            )
        self._check_cued()
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of a fluctuation that is switched off."""
        said = super().ineffective_key_notes()
        if self.swerling in (0, 5):
            fading = "fluctuation_correlation_s", "scintillation_extent_m"
            said += self.note_ineffective(
                *fading, because=f"swerling is {self.swerling}: nothing fluctuates"
            )
        return said

    def _check_cued(self) -> None:
        given = [
            name
            for name in ("cued_pulses", "cued_false_alarm_probability")
            if getattr(self, name) is not None
        ]
        if given and self.cfar_reference_cells is not None:
            raise ValueError(
                f"{given[0]} and cfar_reference_cells are given: Pd with CFAR is that of one "
                "detector; cue by cued_dwell_factor"
            )
        if self.cued_pulses is not None and self.samples_rcs:
            raise ValueError(
                "cued_pulses is given and the RCS is sampled for the usual pulses; cue by "
                "cued_dwell_factor"
            )

    @property
    def samples_rcs(self) -> bool:
        """Whether an RCS is drawn for each look, so that Pd is that of a steady target."""
        lasting = (self.fluctuation_correlation_s, self.scintillation_extent_m)
        return self.fluctuation == "sampled" or any(given is not None for given in lasting)


class SwerlingRadar(LinkBudgetRadar):
    """Detects each target with its probability of detection for a fluctuating cross-section.

    Ground clutter raises the threshold with it (or counts as signal: ``clutter_threshold``).

    One keyed uniform draw per target and scan decides. With fluctuation 'probability' Pd is that
    of the fluctuating target at its mean SNR; with 'sampled' further keyed draws sample the RCS of
    the scan, and Pd is a steady target's at the SNR it gives. So it is where fluctuation lasts
    (`components.radar.rcs`). Confidence is the SNR (mean, or of the scan) above the SNR at which
    that Pd is `reference_pd`, in dB.

    The approximations of Shnidman and Albersheim are no choice for `detection`: they hold for part
    of the SNR of an encounter only and refuse the rest.
    """

    Parameters = SwerlingParameters
    hooks = (FLUCTUATION, FADING, PD_METHOD)
    effects = (RcsFluctuation(), LastingFluctuation(), ExactDetection(), *LinkBudgetRadar.effects)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        # Until the scene's effects are known, as the targets' own models call for.
        self._models: ModelsOfCells = make_swerling_model_lookup(parameters.swerling)
        self._method: str = parameters.detection
        self._draws = self.stream("detection")
        self._rcs_draws = self.stream("rcs")
        self._fading: Fading | None = None
        self._reference_db: dict[int, float] = {}

    def setup(self) -> None:
        """Store the scene's effects; without fluctuation every target is steady."""
        super().setup()
        self._models = self.built_one(FLUCTUATION) or steady_models
        self._fading = self.built_one(FADING)
        if self.p.detection == "exact":
            self._method = self.built_one(PD_METHOD) or "table"

    def skipped_work_notes(self) -> list[str]:
        """Return a sentence on the chosen Pd method and its reason, where the scene has `auto`."""
        said = [*super().skipped_work_notes(), *noise_report_warnings(self.p)]
        return said if self.p.model is None else [*said, *method_reasons(self, self._method)]

    def warnings(self) -> list[str]:
        """Return the warnings, with one if scans draw fades more often than they change."""
        return [*super().warnings(), *_fade_rate_warnings(self)]

    def relative_range_tolerance(self) -> float:
        """Return the relative range error that changes Pd by no more than ``[accuracy]`` allows.

        SNR goes with the fourth power of range, and Pd changes by max |dPd / d ln SNR| per unit
        of ln SNR at most. Nothing is proven where more than that depends on the line of sight.
        """
        allowed = self.context.tolerance.get("detection_probability")
        if allowed is None:
            return math.inf
        steepness = self.largest_pd_slope()
        others = {
            "aspect RCS",
            "beam shape",
            "rain echo",
            "sidelobe clutter",
            "folded clutter",
            "multipath",
        }
        others |= {effect.name for effect in WEATHER_EFFECTS}
        if steepness is None or others & set(self.context.effects):
            return 0.0
        # |4 ln(1 ± e)| is at most 4 e / (1 - e).
        share = allowed / (4.0 * steepness)
        return share / (1.0 + share)

    def confidence_zero_snr_db(self) -> float:
        """Return the SNR in dB at which Pd is `reference_pd`; confidence is counted from it."""
        return self._snr_at_reference_pd_db((self.p.swerling or 0) % 5)

    def look(self, cells: Cells) -> Look:
        """Draw for each cell whether the target is detected by its probability of detection."""
        snr, clutter = self.received_snr_and_clutter(cells)
        echo = snr > 0.0
        snr_db = 10.0 * np.log10(np.where(echo, snr, np.nan))
        confidence = np.empty(len(cells))
        for model, chosen in self.swerling_models_and_cells(cells):
            confidence[chosen] = snr_db[chosen] - self._snr_at_reference_pd_db(model)
        pd = np.where(echo, self._pd_of_cells(cells, snr, clutter), 0.0)
        draw = cells.draws(self._draws)
        extras = {"snr_db": snr_db, "detection_probability": pd}
        noise = (
            draw >= self._pd_beyond_noise_alone(cells, pd, clutter)
            if self.p.errors == "signal"
            else None
        )
        tail = np.clip(draw / np.maximum(pd, 1e-300), 0.0, 1.0)
        cnr = None if clutter is None else clutter.total
        return Look(
            draw < pd, confidence, extras, signal_over_noise_and_clutter(snr, cnr), noise, tail
        )

    def _pd_beyond_noise_alone(
        self, cells: Cells, pd: FloatArray, clutter: Clutter | None
    ) -> FloatArray:
        """Return Pd without noise's share: p in Pd = 1 - (1 - Pfa)(1 - p), at least 0.

        As if noise and target were detected independently, Pd = 1 - (1 - Pfa)(1 - this).
        """
        pfa: Any = self.p.false_alarm_probability
        if clutter is not None or (
            cells.cued is not None and self._cued_pulses_and_pfa is not None
        ):
            pfa = self._pd_of_cells(cells, np.zeros(len(cells)), clutter)
        return np.maximum((pd - pfa) / np.maximum(1.0 - pfa, 1e-300), 0.0)

    def snr(self, cells: Cells) -> FloatArray:
        """Return each cell's SNR (linear), for the mean RCS or for the RCS drawn for the scan."""
        if not self.p.samples_rcs or self._models is steady_models:
            return super().snr(cells)
        rcs = effect_values_of_cells(self, self.mean_rcs_m2, cells)
        keys = cells.roster.draw_keys_of(cells.target)
        for model, chosen in self._models(cells):
            if self._fading is not None and self._is_constant_over_look(model):
                rcs[chosen] = rcs[chosen] * self._fading(cells, chosen, model)
                continue
            draws = self._rcs_draws.of_runs(cells.run[chosen], cells.instant_ns[chosen])
            draw = partial(draws.uniform, keys[chosen], cells.scan[chosen])
            rcs[chosen] = sampled_scan_rcs_m2(
                rcs[chosen], draw, pulses=self.p.pulses_summed, model=f"swerling{model}"
            )
        return self.echo_snr(cells, rcs)

    def _is_constant_over_look(self, model: int) -> bool:
        """Return whether a model's RCS stays the same over all pulses of a look."""
        return model in (1, 3) or (model in (2, 4) and self.p.pulses_summed == 1)

    @property
    def _cued_pulses_and_pfa(self) -> tuple[int, float] | None:
        """Pulses and probability of false alarm inside cue cones; None if the usual ones."""
        p = self.p
        if not (p.cued_pulses or p.cued_false_alarm_probability):
            return None
        return (
            p.cued_pulses or p.pulses_summed,
            p.cued_false_alarm_probability or p.false_alarm_probability,
        )

    def _pd_of_cells(self, cells: Cells, snr: FloatArray, clutter: Clutter | None) -> FloatArray:
        """Return the probability of detection of each cell, with clutter if there is any."""
        pd = np.empty(len(cells))
        cued = None if cells.cued is None else self._cued_pulses_and_pfa
        usual = self.p.pulses_summed, self.p.false_alarm_probability
        for model, chosen in self.swerling_models_and_cells(cells):
            beside = None if clutter is None else clutter.take(chosen)
            of_model = self._pd_of_model(snr[chosen], model, beside, *usual)
            if cued is not None:
                inside = cells.is_cued()[chosen]
                of_model = np.where(
                    inside, self._pd_of_model(snr[chosen], model, beside, *cued), of_model
                )
            pd[chosen] = of_model
        return pd

    def _pd_of_model(
        self,
        snr: FloatArray,
        model: int,
        clutter: Clutter | None,
        pulses: int,
        false_alarm_probability: float,
    ) -> FloatArray:
        """Return the Pd for one fluctuation model, with clutter if there is any."""
        p, name = self.p, f"swerling{model}"
        kind = "" if clutter is None else self.context.sections["terrain"].clutter_mean
        mean, diffuse = np.zeros(0), np.zeros(0)
        if clutter is not None:
            mean, diffuse = clutter.mean, clutter.diffuse
            if kind == "fluctuating":
                mean, diffuse = np.zeros(len(mean)), mean + diffuse
            if p.clutter_threshold == "adaptive":
                # Clutter that fluctuates like noise is more noise to a threshold that follows it.
                noise = 1.0 + diffuse
                snr, mean, diffuse = snr / noise, mean / noise, np.zeros(len(mean))
        if self.cfar is not None:
            return self.cfar.probability(snr, name)
        pd = probability_of_cells(snr, pulses, false_alarm_probability, name, self._method)
        if not (mean.any() or diffuse.any()):
            return pd
        cluttered = np.flatnonzero(mean + diffuse)
        pd[cluttered] = clutter_detection_probability(
            snr[cluttered],
            mean[cluttered],
            diffuse_cnr=diffuse[cluttered],
            false_alarm_probability=false_alarm_probability,
            model=name,
            clutter=kind,
            threshold=p.clutter_threshold,
        )
        return pd

    def largest_pd_slope(self) -> float | None:
        """Return the largest |dPd / d ln SNR| of any fluctuation model; None if unknown.

        None where there is ground clutter, which the same loss takes as well, with CFAR, and with a
        moving-target filter.
        """
        if self.built(CUE):
            return None
        proven = self.p.cfar_reference_cells is None and self.p.moving_target_filter == "none"
        if terrain_of(self) is not None or not proven:
            return None
        return _largest_pd_slope(self.p.pulses_summed, self.p.false_alarm_probability)

    def swerling_models_and_cells(self, cells: Cells) -> list[tuple[int, Any]]:
        """Return pairs (Swerling model for Pd, its cells); model 0 for all if RCS is drawn."""
        if self.p.samples_rcs:
            return [(0, slice(None))]
        return self._models(cells)

    def cued_crossing(self) -> Crossing | None:
        """Return the threshold of a look inside a cue cone; None if it is the same as elsewhere."""
        return (
            None
            if self._cued_pulses_and_pfa is None
            else Crossing.from_false_alarms(*self._cued_pulses_and_pfa)
        )

    def _snr_at_reference_pd_db(self, model: int) -> float:
        if model not in self._reference_db:
            pd, name = self.p.reference_pd, f"swerling{model}"
            self._reference_db[model] = (
                self.required_snr_db(pd, name)
                if self.cfar is None
                else 10.0 * math.log10(self.cfar.required_snr(pd, name))
            )
        return self._reference_db[model]


@lru_cache(maxsize=16)
def _largest_pd_slope(pulses: int, false_alarm_probability: float) -> float:
    """Return the largest |dPd / d ln SNR| of any fluctuation model."""
    log_snr = np.linspace(math.log(1e-8), math.log(1e8), 40_001)
    steepest = 0.0
    for model in range(5):
        pd = detection_probability(
            np.exp(log_snr),
            pulses=pulses,
            false_alarm_probability=false_alarm_probability,
            model=f"swerling{model}",
        )
        steepest = max(steepest, float(np.max(np.diff(pd) / np.diff(log_snr))))
    # Secants over 0.001 in ln SNR miss the steepest tangent by far less than this margin.
    return 1.01 * steepest


# An aircraft of this extent that flies straight keeps its aspect within so much in a second.
_EXTENT_M, _TURNS_RAD_S = 10.0, math.radians(0.2)


def _fade_rate_warnings(block: Any) -> list[str]:
    """Return a warning where scans draw new fades before the last fade can have ended."""
    effects, p = block.context.effects, block.p
    if not p.enabled or RcsFluctuation.name not in effects or LastingFluctuation.name in effects:
        return []
    if p.swerling in (2, 4) and p.pulses is not None and p.pulses > 1:
        return []
    # Scatterers that far apart add up otherwise after such a change of aspect (`Scatterers`).
    lasts_s = 0.5 * block.budget.wavelength / _EXTENT_M / _TURNS_RAD_S
    if float(p.scan_rate_hz) * lasts_s <= 1.0:
        return []
    wavelength_mm = 1e3 * block.budget.wavelength
    return [
        f"scan_rate_hz is {float(p.scan_rate_hz):g}, and each scan draws a fade of its own: the "
        f"echo of an aircraft of {_EXTENT_M:g} m that flies straight fades for some "
        f"{lasts_s:.2g} s or more at {wavelength_mm:.3g} mm, so that m of n count one fade as "
        "several, and targets are declared sooner than they would be; fluctuation_correlation_s or "
        "scintillation_extent_m lets fades last"
    ]
