"""Standard deviations of a file: both aircraft's, along the longest axis, by their own scores."""

import math
from pathlib import Path

import numpy as np
import pytest

import dsa_des
from components.alert_configuration.conf_file import read_conf
from components.alerting.encounter import _uncertainty_bounds, read_encounter
from tests.alerting.conf_text import CONF

SCORES = """
h_pos_z_score = 1.5
v_pos_z_score = 2.5
h_vel_z_score_min = 2
h_vel_z_score_max = 2
v_vel_z_score = 3.5
"""
OWN = {"s_ew_std": 30.0, "s_ns_std": 10.0, "s_en_std": -15.0, "sz_std": 4.0,
       "v_ew_std": 3.0, "v_ns_std": 2.0, "v_en_std": 1.0, "vz_std": 0.5}  # fmt: skip
OTHER = {"s_ew_std": 5.0, "s_ns_std": 40.0, "s_en_std": 12.0, "sz_std": 9.0,
         "v_ew_std": 1.0, "v_ns_std": 6.0, "v_en_std": -2.0, "vz_std": 1.5}  # fmt: skip


def longest(of: dict[str, float], what: str) -> float:
    """By the eigenvalues of the covariance, whose signed root a file gives."""
    east, north, root = (of[f"{what}_{axes}_std"] for axes in ("ew", "ns", "en"))
    matrix = [[east**2, math.copysign(root**2, root)], [math.copysign(root**2, root), north**2]]
    return math.sqrt(np.linalg.eigvalsh(np.array(matrix)).max())


def test_bounds_are_those_of_both_aircraft(tmp_path: Path) -> None:
    text = "\n".join(line for line in CONF.splitlines() if "z_score" not in line) + SCORES
    (tmp_path / "a.conf").write_text(text, encoding="utf-8")
    own = {key: np.array([value]) for key, value in OWN.items()}
    targets = {key: np.array([[value]]) for key, value in OTHER.items()}
    relative = tuple(np.full((1, 1), 1000.0) for _ in range(6))
    found = _uncertainty_bounds(read_conf(tmp_path / "a.conf"), own, targets, relative)
    wanted = (
        1.5 * (longest(OWN, "s") + longest(OTHER, "s")), 2.5 * (4.0 + 9.0),
        2.0 * (longest(OWN, "v") + longest(OTHER, "v")), 3.5 * (0.5 + 1.5),
    )  # fmt: skip
    assert np.allclose([float(np.squeeze(bound)) for bound in found], wanted, rtol=1e-12)


DAA = """\
NAME lat lon alt trk gs vs time
[none] [deg] [deg] [m] [deg] [m/s] [m/s] [s]
own -41.3 174.2 1500 217 60 1 0
own -41.3 174.2 1500 217 60 1 1
late -41.28 174.23 1600 120 80 -4 0
late -41.28 174.23 1600 120 80 -4 0.7
late -41.28 174.23 1600 120 80 -4 1.2
"""


def test_a_sample_at_another_instant_than_the_ownship_s_is_left_out(tmp_path: Path) -> None:
    """Its row at the start counts; places by minutes of arc of a nautical mile."""
    (tmp_path / "a.conf").write_text(CONF, encoding="utf-8")
    (tmp_path / "a.daa").write_text(DAA, encoding="utf-8")
    found = read_encounter(tmp_path / "a.daa", read_conf(tmp_path / "a.conf"))
    assert found.present.tolist() == [[True], [False]]
    assert found.left_out == 2
    assert [found.relative[row][0, 0] for row in (0, 1)] == pytest.approx(
        [-0.03 * 60 * 1852 * math.cos(math.radians(41.29)), -0.02 * 60 * 1852], rel=1e-3
    )


def test_problems_of_a_configuration_in_a_scene_are_said_line_by_line(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.conf"
    wrong.write_text("lookahed_time = 180 [s]\nturn_rate = -3 [deg/s]\n")
    for scene, key in (
        ("alerting/first_light", "blocks.alerting.conf"),
        ("avoidance/crossing", "blocks.avoidance.conf"),
    ):
        with pytest.raises(dsa_des.SceneError) as caught:
            dsa_des.load_scene(scene, sets=[f"{key}={wrong}"])
        (problem,) = caught.value.problems
        first, *rest = str(problem).splitlines()
        assert f"{key} = " in first and first.endswith(f": {wrong}: 3 problems")
        assert [line.split(":")[0] for line in rest[:2]] == ["  line 1", "  line 2"]
