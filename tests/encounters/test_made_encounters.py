"""Encounters made by hand, their closest approaches searched for by pymap3d and GeographicLib."""

import math
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from geographiclib.geodesic import Geodesic

import dsa_des
from components.encounters.encounter_traffic import encounter_flights
from components.encounters.made_encounters import make_set, read_recipe
from components.formats.encounter_set import EncounterSet
from components.formats.set_file import read_set
from dsa_des.errors import UsageError
from tests.encounters.test_set_file import call
from tests.support.wired import sensor

FOOT, KT = 0.3048, 1852 / 3600
RECIPE = """\
closest_s = 100
horizontal_ft = 200
vertical_ft = 50
bearing_deg = 70
own_speed_kt = 120
own_heading_deg = 217
own_altitude_ft = 3000
intruder_speed_kt = 140
intruder_climb_ft_min = 500
geometry = "overtaking"
at = [-41.3, 179.9997]
"""


def made(folder: Path, text: str = RECIPE) -> EncounterSet:
    path = folder / "made.toml"
    path.write_text(text, encoding="utf-8")
    return make_set(read_recipe(str(path)))


def changed(old: str, new: str) -> str:
    assert old in RECIPE
    return RECIPE.replace(old, new)


def places(found: EncounterSet, place: int, time_s: float) -> list[tuple[float, float, float]]:
    states = [flight.at(time_s) for flight in encounter_flights(found, place, "euler")]
    return [(float(s.lat_deg), float(s.lon_deg), float(s.alt_m)) for s in states]


def slant_m(found: EncounterSet, place: int, time_s: float) -> float:
    own, other = (np.array(pymap3d.geodetic2ecef(*p)) for p in places(found, place, time_s))
    return float(np.linalg.norm(other - own))


def searched(found: EncounterSet, place: int, low: float, high: float) -> float:
    """Return when the slant range is smallest, by golden section."""
    golden = (math.sqrt(5) - 1) / 2
    while high - low > 1e-4:
        a, b = high - golden * (high - low), low + golden * (high - low)
        if slant_m(found, place, a) < slant_m(found, place, b):
            high = b
        else:
            low = a
    return (low + high) / 2


def test_every_course_of_a_slow_intruder_is_made_and_none_that_is_not(tmp_path: Path) -> None:
    """Of 35 kt against 60 kt two lead there from within asin(35/60) = 35.69 deg, else none."""
    text = changed("bearing_deg = 70", "bearing_deg = [-80, -35.5, 0, 20, 36]")
    text = text.replace("own_speed_kt = 120", "own_speed_kt = 60").replace("= 140", "= 35")
    text = text.replace('geometry = "overtaking"', 'courses = "every"')
    text = text.replace("intruder_climb_ft_min = 500", "intruder_climb_ft_min = 0")
    found = made(tmp_path, text)
    assert found.extra["bearing_deg"].tolist() == pytest.approx([324.5, 324.5, 0, 0, 20, 20])
    for place in range(len(found)):
        # It comes from that bearing, though at both courses at another speed.
        (own, other), (own_later, other_later) = (places(found, place, t) for t in (10.0, 11.0))
        speeds = [_moved_m(a, b) for a, b in ((own, own_later), (other, other_later))]
        assert speeds == pytest.approx([60 * KT, 35 * KT], rel=1e-3)
    closing = [slant_m(found, place, 50.0) for place in range(len(found))]
    assert closing[0] > closing[1] and closing[2] > closing[3]


def _moved_m(one: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    first, second = (np.array(pymap3d.geodetic2ecef(*place)) for place in (one, other))
    return float(np.linalg.norm(second - first))


def test_traffic_takes_the_table_itself(tmp_path: Path) -> None:
    text = changed("bearing_deg = 70", "bearing_deg = [70, 80]")
    expected = made(tmp_path, text)
    blocks = {
        "traffic": {"type": "traffic.encounters", "file": str(tmp_path / "made.toml")},
        "transform": {"type": "geometry.ellipsoid"},
        "radar": sensor("radar.range_boundary"),
    }
    scene = {"duration_s": 3, "seed": 1, "wires": ["traffic -> transform -> radar"],
             "blocks": blocks}  # fmt: skip
    blocks["traffic"]["encounter"] = 1
    run = dsa_des.run(scene)
    own = [row for row in run["truth"].to_pylist() if row["target"] is None][-1]
    lat, lon, alt = places(expected, 1, own["time_s"])[0]
    assert (own["lat_deg"], own["alt_m"]) == pytest.approx((lat, alt), abs=1e-6)
    assert math.remainder(own["lon_deg"] - lon, 360.0) == pytest.approx(0.0, abs=1e-6)
    (tmp_path / "made.toml").write_text(text.replace("closest_s", "closest"), encoding="utf-8")
    with pytest.raises(Exception, match=r"made.toml: closest = 100: unknown key.*closest_s"):
        dsa_des.run(scene)


@pytest.mark.parametrize("side", [200, -200])
@pytest.mark.parametrize(("at_s", "vertical"), [(100, 50), (63.4, -300)])
def test_the_example_is_met_on_the_ellipsoid(tmp_path, side, at_s, vertical) -> None:
    text = changed("horizontal_ft = 200", f"horizontal_ft = {side}")
    text = text.replace("closest_s = 100", f"closest_s = {at_s}")
    found = made(tmp_path, text.replace("vertical_ft = 50", f"vertical_ft = {vertical}"))
    assert searched(found, 0, 30, 119) == pytest.approx(at_s, abs=1e-3)
    own, other = places(found, 0, at_s)
    east, north, _ = pymap3d.geodetic2enu(*other, *own)
    # Between its samples, 70 m apart, a path is straight: 0.1 mm.
    assert math.hypot(east, north) == pytest.approx(200 * FOOT, abs=2e-3)
    assert other[2] - own[2] == pytest.approx(vertical * FOOT, abs=2e-3)
    assert own[:2] == pytest.approx((-41.3, 179.9997), abs=1e-6)
    # Far away it stands where it comes from.
    own, other = places(found, 0, 0.0)
    east, north, _ = pymap3d.geodetic2enu(*other, *own)
    bearing = (math.degrees(math.atan2(east, north)) - 217) % 360
    assert bearing == pytest.approx(70, abs=2.0)
    # Speeds, courses and climbs are those that were asked for, over geodesics.
    for k, (speed, climb) in enumerate(((120 * KT, 0.0), (140 * KT, 500 * FOOT / 60))):
        a, b = (places(found, 0, t)[k] for t in (40.0, 41.0))
        way = Geodesic.WGS84.Inverse(*a[:2], *b[:2])
        radius = 6.378e6
        assert way["s12"] * (1 + a[2] / radius) == pytest.approx(speed, rel=1e-4)
        assert b[2] - a[2] == pytest.approx(climb, abs=1e-6)


def test_both_sides_pass_on_both_sides(tmp_path: Path) -> None:
    found = made(tmp_path, changed("horizontal_ft = 200", "horizontal_ft = [200, -200]"))
    assert len(found) == 2
    sides = []
    for k in (0, 1):
        own, other = places(found, k, 100.0)
        e, n, _ = pymap3d.geodetic2enu(*other, *own)
        later = places(found, k, 101.0)
        e2, n2, _ = pymap3d.geodetic2enu(*later[1], *later[0])
        sides.append(np.sign((n2 - n) * e - (e2 - e) * n))
    assert sides[0] == -sides[1]


def test_the_horizontal_sense_asks_for_the_horizontal_distance_alone(tmp_path: Path) -> None:
    found = made(tmp_path, RECIPE + 'sense = "horizontal"\n')

    def level(t: float) -> float:
        own, other = places(found, 0, t)
        return math.hypot(*pymap3d.geodetic2enu(*other, *own)[:2])

    times = np.arange(99.9, 100.1, 0.002)
    assert times[np.argmin([level(t) for t in times])] == pytest.approx(100, abs=0.003)
    assert abs(searched(found, 0, 90, 110) - 100) > 0.005  # the slant range's is elsewhere


def test_lists_are_swept_and_ranges_drawn_by_number(tmp_path: Path) -> None:
    text = changed("bearing_deg = 70", "bearing_deg = [10, 70, 120]")
    text = text.replace("vertical_ft = 50", "vertical_ft = { uniform = [-100, 100] }")
    text = text.replace("own_speed_kt = 120", "own_speed_kt = { uniform = [60, 160] }")
    text = text.replace('geometry = "overtaking"', "count = 4")
    found = made(tmp_path, text)
    assert len(found) == 12
    assert found.extra["bearing_deg"] == pytest.approx(np.repeat([10, 70, 120], 4))
    drawn = found.extra["vertical_miss_m"] / FOOT
    assert len(set(drawn)) == 12 and np.abs(drawn).max() <= 100
    for k in (1, 6, 11):
        assert searched(found, k, 98, 102) == pytest.approx(100, abs=2e-3)
    again = made(tmp_path, text)
    assert np.array_equal(again.lists["north_m"], found.lists["north_m"])
    other = made(tmp_path, text + "seed = 3\n")
    assert not np.array_equal(other.extra["vertical_miss_m"], found.extra["vertical_miss_m"])


@pytest.mark.parametrize("kind", ["head-on", "crossing", "overtaking"])
def test_the_geometry_is_kept_where_speeds_are_drawn(tmp_path: Path, kind: str) -> None:
    text = changed('geometry = "overtaking"', f'geometry = "{kind}"\ncount = 6')
    text = text.replace("bearing_deg = 70", "bearing_deg = { uniform = [-60, 60] }")
    text = text.replace("own_speed_kt = 120", "own_speed_kt = { uniform = [60, 260] }")
    found = made(tmp_path, text)
    assert {str(name).split(" ")[0] for name in found.extra["geometry"]} == {kind}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("bearing_deg = 70", "bearing_deg = 70\nbearng_deg = 1", "unknown key; did you mean 'be"),
        ("closest_s = 100\n", "", "closest_s: is required"),
        ("vertical_ft = 50", 'vertical_ft = "x"', "must be a number, a list of numbers, or {unif"),
        ("vertical_ft = 50", "vertical_ft = {uniform = [3, 1]}", "the lower one first"),
        ("vertical_ft = 50", "vertical_ft = 50\nvertical_m = 1", "is given twice"),
        ("own_speed_kt = 120", "own_speed_kt = -5", "own_speed_kt = -5: must lie from"),
        ("at = [-41.3, 179.9997]", "at = [95, 0]", "at = [95, 0]: must be [latitude, longitude]"),
        ('"overtaking"', '"sideways"', "geometry = 'sideways': must be of any, head-on"),
        ("own_speed_kt = 120", "own_speed_kt = 40", "encounter 0: no course of an intruder at"),
        ("horizontal_ft = 200", "horizontal_ft = 1", "encounter 0: it climbs or sinks too fast"),
        ("closest_s = 100", "closest_s = = 1", "made.toml"),
        (
            "closest_s = 100",
            "closest_s = 9\nweight = 0",
            "weight = 0: must be a number from 1e-100",
        ),
        ("closest_s = 100", "closest_s = 9\nduration_s = 8e4\ncount = 9999", "1.6e+09 samples of"),
    ],
)
def test_what_cannot_be_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(UsageError) as error:
        made(tmp_path, changed(old, new))
    assert said in str(error.value)


def test_on_the_command_line(tmp_path: Path) -> None:
    recipe = tmp_path / "made.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    out = tmp_path / "set.parquet"
    assert call("generate", "--made", recipe, "--out", out).exit_code == 0
    found = read_set(out)
    assert searched(found, 0, 60, 119) == pytest.approx(100, abs=1e-3)
    done = call("generate", "--made", recipe, "--count", 3, "--out", out)
    assert done.exit_code == 2 and "--made says all of its encounters" in done.stderr
    done = call("generate", "--out", out)
    assert done.exit_code == 2 and "either --model FILE and --count N" in done.stderr
