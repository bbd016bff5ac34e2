"""Bands, recovery and resolutions against recorded output of the reference logic."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

from components.alert_configuration.conf_file import read_conf
from components.formats.daa_file import read_daa_samples
from components.geometry import east_north_m, east_north_mps
from components.guidance.bands import GuidedIntruder, guidance, guidance_of_many, resolution
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from tests.alerting.reference_data import reference_file, reference_text

UNITS = {"hdir": math.pi / 180, "hs": 1852 / 3600, "vs": 0.3048 / 60, "alt": 0.3048}
AT_ONCE = dict.fromkeys(
    ("turn_rate", "bank_angle", "horizontal_accel", "vertical_accel", "vertical_rate"), 0.0
)


def states(samples, row):
    (own, other) = samples.values()
    lat, lon = np.radians(own["lat"][row]), np.radians(own["lon"][row])
    there = np.radians(other["lat"][row]), np.radians(other["lon"][row])
    v_own = east_north_mps(lat, lon, own["ve"][row], own["vn"][row], lat, lon)
    v_other = east_north_mps(*there, other["ve"][row], other["vn"][row], lat, lon)
    east, north = east_north_m(*there, lat, lon)
    zero = np.float64(0.0)
    return (
        State(zero, zero, own["alt"][row], *v_own, own["vu"][row]),
        State(east, north, other["alt"][row], *v_other, other["vu"][row]),
    )


def table(name):
    with reference_file(f"alerting/{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("manner", ["", "_instantaneous"])
@pytest.mark.parametrize("kind", UNITS)
def test_bands_recovery_and_resolutions(kind, manner):
    configuration = read_conf(reference_file("alerting/do365b.conf"))
    if manner:
        values = {**configuration.values, **AT_ONCE}
        configuration = replace(configuration, values=values)
    samples = read_daa_samples(reference_file("nrc_intercepts/NRC_Intercept3.daa"))
    times = next(iter(samples.values()))["time"]
    bands = table(f"NRC_Intercept3{manner}_bands")
    checked = 0
    for wanted in table(f"NRC_Intercept3{manner}_info"):
        if wanted["kind"] != kind:
            continue
        row = int(np.argmin(np.abs(times - float(wanted["time_s"]))))
        own, other = states(samples, row)
        found = guidance(
            kind, configuration, own, [GuidedIntruder(other, configuration.alerters[0])]
        )
        lines = [b for b in bands if (b["time_s"], b["kind"]) == (wanted["time_s"], kind)]
        assert [b.region for b in found.bands] == [b["region"] for b in lines]
        for band, line in zip(found.bands, lines, strict=True):
            edges = np.array([band.low, band.high]) / UNITS[kind]
            assert edges == pytest.approx([float(line["low"]), float(line["up"])], abs=1e-8)
        compare_recovery(found.recovery, wanted)
        compare_resolution(found, configuration, kind, wanted)
        checked += 1
    assert checked == 60


def compare_recovery(recovery, wanted):
    assert int(wanted["recovery_nfactor"]) == (-1 if recovery is None else recovery.shrinks)
    if recovery is not None:
        assert recovery.time_s == float(wanted["recovery_time_s"])


def compare_resolution(found, configuration, kind, wanted):
    region = configuration["corrective_region"]
    got = resolution(found.bands, found.own_value, region, kind == "hdir")
    if got is None:
        assert wanted["resolution_low"] == wanted["resolution_up"] == ""
        return
    ways = np.array([got.low, got.high]) / UNITS[kind]
    want = [float(wanted["resolution_low"]), float(wanted["resolution_up"])]
    assert ways == pytest.approx(want, abs=1e-8)
    assert str(got.prefers_high).lower() == wanted["preferred_up"]


def test_every_cell_of_an_older_release_is_equal(tmp_path):
    """Recorded by release 2.0.1 every second of a flight: 271 directions and 6 altitudes.

    Positions are those of the second, velocities those of the step of 0.1 s before: so that
    simulation's logic sees them. A value on an edge has the region of either side.
    """
    text = reference_file("published/degas/degas_noncoop_daidalus201.conf").read_text("utf-8")
    path = tmp_path / "older.conf"
    path.write_text(f"{text}\ndaidalus_version = 2.0.1\n", encoding="utf-8")
    configuration = read_conf(path)
    recorded = np.loadtxt(
        reference_text("published/degas/daaGuidance_int_perf.csv.gz").splitlines(), delimiter=","
    )
    lines = reference_text("published/degas/trajectory_int_perf.csv.gz").splitlines()
    flown = dict(zip(lines[0].split(","), np.loadtxt(lines[1:], delimiter=",").T, strict=True))
    now = np.rint(10.0 * recorded[:, 0]).astype(int)
    before = np.maximum(now - 1, 0)

    def states(who):
        east, north, up = (0.3048 * flown[f"{who}_{axis}_ft"][now] for axis in
                           ("east", "north", "up"))  # fmt: skip
        speed, track = 0.3048 * flown[f"{who}_speed_ftps"][before], flown[f"{who}_psi_rad"][before]
        return State(east, north, up, speed * np.sin(track), speed * np.cos(track), 0.0 * up)

    own, other = states("own"), states("int")
    other = other._replace(east_m=other.east_m - own.east_m, north_m=other.north_m - own.north_m)
    own = own._replace(east_m=0.0 * own.east_m, north_m=0.0 * own.north_m)
    others = [GuidedIntruders(other, configuration.alerters[0], np.zeros(len(now), dtype=int))]
    turned, climbed = (
        guidance_of_many(kind, configuration, own, others) for kind in ("hdir", "alt")
    )
    code = {"NONE": 0, "RECOVERY": 1, "MID": 3, "NEAR": 4}
    cells = 0
    for line, found, level in zip(recorded, turned, climbed, strict=True):
        turns = (found.own_value + np.radians(np.arange(-135, 136))) % (2 * math.pi)
        heights = 0.3048 * line[272::2]
        for bands, values, wanted in (
            (found.bands, turns, line[1:272]), (level.bands, heights, line[273::2])
        ):  # fmt: skip
            for value, want in zip(values, wanted, strict=True):
                got = {code[b.region] for b in bands if b.low - 1e-9 <= value <= b.high + 1e-9}
                assert want in got, (line[0], value)
                cells += 1
    assert cells == 49_051 + 1_086
