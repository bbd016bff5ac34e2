"""Bands, recovery and resolutions against recorded output of the reference logic."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

from components.alert_configuration.conf_file import read_conf
from components.formats.daa_file import read_daa_samples
from components.geometry import east_north_m, east_north_mps
from components.guidance.bands import GuidedIntruder, guidance, nearest_values_outside_red
from components.guidance.situation import State
from docs.make.published.degas_bands import equal_cells
from tests.alerting.reference_data import reference_file

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
    got = nearest_values_outside_red(found.bands, found.own_value, region, kind == "hdir")
    if got is None:
        assert wanted["resolution_low"] == wanted["resolution_up"] == ""
        return
    ways = np.array([got.low, got.high]) / UNITS[kind]
    want = [float(wanted["resolution_low"]), float(wanted["resolution_up"])]
    assert ways == pytest.approx(want, abs=1e-8)
    assert str(got.prefers_high).lower() == wanted["preferred_up"]


def test_every_cell_of_an_older_release_is_equal():
    """Recorded by release 2.0.1 every second of a flight: 271 directions and 6 altitudes.

    Positions are those of the second, velocities those of the step of 0.1 s before: so that
    simulation's logic sees them. A value on an edge has the region of either side.
    """
    folder = reference_file("published/degas/degas_noncoop_daidalus201.conf").parent
    assert equal_cells(folder, 1) == (49_051, 49_051, 1_086, 1_086)
    # With the velocity of the instant itself a turning ownship's edges are elsewhere.
    directions, _, altitudes, _ = equal_cells(folder, 0)
    assert 49_000 < directions < 49_051 and altitudes == 1_086
