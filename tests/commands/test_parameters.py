"""Units of keys, as the reference and ``dsa-des components`` say them."""

from components.aircraft.aircraft import Aircraft
from components.surveillance.active import ActiveParameters
from dsa_des.commands.parameters import parameter_rows


def units(model):
    return {name.strip(): unit for name, _, unit, _, _ in parameter_rows(model)}


def test_a_name_that_ends_like_a_unit_need_not_have_one():
    assert (
        units(ActiveParameters)["mode_s_in_1_s"] == units(ActiveParameters)["mode_c_in_1_s"] == ""
    )
    assert units(Aircraft)["mode_s"] == units(Aircraft)["mode_c"] == ""


def test_other_units_are_those_of_the_names():
    assert units(ActiveParameters)["offset_s"] == "s"
    assert "Hz" in units(ActiveParameters).values()
