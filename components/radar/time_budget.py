"""The time that a scan takes, beam by beam, and the pulses of one look.

Pure functions; the parameters that describe them are in `components.radar.time_parameters`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from components.arguments.checks import positive
from components.radar.radar_equation import SPEED_OF_LIGHT_M_S

# A width that is a whole number of steps up to rounding has that many; likewise pulses in a dwell.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class BeamPositions:
    """Say how many beams fill a field of view: columns in azimuth, bars in elevation.

    Build it with `beam_positions`.

    Parameters
    ----------
    azimuth, elevation : int
        Beams side by side and one above the other.
    """

    azimuth: int
    elevation: int

    @property
    def count(self) -> int:
        """Number of beam positions of a scan."""
        return self.azimuth * self.elevation

    def dwell_s(self, scan_rate_hz: float) -> float:
        """Return the time for each beam where a scan looks at every one once, s."""
        return 1.0 / (scan_rate_hz * self.count)

    def highest_rate_hz(self, dwell_s: float) -> float:
        """Return the scan rate at which each beam has so much time and no more, Hz."""
        return 1.0 / (dwell_s * self.count)


def beam_positions(
    *,
    azimuth_width_rad: float,
    elevation_width_rad: float,
    azimuth_beamwidth_rad: float,
    elevation_beamwidth_rad: float,
    spacing: float = 1.0,
) -> BeamPositions:
    """Return the beam positions that search a field of view.

    Parameters
    ----------
    azimuth_width_rad, elevation_width_rad : float, rad
        The volume searched, above 0.
    azimuth_beamwidth_rad, elevation_beamwidth_rad : float, rad
        Half-power beamwidths, above 0.
    spacing : float
        From beam to beam, in beamwidths; below 1 beams overlap.

    Returns
    -------
    BeamPositions

    Raises
    ------
    ValueError
        If an argument is not above 0.

    Notes
    -----
    The number of beams is the solid angle searched over that of a beam,
    ``n_B = (Θ_A Θ_E) / (θ_a θ_e)``, and a scan takes ``T = n_B · dwell``: B. R. Mahafza and A. Z.
    Elsherbeni, *MATLAB Simulations for Radar Systems Design*, 2004, section 1.8, eq. 1.61-1.65.
    Here each axis is rounded up to whole beams, as a radar steps them. A beam that sweeps goes
    through one column of beams after the other, so that it lights an azimuth once per scan. At an
    elevation ε beams one step of azimuth apart overlap by 1 - cos ε more; nobody saves beams by it.
    """
    counts = []
    for name, width, beam in (
        ("azimuth", azimuth_width_rad, azimuth_beamwidth_rad),
        ("elevation", elevation_width_rad, elevation_beamwidth_rad),
    ):
        positive(f"{name}_width_rad", width)
        positive(f"{name}_beamwidth_rad", beam)
        positive("spacing", spacing)
        counts.append(max(1, math.ceil(width / (spacing * beam) - _ROUNDING)))
    return BeamPositions(*counts)


def pulses_in(dwell_s: float, prf_hz: float) -> int:
    """Return the number of whole pulse intervals in a dwell, 0 or more."""
    return math.floor(dwell_s * prf_hz * (1.0 + _ROUNDING))


def unambiguous_range_m(prf_hz: float) -> float:
    """Return the range whose echo comes as the next pulse leaves, c / (2 PRF), m."""
    return SPEED_OF_LIGHT_M_S / (2.0 * prf_hz)


def round_trip_s(range_m: float) -> float:
    """Return the time an echo takes from a range, s."""
    return 2.0 * range_m / SPEED_OF_LIGHT_M_S
