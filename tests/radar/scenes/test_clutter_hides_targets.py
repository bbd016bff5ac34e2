"""Ground clutter and a threshold from few cells make every radar see less far.

A banked ownship follows a low target that it gains on, so the line of sight turns little.
"""

import math

import crooked
import numpy as np
import pytest
from covering import RADARS, covers
from scipy.optimize import brentq
from scipy.stats import binom
from wired import chain, decided, run, sensor

import dsa_des
from dsa_des.errors import SceneError
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

CELL = {
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 6.0, "range_resolution_m": 40.0,
}  # fmt: skip
OWN = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
#: It comes nearer from 9 km off at 150 m/s, well below.
LOW = {
    **crooked.DIVING, "east_m": 9000.0 * math.sin(0.7), "north_m": 9000.0 * math.cos(0.7),
    "up_m": -900.0, "heading_deg": math.degrees(0.7) + 180.0, "speed_mps": 150.0, "climb_mps": 0.0,
    "rcs_dbsm": 0.0, "name": "low",
}  # fmt: skip
KEYS = {
    "radar.threshold": {"power_w": 2.0, "threshold_db": 12.0},
    "radar.swerling": {"power_w": 2.0, "swerling": 1},
    "radar.range_boundary": {"range_km": 8.0},
}


def scene(kind: str, gamma_db: float | None, **keys) -> dict:
    radar = sensor(kind, **{**CELL, **KEYS[kind], "scan_rate_hz": 5, **keys})
    terrain = {} if gamma_db is None else {"height_m": 1350.0, "clutter_gamma_db": gamma_db}
    return chain(
        {"radar": radar}, ownship=OWN, targets=[LOW], duration_s=55,
        **({"terrain": terrain} if terrain else {}),
    )  # fmt: skip


def seen(kind: str, gamma_db: float | None, **keys) -> int:
    return len(decided(run(scene(kind, gamma_db, **keys))))


@covers("clutter_threshold", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
def test_clutter_takes_detections_from_every_radar_and_a_threshold_at_the_noise_adds_them(kind):
    clear = seen(kind, None)
    rising = [seen(kind, gamma_db) for gamma_db in (-45.0, -30.0, -20.0)]
    assert clear >= rising[0] > rising[1] > rising[2]
    staying = seen(kind, -20.0, clutter_threshold="noise")
    if kind == "radar.range_boundary":
        assert staying == clear
    else:
        assert staying > clear
    for mode in ("noise", "adaptive"):
        loaded = dsa_des.load_scene(scene(kind, -20.0, clutter_threshold=mode))
        said = [line for line in notes_of_scene(Simulation(loaded)) if "counts as signal" in line]
        assert len(said) == (mode == "noise")


@covers("cfar_reference_cells", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
@pytest.mark.parametrize("gamma_db", [None, -25.0])
def test_an_average_of_few_cells_costs_range(kind, gamma_db):
    count = [seen(kind, gamma_db, cfar_reference_cells=cells) for cells in (6, 20, 1000)]
    assert count[0] < count[1] <= count[2] <= seen(kind, gamma_db)


def power_over_clutter(row: dict, gamma_db: float) -> float:
    """Echo over the ground's: a still, banked ownship 1050 m above it, beams of 2 by 6 deg."""
    line = crooked.attitude(OWN).T @ crooked.direction(
        row["true_azimuth_rad"], row["true_elevation_rad"]
    )
    range_m, height_m = row["true_range_m"], OWN["alt_m"] - 1350.0
    grazing = math.asin(height_m / range_m)
    off = (math.asin(-line[2]) + grazing) / math.radians(6.0)
    patch = range_m * math.radians(2.0) * min(
        40.0 / math.cos(grazing), range_m * math.radians(6.0) / math.sin(grazing)
    )  # fmt: skip
    ground = 10.0 ** (0.1 * gamma_db) * math.sin(grazing) * patch
    return 1.0 / (ground * math.exp(-8.0 * math.log(2.0) * off**2))


@pytest.mark.parametrize("cells", [None, 12])
def test_pd_in_clutter_is_that_over_noise_and_clutter(cells):
    """Gandhi and Kassam's closed form where the threshold is an average."""
    keys = {} if cells is None else {"cfar_reference_cells": cells}
    pfa = 1e-3
    found = decided(
        run(scene("radar.swerling", -30.0, false_alarm_probability=pfa, power_w=10.0, **keys))
    )
    assert len(found) > 30
    needed = {None: math.log(pfa) / math.log(0.9) - 1.0}
    for row in found:
        snr = 10.0 ** (0.1 * row["snr_db"])
        cnr = snr / power_over_clutter(row, -30.0)
        ratio = snr / (1.0 + cnr)
        if cells is None:
            expected = pfa ** (1.0 / (1.0 + ratio))
        else:
            a = pfa ** (-1.0 / cells) - 1.0
            expected = (1.0 + a / (1.0 + ratio)) ** -cells
            needed[cells] = a / (0.9 ** (-1.0 / cells) - 1.0) - 1.0
        assert row["detection_probability"] == pytest.approx(expected, rel=2e-3)
        margin_db = 10.0 * math.log10(snr / needed[cells])
        assert row["confidence"] == pytest.approx(margin_db, abs=1e-6)


def test_so_many_looks_detect_as_is_said():
    """A still target in clutter, 20,000 looks, threshold from an average."""
    table = scene("radar.swerling", -32.0, false_alarm_probability=1e-2, power_w=8.0,
                  cfar_reference_cells=10, scan_rate_hz=1000)  # fmt: skip
    target = {**LOW, "speed_mps": 0.0, "east_m": 0.3 * LOW["east_m"], "north_m": 1900.0}
    table["blocks"]["traffic"]["intruders"], table["duration_s"] = [target], 20
    found = decided(run(table))
    pd = found[0]["detection_probability"]
    assert 0.1 < pd < 0.9
    low, high = binom.interval(0.99, 20_000, pd)
    assert low <= len(found) <= high


def test_a_threshold_radar_needs_the_loss_of_its_cells_more():
    """That of Pd 0.9 and Swerling I, or of what it is calibrated for."""
    pfa, cells = 1e-6, 10
    a = pfa ** (-1.0 / cells) - 1.0
    for pd, keys in (
        (0.9, {}),
        (0.6, {"calibrate": {"rcs_dbsm": 0.0, "range_km": 3.0, "pd": 0.6}, "bandwidth_hz": None}),
    ):
        loss = (a / (pd ** (-1.0 / cells) - 1.0) - 1.0) / (math.log(pfa) / math.log(pd) - 1.0)
        for number in (None, cells):
            table = scene("radar.threshold", None, cfar_reference_cells=number, **keys)
            radar = table["blocks"]["radar"]
            table["blocks"]["radar"] = {k: v for k, v in radar.items() if v is not None}
            (row,) = [row for row in decided(run(table)) if row["scan"] == 270]
            margin_db = 12.0 if number is None else 12.0 + 10.0 * math.log10(loss)
            assert row["snr_db"] - row["confidence"] == pytest.approx(margin_db, abs=1e-9)


@covers("boundary_rcs_dbsm", "boundary_pd", "false_alarm_probability", of=("radar.range_boundary",))
@pytest.mark.parametrize(
    ("rcs_dbsm", "pd", "pfa", "cells"),
    [(0.0, 0.9, 1e-6, None), (6.0, 0.9, 1e-6, None), (0.0, 0.5, 1e-6, None),
     (0.0, 0.9, 1e-2, None), (3.0, 0.8, 1e-4, 8)],
)  # fmt: skip
def test_the_boundary_lies_where_its_target_stands_out_of_noise_and_clutter(
    rcs_dbsm, pd, pfa, cells
):
    """At 8 km noise is the target's echo over the SNR that Pd needs."""
    keys = {} if cells is None else {"cfar_reference_cells": cells}
    found = decided(
        run(
            scene(
                "radar.range_boundary", -36.0, boundary_rcs_dbsm=rcs_dbsm, boundary_pd=pd,
                false_alarm_probability=pfa, **keys,
            )
        )
    )  # fmt: skip
    needed = math.log(pfa) / math.log(pd) - 1.0
    loss = 1.0
    if cells is not None:
        a = pfa ** (-1.0 / cells) - 1.0
        loss = (a / (pd ** (-1.0 / cells) - 1.0) - 1.0) / needed
    everywhere = decided(run(scene("radar.range_boundary", None)))
    count = 0
    for row in everywhere:
        over = power_over_clutter(row, -36.0) * 10.0 ** (0.1 * rcs_dbsm)
        noise = (row["true_range_m"] / 8000.0) ** 4 + needed / over
        margin_db = -10.0 * math.log10(noise * loss)
        if abs(margin_db) > 0.01:
            count += margin_db > 0.0
            assert (row["scan"] in {other["scan"] for other in found}) is (margin_db > 0.0)
    assert 0 < count < len(everywhere)


def test_a_crude_radar_without_cells_hears_no_ground():
    found = run(scene("radar.range_boundary", -10.0, range_resolution_m=0.0))
    assert len(decided(found)) == seen("radar.range_boundary", None)


BAD = [
    ("radar.swerling", {"cfar_reference_cells": 3}, "cfar_reference_cells.*greater than"),
    ("radar.threshold", {"cfar_reference_cells": 8, "clutter_threshold": "noise"}, "leave one"),
    ("radar.swerling", {"cfar_reference_cells": 8, "detection": "table"}, "'table': Pd with CFAR"),
    ("radar.range_boundary", {"clutter_threshold": "cfar"}, "adaptive"),
]


@pytest.mark.parametrize(("kind", "keys", "message"), BAD)
def test_bad_thresholds_are_one_error_each(kind, keys, message):
    with pytest.raises(SceneError, match=message) as caught:
        run(scene(kind, -20.0, **keys))
    assert len(caught.value.problems) == 1


def test_an_average_is_not_known_for_clutter_that_stands_still():
    table = scene("radar.swerling", -20.0, cfar_reference_cells=8)
    table["terrain"]["clutter_mean"] = "constant"
    with pytest.raises(
        SceneError, match="cfar_reference_cells is 8 and \\[terrain\\] clutter_mean"
    ):
        run(table)


def test_marcum_s_q_far_out_is_the_integral_of_its_density():
    from scipy.integrate import quad
    from scipy.special import ive

    from components.radar.detection.clutter import marcum_q1

    for signal, threshold in ((300.0, 250.0), (250.0, 280.0), (900.0, 950.0)):
        a, b = math.sqrt(2.0 * signal), math.sqrt(2.0 * threshold)

        def density(x, a=a):
            return x * math.exp(-0.5 * (x - a) ** 2) * ive(0, a * x)

        expected, _ = quad(density, b, max(a, b) + 12.0, points=[max(a, b)])
        found = marcum_q1(np.array([signal]), np.array([threshold]), math.inf)[0]
        assert found == pytest.approx(expected, abs=1e-4)
    assert brentq(
        lambda t: marcum_q1(np.array([400.0]), np.array([t]), math.inf)[0] - 0.5, 300.0, 500.0
    ) == pytest.approx(400.5, abs=1.0)
