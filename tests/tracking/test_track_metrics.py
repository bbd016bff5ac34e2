"""Scores of tracks, against enumeration and against tables written by hand."""

import itertools

import numpy as np
import pytest
from scipy.stats import chi2

from components.metrics.set_distances import set_distance
from components.metrics.track_tally import changes
from dsa_des.results.statistics import chi_square_bounds


def enumerated(distance, cutoff, order):
    """OSPA^p · max(m, n) and GOSPA^p as minima over everything that may be."""
    tracks, truths = distance.shape
    ospa, gospa = np.inf, np.inf
    for many in range(min(tracks, truths) + 1):
        for rows in itertools.combinations(range(tracks), many):
            for columns in itertools.permutations(range(truths), many):
                near = sum(min(distance[r, c], cutoff) ** order
                           for r, c in zip(rows, columns, strict=True))  # fmt: skip
                left = tracks + truths - 2 * many
                gospa = min(gospa, near + 0.5 * cutoff**order * left)
                if many == min(tracks, truths):
                    ospa = min(ospa, near + cutoff**order * abs(tracks - truths))
    return (ospa / max(tracks, truths)) ** (1 / order), gospa ** (1 / order)


@pytest.mark.parametrize("order", [1.0, 2.0, 3.0])
def test_distances_of_sets_are_the_least_of_all_assignments(order):
    rng = np.random.default_rng(8)
    for tracks, truths in [(1, 1), (2, 3), (3, 2), (3, 3), (0, 2), (2, 0), (1, 4)]:
        distance = rng.uniform(0, 150, (tracks, truths))
        found = set_distance(distance, 100.0, order)
        ospa, gospa = enumerated(distance, 100.0, order)
        assert found.ospa_m == pytest.approx(ospa)
        assert found.gospa_m == pytest.approx(gospa)
        parts = found.localisation_m, found.missed_m, found.false_m
        assert sum(part**order for part in parts) == pytest.approx(gospa**order)
    nothing = set_distance(np.empty((0, 0)), 100.0)
    assert nothing.ospa_m == nothing.gospa_m == 0.0


def test_bounds_are_quantiles_of_chi_square():
    np.testing.assert_allclose(chi_square_bounds(6), chi2.ppf([0.025, 0.975], 6))


def test_identities_break_and_swap():
    assert changes({0: [1, 1, 3, 3], 1: [2, 2]}) == (1.0, 0.0)
    assert changes({0: [1, 2, 2], 1: [2, 1, 1]}) == (0.0, 2.0)
