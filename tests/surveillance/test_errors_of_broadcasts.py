"""What aircraft say of themselves errs as it is stated, and sends when it is stated."""

from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

from components.aircraft.equipage import POSITION_RADIUS_M, RADIUS_IN_DEVIATIONS
from components.surveillance.altimetry import (
    BETTER_FT,
    LAYER_TOPS_FT,
    OTHER_FT,
    SHARE_OF_BETTER,
    altimetry_error_ft,
    altimetry_variance_ft2,
    laplace_draws_from_uniform,
)
from components.surveillance.broadcast import CORRELATION_TIME_S, Broadcasts, Transponders
from components.surveillance.reception import (
    DO_365_IN_1_S,
    LAWS,
    do_365_reception_probability,
    fitted_reception_probability,
)
from components.surveillance.squitter_clock import SquitterClocks
from components.surveillance.stated_errors import StatedByAircraft
from dsa_des.time.randomness import Stream, Streams

N = 100_000
#: Half width of a 99 % interval, in standard deviations.
Z = NormalDist().inv_cdf(0.995)
NS = 10**9


def who(count, replica=0):
    keys = np.random.default_rng(5).integers(0, 2**63, count).astype(np.uint64)
    return Transponders(keys, np.full(count, replica), np.zeros(count, dtype=np.int64))


@pytest.mark.parametrize("name", ["position", "velocity"])
@pytest.mark.parametrize("errors", ["white", "gauss_markov"])
def test_errors_have_the_stated_deviation_and_last(errors, name):
    them, number = who(N), np.arange(N) % 300
    instant = number * NS // 2
    own = Broadcasts(Streams(7), errors, False)
    now = np.stack(own.horizontal_errors(name, np.full(N, 12.3), them, number, instant))
    lag_s = 90.0
    later = np.stack(
        own.horizontal_errors(name, np.full(N, 12.3), them, number + 180, instant + int(lag_s * NS))
    )
    lasts = errors == "gauss_markov"
    pairs = [(now[0], later[0], lasts), (now[1], later[1], lasts), (now[0], now[1], False)]
    for one, other, lasting in pairs:
        assert abs(one.mean()) < Z * 12.3 / N**0.5
        assert abs(one.var() / 12.3**2 - 1.0) < Z * (2.0 / N) ** 0.5
        expected = np.exp(-lag_s / CORRELATION_TIME_S) if lasting else 0.0
        found = np.corrcoef(one, other)[0, 1]
        assert abs(found - expected) < Z * (1.0 - expected**2) / N**0.5


def test_nacp_is_the_radius_that_holds_95_percent():
    them = who(N)
    own = Broadcasts(Streams(8), "gauss_markov", False)
    sigma = np.full(N, POSITION_RADIUS_M[8] / RADIUS_IN_DEVIATIONS)
    inside = (
        np.hypot(*own.horizontal_errors("position", sigma, them, np.arange(N), np.arange(N))) < 92.6
    )
    assert abs(inside.mean() - 0.95) < Z * (0.95 * 0.05 / N) ** 0.5


@pytest.mark.parametrize("layer", range(6))
def test_altimetry_errors_are_laplacian_by_layer(layer):
    low = [0.0, *LAYER_TOPS_FT][layer]
    altitude = np.full(N, low + 100.0)
    uniform, kind = np.random.default_rng(layer).random((2, N))
    error = altimetry_error_ft(altitude, laplace_draws_from_uniform(uniform), kind)
    share, better, other = SHARE_OF_BETTER[layer], BETTER_FT[layer], OTHER_FT[layer]
    # Moments of a Laplace distribution: E|x| = b, E x² = 2 b², E x⁴ = 24 b⁴.
    first = share * better + (1.0 - share) * other
    second = 2.0 * (share * better**2 + (1.0 - share) * other**2)
    fourth = 24.0 * (share * better**4 + (1.0 - share) * other**4)
    assert abs(error.mean()) < Z * (second / N) ** 0.5
    assert abs(np.abs(error).mean() - first) < Z * ((second - first**2) / N) ** 0.5
    assert abs((error**2).mean() - second) < Z * ((fourth - second**2) / N) ** 0.5
    assert altimetry_variance_ft2(altitude)[0] == pytest.approx(second)


def test_a_layer_s_top_is_of_the_layer_for_errors_as_for_their_variance():
    tops = np.array(LAYER_TOPS_FT, dtype=float)
    for kind in (0.0, 0.999):  # altimeters of either sort
        draws = np.full(len(tops), 1.7), np.full(len(tops), kind)
        at, below, above = (altimetry_error_ft(tops + by, *draws) for by in (0.0, -1.0, 1.0))
        assert np.array_equal(at, below) and not np.array_equal(at, above)
    assert np.array_equal(altimetry_variance_ft2(tops), altimetry_variance_ft2(tops - 1.0))


def test_intervals_are_uniform_and_start_as_if_they_had_always_run():
    them, count = who(2000), 14
    clocks = SquitterClocks(Stream(9, "a", "b"))
    _, sent, counts = clocks.latest_messages(them.keys, them.run, np.full(2000, 30 * NS), count)
    assert counts.all()
    gaps = -np.diff(sent, axis=1).ravel() / NS
    n = gaps.size
    assert gaps.min() >= 0.4 and gaps.max() <= 0.6
    assert abs(gaps.mean() - 0.5) < Z * 0.2 / (12 * n) ** 0.5
    share = (gaps < 0.45).mean()
    assert abs(share - 0.25) < Z * (0.25 * 0.75 / n) ** 0.5
    assert abs(np.corrcoef(gaps[:-1], gaps[1:])[0, 1]) < Z / n**0.5
    # At any instant the last message is (E gap²) / (2 E gap) old on average.
    age = 30.0 - sent[:, 0] / NS
    for ages in (age, clocks.latest_messages(them.keys, them.run, np.full(2000, NS), 1)[1][:, 0]):
        ages = ages if ages is age else 1.0 - ages / NS
        mean = (0.5**2 + 0.2**2 / 12) / (2 * 0.5)
        assert abs(ages.mean() - mean) < Z * 0.15 / 2000**0.5


def test_a_clock_says_the_same_whatever_was_asked_before():
    them = who(4)
    until = np.sort(np.random.default_rng(1).integers(0, 500 * NS, 200))
    keys, runs = np.tile(them.keys, 200), np.tile([0, 0, 3, 7], 200)
    instants = np.repeat(until, 4)
    whole = SquitterClocks(Stream(2, "a", "b")).latest_messages(keys, runs, instants, 6)
    other = SquitterClocks(Stream(2, "a", "b"))
    for k in np.random.default_rng(2).permutation(len(keys))[:80]:
        one = other.latest_messages(keys[k : k + 1], runs[k : k + 1], instants[k : k + 1], 6)
        assert all(np.array_equal(part[0], all_[k]) for part, all_ in zip(one, whole, strict=True))
    # Days later it is still a matter of the clock's own messages.
    number, sent, _ = other.latest_messages(keys[:1], runs[:1], np.array([86_400 * NS]), 1)
    assert abs(number[0, 0] / 172_800 - 1.0) < 1e-3 and 0 <= 86_400 * NS - sent[0, 0] < 0.6 * NS


def test_what_is_sent_at_an_instant_is_sent_by_then_and_no_nanosecond_before():
    them, clocks = who(50), SquitterClocks(Stream(2, "a", "b"))
    _, sent, _ = clocks.latest_messages(them.keys, them.run, np.full(50, 90 * NS), 2)
    _, then, _ = clocks.latest_messages(them.keys, them.run, sent[:, 0], 2)
    assert np.array_equal(then, sent)
    _, before, _ = clocks.latest_messages(them.keys, them.run, sent[:, 0] - 1, 1)
    assert np.array_equal(before[:, 0], sent[:, 1])


def test_positions_carried_on_err_by_the_error_of_the_velocity_times_their_age():
    """The same velocity errs all the way: after 3 s its variance counts nine times, not three."""
    deviations = {
        "position_deviation_m": np.array([20.0]),
        "velocity_deviation_m_s": np.array([2.0]),
    }
    said = {name: np.full(3, 1000.0) for name in ("reported_alt_m", "reported_north_m_s")}
    deviations |= {"latency_s": np.zeros(1), "compensated_s": np.zeros(1)}
    stated = StatedByAircraft(
        SimpleNamespace(**deviations), np.zeros(3, dtype=int), said, errs=True, rounds=False
    )
    north, east, _ = stated.position_variances_m2(np.array([0.0, 0.5, 3.0]))
    assert north.tolist() == east.tolist() == [400.0, 401.0, 436.0]


def test_laws_of_reception():
    ranges = np.linspace(0.0, 6e5, 400)
    for law, ends in LAWS.values():
        p = law(ranges)
        assert ((p >= 0.0) & (p <= 1.0)).all() and (p[ranges > ends] == 0.0).all()
    assert fitted_reception_probability(np.zeros(1))[0] == 1.0
    near, far = do_365_reception_probability(np.array([5.0, 15.0]) * 1852.0)
    # Two messages a second, of which one comes within 3 s and 7 s with 95 %.
    within = [1.0 - (1.0 - near) ** 6, 1.0 - (1.0 - far) ** 14]
    assert within == pytest.approx([0.95, 0.95])
    assert pytest.approx((0.632, 0.348), abs=5e-4) == DO_365_IN_1_S
