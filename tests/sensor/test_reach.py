"""What each sensor looks at: switch, field of view in its own axes, farthest range."""

import math

import crooked
import numpy as np
import pytest
from covering import SENSORS, covers
from wired import alone, rows

from components.messages.reach import ABSENT, Decision, Reach

ROLLING, DIVING = (crooked.body(target) for target in crooked.TARGETS)
RANGES_KM = [float(np.linalg.norm(vector)) / 1000 for vector in (ROLLING, DIVING)]


def degrees(vector) -> tuple[float, float]:
    azimuth, elevation = crooked.angles(vector)
    return math.degrees(azimuth), math.degrees(elevation)


def look(kind: str, **keys) -> tuple[set[str], dict]:
    """Names detected at the first scan, and the row of the scan."""
    found = alone(kind, **keys)
    (scan,) = rows(found, "scans", block="sensor")
    names = {row["target"] for row in rows(found, block="sensor")}
    assert scan["evaluated"] == scan["detected"] == len(names)
    return names, scan


def test_the_two_targets_lie_apart_in_every_frame():
    """Else a window round one of them in a wrong frame might hold the right one."""
    for vector, target in ((ROLLING, crooked.ROLLING), (DIVING, crooked.DIVING)):
        level = degrees(crooked.ned(target))
        assert min(abs(a - b) for a, b in zip(degrees(vector), level, strict=True)) > 10.0
    assert abs(degrees(ROLLING)[0] - degrees(DIVING)[0]) > 20.0


@covers("enabled", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
def test_a_sensor_that_is_off_looks_at_nothing(kind):
    assert look(kind)[0] == {"rolling", "diving"}
    off = alone(kind, enabled=False)
    assert rows(off, "scans", block="sensor") == rows(off, block="sensor") == []


@covers("azimuth_deg", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize(("vector", "name"), [(ROLLING, "rolling"), (DIVING, "diving")])
def test_azimuths_are_those_of_the_body_and_clockwise(kind, vector, name):
    azimuth, _ = degrees(vector)
    names, scan = look(kind, azimuth_deg=[azimuth - 0.2, azimuth + 0.1])
    assert (names, scan["skipped_field_of_view"]) == ({name}, 1)
    for edges in ([azimuth + 0.1, azimuth + 0.3], [azimuth - 0.3, azimuth - 0.1]):
        assert look(kind, azimuth_deg=edges)[0] == set()
    around = [azimuth + 0.1, azimuth - 0.1 + 360.0 if azimuth < 0 else azimuth - 0.1]
    assert look(kind, azimuth_deg=around)[0] == {"rolling", "diving"} - {name}


@covers("elevation_deg", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
def test_elevations_are_those_of_the_body(kind):
    low, high = sorted(((degrees(v)[1], n) for v, n in ((ROLLING, "rolling"), (DIVING, "diving"))))
    middle = 0.5 * (low[0] + high[0])
    assert look(kind, elevation_deg=[low[0] - 0.01, middle])[0] == {low[1]}
    assert look(kind, elevation_deg=[middle, high[0] + 0.01])[0] == {high[1]}
    names, scan = look(kind, elevation_deg=[high[0] + 0.01, 90])
    assert (names, scan["skipped_field_of_view"]) == (set(), 2)
    assert look(kind, elevation_deg=[-90, low[0] - 0.01])[0] == set()


@covers("range_km", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
def test_a_range_is_the_farthest_looked_at(kind):
    far_km, near_km = RANGES_KM
    names, scan = look(kind, range_km=far_km + 0.001)
    assert names == {"rolling", "diving"}
    names, scan = look(kind, range_km=far_km - 0.001)
    assert (names, scan["skipped_range"] + scan["skipped_culled"]) == ({"diving"}, 1)
    assert look(kind, range_km=near_km - 0.001)[0] == set()


@pytest.mark.parametrize("range_km", [3.0, 11.0])
@pytest.mark.parametrize(
    ("kind", "margin"),
    [
        ("radar.range_boundary", lambda ratio: 40.0 * math.log10(ratio)),
        ("optical.range_boundary", lambda ratio: ratio**2 - 1.0),
    ],
)
def test_the_confidence_inside_a_boundary_is_the_margin_to_it(kind, margin, range_km):
    """In dB of an echo that goes with the fourth power, or in pixels that go with the square."""
    found = rows(alone(kind, range_km=range_km), block="sensor")
    for row, here_km in zip(found, RANGES_KM, strict=True):
        assert row["confidence"] == pytest.approx(margin(range_km / here_km), rel=1e-9)


SKEW = (-35.0, 21.0, -75.0)


@covers("mount_azimuth_deg", "mount_elevation_deg", "mount_roll_deg", of=SENSORS)
@pytest.mark.parametrize(
    ("kind", "mount"),
    [
        *((kind, SKEW) for kind in SENSORS),
        *(("optical.ir", mount) for mount in ((25.0, 0, 0), (0, -14.0, 0), (0, 0, 40.0))),
    ],
)
def test_fields_of_view_turn_with_the_mounting(kind, mount):
    """Narrow windows round a target's direction in the sensor's axes, and beside it."""
    keys = dict(
        zip(("mount_azimuth_deg", "mount_elevation_deg", "mount_roll_deg"), mount, strict=True)
    )
    for vector, name in ((ROLLING, "rolling"), (DIVING, "diving")):
        azimuth, elevation = degrees(crooked.rotation(*mount) @ vector)
        window = {
            "azimuth_deg": [azimuth - 0.1, azimuth + 0.1],
            "elevation_deg": [elevation - 0.1, elevation + 0.1],
        }
        assert look(kind, **keys, **window)[0] == {name}
        window["elevation_deg"] = [elevation + 0.05, elevation + 0.2]
        assert look(kind, **keys, **window)[0] == set()


@covers("intruders.start_time_s", "intruders.end_time_s", of=("traffic.scripted",))
def test_targets_are_there_from_start_to_end():
    targets = [
        {**crooked.ROLLING, "start_time_s": 0.5},
        {**crooked.DIVING, "end_time_s": 0.75},
    ]
    found = alone("radar.range_boundary", scan_rate_hz=4, targets=targets, duration_s=1.25)
    there = [(row["scan"], row["target"]) for row in rows(found)]
    assert there == [
        (0, "diving"), (1, "diving"), (2, "rolling"), (2, "diving"), (3, "rolling"),
        (3, "diving"), (4, "rolling"),
    ]  # fmt: skip
    left_out = ("skipped_absent", "skipped_culled")
    absent = [sum(row[key] for key in left_out) for row in rows(found, "scans")]
    assert absent == [1, 1, 0, 0, 1]


@pytest.mark.parametrize(
    ("azimuth_deg", "width_deg"),
    [((-30, 40), 70), ((170, -170), 20), ((-180, 180), 360), ((10, 370), 360)],
)
def test_width_of_a_field_runs_clockwise(azimuth_deg, width_deg):
    reach = Reach(tuple(np.radians(azimuth_deg).tolist()), (-0.25, 0.5))
    across, upward = reach.width_rad
    assert across == pytest.approx(np.radians(width_deg), rel=1e-15) and across <= 2 * np.pi
    assert upward == 0.75


def test_decisions_of_rows_are_taken_widened_and_joined_by_hand():
    """A sensor that scans at rows 0, 2 and 3 of five, with two targets."""
    reason = np.array([[1, 2], [3, 4], [5, 6]], dtype=np.uint8)
    whole = Decision(np.array([0, 2, 3]), reason, 5)
    for some, kept, reasons in (
        (np.array([0, 1, 3]), [0, 2], [[1, 2], [5, 6]]), (slice(2, 5), [0, 1], [[3, 4], [5, 6]]),
        (slice(1, 2), [], []),
    ):  # fmt: skip
        part = whole.take_rows(some)
        assert part.rows.tolist() == kept and part.reason.tolist() == reasons
        assert part.count == len(np.arange(5)[some])
    assert (
        whole.reasons_at(whole.rows) is reason and whole.reasons_at(np.array([0, 2, 3])) is reason
    )
    assert whole.reasons_at(np.array([3, 0])).tolist() == [[5, 6], [1, 2]]
    assert whole.reasons_at(np.array([0, 1])) is None
    wide = whole.widen(np.array([3, 1]), 4)
    assert wide.reason.tolist() == [[ABSENT, b, ABSENT, a] for a, b in reason.tolist()]
    assert wide.rows.tolist() == [0, 2, 3] and wide.count == 5
    both = Decision.join_rows([whole, whole.take_rows(slice(2, 5))])
    assert both.rows.tolist() == [0, 2, 3, 5, 6] and both.count == 8
    assert both.reason.tolist() == [*reason.tolist(), [3, 4], [5, 6]]
