"""``dsa-des check FILE``, ``run FILE``, ``alert FILE`` and ``encounters convert FILE``."""

import json

import pyarrow.parquet as pq
import pytest
import recorded_files as write
from click.testing import CliRunner, Result

from dsa_des.block.entry_points import entry_points_of
from dsa_des.cli import main
from dsa_des.scene.data_files import GROUP

START = 1_717_243_200.0
pytestmark = pytest.mark.skipif(
    not entry_points_of(GROUP), reason="there is no entry point: install the project again"
)
NORTHBOUND = [(START + k, 47.0 + 4e-4 * k, 8.0, 1000.0) for k in range(60)]
SOUTHBOUND = [(START + k, 47.04 - 4e-4 * k, 8.001, 1010.0) for k in range(60)]


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def snapshots(path):
    """Half a minute of a receiver's log: 47 m/s towards each other."""

    def craft(address, lat, lon, track):
        return {"hex": address, "flight": f"F{address}", "lat": lat, "lon": lon, "alt_baro": 3300,
                "gs": 86.5, "track": track, "baro_rate": 0, "seen_pos": 0.0}  # fmt: skip

    lines = [
        {"now": START + k, "messages": 1, "aircraft": [
            craft("a1b2c3", 47 + 4e-4 * k, 8.0, 0.0), craft("d4e5f6", 47.04 - 4e-4 * k, 8.001, 180),
        ]}
        for k in range(30)
    ]  # fmt: skip
    path.write_text("\n".join(json.dumps(line) for line in lines))
    return path


def test_check_says_what_a_file_is_and_what_to_type(tmp_path):
    path = snapshots(tmp_path / "my aircraft.json")
    result = call("check", path)
    assert result.exit_code == 0, result.stderr
    said = " ".join(result.stdout.split())
    for part in (
        "my aircraft.json: aircraft.json of readsb; ft and kt",
        "2 in 60 samples: a1b2c3, d4e5f6",
        "2024-06-01 12:00:00 UTC to 2024-06-01 12:00:29 UTC, 29 s",
        "latitudes 47 to 47.04, longitudes 8 to 8.001 deg",
        "barometric altitude, 1005.8 to 1005.8 m", "a1b2c3, the first",
        f"dsa-des run '{path}'", f"dsa-des alert '{path}' --conf alerting/do365b.conf",
        f'type = "traffic.file" file = "{path}"', "ok. 8 blocks, 9 wires, 29 s",
    ):  # fmt: skip
        assert part in said


def test_a_file_is_run_before_the_sensors_of_detect_and_sense(tmp_path):
    path = snapshots(tmp_path / "aircraft.json")
    set_ = "blocks.traffic.ownship=Fd4e5f6"
    result = call("run", path, "--set", set_, "--no-figures", "--json", "--out", tmp_path / "run")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert list(summary["targets"]) == ["a1b2c3"]


def test_alerts_of_a_receiver_s_log(tmp_path):
    path = snapshots(tmp_path / "aircraft.json")
    alerts = tmp_path / "alerts.csv"
    options = ("--conf", "alerting/do365b.conf", "--out", alerts)
    result = call("alert", path, *options, "--ownship", "d4e5f6")
    assert result.exit_code == 0, result.stderr
    assert "a1b2c3" in result.stdout and "read as aircraft.json of readsb" in result.stdout
    levels = {line.split(",")[4].strip() for line in alerts.read_text().splitlines()[2:]}
    assert "3" in levels
    own = tmp_path / "mine.gpx"
    own.write_bytes(write.gpx({"me": NORTHBOUND[5:20]}))
    result = call("alert", path, *options, "--own-file", own)
    assert result.exit_code == 0, result.stderr
    times = [line.split(",")[0] for line in alerts.read_text().splitlines()[2:]]
    assert {line.split(",")[1].strip() for line in alerts.read_text().splitlines()[2:]} == {"me"}
    assert float(times[0]) == START + 5 and float(times[-1]) == START + 19


def test_tracks_of_any_kind_become_encounters(tmp_path):
    """Two flights of one file, then two files of one flight each."""
    both, one, two = (tmp_path / name for name in ("both.gpx", "one.igc", "two.kml"))
    both.write_bytes(write.gpx({"a": NORTHBOUND, "b": SOUTHBOUND}))
    one.write_bytes(write.igc(NORTHBOUND))
    two.write_bytes(write.kml({"b": SOUTHBOUND}))
    out = tmp_path / "set.parquet"
    result = call("encounters", "convert", both, one, two, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert pq.read_table(out).num_rows == 4
    result = call("encounters", "show", out)
    assert "2 encounters of tracks, 4 flights" in result.stdout
    nearest = next(line for line in result.stdout.splitlines() if "horizontal, m" in line)
    # 0.001 degrees of longitude at 47 degrees north.
    assert [float(word) for word in nearest.split()[2:]] == pytest.approx([76.0] * 4, abs=1.5)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(30), "is a picture; what is read: aircraft.json"),
        ("a.bin", b"\xa3\x95\x80" + bytes(range(256)), "is a DataFlash log of ArduPilot"),
        ("a.txt", b"dear diary,\nmy secret\n", "is of no known kind. As a table it must have"),
        ("a.csv", b"time,lat,lon\n1,2,3\n", "there is no column 'alt' among time, lat, lon"),
        ("a.xml", b"<?xml version='1.0'?><svg/>", "is XML, but neither GPX nor KML"),
        ("a.json", b'{"planes": []}', "is JSON of no known kind"),
    ],
)
def test_a_file_of_no_known_kind_is_told_what_is_read(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_bytes(content)
    for command in (("check", path), ("run", path), ("alert", path, "--conf",
                    "alerting/do365b.conf", "--out", tmp_path / "o.csv")):  # fmt: skip
        result = call(*command)
        assert result.exit_code == 2 and said in result.stderr
        assert "diary" not in result.stderr and "Traceback" not in result.stderr


def test_a_scene_by_another_name_is_a_scene_still(tmp_path):
    path = tmp_path / "scene.txt"
    path.write_text('extends = "first_light"\nduration_s = 5\n')
    assert "ok. 8 blocks" in call("check", path).stdout
    path.write_text('extends = "first_light"\nduration_s = -5\n')
    assert "duration_s" in call("check", path).stderr
