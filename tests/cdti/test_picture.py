"""What is shown lies where it is: contacts, the area of a loss, the camera's silhouette."""

import math
from types import SimpleNamespace

import numpy as np
import pymap3d
import pytest
from matplotlib.path import Path as Outline
from pymap3d import vincenty

import dsa_des
from components.aircraft.aircraft import VisibleAreas
from components.cdti import control
from components.cdti.camera import silhouette
from components.cdti.contacts import (
    Contacts,
    OwnFlight,
    OwnNow,
    contacts_after_lines,
    contacts_of_states,
)
from components.cdti.loss_area import predicted_loss_area
from components.cdti.scope import Scope
from components.messages.state_tracks import StateTracks
from components.messages.tracks import Tracks
from components.optical.silhouette import exact_area_of_bodies_union
from components.well_clear.volume import Volume, violates
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from tests.view.test_page import HOSTILE, SCENE

# -- contacts ------------------------------------------------------------------------------------


def watched(tmp_path, change=("", "")):
    """The display at the end of six seconds of a banked flight, heading 217 deg, in the south."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(title="t", name=HOSTILE).replace(*change))
    recorder = Recorder([MemorySink()])
    simulation = Simulation(dsa_des.load_scene(path), recorder=recorder)
    scope = Scope(simulation)
    recorder.listeners.append(scope.store_message)
    simulation.run()
    return scope


def east_north_up(time_s):
    """Target less ownship at a time, as the scene has it, by pymap3d at the ownship."""
    heading, other = math.radians(217), math.radians(60)
    own = [70 * time_s * math.sin(heading), 70 * time_s * math.cos(heading), 0.0]
    target = [-2500 + 90 * time_s * math.sin(other), -3500 + 90 * time_s * math.cos(other), 400.0]
    places = [pymap3d.enu2geodetic(*p, -41.3, 179.98, 2200) for p in (own, target)]
    return pymap3d.geodetic2enu(*places[1], *places[0])


def test_a_ranged_contact_lies_where_the_target_is(tmp_path):
    scope = watched(tmp_path)
    shown = scope.page_content(6.0)
    assert shown["own"]["heading"] == pytest.approx(217, abs=0.01)
    assert shown["own"]["speed"] == pytest.approx(70, abs=0.5)
    ((number, east, north, up, bearing, age, *flight, level),) = shown["contacts"]
    seen_s = 6.0 - age
    wanted = east_north_up(seen_s)
    # The camera's grid and the radar's: 0.5 deg and 75 m at most, 3 km away.
    assert np.hypot(east - wanted[0], north - wanted[1]) < 120
    assert up == pytest.approx(wanted[2], abs=60)
    assert bearing == pytest.approx(math.degrees(math.atan2(*wanted[:2])) % 360, abs=1)
    assert (number, flight, level) == (0, [None] * 3, 0)
    assert scope.names == ['</script><script>alert(1)</script>{{script}} & "q"']


def test_a_contact_without_a_range_is_a_direction(tmp_path):
    scope = watched(tmp_path, ("range_km = 15", "range_km = 0.5"))
    ((_, east, north, up, bearing, age, *_),) = scope.page_content(6.0)["contacts"]
    assert east is north is up is None
    wanted = east_north_up(6.0 - age)
    assert bearing == pytest.approx(math.degrees(math.atan2(*wanted[:2])) % 360, abs=1)
    assert scope.page_content(6.0 + 11.0)["contacts"] == []  # forgotten


def test_a_range_is_held_for_a_while_along_the_new_direction():
    own = OwnFlight()
    own._tick, own._pose = np.array([0]), np.array([[0.0, 0.0, 1000.0, 0.0, 0.0, 0.0]])
    before = Contacts(
        np.array([7, 3]), np.array([1.0, 1.0]), np.array([True, True]), np.array([500.0, 2000.0]),
        np.array([1.0, 1.0]), np.zeros((2, 3)), np.zeros((2, 2)),
    )  # fmt: skip

    def after(tick):
        tracks = Tracks(
            np.array([tick]), np.array([0, 2]), np.array([3, 4]), np.zeros(2),
            np.zeros(2, dtype=int), None, ("eo",), azimuth_rad=np.array([math.pi / 2, 0.0]),
            elevation_rad=np.zeros(2), range_m=np.full(2, np.nan),
        )  # fmt: skip
        return contacts_after_lines(tracks, own, 1, before)

    held = after(3)
    assert held.ranged.tolist() == [True, False]
    there = pymap3d.enu2geodetic(2000.0, 0.0, 0.0, 0.0, 0.0, 1000.0)
    assert held.position[0] == pytest.approx(np.array(there, dtype=float), abs=1e-6)
    assert after(5).ranged.tolist() == [False, False]


@pytest.mark.parametrize("ranged", [True, False])
def test_a_contact_dead_ahead_is_on_the_nose_however_far_the_start_is(ranged):
    """300 km flown from where the tracker began at 60° N, where east is 4.6° off by then."""
    lat, lon = vincenty.vreckon(60.0, 10.0, 300e3, 90.0)
    _, back = vincenty.vdist(lat, lon, 60.0, 10.0)
    nose = math.radians((back + 180.0) % 360.0)
    own = OwnFlight()
    own.now = OwnNow(float(lat), float(lon), 1000.0, nose, 0.0, 0.0, 100.0, 0.0)
    there = pymap3d.enu2geodetic(
        5000 * math.sin(nose), 5000 * math.cos(nose), 0.0, lat, lon, 1000.0
    )
    sight = np.array(pymap3d.geodetic2ned(*there, 60.0, 10.0, 1000.0)).astype(float)
    here = np.array(pymap3d.geodetic2ned(lat, lon, 1000.0, 60.0, 10.0, 1000.0)).astype(float)
    toward = sight - here
    one, none = np.ones(1), np.zeros(1, dtype=np.int64)
    message = StateTracks(
        tick=none, offsets=np.array([0, 1]), track=none + 1, track_status=none + 1, existence=one,
        azimuth_rad=one * math.atan2(toward[1], toward[0]),
        elevation_rad=one * math.atan2(-toward[2], math.hypot(toward[0], toward[1])),
        azimuth_variance_rad2=one, elevation_variance_rad2=one, has_range=np.array([ranged]),
        age_s=one, state_s=one, updated_s=one, contributors=none, updated_by=none,
        own_north_m=one, own_east_m=one, own_down_m=one, covariance={}, extras={}, sensors=(),
        north_m=sight[:1], east_m=sight[1:2], down_m=sight[2:], north_m_s=one, east_m_s=one,
        down_m_s=one, origin_lat_deg=60.0 * one, origin_lon_deg=10.0 * one,
        origin_alt_m=1000.0 * one,
    )  # fmt: skip
    ((_, east, north, up, bearing, _),) = contacts_of_states(message, own, 1).rows_to_show(
        own.now, 2, 9
    )
    assert bearing == pytest.approx(math.degrees(nose), abs=0.02)
    if ranged:
        assert math.degrees(math.atan2(east, north)) == pytest.approx(math.degrees(nose), abs=0.02)
        assert math.hypot(east, north) == pytest.approx(5000.0, abs=1.0)
        assert up == pytest.approx(there[2] - 1000.0, abs=0.1)
    else:
        assert east is north is up is None


# -- the area in which separation would be lost ---------------------------------------------------


def test_the_area_of_a_loss_is_that_of_flights_tried_one_by_one():
    volume = Volume(horizontal_m=900.0, vertical_m=140.0, horizontal_time_s=30.0)
    own = np.array([-30.0, -40.0, 0.5])
    relative = np.array([[-2600.0, 2500.0], [-1500.0, 900.0], [60.0, -90.0],
                         [80.0, -70.0], [45.0, -20.0], [0.5, 1.5]])  # fmt: skip
    found = predicted_loss_area(volume, 1000.0, own, relative, 120.0)
    step_s = 0.25
    times = np.arange(0.0, 120.0, step_s)
    lost = {}
    for direction in np.radians(np.arange(0, 360, 3)):
        turned = 50.0 * np.sin(direction) - own[0], 50.0 * np.cos(direction) - own[1], 0.0
        for place in (0, 1):
            rates = relative[3:, place] + turned
            at = [relative[i, place] + rates[i] * times for i in range(3)]
            inside = violates(volume, [*at, *(np.full(len(times), rate) for rate in rates)])
            if inside.any():
                key = round(math.degrees(direction)), place
                lost[key] = 50.0 * times[inside].min(), 50.0 * times[inside].max()
    degrees = np.round(np.degrees(found.direction_rad)).astype(int).tolist()
    assert sorted(degrees) == sorted(direction for direction, _ in lost)
    brute = sorted((direction, *span) for (direction, _), span in lost.items())
    mine = sorted(zip(degrees, found.near_m, found.far_m, strict=True))
    assert len(brute) > 20
    for (_, near, far), (_, wanted_near, wanted_far) in zip(mine, brute, strict=True):
        assert near == pytest.approx(wanted_near, abs=50.0 * step_s)
        assert far == pytest.approx(wanted_far, abs=50.0 * step_s)


# -- the camera's picture -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target_deg", "toward_deg"),
    [((30, 0, 0), (20, 5)), ((217, 12, -35), (-70, -8)), ((100, -20, 60), (140, 25))],
)
def test_the_silhouette_covers_as_much_as_the_detection_counts(target_deg, toward_deg):
    """The two outlines together have the area of the union of the bodies, in pixels."""
    areas = VisibleAreas(front_m2=12.0, side_m2=30.0, horizontal_m2=90.0)
    own = np.radians([217.0, 0.0, 0.0])
    toward, target = np.radians(toward_deg), np.radians(target_deg)
    pixel, range_m = (2e-4, 3e-4), 2500.0
    drawn = silhouette(areas, target, own, (toward[0], toward[1]), range_m, pixel)
    corners = np.concatenate(drawn)
    low, high = corners.min(axis=0) - 1, corners.max(axis=0) + 1
    x, y = (np.linspace(a, b, 700) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    inside = np.zeros(len(grid), dtype=bool)
    for outline in drawn:
        inside |= Outline(outline).contains_points(grid)
    covered = inside.mean() * np.prod(high - low)
    one = [np.array([value]) for value in (12.0, 30.0, 90.0)]
    bearing = toward[0] + own[0]
    angles = [np.array([a]) for a in (target[0] - bearing, target[1], target[2], toward[1])]
    wanted = exact_area_of_bodies_union(*angles, *one, None)[0] / (range_m**2 * pixel[0] * pixel[1])
    assert covered == pytest.approx(wanted, rel=0.03)  # circles of 16 corners lack 2.6 %


def test_the_silhouette_rolls_with_the_ownship():
    areas = VisibleAreas(front_m2=1.0, side_m2=2.0, horizontal_m2=40.0)
    ahead = np.radians([0.0, 0.0, 0.0])
    level = silhouette(areas, ahead, np.zeros(3), (0.0, 0.0), 1000.0, (1e-3, 1e-3)).wing
    banked = silhouette(
        areas, ahead, np.radians([0.0, 0.0, 30.0]), (0.0, 0.0), 1000.0, (1e-3, 1e-3)
    ).wing
    # To the right, the wing's tip goes up on the picture of a camera that banks to the right.
    right = banked[np.argmax(banked[:, 0])]
    assert np.abs(level[:, 1]).max() < 1e-9
    assert math.degrees(math.atan2(right[1], right[0])) == pytest.approx(30.0)


def test_a_new_page_is_told_the_last_two_hundred_decisions():
    told = object.__new__(control.SessionControl)
    told.scope = None
    told._scene, told._console = SimpleNamespace(title="t", duration_s=None), None
    told._factor, told._units, told._began, told._waits = 1.0, "si", True, False
    for count in (3, 201, 500):
        told._log = list(range(count))
        assert told.welcome("watcher")["log"] == told._log[-200:]
