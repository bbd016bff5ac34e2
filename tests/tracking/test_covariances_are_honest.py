"""Are tracks as wrong as they say? The measuring command's cases, with fewer replicas."""

import pytest
from scipy.stats import chi2

from docs.make.track_consistency import CASES, nees_of, summary


@pytest.mark.parametrize("name", ["velocity", "missed"])
def test_the_mean_of_normalised_errors_is_that_of_chi_square(name):
    """At the 99.9 % of 24 tracks: a wrong variance, frame or time is off by far more."""
    found = summary(nees_of(CASES[name], 24))
    low, high = chi2.ppf([0.0005, 0.9995], 6 * 24) / 24
    assert low < found["mean"] < high
    assert found["lost"] == 0.0


def test_a_variance_that_is_stated_too_small_is_found_out():
    from dataclasses import replace

    case = CASES["radar"]
    sensors = {"radar": {**case.sensors["radar"], "azimuth_error_deg": 1.0,
                         "azimuth_correlation_time_s": 30.0}}  # fmt: skip
    found = summary(nees_of(replace(case, sensors=sensors), 24))
    assert found["mean"] > 8.0
