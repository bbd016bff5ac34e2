"""Logs of receivers and services: each number where its format has it, in its unit, once."""

import gzip
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_files import read_csv

import dsa_des
from components.formats.daa_file import read_daa
from components.formats.recorded import known_kinds
from components.formats.text_rows import TrafficFileError

FOOT, KNOT = 0.3048, 1852 / 3600


def read(folder, content, name="log", **options):
    path = folder / name
    text = content if isinstance(content, str) else json.dumps(content)
    path.write_bytes(text.encode())
    return read_csv(path, **options)


def record(folder, content):
    (folder / "log").write_text(json.dumps(content))
    return known_kinds.recording_of_file(folder / "log")


def snapshot(now, *aircraft):
    return {"now": now, "messages": 1, "aircraft": list(aircraft)}


def craft(address, lat, **more):
    return {"hex": address, "flight": f"FL{address} ", "lat": lat, "lon": 8.0, "alt_baro": 3000,
            "alt_geom": 3150, "gs": 100, "track": 0.0, "baro_rate": 64, "seen_pos": 0.5,
            **more}  # fmt: skip


HISTORY = [
    snapshot(1700000000.0, craft("a1", 47.0), craft("b2", 47.099, alt_baro="ground"),
             {"hex": "c3", "seen": 1.0}),
    snapshot(1700000001.0, craft("a1", 47.0005), craft("b2", 47.1, seen_pos=1.6)),
    # The last position of b2 again, a second older, as its age is rounded.
    snapshot(1700000002.0, craft("b2", 47.1, seen_pos=2.7, alt_baro=3025)),
    snapshot(1700000010.0, craft("a1", 47.005), craft("b2", 47.104, alt_geom=None)),
]  # fmt: skip


def test_a_history_of_snapshots_is_read_in_feet_and_knots(tmp_path):
    file = read(tmp_path, "\n".join(json.dumps(one) for one in HISTORY))
    own, other = file.aircraft
    assert (own.name, other.name) == ("a1", "b2")
    assert file.start_time_s == 1699999999.4
    assert own.sample_times_s == pytest.approx([0.1, 1.1, 10.1])
    assert own.lat_deg.tolist() == [47.0, 47.0005, 47.005]
    assert own.alt_m == pytest.approx([3000 * FOOT] * 3)
    east, north, up = own.velocity_enu_mps
    assert east == pytest.approx([0.0] * 3, abs=1e-12)
    assert north == pytest.approx([100 * KNOT] * 3)
    assert up == pytest.approx([64 * FOOT / 60] * 3)
    # On the ground, its first report has no altitude.
    assert other.sample_times_s == pytest.approx([0.0, 10.1])
    assert file.warnings[0].startswith("2 reports were left out that had no position or no height")
    assert "1 aircraft wholly" in file.warnings[0]
    assert "read as aircraft.json of readsb, ft and kt" in file.notes


def test_histories_as_people_keep_them(tmp_path):
    """In a list, over lines, and still being written."""
    flown = [one.alt_m.tolist() for one in read(tmp_path, HISTORY).aircraft]
    assert len(flown) == 2
    pretty = "\n".join(json.dumps(one, indent=1) for one in HISTORY)
    lines = "\n".join(json.dumps(one) for one in [*HISTORY, HISTORY[-1]])
    for text, said in (
        (pretty, []),
        (lines[:-40], ["the last line, 5, is cut off and was left out"]),
    ):
        file = read(tmp_path, text)
        assert [one.alt_m.tolist() for one in file.aircraft] == flown
        assert [one for one in file.warnings if "cut off" in one] == said
    with pytest.raises(TrafficFileError, match="line 2: is no JSON that can be read"):
        read(tmp_path, lines.replace('"now": 1700000001', "now"))
    first = json.dumps(HISTORY[0], indent=1)
    begins = first.count("\n") + 3
    with pytest.raises(TrafficFileError, match=f"line {begins}: is no JSON that can be read"):
        read(tmp_path, first + '\n\n{"now": ')
    with pytest.raises(TrafficFileError, match="there are no samples in it; time, latitude"):
        read(tmp_path, [snapshot(1.0)])


def test_a_track_that_opensky_tells(tmp_path):
    path = [[1700000000 + 10 * k, 47.0, 8.0 + 0.01 * k, 900 + k, 90.0, False] for k in range(3)]
    file = record(tmp_path, {"icao24": "4b1805", "callsign": "SWR1 ", "path": path})
    assert file.height == "barometric altitude" and file.callsigns == {"4b1805": "SWR1"}
    assert file.samples["4b1805"]["alt"].tolist() == [900, 901, 902]


def test_one_snapshot_and_which_altitude(tmp_path):
    one = read(tmp_path, HISTORY[-1])
    assert [craft.alt_m.tolist() for craft in one.aircraft] == [[3000 * FOOT]] * 2
    geometric = read(tmp_path, HISTORY[-1], altitude="geometric")
    assert [craft.name for craft in geometric.aircraft] == ["a1"]
    assert geometric.ownship.alt_m.tolist() == pytest.approx([3150 * FOOT])
    assert read(tmp_path, HISTORY[-1], ownship="FLb2").ownship.name == "b2"
    assert read(tmp_path, HISTORY[-1], ownship="b2").ownship.name == "b2"


def test_the_interface_of_services_counts_in_milliseconds(tmp_path):
    answer = {"ac": HISTORY[0]["aircraft"], "now": 1700000000000, "total": 3, "msg": "No error"}
    file = read(tmp_path, answer)
    assert [craft.name for craft in file.aircraft] == ["a1", "b2"]
    assert file.start_time_s == 1699999999.5
    assert file.ownship.alt_m.tolist() == pytest.approx([3000 * FOOT])


def test_a_trace_is_one_aircraft(tmp_path):
    trace = {
        "icao": "3c6444", "r": "D-TEST", "timestamp": 1700000000.0,
        "trace": [
            [0.0, 47.0, 8.0, 3000, 100.0, 0.0, 0, 64, {"flight": "TEST1   "}, "adsb_icao", 3150,
             64, 100, 0.0],
            [10.5, 47.005, 8.0, "ground", 100.0, 0.0, 0, None, None, "adsb_icao", None],
            [20.0, 47.009, 8.0, 3200, 100.0, 0.0, 8, 64, None, "adsb_icao", None],
            [30.0, 47.014, 8.0, 3100, 100.0, 0.0, 0, 64, None],
        ],
    }  # fmt: skip
    file = read(tmp_path, trace, ownship="TEST1")
    assert file.ownship.name == "3c6444" and file.intruders == []
    # The second point is on the ground, the third one's altitude is geometric.
    assert file.ownship.sample_times_s.tolist() == [0.0, 30.0]
    assert file.ownship.alt_m == pytest.approx([3000 * FOOT, 3100 * FOOT])
    geometric = read(tmp_path, trace, altitude="geometric").ownship
    assert geometric.alt_m == pytest.approx([3150 * FOOT, 3200 * FOOT])


def test_openskys_states_are_in_metres_at_the_times_of_their_positions(tmp_path):
    def state(address, lat, time_s=1699999990, barometric=1000.0, geometric=1040.0):
        return [address, f"C{address}  ", "Nowhere", time_s, 1699999999, 8.0, lat, barometric,
                False, 50.0, 180.0, -2.0, None, geometric, "7000", False, 0]  # fmt: skip

    file = read(tmp_path, {"time": 1700000000, "states": [
        state("a1", 47.0), state("b2", 47.1, 1699999995), state("c3", 47.2, None),
        state("d4", 47.3, barometric=None),
    ]})  # fmt: skip
    assert [c.name for c in file.aircraft] == ["a1", "b2", "d4"]
    assert file.start_time_s == 1699999990
    assert [c.sample_times_s.tolist() for c in file.aircraft] == [[0.0], [5.0], [0.0]]
    assert [c.alt_m.tolist() for c in file.aircraft] == [[1000.0], [1000.0], [1040.0]]
    assert np.ravel(file.ownship.velocity_enu_mps) == pytest.approx([0.0, -50.0, -2.0], abs=1e-9)
    rows = [state("a1", 47.0), [*state("b2", 47.1)[:1], None, *state("b2", 47.1)[2:]]]
    content = {"time": 1700000000, "states": rows}
    assert read(tmp_path, content, ownship="a1").ownship.name == "a1"
    assert "None" not in known_kinds.recording_of_file(tmp_path / "log").callsigns.values()


def test_flightradar24_s_json_is_in_feet_at_its_own_times(tmp_path):
    """The feed, a playback and details of flights: 0 ft, or its sign, is the ground."""
    feed = {"full_count": 2, "version": 4, "stats": {"total": {}}}
    for k, (name, ground) in enumerate((("7C6DBB", 0), ("", 1))):
        feed[f"b{k}"] = [name, -37.5, 144.6 + k, 90, 3000, 100, "1353", "F-YMEN2", "B738", "VH",
                         1474583552,
                         "MEL", "BNE", "QF1", ground, 64, f"QFA{k}", 0]  # fmt: skip
    moves = [("feet", 3000), ("feet", 0)]
    track = [
        {"latitude": -37.5, "longitude": 144.6, "altitude": {one: feet}, "speed": {"kts": 100},
         "verticalSpeed": {"fpm": 64}, "heading": 90, "timestamp": 1474583552 + k}
        for k, (one, feet) in enumerate(moves)
    ]  # fmt: skip
    flight = {"identification": {"id": "2f", "callsign": "QFA0"}, "track": track,
              "aircraft": {"identification": {"modes": "7C6DBB"}}}  # fmt: skip
    playback = {"result": {"response": {"data": {"flight": flight}}}, "_api": {}}
    trail = [{"lat": -37.5, "lng": 144.6, "alt": 3000, "spd": 100, "ts": 1474583552, "hd": 90},
             {"lat": -37.5, "lng": 144.6, "alt": 0, "spd": 0, "ts": 1.5e9, "hd": 90}]  # fmt: skip
    details = {"identification": {"id": "2f", "callsign": "QFA0"}, "trail": trail,
               "aircraft": {"hex": "7C6DBB"}}  # fmt: skip
    for content in (feed, playback, details):
        found = record(tmp_path, content)
        ((name, samples),) = found.samples.items()
        assert (name, found.callsigns[name]) == ("7C6DBB", "QFA0")
        assert found.height == "barometric altitude" and found.units == "ft and kt"
        assert [samples[key].tolist() for key in ("time", "lat", "lon", "alt")] == [
            [1474583552], [-37.5], [144.6], [3000 * FOOT],
        ]  # fmt: skip
        if content is not details:
            assert samples["ve"] == pytest.approx([100 * KNOT])
            assert samples["vu"] == pytest.approx([64 * FOOT / 60])


SBS = """\
MSG,1,1,1,A1,1,2024/06/01,23:59:58.000,2024/06/01,23:59:58.000,TEST1   ,,,,,,,,,,,
MSG,4,1,1,A1,1,2024/06/01,23:59:58.500,2024/06/01,23:59:58.500,,,100,0,,,64,,,,,
MSG,3,1,1,A1,1,2024/06/01,23:59:59.000,2024/06/01,23:59:59.000,,3000,,,47.0,8.0,,,,,,
MSG,3,1,1,B2,1,2024/06/01,23:59:59.500,2024/06/01,23:59:59.500,,3100,,,47.1,8.0,,,,,,
MSG,4,1,1,A1,1,2024/06/02,00:00:08.000,2024/06/02,00:00:08.000,,,100,0,,,0,,,,,
MSG,3,1,1,A1,1,2024/06/02,00:00:09.000,2024/06/02,00:00:09.000,,3010,,,47.00463,8.0,,,,,,
MSG,2,1,1,B2,1,2024/06/02,00:00:09.500,2024/06/02,00:00:09.500,,,5,0,47.1,8.0,,,,,,
MSG,8,1,1,B2,1,2024/06/02,00:00:10.000,2024/06/02,00:00:10.000,,,,,,,,,,,,
MSG,3,1,1,B2,1,2024/06/02,00:00:10.200,2024/06/02,00:00:10.200,,3100,,,47.1,,,,,,,
MSG,3,1,1,B2,1,2024/06/02,00:00:10.400,2024/06/02,00:00:10.400,,3100,,,,8.0,,,,,,
STA,,1,1,B2,1,2024/06/02,00:00:10.000,2024/06/02,00:00:10.000,RM
"""


def test_messages_of_basestation_are_joined(tmp_path):
    file = read(tmp_path, SBS)
    own, other = file.aircraft
    assert (own.name, other.name) == ("A1", "B2")
    assert own.sample_times_s.tolist() == [0.0, 10.0]
    assert own.alt_m == pytest.approx([3000 * FOOT, 3010 * FOOT])
    assert own.velocity_enu_mps[1] == pytest.approx([100 * KNOT] * 2)
    assert own.velocity_enu_mps[2] == pytest.approx([64 * FOOT / 60, 0.0])
    assert other.sample_times_s.tolist() == [0.5]
    assert file.warnings == ["1 report was left out that had no height"]
    assert read(tmp_path, SBS, ownship="TEST1").ownship.name == "A1"
    # Heard from within a line on, and by several receivers' times of arrival.
    late = read(tmp_path, "24/06/01,0,0,0\n" + SBS.replace("MSG,", "MLAT,"))
    assert [one.alt_m.tolist() for one in late.aircraft] == [
        one.alt_m.tolist() for one in file.aircraft
    ]
    with pytest.raises(TrafficFileError, match=r"line 3: 2024/13/01 23:59:59.000 is no date"):
        read(tmp_path, SBS.replace("2024/06/01,23:59:59.000,2024", "2024/13/01,23:59:59.000,2024"))


def test_packed_files_are_unpacked(tmp_path):
    table = "time,id,lat,lon,alt\n0,a,47,8,1000\n5,a,47.001,8,1000\n0,b,47,8.1,1000\n"
    plain = read(tmp_path, table)
    path = tmp_path / "t.csv.gz"
    path.write_bytes(gzip.compress(table.encode()))
    assert read_csv(path).ownship.lat_deg.tolist() == plain.ownship.lat_deg.tolist()
    path.write_bytes(gzip.compress(json.dumps(HISTORY[-1]).encode()))
    assert len(read_csv(path).aircraft) == 2
    whole = gzip.compress(table.encode() * 50)
    for reader in (read_csv, read_daa):
        path.write_bytes(whole[:-20])
        with pytest.raises(TrafficFileError, match="the packed file is cut off"):
            reader(path)
        path.write_bytes(whole[:12] + b"\xff\xff\xff" + whole[15:])
        with pytest.raises(TrafficFileError, match="the packed file is"):
            reader(path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"planes": []}, "is JSON of no known kind: an aircraft.json"),
        ("{", "line 1: is no JSON that can be read"),
        ('{"now": 1, "aircraft": [{}]}', "line 1: is not as its keys promise"),
        ('{"now": 1, "aircraft": []}', "there are no samples"),
        ('{"time": 1, "states": [[1]]}', "line 1: is not as its keys promise"),
    ],
)
def test_what_is_no_log_is_said(tmp_path, content, said):
    with pytest.raises(TrafficFileError, match=said):
        read(tmp_path, content)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.data())
def test_damaged_logs_give_the_one_error_or_whole_flights(tmp_path_factory, data):
    texts = [SBS, "\n".join(json.dumps(one) for one in HISTORY), json.dumps(HISTORY[0])]
    raw = bytearray(data.draw(st.sampled_from(texts)).encode())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(raw)))
        raw[at : at + data.draw(st.integers(0, 9))] = data.draw(
            st.sampled_from([b"", b",", b"\n", b"NaN", b"1e999", b"-", b"null", b'"', b"[", b"}"])
        )
    path = tmp_path_factory.mktemp("fuzz") / "f"
    path.write_bytes(bytes(raw))
    try:
        file = read_csv(path)
    except TrafficFileError as error:
        assert 1 <= len(error.problems) <= 20
        return
    for one in file.aircraft:
        assert all(np.isfinite(values).all() for values in one.at(one.sample_times_s).arrays())


def test_a_scene_flies_a_receiver_s_log(tmp_path):
    path = tmp_path / "aircraft.json"
    path.write_text("\n".join(json.dumps(one) for one in HISTORY))
    scene = tmp_path / "s.toml"
    scene.write_text(
        'extends = "detect_and_sense"\n[blocks.traffic]\ntype = "traffic.csv"\n'
        'file = "aircraft.json"\n[record]\ntruth = true\n'
    )
    run = dsa_des.run(dsa_des.load_scene(scene))
    own = [row for row in run.truth.to_pylist() if row["target"] is None]
    assert own[-1]["alt_m"] == pytest.approx(3000 * FOOT, abs=1.0)
