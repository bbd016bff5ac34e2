"""Lobes over flat ground and sea, by two rays added up as complex numbers.

Level flight 40 m above the sea; a target 5 km ahead at several heights.
"""

import cmath
import math

import numpy as np
import pytest
from covering import LINK_BUDGETS, covers
from wired import chain, run, sensor

import dsa_des
from components.terrain.reflection import (
    reflection_coefficient,
    roughness_field_factor,
    two_ray_power_factor,
)
from dsa_des.running.simulation import Simulation

LIGHT_M_S, FREQUENCY_HZ = 299_792_458.0, 3e9
WAVE_M = LIGHT_M_S / FREQUENCY_HZ
OWN_M, AWAY_M = 40.0, 5000.0
OWN = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 540.0, "heading_deg": 0, "speed_mps": 50}
UPS_M = (-35.0, -20.0, 0.0, 30.0, 61.0, 120.0)
SEA = {"height_m": 500.0, "clutter_gamma_db": -100.0, "roughness_m": 0.0,
       "relative_permittivity": 70.0, "conductivity_s_m": 5.0}  # fmt: skip


def targets():
    return [{"name": f"at {up:g}", "east_m": 0, "north_m": AWAY_M, "up_m": up, "heading_deg": 0,
             "speed_mps": 50, "rcs_dbsm": 0} for up in UPS_M]  # fmt: skip


def looks(kind="radar.threshold", terrain=None, **keys):
    radar = sensor(kind, frequency_hz=FREQUENCY_HZ, azimuth_beamwidth_deg=5.0,
                   **{"elevation_beamwidth_deg": 20.0, "range_cell_m": 30.0, **keys})  # fmt: skip
    scene = chain({"radar": radar}, ownship=OWN, targets=targets(), terrain=terrain or {})
    return {row["target"]: row for row in run(scene)["looks"].to_pylist()}


def lifted_db(kind="radar.threshold", terrain=None, **keys):
    """By how much the mirrored ray lifts each echo."""
    free, lobed = (
        looks(kind, {"height_m": 500.0, "clutter_gamma_db": -100.0}, **keys),
        looks(kind, {**SEA, **(terrain or {})}, **keys),
    )
    return {name: lobed[name]["snr_db"] - row["snr_db"] for name, row in free.items()}


def by_two_rays(up_m, terrain=SEA, polarisation="slant", beam_deg=20.0):
    """The same in dB: lengths of both ways by Pythagoras, Fresnel, Ament, a Gaussian beam."""
    # The Earth falls away under a level line: the target's height is that of its altitude.
    high = OWN_M + up_m + AWAY_M**2 / (2.0 * 6.385e6)
    straight = math.hypot(AWAY_M, up_m)
    level = math.sqrt(straight**2 - (high - OWN_M) ** 2)
    mirrored = math.hypot(level, high + OWN_M)
    grazing = math.atan2(high + OWN_M, level)
    eps = complex(terrain["relative_permittivity"], -60.0 * WAVE_M * terrain["conductivity_s_m"])
    root = cmath.sqrt(eps - math.cos(grazing) ** 2)
    sine = math.sin(grazing)
    fresnel = {
        "horizontal": (sine - root) / (sine + root),
        "vertical": (eps * sine - root) / (eps * sine + root),
    }
    gamma = fresnel.get(polarisation, sum(fresnel.values()) / 2.0)
    rough = math.exp(-2.0 * (2.0 * math.pi * terrain["roughness_m"] * sine / WAVE_M) ** 2)
    off = math.atan2(high - OWN_M, level) + grazing
    gain = math.exp(-2.0 * math.log(2.0) * (off / math.radians(beam_deg)) ** 2)
    turned = cmath.exp(-2j * math.pi * (mirrored - straight) / WAVE_M)
    return 40.0 * math.log10(abs(1.0 + gamma * rough * gain * turned))


@covers("roughness_m", of=("[terrain]",))
@pytest.mark.parametrize("polarisation", ["horizontal", "vertical", "circular"])
@pytest.mark.parametrize("roughness_m", [0.0, 0.4])
def test_two_rays_lift_and_hide_a_target(polarisation, roughness_m):
    terrain = {**SEA, "roughness_m": roughness_m}
    found = lifted_db(terrain=terrain, polarisation=polarisation)
    wanted = {f"at {up:g}": by_two_rays(up, terrain, polarisation) for up in UPS_M}
    for name, lifted in found.items():
        assert lifted == pytest.approx(wanted[name], abs=0.1)
    assert max(found.values()) > (10.0 if roughness_m == 0.0 else 5.0)


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_the_beam_and_the_range_cell_part_the_rays(kind):
    keys = {"swerling": 1} if kind == "radar.swerling" else {}
    narrow = lifted_db(kind, elevation_beamwidth_deg=2.0, **keys)
    for up in UPS_M:
        assert narrow[f"at {up:g}"] == pytest.approx(by_two_rays(up, SEA, beam_deg=2.0), abs=0.1)
    fine = lifted_db(kind, range_cell_m=1.0, **keys)
    # Ways to a target 103 m high differ by 1.6 m, to one of 72 m by 1.15 m, of 42 m by 0.67 m.
    parted = {name for name, lifted in fine.items() if lifted == 0.0}
    assert parted == {"at 30", "at 61", "at 120"}


def test_lobes_and_nulls_lie_where_the_ways_differ_by_half_waves():
    """A mirror, h1 = 25 m at 10 km: lobes at odd multiples of λ R / 4 h1, nulls at even ones."""
    step_m = WAVE_M * 10e3 / (4.0 * 25.0)
    heights = step_m * np.arange(1, 7)
    keys = {"wavelength_m": WAVE_M, "permittivity": complex(1e12), "polarisation": "horizontal"}
    found = two_ray_power_factor(10e3, 25.0, heights, **keys)
    assert found[::2] == pytest.approx(16.0, rel=2e-3)
    assert found[1::2] == pytest.approx(0.0, abs=2e-3)
    # Below the first lobe an echo falls with the fourth power of the height: R^-8 in all.
    low = two_ray_power_factor([10e3, 20e3], 25.0, 0.02 * step_m, **keys)
    assert low[0] / low[1] == pytest.approx(16.0, rel=1e-2)
    assert two_ray_power_factor(10e3, 25.0, [0.0, -3.0], **keys).tolist() == [1.0, 1.0]


def test_fresnel_brewster_and_rayleigh():
    for polarisation in ("horizontal", "vertical", "slant", "circular"):
        flat = reflection_coefficient(1e-7, 15.0 + 0j, polarisation)
        assert flat == pytest.approx(-1.0, abs=1e-5)
    brewster = math.atan(1.0 / math.sqrt(15.0))
    assert abs(reflection_coefficient(brewster, 15.0 + 0j, "vertical")) < 1e-12
    down = reflection_coefficient(math.pi / 2.0, 9.0 + 0j, "horizontal")
    assert down == pytest.approx((1.0 - 3.0) / (1.0 + 3.0))
    # Heights of λ / 8 sin ψ are rough by Rayleigh: phases a quarter of a turn apart.
    rough = roughness_field_factor(math.radians(30.0), 0.1 / 8.0 / 0.5, 0.1)
    assert rough == pytest.approx(math.exp(-((math.pi / 2.0) ** 2) / 2.0))


def test_the_reason_is_in_the_scene():
    for terrain, because in (
        ({}, "[terrain] height_m is not given"),
        ({"height_m": 0.0}, "[terrain] roughness_m is not given"),
        ({"height_m": 0.0, "roughness_m": 0.2}, "[terrain] roughness_m is 0.2"),
    ):
        radar = sensor("radar.threshold", range_cell_m=30.0, azimuth_beamwidth_deg=5.0,
                       elevation_beamwidth_deg=20.0)  # fmt: skip
        made = dsa_des.load_scene(chain({"radar": radar}, ownship=OWN, targets=[], terrain=terrain))
        (found,) = [one for one in Simulation(made).plan if one.effect.name == "multipath"]
        assert (found.built, found.because) == ("is 0.2" in because, because)
