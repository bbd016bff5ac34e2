"""Random scenes give the same bytes however they are run.

Thousands: ``python tests/random_scenes/run_many.py --count 3000``; hundreds of closed loops:
``python tests/random_scenes/run_loops.py --count 300``.
"""

import dataclasses

import numpy as np
import pytest
import run_loops
import run_tracks
import studies
from comparisons import difference, judge, recorded
from dice import Dice
from random_scene import legal_case

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
    }  # fmt: skip
    for seed in range(9_200_000, 9_200_120):
        wanted -= legal_case(seed, tmp_path).features
        if not wanted:
            break
    assert wanted == set()


@pytest.mark.parametrize("seed", [4, 5])
def test_a_random_tracked_scene_has_no_track_of_nobody(seed):
    """More: ``python tests/random_scenes/run_tracks.py --count 300``."""
    wrong, _, _ = run_tracks.judged(seed)
    assert wrong == ""
