"""Confidence intervals against published numbers and by coverage."""

import math

import numpy as np
import pytest

from dsa_des.results import differences, statistics
from dsa_des.results.labels import (
    AxisName,
    axis_label,
    format_with_interval,
    readable_label,
    unit_of,
    value_label,
)
from dsa_des.results.printing import rounded_value_and_interval
from dsa_des.results.record import NUMBER, Result
from dsa_des.results.report import _summary_cells
from dsa_des.results.summary import Line


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in
        # Medicine 17 (1998), table I, method 3 (score).
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0000, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_newcombes_table(successes: int, trials: int, low: float, high: float) -> None:
    assert statistics.wilson_interval(successes, trials, 0.95) == pytest.approx(
        (low, high), abs=5e-5
    )


def test_a_mean_of_fractions_and_a_difference_of_shares_have_possible_intervals() -> None:
    values = np.array([1.0] * 10 + [0.75, 0.9, 0.8, 0.2])
    told, plain = (
        statistics.estimate_bounded_mean(values, 0.95),
        statistics.estimate_mean(values, 0.95),
    )
    assert plain.high > 1.0 > told.high > told.value == plain.value > told.low > 0.0
    # As wide as Student's in the middle; at an end where all are alike each is a trial of Wilson's.
    half = np.array([0.4, 0.5, 0.6, 0.45, 0.55] * 20)
    both = statistics.estimate_bounded_mean(half, 0.95), statistics.estimate_mean(half, 0.95)
    assert both[0].half_width == pytest.approx(both[1].half_width, rel=0.01)
    alike = statistics.estimate_bounded_mean(np.ones(20), 0.95)
    assert (alike.low, alike.high) == pytest.approx((1.0 - 0.1611, 1.0), abs=5e-5)
    found = differences.estimate_difference(
        np.zeros(3), np.array([0.9, 0.2, 1.0]), 0.95, kind="fraction"
    )
    assert (found.paired.high, found.unpaired.high) == (1.0, 1.0) and found.paired.value < 0.8


def test_missing_values_are_counted_and_left_out() -> None:
    first = np.array([1.0, np.nan, 3.0, 4.0])
    second = np.array([2.0, 2.0, np.nan, 6.0])
    found = differences.estimate_difference(first, second, 0.95)
    assert (found.paired.count, found.only_first, found.only_second) == (2, 1, 1)
    assert found.paired.value == 1.5
    assert math.isnan(statistics.estimate_mean(np.array([np.nan]), 0.95).value)


def test_few_values_are_marked() -> None:
    assert statistics.estimate_mean(np.arange(9.0), 0.95).few
    assert not statistics.estimate_mean(np.arange(10.0), 0.95).few
    one = statistics.estimate_mean(np.array([4.0]), 0.95)
    assert one.value == 4.0 and math.isnan(one.low) and one.few
    assert statistics.estimate_share(np.array([3.0]), np.array([5.0]), 0.95).few


@pytest.mark.parametrize(
    ("value", "low", "high", "shown"),
    [
        (8842.9, 8211.5, 9474.2, ("8,840", "8,210 to 9,470")),
        (-0.30771, -0.5131, -0.1023, ("-0.31", "-0.51 to -0.10")),
        (1.0, 0.83887, 1.0, ("1.000", "0.839 to 1.000")),
        (-1e-4, -0.0092155, 0.0092155, ("-0.0001", "-0.0092 to 0.0092")),
        (0.0, -0.0092155, 0.0092155, ("0.0000", "-0.0092 to 0.0092")),
        # Equal ratios, whose difference is how they were rounded.
        (5.6e-17, -3e-17, 1.4e-16, ("0", "0 to 0")),
        (0.25, 0.25 - 1e-16, 0.25 + 1e-16, ("0.25", "0.25 to 0.25")),
        (math.nan, math.nan, math.nan, ("-", "")),
        (3.25, 2.0, math.inf, ("3.25", "2 to inf")),
    ],
)
def test_values_are_rounded_to_what_is_known(
    value: float, low: float, high: float, shown: tuple[str, str]
) -> None:
    assert rounded_value_and_interval(statistics.Estimate(value, low, high, 20, False)) == shown
    starred = (shown[0], f"{shown[1]} *" if shown[1] else "")
    assert rounded_value_and_interval(statistics.Estimate(value, low, high, 3, True)) == starred


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (1.23456, 0.12345, "+1.23 ± 0.12"), (-1234.5, 67.8, "-1,234 ± 68"),
        (0.00123456, 0.1, "+0.00 ± 0.10"), (-1.23456, math.nan, "-1.23"), (1234.5, 0.0, "+1234"),
    ],
)  # fmt: skip
def test_differences_are_written_to_two_digits_of_half_their_interval(
    value: float, half: float, shown: str
) -> None:
    assert format_with_interval(value, half) == shown


def test_axes_of_figures_carry_units() -> None:
    assert readable_label("declaration_range_m.radar") == "Declaration range, radar (m)"
    assert readable_label("track_breaks") == "Track breaks"
    assert readable_label("track_nees") == "Track NEES"
    assert readable_label("fused_share.ir_with_radar") == "Fused share, IR with radar"
    assert axis_label("radar.scan_rate_hz") == "Radar scan rate (Hz)"
    assert axis_label("swap.fusion") == "Type of fusion"
    assert axis_label("weather.rain_mm_per_h") == "Weather rain (mm/h)"
    assert axis_label("traffic.intruders[0].rcs_dbsm") == "Traffic intruder 1 RCS (dBsm)"
    assert axis_label("wires[4].drop_probability") == "Wire 5 drop probability"
    lost = AxisName("wires[4].drop_probability", "wire from radar to fusion:.drop_probability")
    assert axis_label(lost) == "Wire from radar to fusion: drop probability"
    assert value_label(lost, 0.1) == "wire from radar to fusion: drop probability 0.1"
    assert value_label("x" * 80, 5.0).endswith("… 5")
    assert axis_label(AxisName("radar.scan_rate_hz")) == "Radar scan rate (Hz)"
    assert value_label("bearing_deg", 30.0) == "bearing 30°"
    assert value_label("ir.rate_error_ppm", 100) == "IR rate error 100 ppm"
    assert value_label("swap.fusion", "fusion.gated") == "fusion.gated"
    assert unit_of("declaration_time_s.any") == "s" and unit_of("track_breaks") == ""


@pytest.mark.parametrize(
    ("exact", "said"),
    [
        (False, ("Declaration range, radar (m)", "1,235", "1,200 to 1,269 *")),
        (True, ("declaration_range_m.radar", "1234.6", "1200.1 to 1269 *")),
    ],
)
def test_a_line_of_the_report_is_in_words_and_rounded_or_as_its_table_has_it(
    exact: bool, said: tuple[str, ...]
) -> None:
    estimate = statistics.Estimate(1234.567, 1200.1, 1269.03, 12, True)
    result = Result("declaration_range_m.radar", NUMBER, "true slant range then, m")
    line = Line((5.0, "x"), result, estimate, 2, 1250.0, runs=14, cut_off=(("never", 2),))
    cells = _summary_cells(line, exact) if exact else _summary_cells(line)
    assert cells == ("5", "x", *said, 12, 2, "few", "2 of 14 never", "1250")
