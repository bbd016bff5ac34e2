"""The law of reception against the 23 published regressions, which are not part of the project."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from components.surveillance.reception import (
    BY_AIRCRAFT,
    BY_AIRPORT,
    FITTED_COEFFICIENTS,
    FITTED_RANGE_M,
    fitted_reception_probability,
)

DATA = Path(os.environ.get("REFERENCE_DATA", Path(__file__).parents[3] / "shared" / "data"))
FILE = DATA / "published" / "adsb_reception" / "regression_models.csv"


@pytest.fixture(scope="module")
def curves():
    """Curves of the receivers amid so many aircraft and airports."""
    if not FILE.exists():
        pytest.skip(f"there is no {FILE}")
    with FILE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    numbers = [row["Best Parameters"].strip("[]").split() for row in rows]
    parameters = np.array(numbers, dtype=float).reshape(-1, 4, 3)
    x = np.linspace(0.0, 1.0, 101)
    errors = [float(row["RMSE (Test) %"]) for row in rows]

    def amid(aircraft, airports):
        by_order = parameters @ np.array([aircraft, airports, 1.0])
        sums = 1.0 + by_order @ np.stack([x**n for n in (1, 2, 3, 4)])
        return np.clip(np.exp(-3.0 * x**2) * sums, 0.0, 1.0)

    return x, amid, np.array(errors)


def test_the_law_is_the_fit_to_the_median_receiver(curves):
    x, amid, errors = curves
    received = amid(50.0, 50.0)
    assert len(received) == 23
    assert [round(errors.min(), 1), round(errors.max(), 1)] == [6.9, 22.4]
    median = np.median(received, axis=0)
    fall = np.exp(-3.0 * x**2)
    powers = np.stack([fall * x**n for n in (1, 2, 3, 4)], axis=1)
    best = np.linalg.lstsq(powers, median - fall, rcond=None)[0]
    assert best == pytest.approx(FITTED_COEFFICIENTS, abs=0.005)
    law = fitted_reception_probability(x * FITTED_RANGE_M, 50.0, 50.0)
    apart = 100.0 * np.sqrt(((received - law) ** 2).mean(axis=1))
    near = apart < 2.5
    assert near.sum() == 18 and apart[~near].min() > 17.0 and apart.max() < 41.5
    assert np.sqrt((apart**2).mean()) == pytest.approx(13.3, abs=0.1)


def test_the_law_follows_the_median_receiver_through_traffic(curves):
    """Its slopes are the least squares of all medians; at the median of traffic 12 % are left."""
    x, amid, _ = curves
    fall = np.exp(-3.0 * x**2)
    powers = np.stack([fall * x**n for n in (1, 2, 3, 4)], axis=1)
    left, right = [], []
    for aircraft in (10, 25, 50, 75, 95, 125, 150, 200, 250):
        for airports in range(20, 81, 10):
            columns = powers[:, :, np.newaxis] * np.array([aircraft - 50.0, airports - 50.0])
            left.append(columns.reshape(len(x), 8))
            median = np.median(amid(aircraft, airports), axis=0)
            right.append(median - fall - powers @ np.array(FITTED_COEFFICIENTS))
    best = np.linalg.lstsq(np.concatenate(left), np.concatenate(right), rcond=None)[0]
    assert best.reshape(4, 2)[:, 0] == pytest.approx(BY_AIRCRAFT, abs=1e-4)
    assert best.reshape(4, 2)[:, 1] == pytest.approx(BY_AIRPORT, abs=1e-3)
    for aircraft, together in ((20.0, 14.1), (95.0, 12.2), (200.0, 9.4)):
        law = fitted_reception_probability(x * FITTED_RANGE_M, aircraft, 50.0)
        apart = 100.0 * np.sqrt(((amid(aircraft, 50.0) - law) ** 2).mean(axis=1))
        assert np.sqrt((apart**2).mean()) < together
        assert np.sort(apart)[17] < 3.0
