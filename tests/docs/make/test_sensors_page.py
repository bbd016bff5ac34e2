"""Tables of docs/sensors.md hold what their makers compute."""

from pathlib import Path

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
