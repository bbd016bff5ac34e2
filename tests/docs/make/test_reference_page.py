"""The reference: every key and column is described, and the committed page is current."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from docs.make.reference import page, recorded_tables
from dsa_des.block.recorded_columns import LEADING
from dsa_des.block.registry import section_models
from dsa_des.cli import main
from dsa_des.commands.parameters import scene_tables
from dsa_des.scene import scene, wiring

ROOT = Path(__file__).parents[3]


def test_the_committed_page_is_current():
    committed = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    assert committed == page(), "python -m docs.make.reference docs/reference.md"


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("_rad", "rad"),
        ("_deg", "deg"),
        ("_m", "m"),
        ("_s", "s"),
        ("_db", "dB"),
        ("_m_s", "m/s"),
        ("_rad2", "rad²"),
        ("_m2", "m²"),
        ("_m2_s", "m²/s"),
        ("_m2_s2", "m²/s²"),
    ],
)
def test_units_are_those_of_the_names(column, unit):
    for columns in [LEADING, *recorded_tables().values()]:
        for name, (said, _, meaning, _) in columns.items():
            assert meaning
            rate = name.endswith(("rad_s", "m_s", "m2_s")) and column in ("_s", "_m")
            if name.endswith(column) and not rate:
                assert said == unit, name


def test_keys_written_by_hand_are_those_that_are_read():
    rows = {name: [row[0] for row in make()] for name, (_, make) in scene_tables().items()}
    assert set(rows["wires"]) == set(wiring._KEYS)
    assert set(rows["scene"]) == set(scene._TOP_LEVEL)
    assert set(section_models()) <= set(rows)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("weather", "rain_rate_mm_h"),
        ("processors", "service_s"),
        ("wires", "drop_probability"),
        ("accuracy", "angle_deg"),
        ("extends", "remove"),
        ("radar.swerling", "power_w"),
    ],
)
def test_the_command_answers(name, text):
    done = CliRunner().invoke(main, ["components", name])
    assert done.exit_code == 0
    assert text in done.stdout


def test_an_unknown_name_lists_the_tables():
    done = CliRunner().invoke(main, ["components", "wether"])
    assert done.exit_code == 2
    assert "weather" in done.stderr
