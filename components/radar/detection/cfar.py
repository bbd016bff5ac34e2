"""Detection with a threshold that follows the mean of the cells around: cell-averaging CFAR.

The threshold is a multiple of the power averaged over N reference cells, which hold the same noise
and clutter as the cell under test and no target. So the probability of false alarm stays what it
is, whatever the clutter; the price is the *CFAR loss*, the SNR that it takes to make up for an
average that is known from N cells only. With the target's mean over the mean of noise and clutter
as SNR, the closed forms hold in noise and in clutter that fluctuates like noise.

Sources: H. M. Finn and R. S. Johnson, RCA Review 29, 1968; P. P. Gandhi and S. A. Kassam, "Analysis
of CFAR processors in nonhomogeneous background", IEEE Trans. AES 24(4), 1988, eq. 10-13 (Swerling
I, one pulse); M. A. Richards, Fundamentals of Radar Signal Processing, 2nd ed., section 6.5. The
sums for several pulses and the other targets are our own: of a target that brings K quanta into
the sum of n pulses (Poisson when steady, negative binomial when it fluctuates; see `exact`)
the cell is Gamma(n + K) distributed and the reference Gamma(n N), and their share is a Beta
variable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    check_probability,
    check_pulses,
    check_snr,
    check_swerling_model,
    unflatten,
)
from components.radar.detection.probability import required_snr
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict

FEWEST_CELLS, MOST_CELLS = 4, 1000

# Elements of a matrix of cells by quanta worked on at once.
_AT_ONCE = 1_000_000
# A quantum that is missed less often than this changes no probability.
_NO_TRACE = 1e-19


def cfar_detection_probability(
    snr: ArrayLike,
    *,
    reference_cells: int,
    false_alarm_probability: float,
    pulses: int = 1,
    model: str = "swerling1",
) -> Any:
    """Return the probability of detection of a cell-averaging CFAR detector, to 1e-12.

    `snr` is the target's mean power over that of noise and clutter, per pulse, linear, 0 (which
    gives the false alarm probability) to infinity; each of the 4 to 1000 reference cells holds the
    sum of as many pulses as the cell under test. For Swerling I and one pulse it is ``(1 + a / (1 +
    snr))**-N`` with ``a = Pfa**(-1 / N) - 1``.
    """
    ratio = check_snr(snr)
    name = check_swerling_model(model)
    terms = _terms(*_check_arguments(reference_cells, false_alarm_probability, pulses))
    flat = np.ascontiguousarray(ratio).reshape(-1)
    with np.errstate(under="ignore"):  # far from the threshold a probability is 0
        probability = _probability(flat, terms, name)
    return unflatten(np.minimum(np.maximum(probability, 0.0), 1.0), ratio.shape)


def cfar_multiplier(
    reference_cells: int, false_alarm_probability: float, *, pulses: int = 1
) -> float:
    """Return the factor from the reference cells' sum to the threshold, for a given Pfa.

    Parameters
    ----------
    reference_cells, false_alarm_probability, pulses
        As for `cfar_detection_probability`.

    Returns
    -------
    float
        a of Pr(cell > a · sum of reference cells) = Pfa; Pfa^(-1/N) - 1 for one pulse.
    """
    return _multiplier(*_check_arguments(reference_cells, false_alarm_probability, pulses))


def cfar_required_snr(
    pd: float,
    *,
    reference_cells: int,
    false_alarm_probability: float,
    pulses: int = 1,
    model: str = "swerling1",
) -> float:
    """Return the mean SNR per pulse at which a cell-averaging CFAR detector has Pd `pd`, linear."""
    wanted = float(check_probability("pd", pd))
    count, pfa, n = _check_arguments(reference_cells, false_alarm_probability, pulses)
    if wanted <= pfa:
        raise ValueError(
            f"pd is {wanted:g}: it must be above the false alarm probability, {pfa:g}, which noise "
            "alone reaches"
        )
    return _solve_required(wanted, count, pfa, n, check_swerling_model(model))


def cfar_loss_db(
    pd: float,
    *,
    reference_cells: int,
    false_alarm_probability: float,
    pulses: int = 1,
    model: str = "swerling1",
) -> float:
    """Return the CFAR loss in dB: the SNR needed beyond that with a threshold known exactly."""
    known = required_snr(
        pd, pulses=pulses, false_alarm_probability=false_alarm_probability, model=model
    )
    averaged = cfar_required_snr(
        pd,
        reference_cells=reference_cells,
        false_alarm_probability=false_alarm_probability,
        pulses=pulses,
        model=model,
    )
    return 10.0 * math.log10(averaged / known)


@dataclass(frozen=True)
class _Terms:
    """Probabilities that a cell with k quanta of signal is missed or detected, for k = 0, 1, ..."""

    pulses: int
    cells: int
    multiplier: float
    missed: FloatArray
    detected: FloatArray
    log_factorial: FloatArray


def _check_arguments(
    reference_cells: int, false_alarm_probability: float, pulses: int
) -> tuple[int, float, int]:
    whole = not isinstance(reference_cells, bool) and int(reference_cells) == reference_cells
    if not whole or not FEWEST_CELLS <= reference_cells <= MOST_CELLS:
        raise ValueError(
            f"reference_cells is {reference_cells!r}: it must be a whole number from "
            f"{FEWEST_CELLS} to {MOST_CELLS}"
        )
    pfa = float(check_probability("false_alarm_probability", false_alarm_probability))
    return int(reference_cells), pfa, int(check_pulses(pulses))


@lru_cache(maxsize=256)
def _multiplier(cells: int, pfa: float, pulses: int) -> float:
    if pulses == 1:
        return math.expm1(-math.log(pfa) / cells)
    from scipy.special import betaincinv

    # The reference's share of both together is Beta(n N, n); it is small when the cell is strong.
    share = float(betaincinv(float(pulses * cells), float(pulses), pfa))
    return (1.0 - share) / share


@lru_cache(maxsize=64)
def _terms(cells: int, pfa: float, pulses: int) -> _Terms:
    from scipy.special import betainc, gammaln

    multiplier = _multiplier(cells, pfa, pulses)
    cell, reference = multiplier / (1.0 + multiplier), 1.0 / (1.0 + multiplier)
    count = 64
    while betainc(float(pulses + count), float(pulses * cells), cell) > _NO_TRACE:
        count *= 2
    quanta = np.arange(count, dtype=np.float64)
    missed = betainc(pulses + quanta, float(pulses * cells), cell)
    kept = max(int(np.count_nonzero(missed > _NO_TRACE)), 1)
    detected = betainc(float(pulses * cells), pulses + quanta[:kept], reference)
    missed, log_factorial = missed[:kept], gammaln(quanta[:kept] + 1.0)
    for array in (missed, detected, log_factorial):
        array.flags.writeable = False
    return _Terms(pulses, cells, multiplier, missed, detected, log_factorial)


def _probability(snr: FloatArray, terms: _Terms, model: str) -> FloatArray:
    n, a, cells = terms.pulses, terms.multiplier, float(terms.cells)
    if model == "swerling2" or (n == 1 and model == "swerling1"):
        if n == 1:
            return np.exp(-cells * np.log1p(a / (1.0 + snr)))
        from scipy.special import betainc

        return np.asarray(betainc(n * cells, float(n), 1.0 / (1.0 + a / (1.0 + snr))))
    if n == 1 and model in ("swerling3", "swerling4"):
        # The mean of exp(-v/M)(1 + v (S/2)/M²) over a threshold v = a · Gamma(N).
        half = 0.5 * snr
        with np.errstate(invalid="ignore"):
            total = 1.0 + half
            share = np.where(np.isinf(half), 0.0, half / total / (total + a))
        return np.exp(-cells * np.log1p(a / total)) * (1.0 + cells * a * share)
    shape = {"swerling0": math.inf, "swerling1": 1.0, "swerling3": 2.0, "swerling4": 2.0 * n}[model]
    result = np.ones_like(snr)
    finite = np.flatnonzero(np.isfinite(snr))
    step = max(1, _AT_ONCE // len(terms.missed))
    for first in range(0, len(finite), step):
        some = finite[first : first + step]
        result[some] = _pd_of_signal_quanta(n * snr[some], shape, terms)
    return result


def _pd_of_signal_quanta(quanta: FloatArray, shape: float, terms: _Terms) -> FloatArray:
    """Return Pd for mean numbers of signal quanta, accurate for small Pd and small 1 - Pd."""
    from scipy.special import gammaln, xlogy

    k = np.arange(len(terms.missed), dtype=np.float64)
    mean = quanta[:, np.newaxis]
    if math.isinf(shape):
        log_weight = xlogy(k, mean) - mean - terms.log_factorial
    else:
        ways = gammaln(shape + k) - math.lgamma(shape) - terms.log_factorial
        odds = mean / shape
        log_weight = ways + xlogy(k, odds / (1.0 + odds)) - shape * np.log1p(odds)
    weight = np.exp(log_weight)
    # Summed row by row, not as a product of matrices, whose order depends on how many rows it has.
    miss = (weight * terms.missed).sum(axis=1)
    surely = np.maximum(1.0 - weight.sum(axis=1), 0.0)
    return np.where(miss < 0.5, 1.0 - miss, (weight * terms.detected).sum(axis=1) + surely)


@lru_cache(maxsize=1024)
def _solve_required(wanted: float, cells: int, pfa: float, pulses: int, model: str) -> float:
    terms = _terms(cells, pfa, pulses)
    if pulses == 1 and model in ("swerling1", "swerling2"):
        return terms.multiplier / math.expm1(-math.log(wanted) / cells) - 1.0
    low, high = math.log(1e-30), math.log(1e30)
    while high - low > 1e-13 * max(1.0, abs(high)):
        middle = 0.5 * (low + high)
        if float(_probability(np.array([math.exp(middle)]), terms, model)[0]) < wanted:
            low = middle
        else:
            high = middle
    return math.exp(0.5 * (low + high))


class Averaging:
    """A cell-averaging detector with one radar's pulses and probability of false alarm."""

    def __init__(self, block: Any) -> None:
        self._settings = {
            "reference_cells": block.p.cfar_reference_cells,
            "false_alarm_probability": block.p.false_alarm_probability,
            "pulses": block.p.pulses_summed,
        }

    def probability(self, snr: FloatArray, model: str) -> FloatArray:
        """Return Pd for powers over noise and clutter (flat array)."""
        pd: FloatArray = cfar_detection_probability(snr, model=model, **self._settings)
        return pd

    def required_snr(self, pd: float, model: str) -> float:
        """Return the SNR at which Pd is `pd`, linear."""
        return cfar_required_snr(pd, model=model, **self._settings)

    def loss_db(self, pd: float, model: str) -> float:
        """Return the additional SNR for Pd `pd` over that with a known threshold, dB."""
        return cfar_loss_db(pd, model=model, **self._settings)


REFERENCE_CELLS = Hook(
    "threshold from reference cells", Averaging, "Pd, required SNR and loss of a CFAR detector"
)


class CellAveraging(Effect[Averaging]):
    """Cell-averaging CFAR: the threshold is known from ``cfar_reference_cells`` cells only.

    The cells hold what the cell under test holds but the target: noise, and ground clutter of the
    same power that fluctuates like noise. So the probability of false alarm stays what it is, and
    a target needs the CFAR loss more SNR. A calibrated range is that of a threshold known exactly.
    """

    name = "CFAR"
    acts_on = REFERENCE_CELLS
    builds = Averaging
    outside_the_proof = "no number of cells is as good as a threshold that is known"

    def verdict(self, block: Any) -> Verdict:
        """Return whether the threshold is estimated by CFAR: needs ``cfar_reference_cells``."""
        cells = block.p.cfar_reference_cells
        if cells is None:
            return Verdict(False, "cfar_reference_cells is not given")
        return Verdict(True, f"cfar_reference_cells is {cells}")
