"""What keys of a table disagree about is told beside keys that are wrong by themselves."""

from pathlib import Path

import pytest

from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

DISAGREE = "blocks.radar.declare_m = 5: it must be at most declare_n, 3"


def problems(tmp_path: Path, configs: Path, radar: str) -> list[str]:
    path = tmp_path / "scene.toml"
    base = (configs / "first_light.toml").as_posix()
    path.write_text(f'extends = "{base}"\n[blocks.radar]\n{radar}\n')
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return [str(problem).partition(": ")[2] for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("scan_rate_hz = -1", "blocks.radar.scan_rate_hz = -1: must be greater than 0"),
        ("quantised = 7", "blocks.radar.quantised = 7: must be true or false"),
        ("quantisd = 7", "blocks.radar.quantisd: unknown parameter of radar.swerling; did you mean "
         "'quantised'?"),
    ],
)  # fmt: skip
def test_a_wrong_key_hides_no_disagreement_of_others(tmp_path, configs, wrong, told):
    found = problems(tmp_path, configs, f"declare_m = 5\ndeclare_n = 3\n{wrong}")
    assert sorted(found) == sorted([DISAGREE, told])


def test_what_rests_on_a_wrong_key_is_not_said(tmp_path, configs):
    """Not of a wrong key, nor of one whose name may have been misspelt."""
    (wrong,) = problems(tmp_path, configs, "declare_m = 5\ndeclare_n = 'x'")
    assert wrong.startswith("blocks.radar.declare_n = 'x': must be")
    (unknown,) = problems(tmp_path, configs, "declare_m = 5\ndeclare_nn = 5")
    assert unknown.startswith("blocks.radar.declare_nn: unknown parameter")


def test_truth_and_text_stand_for_no_number_in_any_table(tmp_path, configs):
    radar = "pulses = true\ncalibrate.swerling = true\ndeclare_m = 1\ndeclare_n = '3'"
    tables = "[weather]\nrain_rate_mm_h = true\nvisibility_km = '5'\n[terrain]\nheight_m = false"
    found = problems(tmp_path, configs, f"{radar}\n{tables}")
    assert sorted(found) == [
        "blocks.radar.calibrate.swerling = True: must be a number",
        "blocks.radar.declare_n = '3': must be a number",
        "blocks.radar.pulses = True: must be a number",
        "terrain.height_m = False: must be a number",
        "weather.rain_rate_mm_h = True: must be a number",
        "weather.visibility_km = '5': must be a number",
    ]


TWO_OF_ONE_NAME = """
scan_rate_hz = 0
[[blocks.traffic.intruders]]
name = "one"
east_m = 10
north_m = 3000
[[blocks.traffic.intruders]]
name = "one"
east_m = 20
north_m = 4000
"""


def test_what_a_block_refuses_when_it_is_made_is_told_beside_wrong_keys_of_others(
    tmp_path, configs
):
    """Names of intruders are compared when the traffic is made, after all keys have been read."""
    found = problems(tmp_path, configs, TWO_OF_ONE_NAME)
    assert len(found) == 2 and found[0] == "blocks.radar.scan_rate_hz = 0: must be greater than 0"
    assert found[1].startswith("blocks.traffic") and "one" in found[1]
    (alone,) = problems_of_running(tmp_path, configs, TWO_OF_ONE_NAME.replace("= 0\n", "= 1\n", 1))
    assert alone == found[1]


def problems_of_running(tmp_path: Path, configs: Path, radar: str) -> list[str]:
    path = tmp_path / "scene.toml"
    base = (configs / "first_light.toml").as_posix()
    path.write_text(f'extends = "{base}"\n[blocks.radar]\n{radar}\n')
    with pytest.raises(SceneError) as caught:
        _ = Simulation(load_scene(path)).components
    return [str(problem).partition(": ")[2] for problem in caught.value.problems]
