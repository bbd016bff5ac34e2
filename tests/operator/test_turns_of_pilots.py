"""When a pilot chooses, how far it turns, to which tracks, and how it flies there."""

import math

import numpy as np
import pytest
from covering import covers
from test_operator import KIND, scene
from wired import rows, run

import dsa_des
from dsa_des.errors import SceneError


def told(tmp_path, **keys):
    return rows(run(scene(tmp_path, **keys)), "manoeuvres")


@covers("goes_beyond", of=KIND)
def test_the_least_turn_is_30_degrees_less_than_the_deterministic_pilot_s(tmp_path):
    usual, least = (told(tmp_path, goes_beyond=beyond)[0] for beyond in (True, False))
    assert usual["time_s"] == least["time_s"]
    smaller = math.degrees(abs(usual["turn_rad"]) - abs(least["turn_rad"]))
    assert smaller == pytest.approx(30.0, abs=1e-9)


@covers("track_step_deg", of=KIND)
@pytest.mark.parametrize("step_deg", [5.0, 7.0, 45.0])
def test_turns_lead_to_the_nearest_track_of_the_dial(tmp_path, step_deg):
    free, dialled = (told(tmp_path, track_step_deg=step)[0] for step in (0.0, step_deg))
    change = math.degrees(dialled["turn_rad"] - free["turn_rad"])
    assert 0.0 < abs(change) <= 0.5 * step_deg
    table = run(scene(tmp_path, track_step_deg=step_deg))["truth"]
    own = table.filter(table["target"].is_null())
    before = own.filter(own["time_s"].to_numpy() == dialled["time_s"])["heading_rad"][0].as_py()
    to_deg = math.degrees(before + dialled["turn_rad"]) % 360.0
    # Its own track is one on the sphere of the alerting, up to 0.2 deg off.
    assert abs(math.remainder(to_deg, step_deg)) < 0.2


@covers("chooses", of=KIND)
def test_the_bands_may_be_those_of_before_the_time_to_execute(tmp_path):
    """An intruder comes nearer: the way out of earlier bands is shorter, and the pause differs."""
    quick = {"coordination_s": 2.0, "execution_delay_s": 9.0, "goes_beyond": False}
    late = told(tmp_path, **quick)
    early = told(tmp_path, chooses="before_executing", **quick)
    assert early[0]["time_s"] == late[0]["time_s"]
    at_once = told(tmp_path, **{**quick, "execution_delay_s": 0.0})
    assert early[0]["turn_rad"] == at_once[0]["turn_rad"] != late[0]["turn_rad"]


@covers("eases_deg", of=KIND)
def test_an_eased_turn_leads_to_a_track_and_the_ownship_flies_it(tmp_path):
    plain, eased = (run(scene(tmp_path, eases_deg=eases)) for eases in (0.0, 8.0))
    one, other = rows(plain, "manoeuvres")[0], rows(eased, "manoeuvres")[0]
    assert one["eases_rad"] == 0.0 == other["turn_rad"]
    assert other["eases_rad"] == pytest.approx(math.radians(8.0))
    heading = {}
    for name, found in (("plain", plain), ("eased", eased)):
        own = found["truth"].filter(found["truth"]["target"].is_null())
        own = own.filter(np.abs(own["time_s"].to_numpy() - one["time_s"] - 2.0) < 0.5)
        heading[name] = own["heading_rad"].to_numpy()[0]
    assert heading["plain"] != heading["eased"]


def test_a_turn_that_would_not_settle_is_refused(tmp_path):
    with pytest.raises(SceneError, match=r"eases_deg = 5.0: it must be 0, or at least 6"):
        dsa_des.load_scene(scene(tmp_path, eases_deg=5.0))
