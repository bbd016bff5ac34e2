"""A recorded run as Stone Soup's objects: its own models see the truth where we measured it."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pymap3d
import pytest

pytest.importorskip("stonesoup", reason="needs the extra stonesoup")

import crooked
from wired import HEARS_ALL, chain, rows, run

from components.estimation.frame import pose_in_frame
from components.export import stone_soup
from components.stone_soup.objects import roll_pitch_yaw_rad
from dsa_des.errors import UsageError

START = datetime(2000, 1, 1)
FINE = {"errors": "stated", "quantised": False, "azimuth_error_deg": 1e-5,
        "elevation_error_deg": 2e-5}  # fmt: skip
RADAR = {"type": "radar.range_boundary", "scan_rate_hz": 2, "range_km": 20.0, **FINE,
         "range_error_m": 0.01}  # fmt: skip
CAMERA = {"type": "optical.range_boundary", "scan_rate_hz": 3, "range_km": 2.5, **FINE}


BLIND = {**CAMERA, "scan_rate_hz": 1, "range_km": 0.01}


def scene(**sections):
    return chain(
        {"radar": RADAR, "camera": CAMERA, "blind": BLIND}, duration_s=2,
        fusion={"type": "fusion.pass_through"}, **sections,
    )  # fmt: skip


@pytest.fixture(scope="module")
def recorded():
    return stone_soup(run(scene()))


def enu(flight, time_s, origin):
    """Where a crooked flight is by pymap3d."""
    return np.array(pymap3d.ecef2enu(*crooked.position(flight, time_s), *origin))


def test_detections_are_those_of_the_true_places(recorded):
    """The measurement model of each, asked for the target by pymap3d, gives what was measured."""
    worst, sizes = 0.0, set()
    for when, found in recorded.detector:
        time_s = (when - START).total_seconds()
        for detection in found:
            spread = np.sqrt(np.diag(detection.measurement_model.noise_covar))
            apart = []
            for target in crooked.TARGETS:
                state = np.zeros((6, 1))
                state[[0, 2, 4], 0] = enu(target, time_s, recorded.origin)
                seen = detection.measurement_model.function(_State(state), noise=False)
                apart.append([float(v) for v in ((detection.state_vector - seen)[:, 0] / spread)])
            worst = max(worst, min(np.abs(one).max() for one in apart))
            sizes.add((detection.metadata["sensor"], len(spread)))
            assert set(detection.metadata) == {"sensor", "scan"}
            assert detection.timestamp == when
    assert sizes == {("radar", 3), ("camera", 2)}
    assert 0.5 < worst < 5.0


class _State:
    def __init__(self, vector):
        from stonesoup.types.array import StateVector

        self.state_vector = StateVector(vector[:, 0])


def test_variances_are_those_of_elevation_azimuth_and_range(recorded):
    radar = {np.diag(d.measurement_model.noise_covar).tobytes(): d
             for _, found in recorded.detector for d in found
             if d.metadata["sensor"] == "radar"}  # fmt: skip
    (one,) = radar.values()
    known = [np.radians(2e-5) ** 2, np.radians(1e-5) ** 2, 0.01**2]
    np.testing.assert_allclose(np.diag(one.measurement_model.noise_covar), known, rtol=1e-9)


def test_looks_come_in_order_with_those_in_vain(recorded):
    looks = [(when, [d.metadata["sensor"] for d in found]) for when, found in recorded.detector]
    assert [when for when, _ in looks] == sorted(when for when, _ in looks)
    # Radar at 0, 0.5, ... and camera at 0, 1/3, ...: ten looks, the radar's first at 0 and 1 s.
    # The blind camera's, at 0 and 1 s, are all in vain.
    assert len(looks) == 4 + 6 + 2
    assert [names for _, names in looks[:3]] == [["radar"] * 2, [], ["camera"]]
    assert looks[2][0] == START and looks[3][0] == START + timedelta(microseconds=333_333)


def test_truth_and_platform_are_where_they_are(recorded):
    assert {path.id for path in recorded.truth} == {"rolling", "diving"}
    for path in recorded.truth:
        flight = next(t for t in crooked.TARGETS if t["name"] == path.id)
        for time_s in (0.0, 1.5):
            at = path[START + timedelta(seconds=time_s)].state_vector[:, 0]
            near = [enu(flight, time_s + h, recorded.origin) for h in (0.0, 0.01)]
            np.testing.assert_allclose(at[[0, 2, 4]], near[0], atol=0.02)
            np.testing.assert_allclose(at[[1, 3, 5]], (near[1] - near[0]) / 0.01, atol=0.05)
    place = recorded.platform[START + timedelta(seconds=1)]
    np.testing.assert_allclose(
        place.state_vector[[0, 2, 4], 0], enu(crooked.OWNSHIP, 1.0, recorded.origin), atol=0.02
    )
    own = recorded.ownship[START + timedelta(seconds=1)].state_vector
    np.testing.assert_allclose(np.array(place.state_vector), np.array(own), atol=1e-6)
    roll, pitch, yaw = np.degrees(np.array(place.metadata["orientation"], dtype=float))[:, 0]
    assert (roll, pitch) == pytest.approx((-27.0, 8.0), abs=1e-3)
    assert yaw % 360.0 == pytest.approx((90.0 - 222.0) % 360.0, abs=1e-3)
    assert recorded.origin == pytest.approx((-41.3, -179.9997, 2400.0))


@pytest.mark.parametrize("pitch_deg", [8.0, 90.0, -90.0])
def test_angles_stand_for_the_same_rotation(pitch_deg):
    from stonesoup.functions import build_rotation_matrix

    origin, here = (-41.0, 179.8, 0.0), (-41.3, -179.9997, 2400.0)
    columns = [np.array([v]) for v in (*origin, *here, *np.radians([222.0, pitch_deg, -27.0]))]
    place = pose_in_frame(tuple(columns[:3]), tuple(columns[3:6]), tuple(columns[6:]))
    got = build_rotation_matrix(roll_pitch_yaw_rad(place.to_body))
    to_ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    known = np.diag([1, -1, -1]) @ place.to_body[:, :, 0] @ to_ned
    np.testing.assert_allclose(got, known, atol=2e-9)


def without_poses(one):
    """A run of a stranger's sensor, which tells no pose."""
    import pyarrow as pa

    table = one["scans"]
    for place, name in enumerate(table.column_names):
        if name.startswith("own_"):
            none = table.schema.field(name).with_type(pa.float64())
            table = table.set_column(place, none, pa.nulls(len(table), pa.float64()))
    return replace(one, tables={**one.tables, "scans": table})


def test_what_has_no_errors_or_poses_is_refused(tmp_path):
    exact = scene()
    exact["blocks"]["camera"] = {**CAMERA, "azimuth_error_deg": 0.0}
    with pytest.raises(UsageError, match="camera states no error of its azimuth_rad"):
        stone_soup(run(exact))
    unknown = without_poses(run(chain({"radar": RADAR}, duration_s=1, record={"truth": False})))
    with pytest.raises(UsageError, match=r"no pose of the ownship and there is no truth\.parquet"):
        stone_soup(unknown)
    with pytest.raises(UsageError, match="there is no such folder"):
        stone_soup(tmp_path / "nothing")
    empty = run(chain({"radar": {**RADAR, "range_km": 0.1}}, duration_s=1))
    with pytest.raises(UsageError, match="has no detections"):
        stone_soup(empty)


def test_poses_are_the_true_ones_where_none_is_told():
    one = run(chain({"radar": RADAR}, duration_s=1))
    known, guessed = stone_soup(one), stone_soup(without_poses(one))
    for (_, told), (_, taken) in zip(known.detector, guessed.detector, strict=True):
        for a, b in zip(sorted(told, key=hash), sorted(taken, key=hash), strict=True):
            assert (
                a.measurement_model.rotation_offset == b.measurement_model.rotation_offset
            ).all()
            np.testing.assert_allclose(
                np.array(a.measurement_model.translation_offset, dtype=float),
                np.array(b.measurement_model.translation_offset, dtype=float), atol=1e-6,
            )  # fmt: skip


def test_range_rates_are_those_of_both_velocities():
    """Asked for: the model gives the rate of crooked flights, whose ownship moves as well."""
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRangeRate

    doppler = {**HEARS_ALL, "azimuth_resolution_deg": 0.05, "elevation_resolution_deg": 0.05,
               "range_resolution_m": 2.0, "measures_range_rate": True,
               "range_rate_resolution_m_s": 0.02}  # fmt: skip
    one = run(chain({"radar": doppler}, duration_s=1, fusion={"type": "fusion.pass_through"}))
    plain, rated = stone_soup(one), stone_soup(one, range_rates=True)
    assert {d.measurement_model.ndim_meas for _, found in plain.detector for d in found} == {3}
    ((_, found),) = rated.detector
    assert len(found) == 2
    for detection in found:
        assert isinstance(detection.measurement_model, CartesianToElevationBearingRangeRate)
        apart = []
        for target in crooked.TARGETS:
            state = np.zeros((6, 1))
            near = [enu(target, h, rated.origin) for h in (0.0, 0.01)]
            state[[0, 2, 4], 0], state[[1, 3, 5], 0] = near[0], (near[1] - near[0]) / 0.01
            seen = detection.measurement_model.function(_State(state), noise=False)
            ranges = [np.linalg.norm(crooked.body(target, h)) for h in (0.0, 0.01)]
            rate = (ranges[1] - ranges[0]) / 0.01
            assert float(seen[3, 0]) == pytest.approx(rate, abs=0.05)
            apart.append(abs(float(detection.state_vector[3, 0]) - rate))
        assert min(apart) < 0.05


def test_each_detection_of_turned_radars_has_its_own_instant_and_errors():
    """Where a beam meets a target it is by then; errors turn with where in the field it is seen."""
    turned = {**RADAR, "scan_rate_hz": 0.5, "azimuth_error_deg": 9e-5, "mount_azimuth_deg": -35.0,
              "mount_elevation_deg": 21.0, "mount_roll_deg": -75.0}  # fmt: skip
    radars = {"still": turned, "swept": {**turned, "beam_sweep": True}}
    one = run(chain(radars, duration_s=2, fusion={"type": "fusion.pass_through"}))
    told = {row["range_m"]: row for row in rows(one)}
    soup = stone_soup(one)
    looks = []
    for when, found in soup.detector:
        looks += [when] * bool(found)
        for detection in found:
            range_m = float(detection.state_vector[2, 0])
            apart = []
            for target in crooked.TARGETS:
                state = np.zeros((6, 1))
                state[[0, 2, 4], 0] = enu(target, (when - START).total_seconds(), soup.origin)
                seen = detection.measurement_model.function(_State(state), noise=False)
                apart.append(abs(float(seen[2, 0]) - range_m))
            assert min(apart) < 0.1  # a hundredth of a second is a metre
            row = told.pop(range_m)
            names = ("elevation_variance_rad2", "azimuth_variance_rad2", "range_variance_m2")
            spread = np.diag(detection.measurement_model.noise_covar)
            assert spread == pytest.approx([row[name] for name in names], rel=1e-9)
    # Both at once, and then one after the other.
    assert not told and len(looks) == 3 and looks[0] == START < looks[1] < looks[2]
    first, second = (row["azimuth_variance_rad2"] for row in rows(one, block="still"))
    assert abs(first / second - 1.0) > 0.1


def test_of_several_platforms_it_is_what_one_has():
    """Its looks alone, from where it is, and the ownship among the targets."""
    tables = scene()
    tables["blocks"] |= {"there": {"type": "geometry.ellipsoid", "platform": "rolling"},
                         "other": RADAR, "mixed": {"type": "fusion.pass_through"}}  # fmt: skip
    tables["wires"] = [*tables["wires"], "traffic -> there -> other -> mixed"]
    two = run(tables)
    mine, theirs = stone_soup(two), stone_soup(two, platform="rolling")
    for of, sensors, called, others in (
        (mine, {"radar", "camera"}, "ownship", {"rolling", "diving"}),
        (theirs, {"other"}, "rolling", {"ownship", "diving"}),
    ):
        found = {d.metadata["sensor"] for _, looked in of.detector for d in looked}
        assert found == sensors and of.platform.id == of.ownship.id == called
        assert {path.id for path in of.truth} == others
        at = START + timedelta(seconds=1)
        places = [np.array(one[at].state_vector, dtype=float) for one in (of.platform, of.ownship)]
        np.testing.assert_allclose(*places, atol=1e-6)
