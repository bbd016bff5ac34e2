"""Angles between directions: every form against 40 digits, and against each other."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import (
    angle_between,
    angle_between_vectors,
    angle_by_haversine,
    angle_of_chord,
    chord_between,
    unit_vector,
    unit_vectors,
)

fast = settings(derandomize=True, deadline=None, max_examples=100)
azimuths = st.floats(-7.0, 7.0)
elevations = st.floats(-1.55, 1.55)
small = st.floats(-1.0, 1.0).map(lambda share: 10.0 ** (-9 * abs(share)) * (share or 1.0))


def exact_angle(p1, q1, p2, q2):
    with mpmath.workdps(40):
        p1, q1, p2, q2 = (mpmath.mpf(float(x)) for x in (p1, q1, p2, q2))
        one = (mpmath.cos(q1) * mpmath.cos(p1), mpmath.cos(q1) * mpmath.sin(p1), mpmath.sin(q1))
        two = (mpmath.cos(q2) * mpmath.cos(p2), mpmath.cos(q2) * mpmath.sin(p2), mpmath.sin(q2))
        chord = mpmath.sqrt(sum((a - b) ** 2 for a, b in zip(one, two, strict=True)))
        return float(2 * mpmath.asin(chord / 2))


@fast
@given(azimuths, elevations, azimuths, elevations)
def test_all_forms_agree_with_forty_digits_at_any_separation(p1, q1, p2, q2):
    truth = exact_angle(p1, q1, p2, q2)
    one, other = (np.array([a]) for a in (p1, q1)), (np.array([a]) for a in (p2, q2))
    one, other = tuple(one), tuple(other)
    assert angle_between(p1, q1, p2, q2) == pytest.approx(truth, rel=1e-14, abs=2e-15)
    vectors = angle_between_vectors(unit_vectors(*one), unit_vectors(*other))
    assert vectors[0] == pytest.approx(truth, rel=1e-14, abs=2e-15)
    # The two through an arc sine know half of the digits near half a turn.
    chord = chord_between(unit_vector(*one), unit_vector(*other))
    assert angle_of_chord(chord)[0] == pytest.approx(truth, rel=1e-14, abs=1e-7)
    assert angle_by_haversine(*one, *other)[0] == pytest.approx(truth, rel=1e-14, abs=1e-7)


@fast
@given(azimuths, elevations, small, small)
def test_small_separations_keep_their_digits(p1, q1, turn, climb):
    p2, q2 = p1 + turn, float(np.clip(q1 + climb, -1.57, 1.57))
    truth = exact_angle(p1, q1, p2, q2)
    angles = [np.array([value]) for value in (p1, q1, p2, q2)]
    assert angle_between(*angles)[0] == pytest.approx(truth, rel=2e-14, abs=1e-300)
    assert angle_by_haversine(*angles)[0] == pytest.approx(truth, rel=2e-14, abs=1e-150)


def test_angles_between_vectors_do_not_ask_for_their_length():
    one, other = np.array([0.0, 3.0, 0.0]), np.array([0.0, 2.0, 2.0])
    assert angle_between_vectors(one, other) == pytest.approx(np.pi / 4, rel=1e-15)
    assert angle_between_vectors(one, -one) == pytest.approx(np.pi, rel=1e-15)


def test_a_direction_that_is_not_there_stays_so():
    nan, zero = np.array([np.nan]), np.array([0.0])
    assert np.isnan(angle_by_haversine(nan, zero, zero, zero))
    assert np.isnan(angle_between_vectors(unit_vectors(nan, zero), unit_vectors(zero, zero)))
