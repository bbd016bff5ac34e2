"""What a block says it was held against: there is such a test, and it says how closely."""

from pathlib import Path

from dsa_des.block.entry_points import COMPONENTS, entry_points_of
from dsa_des.block.registry import find_component
from dsa_des.evidence.case import read_case
from dsa_des.evidence.inputs import models_of_blocks, verifications_of_class

ROOT = Path(__file__).parents[2]


def test_every_claim_names_a_test_that_is_there():
    claims = {}
    for name in entry_points_of(COMPONENTS):
        claims |= {(name, one.what): one for one in verifications_of_class(find_component(name))}
    assert len(claims) >= 12
    for one in claims.values():
        assert (ROOT / one.test).is_file(), one
        assert all(text and text == text.strip() for text in one), one
    assert {"line of sight", "errors of measured values"} <= {what for _, what in claims}


def test_the_shipped_case_states_something_of_every_block():
    case = read_case(ROOT / "configs" / "evidence" / "noncooperative.toml")
    assert all(model["verified"] for model in models_of_blocks(case.system_study))


def test_a_sensor_is_held_to_what_all_sensors_are():
    what = [one.what for one in verifications_of_class(find_component("radar.range_boundary"))]
    assert "field of view and range" in what
