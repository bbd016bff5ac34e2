"""The silhouette area of an aircraft by the thesis's own equations 6 and 9-13."""

from __future__ import annotations

import numpy as np

from components.arguments.checks import FloatArray
from components.optical.silhouette_exact import front_and_back_area


def thesis_area(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
    front_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    back_m2: FloatArray | None,
) -> FloatArray:
    """Sum the projections as thesis eq. 9-13 give them (errata 4, 8, 12).

    With psi = relative heading, theta = elevation - pitch and phi = elevation - roll (eq. 6),

        shown = sqrt(sin² theta + cos² theta · sin² psi)          (eq. 12, its right-hand side)
        area  = front + side · shown + horizontal · |sin phi| · shown

    With `back_m2` the front becomes eq. 21's mix with cos psi. The plane is projected twice, as
    printed (eq. 13 put into eq. 12), and roll shares an axis with elevation only abeam: for
    attitudes other than level the exact model is the one to use. Magnitudes are taken, so the
    area is never negative.

    Parameters
    ----------
    relative_heading_rad, pitch_rad, roll_rad, elevation_rad : flat arrays, rad
    front_m2, side_m2, horizontal_m2, back_m2 : flat arrays, m²

    Returns
    -------
    flat array, m²
    """
    theta_rad = elevation_rad - pitch_rad
    phi_rad = elevation_rad - roll_rad
    shown = np.hypot(np.sin(theta_rad), np.cos(theta_rad) * np.sin(relative_heading_rad))
    sphere = front_m2
    if back_m2 is not None:
        sphere = front_and_back_area(np.cos(relative_heading_rad), front_m2, back_m2)
    return sphere + side_m2 * shown + horizontal_m2 * np.abs(np.sin(phi_rad)) * shown
