"""A sweeping beam reports targets where they are when it lights them."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from components.radar.beam import first_lit_time_and_mask
from dsa_des.errors import BlockFailure
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """
duration_s = 30
seed = 1
wires = ["traffic -> transform -> gate -> radar"]

[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = 52, lon_deg = 4, alt_m = 1000, heading_deg = 350, speed_mps = 60, \
legs = [{{ kind = "turn", rate_deg_s = 3 }}] }}
intruders = [
  {{ name = "crosses", east_m = -1500, north_m = 1500, up_m = 100, heading_deg = 90, \
speed_mps = 250 }},
  {{ name = "turns", east_m = 2000, north_m = 500, up_m = -200, heading_deg = 270, \
speed_mps = 120, legs = [{{ kind = "turn", rate_deg_s = -6 }}] }},
  {{ name = "behind", east_m = 0, north_m = -3000, up_m = 0, speed_mps = 200 }},
]

[blocks.transform]
type = "geometry.ellipsoid"

[blocks.gate]
type = "gate"

[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 1
range_km = 4
azimuth_deg = {azimuth}
beam_sweep = true
mount_azimuth_deg = {mount}

"""


def simulate(tmp_path: Path, azimuth: str = "[-110, 110]", mount: float = 0.0, **options: Any):
    path = tmp_path / "sweep.toml"
    path.write_text(SCENE.format(azimuth=azimuth, mount=mount))
    sink = MemorySink()
    simulation = Simulation(load_scene(path), recorder=Recorder([sink]), **options)
    simulation.run()
    return simulation, sink.tables()


def body_azimuths(simulation: Simulation, target: int, times: np.ndarray) -> tuple:
    """Azimuth and range by the exact flights, at any times."""
    traffic = simulation.components["traffic"]
    transform = simulation.components["transform"]
    flights = (traffic.own, traffic.targets[target])
    seen = transform._columns_at_other_instants(
        *(flight.at(times[:, np.newaxis]) for flight in flights)
    )
    return seen["body_azimuth_rad"][:, 0], seen["range_m"][:, 0]


@pytest.mark.parametrize(("azimuth", "mount"), [("[-110, 110]", 0.0), ("[-180, 180]", 25.0)])
def test_against_a_brute_force_search_over_the_flights(
    tmp_path: Path, azimuth: str, mount: float
) -> None:
    simulation, tables = simulate(tmp_path, azimuth, mount)
    rows = tables["detections"].to_pylist()
    names = simulation.components["traffic"].roster.names
    low = math.radians(-110 if "110" in azimuth else -180)
    width = -2 * low
    lit = {(row["scan"], row["target"]): row for row in rows}
    fine = np.linspace(0, 1, 20_001)
    expected = 0
    for scan in range(30):
        for target, name in enumerate(names):
            p, range_m = body_azimuths(simulation, target, scan + fine)
            p = p - math.radians(mount)
            # The beam meets the target where the angle between them goes through 0.
            gap = np.angle(np.exp(1j * (p - low - width * fine)))
            meets = np.flatnonzero((gap[:-1] >= 0) & (gap[1:] < 0) & (np.abs(gap[:-1]) < 0.1))
            if len(meets) == 0 or range_m[meets[0]] > 4000:
                assert (scan, name) not in lit
                continue
            expected += 1
            i = meets[0]
            at = fine[i] + (fine[1] - fine[0]) * gap[i] / (gap[i] - gap[i + 1])
            row = lit[scan, name]
            assert row["illuminated_s"] - scan == pytest.approx(at, abs=1e-7)
            p_lit, range_lit = body_azimuths(simulation, target, np.array([row["illuminated_s"]]))
            assert row["range_m"] == pytest.approx(range_lit[0], abs=1e-6)
            assert row["azimuth_rad"] == pytest.approx(p_lit[0], abs=1e-9)
            # The beam points there, to its own rounding.
            beam = low + width * (row["illuminated_s"] - scan) + math.radians(mount)
            assert math.remainder(row["azimuth_rad"] - beam, 2 * math.pi) == pytest.approx(
                0, abs=2e-9
            )
    assert expected == len(lit) > 25


def test_who_comes_in_behind_the_beam_waits_for_the_next_scan() -> None:
    """A sweep of 2 rad in 1 s from 0: by hand."""
    start = np.array([-0.1, 0.5, 0.5, 2.1, 1.9, 2.0, 0.0, 4.0])
    rate = np.array([0.5, 0.0, 0.5, -0.5, 0.5, 0.0, -1.0, 0.0])
    offset, lit = first_lit_time_and_mask(
        lambda t: start + rate * t, start, start_rad=0.0, width_rad=2.0, scan_period_s=1.0
    )
    assert lit.tolist() == [False, True, True, True, False, True, True, False]
    np.testing.assert_allclose(offset[[1, 2, 3, 5, 6]], [0.25, 1 / 3, 0.84, 1.0, 0.0], atol=1e-9)


def test_a_passing_target_that_outruns_the_beam_for_a_while_is_still_found() -> None:
    """A close pass: 0.4 rad before, 1.6 rad after, most of it within 20 ms."""

    def azimuth_at(offset: np.ndarray) -> np.ndarray:
        return 1.0 + 0.6 * np.tanh((offset - 0.55) / 0.01)

    offset, lit = first_lit_time_and_mask(
        azimuth_at, azimuth_at(np.zeros(1)), start_rad=0.0, width_rad=2.0, scan_period_s=1.0
    )
    assert lit.all()
    assert azimuth_at(offset) == pytest.approx(2.0 * offset, abs=1e-8)


def test_targets_that_cannot_be_revisited_are_refused(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("components.traffic.source.KnownFlights", lambda *_: None)
    with pytest.raises(BlockFailure, match="beam_sweep needs to know the targets at instants"):
        simulate(tmp_path)
