"""Scan clocks never drift: every instant is what rational arithmetic says, after any time."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dsa_des.time.clock import (
    MAX_TICK,
    ClockSpec,
    ScanClock,
    common_ticks_per_second,
    parse_rational,
)
from dsa_des.time.randomness import Streams

DRAWS = Streams(5).scan_normal_function("radar", "clock jitter")


def clocks_of(*specs):
    """Return clocks with a common resolution, and that resolution."""
    ticks_per_s = common_ticks_per_second(
        time for spec in specs for time in spec.times_needing_whole_ticks()
    )
    return [ScanClock(spec, ticks_per_s, DRAWS) for spec in specs], ticks_per_s


def spec_of(rate, offset=0, **kwargs):
    return ClockSpec(parse_rational(rate), parse_rational(offset), **kwargs)


def ticks_within(clock, ticks_per_s, seconds):
    return clock.scans_between(0, seconds * ticks_per_s)[1]


@pytest.mark.parametrize(
    ("rate_a", "rate_b", "seconds", "common"),
    [
        (10, 30, 3600, 36_000),
        (5, 2, 3600, 3600),
        # 30000/1001 and 25 Hz meet every lcm(1001/30000, 1/25) s = 1001/25 s.
        ("30000/1001", 25, 36_000, math.ceil(Fraction(36_000) / Fraction(1001, 25))),
        # 29.97 = 2997/100 and 25 Hz: periods 100/2997 and 1/25 meet every 100 s.
        (29.97, 25, 36_000, 360),
        ("1/3", "1/7", 36_000, math.ceil(Fraction(36_000, 21))),
        ("24000/1001", "30000/1001", 7200, math.ceil(Fraction(7200) / Fraction(1001, 6000))),
    ],
)
def test_two_clocks_meet_exactly_as_often_as_rational_arithmetic_says(
    rate_a, rate_b, seconds, common
):
    (a, b), ticks_per_s = clocks_of(spec_of(rate_a), spec_of(rate_b))
    met = np.intersect1d(
        ticks_within(a, ticks_per_s, seconds), ticks_within(b, ticks_per_s, seconds)
    )
    assert len(met) == common


def test_every_scan_of_the_slow_clock_is_shared_and_is_the_third_of_the_fast_one():
    (slow, fast), ticks_per_s = clocks_of(spec_of(10), spec_of(30))
    scans, ticks = slow.scans_between(0, 3600 * ticks_per_s)
    assert np.array_equal(ticks, fast.ticks(3 * scans))
    assert len(scans) == 36_000


@pytest.mark.parametrize("offset", [0, "0.013", "1/7", 2.5])
def test_scan_k_is_at_offset_plus_k_periods_exactly(offset):
    spec = spec_of("30000/1001", offset)
    (clock,), ticks_per_s = clocks_of(spec)
    for k in (0, 1, 2, 999, 10**6, 10**9):
        exact = (spec.offset_s + k * spec.period_s) * ticks_per_s
        assert exact.denominator == 1
        assert int(clock.ticks(np.array([k]))[0]) == int(exact)


@pytest.mark.parametrize(
    ("written", "exact"),
    [
        (29.97, Fraction(2997, 100)),
        (0.1, Fraction(1, 10)),
        (5, Fraction(5)),
        ("30000/1001", Fraction(30000, 1001)),
        (" 29.97 ", Fraction(2997, 100)),
        ("1e-3", Fraction(1, 1000)),
        (Fraction(2, 3), Fraction(2, 3)),
    ],
)
def test_a_rate_is_read_the_way_it_is_written(written, exact):
    assert parse_rational(written) == exact


@pytest.mark.parametrize(
    "value", [True, None, "fast", "1/0", "", float("inf"), float("nan"), "nan", "1/2/3", [5], 1j]
)
def test_what_is_no_number_is_refused(value):
    with pytest.raises(ValueError, match="must be"):
        parse_rational(value)


def test_the_resolution_is_nanoseconds_or_finer():
    assert common_ticks_per_second([]) == 10**9
    assert common_ticks_per_second([Fraction(1, 3), Fraction(1001, 30000)]) == 3 * 10**9
    assert common_ticks_per_second([Fraction(1, 10**10), Fraction(1, 7)]) == 7 * 10**10


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    rate=st.fractions(Fraction(1, 100), 1000, max_denominator=2002).map(
        lambda rate: Fraction(rate.numerator % 1000 + 1, rate.denominator)
    ),
    ppm=st.fractions(-500, 500, max_denominator=1000),
    day=st.sampled_from([0, 1, 3, 30]),
)
def test_a_rate_error_is_rounded_once_and_never_accumulates(rate, ppm, day):
    spec = ClockSpec(rate, rate_error_ppm=ppm)
    (clock,), ticks_per_s = clocks_of(spec)
    first = int(day * 86_400 * rate)
    scans = np.arange(first, first + 5)
    exact = [k * Fraction(ticks_per_s) / (rate * (1 + ppm / 1_000_000)) for k in scans.tolist()]
    for tick, true in zip(clock.ticks(scans).tolist(), exact, strict=True):
        assert abs(tick - true) <= Fraction(1, 2)


def test_a_rate_error_written_to_many_digits_is_still_exact():
    ppm = Fraction("12.345678901234567891234")
    spec = ClockSpec(Fraction(30000, 1001), rate_error_ppm=ppm)
    (clock,), ticks_per_s = clocks_of(spec)
    scans = np.array([[0, 1], [10**6, 10**9]])
    ticks = clock.ticks(scans)
    assert ticks.shape == scans.shape
    for k, tick in zip(scans.ravel().tolist(), ticks.ravel().tolist(), strict=True):
        assert abs(tick - k * Fraction(ticks_per_s) / (spec.rate_hz * (1 + ppm / 10**6))) <= 0.5


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    rate=st.builds(Fraction, st.integers(200, 2000), st.integers(1, 101)),
    offset=st.fractions(0, 3, max_denominator=50),
    ppm=st.sampled_from([Fraction(0), Fraction(-37), Fraction(101, 7)]),
    jitter_s=st.sampled_from([0.0, 1e-4, 0.02, 10.0]),
    cuts=st.lists(st.fractions(0, 4, max_denominator=997), max_size=6),
    later=st.sampled_from([0, 86_400 * 7]),
)
def test_windows_partition_the_scans(rate, offset, ppm, jitter_s, cuts, later):
    spec = ClockSpec(rate, offset, ppm, jitter_s)
    (clock,), ticks_per_s = clocks_of(spec)
    bounds = sorted({int((later + cut) * ticks_per_s) for cut in [0, 4, *cuts]})
    assume(bounds[-1] < MAX_TICK)  # a scene that needs more is refused when it is loaded
    whole = clock.scans_between(bounds[0], bounds[-1])
    parts = [clock.scans_between(a, b) for a, b in itertools.pairwise(bounds)]
    for position in (0, 1):
        assert np.array_equal(np.concatenate([part[position] for part in parts]), whole[position])
    scans, ticks = whole
    assert (np.diff(scans) == 1).all()
    assert (np.diff(ticks) > 0).all()
    assert ((ticks >= bounds[0]) & (ticks < bounds[-1])).all()
    assert scans.dtype == ticks.dtype == np.int64
    # Nothing is missing at either end.
    outside = np.array([k for k in (scans[0] - 1, scans[-1] + 1) if k >= 0]) if len(scans) else []
    if len(outside):
        beyond = clock.ticks(np.asarray(outside))
        assert not ((beyond >= bounds[0]) & (beyond < bounds[-1])).any()


def test_a_scan_at_the_edge_of_a_window_belongs_to_the_next():
    (clock,), _ = clocks_of(ClockSpec(Fraction(10), jitter_s=0.004))
    edges = clock.ticks(np.arange(1, 20)).tolist()
    for scan, edge in enumerate(edges, start=1):
        assert clock.scans_between(0, edge)[0].tolist() == list(range(scan))
        assert clock.scans_between(edge, edges[-1] + 1)[0].tolist() == list(range(scan, 20))


def test_jitter_moves_scans_by_its_deviation_and_never_before_the_start():
    spec = ClockSpec(Fraction(100), jitter_s=1e-3)
    (clock,), ticks_per_s = clocks_of(spec)
    (steady,), _ = clocks_of(ClockSpec(Fraction(100)))
    scans = np.arange(20_000)
    shift = (clock.ticks(scans) - steady.ticks(scans)) / ticks_per_s
    assert np.std(shift) == pytest.approx(1e-3, rel=0.02)
    assert abs(np.mean(shift)) < 5e-5
    assert np.abs(shift).max() <= 0.45 / 100
    assert clock.ticks(np.array([0]))[0] >= 0


@pytest.mark.parametrize(
    ("drawn", "first_s", "second_s"),
    [(-1.0, 0.0, 0.096), (2.0, 0.008, 0.108), (-100.0, 0.0, 0.055), (100.0, 0.045, 0.145)],
)
def test_jitter_is_its_deviation_times_what_is_drawn_and_less_than_half_a_period(
    drawn: float, first_s: float, second_s: float
) -> None:
    spec = ClockSpec(Fraction(10), jitter_s=0.004)
    clock = ScanClock(spec, 10**9, lambda scans: np.full(np.shape(scans), drawn))
    assert clock.ticks(np.array([0, 1])).tolist() == [round(first_s * 1e9), round(second_s * 1e9)]
    assert clock.previous_ticks(np.array([0, 1, 2])).tolist() == [
        -1, round(first_s * 1e9), round(second_s * 1e9)
    ]  # fmt: skip


def test_jitter_is_a_function_of_seed_block_and_scan_only():
    def ticks(seed, block, scans):
        draw = Streams(seed).scan_normal_function(block, "clock jitter")
        return ScanClock(ClockSpec(Fraction(10), jitter_s=0.001), 10**9, draw).ticks(scans)

    scans = np.arange(100)
    alone = [int(ticks(1, "radar", np.array([k]))[0]) for k in scans]
    assert ticks(1, "radar", scans).tolist() == alone
    assert ticks(2, "radar", scans).tolist() != alone
    assert ticks(1, "ir", scans).tolist() != alone


@pytest.mark.parametrize("tick", [0, 1, 10**17, MAX_TICK - 10**12])
def test_the_first_scan_at_or_after_an_instant(tick):
    for spec in (spec_of("30000/1001", "1/7"), spec_of(3, rate_error_ppm=Fraction(17))):
        (clock,), _ = clocks_of(spec)
        k = clock.first_scan_at_or_after(tick)
        assert clock.ticks(np.array([k]))[0] >= tick
        if k:
            assert clock.ticks(np.array([k - 1]))[0] < tick


@pytest.mark.parametrize("jitter_s", [0.0, 0.004])
def test_nothing_is_before_the_instant_that_is_said_to_have_nothing_before_it(jitter_s):
    spec = ClockSpec(Fraction(30000, 1001), Fraction(1, 8), Fraction(-40), jitter_s)
    clock = ScanClock(spec, 30_000 * 10**6, lambda scans: np.sin(7.0 * scans))
    for tick in np.linspace(0, 10**12, 500).astype(int).tolist():
        none_before = clock.lower_bound_of_next_scan(tick)
        assert len(clock.scans_between(tick, none_before)[0]) == 0
        first = clock.scans_between(tick, tick + clock.offset + 2 * int(clock.period))[1][0]
        assert none_before <= first
        assert none_before == first or jitter_s


def test_the_window_holds_its_start_and_not_its_end():
    (clock,), ticks_per_s = clocks_of(spec_of(2))
    assert clock.scans_between(0, ticks_per_s)[0].tolist() == [0, 1]
    assert clock.scans_between(0, ticks_per_s + 1)[0].tolist() == [0, 1, 2]
    assert clock.scans_between(ticks_per_s, ticks_per_s)[0].size == 0
    assert clock.scans_between(ticks_per_s, 0)[0].size == 0


def test_an_offset_that_is_no_whole_tick_is_refused():
    with pytest.raises(ValueError, match="offset 1/3 s"):
        ScanClock(ClockSpec(Fraction(1), Fraction(1, 3)), 10**9)


def test_a_rate_above_the_tick_rate_is_refused():
    with pytest.raises(ValueError, match="above the tick rate"):
        ScanClock(ClockSpec(Fraction(2 * 10**9)), 10**9)
