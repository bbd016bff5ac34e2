"""Metrics of true flights where several aircraft are steered, against the recorded truth."""

import numpy as np
import pymap3d
import pytest
from covering import covers
from equipped import SURE_RADAR, TURN_AWAY, scene_of
from same_runs import tables_of
from wired import measured

import dsa_des

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 50}
B = {"name": "b", "east_m": 3000, "north_m": 3000, "up_m": 20, "heading_deg": 270, "speed_mps": 50}
C = {"name": "c", "east_m": 3500, "north_m": 2000, "up_m": -40, "heading_deg": 290,
     "speed_mps": 40}  # fmt: skip
BOTH = {"": None, "_b": "b"}
HOW = {"radar": SURE_RADAR | {"scan_rate_hz": 10}, "decider": TURN_AWAY | {"range_km": 2.5},
       "decides_by": "tracker", "duration_s": 80}  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    return scene_of(OWN, [B, C], BOTH, **HOW)


@pytest.fixture(scope="module")
def apart(scene):
    """Slant ranges of every two over time, by name."""
    paths: dict[str, list[np.ndarray]] = {}
    for row in tables_of(scene)[1]["truth"].to_pylist():
        place = pymap3d.geodetic2ecef(row["lat_deg"], row["lon_deg"], row["alt_m"])
        paths.setdefault(row["target"] or "ownship", []).append(np.array(place))
    assert len({len(path) for path in paths.values()}) == 1
    return {
        (one, other): np.linalg.norm(np.array(paths[one]) - np.array(paths[other]), axis=1)
        for one in paths
        for other in paths
    }


@covers("platform", of=("[metric closest_approach]",))
@pytest.mark.parametrize("platform", [None, "ownship", "b", "c"])
def test_the_closest_approach_of_each_is_that_of_the_truth(scene, apart, platform):
    looking = platform or "ownship"
    on = {} if platform is None else {"platform": platform}
    found = measured(scene, {"metric": "closest_approach", **on})
    nearest = min(of.min() for (one, other), of in apart.items() if one == looking != other)
    assert found["closest_approach_m"] == pytest.approx(nearest, abs=3.0)
    for other in {"ownship", "b", "c"} - {looking}:
        found = measured(scene, {"metric": "closest_approach", "target": other, **on})
        nearest = apart[looking, other].min()
        assert found["closest_approach_m"] == pytest.approx(nearest, abs=3.0), other


@covers("platform", of=("[metric mitigated]", "[metric manoeuvres]"))
def test_events_of_each_are_nominal_without_anybody_s_manoeuvres(scene, apart):
    nearest = apart["ownship", "b"].min()
    assert nearest > 250
    for platform, other in (("ownship", "b"), ("b", "ownship")):
        size = {"horizontal_m": 200.0, "vertical_m": 100.0}
        keys = {"metric": "mitigated", "platform": platform, **size}
        found = measured(scene, keys)
        assert found["well_clear_lost_nominal"] == 1.0, other
        assert found["well_clear_lost_mitigated"] == float(
            min(of.min() for (one, to), of in apart.items() if one == platform != to) < 200.0
        )
        counted = measured(scene, {"metric": "manoeuvres", "platform": platform})
        told = tables_of(scene)[1]["manoeuvres"]["block"].to_pylist()
        mine = "decider" if platform == "ownship" else "decider_b"
        assert counted["manoeuvres"] == told.count(mine) > 0


def test_events_between_any_two_are_those_of_the_nearest_two(scene, apart):
    """b and c are nearer to each other than either is to the ownship."""
    between = {pair: of.min() for pair, of in apart.items() if pair[0] != pair[1]}
    nearest, own = between["b", "c"], min(between["ownship", one] for one in "bc")
    assert nearest == min(between.values()) < own - 20.0
    for more_m, lost in ((5.0, 1.0), (-5.0, 0.0)):
        size = {"horizontal_m": nearest + more_m, "vertical_m": 400.0}
        found = [measured(scene, {"metric": "mitigated", "platform": platform, **size})
                 for platform in ("*", "ownship")]  # fmt: skip
        assert [one["well_clear_lost_mitigated"] for one in found] == [lost, 0.0]
    with pytest.raises(dsa_des.SceneError, match="there is no '\\*'"):
        measured(scene, {"metric": "manoeuvres", "platform": "*"})


@covers("platform", of=("[metric risk_ratio]", "[metric severity]", "[metric well_clear]",
                        "[metric alert_times]"))  # fmt: skip
def test_a_pair_is_as_far_apart_for_the_one_as_for_the_other(scene):
    size = {"horizontal_m": 900.0, "vertical_m": 100.0}
    wide = size | {"horizontal_m": 3000.0}
    ours, theirs = (
        measured(
            scene,
            {"metric": "risk_ratio", "platform": platform, **size},
            {"metric": "severity", "target": other, "platform": platform, **wide},
            {"metric": "well_clear", "target": other, "platform": platform, **size},
            {"metric": "alert_times", "target": other, "platform": platform, **size},
        )
        for platform, other in (("c", "b"), ("b", "c"))
    )
    assert ours["well_clear_lost"] == theirs["well_clear_lost"]
    assert ours["slowc_percent"] == pytest.approx(theirs["slowc_percent"], abs=0.5)
    events = measured(scene, {"metric": "mitigated", "platform": "c", **size})
    assert len(events) == 4 and all(ours[name] == value for name, value in events.items())
    # Of alerts each has those on board.
    assert not [name for name in ours if name.startswith("first_alert_time_s")]
    alerting = {name for name in theirs if name.startswith("alert_missed")}
    assert alerting == {"alert_missed.alerting_b"}
    # The ownship is nearer to the one than to the other.
    own = measured(scene, {"metric": "severity", "target": "b", **wide})
    assert abs(own["slowc_percent"] - ours["slowc_percent"]) > 1.0


@covers("platform", of=("[metric tracking]", "[metric track_errors_by_range]"))
def test_tracks_of_each_are_measured_by_what_it_sees_as_all_flew():
    """A radar of small errors: tracks are tens of metres wrong; flights as planned, hundreds."""
    fine = SURE_RADAR | {"azimuth_resolution_deg": 0.2, "elevation_resolution_deg": 0.2,
                         "range_resolution_m": 20}  # fmt: skip
    how = {"radar": fine, "duration_s": 90,
           "tracker": {"type": "tracking.ekf", "acceleration_intensity_m2_s3": 9}}  # fmt: skip
    flown = scene_of(OWN, [B | {"east_m": 4200, "north_m": 4000}], BOTH, **how)
    assert len({*tables_of(flown)[1]["manoeuvres"]["block"].to_pylist()}) == 2
    for platform, tracker in (("ownship", "tracker"), ("b", "tracker_b")):
        by_range = {"metric": "track_errors_by_range", "ranges_nmi": [1.5, 2], "from_s": 1}
        found = measured(
            flown, {"metric": "tracking", "platform": platform},
            {"metric": "tracking", "platform": platform, "block": tracker},
            {**by_range, "platform": platform},
        )  # fmt: skip
        assert found["track_position_error_m"] == found[f"track_position_error_m.{tracker}"] < 80.0
        assert found["track_completeness"] > 0.8 and found["track_spuriousness"] == 0.0
        assert found["track_confirmation_from_coverage_s"] >= 0.0
        assert 1.5 < found["first_track_range_nmi"] < 3.5
    with pytest.raises(dsa_des.SceneError, match="'tracker' tells no tracks"):
        measured(flown, {"metric": "tracking", "platform": "b", "block": "tracker"})


def test_a_platform_that_there_is_not_is_said(scene):
    with pytest.raises(dsa_des.SceneError, match="there is no 'bb'; did you mean 'b'"):
        measured(scene, {"metric": "manoeuvres", "platform": "bb"})
