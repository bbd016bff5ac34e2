"""A run that branches is the run that it comes from up to its branch, in everything recorded."""

import pyarrow.compute as pc
from same_runs import same_as_alone, tables_of

from dsa_des.replicas.changed_scene import Replica, scene_of
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import branch

#: Errors new at every look and errors that last, of sensors and of the ownship's own navigation,
#: and a wire that loses and delays.
LOOP = """
title = "a turn that comes by chance"
duration_s = 24
seed = 1
wires = [
  "traffic -> transform -> gate -> radar -> fusion -> tracker",
  { from = "tracker", to = "avoidance", drop_probability = 0.7, jitter_s = 0.4 },
  { from = "avoidance", to = "traffic", delay_s = 1, holds = "nothing" },
]
[navigation]
position_noise_m = [5, 5, 5]
position_correlation_time_s = 20
attitude_noise_deg = [0.1, 0.1, 0.1]
[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 52, lon_deg = 4, alt_m = 1000, speed_mps = 50 }
[[blocks.traffic.intruders]]
name = "ahead"
east_m = 0
north_m = 3000
up_m = 0
heading_deg = 180
speed_mps = 50
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.gate]
type = "gate"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 1
range_km = 4
azimuth_beamwidth_deg = 5.8
elevation_beamwidth_deg = 5.8
range_cell_m = 76.2
errors = "stated"
azimuth_error_deg = 1
elevation_error_deg = 1
elevation_correlation_time_s = 8
range_error_m = 20
range_bias_m = 5
[blocks.fusion]
type = "fusion.pick_best"
[blocks.tracker]
type = "tracking.stub"
[blocks.avoidance]
type = "avoidance.turn_away"
range_km = 5
turn_deg = 90
rate_deg_s = 6
"""


def branches_agree(scene, late_s, later_s):
    """Check a run, a branch of it and a branch of that, and that each goes its own way then."""
    one = branch(7, late_s * 10**9, 31)
    seeds = [7, one, branch(one, later_s * 10**9, 32)]
    scenes = [scene_of(scene, Replica(seed)) for seed in seeds]
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


def test_a_branch_is_its_run_up_to_the_branch(tmp_path):
    (tmp_path / "loop.toml").write_text(LOOP)
    branches_agree(load_scene(tmp_path / "loop.toml"), 8, 15)


def test_branches_with_a_filter_and_a_pilot():
    branches_agree(load_scene("configs/avoidance/crossing_tracked.toml", duration_s="50"), 20, 35)
