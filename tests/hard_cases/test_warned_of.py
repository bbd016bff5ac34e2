"""What can be run and can hardly be meant is said before it is run."""

import json

import pytest
from click.testing import CliRunner

from dsa_des.cli import main

RADAR = """
duration_s = 2
wires = ["traffic -> transform -> radar"]
[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 0, lon_deg = 0, alt_m = 1000, speed_mps = 50 }
intruders = [{ name = "a", east_m = 10, north_m = 3000, up_m = 0, speed_mps = 50 }]
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.swerling"
scan_rate_hz = 5
power_w = 1000
antenna_gain_db = 30
wavelength_m = 0.03
bandwidth_hz = 1e6
false_alarm_probability = 1e-6
fluctuation_correlation_s = 1      # without it 5 Hz is warned of
"""


def run(*words):
    return CliRunner().invoke(main, list(map(str, words)))


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(RADAR)
    return path


def test_a_plausible_radar_is_not_warned_of(scene):
    done = run("check", scene)
    assert done.exit_code == 0
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("assignment", "text"),
    [
        ("wavelength_m=12", None),
        ("wavelength_m=12000", "wavelength_m is 12000 m: implausible"),
        ("power_w=1e12", "power_w is 1e+12 W: implausible"),
        ("antenna_gain_db=300", "antenna_gain_db is 300 dB: implausible"),
        ("losses_db=-3", "losses_db is -3 dB: implausible"),
        ("bandwidth_hz=0.1", "bandwidth_hz is 0.1 Hz: implausible"),
        (
            "false_alarm_probability=0.05",
            "looks at a target detect at an SNR of 5.2 dB",
        ),
    ],
)
def test_what_no_radar_has_is_named(scene, assignment, text):
    done = run("check", scene, "--set", f"blocks.radar.{assignment}")
    assert done.exit_code == 0, done.stderr
    if text is None:
        assert done.stderr == ""
    else:
        assert f"note: blocks.radar: {text}" in done.stderr or text in done.stderr


def test_a_carrier_in_gigahertz_is_named_and_not_the_range(scene):
    scene.write_text(RADAR.replace("wavelength_m = 0.03", "frequency_hz = 24"))
    done = run("check", scene)
    assert "frequency_hz is 24 Hz: implausible" in done.stderr
    assert "is it 24 GHz, 2.4e+10 Hz?" in done.stderr
    known = "calibrate = { rcs_dbsm = 0, range_km = 7, pd = 0.5 }"
    scene.write_text(scene.read_text().replace("bandwidth_hz = 1e6", known))
    done = run("check", scene)
    assert done.exit_code == 2
    assert "blocks.radar: frequency_hz is 24 Hz: implausible" in done.stderr


def test_notes_go_to_standard_error_and_run_json(scene, tmp_path):
    scene.write_text(RADAR.replace("false_alarm_probability = 1e-6\n", ""))
    done = run("run", scene, "--json", "--no-figures", "--out", "a")
    assert json.loads(done.stdout)
    assert done.stderr == f"1 note: dsa-des check {scene}\n"
    assert run("run", scene, "--quiet", "--no-figures", "--out", "b").output == ""
    for folder in "ab":
        (text,) = json.loads((tmp_path / folder / "run.json").read_text())["notes"]
        assert text.startswith("blocks.radar: false_alarm_probability is 0.05")


def flights(rows, header="time,id,lat,lon,alt"):
    return "\n".join([header, *(",".join(map(str, row)) for row in rows)])


def level(name, alt=1000, step=0.0005, lat=52.0, count=21, dt=1):
    """A flight eastward, by default at some 34 m/s."""
    return [(t * dt, name, lat, 4 + t * step, alt) for t in range(count)]


@pytest.mark.parametrize(
    ("other", "duration", "text"),
    [
        (level("b", 1200, lat=52.01), None, None),
        (level("b", 35_000, lat=52.01), None, "b: it flies at 35,000 m; are altitudes in feet"),
        (level("b", 1200, 0.05, 52.01), None, "m/s; are positions in degrees read as radians"),
        # 0.02 degrees a second of a parallel of 3,935 km: 1,374 m/s.
        (level("b", 1200, 0.02, 52.01), None, "b: its positions imply 1,374 m/s"),
        (
            [(t, "b", 52.01, 4 + t * 0.0005 + (0.002 if t == 9 else 0), 1000) for t in range(21)],
            None,
            "m/s²; are times rounded",
        ),
        (
            [(t, "b", 52.01, 4 + t * 0.0005, 1000 + 300 * t) for t in range(21)],
            None,
            "climbs or sinks at 300 m/s; are altitudes in feet",
        ),
        (
            [(t, "b", 0.9 + 1e-6 * t, 0.07 + 4e-6 * t, 1000) for t in range(21)],
            None,
            "are latitude and longitude in radians",
        ),
        (level("b", count=8), None, "1 of 1 intruders are there for only a part of the run's 20 s"),
        (level("b", 1200, lat=52.01), 3600, "own is there for 20 s of the run's 3600 s; is time"),
    ],
)
def test_suspicious_flights_name_the_likely_error(scene, tmp_path, other, duration, text):
    (tmp_path / "flights.csv").write_text(flights([*level("own"), *other]))
    head, _, tail = RADAR.partition('type = "traffic.scripted"')
    tail = tail.partition("[blocks.transform]")[2]
    head = head.replace(
        "duration_s = 2\n", "" if duration is None else f"duration_s = {duration}\n"
    )
    traffic = 'type = "traffic.csv"\nfile = "flights.csv"\nownship = "own"\n[blocks.transform]'
    scene.write_text(head + traffic + tail)
    done = run("check", scene)
    assert done.exit_code == 0, done.stderr
    if text is None:
        assert done.stderr == ""
    else:
        assert done.stderr.count("note:") == 1
        assert text in done.stderr
        assert "flights.csv" in done.stderr
