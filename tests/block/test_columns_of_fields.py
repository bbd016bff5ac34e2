"""What a message records follows from its fields; columns and their order are the files' face."""

from dataclasses import dataclass

import numpy as np
import pytest

from components.messages.detections import EXTRAS, Detections
from components.messages.fused import FusedDetections
from components.messages.steering import Manoeuvres
from components.messages.tracks import Tracks
from dsa_des.block.message import (
    PER_ROW,
    Column,
    Message,
    Text,
    column,
    columns,
    columns_of_dataclass,
    per_row,
    static,
)

# As files have them; whoever reads one by position must not be surprised.
COLUMNS = {
    "scans": "scan evaluated detected skipped_absent skipped_off skipped_field_of_view "
    "skipped_range skipped_hidden skipped_culled "
    "own_lat_deg own_lon_deg own_alt_m own_heading_rad own_pitch_rad own_roll_rad "
    "own_velocity_north_m_s own_velocity_east_m_s own_velocity_down_m_s",
    "detections": "scan target confidence azimuth_rad elevation_rad range_m true_azimuth_rad "
    "true_elevation_rad true_range_m "
    "range_rate_m_s azimuth_variance_rad2 elevation_variance_rad2 range_variance_m2 "
    "range_rate_variance_m2_s2 "
    "snr_db detection_probability pixels declared illuminated_s "
    "ned_azimuth_rad ned_elevation_rad cued",
    "fused": "target sensors angle_source range_source measured_s azimuth_rad elevation_rad "
    "range_m true_azimuth_rad true_elevation_rad true_range_m "
    "range_rate_m_s azimuth_variance_rad2 elevation_variance_rad2 range_variance_m2 "
    "range_rate_variance_m2_s2",
    "tracks": "target age_s updated_by measured_s azimuth_rad elevation_rad range_m",
    "manoeuvres": "turn_rad rate_rad_s climb_m climb_rate_mps speed_mps acceleration_mps2 "
    "vertical_speed_mps vertical_acceleration_mps2 bank_rad roll_rate_rad_s "
    "heading_rad eases_rad",
}
KINDS = {"int64": ["scan", "evaluated", "detected"], "bool": ["declared", "cued"]}
TEXTS = ["target", "sensors", "angle_source", "range_source", "updated_by"]


@dataclass(eq=False)
class Catch(Message):
    """Fish by net: a row per haul."""

    row_table = "hauls"
    entry_table = "fish"

    haul: np.ndarray = column(
        "", "", "its number", "int64", of=PER_ROW, name="number", in_entries=True
    )
    crew: np.ndarray = column(
        "", "", "who", "text", of=PER_ROW, in_entries=True, value=lambda m: Text(m.crew, m.names)
    )
    note: np.ndarray = per_row()
    offsets: np.ndarray = per_row()
    mass_kg: np.ndarray = column("kg", "", "its weight")
    extras: dict = columns({"age_years": Column("years"), "marked": Column(kind="bool")})
    names: tuple = static()


def catch(**extras):
    return Catch(
        np.array([3, 7, 9]),
        haul=np.array([1, 2, 3]),
        crew=np.array([0, 1, 0]),
        note=np.zeros(3),
        offsets=np.array([0, 2, 2, 3]),
        mass_kg=np.array([0.5, 0.75, 4.0]),
        extras=extras,
        names=("ann", "ben"),
    )


@pytest.mark.parametrize("message", [Detections, FusedDetections, Tracks, Manoeuvres])
def test_tables_have_the_columns_they_always_had(message):
    for table, found in message.recorded.items():
        assert " ".join(found) == COLUMNS[table]
        for name, (_, _, meaning, kind) in found.items():
            assert meaning
            expected = next((k for k, names in KINDS.items() if name in names), "float64")
            if name.startswith("skipped_"):
                expected = "int64"
            assert kind == ("text" if name in TEXTS else expected), name


def test_columns_follow_from_fields():
    assert Catch.recorded == {
        "hauls": {
            "number": Column("", "", "its number", "int64"),
            "crew": Column("", "", "who", "text"),
        },
        "fish": {
            "number": Column("", "", "its number", "int64"),
            "crew": Column("", "", "who", "text"),
            "mass_kg": Column("kg", "", "its weight"),
            "age_years": Column("years"),
            "marked": Column(kind="bool"),
        },
    }
    assert Message.recorded == {} and Message(np.array([1])).tables() == {}


def test_rows_are_repeated_for_their_entries():
    tables = catch(marked=np.array([True, False, True])).tables()
    hauls, fish = tables["hauls"], tables["fish"]
    assert hauls["tick"].tolist() == [3, 7, 9] and hauls["number"].tolist() == [1, 2, 3]
    assert fish["tick"].tolist() == [3, 3, 9] and fish["number"].tolist() == [1, 1, 3]
    assert [fish["crew"].names[code] for code in fish["crew"].codes] == ["ann", "ann", "ann"]
    assert fish["mass_kg"].tolist() == [0.5, 0.75, 4.0]
    assert fish["marked"].tolist() == [True, False, True]
    assert "age_years" not in fish  # not held: the recorder writes null


def test_a_subclass_declares_more():
    @dataclass(eq=False)
    class Measured(Catch):
        extras: dict = columns({"length_m": Column("m")})

    assert list(Measured.recorded["fish"]) == ["number", "crew", "mass_kg", "length_m"]
    assert "age_years" in Catch.recorded["fish"]


def test_a_dict_cannot_take_the_place_of_another_fields_column():
    with pytest.raises(ValueError, match=r"Catch\.extras holds 'mass_kg'"):
        catch(mass_kg=np.zeros(3)).tables()


def test_a_column_without_a_table_or_twice_is_refused():
    @dataclass(eq=False)
    class Homeless(Message):
        size: np.ndarray = column("m", "", "", of=PER_ROW)

    @dataclass(eq=False)
    class Twice(Message):
        row_table = "sizes"
        size: np.ndarray = column("m", "", "", of=PER_ROW)
        other: np.ndarray = column("m", "", "", of=PER_ROW, name="size")

    with pytest.raises(TypeError, match=r"Homeless\.size .* no row_table"):
        _ = Homeless.recorded
    with pytest.raises(TypeError, match="two fields for column 'size'"):
        _ = Twice.recorded
    with pytest.raises(ValueError, match=r"'float32'.*float64"):
        column("", "", "", "float32")


def test_the_extras_of_detections_are_columns_of_theirs():
    assert EXTRAS.items() <= Detections.recorded["detections"].items()


def test_what_a_wire_held_first_may_lack_columns_that_real_messages_have():
    """Nothing is lost of the real ones, whatever stands before them."""
    held = catch()
    held.note = None
    real = catch(age_years=np.array([1.0, 2.0, 3.0]), marked=np.array([True, False, True]))
    for parts, place in (([held, real], slice(3, 6)), ([real, held], slice(0, 3))):
        joined = Catch.concatenate(parts)
        np.testing.assert_array_equal(joined.extras["age_years"][place], [1.0, 2.0, 3.0])
        np.testing.assert_array_equal(joined.extras["marked"][place], [True, False, True])
        assert joined.extras["marked"].dtype == bool and len(joined.note) == 6
        assert np.isnan(joined.extras["age_years"]).sum() == 3


def test_groups_of_columns_come_behind_a_class_s_own_and_before_dicts():
    @dataclass(eq=False, kw_only=True)
    class Size:
        length_m: np.ndarray = column("m", "", "its length")
        width_m: np.ndarray = column("m", "", "its width", default=None)

    @dataclass(eq=False)
    class Sized(Size, Message):
        entry_table = "sizes"
        offsets: np.ndarray = per_row()
        more: dict = columns({"depth_m": Column("m")})
        number: np.ndarray = column("", "", "its number", "int64", default=None, kw_only=True)

    assert list(Sized.recorded["sizes"]) == ["number", "length_m", "width_m", "depth_m"]
    assert columns_of_dataclass(Size)["length_m"] == Column("m", "", "its length")
    made = Sized(np.array([5]), np.array([0, 2]), {}, length_m=np.array([1.0, 2.0]))
    assert np.isnan(made.width_m).all() and made.number.tolist() == [0, 0]
    empty = Sized.empty()
    assert len(empty.length_m) == len(empty.number) == 0 and empty.offsets.tolist() == [0, 0]
    assert empty.number.dtype == np.int64 and empty.more["depth_m"].dtype == np.float64
