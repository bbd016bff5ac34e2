"""Nothing is special about the ownship but its name."""

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from equipped import PILOT, RADAR, TURN_AWAY, scene_of
from same_runs import tables_of

EKF = {"type": "tracking.ekf", "acceleration_intensity_m2_s3": 0.2}
NAVIGATION = {
    "navigation": {"position_noise_m": [5, 5, 8], "attitude_noise_deg": [0.2, 0.2, 0.3],
                   "position_correlation_time_s": 30}
}  # fmt: skip
#: A shower on the way of both, a radar that freezes, and one that is switched off and on.
HAPPENS = {
    "weather": {"cells": [{"lat_deg": 52.03, "lon_deg": 4.44, "radius_km": 1.5,
                           "rain_rate_mm_h": 30, "speed_mps": 10, "towards_deg": 200}]},
    "outages": [{"blocks": ["radar_b"], "mean_between_s": 20, "mean_repair_s": 15,
                 "mode": "frozen"}],
    "changes": [{"from_s": 30, "to_s": 45, "set": {"blocks.radar.enabled": False}}],
}  # fmt: skip
# Off any meridian and parallel, so that nothing is symmetric by chance.
A = {"name": "a", "lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 3,
     "speed_mps": 50, "rcs_dbsm": 2, "swerling": 3}  # fmt: skip
B = {"name": "b", "lat_deg": 52.053, "lon_deg": 4.49, "alt_m": 1015, "heading_deg": 262,
     "speed_mps": 60, "rcs_dbsm": 8, "swerling": 1}  # fmt: skip
C = {"name": "c", "lat_deg": 52.02, "lon_deg": 4.25, "alt_m": 1100, "heading_deg": 80,
     "speed_mps": 70, "start_time_s": 20, "end_time_s": 100}  # fmt: skip


def rows_of(table: pa.Table, own: str | None) -> list[tuple[Any, ...]]:
    """Return rows, null targets as `own`, in an order that does not rest on who that is."""
    rows = [tuple(own if k == "target" and v is None else v for k, v in row.items())
            for row in table.to_pylist()]  # fmt: skip
    return sorted(rows, key=repr)


def test_who_is_called_ownship_makes_no_difference():
    assert_it_makes_no_difference()


@pytest.mark.parametrize(
    "how",
    [
        {"radar": {**RADAR, "beam_sweep": True}, "tracker": EKF, "decider": PILOT},
        {"radar": RADAR, "tracker": EKF, "sections": NAVIGATION | HAPPENS},
    ],
    ids=["sweeping beam, filter and pilot", "drawn navigation, and much happens"],
)
def test_nor_does_it_where_much_is_drawn(how):
    assert_it_makes_no_difference(**how)


def assert_it_makes_no_difference(**how: Any) -> None:
    first = scene_of(A, [B, C], {"": None, "_b": "b"}, **how)
    second = scene_of(B, [A, C], {"": "a", "_b": None}, **how)
    (_, one), (_, other) = tables_of(first), tables_of(second)
    assert one.keys() == other.keys() > {"truth", "detections", "fused", "alerts", "manoeuvres"}
    for name, table in one.items():
        assert table.num_rows > 0
        a, b = ("a", "b") if name == "truth" else (None, None)
        assert rows_of(table, a) == rows_of(other[name], b), name
    blocks = set(one["detections"]["block"].to_pylist())
    assert blocks == {"radar", "radar_b"}
    assert {"decider", "decider_b"} <= set(one["manoeuvres"]["block"].to_pylist())


#: Columns of the ways in which an encounter is its own image, by part of their name: those that
#: change their sign, and those that change by half a turn.
MIRRORED = ("azimuth_rad", "turn_rad", "heading_rad", "yaw_rad", "roll_rad", "lon_deg"), ()
ROTATED = ("lon_deg", "lat_deg"), ("own_heading_rad", "heading_rad")
ALIKE = ("detections", "fused", "tracks", "alerts", "manoeuvres", "scans")


def assert_alike(tables: Any, negated: tuple[str, ...], reversed_: tuple[str, ...]) -> None:
    """Compare the rows of the ownship's blocks with those of the same names and _b."""
    compared = 0
    for name in ALIKE:
        on_b = pa.array([str(block).endswith("_b") for block in tables[name]["block"]])
        theirs, mine = tables[name].filter(on_b), tables[name].filter(pc.invert(on_b))
        assert mine.num_rows == theirs.num_rows > 0, name
        for column in mine.column_names:
            one, other = mine[column].to_pylist(), theirs[column].to_pylist()
            if column == "platform":
                assert {*one} == {"ownship"} and {*other} == {"b"}
            elif column == "target":
                assert set(one) <= {"b"} and set(other) <= {"ownship"}
            elif pa.types.is_string(mine[column].type):  # names of blocks
                assert one == [block.removesuffix("_b") for block in other], (name, column)
            elif pa.types.is_floating(mine[column].type):
                sign = -1.0 if any(part in column for part in negated) else 1.0
                apart = np.array(one, dtype=float) - sign * np.array(other, dtype=float)
                if column.endswith("_rad"):
                    apart -= np.pi * (name != "manoeuvres" and column in reversed_)
                    apart = np.angle(np.exp(1j * apart))
                size = max(1.0, np.nanmax(np.abs(np.array(one, dtype=float)), initial=0.0))
                assert np.isnan(apart).tolist() == np.isnan(np.array(one, dtype=float)).tolist()
                assert np.nanmax(np.abs(apart), initial=0.0) <= 1e-8 * size, (name, column)
                compared += 1
            else:
                assert one == other, (name, column)
    assert compared > 20


def test_an_encounter_that_is_its_own_mirror_image_gives_two_equal_chains():
    """In the plane of the meridian 0, from the equator: east is west, and right is left."""
    own = {"lat_deg": 0.0, "lon_deg": -0.055, "alt_m": 1000, "heading_deg": 62, "speed_mps": 55}
    other = own | {"name": "b", "lon_deg": 0.055, "heading_deg": 298}
    how = {"decider": TURN_AWAY, "decides_by": "tracker", "duration_s": 150}
    _, tables = tables_of(scene_of(own, [other], {"": None, "_b": "b"}, **how))
    assert_alike(tables, *MIRRORED)
    turns = tables["manoeuvres"]["turn_rad"].to_pylist()
    assert min(turns) < 0.0 < max(turns)


def test_an_encounter_that_is_itself_turned_round_gives_two_equal_chains():
    """About the point 0, 0 by half a turn: what is north is south, and right stays right."""
    own = {"lat_deg": -0.03, "lon_deg": -0.045, "alt_m": 1000, "heading_deg": 60, "speed_mps": 55}
    other = own | {"name": "b", "lat_deg": 0.03, "lon_deg": 0.045, "heading_deg": 240}
    _, tables = tables_of(scene_of(own, [other], {"": None, "_b": "b"}, duration_s=150))
    assert_alike(tables, *ROTATED)
