"""Targets in one cell of a radar's grid are one report, and noise reports a cell, not its targets.

The cells are those of the radar's own axes: here it is mounted askew on a banked ownship.
"""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, RADARS, covers
from scipy.stats import binom
from wired import alone, chain, decided, noise_crosses, run, sensor

import dsa_des
from dsa_des.errors import SceneError
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

CELL = {
    "azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 3.0, "range_resolution_m": 120.0,
    "mount_azimuth_deg": 20.0, "mount_roll_deg": 12.0,
}  # fmt: skip
#: Flies through the cells of its neighbour, and on.
FAINT = {**crooked.DIVING, "name": "faint", "rcs_dbsm": 0.0, "east_m": -180.0, "heading_deg": 50.0}
TARGETS = (crooked.ROLLING, {**crooked.DIVING, "rcs_dbsm": 3.0}, FAINT)


def by_scan(kind: str, merged: bool) -> dict[int, dict[str, dict]]:
    found: dict[int, dict[str, dict]] = {}
    run_ = alone(
        kind, targets=TARGETS, duration_s=4, scan_rate_hz=5, resolution_cells=merged, **CELL
    )
    for row in decided(run_):
        found.setdefault(row["scan"], {})[row["target"]] = row
    return found


@covers("resolution_cells", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
def test_two_targets_in_one_cell_are_one_report_of_the_stronger(kind):
    apart, merged = by_scan(kind, False), by_scan(kind, True)
    together = 0
    for scan, each in apart.items():
        place = {
            name: (row["azimuth_rad"], row["elevation_rad"], row["range_m"])
            for name, row in each.items()
        }
        if place["diving"] != place["faint"]:
            assert set(merged[scan]) == set(each)
            assert merged[scan]["faint"]["snr_db"] == each["faint"]["snr_db"]
            continue
        together += 1
        assert len(merged[scan]) == len(each) - 1
        if kind == "radar.range_boundary":
            nearer = min(("diving", "faint"), key=lambda name: each[name]["true_range_m"])
            assert nearer in merged[scan]
            continue
        row = merged[scan]["diving"]
        assert row["range_m"] == each["diving"]["range_m"]
        power = sum(10.0 ** (0.1 * each[name]["snr_db"]) for name in ("diving", "faint"))
        assert row["snr_db"] == pytest.approx(10.0 * math.log10(power), abs=1e-9)
    assert 2 < together < len(apart) - 2


@pytest.mark.parametrize("merged", [False, True])
def test_noise_reports_a_cell_with_the_false_alarm_probability_however_many_are_in_it(merged):
    """Far below the noise, on the grid point of the cell."""
    pfa, scans = 0.02, 1500
    swarm = [{**crooked.ROLLING, "name": f"fly {i}", "rcs_dbsm": -150.0} for i in range(10)]
    still = [{**fly, "speed_mps": 0.0, "climb_mps": 0.0} for fly in swarm]
    own = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
    radar = sensor(
        "radar.swerling", power_w=1.0, swerling=1, false_alarm_probability=pfa, reference_pd=0.5,
        scan_rate_hz=100, resolution_cells=merged, **CELL,
    )  # fmt: skip
    del radar["mount_roll_deg"], radar["mount_azimuth_deg"]
    found = decided(
        run(chain({"radar": radar}, ownship=own, targets=still, duration_s=scans / 100))
    )
    looks = scans * (1 if merged else len(swarm))
    low, high = binom.interval(0.99, looks, pfa)
    assert low <= len(found) <= high
    for row in found:
        assert row["azimuth_rad"] != row["true_azimuth_rad"]
        step = math.radians(3.0)
        for angle in (row["azimuth_rad"] / step, row["elevation_rad"] / step):
            assert angle == pytest.approx(np.rint(angle), abs=1e-6)
        assert row["range_m"] % 120.0 == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("kind", RADARS)
@pytest.mark.parametrize("name", ["azimuth_resolution_deg", "range_resolution_m"])
def test_a_cell_without_a_size_is_refused(kind, name):
    with pytest.raises(SceneError, match=f"{name} is 0 and resolution_cells is true"):
        alone(kind, resolution_cells=True, **{**CELL, name: 0.0})


VIEW = {
    "azimuth_deg": [-40, 60], "elevation_deg": [-30, 10], "range_km": 3.0, "minimum_range_m": 1.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 100.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "said"),
    [({}, True), (CELL, False), ({"range_resolution_m": 10.0}, True),
     ({"errors": "stated", "azimuth_error_deg": 1.0}, False)],
)  # fmt: skip
def test_explain_says_where_noise_is_reported_exactly_at_the_target(keys, said):
    radar = sensor("radar.swerling", **keys)
    simulation = Simulation(dsa_des.load_scene(chain({"radar": radar})))
    lines = simulation.components["radar"].skipped_work_notes()
    assert any("reported exactly where the target is" in line for line in lines) is said


def warned(kind: str = "radar.threshold", **keys) -> list[str]:
    radar = {**sensor(kind), **VIEW, **keys}
    found = notes_of_scene(Simulation(dsa_des.load_scene(chain({"radar": radar}))))
    # A beam that contradicts the gain speaks of false alarms too.
    return [line for line in found if "false" in line and "which is a beam of" not in line]


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_what_a_probability_per_look_comes_to_by_scan_is_said(kind):
    """50 by 10 by 30 cells, and the rate of the threshold that there is."""
    said = " ".join(warned(kind, **noise_crosses(kind, 0.05)))
    key = "false_alarm_probability is 0.05:"
    if kind == "radar.threshold":
        key = f"threshold_db is {10.0 * math.log10(-math.log(0.05) - 1.0):g}:"
    assert key in said
    assert "15,000 resolution cells" in said and "750 false alarms per scan" in said
    assert not warned(kind, **noise_crosses(kind, 1e-6))
    assert len(warned(kind, false_alarm_probability=0.05)) == 1
    assert not warned(kind, false_alarms=True, enabled=False)


def test_a_threshold_that_noise_never_crosses_is_said():
    """21 dB: exp(-1 - 125.9) in each of 15,000 cells, 1e-51 by scan, whatever the Pfa says."""
    (said,) = warned(false_alarms=True, threshold_db=21.0, false_alarm_probability=1e-3)
    pfa = math.exp(-1.0 - 10.0**2.1)
    assert "threshold_db is 21:" in said and f"{15_000 * pfa:,.3g} false alarms per scan" in said
    assert "practically none" in said
    (said,) = warned("radar.swerling", false_alarms=True, false_alarm_probability=1e-12)
    assert "1.5e-08 false alarms per scan, practically none" in said


def test_the_thesis_s_probability_is_said_to_be_its():
    default = sensor("radar.swerling", false_alarm_probability=None)
    scene = chain({"radar": {**default, **VIEW, "false_alarms": True}})
    said = " ".join(notes_of_scene(Simulation(dsa_des.load_scene(scene))))
    assert "(the thesis's, as the scene gives none): with 15,000 resolution cells" in said


BEAM = {
    "azimuth_beamwidth_deg": 5.0, "elevation_beamwidth_deg": 4.0, "range_resolution_m": 90.0,
    "scan_rate_hz": 5,
}  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "merges"),
    [({}, False), ({"resolution_cells": True}, True), ({"errors": "signal"}, True),
     ({"errors": "signal", "resolution_cells": False}, False),
     ({"errors": "stated", "azimuth_error_deg": 0.1}, True),
     ({"errors": "stated", "azimuth_error_deg": 0.1, "range_resolution_m": 0.0}, False)],
)  # fmt: skip
def test_beams_are_the_cells_where_they_are_given(keys, merges):
    """Where errors are not the grid's, targets of one cell that has a size are one by default."""
    found: dict[int, dict[str, dict]] = {}
    radar = sensor("radar.threshold", **{**BEAM, **keys})
    for row in decided(run(chain({"radar": radar}, targets=TARGETS, duration_s=4))):
        found.setdefault(row["scan"], {})[row["target"]] = row
    apart = {
        (row["scan"], row["target"]): row
        for row in decided(run(chain({"radar": sensor("radar.threshold", **BEAM)}, targets=TARGETS,
                                  duration_s=4)))
    }  # fmt: skip
    together = 0
    for scan, each in found.items():
        cell = {}
        for name in ("diving", "faint"):
            row = apart[scan, name]
            cell[name] = (
                round(math.degrees(row["true_azimuth_rad"]) / 5.0),
                round(math.degrees(row["true_elevation_rad"]) / 4.0),
                round(row["true_range_m"] / 90.0),
            )
        one = cell["diving"] == cell["faint"]
        together += one
        assert ("faint" in each) is not (one and merges)
        assert "diving" in each and "rolling" in each
    assert 2 < together < len(found) - 2


def test_noise_fills_the_beams_of_the_field_of_view():
    """20 by 10 by 30 cells of 5 by 4 deg and 100 m, however fine the grid."""
    view = {**VIEW, "azimuth_beamwidth_deg": 5.0, "elevation_beamwidth_deg": 4.0,
            "azimuth_resolution_deg": 0.1, **noise_crosses("radar.threshold", 1e-3)}  # fmt: skip
    found = decided(alone("radar.threshold", **view, scan_rate_hz=50, duration_s=4), target=None)
    low, high = binom.interval(0.99, 20 * 10 * 30 * 200, 1e-3)
    assert low <= len(found) <= high


@pytest.mark.parametrize("kind", RADARS)
def test_astern_the_last_cell_is_the_first_one(kind):
    """One to the left of the tail and one to its right, both within half a cell of it."""
    own = {**crooked.OWNSHIP, "yaw_deg": 217.0, "pitch_deg": 0.0, "roll_deg": 0.0}
    still = {"up_m": 0.0, "heading_deg": 217.0, "speed_mps": 70.0, "climb_mps": 3.0}
    behind = []
    for off in (-1.0, 1.0, 2.5):
        bearing = math.radians(37.0 + off)
        place = {"east_m": 2100.0 * math.sin(bearing), "north_m": 2100.0 * math.cos(bearing)}
        behind.append({"name": f"at {off}", **place, **still})
    cell = {name: step for name, step in CELL.items() if not name.startswith("mount")}
    scene = chain(
        {"radar": sensor(kind, **cell, resolution_cells=True)}, ownship=own, targets=behind
    )
    reported = {row["target"] for row in decided(run(scene))}
    assert len(reported) == 2 and "at 2.5" in reported
