"""Tables of docs/sensors.md hold what their makers compute."""

from pathlib import Path

from docs.make.sensors.blind_zones import zones
from docs.make.sensors.lasers import wire_within_a_second, wires

PAGE = Path(__file__).parents[3] / "docs/sensors.md"


def test_the_table_of_wires_is_the_maker_s():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    rows = wires()
    assert len(rows) == 2
    for row in rows:
        assert row in lines


def test_the_first_laser_s_wire_is_seen_and_the_second_s_is_not():
    assert wire_within_a_second(10.0, 600.0) > 0.995 > 1e2 * wire_within_a_second(5.0, 750.0)


def test_blind_zones_are_the_closed_form_s():
    """One PRF: the notch's share of rates, 5 of them within 300 m/s, and of ranges 5 pulses.

    Of 3 of 8 PRFs the notch at rate 0 and the first pulse are left.
    """
    blind = {title: zone.mean() for title, zone in zones(800).items()}
    pulse_m = 0.5 * 299_792_458.0 * 1e-6
    one, _, eight = blind.values()
    in_range = 1.0 - 5 * pulse_m / 40e3
    assert abs(one - (1.0 - in_range * (1.0 - 5 * 30.0 / 600.0))) < 2e-3
    assert abs(eight - (1.0 - (1.0 - pulse_m / 40e3) * (1.0 - 30.0 / 600.0))) < 2e-3
