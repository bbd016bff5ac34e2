"""Eclipsing, folded ranges and their resolution by coincidence, and blind zones.

A receiver is shut while a pulse of τ seconds is sent, every T = 1 / PRF. An echo arrives
t = 2R / c later, modulo T, and lasts τ: the share of it outside the pulses just sent and sent next
is received.
Ranges that differ by c / 2PRF look alike to one PRF. Several PRFs that see a target agree on its
range, and on others that are as near to a multiple of each one's c / 2PRF from it: ghosts.

Sources: M. I. Skolnik (ed.), Radar Handbook, 3rd ed., chapter 4 (pulse Doppler radar: eclipsing and
range ambiguity resolution); M. A. Richards, Fundamentals of Radar Signal Processing, 2nd ed.,
chapter 5 (blind zones; staggered PRFs); G. V. Morris and L. Harkness (eds.), Airborne Pulsed
Doppler Radar, 2nd ed., on medium PRF (M of N).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_positive,
    refuse,
    unflatten,
)
from components.arguments.units import SPEED_OF_LIGHT_M_S
from dsa_des.arrays.types import BoolArray, FloatArray

# Ranges that agree but for rounding do agree.
_ROUNDING_M = 1e-6


def unambiguous_range_m(prf_hz: float) -> float:
    """Return the largest unambiguous range of a pulse repetition frequency, m."""
    return SPEED_OF_LIGHT_M_S / (2.0 * prf_hz)


def received_share(range_m: ArrayLike, *, prf_hz: float, pulse_width_s: float) -> Any:
    """Return the share of an echo that is received, as none is while a pulse is sent.

    Parameters
    ----------
    range_m : array_like
        Slant ranges, 0 or more.
    prf_hz : float
    pulse_width_s : float
        At most the interval between pulses.

    Returns
    -------
    ndarray or float
        In [0, 1]: min(1, t/τ) + min(1, (T - t)/τ) - 1, t the delay modulo T. Its mean over all
        delays is 1 - τ/T up to a duty factor of 1/2. It is a factor of the SNR: a receiver that is
        shut receives no noise either, and what is left of the pulse is matched. A filter matched to
        the whole pulse that goes on to hear noise has the square of the share.
    """
    interval_s = 1.0 / float(check_positive("prf_hz", prf_hz))
    width_s = float(check_positive("pulse_width_s", pulse_width_s))
    refuse(
        "pulse_width_s", np.asarray(width_s), np.asarray(width_s > interval_s),
        f"be at most the pulse interval, {interval_s:g} s",
    )  # fmt: skip
    shape, (distance,) = broadcast_flat(range_m=check_not_negative("range_m", range_m))
    after_s = np.mod(2.0 * distance / SPEED_OF_LIGHT_M_S, interval_s)
    share = np.minimum(1.0, after_s / width_s) + np.minimum(1.0, (interval_s - after_s) / width_s)
    return unflatten(np.clip(share - 1.0, 0.0, 1.0), shape)


def mth_largest_share(shares: FloatArray, needed: int) -> FloatArray:
    """Return the `needed`-th largest share over the PRFs for each target.

    Parameters
    ----------
    shares : (prfs, targets)
    needed : int
        M of M of N.

    Returns
    -------
    (targets,)
        The M-th largest. The dwells of one scan meet one fluctuation of the target, so where the
        M-th clearest PRF detects it, those that see it as well do too. Gains by further chances of
        the noise are left out.
    """
    decisive: FloatArray = np.sort(shares, axis=0)[len(shares) - needed]
    return decisive


def coincident_range_m(
    range_m: FloatArray, *, prfs_hz: Sequence[float], seen: BoolArray, tolerance_m: float
) -> FloatArray:
    """Return a multi-PRF radar's range: the nearest where all PRFs that see the target agree.

    Parameters
    ----------
    range_m : (targets,)
        True ranges.
    prfs_hz : sequence of float
    seen : (prfs, targets)
        Which PRF sees which target; one that none sees keeps its range.
    tolerance_m : float
        How far ranges of two PRFs may lie apart to agree.

    Returns
    -------
    (targets,)
        The true range or a ghost nearer than it, by a multiple of c / 2PRF of the first PRF that
        sees the target. With one PRF that is the range modulo c / 2PRF.
    """
    lengths = np.array([unambiguous_range_m(prf_hz) for prf_hz in prfs_hz])
    found: FloatArray = np.array(range_m, dtype=np.float64)
    length = lengths[np.argmax(seen, axis=0)]
    folds = np.where(seen.any(axis=0), np.floor(found / length), 0.0).astype(np.int64)
    true = found.copy()
    for fold in range(1, int(folds.max(initial=0)) + 1):
        offset = fold * length
        of_each = lengths[:, np.newaxis]
        off = np.abs(offset - of_each * np.rint(offset / of_each))
        agree = np.where(seen, off <= tolerance_m + _ROUNDING_M, True).all(axis=0)
        found = np.where(agree & (fold <= folds), true - offset, found)
    return found


def count_clear_prfs(
    range_m: ArrayLike,
    range_rate_m_s: ArrayLike,
    *,
    prfs_hz: Sequence[float],
    pulse_width_s: float,
    wavelength_m: float,
    notch_m_s: float,
    least_share: float = 1.0,
) -> Any:
    """Return how many PRFs see a target at a range and range rate: not eclipsed, not filtered.

    Parameters
    ----------
    range_m, range_rate_m_s : array_like
        Broadcast against each other; rates against the clutter's.
    prfs_hz : sequence of float
    pulse_width_s, wavelength_m : float
    notch_m_s : float
        Rates nearer than this to a multiple of the blind speed, wavelength · PRF / 2, are filtered
        out.
    least_share : float
        Of the echo that a PRF must receive, (0, 1].

    Returns
    -------
    ndarray or int
        0 to the number of PRFs. One PRF sees (1 - 2 notch / blind speed) of all rates and, with
        `least_share` s, 1 - 2 s τ/T of all delays.
    """
    check_positive("wavelength_m", wavelength_m)
    notch = float(check_not_negative("notch_m_s", notch_m_s))
    shape, (distance, rate) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        range_rate_m_s=check_finite("range_rate_m_s", range_rate_m_s),
    )
    count = np.zeros(distance.shape, dtype=np.int64)
    for prf_hz in prfs_hz:
        blind_m_s = 0.5 * wavelength_m * prf_hz
        off = np.abs(rate - blind_m_s * np.rint(rate / blind_m_s))
        share = received_share(distance, prf_hz=prf_hz, pulse_width_s=pulse_width_s)
        count += (off >= notch) & (share >= least_share)
    return unflatten(count, shape)
