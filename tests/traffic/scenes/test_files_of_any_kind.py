"""``traffic.file``: several files as one traffic, an own flight among it, what is chosen of it."""

import math

import numpy as np
import pytest
import recorded_files as write
from covering import covers

from components.flights.closest_approach import KnownTimes
from components.traffic.files import FileTraffic, FileTrafficParameters
from components.traffic.scripted import ScriptedParameters, ScriptedTraffic
from dsa_des.block.component import Context
from dsa_des.block.entry_points import entry_points_of
from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

#: The names that it goes by; an environment that was made before has not all of them.
NAMES = tuple(
    name for name, point in entry_points_of().items()
    if point.value.startswith("components.traffic.fil") and name != "traffic.daa_file"
)  # fmt: skip
START = 1_717_243_200.0


def flight(lat=47.0, lon=8.0, alt=1000.0, begins=0, seconds=60, north=1e-4, step=1):
    return [(START + begins + k, lat + north * k, lon, alt) for k in range(0, seconds, step)]


def traffic(files=("t.gpx",), **keys):
    names = [str(file) for file in files]
    parameters = FileTrafficParameters(file=names if len(names) > 1 else names[0], **keys)
    context = Context(Streams(1), 10**9, sections={})
    return FileTraffic("traffic", parameters, context)


def gpx(tmp_path, name="t.gpx", **flights):
    path = tmp_path / name
    path.write_bytes(write.gpx(flights))
    return path


@covers("file", of=NAMES)
def test_files_of_one_flight_each_are_one_traffic_whatever_their_kinds(tmp_path):
    one = gpx(tmp_path, "one.gpx", a=flight())
    two = tmp_path / "two.igc"
    two.write_bytes(write.igc(flight(lat=47.1, begins=10), name="a"))
    three = tmp_path / "three.kml"
    three.write_bytes(write.kml({"c": flight(lat=47.2, begins=20)}))
    block = traffic([one, two, three])
    assert block.own.name == "a" and block.roster.names == ("a (two)", "c")
    assert [c.interval_present() for c in block.targets] == [(10.0, 69.0), (20.0, 79.0)]
    assert block.natural_duration_s() == 79
    folder = traffic([tmp_path])
    assert folder.roster.names == ("c (three)", "a (two)") or len(folder.roster) == 2


def table(rows):
    lines = ["time,icao24,lat,lon,alt"]
    lines += [f"{t},{name},{lat},{lon},{alt}" for name, t, lat, lon, alt in rows]
    return "\n".join(lines) + "\n"


def test_an_aircraft_that_two_receivers_heard_is_there_once(tmp_path):
    heard = [("4ca123", t, 47 + 1e-4 * t, 8.0, 1000) for t in (0, 2, 4, 12, 14)]
    here = [*heard, ("3c0001", 0, 47, 8.5, 900), ("3c0001", 14, 47, 8.5, 900)]
    # The other's clock is a little late, and it hears what the first one missed.
    there = [("4CA123", t + 0.1, 47 + 1e-4 * t, 8.0, 1000) for t in (2, 4, 6, 8, 10, 12)]
    (tmp_path / "here.csv").write_text(table(here))
    (tmp_path / "there.csv").write_text(table(there))
    block = traffic([tmp_path / "here.csv", tmp_path / "there.csv"])
    assert block.roster.names == ("3c0001",)
    assert block.own.sample_times_s == pytest.approx([0, 2, 4, 6.1, 8.1, 10.1, 12, 14])
    assert any("are in more than one file and count once" in n for n in block.content.notes)


@covers("ownship", of=NAMES)
def test_the_ownship_is_called_by_its_name_in_any_case(tmp_path):
    path = gpx(tmp_path, alpha=flight(), bravo=flight(lat=47.1))
    assert traffic([path], ownship="Bravo").own.name == "bravo"
    with pytest.raises(ValueError, match="there is no aircraft 'charlie': it must be one of alpha"):
        traffic([path], ownship="charlie")


@covers("altitude", of=NAMES)
def test_of_two_altitudes_the_chosen_one_is_flown(tmp_path):
    path = tmp_path / "a.igc"
    path.write_bytes(write.igc(flight(alt=1000.0), [950] * 60))
    assert traffic([path]).own.alt_m[0] == 950.0
    assert traffic([path], altitude="geometric").own.alt_m[0] == 1000.0


@covers("own_file", of=NAMES)
def test_an_own_flight_of_another_file_is_flown_among_the_others(tmp_path):
    others = gpx(tmp_path, a=flight(seconds=300), b=flight(lat=47.1, begins=200, seconds=50))
    own = gpx(tmp_path, "mine.gpx", me=flight(lon=8.1, begins=100, seconds=61))
    block = traffic([others], own_file=str(own))
    assert block.own.name == "me" and block.roster.names == ("a",)
    assert block.own.interval_present() == (0.0, 60.0) and block.natural_duration_s() == 60
    assert block.targets[0].at(np.array([0.0])).lat_deg[0] == pytest.approx(47.01, abs=1e-9)
    late = gpx(tmp_path, "late.gpx", me=flight(begins=1000))
    with pytest.raises(
        ValueError, match=r"no other aircraft is there from 2024-06-01 12:16:40 UTC"
    ):
        traffic([others], own_file=str(late))


@covers("own_starts_s", "own_moved.north_m", "own_moved.east_m", "own_moved.up_m", of=NAMES)
def test_an_own_flight_is_put_at_another_time_and_place(tmp_path):
    others = gpx(tmp_path, a=flight(seconds=300))
    own = gpx(tmp_path, "mine.gpx", me=[(5.0 + k, 60.0, 20 + 1e-3 * k, 500.0) for k in range(61)])
    moved = {"north_m": 30_000.0, "east_m": -20_000.0, "up_m": 250.0}
    block = traffic([others], own_file=str(own), own_starts_s=100, own_moved=moved)
    assert block.content.start_time_s == START + 100
    assert block.targets[0].at(np.array([0.0])).lat_deg[0] == pytest.approx(47.01, abs=1e-9)
    assert block.own.interval_present() == (0.0, 60.0)
    assert block.own.alt_m == pytest.approx([750.0] * 61, abs=0.5)
    # Of a sphere that touches there, to a thousandth of the way.
    north_m = 6_367_400 * math.radians(block.own.lat_deg[0] - 60.0) * 1.0027
    east_m = 6_378_137 * math.cos(math.radians(60.15)) * math.radians(block.own.lon_deg[0] - 20.0)
    assert (north_m, east_m) == pytest.approx((30_000, -20_000), rel=5e-3)

    # The path keeps its shape: lengths, to a thousandth.
    def length(lat, lon):
        east = np.radians(lon[-1] - lon[0]) * np.cos(np.radians(lat[0]))
        return math.hypot(east, math.radians(lat[-1] - lat[0]))

    before = length(np.full(61, 60.0), 20 + 1e-3 * np.arange(61))
    assert length(block.own.lat_deg, block.own.lon_deg) == pytest.approx(before, rel=2e-3)


@pytest.mark.parametrize(
    "more",
    [
        {}, {"yaw_deg": 10.0, "pitch_deg": 3.0, "roll_deg": -5.0}, {"climb_mps": 2.0},
        {"airspeed_mps": 40.0, "speed_mps": 0.0},
        {"legs": [{"kind": "straight", "duration_s": 5}, {"kind": "turn", "rate_deg_s": 3,
                                                          "duration_s": 10}]},
    ],
)  # fmt: skip
def test_a_scripted_ownship_flies_as_in_scripted_traffic(tmp_path, more):
    own = {"lat_deg": 47.05, "lon_deg": 8.0, "alt_m": 900.0, "heading_deg": 200.0,
           "speed_mps": 50.0, **more}  # fmt: skip
    block = traffic([gpx(tmp_path, a=flight(), b=flight(lat=47.1))], own_flight=own)
    scripted = ScriptedTraffic(
        "traffic", ScriptedParameters(ownship=own), Context(Streams(1), 10**9, sections={})
    )
    times = np.linspace(0.0, 60.0, 13)
    for mine, other in zip(
        block.own.at(times).arrays(), scripted.own.at(times).arrays(), strict=True
    ):
        assert (mine == other).all()
    assert block.roster.names == ("a", "b") and block.natural_duration_s() == 59
    assert [type(times) for times in block.sample_times()] == [KnownTimes]


@covers("from_s", "to_s", of=NAMES)
def test_a_window_of_time_is_flown(tmp_path):
    path = gpx(tmp_path, a=flight(seconds=100), b=flight(lat=47.1, seconds=10),
               c=flight(begins=30))  # fmt: skip
    block = traffic([path], from_s=20.5, to_s=40.25)
    assert block.roster.names == ("c",) and block.natural_duration_s() == 19.75
    assert block.content.start_time_s == START + 20.5
    assert block.own.at(np.array([0.0])).lat_deg[0] == pytest.approx(47.00205, abs=1e-9)
    assert block.own.interval_present() == (-0.5, 20.5)


@covers("box.south_deg", "box.north_deg", "box.west_deg", "box.east_deg", "lowest_m", "highest_m",
        of=NAMES)  # fmt: skip
@pytest.mark.parametrize(
    ("chosen", "present"),
    [
        ({"box": {"south_deg": 47.0025}}, (25, 59)),
        ({"box": {"north_deg": 47.0025}}, (0, 25)),
        ({"box": {"west_deg": 8.01}}, None),
        ({"box": {"east_deg": 7.99}}, None),
        ({"box": {"west_deg": 7.9, "east_deg": -170.0}}, (0, 59)),
        ({"lowest_m": 1001.0}, None),
        ({"highest_m": 999.0}, None),
        ({"lowest_m": 999.0, "highest_m": 1001.0}, (0, 59)),
    ],
)
def test_others_are_there_in_a_box_and_between_heights(tmp_path, chosen, present):
    """The ownship is there wherever it is."""
    path = gpx(tmp_path, own=flight(lat=10, lon=50, alt=9000.0), a=flight(),
               far=flight(lat=47.003, lon=8.0 if present else 8.005, alt=1000.0, north=0.0)
               if present is None or present[1] == 25 else flight(lat=47.02))  # fmt: skip
    if present is None:
        with pytest.raises(ValueError, match="no other aircraft is there from"):
            traffic([path], **chosen)
        return
    block = traffic([path], **chosen)
    assert block.targets[0].interval_present() == present
    assert block.own.interval_present() == (0.0, 59.0)


def test_who_leaves_a_box_is_away_until_it_comes_back(tmp_path):
    there_and_back = [
        (START + k, 47.0 + 1e-4 * min(k, 60 - k), 8.0, 1000.0) for k in range(61)
    ]  # fmt: skip
    path = gpx(tmp_path, own=flight(seconds=61), a=there_and_back)
    block = traffic([path], box={"north_deg": 47.00205})
    states = block.targets.at(np.arange(0.0, 61.0))
    assert np.flatnonzero(~states.present[:, 0]).tolist() == list(range(21, 40))
    alone = block.targets[0].at(np.arange(0.0, 61.0))
    assert (alone.present == states.present[:, 0]).all()


@covers("longest_gap_s", of=NAMES)
@pytest.mark.parametrize(
    ("keys", "away"), [({}, True), ({"longest_gap_s": 40.0}, False), ({"longest_gap_s": 5}, True)]
)
def test_gaps_are_gaps(tmp_path, keys, away):
    """Without a word 30 s, or ten times the usual step."""
    path = gpx(tmp_path, own=flight(seconds=100),
               a=[fix for fix in flight(seconds=100) if not 20 < fix[0] - START < 55])  # fmt: skip
    block = traffic([path], **keys)
    times = np.array([20.0, 20.001, 37.0, 54.999, 55.0])
    expected = [True, not away, not away, not away, True]
    assert block.targets.at(times).present[:, 0].tolist() == expected
    each = block.targets.each(np.zeros(5, dtype=np.int64), times)
    assert each.present.tolist() == expected
    (said,) = [line for line in block.content.warnings if "no sample for 35 s" in line]
    assert said.endswith("it is not there" if away else "positions there are interpolated")


def test_the_closest_approach_is_that_of_flights_that_are_there(tmp_path):
    """Straight through the ownship's place while nobody heard of it."""
    own = [(START + k, 47.0, 8.0, 1000.0) for k in range(121)]
    past = [(START + k, 47.0 + 1e-4 * (k - 60), 8.0, 1000.0)
            for k in range(121) if not 40 < k < 80]  # fmt: skip
    path = gpx(tmp_path, own=own, a=past)
    found = {}
    for gap in (None, 1000.0):
        keys = {} if gap is None else {"longest_gap_s": gap}
        parameters = FileTrafficParameters(file=str(path), **keys)
        context = Context(Streams(1), 10**9, sections={})
        context.duration_s = 120
        block = FileTraffic("traffic", parameters, context)
        (one,) = block.report()["targets"].values()
        found[gap] = one["closest_approach"]
    assert found[1000.0]["range_m"] == pytest.approx(0.0, abs=0.05)
    metres = 20e-4 * 111_170
    assert found[None] == {"time_s": 40.0, "range_m": pytest.approx(metres, rel=1e-3)}


def test_an_own_transponder_among_the_others_is_noticed(tmp_path):
    """Heard 200 m higher, as pressure has it, and a little beside."""
    own = gpx(tmp_path, "mine.gpx", me=flight())
    heard = gpx(tmp_path, itself=flight(lat=47.0002, alt=1200.0), other=flight(lat=47.003))
    (said,) = [w for w in traffic([heard], own_file=str(own)).content.warnings if "itself" in w]
    assert said.startswith("itself stays within 22 m of the ownship me: if it is its own")
    assert traffic([heard], own_file=str(own), without=["itself"]).roster.names == ("other",)


@pytest.mark.parametrize(("step_s", "away"), [(2, True), (4, False), (1, True)])
def test_a_silence_is_longer_than_ten_usual_steps_and_than_30_s(tmp_path, step_s, away):
    """Silent for 36 s, heard before and after at every so many seconds."""
    heard = [fix for fix in flight(seconds=121, step=step_s) if not 40 < fix[0] - START < 76]
    block = traffic([gpx(tmp_path, own=flight(seconds=121), a=heard)])
    assert block.targets.at(np.array([39.0, 60.0, 77.0])).present[:, 0].tolist() == [
        True, not away, True
    ]  # fmt: skip


def test_who_is_beside_the_ownship_for_half_the_time_is_another(tmp_path):
    """For 11 s at its place and then a kilometre away, or at its place for all but 11 s."""
    for near_s, is_noted in ((11, False), (49, True)):
        beside = [
            (t, lat, lon + (0.0 if t - START < near_s else 0.05), alt)
            for t, lat, lon, alt in flight()
        ]
        block = traffic([gpx(tmp_path, own=flight(), other=beside)])
        assert any("stays within" in line for line in block.content.warnings) is is_noted


def test_heights_of_several_kinds_are_said(tmp_path):
    one, two = gpx(tmp_path, "one.gpx", a=flight()), tmp_path / "two.igc"
    for pressure_m, other in ((None, "geometric altitude"), ([900] * 60, "barometric altitude")):
        two.write_bytes(write.igc(flight(lat=47.1), pressure_m, name="b"))
        content = traffic([one, two]).content
        assert content.height == f"{other}, geometric altitude above mean sea level" or (
            content.height == f"geometric altitude above mean sea level, {other}"
        )
        said = f"heights of several kinds are flown together: {content.height}"
        assert said in content.warnings
        (said,) = [w for w in traffic([two], own_file=str(one)).content.warnings if "heights" in w]
        assert said.startswith("heights of the ownship: geometric altitude above mean sea level;")
    two.write_bytes(write.gpx({"b": flight(lat=47.1)}))
    assert not any("heights" in w for w in traffic([one, two]).content.warnings)


@covers("without", of=NAMES)
def test_an_aircraft_is_left_out(tmp_path):
    path = gpx(tmp_path, a=flight(), b=flight(lat=47.1), c=flight(lat=47.2))
    assert traffic([path], without=["B"]).roster.names == ("c",)
    with pytest.raises(ValueError, match="there is no aircraft 'd'"):
        traffic([path], without=["d"])


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("from_s = 5\nto_s = 5", "to_s = 5: it must be above from_s"),
        ("own_file = 't.gpx'\nown_flight = {lat_deg = 1, lon_deg = 1, alt_m = 1}",
         "own_flight and own_file are given: only one says the ownship"),
        ("box = {south_deg = 5, north_deg = 4}", "north_deg = 4: it must be above south_deg, 5"),
    ],
)  # fmt: skip
def test_what_cannot_be_chosen_is_said(tmp_path, lines, said):
    gpx(tmp_path, a=flight(), b=flight())
    scene = tmp_path / "s.toml"
    scene.write_text(
        f"extends = 'detect_and_sense'\n[blocks.traffic]\ntype = '{NAMES[-1]}'\n"
        f"file = 't.gpx'\n{lines}"
    )
    with pytest.raises(SceneError, match=said):
        load_scene(scene)
