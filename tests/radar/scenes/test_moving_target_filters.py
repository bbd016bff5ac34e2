"""A moving-target filter takes out what moves like the ground: exact range rates, crooked flights.

Range rates and the ownship's velocity are differences of positions by pymap3d; the gains are the
filter's weights applied to echoes one by one.
"""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, RADARS, covers
from wired import HEARS_ALL, chain, decided, noise_crosses, rows, run, sensor

from dsa_des.errors import SceneError

FREQUENCY_HZ, PRF_HZ = 10e9, 6000.0
WAVELENGTH_M = 299_792_458.0 / FREQUENCY_HZ
CELL = {
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 6.0, "range_resolution_m": 40.0,
}  # fmt: skip
GROUND_M = 1300.0
KINDS = ("single_canceller", "double_canceller", "filter_bank")


def range_rate(target: dict, time_s: float, ownship: dict = crooked.OWNSHIP) -> float:
    def distance(at):
        return float(
            np.linalg.norm(
                crooked.position(target, at, ownship) - crooked.position(ownship, at, ownship)
            )
        )

    return (distance(time_s + 0.05) - distance(time_s - 0.05)) / 0.1


def velocity(time_s: float, ownship: dict = crooked.OWNSHIP) -> np.ndarray:
    """Of the ownship over ground, in its north-east-down frame."""
    here = crooked.geodetic(crooked.position(ownship, time_s, ownship))
    import pymap3d

    def ned(at):
        return np.array(pymap3d.ecef2ned(*crooked.position(ownship, at, ownship), *here))

    return (ned(time_s + 0.05) - ned(time_s - 0.05)) / 0.1


def ground_rate(target: dict, time_s: float, ground_m: float | None) -> float:
    """Of the ground in the target's range cell, below the line of sight; of the line itself."""
    line = crooked.ned(target, time_s)
    range_m = float(np.linalg.norm(line))
    azimuth, elevation = crooked.angles(line)
    if ground_m is not None:
        own = crooked.geodetic(crooked.position(crooked.OWNSHIP, time_s))
        elevation = -math.asin(min(1.0, (own[2] - ground_m) / range_m))
    return -float(velocity(time_s) @ crooked.direction(azimuth, elevation))


def weights(kind: str, pulses: int) -> np.ndarray:
    return {
        "single_canceller": np.array([1.0, -1.0]),
        "double_canceller": np.array([1.0, -2.0, 1.0]),
        "filter_bank": np.hamming(pulses),
    }[kind]


def gain(kind: str, pulses: int, off_m_s: float, tuned: float = 0.0) -> float:
    """Power of echoes that turn by their Doppler shift from pulse to pulse, weighted and summed."""
    w = weights(kind, pulses)
    turn = -2.0 * off_m_s / WAVELENGTH_M / PRF_HZ
    total = abs(np.sum(w * np.exp(2j * np.pi * np.arange(len(w)) * (turn - tuned)))) ** 2
    return total / np.sum(w**2) / (pulses if kind == "filter_bank" else 1)


def tuned_to(pulses: int, off_m_s: float, notch: float) -> float:
    turn = -2.0 * off_m_s / WAVELENGTH_M / PRF_HZ
    centres = [k / pulses for k in range(-(pulses // 2), pulses // 2 + 1) if k]
    centres = [c for c in centres if abs(c) >= notch - 1e-12]
    return min(centres, key=lambda c: abs(math.remainder(turn - c, 1.0)))


def looked(kind: str, *, terrain: dict | None = None, duration_s: float = 3, **keys) -> dict:
    radar = sensor(
        kind, **{**CELL, "scan_rate_hz": 2, "frequency_hz": FREQUENCY_HZ, "prf_hz": PRF_HZ, **keys}
    )
    sections = {} if terrain is None else {"terrain": terrain}
    return chain({"radar": radar}, duration_s=duration_s, **sections)


def looks(kind: str, **keys):
    return run(looked(kind, **keys))


TARGETS = {target["name"]: target for target in crooked.TARGETS}


@covers("moving_target_filter", of=LINK_BUDGETS)
@covers("prf_hz", "frequency_hz", of=("radar.swerling",))
@pytest.mark.parametrize("lock", [True, False])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("radar", LINK_BUDGETS)
def test_an_echo_is_let_through_by_its_range_rate(radar, kind, lock):
    """Against the ground's below it, or against 0."""
    keys = {"terrain": {"height_m": GROUND_M, "clutter_gamma_db": -90.0}}
    plain = {(row["scan"], row["target"]): row for row in decided(looks(radar, **keys))}
    found = decided(looks(radar, moving_target_filter=kind, clutter_lock=lock, **keys))
    assert len(found) == 12
    for row in found:
        target, time_s = TARGETS[row["target"]], row["time_s"]
        off = range_rate(target, time_s) - (ground_rate(target, time_s, GROUND_M) if lock else 0.0)
        tuned = tuned_to(16, off, 2 / 16) if kind == "filter_bank" else 0.0
        expected_db = 10.0 * math.log10(gain(kind, 16, off, tuned))
        lost_db = row["snr_db"] - plain[row["scan"], row["target"]]["snr_db"]
        assert lost_db == pytest.approx(expected_db, abs=2e-3)


def test_a_sweeping_beam_hears_the_motion_of_the_instant_at_which_it_lights_the_target():
    # So exact that the beam's azimuth as measured is the one at which it lights the target.
    keys = {"beam_sweep": True, "scan_rate_hz": 0.5, "errors": "stated", "quantised": False,
            "azimuth_error_deg": 1e-6}  # fmt: skip
    filtered = {**keys, "moving_target_filter": "double_canceller", "clutter_lock": False}
    plain, found = (
        run({**looked("radar.threshold", duration_s=5, **one), "record": {"looks": True}})
        for one in (keys, filtered)
    )
    mean_db, heard_db = (
        {(row["scan"], row["target"]): row["snr_db"] for row in rows(table, "looks")}
        for table in (plain, found)
    )
    assert len(decided(found)) > 3
    for row in decided(found):
        off = range_rate(TARGETS[row["target"]], row["illuminated_s"])
        expected_db = 10.0 * math.log10(gain("double_canceller", 3, off))
        look = row["scan"], row["target"]
        assert heard_db[look] - mean_db[look] == pytest.approx(expected_db, abs=2e-2)
        late = range_rate(TARGETS[row["target"]], row["time_s"])
        assert abs(expected_db - 10.0 * math.log10(gain("double_canceller", 3, late))) > 0.05


@covers("filter_pulses", "notch_m_s", "clutter_lock", of=LINK_BUDGETS)
@pytest.mark.parametrize("radar", LINK_BUDGETS)
@pytest.mark.parametrize(("pulses", "notch_m_s"), [(8, 25.0), (32, 25.0), (32, 3.0)])
def test_a_bank_has_its_pulses_and_its_notch(radar, pulses, notch_m_s):
    plain = {(row["scan"], row["target"]): row for row in decided(looks(radar))}
    keys = {"moving_target_filter": "filter_bank", "filter_pulses": pulses, "clutter_lock": False}
    for row in decided(looks(radar, notch_m_s=notch_m_s, **keys)):
        off = range_rate(TARGETS[row["target"]], row["time_s"])
        tuned = tuned_to(pulses, off, 2.0 * notch_m_s / WAVELENGTH_M / PRF_HZ)
        expected_db = 10.0 * math.log10(gain("filter_bank", pulses, off, tuned))
        lost_db = row["snr_db"] - plain[row["scan"], row["target"]]["snr_db"]
        assert lost_db == pytest.approx(expected_db, abs=5e-3)


def spread_of(target: dict, motion_m_s: float) -> float:
    """Of the ground's range rates: a beam 2 deg wide across the course, and its own motion."""
    rate = ground_rate(target, 0.0, GROUND_M)
    across = math.sqrt(float(np.sum(velocity(0.0) ** 2)) - rate**2)
    beam = math.radians(2.0) / math.sqrt(16.0 * math.log(2.0))
    return math.hypot(beam * across, motion_m_s)


@covers("improvement_limit_db", of=LINK_BUDGETS)
@covers("clutter_motion_m_s", of=("[terrain]",))
@pytest.mark.parametrize("motion_m_s", [0.0, 2.0])
@pytest.mark.parametrize("limit_db", [15.0, 80.0])
@pytest.mark.parametrize(("kind", "lock"), [(KINDS[0], True), (KINDS[1], True), (KINDS[0], False)])
def test_clutter_leaves_a_residue_by_its_spread(kind, lock, limit_db, motion_m_s):
    """The mean over the spectrum of the ground's range rates, and what the radar itself limits."""
    terrain = {"height_m": GROUND_M, "clutter_gamma_db": 0.0, "clutter_motion_m_s": motion_m_s}
    low = [{**crooked.DIVING, "up_m": -900.0}]
    radar = {**HEARS_ALL, **CELL, "frequency_hz": FREQUENCY_HZ, "prf_hz": PRF_HZ}
    filtered = {"moving_target_filter": kind, "improvement_limit_db": limit_db,
                "clutter_lock": lock}  # fmt: skip
    cnr = []
    for keys in ({}, filtered):
        scene = chain({"radar": {**radar, **keys}}, targets=low, terrain=terrain)
        (row,) = decided(run(scene))
        lost_db = row["snr_db"] - HEARS_ALL["threshold_db"] - row["confidence"]
        cnr.append(10.0 ** (0.1 * lost_db) - 1.0)
    mean = 0.0 if lock else ground_rate(low[0], 0.0, GROUND_M)
    spread = spread_of(low[0], motion_m_s)
    off = mean + spread * np.linspace(-8.0, 8.0, 4001)
    density = np.exp(-0.5 * ((off - mean) / spread) ** 2)
    residue = np.average([gain(kind, 2, v) for v in off], weights=density)
    assert cnr[1] / cnr[0] == pytest.approx(residue + 10.0 ** (-0.1 * limit_db), rel=2e-2)


#: Passes by, level with a still ownship and 2 km off: its range rate goes through 0.
PASSING = {
    **crooked.ROLLING, "name": "passing", "east_m": 2000.0, "north_m": -900.0, "up_m": -960.0,
    "heading_deg": 0.0, "speed_mps": 60.0, "climb_mps": 0.0, "rcs_dbsm": 0.0,
}  # fmt: skip
POWER = {
    "radar.threshold": {"threshold_db": 13.0, "power_w": 3.0},
    "radar.swerling": {"swerling": 0, "power_w": 10.0, "reference_pd": 0.5},
    "radar.range_boundary": {"range_km": 4.0, "boundary_rcs_dbsm": 0.0},
}


def passing(radar: str, ownship: dict, target: dict, **keys) -> list[float]:
    """Times at which the target is seen."""
    table = sensor(
        radar, **{**CELL, **POWER[radar], "scan_rate_hz": 4, "frequency_hz": FREQUENCY_HZ,
                  "prf_hz": PRF_HZ, **keys},
    )  # fmt: skip
    terrain = {"height_m": 1350.0, "clutter_gamma_db": -12.0, "clutter_motion_m_s": 0.3}
    scene = chain(
        {"radar": table}, ownship=ownship, targets=[target], duration_s=30, terrain=terrain
    )
    return [row["time_s"] for row in decided(run(scene), target="passing")]


@covers("moving_target_filter", "prf_hz", "frequency_hz", "clutter_lock", "filter_pulses",
        "notch_m_s", "improvement_limit_db", of=("radar.range_boundary",))  # fmt: skip
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("kind", ["double_canceller", "filter_bank"])
@pytest.mark.parametrize("radar", RADARS)
def test_a_crossing_target_disappears_in_the_notch_and_comes_back(radar, kind, moving):
    """When its own velocity over ground has no part along the line of sight."""
    own = {**crooked.OWNSHIP, "climb_mps": 0.0, "speed_mps": 45.0 if moving else 0.0}
    target = PASSING
    seen = passing(radar, own, target, moving_target_filter=kind)
    without = passing(radar, own, target)
    assert len(without) < len(seen) < 120
    # The target's own range rate over ground, from its velocity to the north.
    times = np.arange(0, 30, 0.25)
    own_rate = np.array(
        [
            60.0 * crooked.ned(target, t, own)[0] / np.linalg.norm(crooked.ned(target, t, own))
            for t in times
        ]
    )
    crossing = times[np.argmin(np.abs(own_rate))]
    assert 3.0 < crossing < 27.0
    hidden = [t for t in times if t not in set(seen)]
    assert min(abs(t - crossing) for t in seen) > 0.5
    assert min(seen) < crossing < max(seen)
    around = [t for t in hidden if abs(t - crossing) < 12.0]
    assert around and np.max(np.abs(own_rate[np.isin(times, around)])) < 25.0


@pytest.mark.parametrize("radar", RADARS)
@pytest.mark.parametrize("multiple", [1, -1, 2])
def test_a_blind_speed_hides_a_target_that_comes_straight_on(radar, multiple):
    """λ PRF / 2 and its multiples; half a blind speed beside them it is seen."""
    blind_m_s = 0.5 * WAVELENGTH_M * PRF_HZ
    own = {**crooked.OWNSHIP, "climb_mps": 0.0, "speed_mps": 0.0}
    for share, seen in ((1.0, False), (1.0 + 0.5 / multiple, True)):
        rate = multiple * blind_m_s * share
        # Level at the same height, on its way from or to us.
        coming = {
            **crooked.ROLLING, "name": "passing", "up_m": 0.0, "climb_mps": 0.0,
            "east_m": 0.0, "north_m": 2500.0, "heading_deg": 0.0 if rate > 0 else 180.0,
            "speed_mps": abs(rate), "rcs_dbsm": 0.0,
        }  # fmt: skip
        # Nearer than 500 m the 40 dB of the notch are not enough.
        times = passing(radar, own, coming, moving_target_filter="double_canceller", range_km=4.0)
        early = [t for t in times if 1500.0 < abs(2500.0 + rate * t) < 3500.0 and 0.0 <= t < 6.0]
        there = [t for t in np.arange(0, 6.0, 0.25) if 1500.0 < 2500.0 + rate * t < 3500.0]
        assert len(there) >= 2
        assert (len(early) > 0.5 * len(there)) is seen, (share, early)


@covers("range_rate_folds", of=RADARS)
@pytest.mark.parametrize("prf_hz", [1500.0, 6000.0])
@pytest.mark.parametrize("radar", RADARS)
def test_range_rates_of_one_prf_fold_at_the_unambiguous_velocity(radar, prf_hz):
    """Within ±λ PRF / 4, whole blind speeds away from the truth; false alarms as well."""
    blind_m_s = 0.5 * WAVELENGTH_M * prf_hz
    keys = {"measures_range_rate": True, "prf_hz": prf_hz, "frequency_hz": FREQUENCY_HZ}
    if radar != "radar.range_boundary":
        keys |= {**noise_crosses(radar, 1e-4), "range_km": 4.0}
    found = decided(run(chain({"r": sensor(radar, **CELL, **keys, range_rate_folds=True)})))
    assert len([row for row in found if row["target"]]) == 2
    for row in found:
        assert abs(row["range_rate_m_s"]) <= 0.5 * blind_m_s * (1.0 + 1e-12)
        if row["target"]:
            off = row["range_rate_m_s"] - range_rate(TARGETS[row["target"]], row["time_s"])
            assert math.remainder(off, blind_m_s) == pytest.approx(0.0, abs=1e-3)
    if prf_hz == 1500.0:
        truth = [range_rate(target, 0.0) for target in crooked.TARGETS]
        assert any(abs(rate) > 0.5 * blind_m_s for rate in truth)


@pytest.mark.parametrize("radar", RADARS)
def test_a_look_at_nothing_has_nothing_to_filter(radar):
    far = [{**crooked.ROLLING, "north_m": -90_000.0}]
    keys = {"moving_target_filter": "single_canceller", "prf_hz": PRF_HZ, "range_km": 3.0,
            "frequency_hz": FREQUENCY_HZ}  # fmt: skip
    assert not decided(run(chain({"r": sensor(radar, **CELL, **keys)}, targets=far)))


BAD = [
    ("radar.threshold", {"moving_target_filter": "double_canceller", "prf_hz": 1e3,
                         "pulses_per_dwell": 2}, "adds up 3 pulses, and a look has 2"),
    ("radar.swerling", {"moving_target_filter": "filter_bank", "prf_hz": 1e3, "dwell_s": 0.012},
     "adds up 16 pulses, and a look has 12"),
    ("radar.threshold", {"range_rate_folds": True, "prf_hz": 1e3}, "measures_range_rate is false"),
    ("radar.swerling", {"range_rate_folds": True, "measures_range_rate": True},
     "prf_hz is not given"),
    ("radar.range_boundary", {"range_rate_folds": True, "measures_range_rate": True,
                              "prf_hz": 1e3}, "frequency_hz is not given"),
    ("radar.swerling", {"moving_target_filter": "triple", "prf_hz": 1e3}, "single_canceller"),
    ("radar.swerling", {"moving_target_filter": "single_canceller"}, "prf_hz is not given"),
    ("radar.range_boundary", {"moving_target_filter": "single_canceller", "prf_hz": 1e3},
     "frequency_hz is not given"),
    ("radar.range_boundary", {"prf_hz": 1e5}, "prf_hz.*100000.*echoes are unambiguous up to"),
    ("radar.threshold", {"notch_m_s": 3.0}, "notch_m_s is 3 and moving_target_filter is 'none'"),
    ("radar.threshold", {"moving_target_filter": "filter_bank", "prf_hz": 1e3, "notch_m_s": 90.0},
     "it leaves no filter"),
    ("radar.threshold", {"moving_target_filter": "filter_bank", "prf_hz": 1e3,
                         "filter_pulses": 4}, "filter_pulses"),
    ("radar.swerling", {"improvement_limit_db": -1.0}, "improvement_limit_db"),
]  # fmt: skip


@pytest.mark.parametrize(("radar", "keys", "message"), BAD)
def test_bad_filters_are_one_error_each(radar, keys, message):
    with pytest.raises(SceneError, match=message) as caught:
        run(chain({"radar": sensor(radar, **keys)}))
    assert len(caught.value.problems) == 1
