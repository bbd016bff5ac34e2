"""Ground and rain that fold beside a target, and the altitude line, summed by plain loops.

Level flight 800 m above flat ground; a target 9 km ahead, at 20 kHz beyond the first pulse's reach.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from covering import covers
from scipy.integrate import quad
from wired import HEARS_ALL, chain, run, sensor

import dsa_des
from components.radar.ground_clutter import altitude_line_rcs_m2
from components.radar.rain import ambiguous_ranges_m
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation

C = 299_792_458.0
HEIGHT_M, RANGE_M, PRF_HZ = 800.0, 9000.0, 20e3
FOLD_M = C / 2.0 / PRF_HZ
CELL_M, AZIMUTH_DEG, ELEVATION_DEG, GAMMA_DB, SIDELOBE_DB = 60.0, 5.0, 8.0, -12.0, -30.0
OWN = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 900.0, "heading_deg": 0, "speed_mps": 60}
AHEAD = {"name": "ahead", "east_m": 0, "north_m": RANGE_M, "up_m": 0, "heading_deg": 180,
         "speed_mps": 60, "rcs_dbsm": 3}  # fmt: skip
RADAR = {
    **HEARS_ALL, "prf_hz": PRF_HZ, "range_folds": True, "range_km": 20.0, "range_cell_m": CELL_M,
    "azimuth_beamwidth_deg": AZIMUTH_DEG, "elevation_beamwidth_deg": ELEVATION_DEG,
    "frequency_hz": 10e9, "sidelobe_level_db": SIDELOBE_DB,
}  # fmt: skip
GROUND = {"height_m": 100.0, "clutter_gamma_db": GAMMA_DB}


def without(radar, *keys):
    return {key: value for key, value in radar.items() if key not in keys}


#: Whose pulses come so seldom that nothing folds.
SLOW = without(RADAR, "prf_hz", "range_folds")


def scene(radar=RADAR, terrain=GROUND, target=AHEAD, **sections):
    return chain({"radar": radar}, ownship=OWN, targets=[target], terrain=terrain, **sections)


def margin(made):
    """SNR of the first look, and its margin over noise and clutter, dB; threshold -250 dB."""
    (row,) = run(made)["looks"].to_pylist()
    return row["snr_db"], row["confidence"] - 250.0


def ground_m2(at_m):
    """The ground at a range: in the level beam by hand, and around through the sidelobes."""
    if at_m < HEIGHT_M:
        return 0.0
    sine = HEIGHT_M / at_m
    grazing = math.asin(sine)
    along = min(CELL_M / math.cos(grazing), at_m * math.radians(ELEVATION_DEG) / sine)
    off = grazing / math.radians(ELEVATION_DEG)
    gain = math.exp(-8.0 * math.log(2.0) * off**2) if off <= 2.0 else 0.0
    gamma = 10.0 ** (GAMMA_DB / 10.0)
    beam = gamma * sine * at_m * math.radians(AZIMUTH_DEG) * along * gain
    ring = gamma * sine * 2.0 * math.pi * at_m * CELL_M
    return beam + 10.0 ** (2.0 * SIDELOBE_DB / 10.0) * ring


def folded_m2(true_m, fold_m, of=ground_m2, farthest_m=330e3):
    """What comes from all other ranges, as if it were at the true one."""
    own = int(true_m // fold_m)
    first = true_m - own * fold_m
    others = (first + k * fold_m for k in range(int(farthest_m // fold_m)) if k != own)
    return sum(of(at_m) * (true_m / at_m) ** 4 for at_m in others if at_m > 0.0)


@covers("range_folds", of=("radar.threshold",))
def test_the_ground_of_other_pulses_is_heard_beside_a_target():
    snr_db, alone_db = margin(scene(radar=SLOW))
    folded_snr_db, with_db = margin(scene())
    assert folded_snr_db == snr_db
    target_m2 = 10.0**0.3
    per_m2 = 10.0 ** (snr_db / 10.0) / target_m2
    own = ground_m2(RANGE_M) * per_m2
    beside = folded_m2(RANGE_M, FOLD_M) * per_m2
    assert beside > own > 10.0
    lost = 10.0 * math.log10((1.0 + own + beside) / (1.0 + own))
    assert alone_db - with_db == pytest.approx(lost, abs=2e-3)


def test_of_several_prfs_the_clearest_that_are_needed_count():
    snr_db, alone_db = margin(scene(radar=SLOW))
    per_m2 = 10.0 ** (snr_db / 10.0) / 10.0**0.3
    own = ground_m2(RANGE_M) * per_m2
    others = [21.3e3, 23.9e3]
    each = sorted(folded_m2(RANGE_M, C / 2.0 / f) * per_m2 for f in (PRF_HZ, *others))
    for needed in (1, 2, 3):
        radar = {**RADAR, "other_prfs_hz": others, "prfs_needed": needed}
        lost = 10.0 * math.log10((1.0 + own + each[needed - 1]) / (1.0 + own))
        assert alone_db - margin(scene(radar=radar))[1] == pytest.approx(lost, abs=2e-3)


@covers("facet_slope_deg", "relative_permittivity", "conductivity_s_m", of=("[terrain]",))
def test_the_altitude_line_hides_targets_at_the_height_modulo_the_fold():
    """A mirror below, pi h² ρ², in the cell that folds to the height: 9 km are 800 m and a fold."""
    fold_m = 8200.0 / 3.0
    radar = {**RADAR, "prf_hz": C / 2.0 / fold_m}
    ground = {**GROUND, "clutter_gamma_db": -100.0, "relative_permittivity": 70.0,
              "conductivity_s_m": 5.0}  # fmt: skip
    snr_db, quiet_db = margin(scene(radar=radar, terrain=ground))
    _, loud_db = margin(scene(radar=radar, terrain={**ground, "facet_slope_deg": 1.0}))
    root = (complex(70.0, -60.0 * 0.03 * 5.0)) ** 0.5
    mirrored = abs((1.0 - root) / (1.0 + root)) ** 2
    # Half of the cell lies below the height, where there is no ground; the spike is in the other.
    line_m2 = math.pi * HEIGHT_M**2 * mirrored * 10.0 ** (2.0 * SIDELOBE_DB / 10.0)
    heard = line_m2 * (RANGE_M / HEIGHT_M) ** 4 * 10.0 ** (snr_db / 10.0) / 10.0**0.3
    assert quiet_db - loud_db == pytest.approx(10.0 * math.log10(1.0 + heard), abs=0.05)
    assert heard > 10.0


@pytest.mark.parametrize("slope_deg", [0.5, 5.0, 15.0])
def test_all_that_is_mirrored_is_a_mirror_s(slope_deg):
    keys = {"slope_rad": math.radians(slope_deg), "reflectivity": 0.4}
    edges = np.arange(700.0, 6000.0, 10.0)
    each = altitude_line_rcs_m2(edges + 5.0, 800.0, range_resolution_m=10.0, **keys)
    assert each.sum() == pytest.approx(math.pi * 800.0**2 * 0.4, rel=1e-9)
    slope = math.tan(math.radians(slope_deg))

    def ring(range_m):
        tangent2 = (range_m**2 - 800.0**2) / 800.0**2
        return 2.0 * math.pi * range_m * 0.4 / slope**2 * math.exp(-tangent2 / slope**2)

    wanted = quad(ring, 810.0, 820.0)[0]
    assert altitude_line_rcs_m2(815.0, 800.0, range_resolution_m=10.0, **keys) == pytest.approx(
        wanted, rel=1e-9
    )


def test_rain_of_other_pulses_is_heard_too():
    """Level with the beam, below its top: eta · pi R² θ θ ΔR / (8 ln 2), with R^-4 each."""
    radar = without(RADAR, "sidelobe_level_db")
    weather = {"rain_rate_mm_h": 2.0, "rain_top_m": 9000.0}
    made = {"terrain": {}, "weather": weather}
    snr_db, alone_db = margin(scene(radar=without(SLOW, "sidelobe_level_db"), **made))
    _, with_db = margin(scene(radar=radar, **made))
    eta = math.pi**5 * 0.93 / (C / 10e9) ** 4 * 200e-18 * 2.0**1.6
    solid = math.pi * math.radians(AZIMUTH_DEG) * math.radians(ELEVATION_DEG) * CELL_M
    per_m2 = 10.0 ** (snr_db / 10.0) / 10.0**0.3

    def rain_m2(at_m):
        return eta * solid / (8.0 * math.log(2.0)) * at_m**2

    own = rain_m2(RANGE_M) * per_m2
    beside = folded_m2(RANGE_M, FOLD_M, rain_m2, farthest_m=338e3) * per_m2
    lost = 10.0 * math.log10((1.0 + own + beside) / (1.0 + own))
    # The Earth falls away from the level beam, whose far ends look above the rain.
    assert alone_db - with_db == pytest.approx(lost, abs=0.02)
    assert lost > 3.0


def test_other_ranges_are_every_fold_but_the_own():
    found = list(ambiguous_ranges_m(np.array([2500.0, 40.0, 1000.0]), 1000.0, 3600.0))
    assert np.array(found).tolist() == [
        [500.0, np.inf, np.inf], [1500.0, 1040.0, np.inf], [np.inf, 2040.0, 2000.0],
        [3500.0, 3040.0, 3000.0],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "sections", "because"),
    [
        ({}, {}, "range_folds is true: clutter of every 7.495 km beside a target's"),
        ({"range_folds": False, "prf_hz": 5e3}, {}, "range_folds is false"),
        ({}, {"terrain": {}}, "there is neither [terrain] height_m nor rain"),
    ],
)
def test_the_reason_is_in_the_scene(keys, sections, because):
    made = scene(radar={**RADAR, **keys}, **sections)
    plan = Simulation(dsa_des.load_scene(made)).plan
    (found,) = [one for one in plan if one.effect.name == "folded clutter"]
    assert found.because == because and found.built == because.startswith("range_folds is true")


def test_a_filter_that_is_locked_to_the_ground_far_off_hears_that_below():
    """The near ground passes a notch that lies at the rate of the ground at the target's range."""
    filtered = {"moving_target_filter": "filter_bank", "clutter_lock": True, "filter_pulses": 64,
                "notch_m_s": 6.0}  # fmt: skip
    radar = sensor("radar.threshold", **{**RADAR, **filtered})
    simulation = Simulation(dsa_des.load_scene(scene(radar=radar)))
    simulation.run()
    echo = next(
        e for e in simulation.components["radar"].echoes if type(e).__name__ == "FoldedEcho"
    )
    cells = Beside(RANGE_M)
    level = np.array([60.0]), np.zeros(1), np.zeros(1)
    rate, _ = echo.range_rate_mean_and_spread(cells, level, np.zeros(1))
    others = [RANGE_M - FOLD_M, RANGE_M + FOLD_M]
    strongest = max(others, key=lambda at_m: ground_m2(at_m) / at_m**4)
    steep = math.cos(math.asin(min(HEIGHT_M / strongest, 1.0)))
    assert rate[0] == pytest.approx(-60.0 * steep, rel=1e-6)


class Beside(SimpleNamespace):
    """One cell of a target straight ahead."""

    def __init__(self, range_m):
        one = np.array([range_m])
        super().__init__(range_m=one, elevation_rad=0.0 * one, azimuth_rad=0.0 * one)

    def __len__(self):
        return 1

    def field_at_rows(self, name):
        return np.array([900.0])


def test_without_a_cell_there_is_no_clutter_to_fold():
    with pytest.raises(SceneError, match="0: ground clutter fills a resolution cell"):
        Simulation(dsa_des.load_scene(scene(radar=without(RADAR, "range_cell_m"))))
