"""One module decides which numbers physics accepts; two rules have two names."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from components.arguments.checks import LARGEST, check_angle_rad, check_finite, check_squarable

numbers = st.floats(allow_nan=False, allow_infinity=False)
bad = pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, "far", None, [1.0, np.nan]])


@bad
@pytest.mark.parametrize("check", [check_finite, check_squarable, check_angle_rad])
def test_what_is_no_number_is_refused_by_name(check, value):
    with pytest.raises(ValueError, match=r"^range_m is "):
        check("range_m", value)


@given(numbers)
def test_finite_takes_any_size_as_it_is(value):
    assert float(check_finite("x", value)) == value


@given(numbers)
def test_squarable_takes_what_can_be_squared_and_refuses_the_rest(value):
    if abs(value) <= LARGEST:
        assert float(check_squarable("x", value)) == value
        assert np.isfinite(check_squarable("x", value) ** 2)
    else:
        with pytest.raises(ValueError, match=r"x is .*1e\+150"):
            check_squarable("x", value)


def test_squarable_says_which_element():
    with pytest.raises(ValueError, match=r"x is 1e\+200 \(element 1\)"):
        check_squarable("x", [1.0, 1e200, 2.0])


@given(numbers, numbers)
def test_two_angles_can_be_added(one, other):
    assert np.isfinite(check_angle_rad("a", one) + check_angle_rad("b", other))
    if abs(one) <= 1e15:
        assert float(check_angle_rad("a", one)) == one
