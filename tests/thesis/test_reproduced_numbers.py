"""The rows of `dsa-des reproduce` against numbers worked out by hand from the equations."""

import math

import pytest
from scipy.optimize import brentq
from scipy.special import chndtr

DEG = math.pi / 180.0
# Pixels of Table 2.5 and 2.6 by hand.
EO_PIXEL = (220.0 / 6144.0 * DEG) * (60.0 / 2048.0 * DEG)
IR_PIXEL = (100.0 / 1024.0 * DEG) ** 2


def eo_km(area_m2):
    """Eq. 14-19 solved for the range: a = 0.3, threshold 1, P = 1, b = 0."""
    return math.sqrt(0.3 * area_m2 / EO_PIXEL) / 1000.0


def ir_km(area_m2):
    return math.sqrt(0.3 * area_m2 / IR_PIXEL) / 1000.0


def pd(rcs_dbsm, range_km):
    """Errata 16 and eq. 7: SNR scales with RCS / R⁴ from 0.9114 for 1.76 dBsm at 6.91 km."""
    snr = (math.log(0.05) / math.log(0.9114) - 1.0) * 10.0 ** ((rcs_dbsm - 1.76) / 10.0)
    return 0.05 ** (1.0 / (1.0 + snr * (6.91 / range_km) ** 4))


def bandwidth_hz(rcs_dbsm, range_km, wanted):
    """Eq. 7 and 8 with Table 2.2, T0 = 290 K and errata 16, solved for the bandwidth."""
    snr = math.log(0.05) / math.log(wanted) - 1.0
    received = 2.5 * 10**5.9 * 8.57e-3**2 * 10.0 ** (rcs_dbsm / 10.0 + 0.7)
    return received / ((4 * math.pi) ** 3 * (1e3 * range_km) ** 4 * 1.380649e-23 * 290 * 10**0.6
                       * snr)  # fmt: skip


def range_for_pd_km(rcs_dbsm, wanted):
    """Where `pd` is `wanted`: SNR goes with 1/R⁴ from 0.9114 for 1.76 dBsm at 6.91 km."""
    needed = math.log(0.05) / math.log(wanted) - 1.0
    there = (math.log(0.05) / math.log(0.9114) - 1.0) * 10.0 ** ((rcs_dbsm - 1.76) / 10.0)
    return 6.91 * (there / needed) ** 0.25


def rcs_for_pd_dbsm(range_km, wanted):
    needed = math.log(0.05) / math.log(wanted) - 1.0
    there = (math.log(0.05) / math.log(0.9114) - 1.0) * (6.91 / range_km) ** 4
    return 1.76 + 10.0 * math.log10(needed / there)


FLOWN = ((1.76, 22.4 / 6 * 1.852, 0.9114), (3.01, 35.5 / 9 * 1.852, 0.9170),
         (6.99, 57.9 / 11 * 1.852, 0.8668))  # fmt: skip


def by_one_bandwidth():
    """Pd of the three classes by the factor on SNR whose squared residuals are least."""

    def all_three(factor):
        return [0.05 ** (1 / (1 + factor * (math.log(0.05) / math.log(pd(dbsm, km)) - 1)))
                for dbsm, km, _ in FLOWN]  # fmt: skip

    def misfit(factor):
        return sum((a - c) ** 2 for a, (_, _, c) in zip(all_three(factor), FLOWN, strict=True))

    return all_three(min((0.5 + 0.0005 * k for k in range(1001)), key=misfit))


def swerling5_snr_db(wanted):
    """One pulse of a steady target: twice the power is noncentral chi-square of 2 degrees."""
    threshold = 2.0 * -math.log(0.05)
    root = brentq(lambda snr: chndtr(threshold, 2.0, 2.0 * snr) - (1.0 - wanted), 1e-3, 1e3)
    return 10.0 * math.log10(root)


def worst_of_eq_27():
    """Largest error of the corrected series (errata 15) for one pulse, SNR from -20 to 30 dB."""
    threshold, worst = -math.log(0.05), 0.0
    for step in range(501):
        snr = 10.0 ** (-2.0 + 0.01 * step)
        c3 = -(snr + 1 / 3) / (2 * snr + 1) ** 1.5
        c4, c6 = (snr + 0.25) / (2 * snr + 1) ** 2, 0.5 * c3 * c3
        v = (threshold - (1 + snr)) / math.sqrt(2 * snr + 1)
        series = 0.5 * math.erfc(v / math.sqrt(2)) - math.exp(-v * v / 2) / math.sqrt(
            2 * math.pi) * (c3 * (v * v - 1) + c4 * v * (3 - v * v)
                            - c6 * v * (v**4 - 10 * v * v + 15))  # fmt: skip
        exact = 1.0 - chndtr(2 * threshold, 2.0, 2.0 * snr)
        worst = max(worst, abs(min(max(series, 0.0), 1.0) - exact))
    return worst


def mean_first_detection_km(rcs_dbsm):
    """Looks every 150 m from 16 km on, inside 15 km; each detects with `pd` by itself."""
    missed, mean = 1.0, 0.0
    for look in range(7, 100):
        range_km = 16.0 - 0.15 * look
        mean += range_km * missed * pd(rcs_dbsm, range_km)
        missed *= 1.0 - pd(rcs_dbsm, range_km)
    return mean


CLIMB = math.sin(1.4 * DEG)

# item, start of the quantity, expected, absolute tolerance
ROWS = [
    ("fig-3.11", "area shown at relative heading 0°", 1.0, 1e-12),
    ("fig-3.11", "area shown at relative heading 180°", 1.5, 1e-12),
    ("fig-3.11", "area shown abeam", 1.25, 1e-12),
    ("fig-4.2", "SNR for Pd 0.9, Swerling I", 10 * math.log10(math.log(0.05) / math.log(0.9) - 1),
     1e-9),
    ("fig-4.2", "SNR for Pd 0.9, Swerling V", swerling5_snr_db(0.9), 1e-9),
    ("fig-4.2", "largest error of the lookup table, Swerling I", 0.0, 1e-6),
    ("fig-4.2", "largest error of the Gram-Charlier", worst_of_eq_27(), 1e-9),
    ("sec-4.1.1", "3.5 statute miles", 5.632704, 1e-9),
    ("sec-4.1.1", "first detection of 5 m²", 6.48 - 0.025, 0.026),
    ("sec-4.1.1", "Pd of 5 m² at 6.48 km, nautical", 0.9, 2e-4),
    ("sec-4.1.1", "Pd of 5 m² at 6.48 km, flight test", pd(6.9897, 6.48), 1e-6),
    ("sec-4.1.1", "range of Pd 0.9 for 5 m², specification", 5.6, 1e-6),
    ("sec-4.1.1", "bandwidth, flight test", bandwidth_hz(1.76, 6.91, 0.9114), 1e-4),
    ("sec-4.1.1", "bandwidth, specification", bandwidth_hz(6.9897, 5.6, 0.9), 1e-3),
    ("sec-4.1.1", "bandwidth, 3.5 nautical", bandwidth_hz(6.9897, 6.482, 0.9), 1e-3),
    ("fig-4.3", "Pd at 6.91 km", pd(1.76, 22.4 / 6 * 1.852), 1e-9),
    ("fig-4.4", "Pd at 7.31 km", pd(3.01, 35.5 / 9 * 1.852), 1e-9),
    ("fig-4.5", "Pd at 9.75 km", pd(6.99, 57.9 / 11 * 1.852), 1e-9),
    ("fig-4.4", "Pd at 7.31 km", 0.9170, 5e-4),  # as printed, §4.1.3
    ("sec-4.1.3", "how far Pd of the large class", 100 * (0.9 - pd(6.99, 57.9 / 11 * 1.852)), 1e-6),
    *(("sec-4.1.3", f"the same by one least-squares bandwidth, {name}", value, 5e-5)
      for name, value in zip(("small", "medium", "large"), by_one_bandwidth(), strict=True)),
    ("sec-4.1.3", "range at which the large class", range_for_pd_km(6.99, 0.8668), 1e-6),
    ("sec-4.1.3", "RCS that has Pd 0.8668", rcs_for_pd_dbsm(57.9 / 11 * 1.852, 0.8668), 1e-6),
    ("table-4.1", "RCS of the King Air", 6.99, 0.0),
    ("table-4.2", "average of Table 4.2, small", 41.48 / 6, 1e-9),
    ("table-4.2", "average of Table 4.2, medium", 65.73 / 9, 1e-9),
    ("table-4.2", "average of Table 4.2, large", 107.22 / 11, 1e-9),
    # The mean of 100 flights scatters by about a tenth of one flight's 0.4 km.
    *(("table-4.2", f"simulated average of the first detection, {name}",
       mean_first_detection_km(dbsm), 0.12)
      for name, (dbsm, _, _) in zip(("small", "medium", "large"), FLOWN, strict=True)),
    ("fig-4.8", "shown share at 0°, rotation about x", 42.0 / 132.0, 1e-9),
    ("fig-4.8", "shown share at 0°, rotation about y", 12.0 / 132.0, 1e-9),
    ("fig-4.9", "shown share at 0°, rotation about y", 7.0 / 277.0, 1e-9),
    ("fig-4.10", "shown share at 90°, rotation about z", 340.0 / 740.0, 1e-9),
    # What this gave: no other value is known. The union of the bodies is checked against pixels in
    # tests/optical/test_silhouette_union_of_bodies.py, eq. 9 to 13 by hand in
    # tests/optical/test_silhouette_thesis_model.py.
    ("table-4.3", "mean error, Beech 99, rotation about x", 3.97, 0.01),
    ("table-4.3", "maximum error, F-16, rotation about y", 22.56, 0.01),
    ("eq-34", "error in range for +20 % area, nearest", 1e3 * eo_km(12.0) * 0.0954451, 1e-3),
    ("eq-34", "error in range for +20 % area, farthest", 1e3 * eo_km(90.0) * 0.0954451, 1e-3),
    ("eq-34", "detection range at which +20 % area are 600 m", 600.0 / 95.44512, 1e-6),
    ("eq-34", "error in range for +20 % area, smallest", 9.54451, 1e-4),
    ("eq-34", "error in range for -20 % area", 10.55728, 1e-4),
    ("eq-34", "denominator of eq. 34 at the threshold, smallest", 3.6, 1e-9),
    ("eq-34", "denominator of eq. 34 at the threshold, largest", 27.0, 1e-9),
    ("table-4.4", "Level head-on, King Air, thesis", eo_km(12.0), 1e-9),
    ("table-4.4", "Level abeam, King Air, thesis", eo_km(12.0 + 30.0), 1e-9),
    ("table-4.4", "Level head-on, Convair, thesis", eo_km(90.0), 1e-9),
    ("table-4.4", "Ascending head-on, Convair, thesis", eo_km(90 + 250 * CLIMB), 1e-9),
    ("table-4.4", "Ascending head-on, Convair, exact", eo_km(90 + 650 * CLIMB), 1e-9),
    ("table-4.4", "Ascending head-on, King Air, thesis", eo_km(12 + 30 * CLIMB), 1e-9),
    ("table-4.4", "contrast P that gives the literature, Level head-on, King Air",
     (6.7 / eo_km(12.0)) ** 2, 1e-9),
    ("fig-4.11", "detection range tail-on, commercial transport", ir_km(65.0), 1e-9),
    ("fig-4.11", "detection range abeam, commercial transport", ir_km(48.75 + 223.0), 1e-9),
    ("fig-4.11", "detection range head-on, small fighter", ir_km(7.0), 1e-9),
    ("fig-4.13", "detection range abeam, general aviation", ir_km(4.6 + 6.0), 1e-9),
    ("fig-4.13", "abeam range, refined over first, general", math.sqrt(10.6 / 15.75), 1e-9),
    ("fig-4.14", "share of fused detections with a range", 1.0, 0.0),
    ("fig-4.14", "range within which the EO camera joins", 5.05, 0.1),
    ("fig-4.17", "outermost detection to the right, radar", 109.3, 0.75),
    ("fig-4.17", "outermost detection to the left, ir", 49.3, 0.75),
    ("fig-4.19", "spacing of the reported azimuths at 2.5°", 2.5, 1e-6),
    ("fig-4.20", "combinations of detection", 4.0, 0.0),
    ("fig-4.20", "azimuth up to which both detect", 14.3, 0.8),
    ("fig-4.21", "steps of the timed scene", 1800.0, 0.0),
    ("fig-4.22", "share of IR detections fused", 0.5, 0.0),
    ("fig-4.22", "IR detections", 60.0, 0.0),
    ("table-2.4", "AFRL, pixels in azimuth", 6144.0, 0.0),
    ("table-2.4", "AFRL, field of view in azimuth", 220.0, 1e-9),
    ("table-2.4", "farthest EO detection of TECVOL", 2.9625, 0.0376),
    # Navigation alone: bias 0.1°, noise 0.1°; the grid of 0.1° adds 0.1/sqrt(12).
    ("table-2.4", "TECVOL, mean azimuth error, EO", 0.1, 0.015),
    ("table-2.4", "TECVOL, standard deviation of the azimuth error, EO", 0.104, 0.006),
    ("table-2.4", "range of Pd 0.9 for the small aircraft", range_for_pd_km(1.76, 0.9), 1e-6),
]  # fmt: skip


@pytest.mark.parametrize(
    ("item", "quantity", "expected", "tolerance"), ROWS, ids=lambda value: str(value)[:50]
)
def test_number(results, item, quantity, expected, tolerance):
    found = [row for row in results[item].rows if row.quantity.startswith(quantity)]
    assert found, [row.quantity for row in results[item].rows]
    assert abs(found[0].ours - expected) <= tolerance * (1 + 1e-9), found[0].ours


def test_angle_errors_stay_within_half_a_step_of_the_grid(results):
    limits = {"radar alone": 0.5, "with EO": 0.5 * 220.0 / 6144.0}
    checked = 0
    for row in results["fig-4.14"].rows:
        for who, limit in limits.items():
            if row.quantity.startswith("largest") and row.quantity.endswith(who):
                assert 0.7 * limit < row.ours <= limit + 1e-9
                checked += 1
    assert checked == 4


def test_share_of_detections_scatters_about_pd(results):
    (row,) = [r for r in results["fig-4.18"].rows if r.quantity.startswith("chi-square")]
    assert 0.2 < row.ours < 2.1


def test_every_row_is_computed_and_says_why(results):
    for item, made in results.items():
        quantities = [row.quantity for row in made.rows]
        assert len(set(quantities)) == len(quantities), item
        for row in made.rows:
            assert math.isfinite(row.ours), (item, row.quantity)
            assert row.source_text.endswith("."), (item, row.quantity)
            if row.verdict == "differs because":
                assert len(row.because) > 20, (item, row.quantity)


def test_what_must_come_near_comes_near(results):
    """Everything the thesis prints and computes rightly from what it prints."""
    for item in ("fig-3.11", "table-4.1", "fig-4.14", "fig-4.17", "fig-4.19", "fig-4.22"):
        assert all(
            row.is_within_tolerance for row in results[item].rows if row.printed is not None
        ), item
    near = {row.quantity for row in results["table-4.4"].rows if row.is_within_tolerance}
    assert near == {
        "Ascending head-on, Convair, thesis's eq. 9-13",
        "Level abeam, King Air, thesis's eq. 9-13",
        "Level head-on, King Air, thesis's eq. 9-13",
        "Level head-on, Convair, thesis's eq. 9-13",
    }


def test_the_flights_of_fig_4_14_spread_about_the_printed_range(results):
    """By hand: the camera joins where the area that an overtaking aircraft shows is enough."""
    rows = {row.quantity: row.ours for row in results["fig-4.14"].rows}
    near, far = (rows[f"EO joins, King Air, {end} of 9 flights"] for end in ("nearest", "farthest"))
    assert near < 5.1 < far
    for left_m, above_m, found in ((500, 200, near), (3000, 800, far)):
        range_m = 5000.0
        for _ in range(50):
            across, up = math.asin(math.hypot(left_m, above_m) / range_m), above_m / range_m
            range_m = 1000.0 * eo_km(12.0 + 30.0 * math.sin(across) + 90.0 * up)
        # One scan of 70 m nearer at most.
        assert range_m / 1000.0 - 0.075 < found <= range_m / 1000.0 + 0.002
    transport = rows["EO joins, Boeing 787, nearest of 9 flights"]
    assert transport > 5.1 * 1.5
