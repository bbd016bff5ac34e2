"""The radar cross-section: its mean over aspect, its fluctuation, and how long that lasts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.aircraft import Aircraft
from components.aircraft.known_targets import offered_rosters
from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_swerling_model,
    refuse,
    unflatten,
)
from components.geometry import aspect_angles, unit_vector
from components.sensor.look import Cells, CellValues, aspect_pitch_roll_elevation_rad
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Context
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.time.gauss_markov import GaussMarkov
from dsa_des.time.randomness import Stream


def fluctuating_rcs(mean_rcs_m2: ArrayLike, uniforms: ArrayLike, model: str) -> Any:
    """Return random RCS (m²) with the fluctuation of a Swerling model, from uniform numbers.

    Of ``swerling1`` and ``swerling3`` there is one draw per scan; of ``swerling2`` and
    ``swerling4`` one per pulse, along the last axis, with which the mean broadcasts before it.
    Larger draws give larger RCS. Thesis eq. 22 with N = 1 (eq. 23: the exponential in power,
    Rayleigh in amplitude) and N = 2.
    """
    name = check_swerling_model(model)
    mean, draw = check_not_negative("mean_rcs_m2", mean_rcs_m2), check_finite("uniforms", uniforms)
    refuse("uniforms", draw, ~((draw >= 0.0) & (draw < 1.0)), "lie in [0, 1)")
    if name in ("swerling2", "swerling4"):
        if draw.ndim == 0:
            raise ValueError("uniforms is a scalar: it must have one draw per pulse along an axis")
        mean = mean[..., None]
    shape, (mean, draw) = broadcast_flat(mean_rcs_m2=mean, uniforms=draw)
    if name == "swerling0":
        return unflatten(mean, shape)
    if name in ("swerling1", "swerling2"):
        return unflatten(mean * -np.log1p(-draw), shape)
    from scipy.special import gammaincinv

    return unflatten(mean * (0.5 * np.asarray(gammaincinv(2.0, draw))), shape)


def sampled_scan_rcs_m2(
    mean_rcs_m2: FloatArray,
    draw: Callable[[int], FloatArray],
    *,
    pulses: int,
    model: str,
) -> FloatArray:
    """Return the mean RCS of a scan's pulses, drawn at random by the Swerling model, m².

    One draw per scan for ``swerling1`` and ``swerling3``; one per pulse for ``swerling2`` and
    ``swerling4``, whose RCS are averaged (thesis §4.1.2). `draw` gives uniform numbers in [0, 1) by
    the number of the pulse. That average is all a square-law detector needs: with a steady echo in
    each pulse the sum of n pulses depends only on the sum of their SNR. So a steady target's Pd at
    the scan's RCS, averaged over scans, is the model's own Pd, whatever the pulses.
    """
    name = check_swerling_model(model)
    if name == "swerling0":
        return np.array(mean_rcs_m2)
    if name in ("swerling1", "swerling3"):
        return np.asarray(fluctuating_rcs(mean_rcs_m2, draw(0), name))
    # Pulse after pulse, so that an element's sum has one order in any array.
    total = np.zeros_like(mean_rcs_m2)
    for pulse in range(pulses):
        total += fluctuating_rcs(mean_rcs_m2, draw(pulse)[:, np.newaxis], name)[:, 0]
    return total / pulses


def _aspect_angles(cells: Cells) -> tuple[FloatArray, FloatArray]:
    """Return azimuth and elevation of the radar as seen in each target's body axes, rad."""
    # In a frame turned so that the line of sight has bearing 0, the target's yaw is its relative
    # heading.
    *turned, elevation = aspect_pitch_roll_elevation_rad(cells)
    return aspect_angles(np.zeros(len(cells)), elevation, *turned)


def mean_rcs_m2(cells: Cells) -> FloatArray:
    """Return each cell's mean RCS: from the aircraft's table over aspect, else its constant."""
    rcs: FloatArray = cells.column_at_targets(cells.roster.rcs_m2)
    tables, table_of = cells.roster.tables("rcs_table")
    if not tables:
        return rcs
    azimuth, elevation = _aspect_angles(cells)
    which = table_of[cells.craft]
    for index, table in enumerate(tables):
        chosen = np.flatnonzero(which == index)
        rcs[chosen] = table.rcs_m2(azimuth[chosen], elevation[chosen])
    return rcs


class ModelsOfCells(Protocol):
    """Function that returns the Swerling model of each cell."""

    def __call__(self, cells: Cells, /) -> list[tuple[int, Any]]:
        """Return models (5 written as 0) with the cells that each holds for."""


FLUCTUATION = Hook("RCS", ModelsOfCells, "which Swerling model each cell has")
MEAN_RCS = Hook("mean RCS", CellValues, "each cell's mean RCS in m²")


def _verdict_by_targets(
    context: Context, says: Callable[[Aircraft], str], *, otherwise: str
) -> Verdict:
    """Return the verdict: needed if `says` returns text for any known target, or none is known."""
    rosters = offered_rosters(context)
    if not rosters:
        return Verdict(True, "the targets are not known before the run")
    calling = [
        f"target {name!r} has {said}"
        for roster in rosters
        for name, craft in zip(roster.names, roster.aircraft, strict=True)
        if (said := says(craft))
    ]
    if not calling:
        return Verdict(False, otherwise)
    more = "" if len(calling) == 1 else f" (and {len(calling) - 1} more like it)"
    return Verdict(True, calling[0] + more)


class RcsFluctuation(Effect[ModelsOfCells]):
    """Swerling fluctuation I to IV (thesis §4.1.2); without it every target is steady."""

    name = "RCS fluctuation"
    acts_on = FLUCTUATION

    def verdict(self, block: Any) -> Verdict:
        """Return whether RCS fluctuates: by the radar's ``swerling``, or else by each target's."""
        if block.p.swerling is not None:
            return Verdict(block.p.swerling not in (0, 5), f"swerling is {block.p.swerling}")
        return _verdict_by_targets(
            block.context,
            lambda craft: f"swerling {craft.swerling}" if craft.swerling % 5 else "",
            otherwise="every target has swerling 0 or 5",
        )

    def build(self, block: Any) -> ModelsOfCells:
        """Return a function giving cells' Swerling models, each with the cells it applies to."""
        return make_swerling_model_lookup(block.p.swerling)


class AspectRcs(Effect[CellValues]):
    """Mean RCS from a table over the direction from which the radar sees the aircraft."""

    name = "aspect RCS"
    acts_on = MEAN_RCS

    def verdict(self, block: Any) -> Verdict:
        """Return whether RCS depends on aspect: needs ``aspect_rcs`` and targets' ``rcs_table``."""
        if not block.p.aspect_rcs:
            return Verdict(False, "aspect_rcs is false")
        return _verdict_by_targets(
            block.context,
            lambda craft: "an rcs_table" if craft.rcs_table else "",
            otherwise="no target has an rcs_table",
        )

    def build(self, block: Any) -> CellValues:
        """Return a function giving cells' mean RCS, m²: a table over aspect, or else a constant."""
        return mean_rcs_m2 if block.p.aspect_rcs else constant_rcs_m2


def make_swerling_model_lookup(swerling: int | None) -> ModelsOfCells:
    """Return a function giving cells' Swerling models: one for all, or each target's own.

    It gives pairs of a model (5 written as 0) and the cells that it holds for.
    """
    if swerling is not None:
        return lambda cells: [(swerling % 5, slice(None))]

    def models(cells: Cells) -> list[tuple[int, Any]]:
        known = cells.roster.swerling_models
        if len(known) == 1:
            return [(known[0], slice(None))]
        of_cell = cells.column_at_targets(cells.roster.swerling)
        pairs = [(model, np.flatnonzero(of_cell == model)) for model in known]
        return [(model, chosen) for model, chosen in pairs if len(chosen)]

    return models


def steady_models(cells: Cells) -> list[tuple[int, Any]]:
    """Return model 0 (steady) for all cells."""
    return [(0, slice(None))]


def constant_rcs_m2(cells: Cells) -> FloatArray:
    """Return the constant RCS of each cell's target, m²."""
    rcs: FloatArray = cells.column_at_targets(cells.roster.rcs_m2)
    return rcs


#: Scatterers of an echo whose strengths are fixed, and of one whose strengths change with time.
#: Gaussian strengths make the power exponential for any number, over targets; over all aspects of
#: one target it has that target's own mean, which varies by 1 / sqrt(number) (0.6 dB), unless
#: strengths change.
FIXED, CHANGING = 48, 8


class Scatterers:
    """Random scatterers fixed in each target's body, uniform in a ball of `extent_m`.

    An echo that goes to a scatterer at r and back has the phase 4π r·u / λ for the direction u to
    the radar. The sum of many with complex Gaussian strengths is a complex Gaussian amplitude; over
    targets its correlation between two aspects Δ apart is that of the ball, 3 (sin x - x cos x) /
    x³ with x = 2π Δ extent / λ: half of it is left at Δ = 0.40 λ / extent, nothing at 0.72 λ /
    extent. For the usual estimate λ / (2 extent): D. K. Barton, *Modern Radar System Analysis*,
    1988, section 2.4; M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., section 2.8.
    """

    def __init__(
        self, stream: Stream, extent_m: float, wavelength_m: float, count: int = FIXED
    ) -> None:
        self._stream, self._count = stream, count
        self._reach = 2.0 * math.pi * extent_m / wavelength_m

    def echo_amplitudes(
        self,
        keys: Any,
        aspect: tuple[FloatArray, FloatArray, FloatArray],
        which: int,
        strengths: Callable[[int], tuple[FloatArray, FloatArray]] | None = None,
        run: IntArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return real and imaginary part of the amplitude of echoes, each of variance 1.

        `aspect` is the unit vector to the radar in the target's body axes, `which` the number of a
        target's independent echo, and `strengths` gives standard normal numbers by a scatterer's
        number; by default they are fixed to the target. `run` says of which run each is.
        """
        of_run = np.zeros(len(keys), dtype=np.uint64) if run is None else run
        pairs = np.stack([keys, of_run.astype(np.uint64)])
        (targets, runs), of_target = np.unique(pairs, axis=1, return_inverse=True)
        of_target = of_target.reshape(-1)
        stream = self._stream.of_runs(runs.astype(np.int64))
        real, imaginary = np.zeros(len(keys)), np.zeros(len(keys))
        for number in range(which * self._count, (which + 1) * self._count):
            numbers = np.full(len(targets), number, dtype=np.int64)
            position = self._scatterer_positions(stream, targets, numbers)
            # One after the other, so that an element's sum has one order in any array.
            phase = np.zeros(len(keys))
            for along, component in zip(position, aspect, strict=True):
                phase += along[of_target] * component
            if strengths is None:
                normal = (stream.normal(targets, numbers, draw) for draw in (2, 3))
                a, b = (value[of_target] for value in normal)
            else:
                a, b = strengths(number)
            cosine, sine = np.cos(phase), np.sin(phase)
            real += a * cosine - b * sine
            imaginary += a * sine + b * cosine
        scale = 1.0 / math.sqrt(self._count)
        return scale * real, scale * imaginary

    def _scatterer_positions(
        self, stream: Stream, targets: Any, numbers: IntArray
    ) -> list[FloatArray]:
        """Return a scatterer's coordinates by body axis, as phase per unit of aspect vector."""
        # One draw number is two uniforms (`Stream.uniform`), so 0 and 1 are the first of them.
        out, up, around = (stream.uniform(targets, numbers, draw) for draw in (0, 1, 2))
        radius = self._reach * np.cbrt(out)
        z = 2.0 * up - 1.0
        level = np.sqrt(1.0 - z * z)
        turn = 2.0 * math.pi * around
        return [radius * level * np.cos(turn), radius * level * np.sin(turn), radius * z]


class Fading(Protocol):
    """Gives the power of lasting echoes over their mean."""

    def __call__(self, cells: Cells, chosen: Any, model: int, /) -> FloatArray:
        """Return the fading of some cells that have one Swerling model."""


FADING = Hook("fading", Fading, "power of lasting echoes over their mean")


def fading_power(amplitudes: list[FloatArray]) -> FloatArray:
    """Return the power of an echo over its mean from independent standard normal amplitudes.

    Two of them (real and imaginary part) for exponential power (one complex amplitude of many
    scatterers, Swerling I and II), four for chi-square of 4 degrees of freedom (two such
    amplitudes, III and IV). Where they are correlated with ρ, the power is with ρ². P. Swerling,
    "Probability of detection for fluctuating targets", IRE Trans. IT-6(2), 1960.
    """
    total = np.zeros_like(amplitudes[0])
    for part in amplitudes:
        total += part * part
    return total / len(amplitudes)


class LastingFluctuation(Effect[Fading]):
    """Echoes whose complex amplitude lasts: in time, and in the aspect that the radar has.

    With ``fluctuation_correlation_s`` the amplitude of each target is a Gauss-Markov process: its
    correlation falls as exp(-|dt|/τ), that of the power as exp(-2 |dt|/τ), whenever the radar
    looks. With ``scintillation_extent_m`` it is that of scatterers on the target's body
    (`components.radar.rcs`), which changes as the target turns or passes; with both, the
    correlations multiply. A look is detected with a steady target's Pd at the power it meets; over
    many looks far apart that is the Swerling model's own Pd. Where pulses are summed, Swerling II
    and IV change from pulse to pulse and do not last.

    An aspect table's mean is multiplied by it.
    """

    name = "lasting fluctuation"
    acts_on = FADING
    outside_the_proof = "without it every scan draws a fade of its own"

    def verdict(self, block: Any) -> Verdict:
        """Return whether fluctuation lasts over scans: needs both keys and a fluctuating target."""
        lasts_s, extent_m = block.p.fluctuation_correlation_s, block.p.scintillation_extent_m
        if lasts_s is None and extent_m is None:
            return Verdict(
                False, "fluctuation_correlation_s and scintillation_extent_m are not given"
            )
        fluctuates = RcsFluctuation().verdict(block)
        if not fluctuates.simulated:
            return Verdict(False, fluctuates.because)
        said = []
        if lasts_s is not None:
            said.append(
                f"fluctuation_correlation_s is {lasts_s:g}: the power of looks {lasts_s / 2:g} s "
                "apart is correlated with 0.368"
            )
        if extent_m is not None:
            apart_deg = np.degrees(0.5 * block.budget.wavelength / extent_m)
            said.append(
                f"scintillation_extent_m is {extent_m:g}: aspects {apart_deg:.2g} deg apart fade "
                "each by itself"
            )
        return Verdict(True, "; ".join(said))

    def build(self, block: Any) -> Fading:
        """Return a function giving each echo's power over its mean at its look's instant."""
        lasts_s, extent_m = block.p.fluctuation_correlation_s, block.p.scintillation_extent_m
        process = None if lasts_s is None else GaussMarkov(block.stream("fading"), lasts_s)
        scatterers = None
        if extent_m is not None:
            scatterers = Scatterers(
                block.stream("scatterers"),
                extent_m,
                block.budget.wavelength,
                FIXED if process is None else CHANGING,
            )

        def fading(cells: Cells, chosen: Any, model: int) -> FloatArray:
            keys = cells.roster.draw_keys_of(cells.target)[chosen]
            instant_ns, run = cells.instant_ns[chosen], cells.run[chosen]

            def pair(number: int) -> tuple[FloatArray, FloatArray]:
                assert process is not None
                real, imaginary = (
                    process(keys, instant_ns, 2 * number + part, run) for part in (0, 1)
                )
                return real, imaginary

            amplitudes: list[FloatArray] = []
            for which in range(2 if model in (3, 4) else 1):
                if scatterers is None:
                    amplitudes += pair(which)
                    continue
                aspect = _aspect_vectors(cells, chosen)
                strengths = None if process is None else pair
                amplitudes += scatterers.echo_amplitudes(keys, aspect, which, strengths, run)
            return fading_power(amplitudes)

        return fading


def _aspect_vectors(cells: Cells, chosen: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the unit vector from each target to the radar in the target's body axes."""
    azimuth, elevation = _aspect_angles(cells)
    x, y, z = unit_vector(azimuth[chosen], elevation[chosen])
    return x, y, z
