"""What displays show of several platforms, and of one: whose eyes, and in whose colour."""

import numpy as np
import pymap3d
import pytest
from equipped import SURE_RADAR, TURN_AWAY, scene_of

import dsa_des
from components.cdti.scope import Scope
from components.display.alerted import Alerted
from components.display.outcomes import platform_by_block
from components.display.picture_plane import held_range_rows_and_positions
from components.display.recorded_run import tables_of
from components.display.symbols import platform_colours, recolour_by_platform, sensor_marks
from components.view.run_picture import run_picture
from dsa_des.embed import Simulator
from dsa_des.errors import UsageError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 50}
B = {"name": "b", "east_m": 2000, "north_m": 1500, "up_m": 30, "heading_deg": 270, "speed_mps": 60}
FINE = SURE_RADAR | {"azimuth_resolution_deg": 0.2, "elevation_resolution_deg": 0.2,
                     "range_resolution_m": 20}  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    decider = TURN_AWAY | {"range_km": 9}
    chains = {"": None, "_b": "b"}
    return scene_of(OWN, [B], chains, radar=FINE, decider=decider, decides_by="tracker",
                    duration_s=8)  # fmt: skip


@pytest.fixture(scope="module")
def folder(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("eyes") / "run"
    dsa_des.run(scene, out=out)
    return out


def ends(picture, name="tracks"):
    table = picture.tables[name]
    return np.column_stack((table["east_m"], table["north_m"]))


def test_a_page_shows_what_each_has_where_it_is(folder):
    """Tracks end at who is tracked, wherever the tracker was: b is 2.5 km from the ownship."""
    whole, mine, theirs = (run_picture(folder, on) for on in (None, "ownship", "b"))
    east, north, _ = pymap3d.geodetic2enu(
        *pymap3d.enu2geodetic(2000, 1500, 30, 52, 4.4, 1000), 52, 4.4, 1000
    )
    assert ends(mine)[:2] == pytest.approx(np.array([[east, north]] * 2), abs=150.0)
    assert ends(theirs)[:2] == pytest.approx(np.array([[-east, -north]] * 2), abs=150.0)
    source = whole.tables["tracks"]["source"]
    assert [whole.trackers[k] for k in np.unique(source)] == ["tracker", "tracker_b"]
    assert ends(whole)[source == 0] == pytest.approx(ends(mine))
    own = whole.tables["own"]
    flown = np.column_stack((own["east_m"], own["north_m"]))[: (source == 1).sum()]
    assert ends(whole)[source == 1] == pytest.approx(flown, abs=150.0)
    assert theirs.targets == ["ownship"] and mine.targets == ["b"]
    assert theirs.tables["own"]["alt_m"][0] == pytest.approx(1030.0, abs=1.0)
    assert theirs.facts["seen from"] == "b" and "seen from" not in whole.facts
    assert len(theirs.tables["manoeuvres"]["time_s"]) == 1


def test_sensors_have_the_colour_of_what_carries_them(scene, folder):
    """And fields of view, which are drawn about that."""
    whole, theirs = run_picture(folder), run_picture(folder, "b")
    (mine, other), (alone,) = whole.sensors, theirs.sensors
    assert (mine["on"], other["on"], alone["on"]) == ("ownship", "b", "b")
    assert mine["colour"] != other["colour"] == alone["colour"]
    assert mine["range_m"] == other["range_m"] == alone["range_m"] == 9000.0
    simulation = Simulation(scene)
    carrying = platform_by_block(simulation)
    assert list(platform_colours(carrying.values())) == ["ownship", "b"]
    styles = sensor_marks(["radar", "radar_b"], simulation.components, carrying)
    assert [styles[name].colour for name in styles] == [mine["colour"], other["colour"]]
    assert recolour_by_platform(styles, {}, platform_colours([])) == styles
    told = Alerted.read(folder).manoeuvres
    assert {*told} == {"ownship", "b"} and all(len(times_s) == 1 for times_s in told.values())


def test_a_display_is_that_of_one_platform(scene):
    recorder = Recorder([MemorySink()])
    simulation = Simulation(scene, recorder=recorder)
    scopes = {on: Scope(simulation, on) for on in (None, "ownship", "b")}
    recorder.listeners += [scope.store_message for scope in scopes.values()]
    simulation.run()
    shown = {on: scope.page_content(8.0) for on, scope in scopes.items()}
    assert shown[None] == shown["ownship"]
    assert [scopes[on].names for on in ("ownship", "b")] == [["b"], ["ownship"]]
    assert [one["name"] for one in scopes["b"].sensors] == ["radar_b"]
    assert [round(shown[on]["own"]["alt"]) for on in ("ownship", "b")] == [1000, 1030]
    apart = [shown[on]["contacts"][0][1:3] for on in ("ownship", "b")]
    assert apart[0] == pytest.approx([-x for x in apart[1]], abs=150.0)
    with pytest.raises(UsageError, match="nothing of this scene is carried by it; did you"):
        Scope(simulation, "bb")


def test_a_host_is_what_carries_a_chain():
    """Its chain alone, on the ownship, gives the same."""
    tables = scene_of(OWN, [B], {"": None, "_b": "b"}, radar=FINE, duration_s=8).resolved()
    for suffix in ("", "_b"):
        del tables["blocks"][f"alerting{suffix}"], tables["blocks"][f"decider{suffix}"]
    tables["wires"] = [w for w in tables["wires"] if "alert" not in str(w) and "dec" not in str(w)]
    alone = {**tables, "wires": [w for w in tables["wires"] if "_b" in str(w)]}
    alone["blocks"] = {n: b for n, b in tables["blocks"].items() if n == "traffic" or "_b" in n}
    alone["blocks"]["transform_b"] = {"type": "geometry.ellipsoid"}
    found = []
    for of, platform in ((tables, "b"), (alone, None)):
        simulator = Simulator(dsa_des.load_scene(of), platform=platform)
        simulator.add_plane("ownship")
        found.append(simulator.simulate(
            [0.9, 0.07, 1000], [0.3, 0, 0], [0.9003, 0.0701, 990], [0, 0, 0], 0.0
        ))  # fmt: skip
    assert found[0]["ownship"].sensors == ("radar_b",)
    assert found[0].detected == pytest.approx(found[1].detected, rel=0, abs=0)
    with pytest.raises(dsa_des.SceneError, match="carried by 'bb'; did you mean 'b'"):
        Simulator(dsa_des.load_scene(tables), platform="bb")


#: In the south, banked, across the date line; none is called ownship, and a site is first by name.
ZULU = {"name": "zulu", "lat_deg": -41.3, "lon_deg": 179.98, "alt_m": 2200, "heading_deg": 217,
        "speed_mps": 70, "roll_deg": -20, "pitch_deg": 6}  # fmt: skip
BRAVO = {"name": "bravo", "lat_deg": -41.33, "lon_deg": 179.93, "alt_m": 2230, "heading_deg": 60,
         "speed_mps": 60, "roll_deg": 15}  # fmt: skip
SITE = {"name": "airport", "lat_deg": -41.35, "lon_deg": 179.95, "alt_m": 30, "yaw_deg": 30}


@pytest.mark.parametrize("own", [{}, {"": None}], ids=["carries nothing", "carries a chain"])
def test_tracks_go_out_to_other_programs_from_where_they_were_measured(own):
    """By the truth and pymap3d: what is measured to a metre ends where the target was."""
    exact = SURE_RADAR | {"range_km": 20, "errors": "stated", "quantised": False}
    exact |= {"azimuth_error_deg": 1e-3, "elevation_error_deg": 1e-3, "range_error_m": 1}
    chains = own | {"_b": "bravo", "_s": "airport"}
    tables = scene_of(ZULU, [BRAVO], chains, radar=exact, duration_s=5).resolved()
    tables["blocks"]["traffic"]["sites"] = [SITE]
    blocks = [name for name in tables["blocks"] if name.startswith(("alerting", "decider"))]
    for name in blocks:
        del tables["blocks"][name]
    tables["wires"] = [w for w in tables["wires"] if not any(name in str(w) for name in blocks)]
    run = tables_of(dsa_des.run(dsa_des.load_scene(tables)))
    assert run.own_name == "zulu" and next(iter(run.true_flights())) == "zulu"
    rows, places = held_range_rows_and_positions(run)
    about = np.array([run.texts("tracks", name) for name in ("block", "target")])[:, rows].T
    seen = {"tracker": {"bravo"}, "tracker_b": {"zulu"}, "tracker_s": {"zulu", "bravo"}}
    assert {(a, b) for a, b in about.tolist()} == {
        (f"tracker{suffix}", name) for suffix in chains for name in seen[f"tracker{suffix}"]
    }
    for (_, target), when_s, place in zip(
        about.tolist(), run.numbers("tracks", "measured_s")[rows], places.T, strict=True
    ):
        flown = run.true_flights()[target]
        at = int(np.flatnonzero(flown["time_s"] == when_s)[0])
        true = [flown[name][at] for name in ("lat_deg", "lon_deg", "alt_m")]
        apart = np.subtract(pymap3d.geodetic2ecef(*place), pymap3d.geodetic2ecef(*true))
        assert np.linalg.norm(apart) < 10.0
