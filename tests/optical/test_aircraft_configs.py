"""The aircraft files hold the tables of the thesis, with every value's source beside it."""

import tomllib
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "configs" / "aircraft"
# Files that extend one of these are those of tests/radar/test_target_configs.py.
NAMES = sorted(
    path.stem for path in FOLDER.glob("*.toml") if "\nextends" not in path.read_text("utf-8")
)

# Table 3.1 with the lost cells of errata 19: front, side, horizontal.
EO = {
    "beech_99": (12.0, 30.0, 90.0),
    "general_aviation": (12.0, 30.0, 90.0),
    "f_16": (7.0, 20.0, 250.0),
    "f_16_realistic": (7.0, 20.0, 69.0),
    "small_fighter": (7.0, 20.0, 250.0),
    "boeing_787": (90.0, 250.0, 400.0),
    "commercial_transport": (90.0, 250.0, 400.0),
}
# Table 3.2 (errata 20) and Table 4.6 (errata 21): front, back, side, horizontal.
IR_FIRST = {
    "general_aviation": (4.6, 4.6, 11.15, 35.52),
    "small_fighter": (7.0, 14.0, 14.0, 37.16),
    "commercial_transport": (32.5, 65.0, 223.0, 353.0),
}
IR_REFINED = {
    "general_aviation": (4.6, 4.6, 6.0, 35.52),
    "small_fighter": (7.0, 14.0, 7.0, 37.16),
    "commercial_transport": (32.5, 65.0, 110.0, 353.0),
}
CLASS = {
    "beech_99": "general_aviation",
    "f_16": "small_fighter",
    "f_16_realistic": "small_fighter",
    "boeing_787": "commercial_transport",
}
ENGINE = {
    "general_aviation": "propeller",
    "small_fighter": "turbojet",
    "commercial_transport": "turbofan",
}


def test_every_aircraft_is_there():
    assert set(NAMES) == {*EO, *(f"{name}_refined" for name in EO if name != "f_16_realistic")}


@pytest.mark.parametrize("name", NAMES)
def test_values_are_those_of_the_tables(name):
    data = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    plain = name.removesuffix("_refined")
    kind = CLASS.get(plain, plain)
    eo, ir = data.pop("eo"), data.pop("ir")
    assert tuple(eo[k] for k in ("front_m2", "side_m2", "horizontal_m2")) == EO[plain]
    infrared = IR_REFINED if name.endswith("_refined") else IR_FIRST
    keys = ("front_m2", "back_m2", "side_m2", "horizontal_m2")
    assert tuple(ir[k] for k in keys) == infrared[kind]
    assert len(eo) == 3 and len(ir) == 4
    assert data.pop("rcs_dbsm") in (1.76, 3.01, 6.99)  # the classes of Table 4.1
    assert data == {"swerling": 1, "contrast": 1.0, "contrast_ir": 1.0, "engine": ENGINE[kind]}


@pytest.mark.parametrize("name", NAMES)
def test_every_value_names_its_source(name):
    for line in (FOLDER / f"{name}.toml").read_text(encoding="utf-8").splitlines():
        if "=" in line and not line.startswith("#"):
            source = line.partition("  # ")[2]
            assert any(word in source for word in ("Table", "errata", "assumption", "thesis")), line
