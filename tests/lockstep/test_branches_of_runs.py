"""A run that branches is the run that it comes from up to its branch, in everything recorded."""

import pyarrow.compute as pc
from same_runs import same_as_alone, tables_of
from wired import head_on_loop

import dsa_des
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.time.randomness import branch_seed


def branches_agree(scene, late_s, later_s):
    """Check a run, a branch of it and a branch of that, and that each goes its own way then."""
    one = branch_seed(7, late_s * 10**9, 31)
    seeds = [7, one, branch_seed(one, later_s * 10**9, 32)]
    scenes = [replica_scene(scene, Replica(seed)) for seed in seeds]
    same_as_alone(scenes)
    _, together = tables_of(scenes)
    for run, until_s in ((1, late_s), (2, later_s)):
        differ = 0
        for table in together.values():
            mine, theirs = (
                table.filter(pc.equal(table["replica"], k)).drop_columns(["replica"])
                for k in (run, run - 1)
            )
            parts = [
                each.filter(pc.less(each["tick"], until_s * scene.ticks_per_s)).combine_chunks()
                for each in (mine, theirs)
            ]
            assert parts[0].equals(parts[1])
            differ += not mine.combine_chunks().equals(theirs.combine_chunks())
        assert differ


def test_a_branch_is_its_run_up_to_the_branch():
    """With errors that last, of the navigation too, and a wire that loses and delays."""
    loop = head_on_loop(
        {
            "range_km": 4, "errors": "stated", "azimuth_error_deg": 1, "elevation_error_deg": 1,
            "elevation_correlation_time_s": 8, "range_error_m": 20, "range_bias_m": 5,
        },
        {"drop_probability": 0.7, "jitter_s": 0.4}, north_m=3000, duration_s=24,
        navigation={
            "position_noise_m": [5, 5, 5], "position_correlation_time_s": 20,
            "attitude_noise_deg": [0.1, 0.1, 0.1],
        },
    )  # fmt: skip
    branches_agree(dsa_des.load_scene(loop), 8, 15)


def test_branches_with_a_filter_and_a_pilot():
    branches_agree(
        dsa_des.load_scene("configs/avoidance/crossing_tracked.toml", duration_s="50"), 20, 35
    )
