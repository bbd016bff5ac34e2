"""The law of reception against the 23 published regressions, which are not part of the project."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from components.surveillance.reception import FITTED_COEFFICIENTS, FITTED_RANGE_M, fitted

DATA = Path(os.environ.get("REFERENCE_DATA", Path(__file__).parents[3] / "shared" / "data"))
FILE = DATA / "published" / "adsb_reception" / "regression_models.csv"
#: Aircraft and airports around a receiver.
AROUND = np.array([50.0, 50.0, 1.0])


@pytest.fixture(scope="module")
def curves():
    if not FILE.exists():
        pytest.skip(f"there is no {FILE}")
    with FILE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    numbers = [row["Best Parameters"].strip("[]").split() for row in rows]
    by_order = np.array(numbers, dtype=float).reshape(-1, 4, 3) @ AROUND
    x = np.linspace(0.0, 1.0, 101)
    sums = 1.0 + by_order @ np.stack([x**n for n in (1, 2, 3, 4)])
    errors = [float(row["RMSE (Test) %"]) for row in rows]
    return x, np.clip(np.exp(-3.0 * x**2) * sums, 0.0, 1.0), np.array(errors)


def test_the_law_is_the_fit_to_the_median_receiver(curves):
    x, received, errors = curves
    assert len(received) == 23
    assert [round(errors.min(), 1), round(errors.max(), 1)] == [6.9, 22.4]
    median = np.median(received, axis=0)
    fall = np.exp(-3.0 * x**2)
    powers = np.stack([fall * x**n for n in (1, 2, 3, 4)], axis=1)
    best = np.linalg.lstsq(powers, median - fall, rcond=None)[0]
    assert best == pytest.approx(FITTED_COEFFICIENTS, abs=0.005)
    apart = 100.0 * np.sqrt(((received - fitted(x * FITTED_RANGE_M)) ** 2).mean(axis=1))
    near = apart < 2.5
    assert near.sum() == 18 and apart[~near].min() > 17.0 and apart.max() < 41.5
    assert np.sqrt((apart**2).mean()) == pytest.approx(13.3, abs=0.1)
