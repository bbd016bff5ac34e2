"""Gas attenuation stays off by default above 10 GHz, and what it would take is said."""

import re

import pytest
from wired import HEARS_ALL, chain

from components.atmosphere.attenuation import gas_specific_attenuation
from dsa_des.library.scenes import load_scene
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation


def said(weather, **keys):
    scene = load_scene(chain({"radar": {**HEARS_ALL, **keys}}, weather=weather))
    return " ".join(Simulation(scene).components["radar"].skipped_work_notes())


@pytest.mark.parametrize(
    ("keys", "range_km"), [({}, 10.0), ({"range_km": 25.0}, 25.0), ({"frequency_hz": 94e9}, 10)]
)
def test_what_clear_air_would_take_is_said(keys, range_km):
    text = said({"vapour_density_g_m3": 12.0}, **keys)
    db, at = re.search(r"would take (\S+) dB from an echo at (\S+) km", text).groups()
    frequency_hz = keys.get("frequency_hz", 35e9)
    per_km = float(gas_specific_attenuation(frequency_hz, vapour_density_g_m3=12.0))
    assert float(at) == range_km
    assert float(db) == pytest.approx(2 * range_km * per_km, rel=0.06)


def test_check_and_run_say_it_too():
    scene = load_scene(chain({"radar": HEARS_ALL}))
    (line,) = (line for line in notes_of_scene(Simulation(scene)) if "gas attenuation" in line)
    assert line.startswith("blocks.radar: gas attenuation: at 35 GHz clear air")


def test_where_it_is_simulated_or_does_not_matter_nothing_is_said():
    assert "gas attenuation" not in said({"gas": True})
    assert "gas attenuation" not in said({}, frequency_hz=9.5e9)
