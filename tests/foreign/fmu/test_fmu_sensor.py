"""A sensor that somebody ships as an FMU: fused and tracked as any of ours."""

import math

import numpy as np
import pymap3d
import pytest
from covering import covers
from crooked import TARGETS
from scipy.spatial.transform import Rotation
from wired import chain

import dsa_des
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

FMU = ("foreign.fmu",)
_NAMES = [target["name"] for target in TARGETS][:2]
_IN = {"azimuth": "body_azimuth_rad", "elevation": "body_elevation_rad", "range": "range_m"}


@pytest.fixture
def eye(tmp_path):
    """Build the sensor in the test's folder."""
    import c_eyes

    return lambda version=3: c_eyes.eye_fmu(tmp_path, version)


def scene(path, version=3, *, duration_s=4, **keys):
    """A scene whose only sensor is the FMU, on a banked ownship that heads 217°."""
    found = chain({}, duration_s=duration_s, fusion={"type": "fusion.pass_through"},
                  tracker={"type": "tracking.ekf"})  # fmt: skip
    inputs = {}
    for what, column in _IN.items():
        name = f"{what}_in" if version == 3 else f"plane[*].{what}_in"
        inputs[name] = f"transform.{column}[*]"
        if "targets" not in keys:  # the same, one by one
            del inputs[name]
            name = name if "*" in name else f"{name}[*]"
            for i, target in enumerate(_NAMES, start=1):
                inputs[name.replace("*", str(i))] = f"transform.{column}[{target}]"
    said = {"detected": "seen", "azimuth_rad": "azimuth", "elevation_rad": "elevation",
            "range_m": "range"}  # fmt: skip
    if version == 2:
        said = {name: f"plane[*].{output}" for name, output in said.items()}
    said |= {"azimuth_error_rad": 0.002, "elevation_error_rad": 0.002, "range_variance_m2": 25.0}
    found["blocks"]["eye"] = {
        "type": "foreign.fmu", "file": str(path), "scan_rate_hz": 5, "inputs": inputs,
        "detections": said, **keys,
    }  # fmt: skip
    found["wires"] += ["transform -> eye", "eye.detections -> fusion"]
    return found


def expected(run):
    """Azimuth, elevation (body axes) and range of each target at each instant, from the truth."""
    found = {}
    own = {row["tick"]: row for row in run.truth.to_pylist() if row["target"] is None}
    for row in run.truth.to_pylist():
        if row["target"] is None:
            continue
        me = own[row["tick"]]
        ned = pymap3d.geodetic2ned(*(r[n] for r in (row, me) for n in ("lat_deg", "lon_deg",
                                                                       "alt_m")))  # fmt: skip
        turn = Rotation.from_euler("ZYX", [me["heading_rad"], me["pitch_rad"], me["roll_rad"]])
        x, y, z = turn.inv().apply(ned)
        far = math.sqrt(x * x + y * y + z * z)
        found[row["tick"], row["target"]] = math.atan2(y, x), math.asin(-z / far), far
    return found


@covers("detections", "targets", of=FMU)
@pytest.mark.parametrize("version", [2, 3])
def test_what_it_sees_is_fused_in_body_axes_under_the_names_it_is_given(eye, version):
    found = scene(eye(version), version, targets=_NAMES, start={"reach": 2500.0})
    found["record"] = {"truth": True}
    run = dsa_des.run(found)
    truth = expected(run)
    rows = run.fused.to_pylist()
    assert {row["target"] for row in rows} == {*_NAMES} and len(rows) > 25
    for row in rows:
        azimuth, elevation, far = truth[row["tick"], row["target"]]
        assert row["azimuth_rad"] == pytest.approx(azimuth, abs=1e-6)
        assert row["elevation_rad"] == pytest.approx(elevation, abs=1e-6)
        assert row["range_m"] == pytest.approx(far, rel=1e-6) and far < 2500.0
        # What is true of it is known, for metrics.
        assert row["true_azimuth_rad"] == pytest.approx(azimuth, abs=1e-6)
        assert row["true_range_m"] == pytest.approx(far, rel=1e-6)
    near = {key for key, (_, _, far) in truth.items() if key[1] in _NAMES and far < 2500.0}
    assert {(row["tick"], row["target"]) for row in rows} == near


def test_a_tracker_takes_it_as_any_sensor_of_ours(eye):
    """Nobody says whose they are: tracks stand where the aircraft truly are, and are as sure."""
    found = scene(eye(), duration_s=6, latency_s=0.3)
    found["blocks"]["eye"]["detections"] |= {
        "range_rate_m_s": "rate", "range_rate_error_m_s": 2.0
    }  # fmt: skip
    found["record"] = {"truth": True}
    run = dsa_des.run(found)
    last = [row for row in run.state_tracks.to_pylist() if row["time_s"] > 5.4]
    assert {row["track_status"] for row in last} == {"confirmed"}
    there = {(row["tick"], row["target"]): row for row in run.truth.to_pylist()}
    per_s = 10**9
    seen = set()
    for row in last:
        at = round(row["state_s"] * per_s)
        origin = [row[f"origin_{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]
        apart = {}
        for name in _NAMES:
            truth = there[at, name]
            ned = pymap3d.geodetic2ned(truth["lat_deg"], truth["lon_deg"], truth["alt_m"], *origin)
            state = np.array([row["north_m"], row["east_m"], row["down_m"]])
            apart[name] = float(np.linalg.norm(state - np.array(ned)))
        name = min(apart, key=apart.get)
        seen.add(name)
        assert apart[name] < 3.0
        moves = there[at, name]
        for axis in ("north", "east", "down"):
            assert row[f"{axis}_m_s"] == pytest.approx(moves[f"velocity_{axis}_m_s"], abs=5.0)
    assert seen == set(_NAMES)
    # The range rate is weighed, as the ownship's own velocity is known: three or four quantities.
    assert {row["nis_freedom"] for row in last} == {4}
    assert all(row["time_s"] == pytest.approx(row["state_s"] + 0.3) for row in last)
    own = next(row for row in run.truth.to_pylist() if row["target"] is None and row["tick"] == 0)
    scans = [row for row in run.scans.to_pylist() if row["block"] == "eye"]
    assert len(scans) == 30 and [row["scan"] for row in scans] == list(range(30))
    for axis in ("north", "east", "down"):
        told = scans[0][f"own_velocity_{axis}_m_s"]
        assert told == pytest.approx(own[f"velocity_{axis}_m_s"], abs=1e-4)


@pytest.mark.parametrize("late", [0, 1])
def test_the_own_velocity_is_that_of_each_look(eye, late):
    """A line of sight that comes late, by so many looks, is of where the ownship was then.

    Before it has come nobody knows from where the sensor looks: it has no look to report.
    """
    found = scene(eye(), duration_s=6)
    found["wires"][0] = "transform -> gate"
    found["wires"] += [{"from": "traffic", "to": "transform", "delay_s": 0.2 * late}]
    own = found["blocks"]["traffic"]["ownship"]
    for name in ("yaw_deg", "pitch_deg", "roll_deg"):
        own.pop(name)
    own["legs"] = [{"kind": "turn", "rate_deg_s": 6, "angle_deg": 120}, {"kind": "straight"}]
    found["blocks"]["eye"]["detections"] |= {"range_rate_m_s": "rate"}
    found["record"] = {"truth": True}
    run = dsa_des.run(found)
    truth = {row["tick"]: row for row in run.truth.to_pylist() if row["target"] is None}
    scans = [row for row in run.scans.to_pylist() if row["block"] == "eye"]
    assert [row["scan"] for row in scans] == list(range(late, 30))
    for row in scans:
        tick = row["tick"] - late * 200_000_000
        for axis in ("north", "east", "down"):
            moves = truth[tick][f"velocity_{axis}_m_s"]
            error = 0.06 if tick == 0 else 0.01  # a flight that begins has one side
            assert row[f"own_velocity_{axis}_m_s"] == pytest.approx(moves, abs=error)
    assert abs(scans[0]["own_velocity_north_m_s"] - scans[-1]["own_velocity_north_m_s"]) > 20


def test_windows_change_nothing_and_its_pose_is_the_believed_one(eye):
    found = scene(eye(), start={"reach": 2500.0})
    found["navigation"] = {"attitude_bias_deg": [3.0, 0.0, 0.0]}
    found["wires"] += ["traffic -> eye"]  # whose truth does not stand in for the belief
    tables = []
    for window in (None, 1, 7):
        sink = MemorySink()
        loaded = dsa_des.load_scene(found)
        Simulation(loaded, window=window, recorder=Recorder([sink])).run()
        tables.append(sink.tables())
    for other in tables[1:]:
        for name, table in other.items():
            assert table.equals(tables[0][name]), name
    rows = tables[0]["scans"].to_pylist()
    headings = {row["own_heading_rad"] for row in rows if row["block"] == "eye"}
    assert all(abs(math.degrees(h) % 360 - 222.0) > 1e-3 for h in headings)


def test_in_a_loop_it_looks_ahead_and_is_taken_back(eye):
    found = scene(eye(), targets=_NAMES, duration_s=20)
    found["blocks"] |= {
        "fusion": {"type": "fusion.pick_best"}, "tracker": {"type": "tracking.stub"},
        "avoid": {"type": "avoidance.turn_away", "range_km": 1.9, "turn_deg": 45},
    }  # fmt: skip
    found["blocks"]["eye"]["detections"] |= {"range_rate_m_s": "rate"}
    found["wires"] += [
        "tracker -> avoid", {"from": "avoid", "to": "traffic", "delay_s": 0.7, "holds": "nothing"}
    ]  # fmt: skip
    tables = []
    for window in (None, 1):
        sink = MemorySink()
        simulation = Simulation(dsa_des.load_scene(found), window=window, recorder=Recorder([sink]))
        outcome = simulation.run()
        assert ("eye" in outcome.windowed) == (window is None)
        tables.append(sink.tables())
    assert tables[0]["manoeuvres"]["tick"][0].as_py() > 0
    for name, table in tables[1].items():
        assert table.equals(tables[0][name]), name


def test_what_the_fmu_says_of_its_errors_goes_before_what_the_scene_says(eye):
    found = scene(eye())
    found["blocks"]["eye"]["detections"] |= {
        "azimuth_error_rad": "sigma", "range_variance_m2": "spread",
        "azimuth_rad": ["azimuth[2]", "azimuth[1]"], "elevation_rad": ["elevation[2]",
                                                                       "elevation[1]"],
        "range_m": ["range[2]", "range[1]"], "detected": ["seen[2]", "seen[1]"],
        "confidence": 7.5,
    }  # fmt: skip
    found["blocks"]["eye"]["targets"] = _NAMES[::-1]
    run = dsa_des.run(found)
    plain = dsa_des.run(scene(eye(), targets=_NAMES))
    rows, others = (
        sorted(r.detections.to_pylist(), key=lambda row: (row["tick"], row["target"]))
        for r in (run, plain)
    )
    assert len(rows) == len(others) == 40
    for row, other in zip(rows, others, strict=True):
        assert (row["target"], row["range_m"]) == (other["target"], other["range_m"])
        assert row["azimuth_variance_rad2"] == pytest.approx(math.radians(0.1) ** 2)
        assert other["azimuth_variance_rad2"] == pytest.approx(0.002**2)
        assert row["range_variance_m2"] == 25.0 and row["confidence"] == 7.5


@pytest.mark.parametrize("range_m", [0.0, -1.0])
def test_a_range_that_is_not_above_0_is_none(eye, range_m):
    found = scene(eye(), targets=_NAMES, duration_s=1)
    found["blocks"]["eye"]["detections"] |= {"range_m": range_m}
    rows = dsa_des.run(found).detections.to_pylist()
    assert len(rows) == 10
    assert {(row["range_m"], row["range_variance_m2"]) for row in rows} == {(None, None)}


def test_it_offers_the_errors_that_are_always_the_same(eye):
    found = scene(eye())
    found["blocks"]["eye"]["detections"] |= {"elevation_error_rad": 0.005,
                                             "range_variance_m2": "spread"}  # fmt: skip
    simulation = Simulation(dsa_des.load_scene(found))
    offer = simulation.components["eye"].offer("detections")
    assert offer.azimuth_variance_rad2 == pytest.approx(0.002**2)
    assert offer.elevation_variance_rad2 == pytest.approx(0.005**2)
    # That of a cell whose width is the larger one's.
    assert offer.resolution_rad == pytest.approx(math.sqrt(12.0) * 0.005)
    assert offer.measures_range and not offer.measures_range_rate
    assert offer.range_variance_m2 is None  # the FMU says it, look by look
    for component in simulation.components.values():
        component.close()


def test_text_and_enumerations_of_fmi_2(eye):
    found = scene(eye(2), 2, start={"label": "Auge 1", "mode": "shut"}, outputs=["echo"])
    run = dsa_des.run(found)
    said = {row["text"] for row in run["signals"].to_pylist() if row["signal"] == "echo"}
    assert said == {"Auge 1"} and run.fused.num_rows == 0
    found["blocks"]["eye"]["start"]["mode"] = "shutt"
    with pytest.raises(SceneError, match="must be one of looking, shut; did you mean 'shut'"):
        dsa_des.load_scene(found)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"azimuth": "azimuth"}, "there is no 'azimuth'; did you mean 'azimuth_rad'"),
        ({"range_m": "rnge"}, "detections.range_m: eye.fmu has no variable 'rnge'; did you mean"),
        ({"range_m": "azimuth"}, "is in 'deg', which 'm' cannot be made into"),
        ({"range_m": "range[3]"}, "has the elements 1 to 2"),
        ({"range_m": "plane[*].range"}, "has no variables 'plane[*].range'"),
        ({"range_m": ["range", "range"]}, "has 2 values where there are 4"),
        ({"range_error_m": 3.0}, "range_error_m and range_variance_m2 say the same"),
        ({"own_lat_deg": 3.0}, "own_lat_deg is of no use without own_lon_deg"),
        ({"elevation_rad": None}, "elevation_rad is needed"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(eye, keys, said):
    found = scene(eye())
    given = found["blocks"]["eye"]["detections"] | keys
    found["blocks"]["eye"]["detections"] = {n: v for n, v in given.items() if v is not None}
    with pytest.raises(SceneError) as error:
        dsa_des.load_scene(found)
    assert said in str(error.value)


def test_targets_are_those_of_the_scene_and_one_for_each(eye):
    found = scene(eye(), targets=_NAMES)
    del found["blocks"]["eye"]["targets"]
    with pytest.raises(SceneError, match=r"'azimuth_in' is .*: targets must name them"):
        dsa_des.load_scene(found)
    with pytest.raises(SceneError, match="has 1 names where there are 2 detections"):
        dsa_des.load_scene(scene(eye(), targets=["rolling"]))
    with pytest.raises(SceneError, match="'rollin' is not in the scene; did you mean 'rolling'"):
        dsa_des.run(scene(eye(), targets=["rollin", "diving"]))


def test_what_it_detects_has_a_direction(eye):
    found = scene(eye())
    found["blocks"]["eye"]["detections"] |= {"elevation_rad": 2.0}
    with pytest.raises(BlockFailure, match=r"detections\.elevation_rad is 2 for what it detected"):
        dsa_des.run(found)


@pytest.mark.parametrize(("range_km", "times"), [(0.001, 10), (20.0, 0)])
def test_an_input_that_nothing_comes_to_is_counted(eye, range_km, times):
    """A radar that is to say how far two targets are has never seen anybody."""
    found = scene(eye(), targets=_NAMES, duration_s=1)
    found["blocks"]["radar"] = {
        "type": "radar.range_boundary", "range_km": range_km, "scan_rate_hz": 5,
    }  # fmt: skip
    found["blocks"]["eye"]["inputs"]["range_in"] = "radar.range_m[*]"
    found["wires"] += ["gate -> radar", "radar -> eye"]
    counted = Simulation(dsa_des.load_scene(found)).run().failure_counts["eye"]
    what = "inputs.range_in has had nothing from radar and keeps its start value"
    assert counted.pop(what) == (times, 10)
    assert list(counted.values()) == [(0, 10), (0, 10)]
