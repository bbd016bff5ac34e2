"""Random scenes give the same bytes however they are run.

Thousands: ``python tests/random_scenes/run_many.py --count 3000``; hundreds of closed loops:
``python tests/random_scenes/run_loops.py --count 300``.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pymap3d
import pytest
import run_loops
import run_tracks
import studies
from comparisons import difference, judge, recorded
from dice import Dice
from random_scene import legal_case
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

LIMIT_S = 60.0
FEW = range(9_000_000, 9_000_006)
MORE = range(9_100_020, 9_100_023)


@pytest.mark.parametrize("seed", FEW)
def test_a_random_scene_gives_the_same_however_it_is_run(seed, tmp_path):
    verdict = judge(legal_case(seed, tmp_path), tmp_path, LIMIT_S)
    assert verdict.kind == "same", verdict.detail


@pytest.mark.parametrize("seed", range(9_300_000, 9_300_003))
def test_a_random_scene_that_changes_gives_the_same_however_it_is_run(seed, tmp_path):
    verdict = judge(legal_case(seed, tmp_path, changing=1), tmp_path, LIMIT_S)
    assert verdict.kind == "same", verdict.detail


@pytest.mark.slow
@pytest.mark.parametrize("seed", MORE)
def test_many_random_scenes_give_the_same_however_they_are_run(seed, tmp_path):
    verdict = judge(legal_case(seed, tmp_path), tmp_path, LIMIT_S)
    assert verdict.kind == "same", verdict.detail


@pytest.mark.parametrize("seed", range(1, 5))
def test_a_random_closed_loop_gives_the_same_side_by_side(seed, tmp_path):
    found, _ = run_loops.judged(seed, tmp_path)
    assert not found


def test_a_scene_is_a_function_of_its_seed(tmp_path):
    one, other = (legal_case(FEW[0], tmp_path / name) for name in "ab")
    assert one == other
    assert one.tables != legal_case(FEW[1], tmp_path / "c").tables


def test_hash_seeds_change_nothing(tmp_path):
    paths = [legal_case(seed, tmp_path / str(seed)).write(tmp_path / str(seed)) for seed in FEW[:3]]
    assert studies.hash_seeds_differ(paths, 10 * LIMIT_S) == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", FEW[:3])
def test_a_random_study_gives_the_same_with_one_and_two_workers(seed, tmp_path):
    case = legal_case(seed, tmp_path)
    study = studies.write_study(case, tmp_path, Dice(seed))
    assert studies.workers_differ(study, 10 * LIMIT_S) in ("", "refused")


def test_what_differs_is_seen(tmp_path):
    """The comparison itself: a bit of a value, a row, the sign of zero and a null all count."""
    case = legal_case(FEW[0], tmp_path)
    first = recorded(case.load(tmp_path))
    other = recorded(dataclasses.replace(case.load(tmp_path), seed=12345))
    assert difference(first, first) == ""
    table = {"t": {"c": np.array([0, 5], dtype=np.int64)}}
    bit = {"t": {"c": np.array([-0.0, 5.0]).view(np.int64)}}
    zero = {"t": {"c": np.array([0.0, 5.0]).view(np.int64)}}
    assert "row 0" in difference(bit, zero)
    assert "rows" in difference(table, {"t": {"c": table["t"]["c"][:1]}})
    assert "tables" in difference(table, {})
    assert set(other) == set(first)


def test_the_generator_leaves_nothing_out(tmp_path):
    """Over some hundred scenes every type of block, loop, beam and fault on the way occurs."""
    wanted = {
        "closed loop", "sweeping beam in a loop", "update_rate_hz", "shared processors",
        "initial message", "clock jitter", "clock rate error", "clock offset", "weather",
        "terrain", "navigation", "accuracy", "declaration m of n", "camera false alarms",
        "radar false alarms", "several transforms", "several fusions", "two sources",
        "gates in series", "no gate", "at the pole", "antimeridian", "southern hemisphere",
        "ownship with legs", "traffic.scripted", "traffic.random", "traffic.csv",
        "traffic.daa_file", "radar.threshold", "radar.swerling", "radar.range_boundary",
        "optical.eo", "optical.ir", "optical.projection", "optical.range_boundary",
        "fusion.pick_best", "fusion.gated", "tracker", "avoidance", "latency of traffic",
        "delay_s traffic -> transform", "jitter_s fusion -> tracker",
        "drop_probability sensor -> fusion", "cue loop", "fusion.covariance_intersection",
        "tracker that estimates", "late looks that count", "fusion.pass_through",
        "changes enabled", "changes scan_rate_hz", "changes delay_s", "changes for a while",
        "outages", "2 platforms", "3 platforms", "site",
    }  # fmt: skip
    for seed in range(9_200_000, 9_200_120):
        wanted -= legal_case(seed, tmp_path).features
        if not wanted:
            break
    assert wanted == set()


#: Cheap ones, among them one behind every fusion; 65 had a covariance that became singular.
TRACKED = (9, 15, 22, 51, 54, 63, 65, 69, 70, 252, 253)


@pytest.fixture(scope="module")
def tracked():
    """Some of the scenes of ``python tests/random_scenes/run_tracks.py --count 300``."""
    return {seed: run_tracks.judged(seed, same=False) for seed in TRACKED}


@pytest.mark.parametrize("seed", TRACKED)
def test_a_random_tracked_scene_has_no_track_of_nobody(seed, tracked):
    assert tracked[seed][0] == ""


def test_random_tracked_scenes_have_errors_as_they_state(tracked):
    nees = run_tracks.added(found for _, found, _ in tracked.values())
    assert run_tracks.outside(nees) == []
    # Few scenes say little of each group, more of all of them.
    assert run_tracks.outside(run_tracks.added({"all": mine} for mine in nees.values())) == []
    kinds = {"covariance_intersection", "gated", "pass_through", "pass_through, one sensor",
             "pick_best"}  # fmt: skip
    assert set(nees) == kinds


@pytest.mark.parametrize("times", [0.1, 0.7, 3.0])
def test_a_fusion_whose_tracks_are_too_sure_or_too_cautious_is_seen(times):
    """Among others that are right, by 75 scenes of one instant."""
    draws = np.random.default_rng(7).chisquare(6, (2, 75))
    nees = {"gated": {20: [*draws[0]]}, "pick_best": {20: [*(times * draws[1])]}}
    wrong = [] if times == 0.7 else ["pick_best at 20 s"]
    assert run_tracks.outside(nees) == wrong


def test_nobody_is_seen():
    """A track half a kilometre beside the only aircraft, sure of itself by 50 m."""
    run = SimpleNamespace(truth=Rows([place(0.0, 0.0), place(10.0, 0.01)]), state_tracks=Rows([
        track(5.0, 600.0), track(6.0, 100.0)]))  # fmt: skip
    lost, nees = run_tracks.errors(run, {"blocks": {"fusion": {"type": "fusion.gated"}}})
    assert lost == ["tracker, track 1 of nobody in 1 of 2 rows"]
    # Off by 100 m at 50 m, and by the speed of a flight that goes north.
    north_m_s = pymap3d.geodetic2ned(0.01, 0.0, 0.0, 0.0, 0.0, 0.0)[0] / 10.0
    assert nees["gated"][6] == pytest.approx([4.0 + (north_m_s - 110.0) ** 2 / 100.0], rel=2e-2)


class Rows(list):
    """Rows of a table."""

    def to_pylist(self):
        return self


def place(time_s, lat_deg):
    return {"target": "one", "time_s": time_s, "lat_deg": lat_deg, "lon_deg": 0.0, "alt_m": 0.0}


def track(time_s, east_m):
    north_m = pymap3d.geodetic2ned(0.01, 0.0, 0.0, 0.0, 0.0, 0.0)[0] * time_s / 10.0
    units = {(False, False): "m2", (False, True): "m2_s", (True, True): "m2_s2"}
    spread = {f"covariance_{i}{j}_{units[i > 2, j > 2]}": (2500.0 if i < 3 else 100.0) * (i == j)
              for i in range(6) for j in range(i, 6)}  # fmt: skip
    return {"block": "tracker", "track": 1, "track_status": "confirmed", "has_range": True,
            "state_s": time_s, "age_s": 20.0, "north_m": north_m, "east_m": east_m, "down_m": 0.0,
            "north_m_s": 110.0, "east_m_s": 0.0, "down_m_s": 0.0, "origin_lat_deg": 0.0,
            "origin_lon_deg": 0.0, "origin_alt_m": 0.0, "own_north_m": north_m,
            "own_east_m": -5000.0, **spread}  # fmt: skip


@pytest.mark.parametrize("noise_m2_s3", [0.01, 1.0, 100.0])
def test_a_filter_in_straight_flight_has_half_the_nees_that_it_states(noise_m2_s3):
    """By the equations of Riccati and Lyapunov, of position and velocity along one axis."""
    motion, noise = np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, noise_m2_s3])
    seen, variance = np.array([[1.0, 0.0]]), np.array([[30.0]])
    stated = solve_continuous_are(motion.T, seen.T, noise, variance)
    gain = stated @ seen.T / variance
    true = solve_continuous_lyapunov(motion - gain @ seen, -gain @ variance @ gain.T)
    assert np.trace(np.linalg.solve(stated, true)) == pytest.approx(2.0 * run_tracks.STRAIGHT)
