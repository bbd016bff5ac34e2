"""Paired encounters against closed forms, a plain Monte Carlo, and published ones."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from components.encounters.model_file import read_model
from components.encounters.pair_densities import (
    PairingRules,
    StepDensity,
    relative_speed_over_directions,
)
from components.encounters.pairing import COURSES, Pairs, PairSampler, draw_intruder_courses_rad
from components.encounters.track_rules import TrackError
from components.metrics.risk import risk_ratio
from tests.encounters.reference_data import reference_file

KT = 1852 / 3600 / 0.3048

#: Straight flights at two speeds, level or at one of two vertical rates.
GAS = """\
# labels_initial
"L", "v", "\\dot v", "\\dot h", "\\dot \\psi"
# G_initial
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
# r_initial
1 4 1 3 1
# N_initial
100 2 49 0 49 100 25 50 25 100
# labels_transition
"L", "v", "\\dot v(t)", "\\dot h(t)", "\\dot \\psi(t)", "\\dot h(t+1)"
# G_transition
0 0 0 0 0 0
0 0 0 0 0 0
0 0 0 0 0 0
0 0 0 0 0 1
0 0 0 0 0 0
0 0 0 0 0 0
# r_transition
1 4 1 3 1 3
# N_transition
1 0 0 0 1 0 0 0 1
# boundaries
0 40000
70 80 100 140 160
-1 1
-1600 -1200 1200 1600
-1 1
# resample_rates
0 0 0 0 0
"""
#: Flights that now and then turn, climb or accelerate for a while.
TURNS = """\
# labels_initial
"L", "v", "\\dot v", "\\dot h", "\\dot \\psi"
# G_initial
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
0 0 0 0 0
# r_initial
2 3 3 3 3
# N_initial
40 60 4 50 46 10 80 10 10 80 10 5 90 5
# labels_transition
"L", "v", "\\dot v(t)", "\\dot h(t)", "\\dot \\psi(t)", "\\dot v(t+1)", "\\dot h(t+1)", \
"\\dot \\psi(t+1)"
# G_transition
0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0
0 0 0 0 0 1 0 0
0 0 0 0 0 0 1 0
0 0 0 0 0 0 0 1
0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0
0 0 0 0 0 0 0 0
# r_transition
2 3 3 3 3 3 3 3
# N_transition
80 20 0 1 98 1 0 20 80 90 10 0 1 98 1 0 10 90 80 20 0 1 198 1 0 20 80
# boundaries
500 2500 6000
60 70 110 160
-0.5 -0.1 0.1 0.5
-1200 -400 300 900
-4 -1 1 3
# resample_rates
0 0 0.02 0.05 0.1
"""
#: Nothing is rejected that is only near when it begins.
FREE = {"start_vertical_ft": 0.0}
PLAIN = {
    "vertical_ft": StepDensity(np.array([-1500.0, 1500.0]), np.array([1.0])),
    "horizontal_ft": StepDensity(np.array([-18240.0, 18240.0]), np.array([1.0])),
}


def sampler(folder: Path, text: str, seed: int = 1, **rules) -> PairSampler:
    path = folder / "model.txt"
    path.write_text(text, encoding="utf-8")
    return PairSampler(read_model(path), read_model(path), seed, PairingRules(**rules))


def passes(pairs: Pairs, radius_ft: float, half_height_ft: float) -> np.ndarray:
    """Tell which straight flights come within a cylinder, by the chord through it."""
    first, second = pairs.speed_ft_s[:, 150]
    north = second * np.cos(pairs.course_rad) - first
    speed = np.hypot(north, second * np.sin(pairs.course_rad))
    half = np.sqrt(np.maximum(radius_ft**2 - pairs.horizontal_ft**2, 0.0)) / speed
    climb = pairs.climb_ft_s[1, 150] - pairs.climb_ft_s[0, 150]
    reach = half_height_ft + np.abs(climb) * half
    return (np.abs(pairs.horizontal_ft) < radius_ft) & (np.abs(pairs.vertical_ft) < reach)


def test_the_gas_models_closed_form_over_the_radius(tmp_path: Path) -> None:
    pairs = sampler(tmp_path, GAS, **FREE).sample_pairs(range(3000))
    # Mean relative speeds, by plain Monte Carlo of velocities.
    random = np.random.default_rng(2)
    count = 400_000
    v1, v2 = (
        np.where(random.random(count) < 0.5, random.uniform(80, 100, count),
                 random.uniform(140, 160, count)) * KT
        for _ in range(2)
    )  # fmt: skip
    climbs = [
        random.choice([-1, 0, 0, 1], count) * random.uniform(1200, 1600, count) / 60
        for _ in range(2)
    ]
    course = random.uniform(0, 2 * np.pi, count)
    v_h = np.sqrt(v1**2 + v2**2 - 2 * v1 * v2 * np.cos(course)).mean()
    v_v = np.abs(climbs[0] - climbs[1]).mean()
    total = pairs.weight.sum()
    for radius in (500.0, 1500.0, 4000.0, 10_000.0):
        for half in (100.0, 300.0):
            expected = (4 * radius * half * v_h + np.pi * radius**2 * v_v) / (
                4 * 18240 * 1500 * v_h
            )
            if radius > 4000 and half > 100:
                continue  # climbs through it take longer than vertical miss distances reach
            inside = passes(pairs, radius, half)
            found = (pairs.weight * inside).sum() / total
            spread = np.sqrt((pairs.weight**2 * (inside - found) ** 2).sum()) / total
            bias = 0.02 * expected  # climbing tracks leave the layer a little more often
            assert abs(found - expected) < 4 * spread + bias, (radius, half, found, expected)


def test_importance_weights_agree_with_a_plain_monte_carlo(tmp_path: Path) -> None:
    weighted = sampler(tmp_path, GAS, **FREE).sample_pairs(range(5000))
    plain = sampler(tmp_path, GAS, 2, **FREE, **PLAIN).sample_pairs(range(5000))

    def estimate(pairs: Pairs, what: np.ndarray) -> tuple[float, float]:
        p = (pairs.weight * what).sum() / pairs.weight.sum()
        error = np.sqrt((pairs.weight**2 * (what - p) ** 2).sum()) / pairs.weight.sum()
        return p, error

    for inside in (
        lambda p: passes(p, 4000.0, 450.0),
        lambda p: np.abs(p.horizontal_ft) < 1500,
        lambda p: p.vertical_ft > 400,
        lambda p: np.cos(p.course_rad) < 0,
    ):
        (a, da), (b, db) = estimate(weighted, inside(weighted)), estimate(plain, inside(plain))
        assert abs(a - b) < 4 * np.hypot(da, db)
    # That is what the weights are for: near misses are drawn more often.
    near, far = passes(weighted, 500.0, 100.0), passes(plain, 500.0, 100.0)
    assert near.sum() > 10 * max(far.sum(), 1)
    # A mean of the weights is a rate: both are the same integral up to P's and q's areas.
    found = risk_ratio(near, near, weighted.weight)
    assert found.ratio == 1.0


def test_pairs_are_where_they_should_be(tmp_path: Path) -> None:
    rules = PairingRules()
    pairs = sampler(tmp_path, TURNS).sample_pairs(range(60))
    here = np.arange(60)
    north, east, up = (v[1] - v[0] for v in (pairs.north_ft, pairs.east_ft, pairs.up_ft))
    apart = np.hypot(north, east)
    at = np.argmin(apart, axis=0)
    assert (at >= 150).all()
    assert apart[150] == pytest.approx(np.abs(pairs.horizontal_ft))
    assert up[150] == pytest.approx(pairs.vertical_ft, abs=1e-6)
    assert (np.abs(up[at, here] - pairs.vertical_ft) < 20).all()
    assert (np.abs(apart[at, here] - np.abs(pairs.horizontal_ft)) < 500).all()
    near = (np.abs(up[0]) < 800) & (apart[0] < 1.5 * 6076.1155)
    assert not near.any()
    assert (np.abs(pairs.vertical_ft) <= 1500).all() and (np.abs(pairs.horizontal_ft) < 18240).all()
    # Courses at the closest approach, and turns and climbs that are those of the commands.
    assert pairs.heading_rad[0, 150] == pytest.approx(np.zeros(60), abs=1e-12)
    assert pairs.heading_rad[1, 150] == pytest.approx(pairs.course_rad)
    turned = np.diff(pairs.heading_rad, axis=1)
    assert turned == pytest.approx(pairs.turn_rad_s[:, :-1], abs=1e-12)
    assert np.diff(pairs.up_ft, axis=1) == pytest.approx(pairs.climb_ft_s[:, :-1], abs=1e-6)
    steps = np.hypot(np.diff(pairs.north_ft, axis=1), np.diff(pairs.east_ft, axis=1))
    assert steps == pytest.approx(pairs.speed_ft_s[:, :-1], rel=1e-9)
    # The intruder crosses on the side that the sign says.
    v = pairs.speed_ft_s[:, 150]
    v_n = v[1] * np.cos(pairs.course_rad) - v[0]
    v_e = v[1] * np.sin(pairs.course_rad)
    side = pairs.horizontal_ft / np.hypot(v_n, v_e)
    assert north[150] == pytest.approx(side * v_e, abs=1e-6)
    assert east[150] == pytest.approx(-side * v_n, abs=1e-6)
    # w = S / (2 · 60761) / q / P, S by quadrature.
    climb = pairs.climb_ft_s[1, 150] - pairs.climb_ft_s[0, 150]
    for k in range(5):

        def speed(psi: float, k: int = k) -> float:
            across = v[0, k] ** 2 + v[1, k] ** 2 - 2 * v[0, k] * v[1, k] * np.cos(psi)
            return float(np.sqrt(across + climb[k] ** 2))

        total = quad(speed, 0, 2 * np.pi)[0]
        hmd, vmd = abs(pairs.horizontal_ft[k]), abs(pairs.vertical_ft[k])
        share, width = (1, 500) if hmd < 500 else (0.8, 1000) if hmd < 1500 else (2 / 3, 16740)
        q = share / (2 * (1 + 0.8 + 2 / 3)) / width
        chance = 1 if vmd < 100 else 2 / 3 if vmd < 500 else 0.5
        assert pairs.weight[k] == pytest.approx(total / (2 * 60761) / q / chance, rel=1e-6)
    assert rules.closest_s == 150


def test_relative_speed_over_directions_takes_the_parameter_not_the_modulus() -> None:
    first, second = np.array([300.0, 150.0]), np.array([100.0, 150.0])
    found = relative_speed_over_directions(first, second, np.array([10.0, 0.0]))
    assert found[1] == pytest.approx(8 * 150)  # ∫ 2 v |sin(ψ/2)| dψ
    by_hand = quad(lambda p: np.sqrt(300**2 + 100**2 - 6e4 * np.cos(p) + 100), 0, 2 * np.pi)[0]
    assert found[0] == pytest.approx(by_hand, rel=1e-9)


def test_a_pair_is_the_same_alone_and_in_any_batch(tmp_path: Path) -> None:
    pairing = sampler(tmp_path, TURNS)
    alone, batch = pairing.sample_pairs(range(17, 18)), pairing.sample_pairs(range(3, 40))
    for name, values in vars(alone).items():
        assert np.array_equal(values[..., 0], vars(batch)[name][..., 14]), name
    assert batch.numbers.tolist() == list(range(3, 40))
    other = sampler(tmp_path, TURNS, seed=2).sample_pairs(range(17, 18))
    assert other.weight[0] != alone.weight[0]


def test_models_that_never_meet_say_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    high, low = tmp_path / "high.txt", tmp_path / "low.txt"
    high.write_text(GAS.replace("0 40000", "90000 99000"), encoding="utf-8")
    low.write_text(GAS.replace("0 40000", "0 9000"), encoding="utf-8")
    pairing = PairSampler(read_model(high), read_model(low), 1, PairingRules())
    monkeypatch.setattr("components.encounters.pairing._MOST_ATTEMPTS", 500)
    with pytest.raises(TrackError, match="the two models do not meet"):
        pairing.sample_pairs(range(2))


def test_whoever_begins_near_but_high_above_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The smallest range is compared with the range, and the smallest height with the height."""
    monkeypatch.setattr("components.encounters.pairing._MOST_ATTEMPTS", 3000)
    far = {"start_range_ft": 1e6, "start_vertical_ft": 800.0}
    pairs = sampler(tmp_path, GAS, **far).sample_pairs(range(20))
    assert (np.abs(pairs.up_ft[1, 0] - pairs.up_ft[0, 0]) >= 800).all()


def test_rules_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="closest_s = 200: must lie between 0 and"):
        PairingRules(closest_s=200)
    with pytest.raises(ValueError, match="3 edges need 2 proportions; there are 1"):
        StepDensity(np.array([0.0, 1.0, 2.0]), np.array([1.0]))
    with pytest.raises(ValueError, match="rising"):
        StepDensity(np.array([1.0, 0.0]), np.array([1.0]))


def test_published_models_pair(tmp_path: Path) -> None:
    model = read_model(reference_file("models/uncor_1200code_v1.txt"))
    pairs = PairSampler(model, model, 1, PairingRules()).sample_pairs(range(300))
    assert np.isfinite(pairs.weight).all() and (pairs.weight > 0).all()
    assert pairs.up_ft.min() >= 500 and pairs.up_ft.max() <= 18000
    shares = np.histogram(np.abs(pairs.horizontal_ft), [0, 500, 1500, 18240])[0] / 300
    assert shares == pytest.approx(np.array([1, 0.8, 2 / 3]) / (1 + 0.8 + 2 / 3), abs=0.1)


def test_courses_are_those_whose_relative_speed_is_drawn():
    """Two of 100 ft/s: at 36 deg 3,820 of at most 40,000 ft²/s²; at 90 deg 20,000."""
    drawn = np.zeros((2 * COURSES, 4))
    drawn[:6] = [
        [0.1, 0.1, 0.1, 0.25],  # courses, in turns
        [0.45, 0.3, 0.65, 0.5],  # their squares of the most: 8,100 is too much, 3,600 is not
        [0.25, 0.4, 0.25, 0.4],
        [0.72, 0.1, 0.69, 0.1],  # 20,736 is too much; of 60,000, climbing, 28,566 is not
        [0.5, 0.5, 0.5, 0.5],
        [0.9, 0.9, 0.9, 0.9],
    ]
    first, second = np.full((2, 4), 100.0)
    climb = np.array([0.0, 0.0, 100.0 * 2**0.5, 0.0])
    # The third has 3,820 + 20,000 there, of at most 60,000: 25,350 are asked.
    turns = draw_intruder_courses_rad(first, second, climb, drawn) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, [0.5, 0.1, 0.25, 0.25])
    unlike = draw_intruder_courses_rad(
        np.array([300.0]), np.array([100.0]), np.zeros(1), drawn[:, :1]
    )
    # (300² + 100² - 60,000 cos 36 deg) of 160,000: 51,459, of which 32,400 are asked.
    assert unlike[0] / (2.0 * np.pi) == pytest.approx(0.1)
