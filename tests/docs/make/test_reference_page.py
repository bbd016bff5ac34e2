"""The reference: every key and column is described, and the committed page is current."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from docs.make.reference.__main__ import page, recorded_tables
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.recorded_columns import LEADING
from dsa_des.block.registry import find_component, section_models
from dsa_des.cli import main
from dsa_des.commands.parameters import parameter_rows, scene_tables
from dsa_des.scene import scene, wiring

ROOT = Path(__file__).parents[3]


def test_the_committed_page_is_current():
    committed = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    assert committed == page(), "python -m docs.make.reference docs/reference.md"


def test_every_key_of_every_block_follows_from_its_table_and_the_links():
    """Shared keys stand once: who follows the links finds all rows that the command prints."""
    sections = {
        re.sub(r"[^a-z0-9_. ]", "", title.lower()).replace(" ", "-"): text
        for title, text in re.findall(r"^### (.+)\n((?:.*\n)*?)(?=^##|\Z)", page(), re.MULTILINE)
    }

    def found(anchor: str, prefix: str = "") -> set[tuple[str, ...]]:
        own: set[tuple[str, ...]] = set()
        inner: set[tuple[str, ...]] = set()
        shared: set[tuple[str, ...]] = set()
        for line in sections[anchor].splitlines():
            if line.startswith("| ") and not line.startswith(("| key", "| ---")):
                cells = re.split(r" (?<!\\)\| ", f" {line[1:]} ")
                key, _, mark = cells[0].strip().partition(" ")
                meaning, _, links = cells[4].partition("Keys: ")
                said = meaning.strip() + (" May change while a run lasts." if mark else "")
                row = (cells[1], cells[2], cells[3].replace("there", "below"), said)
                own.add((f"{prefix}{key}", *(cell.strip() for cell in row)))
                for link in re.findall(r"\(#([a-z-]+)\)", links):
                    inner |= found(link, f"{prefix}{key}.")
            else:
                for link in re.findall(r"\(#([a-z-]+)\)", line.partition("keys of ")[2]):
                    names = {row[0] for row in own | shared}
                    shared |= {row for row in found(link, prefix) if row[0] not in names}
        return own | inner | shared

    for name in entry_points_of():
        rows = parameter_rows(find_component(name).Parameters)
        asked = {tuple(cell.strip().replace("|", "\\|") for cell in row) for row in rows}
        assert found(name) == asked, name


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
