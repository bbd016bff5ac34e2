"""Aspect tables: axes, units, interpolation, wrap, and holes refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.aircraft.aspect_tables import (
    SilhouetteTable,
    read_silhouette_table,
    silhouette_table_from_nodes,
)
from components.optical.silhouette import visible_area

AZIMUTHS = np.arange(0.0, 360.0, 30.0)
ELEVATIONS = np.arange(-90.0, 91.0, 30.0)


def lopsided(azimuth_deg, elevation_deg):
    """A made-up area that tells nose, tail, left, right, above and below apart."""
    az, el = np.radians(azimuth_deg), np.radians(elevation_deg)
    return 20.0 + np.cos(el) * (3.0 * np.cos(az) + 5.0 * np.sin(az)) + 7.0 * np.sin(el)


@pytest.fixture
def rows():
    return [
        (az, el, float(lopsided(az, el))) for el in ELEVATIONS for az in np.append(AZIMUTHS, 360.0)
    ]


def write(path, rows, header="az_deg,el_deg,area_m2"):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def test_reads_nodes_in_any_order_and_with_360_repeated(tmp_path, rows):
    table = read_silhouette_table(write(tmp_path / "a.csv", rows[::-1]))
    assert table.area_m2.shape == (7, 12)
    for az, el, area in rows:
        assert table.area(np.radians(az), np.radians(el)) == pytest.approx(area, rel=1e-13)


@pytest.mark.parametrize(
    ("column", "unit"),
    [("area", 1.0), ("a_m2", 1.0), (" AREA_M2 ", 1.0), ("a_ft", 0.09290304), ("a_ft2", 0.09290304)],
)
def test_column_name_carries_the_unit(tmp_path, rows, column, unit):
    table = read_silhouette_table(write(tmp_path / "a.csv", rows, f"az_deg, el_deg,{column}"))
    assert table.area(0.0, 0.0) == pytest.approx(23.0 * unit, rel=1e-14)


def test_extra_columns_comments_and_blank_lines(tmp_path):
    text = "# made by hand\n\nnote,el_deg,az_deg,area_m2\n"
    for el in (-90, 0, 90):
        for az in (0, 120, 240):
            text += f"x,{el},{az},{lopsided(az, el)}\n"
    path = tmp_path / "a.csv"
    path.write_text("\ufeff" + text, encoding="utf-8")
    assert read_silhouette_table(path).area(np.radians(120.0), 0.0) == pytest.approx(
        lopsided(120, 0)
    )


@pytest.mark.parametrize(
    ("view", "seen_from"),
    [
        ((np.pi, 0.0, 0.0, 0.0), (0, 0)),  # comes towards us: nose
        ((0.0, 0.0, 0.0, 0.0), (180, 0)),  # flies away: tail
        ((np.pi / 2, 0.0, 0.0, 0.0), (90, 0)),  # crosses to the right: right wing
        ((-np.pi / 2, 0.0, 0.0, 0.0), (270, 0)),  # crosses to the left: left wing
        ((0.4, 0.0, 0.0, np.pi / 2), (0, -90)),  # above us: its underside
        ((0.4, 0.0, 0.0, -np.pi / 2), (0, 90)),  # below us: its upper side
        ((0.0, np.pi / 2, 0.0, 0.0), (0, 90)),  # flies away, nose straight up: upper side
        ((np.pi / 2, 0.0, np.pi / 2, 0.0), (0, 90)),  # right wing down towards us: upper side
    ],
)
def test_silhouette_call_looks_from_the_observers_side(rows, view, seen_from):
    table = silhouette_table_from_nodes(*np.array(rows).T)
    area = visible_area(*view, model="aspect_table", table=table)
    assert area == pytest.approx(lopsided(*seen_from), rel=1e-12)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.floats(-20.0, 20.0), st.floats(-np.pi / 2, np.pi / 2))
def test_interpolation_wraps_and_stays_between_its_nodes(azimuth, elevation):
    az, el = np.meshgrid(AZIMUTHS, ELEVATIONS)
    table = SilhouetteTable(AZIMUTHS, ELEVATIONS, lopsided(az, el))
    area = table.area(azimuth, elevation)
    assert table.area(azimuth + 2 * np.pi, elevation) == pytest.approx(area, rel=1e-12)
    assert table.area_m2.min() <= area <= table.area_m2.max()
    # 30 degree cells of a function whose second derivative is below 12: error under 12 h²/8 · 2.
    truth = lopsided(np.degrees(azimuth), np.degrees(elevation))
    assert abs(area - truth) < 12.0 * np.radians(30.0) ** 2 / 4.0


def test_bilinear_in_the_cell_across_360(rows):
    table = silhouette_table_from_nodes(*np.array(rows).T)
    expected = 0.25 * (lopsided(330, 0) * 1.5 + lopsided(0, 0) * 0.5)
    expected += 0.25 * (lopsided(330, 30) * 1.5 + lopsided(0, 30) * 0.5)
    assert table.area(np.radians(337.5), np.radians(15.0)) == pytest.approx(expected)
    assert table.area(np.radians(-22.5), np.radians(15.0)) == pytest.approx(expected)
    assert table.area(-1e-320, 0.0) == pytest.approx(23.0)


def without(rows, test):
    return [row for row in rows if not test(row)]


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda r: without(r, lambda x: x[:2] == (60, 30)), "hole.*az_deg 60, el_deg 30"),
        (lambda r: without(r, lambda x: x[0] == 60), "hole: az_deg .*between 30 and 90.*60"),
        (lambda r: without(r, lambda x: x[1] == 30), "hole: el_deg .*between 0 and 60.*30"),
        (lambda r: without(r, lambda x: x[1] == 90), "hole.*from -90 to 60"),
        (lambda r: without(r, lambda x: 180 < x[0] < 360), "hole: az_deg"),
        (lambda r: [*r, (30, 0, 1.0)], "area_m2 is 1 and .* at az_deg 30, el_deg 0"),
        (lambda r: [*r[:-1], (360, 90, 5.0)], "must be one value.*0 and 360 are one node"),
        (
            lambda r: [*r[:5], (150, -90, "wide"), *r[6:]],
            "line 7: it must have a number in each of the columns az_deg",
        ),
        (
            lambda r: [*r[:5], (150,), *r[6:]],
            "line 7: it must have a number in each of the columns az_deg",
        ),
        (lambda r: [*r[:5], (150, -90, -3.0), *r[6:]], "area_m2 is -3"),
        (lambda r: [*r[:5], (150, -90, "nan"), *r[6:]], "area_m2 is nan"),
        (lambda r: [*r[:5], (150, -95, 3.0), *r[6:]], "el_deg is -95"),
        (lambda r: [], "is empty"),
    ],
)
def test_holes_and_bad_cells_are_named(tmp_path, rows, spoil, says):
    with pytest.raises(ValueError, match=says):
        read_silhouette_table(write(tmp_path / "a.csv", spoil(rows)))


@pytest.mark.parametrize(
    ("header", "says"),
    [("az,el_deg,area", "none of its 3 columns is az_deg"), ("az_deg,el_deg,rcs", "is an area")],
)
def test_missing_columns_are_named(tmp_path, rows, header, says):
    with pytest.raises(ValueError, match=says):
        read_silhouette_table(write(tmp_path / "a.csv", rows, header))


def test_unequal_steps_are_no_hole():
    azimuths = np.array([0, 1, 2, 3, 5, 10, 15, 30, 45, 90, 135, 180, 225, 270, 315, 330, 345.0])
    elevations = np.array([-90, -45, -15, -5, 0, 5, 15, 45, 90.0])
    az, el = np.meshgrid(azimuths, elevations)
    table = SilhouetteTable(azimuths, elevations, lopsided(az, el))
    assert table.area(np.radians(2.0), np.radians(5.0)) == pytest.approx(lopsided(2, 5))


def test_bad_direction_is_named(rows):
    table = silhouette_table_from_nodes(*np.array(rows).T)
    with pytest.raises(ValueError, match="elevation_rad is 2"):
        table.area(0.0, 2.0)
    with pytest.raises(ValueError, match="azimuth_rad is nan"):
        table.area(np.nan, 0.0)
