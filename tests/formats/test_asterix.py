"""ASTERIX to and fro: each quantity within its least bit, and the same tracks out of it."""

import math
import struct
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pymap3d
import pytest
from asterix_flights import read_asterix
from click.testing import CliRunner
from covering import covers
from scipy.spatial.transform import Rotation

import dsa_des
from components.display.recorded_run import RecordedTables
from components.export.asterix_export import asterix_bytes
from components.export.command import export
from components.formats.asterix_file import read_asterix_plots
from components.formats.asterix_records import (
    ADS_B,
    PLOTS,
    SYSTEM_TRACKS,
    decode_records_with_notes,
)
from components.formats.text_rows import TrafficFileError
from components.messages.state_tracks import COVARIANCE
from dsa_des.errors import UsageError

asterix = pytest.importorskip("asterix", reason="needs the extra asterix")

NMI_M, FOOT_M = 1852.0, 0.3048
RANGE_M, TURN, TIME_S = NMI_M / 256 / 2, math.pi / 65536, 1 / 256
HEIGHT_M, LEVEL_M = 6.25 * FOOT_M / 2, 25 * FOOT_M / 2
MARK_DEG, TRACK_DEG = 180 / 2**23 / 2, 180 / 2**25 / 2
POSES = ("lat_deg", "lon_deg", "alt_m", "heading_rad", "pitch_rad", "roll_rad")


def plots_of(count=40, start_s=86390.0, lat_deg=-16.9):
    """Banked looks at 217° across the antimeridian, below the ellipsoid, over midnight."""
    random = np.random.default_rng(7)
    pose = {
        "own_lat_deg": lat_deg + 0.02 * random.random(count),
        "own_lon_deg": (179.995 + 0.01 * random.random(count) + 180) % 360 - 180,
        "own_alt_m": random.uniform(-90.0, 900.0, count),
        "own_heading_rad": np.full(count, math.radians(217.0)),
        "own_pitch_rad": random.uniform(-0.2, 0.2, count),
        "own_roll_rad": random.uniform(-0.7, 0.7, count),
    }
    time_s = start_s + 0.73 * np.arange(count)
    scans = {"block": ["nose"] * count, "time_s": time_s, **pose}
    detections = {
        **scans,
        "azimuth_rad": random.uniform(-1.0, 1.0, count),
        "elevation_rad": random.uniform(-0.3, 0.3, count),
        "range_m": random.uniform(300.0, 40_000.0, count),
        "illuminated_s": np.full(count, np.nan),
        "range_rate_m_s": np.where(np.arange(count) % 5, random.uniform(-600, 500, count), np.nan),
    }
    detections["range_m"][3:4] = np.nan  # no plot, but a scan
    return RecordedTables(
        Path("run"), {"scans": pa.table(scans), "detections": pa.table(detections)}
    )


def ends_of(run, rows):
    """Bearing, slant range and end of each line of sight, by SciPy and pymap3d."""
    d = {name: run.tables["detections"][name].to_numpy()[rows] for name in
         ("azimuth_rad", "elevation_rad", "range_m", *(f"own_{n}" for n in POSES))}  # fmt: skip
    level = np.cos(d["elevation_rad"])
    body = np.stack([level * np.cos(d["azimuth_rad"]), level * np.sin(d["azimuth_rad"]),
                     -np.sin(d["elevation_rad"])], axis=1)  # fmt: skip
    turn = Rotation.from_euler("ZYX", np.stack([d[f"own_{n}"] for n in POSES[3:]], axis=1))
    ned = turn.apply(body * d["range_m"][:, np.newaxis])
    place = pymap3d.ned2geodetic(*ned.T, *(d[f"own_{n}"] for n in POSES[:3]))
    return np.arctan2(ned[:, 1], ned[:, 0]), d["range_m"], place


def test_plots_come_back_within_the_least_bits(tmp_path):
    run, path = plots_of(), tmp_path / "run.ast"
    path.write_bytes(asterix_bytes(run))
    found = read_asterix_plots(path)
    rows = np.delete(np.arange(40), 3)
    bearing, far_m, (_, _, alt) = ends_of(run, rows)
    scans = run.tables["scans"]
    assert found.radars == ["0/1"] and found.scan.tolist() == rows.tolist()
    time_s = scans["time_s"].to_numpy()
    assert found.start_time_s == pytest.approx(time_s[0], abs=TIME_S)
    assert found.start_time_s + found.scan_s == pytest.approx(time_s, abs=TIME_S * 1.01)
    assert found.scan_s[found.scan].tolist() == found.time_s.tolist()
    assert found.range_m == pytest.approx(far_m, abs=RANGE_M * 1.001)
    rate = run.tables["detections"]["range_rate_m_s"].to_numpy()[rows]
    fits = np.abs(rate) <= 511  # what does not fit is not there
    assert np.isnan(rate).sum() > 3 and (rate < -511).sum() > 0
    assert np.isnan(found.range_rate_m_s[~fits]).all()
    assert found.range_rate_m_s[fits] == pytest.approx(rate[fits], abs=0.5)
    apart = (found.azimuth_rad - bearing + math.pi) % (2 * math.pi) - math.pi
    assert np.abs(apart).max() <= TURN * 1.001
    assert found.own_lat_deg == pytest.approx(scans["own_lat_deg"].to_numpy(), abs=MARK_DEG * 1.01)
    lon = found.own_lon_deg - scans["own_lon_deg"].to_numpy()
    assert np.abs((lon + 180) % 360 - 180).max() <= MARK_DEG * 1.01
    assert found.own_alt_m == pytest.approx(scans["own_alt_m"].to_numpy(), abs=0.501)
    # Where the elevation leads to, from where the radar says that it is: the height's least bit.
    own = (getattr(found, f"own_{name}")[found.scan] for name in POSES[:3])
    _, _, height = pymap3d.aer2geodetic(
        np.degrees(found.azimuth_rad), np.degrees(found.elevation_rad), found.range_m, *own
    )
    assert height == pytest.approx(alt, abs=LEVEL_M + 0.05)


def test_the_bytes_are_those_of_the_specification(tmp_path):
    """A plot taken apart by hand: EUROCONTROL-SPEC-0149, part 4."""
    run = plots_of(1)
    bearing, far_m, (_, _, alt) = ends_of(run, [0])
    data = asterix_bytes(run)
    assert data[0] == 34 and data[3:5] == bytes([0b11100001, 0b00010000])
    size = int.from_bytes(data[1:3], "big")
    # North marker, time of day, then past the second octet of the FSPEC the place.
    sac, sic, kind, *time_of_day = data[5:11]
    assert (sac, sic, kind) == (0, 1, 1)
    assert int.from_bytes(time_of_day, "big") == 86390 * 128
    assert struct.unpack(">h", data[11:13])[0] == round(run.tables["scans"]["own_alt_m"][0].as_py())
    plot = data[size:]
    assert plot[0] == 48 and plot[3:6] == bytes([0b11110001, 0b00000001, 0b00001000])
    at = 6 + 5
    assert plot[at] == 0b00110000  # single primary detection, simulated
    rho, theta, height = struct.unpack(">HHH", plot[at + 1 : at + 7])
    assert rho == round(far_m[0] / NMI_M * 256)
    assert theta == round(math.degrees(bearing[0]) % 360 / 360 * 65536)
    assert height == round(alt[0] / FOOT_M / 25) % 2**14


#: Covariances of the first track, across the axes none; the second one says none.
SPREADS = dict.fromkeys(COVARIANCE.values(), 0.0) | {
    "covariance_00_m2": 20.25, "covariance_11_m2": 6250000.0, "covariance_22_m2": 1e9,
    "covariance_33_m2_s2": 1.1, "covariance_44_m2_s2": 1e6, "covariance_55_m2_s2": 0.04,
}  # fmt: skip


def tracked_run(start_s=86395.0):
    """Two tracks and the ownship over midnight, one of them below the ellipsoid."""
    count, random = 30, np.random.default_rng(3)
    time_s = start_s + 0.5 * np.arange(count)
    velocity = np.array([[-61.3, 40.2, 3.1], [12.7, -95.0, -4.4], [50.0, 10.0, 0.0]])
    starts = np.array([[800.0, 1500.0, 40.0], [-4000.0, 300.0, -900.0], [0.0, 0.0, -300.0]])
    ned = starts + velocity * (time_s - start_s)[:, np.newaxis, np.newaxis]
    origin = (-16.9, 179.999, 200.0)
    tracks = {
        "block": ["tracker"] * (2 * count), "state_s": np.repeat(time_s, 2),
        "time_s": np.repeat(time_s, 2), "track": np.tile([1, 7], count),
        "track_status": ["confirmed", "tentative"] * (count - 1) + ["deleted", "coasted"],
        **{f"{axis}_m": ned[:, :2, k].ravel() for k, axis in enumerate(("north", "east", "down"))},
        **{f"{axis}_m_s": np.tile(velocity[:2, k], count)
           for k, axis in enumerate(("north", "east", "down"))},
        **{name: np.tile([spread, np.nan], count) for name, spread in SPREADS.items()},
        **dict(zip(("origin_lat_deg", "origin_lon_deg", "origin_alt_m"),
                   (np.full(2 * count, v) for v in origin), strict=True)),
    }  # fmt: skip
    lat, lon, alt = pymap3d.ned2geodetic(*ned[:, 2].T, *origin)
    truth = {
        "target": pa.nulls(count, pa.string()), "time_s": time_s, "lat_deg": lat, "lon_deg": lon,
        "alt_m": alt, "velocity_north_m_s": np.full(count, 50.0),
        "velocity_east_m_s": np.full(count, 10.0), "velocity_down_m_s": np.zeros(count),
        "heading_rad": random.random(count), "pitch_rad": np.zeros(count),
        "roll_rad": np.zeros(count),
    }  # fmt: skip
    run = RecordedTables(Path("r"), {"state_tracks": pa.table(tracks), "truth": pa.table(truth)})
    return run, time_s, [pymap3d.ned2geodetic(*ned[:, k].T, *origin) for k in (2, 0, 1)]


def test_tracks_come_back_as_traffic(tmp_path):
    run, time_s, flights = tracked_run()
    path = tmp_path / "run.ast"
    path.write_bytes(asterix_bytes(run))
    found = read_asterix(path)
    assert [craft.name for craft in found.aircraft] == ["OWNSHIP", "0/1/1", "0/1/7"]
    assert found.start_time_s == 86395.0
    for craft, (lat, lon, alt) in zip(found.aircraft, flights, strict=True):
        assert craft.sample_times_s == pytest.approx(time_s - time_s[0], abs=1e-9)
        state = craft.at(craft.sample_times_s)
        assert state.lat_deg == pytest.approx(lat, abs=TRACK_DEG * 1.01)
        apart = (state.lon_deg - lon + 180) % 360 - 180
        assert np.abs(apart).max() <= TRACK_DEG * 1.01
        assert state.alt_m == pytest.approx(alt, abs=HEIGHT_M * 1.01)
        assert not craft.velocity_was_ignored
    with pytest.raises(TrafficFileError, match="there is no aircraft 'me': it must be one of"):
        read_asterix(path, "me")
    assert read_asterix(path, "0/1/7").ownship.name == "0/1/7"


def test_velocities_and_statuses_keep_their_least_bits(tmp_path):
    run, _, _ = tracked_run()
    records, notes = decode_records_with_notes(tmp_path, asterix_bytes(run))
    tracks = [r.values for r in records if r.category == SYSTEM_TRACKS]
    assert not notes and len(tracks) == 60
    assert [(t["velocity_north_m_s"], t["velocity_east_m_s"]) for t in tracks[:2]] == [
        (-61.25, 40.25),
        (12.75, -95.0),
    ]
    for track, up in zip(tracks[:2], (-3.1, 4.4), strict=True):
        assert track["velocity_up_m_s"] == pytest.approx(up, abs=6.25 * FOOT_M / 120 + 0.03)
    assert [t["tentative"] for t in tracks[:2]] == [0, 1]
    assert [(t["last"], t["coasted"]) for t in tracks[-2:]] == [(1, 0), (0, 1)]
    assert all(t["simulated"] for t in tracks)
    said = [tracks[0][f"{name}_error_m"] for name in ("north", "east", "alt")]
    # The track's vertical leans by 800 m of the Earth's radius: 31.6 km of error up are 4 north.
    assert math.hypot(4.5, math.sqrt(1e9) * 800 / 6.37e6) == pytest.approx(6.0, abs=0.05)
    assert said == [6.0, 2500.0, 255 * 6.25 * FOOT_M]  # the largest stands for all that are larger
    moves = [tracks[0][f"velocity_{name}_error_m_s"] for name in ("north", "east", "up")]
    climb = math.hypot(0.2, 1e3 * 1500 / 6.37e6)  # 1,500 m east of the origin
    assert moves == [1.0, 63.75, pytest.approx(climb, abs=6.25 * FOOT_M / 120)]
    assert "north_error_m" not in tracks[1]


def test_what_aircraft_say_of_themselves_is_ads_b_and_no_plot(tmp_path):
    """Each position once, however often it is looked at; a reply without one stays a plot."""
    run, nan = plots_of(4), np.nan
    says = {
        "address": [0x4CA7B3, 0x4CA7B3, 0x4CA7B3, -1], "target": ["Cargo-7"] * 4,
        "reported_lat_deg": [-16.91234567, -16.91234567, -16.913, nan],
        "reported_lon_deg": [-179.9998, -179.9998, 179.9999, nan],
        "reported_alt_m": [-60.96, -60.96, -53.34, nan],
        "reported_s": [86399.9, 86399.9, 86400.9, nan],
        "reported_north_m_s": [-30.0, -30.0, nan, nan], "reported_east_m_s": [40.0, 40.0, nan, nan],
        "reported_climb_m_s": [-2.5, -2.5, nan, nan],
    }  # fmt: skip
    table = run.tables["detections"]
    table = table.set_column(table.column_names.index("range_m"), "range_m", pa.array([9e3] * 4))
    for name, values in says.items():
        table = table.append_column(name, pa.array(values))
    path = tmp_path / "run.ast"
    path.write_bytes(asterix_bytes(RecordedTables(run.folder, {**run.tables, "detections": table})))
    records, _ = decode_records_with_notes(path, path.read_bytes())
    first, second = (r for r in records if r.category == ADS_B)
    assert [r.category for r in records].count(PLOTS) == 1
    assert first.time_s == pytest.approx(86399.9, abs=TIME_S) and second.time_s > 86400.0
    values = first.values
    assert (values["number"], values["name"]) == (0x4CA7B3, "CARGO7")
    assert values["lat_deg"] == pytest.approx(-16.91234567, abs=180 / 2**31 * 1.01)
    assert second.values["lon_deg"] == pytest.approx(179.9999, abs=180 / 2**31 * 1.01)
    assert values["flight_level_m"] == pytest.approx(-60.96, abs=LEVEL_M / 50)
    assert values["speed_m_s"] == pytest.approx(50.0, abs=NMI_M / 2**15)
    south_east = 180.0 - math.degrees(math.atan2(40, 30))
    assert values["track_deg"] == pytest.approx(south_east, abs=180 / 2**16 * 1.01)
    assert values["barometric_climb_m_s"] == pytest.approx(-2.5, abs=6.25 * FOOT_M / 120)
    assert "speed_m_s" not in second.values


RADAR_ONLY = """
duration_s = 20
wires = ["traffic -> transform -> gate -> radar -> fusion -> tracker"]
blocks.remove = ["eo", "ir"]
[blocks.radar]
scan_rate_hz = 4  # a whole number of least bits of time
[blocks.fusion]
type = "fusion.pass_through"
[blocks.tracker]
type = "tracking.ekf"
"""


@covers("model", of=("sensor.recorded",))
def test_first_light_exported_read_back_and_tracked_gives_the_same_tracks(tmp_path, configs):
    scene, again = tmp_path / "scene.toml", tmp_path / "again.toml"
    scene.write_text(f'extends = "{configs / "first_light.toml"}"\n{RADAR_ONLY}')
    first = dsa_des.run(dsa_des.load_scene(scene), out=tmp_path / "run")
    assert CliRunner().invoke(export, [str(first.path), "--to", "asterix"]).exit_code == 0
    stated = first.detections.to_pylist()[0]
    angle = math.degrees(math.sqrt(stated["azimuth_variance_rad2"]))
    again.write_text(
        'extends = "scene.toml"\nwires = ["radar -> fusion -> tracker"]\n'
        'blocks.remove = ["traffic", "transform", "gate"]\n[blocks.radar]\n'
        'type = "sensor.recorded"\nfile = "run.ast"\nblock = "0/1"\nmodel = "scene.toml"\n'
        f"azimuth_error_deg = {angle}\nelevation_error_deg = {angle}\n"
        f"range_error_m = {math.sqrt(stated['range_variance_m2'])}\n"
    )
    one, two = first.state_tracks, dsa_des.run(dsa_des.load_scene(again)).state_tracks
    for name in ("time_s", "track", "track_status", "updated_by"):
        assert one[name].to_pylist() == two[name].to_pylist()
    apart = {
        name: np.nanmax(np.abs(one[name].to_numpy() - two[name].to_numpy()))
        for name in ("north_m", "east_m", "down_m")
    }
    # Range, the radar's place, its azimuth at 13 km; the height of the target and of the radar.
    place_m = 180 / 2**23 / 2 * 111_200
    assert max(apart["north_m"], apart["east_m"]) <= RANGE_M + place_m + 13_000 * TURN
    assert apart["down_m"] <= LEVEL_M + 0.5
    assert min(apart.values()) > 0.1  # they are those of the file
    assert one.num_rows > 150 and set(one["track"].to_pylist()) >= {1, 2}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "the file is empty: data blocks of ASTERIX are needed"),
        (b"NAME, lat, lon\n", "the data block at byte 0"),
        (b"\x30\x00\x02", "the data block at byte 0: says that it has less than 3 bytes"),
        (b"\x30\x00", "less than 3 bytes"),
        (b"\x01\x00\x04\x00\x30\x00\x10\x80", "at byte 4: has 16 bytes, but the file ends at byte"),
        (b"\x30\x00\x05\xff\x00", "none of category 048, edition 1."),
        (b"\x01\x00\x04\x00", "no system tracks \\(062\\) and no ADS-B reports \\(021\\)"),
    ],
)
def test_what_is_no_asterix_is_said(tmp_path, data, said):
    path = tmp_path / "bad.ast"
    path.write_bytes(data)
    with pytest.raises(TrafficFileError, match=said):
        read_asterix(path)
    with pytest.raises(TrafficFileError, match=r"bad\.ast"):
        read_asterix_plots(path)


def test_any_cut_and_any_flipped_byte_is_read_or_said(tmp_path):
    data = asterix_bytes(tracked_run()[0])[:400]
    random = np.random.default_rng(1)
    path = tmp_path / "bad.ast"
    for cut in random.integers(1, len(data), 60).tolist():
        flipped = bytearray(data)
        flipped[cut] ^= 1 << int(random.integers(8))
        for content in (data[:cut], bytes(flipped)):
            path.write_bytes(content)
            try:
                read_asterix(path)
            except TrafficFileError as error:
                assert str(path) in str(error)


def test_the_missing_extra_is_named(tmp_path, monkeypatch):
    run, path = plots_of(2), tmp_path / "a.ast"
    path.write_bytes(asterix_bytes(run))
    monkeypatch.setitem(sys.modules, "asterix.generated", None)
    said = r"ASTERIX needs an extra: pip install 'dsa-des\[asterix\]'"
    with pytest.raises(UsageError, match=said):
        asterix_bytes(run)
    with pytest.raises(UsageError, match=said):
        read_asterix(path)


def test_what_does_not_fit_is_said(tmp_path):
    run = plots_of(3)
    table = run.tables["detections"]
    far = table.set_column(table.column_names.index("range_m"), "range_m",
                           pa.array([1e3, 475e3, 2e3]))  # fmt: skip
    far = RecordedTables(run.folder, {**run.tables, "detections": far})
    with pytest.raises(UsageError, match=r"category 048, time 86390.7 s: range_m = 475000 does"):
        asterix_bytes(far)
    with pytest.raises(UsageError, match="holds nothing that ASTERIX has a record for"):
        asterix_bytes(RecordedTables(Path("r"), {}))


@covers("file", "ownship", "update_rate_hz", of=("traffic.asterix",))
def test_a_scene_flies_an_asterix_file(tmp_path):
    run, _, flights = tracked_run()
    (tmp_path / "run.ast").write_bytes(asterix_bytes(run))
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'extends = "detect_and_sense.toml"\n[blocks.traffic]\ntype = "traffic.asterix"\n'
        'file = "run.ast"\n'
    )
    found = dsa_des.run(dsa_des.load_scene(scene))
    assert set(found.truth["target"].to_pylist()) == {None, "0/1/1", "0/1/7"}
    assert found.info["duration_s"] == 14.5
    assert found.truth["heading_rad"].to_numpy()[0] == pytest.approx(math.atan2(10, 50), abs=0.01)
    text = scene.read_text() + 'ownship = "0/1/7"\nupdate_rate_hz = 1\n'
    scene.write_text(text)
    found = dsa_des.run(dsa_des.load_scene(scene, duration_s=4))
    assert set(found.truth["target"].to_pylist()) == {None, "OWNSHIP", "0/1/1"}
    own = [row for row in found.truth.to_pylist() if row["target"] is None]
    assert {row["time_s"] % 1 for row in own} == {0.0}
    assert [row["lat_deg"] for row in own] == pytest.approx(flights[2][0][:8:2], abs=1e-5)
