"""Units and types of keys, as the reference and ``dsa-des components`` say them."""

from components.aircraft.aircraft import Aircraft
from components.environment.tables import Terrain
from components.sensor.acquisition import AcquisitionRange
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


def test_types_are_said_as_a_scene_writes_them():
    def types(model):
        return {name.strip(): kind for name, kind, *_ in parameter_rows(model)}

    assert types(Aircraft)["rcs_table"] == types(Terrain)["raster"] == "path"
    assert types(ActiveParameters)["azimuth_deg"] == "[number, number]"
    assert types(AcquisitionRange)["azimuth_deg"] == "list of number"
