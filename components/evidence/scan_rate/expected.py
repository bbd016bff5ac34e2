"""The range of first detection and of declaration on a head-on course, computed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from components.arguments.checks import FloatArray
from components.radar.detection import detection_probability, first_declared

# Phases of the scan clock against the encounter; more change no digit that is shown.
_PHASES = 32


@dataclass(frozen=True)
class HeadOn:
    """Describe a head-on encounter and the one look whose Pd is known.

    Parameters
    ----------
    snr_at_1_m : float
        Linear SNR of the known look, times the fourth power of its range in metres.
    pulses : int
        Pulses of that look.
    closing_m_s, from_m, to_m : float
        The target comes from the one range to the other.
    false_alarm_probability : float
    """

    snr_at_1_m: float
    pulses: int
    closing_m_s: float
    from_m: float
    to_m: float
    false_alarm_probability: float


def known_snr_at_1_m(
    *, rcs_dbsm: float, range_m: float, pd: float, false_alarm_probability: float, of_dbsm: float
) -> float:
    """Return the SNR of a Swerling I target of `of_dbsm` at 1 m, where Pd of another is known.

    Notes
    -----
    Pd = Pfa^(1 / (1 + SNR)) of one look, and SNR goes with σ / R⁴.
    """
    known = math.log(false_alarm_probability) / math.log(pd) - 1.0
    return float(known * 10.0 ** (0.1 * (of_dbsm - rcs_dbsm)) * range_m**4)


def ranges_of_declaration(
    approach: HeadOn, scan_rate_hz: float, m: int, n: int, *, pulses: int, summed: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return ranges of the looks of all phases, and the probability of a first declaration there.

    Parameters
    ----------
    approach : HeadOn
    scan_rate_hz : float
    m, n : int
        Detections that declare, of so many looks; 1 and 1 for the first detection.
    pulses : int
        Pulses of a look.
    summed : bool
        Whether they are summed in power; else in amplitude.

    Returns
    -------
    range_m, probability : (phases, looks) arrays
        The probabilities add up to that of being declared at all.
    """
    a = approach
    per_scan_m = a.closing_m_s / scan_rate_hz
    first_m = a.from_m - per_scan_m * (np.arange(_PHASES)[:, np.newaxis] + 0.5) / _PHASES
    looks = math.ceil((a.from_m - a.to_m) / per_scan_m)
    range_m = first_m - per_scan_m * np.arange(looks)
    # Where the run has ended nothing is detected.
    over = range_m < a.to_m
    snr = a.snr_at_1_m / np.where(over, a.to_m, range_m) ** 4 / a.pulses
    pd = detection_probability(
        snr if summed else snr * pulses,
        pulses=pulses if summed else 1,
        false_alarm_probability=a.false_alarm_probability,
    )
    return range_m, first_declared(np.where(over, 0.0, pd), m, n) / _PHASES


def mean_range_m(range_m: FloatArray, probability: FloatArray) -> float:
    """Return the mean range of those that are declared."""
    return float(np.sum(range_m * probability) / np.sum(probability))


def certain_range_m(range_m: FloatArray, probability: FloatArray, share: float) -> float:
    """Return the range at which so large a share is declared; NaN if it never is."""
    order = np.argsort(-range_m, axis=None)
    declared = np.cumsum(probability.reshape(-1)[order])
    place = int(np.searchsorted(declared, share))
    return math.nan if place == len(declared) else float(range_m.reshape(-1)[order][place])
