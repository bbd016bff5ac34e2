"""The exact Pd and 1 - Pd against 50-digit values made by two methods (make_pd_table.py)."""

import csv
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest

from components.radar.detection import (
    detection_probability,
    detection_threshold,
    miss_probability,
)

with (Path(__file__).parent / "pd_table.csv").open(encoding="utf-8") as file:
    ROWS = list(csv.DictReader(file))

RADARS = sorted({(int(row["pulses"]), float(row["pfa"])) for row in ROWS})


@pytest.mark.parametrize("model", [f"swerling{i}" for i in range(5)])
def test_both_sides_of_every_row(model):
    rows = [row for row in ROWS if row["model"] == model]
    assert len(rows) == 98
    for row in rows:
        snr = 10.0 ** (float(row["snr_db"]) / 10.0)
        radar = {
            "pulses": int(row["pulses"]),
            "false_alarm_probability": float(row["pfa"]),
            "model": model,
        }
        for function, text in ((detection_probability, row["pd"]), (miss_probability, row["miss"])):
            ours, truth = float(function(snr, **radar)), mpmath.mpf(text)
            where = f"{function.__name__} {row}: {ours!r}"
            if truth > 1e-250:
                assert abs(ours / truth - 1) < 1e-12, where
            else:
                assert 0.0 <= ours < 1e-240, where


@pytest.mark.parametrize(("pulses", "pfa"), [*RADARS, (3, 0.9), (300, 1e-9), (1, 1e-12)])
def test_threshold_is_the_root(pulses, pfa):
    ours = float(detection_threshold(pulses, pfa))
    with mpmath.workdps(40):
        tail = mpmath.gammainc(pulses, ours, mpmath.inf, regularized=True)
        slope = mpmath.exp((pulses - 1) * mpmath.log(ours) - ours - mpmath.loggamma(pulses))
        error = (tail - mpmath.mpf(pfa)) / slope
    assert abs(error) < 4e-16 * ours


def test_one_row_is_recomputed_here():
    """The frozen table is what its definition says: integrate the steady echo's density."""
    pulses, pfa, snr = 5, 1e-4, 10.0**0.3
    row = next(
        r
        for r in ROWS
        if (r["model"], r["pulses"], r["snr_db"]) == ("swerling0", "5", "3")
        and float(r["pfa"]) == pfa
    )
    with mpmath.workdps(25):
        v = mpmath.findroot(
            lambda x: mpmath.log(mpmath.gammainc(pulses, x, mpmath.inf, regularized=True) / pfa),
            14.0,
        )
        echo = mpmath.mpf(pulses) * snr

        def density(y):
            return (
                (y / echo) ** mpmath.mpf((pulses - 1) / 2)
                * mpmath.exp(-y - echo)
                * mpmath.besseli(pulses - 1, 2 * mpmath.sqrt(y * echo))
            )

        missed = mpmath.quad(density, mpmath.linspace(0, v, 4))
    assert float(missed) == pytest.approx(float(row["miss"]), rel=1e-15)


def test_swerling_1_and_3_of_a_sampled_echo_average_the_steady_one():
    """The fluctuating models are the steady one averaged over the echo's distribution."""
    nodes, weights = np.polynomial.laguerre.laggauss(60)
    radar = {"pulses": 4, "false_alarm_probability": 1e-3}
    for snr in (0.3, 1.0, 4.0):
        steady_1 = detection_probability(snr * nodes, model="swerling0", **radar)
        assert float(weights @ steady_1) == pytest.approx(
            float(detection_probability(snr, model="swerling1", **radar)), abs=1e-5
        )
        steady_3 = detection_probability(snr * nodes / 2.0, model="swerling0", **radar)
        assert float((weights * nodes) @ steady_3) == pytest.approx(
            float(detection_probability(snr, model="swerling3", **radar)), abs=1e-5
        )


def test_one_pulse_swerling_1_in_closed_form():
    snr = np.array([0.1, 1.0, 20.0])
    expected = [math.exp(math.log(0.05) / (1.0 + s)) for s in snr]
    pd = detection_probability(snr, false_alarm_probability=0.05)
    np.testing.assert_allclose(pd, expected, rtol=1e-15)
