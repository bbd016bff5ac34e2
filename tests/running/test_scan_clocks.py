"""Every sensor scans at the instants that its own four keys say."""

import numpy as np
import pytest
from covering import SENSORS, covers
from wired import alone, rows


def times(kind: str, **keys) -> np.ndarray:
    found = rows(alone(kind, **keys), "scans", block="sensor")
    assert [row["scan"] for row in found] == list(range(len(found)))
    return np.array([row["time_s"] for row in found])


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
def test_rate_offset_and_rate_error(kind):
    np.testing.assert_allclose(times(kind, scan_rate_hz=8), np.arange(8) / 8, atol=1e-9)
    np.testing.assert_allclose(times(kind, scan_rate_hz="5/2"), [0.0, 0.4, 0.8], atol=1e-9)
    later = times(kind, scan_rate_hz=8, offset_s=0.3)
    np.testing.assert_allclose(later, 0.3 + np.arange(6) / 8, atol=1e-9)
    # A quarter faster.
    fast = times(kind, scan_rate_hz=8, rate_error_ppm=250_000)
    np.testing.assert_allclose(fast, np.arange(10) / 10, atol=1e-9)


@covers("jitter_s", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
def test_jitter_is_a_standard_deviation_about_the_grid(kind):
    """200 draws: their deviation is within a fifth of the stated one (four standard errors)."""
    found = times(kind, scan_rate_hz=200, jitter_s=0.0005)
    shift = found - np.arange(len(found)) / 200
    assert np.std(shift[1:]) == pytest.approx(0.0005, rel=0.2)
    assert abs(np.mean(shift)) < 0.00015
