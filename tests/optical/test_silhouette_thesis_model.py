"""The thesis's own silhouette, equations 6 and 9-13, term by term."""

import mpmath
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from components.optical.silhouette import visible_area

angles = st.floats(-7.0, 7.0)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(angles, angles, angles, angles, st.sampled_from([None, 5.0, 24.0]))
def test_agrees_with_the_printed_steps(heading, pitch, roll, elevation, back):
    area = visible_area(
        heading,
        pitch,
        roll,
        elevation,
        front_m2=12.0,
        side_m2=30.0,
        horizontal_m2=90.0,
        back_m2=back,
        model="thesis",
    )
    with mpmath.workdps(40):
        psi, theta_i, phi_i, q = (mpmath.mpf(a) for a in (heading, pitch, roll, elevation))
        theta, phi = q - theta_i, q - phi_i

        def shown(x):
            b = x * mpmath.sin(theta)  # eq. 10
            a = x * mpmath.cos(theta) * mpmath.sin(psi)  # eq. 9 and 11
            return mpmath.sqrt(b**2 + a**2)  # eq. 12, errata 8

        expected = shown(mpmath.mpf(30)) + shown(90 * mpmath.sin(phi))  # eq. 13
        if back is None:
            expected += 12
        else:
            expected += (back - 12) * (mpmath.cos(psi) / 2 + mpmath.mpf(1) / 2) + 12  # eq. 21
        assert abs(area - expected) <= 1e-12


def test_equals_the_exact_model_abeam_and_in_the_horizontal():
    elevation = np.linspace(-1.5, 1.5, 31)
    sizes = {"front_m2": 7.0, "side_m2": 20.0, "horizontal_m2": 250.0}
    for heading, el in ((np.pi / 2, elevation), (np.linspace(-3.0, 3.0, 31), 0.0)):
        thesis = visible_area(heading, 0.0, 0.0, el, **sizes, model="thesis")
        exact = visible_area(heading, 0.0, 0.0, el, **sizes, model="exact")
        np.testing.assert_allclose(thesis, exact, rtol=1e-14)
