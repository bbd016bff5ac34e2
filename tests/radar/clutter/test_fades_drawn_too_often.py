"""`check` says where each scan draws a fade of its own, sooner than the last one can be over."""

import math

import pytest
from wired import HEARS_ALL, chain

import dsa_des
from dsa_des.running.simulation import Simulation

#: The wavelength at which an aircraft of 10 m, whose aspect turns 0.2°/s, fades for 0.1 s.
WAVELENGTH_M = 0.1 * math.radians(0.2) * 2 * 10.0
FADES = {
    **{key: value for key, value in HEARS_ALL.items() if key != "frequency_hz"},
    "type": "radar.swerling", "wavelength_m": WAVELENGTH_M, "swerling": 1,
}  # fmt: skip
FADES.pop("threshold_db")


def said(**keys):
    scene = dsa_des.load_scene(chain({"radar": {**FADES, **keys}}))
    warnings = Simulation(scene).components["radar"].warnings()
    return [one for one in warnings if "draws a fade of its own" in one]


def test_scans_faster_than_fades_are_told():
    (warning,) = said(scan_rate_hz=11)
    assert "scan_rate_hz is 11" in warning and "some 0.1 s" in warning
    assert "fluctuation_correlation_s" in warning and "scintillation_extent_m" in warning


@pytest.mark.parametrize(
    "keys",
    [
        {"scan_rate_hz": 9}, {"swerling": 0}, {"swerling": 2, "pulses": 10}, {"enabled": False},
        {"fluctuation_correlation_s": 0.5}, {"scintillation_extent_m": 5.0},
        {"wavelength_m": WAVELENGTH_M / 2},
    ],
)  # fmt: skip
def test_others_are_not(keys):
    assert said(**{"scan_rate_hz": 11, **keys}) == []
