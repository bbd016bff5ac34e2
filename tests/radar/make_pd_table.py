"""Compute Pd and 1 - Pd at 50 digits by two independent methods and write pd_table.csv.

    python tests/radar/make_pd_table.py [OUTPUT.csv]

Method 1 adds up the mixture of gamma distributions (the definition, positive terms). Method 2 knows
only the moment generating function of the detector's sum, and inverts it: a contour integral along
a parabola through the saddle point, by the trapezoidal rule, refined until it stands still. The
threshold is the root of mpmath's incomplete gamma function. A row is written when the two methods
agree to 1e-25; otherwise the script stops.
"""

from __future__ import annotations

import csv
import itertools
import sys
from pathlib import Path

import mpmath
from mpmath import mpf

DIGITS = 50
AGREEMENT = mpf(10) ** -25
MODELS = ("swerling0", "swerling1", "swerling2", "swerling3", "swerling4")


def threshold(pulses, pfa):
    """Root of the upper regularised gamma function, with the double `pfa` taken exactly."""
    target = mpmath.log(mpf(pfa))
    start = mpf(pulses) + mpmath.sqrt(2 * pulses * -target) - target
    return mpmath.findroot(
        lambda v: mpmath.log(mpmath.gammainc(pulses, v, mpmath.inf, regularized=True)) - target,
        (start, start * mpf("0.9")),
        tol=mpf(10) ** (-2 * DIGITS + 10),
    )


def shape_of(model, pulses):
    return {
        "swerling0": None,
        "swerling1": 1,
        "swerling2": pulses,
        "swerling3": 2,
        "swerling4": 2 * pulses,
    }[model]


def noise_terms(pulses, v):
    """Sum of the Poisson terms below pulses + j, and from there on, for j = 0, 1, …"""
    first = mpmath.exp((pulses - 1) * mpmath.log(v) - v - mpmath.loggamma(pulses))
    below = mpmath.gammainc(pulses, v, mpmath.inf, regularized=True)
    terms, m = [], pulses
    term = first
    while True:
        term = term * v / m
        terms.append(term)
        m += 1
        if m > v and term < mpf(10) ** -420:
            break
    above, total = [], mpf(0)
    for term in reversed(terms):
        total += term
        above.append(total)
    above.reverse()
    gains = []
    for term in terms:
        gains.append(below)
        below += term
    return gains, above


def by_mixture(model, pulses, snr, terms):
    gains, misses = terms
    echo, shape = pulses * snr, shape_of(model, pulses)
    if shape is None:
        weight, z = mpmath.exp(-echo), echo
    else:
        c = echo / shape
        weight, z = (1 + c) ** -shape, c / (1 + c)
    pd = miss = used = mpf(0)
    for j, (gain, lost) in enumerate(zip(gains, misses, strict=True)):
        pd += weight * gain
        miss += weight * lost
        used += weight
        weight = weight * z / (j + 1) * (1 if shape is None else j + shape)
    return pd + (1 - used), miss


def by_contour(model, pulses, snr, v, *, miss):
    """P(sum < v) with the contour right of the pole at 0, P(sum > v) left of it."""
    echo, shape = pulses * snr, shape_of(model, pulses)

    def exponent(s):
        if shape is None:
            log_mgf = -pulses * mpmath.log(1 + s) - echo * s / (1 + s)
        else:
            c = echo / shape
            log_mgf = -(pulses - shape) * mpmath.log(1 + s) - shape * mpmath.log(1 + (1 + c) * s)
        return log_mgf + s * v

    wall = mpf(-1) if shape is None else -1 / (1 + echo / shape)
    # The saddle point, roughly: the smallest value on the real axis, by golden section.
    with mpmath.workdps(20):
        low, high = (mpf(-60), mpf(60)) if miss else (mpf("-60"), mpf(60))
        place = (lambda x: mpmath.exp(x)) if miss else (lambda x: wall / (1 + mpmath.exp(x)))
        golden = (mpmath.sqrt(5) - 1) / 2

        def height(x):
            s = place(x)
            return mpmath.re(exponent(s)) - mpmath.log(abs(s))

        for _ in range(90):
            a, b = high - golden * (high - low), low + golden * (high - low)
            if height(a) < height(b):
                high = b
            else:
                low = a
        c = place((low + high) / 2)
        step = min(abs(c), c - wall) / 2
        curvature = (
            mpmath.re(exponent(c + step / 64))
            - 2 * mpmath.re(exponent(c))
            + mpmath.re(exponent(c - step / 64))
        ) / (step / 64) ** 2 + 1 / c**2
        scale = 1 / mpmath.sqrt(curvature)
    # Bending back ends the contour; gently, to stay clear of the singularity at -1.
    bend = 1 / (2 * (c + 1))

    def integrand(u):
        # sinh spreads the points from the saddle's width to the parabola's.
        y = scale * mpmath.sinh(u)
        s = mpmath.mpc(c - bend * y * y, y)
        slope = mpmath.mpc(1, 2 * bend * y) * scale * mpmath.cosh(u)
        return mpmath.re(mpmath.exp(exponent(s)) / s * slope)

    # ds = (i - 2 bend y) dy; dividing by i gives 1 + 2i bend y.
    h = mpf(1) / 16
    total, last = None, None
    for _ in range(7):
        total = integrand(mpf(0)) / 2
        u = h
        while True:
            value = integrand(u)
            total += value
            if abs(value) < abs(total) * mpf(10) ** -40 and u > 2:
                break
            u += h
        total = total * h / mpmath.pi
        if last is not None and abs(total - last) < abs(total) * AGREEMENT / 100:
            break
        last, h = total, h / 2
    return total if miss else -total


def both(model, pulses, snr, v, terms, *, compare=True):
    pd, miss = by_mixture(model, pulses, snr, terms)
    if compare:
        for value, lost in ((pd, False), (miss, True)):
            if value > mpf(10) ** -300:
                # Near 1 the contour is squeezed between pole and singularity: take the other side.
                side = lost if value < 0.5 else not lost
                other = by_contour(model, pulses, snr, v, miss=side)
                other = other if side == lost else 1 - other
                if abs(other / value - 1) > AGREEMENT:
                    raise SystemExit(
                        f"{model} {pulses} {snr} miss={lost}: {mpmath.nstr(value, 30)} by mixture,"
                        f" {mpmath.nstr(other, 30)} by contour"
                    )
    return pd, miss


def main():
    mpmath.mp.dps = DIGITS
    here = Path(__file__).parent / "pd_table.csv"
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else here
    radars = [(1, 0.1), (1, 1e-6), (2, 1e-12), (5, 1e-4), (10, 1e-9), (100, 1e-2), (1000, 1e-6)]
    ratios_db = (-60, -33, -16, -9, -4, 0, 3, 7, 11, 15, 19, 24, 37, 60)
    with output.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["model", "pulses", "pfa", "snr_db", "pd", "miss"])
        for pulses, pfa in radars:
            v = threshold(pulses, pfa)
            terms = noise_terms(pulses, v)
            for model, db in itertools.product(MODELS, ratios_db):
                # The double nearest to 10^(dB/10), taken exactly, is what the code under test sees.
                snr = mpf(10.0 ** (db / 10.0))
                pd, miss = both(model, pulses, snr, v, terms)
                writer.writerow(
                    [model, pulses, pfa, db, mpmath.nstr(pd, 20), mpmath.nstr(miss, 20)]
                )
            print(pulses, pfa, "done", flush=True)


if __name__ == "__main__":
    main()
