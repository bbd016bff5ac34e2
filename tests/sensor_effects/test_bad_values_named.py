"""What is wrong with sensors, weather and flights is said at its own key, with what is allowed."""

from pathlib import Path

import pytest
from wired import chain, sensor

from dsa_des.errors import SceneError
from dsa_des.library.scenes import load_scene as load_any
from dsa_des.scene.scene import load_scene


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (
            ["weather.fog_base_m=1000", "weather.fog_top_m=500"],
            "weather.fog_top_m = 500: it must be at least fog_base_m, 1000",
        ),
        (["wether.rain_rate_mm_h=5"], "wether: unknown key of a scene; did you mean 'weather'?"),
        (
            ["blocks.radar.declare_m=5", "blocks.radar.declare_n=3"],
            "blocks.radar.declare_m = 5: it must be at most declare_n, 3",
        ),
        (
            ["navigation.position_bias_m=[1,2]"],
            "navigation.position_bias_m = [1, 2]: must be a list of 3 numbers",
        ),
        (
            ["navigation.position_bias_m=[1,2,3,4]"],
            "navigation.position_bias_m = [1, 2, 3, 4]: must be a list of 3 numbers",
        ),
        (
            ["blocks.radar.misalignment_deg=5"],
            "blocks.radar.misalignment_deg = 5: must be a list of 3 numbers",
        ),
        (
            ["blocks.traffic.ownship.legs=[{kind='turm'}]"],
            "blocks.traffic.ownship.legs[0].kind = 'turm': must be one of straight, turn, climb, "
            "stationary, waypoints; did you mean 'turn'?",
        ),
        (
            ["blocks.traffic.ownship.legs=[{duration_s=5}]"],
            "blocks.traffic.ownship.legs[0].kind: is required and missing",
        ),
        (["blocks.radar.calibrate=3"], "blocks.radar.calibrate = 3: must be a table"),
        (
            ["blocks.eo.elevation_deg=[5,5]"],
            "blocks.eo.elevation_deg = [5, 5]: must hold two angles in [-90, 90], the lower one "
            "first",
        ),
        (
            ["blocks.radar.false_alarm_probability=0.3", "blocks.radar.reference_pd=0.2"],
            "blocks.radar.reference_pd = 0.2: it must be above false_alarm_probability, 0.3, "
            "which noise alone reaches",
        ),
        *(
            (
                [f"blocks.eo.azimuth_deg={field}"],
                f"blocks.eo.azimuth_deg = {field}: must hold a field above 0 and up to 360 deg "
                "wide; all round is -180, 180",
            )
            for field in ("[20, 20]", "[-360, 360]", "[180, -180]")
        ),
    ],
)
def test_one_problem_at_its_own_key(configs: Path, sets: list[str], text: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(configs / "first_light.toml", sets=sets)
    assert [str(problem) for problem in caught.value.problems] == [f"command line: {text}"]


@pytest.mark.parametrize(
    ("keys", "where", "said"),
    [
        ({}, "", "exactly one of wavelength_m and frequency_hz must be given"),
        ({"wavelength_m": 0.03, "frequency_hz": 1e10}, "", "exactly one of wavelength_m and"),
        ({"wavelength_m": 0.0}, ".wavelength_m = 0.0", "must be greater than 0"),
        ({"wavelength_m": -0.03}, ".wavelength_m = -0.03", "must be greater than 0"),
        ({"frequency_hz": 0.0}, ".frequency_hz = 0.0", "must be greater than 0"),
    ],
)
@pytest.mark.parametrize("kind", ["radar.threshold", "radar.swerling"])
def test_a_radar_has_one_carrier(kind: str, keys: dict, where: str, said: str) -> None:
    radar = {**sensor(kind), "frequency_hz": None, **keys}
    radar = {key: value for key, value in radar.items() if value is not None}
    if "wavelength_m" not in keys:
        radar.pop("wavelength_m", None)
    with pytest.raises(SceneError) as caught:
        load_any(chain({"radar": radar}))
    assert any(f"blocks.radar{where}" in str(one) and said in str(one)
               for one in caught.value.problems)  # fmt: skip


def test_of_a_whole_table_no_contents_are_shown(configs: Path) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(configs / "first_light.toml", sets=["blocks.radar.frequency_hz=35e9"])
    (problem,) = caught.value.problems
    assert str(problem).endswith(
        "blocks.radar: exactly one of wavelength_m and frequency_hz must be given"
    )
