"""The exact silhouette against 40-digit rotation matrices."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.optical.silhouette import line_of_sight_in_target_axes, visible_area

AREAS = {"front_m2": 12.0, "side_m2": 30.0, "horizontal_m2": 90.0}
angles = st.floats(-10.0, 10.0)
tilts = st.floats(-np.pi / 2, np.pi / 2)


def reference(heading, pitch, roll, elevation, front, side, horizontal, back=None):
    """Multiply the three rotation matrices at 40 digits."""
    with mpmath.workdps(40):
        psi, theta, phi, el = (mpmath.mpf(float(a)) for a in (heading, pitch, roll, elevation))
        cos, sin = mpmath.cos, mpmath.sin
        u = mpmath.matrix([cos(el), 0, -sin(el)])
        yaw = mpmath.matrix([[cos(psi), sin(psi), 0], [-sin(psi), cos(psi), 0], [0, 0, 1]])
        nose_up = mpmath.matrix(
            [[cos(theta), 0, -sin(theta)], [0, 1, 0], [sin(theta), 0, cos(theta)]]
        )
        bank = mpmath.matrix([[1, 0, 0], [0, cos(phi), sin(phi)], [0, -sin(phi), cos(phi)]])
        u = bank * (nose_up * (yaw * u))
        sphere = front if back is None else (back - front) * (u[0] / 2 + mpmath.mpf(1) / 2) + front
        return sphere + side * mpmath.sqrt(u[1] ** 2 + u[2] ** 2) + horizontal * abs(u[2])


@settings(derandomize=True, deadline=None, max_examples=100)
@given(angles, tilts, angles, tilts, st.sampled_from([None, 5.0, 24.0]))
def test_agrees_with_rotation_matrices(heading, pitch, roll, elevation, back):
    area = visible_area(heading, pitch, roll, elevation, **AREAS, back_m2=back)
    assert abs(area - reference(heading, pitch, roll, elevation, 12, 30, 90, back)) <= 1e-12


@pytest.mark.parametrize("level", [0, 1, 2])
def test_one_that_flies_level_beside_others_changes_nothing_of_theirs(level):
    """And each is as alone, whether all, some or none of a look pitch."""
    views = np.array([[0.3, 0.4, -0.7, 0.2], [2.5, -0.2, 0.1, -0.4], [-1.1, 0.6, 1.9, 0.3]]).T
    views[1, :level] = 0.0
    area = visible_area(*views, **AREAS)
    for k in range(3):
        assert abs(area[k] - reference(*views[:, k], 12, 30, 90)) <= 1e-12


@pytest.mark.parametrize("approaching", [False, True])
@pytest.mark.parametrize("off_rad", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_side_keeps_its_digits_along_the_long_axis(approaching, off_rad):
    # A climbing target seen almost exactly along its axis; 1 - cos² would be all noise here.
    heading = np.pi if approaching else 0.0
    elevation = -0.3 if approaching else 0.3
    view = (heading + 0.7 * off_rad, 0.3, 0.2, elevation + off_rad)
    side = visible_area(*view, front_m2=0.0, side_m2=1.0, horizontal_m2=0.0)
    exact = reference(*view, 0, 1, 0)
    assert abs(side / exact - 1) < 1e-13


def test_signs_of_the_body_axes():
    def axes(*view):
        return [float(a[0]) for a in line_of_sight_in_target_axes(*(np.array([v]) for v in view))]

    quarter = np.pi / 2
    # Flies away: the line of sight leaves through the nose. Below us: through the belly.
    assert axes(0.0, 0.0, 0.0, 0.0)[:3] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert axes(0.0, 0.0, 0.0, -quarter)[:3] == pytest.approx([0.0, 0.0, 1.0], abs=1e-15)
    # Crosses to the right: we see its right wing, the line of sight runs from right to left.
    assert axes(quarter, 0.0, 0.0, 0.0)[:3] == pytest.approx([0.0, -1.0, 0.0], abs=1e-15)
    # ... with the right wing down by 30 degrees, towards us, we see its upper side.
    assert axes(quarter, 0.0, np.pi / 6, 0.0)[2] == pytest.approx(0.5)
    # Flies away with its nose up: we see its upper side.
    assert axes(0.0, 0.2, 0.0, 0.0)[2] == pytest.approx(np.sin(0.2))
    assert axes(0.0, 0.2, 0.0, 0.2)[3] == pytest.approx(0.0, abs=1e-16)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    angles,
    tilts,
    angles,
    tilts,
    st.tuples(*[st.floats(0.0, 1e3)] * 4),
    st.sampled_from(["exact", "thesis", "convex_hull"]),
)
def test_area_is_never_negative_and_turns_with_the_circle(
    heading, pitch, roll, elevation, sizes, model
):
    front, side, horizontal, back = sizes
    known = {"front_m2": front, "side_m2": side, "horizontal_m2": horizontal, "model": model}
    for back_m2 in (None, back):
        area = visible_area(heading, pitch, roll, elevation, **known, back_m2=back_m2)
        assert area >= 0.0
        assert area <= max(front, back) + side + horizontal + 1e-9
        turned = visible_area(heading + 2 * np.pi, pitch, roll, elevation, **known, back_m2=back_m2)
        # The plate's tilt may cross the flat state, where the union has a square-root edge.
        assert turned == pytest.approx(area, abs=1e-6 * (1.0 + front + side + horizontal))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"front_m2": -1.0}, "front_m2 is -1"),
        ({"side_m2": np.nan}, "side_m2 is nan"),
        ({"back_m2": [3.0, -2.0]}, "back_m2 is -2"),
        ({"horizontal_m2": None}, "horizontal_m2 is missing"),
        ({"front_m2": "wide"}, "front_m2 is 'wide'"),
        ({"model": "cube"}, "model is 'cube'.*exact, thesis"),
        ({"pitch_rad": np.inf}, "pitch_rad is inf"),
        ({"roll_rad": [0.0, np.nan]}, "roll_rad is nan"),
        ({"pitch_rad": [0.0, 1.0], "roll_rad": [0.0, 1.0, 2.0]}, "do not broadcast"),
        ({"model": "aspect_table"}, "table is None"),
    ],
)
def test_bad_input_is_named(change, says):
    call = {"relative_heading_rad": 0.0, "pitch_rad": 0.0, "roll_rad": 0.0, "elevation_rad": 0.0}
    with pytest.raises(ValueError, match=says):
        visible_area(**{**call, **AREAS, **change})


def test_huge_finite_angles_give_no_warning():
    area = visible_area(1e308, 1.7e308, -1e308, -1.7e308, **AREAS)
    assert 12.0 <= area <= 132.0
