"""Attitude of replayed flights: window edges, measured headings, and what the summary says."""

import math

import numpy as np
import pymap3d
import pytest
from recorded_files import read_csv
from wired import chain, rows, run, sensor

from components.display.terminal import derived_attitude_lines
from components.flights.attitude import attitude_from_path, fit_velocity_and_acceleration
from components.formats.daa_file import read_daa
from components.traffic.recorded import derived_attitude_report

KNOT, FOOT = 1852 / 3600, 0.3048


@pytest.mark.parametrize("start_s", [0.0, 0.3, 325374.2])
def test_no_sample_at_the_edge_of_a_window_is_lost_by_rounding(start_s):
    """Counted in tenths of a second all times are whole, and every window holds 41 samples."""
    tenths = np.arange(600)
    rng = np.random.default_rng(3)
    lat = 45 + 4e-5 * tenths + rng.normal(0, 1e-6, 600)
    lon = -75 + 3e-5 * tenths + rng.normal(0, 1e-6, 600)
    alt = 1000 + rng.normal(0, 0.3, 600).cumsum()
    time_s = np.round(start_s + tenths / 10, 1) - start_s
    velocity, acceleration = fit_velocity_and_acceleration(time_s, lat, lon, alt)
    exact, bend = fit_velocity_and_acceleration(tenths.astype(float), lat, lon, alt, window_s=40.0)
    for found, expected in zip(velocity, exact, strict=True):
        np.testing.assert_allclose(found, 10 * expected, atol=1e-6)
    for found, expected in zip(acceleration, bend, strict=True):
        np.testing.assert_allclose(found, 100 * expected, atol=1e-6)
    pitch = attitude_from_path(time_s, lat, lon, alt)[1]
    np.testing.assert_allclose(pitch, np.arctan2(exact[2], np.hypot(*exact[:2])), atol=1e-9)


def flights(heading="heading", unit="[deg]", cell=str):
    """Own flies east and points to 80°; the intruder flies north and points to 10°."""
    lines = [f"NAME lat lon alt trk gs vs {heading} time",
             f"[none] [deg] [deg] [ft] [deg] [knot] [fpm] {unit} [s]"]  # fmt: skip
    for t in range(6):
        place = pymap3d.enu2geodetic(60.0 * t, 0.0, 0.0, -41.0, 172.0, 900.0)
        where = f"{float(place[0])!r} {float(place[1])!r} {900 / FOOT!r}"
        lines.append(f"own {where} 90 {60 / KNOT!r} 0 {cell(80)} {t}")
        place = pymap3d.enu2geodetic(900.0, 50.0 * t - 1500.0, 0.0, -41.0, 172.0, 900.0)
        where = f"{float(place[0])!r} {float(place[1])!r} {950 / FOOT!r}"
        lines.append(f"it {where} 0 {50 / KNOT!r} 0 {cell(10)} {t}")
    return "\n".join(lines) + "\n"


def write(folder, text, name="f.daa"):
    path = folder / name
    path.write_text(text, "utf-8")
    return path


def test_a_heading_of_the_file_is_the_nose_in_a_scene(tmp_path):
    scene = chain({"radar": sensor("radar.range_boundary", scan_rate_hz=1)}, duration_s=4)
    scene["blocks"]["traffic"] = {
        "type": "traffic.daa_file", "file": str(write(tmp_path, flights())),
    }  # fmt: skip
    result = rows(run(scene))
    assert len(result) == 4
    for row in result:
        own = pymap3d.enu2geodetic(60.0 * row["time_s"], 0.0, 0.0, -41.0, 172.0, 900.0)
        other = pymap3d.enu2geodetic(900.0, 50.0 * row["time_s"] - 1500.0, 0, -41.0, 172.0, 900.0)
        east, north, up = pymap3d.geodetic2enu(other[0], other[1], 950.0, own[0], own[1], 900.0)
        expected = math.atan2(east, north) - math.radians(80.0)
        assert row["true_azimuth_rad"] == pytest.approx(expected, abs=1e-4)
        assert row["true_elevation_rad"] == pytest.approx(
            math.atan2(up, math.hypot(east, north)), abs=1e-3
        )


@pytest.mark.parametrize(
    ("changed", "note"),
    [
        ({"unit": "[m/s]"}, "column heading is in [m/s], no unit of angle, and is ignored"),
        ({"cell": lambda x: "n/a" if x == 10 else x}, "it: column heading has no number in 6 of"),
        ({"cell": lambda x: "nan" if x == 10 else x}, "it: column heading has no number in 6 of"),
    ],
)
def test_headings_that_cannot_be_read_are_ignored_and_said(changed, note, tmp_path):
    file = read_daa(write(tmp_path, flights(**changed)))
    assert any(note in line for line in file.notes)
    assert "yaw" in file.intruders[0].derived_attitude
    assert np.degrees(file.intruders[0].yaw_rad) == pytest.approx(0.0, abs=1e-6)
    gone = "unit" in changed
    assert ("yaw" in file.ownship.derived_attitude) == gone
    assert np.degrees(file.ownship.yaw_rad[0]) == pytest.approx(90.0 if gone else 80.0, abs=0.01)


def test_a_heading_in_radians_and_in_an_offset_file(tmp_path):
    radians = read_daa(write(tmp_path, flights(unit="[rad]", cell=lambda x: math.radians(x))))
    assert np.degrees(radians.ownship.yaw_rad) == pytest.approx(80.0)
    lines = ["NAME sx sy sz heading time", "[none] [nmi] [nmi] [ft] [deg] [s]"]
    lines += [
        f"{name} {x} 0 3000 33 {t}" for t in range(3) for name, x in (("own", 0), ("b", 60 + t))
    ]
    file = read_daa(write(tmp_path, "\n".join(lines), "o.xyz"), reference_lat_deg=60.0)
    assert np.degrees(file.ownship.yaw_rad) == pytest.approx(33.0, abs=1e-9)
    # 60 miles east at 60° N the meridians have turned by asin(sin 60° · 111 km / R cos 60°).
    origin = pymap3d.enu2geodetic(60 * 1852.0, 0, 0, 60.0, 0.0, 0.0)
    turned = math.degrees(math.radians(origin[1]) * math.sin(math.radians(60.0)))
    assert np.degrees(file.intruders[0].yaw_rad[0]) == pytest.approx(33.0 + turned, abs=0.01)


def test_the_summary_says_what_was_derived_and_how_wrong_it_is(tmp_path):
    without = derived_attitude_report(read_daa(write(tmp_path, flights(heading="spare"))))
    assert without["yaw"] == without["roll"] == ["own", "it"]
    (line,) = derived_attitude_lines({"derived_attitude": without})
    assert "own, it" in line and "4.2°" in line and "yaw, pitch, roll" in line
    measured = derived_attitude_report(read_daa(write(tmp_path, flights())))
    (line,) = derived_attitude_lines({"derived_attitude": measured})
    assert "pitch, roll" in line and "yaw" not in line and "4.2" not in line
    csv = "time,id,lat,lon,alt,heading,pitch,roll\n0,a,1,2,3,4,5,6\n0,b,1,2.1,3,4,5,6\n"
    assert derived_attitude_report(read_csv(write(tmp_path, csv, "f.csv"))) == {}
    assert derived_attitude_lines({}) == []


def test_a_run_of_recorded_flights_prints_it(tmp_path, configs, capsys):
    from dsa_des.cli import main

    with pytest.raises(SystemExit):
        main(
            ["run", str(configs / "replay_daa.toml"), "--no-figures", "--out", str(tmp_path / "o")]
        )
    assert "Attitude derived from the flight path" in " ".join(capsys.readouterr().out.split())
