"""Every key of the trackers reaches what it says, seen in the tracks of scenes."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, SEES_ALL, chain, rows, run

TRACKERS = ("tracking.ekf", "tracking.ukf", "tracking.imm")
RADAR = {**HEARS_ALL, "azimuth_resolution_deg": 0.3, "elevation_resolution_deg": 0.3,
         "range_resolution_m": 5.0}  # fmt: skip
PASS = {"type": "fusion.pass_through"}


def tracks(kind="tracking.ekf", *, sensors=None, targets=(crooked.ROLLING,), duration_s=4, **keys):
    tracker = {"type": kind, **keys}
    scene = chain(sensors or {"radar": RADAR}, targets=targets, duration_s=duration_s, fusion=PASS,
                  tracker=tracker)  # fmt: skip
    return rows(run(scene), "state_tracks")


AWAY = {
    "name": "away", "east_m": -900.0, "north_m": -1200.0, "up_m": 150.0, "heading_deg": 217.0,
    "speed_mps": 130.0,
}  # fmt: skip


def fading(seconds, **keys):
    """Tracks of a target that a radar sees for so many seconds, and then not."""
    scene = chain({"radar": RADAR}, targets=[AWAY], duration_s=12)
    levels = [row["snr_db"] for row in rows(run(scene))]
    falling = levels if levels[0] > levels[-1] else levels[::-1]
    assert falling == levels, "the target must fly away"
    threshold = 0.5 * (levels[seconds - 1] + levels[seconds])
    radar = {**RADAR, "threshold_db": threshold}
    return tracks(sensors={"radar": radar}, targets=[AWAY], duration_s=12, **keys)


@covers("start_climb_m_s", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_a_new_track_knows_how_fast_aircraft_climb(kind):
    first = tracks(kind, start_speed_m_s=33.0, start_climb_m_s=8.0)[0]
    found = [first[f"covariance_{i}{i}_m2_s2"] for i in (3, 4, 5)]
    assert found == pytest.approx([33.0**2, 33.0**2, 8.0**2])


@covers("start_speed_m_s", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_a_first_detection_s_velocity_is_as_uncertain_as_said(kind):
    first = tracks(kind, start_speed_m_s=33.0)[0]
    for name in ("covariance_33_m2_s2", "covariance_44_m2_s2", "covariance_55_m2_s2"):
        assert first[name] == pytest.approx(33.0**2)


@covers("acceleration_intensity_m2_s3", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_white_acceleration_keeps_the_velocity_uncertain(kind):
    spread = [
        tracks(kind, acceleration_intensity_m2_s3=q)[-1]["covariance_33_m2_s2"]
        for q in (0.01, 30.0)
    ]
    assert spread[1] > 2.0 * spread[0]


@covers("gate_probability", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_a_gate_that_holds_nothing_starts_a_track_at_every_look(kind):
    assert {row["track"] for row in tracks(kind)} == {1}
    assert {row["track"] for row in tracks(kind, gate_probability=1e-9)} == {1, 2, 3, 4}


@covers("start_gate_probability", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_beside_a_confirmed_track_none_starts(kind):
    """With a gate of 90 % one look of ten at the one target falls outside; a first one confirms."""
    known = {"gate_probability": 0.9, "confirm_m": 1, "duration_s": 8}
    noisy = {"radar": {**RADAR, "errors": "stated", "quantised": False, "azimuth_error_deg": 0.3,
                       "elevation_error_deg": 0.3, "range_error_m": 5.0,
                       "scan_rate_hz": 5}}  # fmt: skip
    many = {
        row["track"] for row in tracks(kind, sensors=noisy, start_gate_probability=0.0, **known)
    }
    assert len(many) > 2
    assert {row["track"] for row in tracks(kind, sensors=noisy, **known)} == {1}


def odds(kind, **keys):
    """The odds after the second look, both of which hit."""
    found = tracks(kind, start_existence=1e-9, duration_s=2,
                   **{"false_alarms_per_scan": 1e4, **keys})  # fmt: skip
    chance = found[-1]["existence"]
    return math.log(chance / (1.0 - chance))


@covers("detection_probability", "false_alarms_per_scan", "start_existence", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_odds_follow_detections_and_false_alarms(kind):
    """ln(Pd N / λ) with nothing else changed: differences are those of the logarithms."""
    usual = odds(kind, detection_probability=0.9)
    assert odds(kind, detection_probability=0.45) - usual == pytest.approx(-math.log(2), abs=1e-6)
    more = odds(kind, detection_probability=0.9, false_alarms_per_scan=1e5)
    assert more - usual == pytest.approx(-math.log(10), abs=1e-6)
    first = tracks(kind, start_existence=0.37, duration_s=1)[0]
    assert first["existence"] == pytest.approx(0.37)


@covers("confirm_m", "confirm_n", "delete_misses", "delete_after_s", "initiation",
        "false_confirmation", "missed_confirmation", of=TRACKERS)  # fmt: skip
@pytest.mark.parametrize("kind", TRACKERS)
def test_tracks_live_by_their_rules(kind):
    def life(**keys):
        return [row["track_status"] for row in fading(5, kind=kind, **keys)]

    usual = {"confirm_m": 4, "confirm_n": 6, "delete_misses": 3}
    wanted = ["tentative"] * 3 + ["confirmed"] * 2 + ["coasted"] * 2 + ["deleted"]
    assert life(**usual) == wanted
    assert life(**{**usual, "confirm_m": 2})[:2] == ["tentative", "confirmed"]
    # Six hits cannot come any more with the first look in vain.
    assert life(**{**usual, "confirm_m": 6}) == ["tentative"] * 5 + ["deleted"]
    assert life(**{**usual, "confirm_m": 6, "confirm_n": 8})[5:8] == ["tentative"] * 2 + ["deleted"]
    assert life(**{**usual, "delete_misses": 2}) == [*wanted[:6], "deleted"]
    assert life(**{**usual, "delete_after_s": 1.5}) == [*wanted[:6], "deleted"]
    wald = {"initiation": "likelihood_ratio", "delete_misses": 3, "false_alarms_per_scan": 1e5,
            "start_existence": 0.5}  # fmt: skip
    soon = life(**wald, false_confirmation=0.4).index("confirmed")
    late = life(**wald, false_confirmation=1e-12)
    assert soon < (late.index("confirmed") if "confirmed" in late else 99)
    wald |= {"false_alarms_per_scan": 3e8, "false_confirmation": 1e-12}
    ends = [life(**wald, missed_confirmation=p).index("deleted") for p in (0.4, 1e-6)]
    assert ends[0] < ends[1]


@covers("delete_above_m", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_a_track_ends_where_its_position_has_become_too_uncertain(kind):
    """At 3 m a new track is less certain than that with every hit, and ends at its first miss."""
    life = [row["track_status"] for row in fading(5, kind=kind, delete_above_m=3.0)]
    assert life == ["tentative"] * 2 + ["confirmed"] * 3 + ["deleted"]
    # 2 s without a detection: 4 m²/s³ alone are 4 · 2³ / 3 = 11 m² an axis.
    assert len(fading(5, kind=kind, delete_above_m=1000.0)) > 8


@covers("assumed_range_m", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_without_a_range_none_is_told_and_nearer_ones_turn_sooner(kind):
    camera = {**SEES_ALL, "azimuth_pixels": 3600, "elevation_pixels": 1800}
    spread = []
    for assumed in (1000.0, 10_000.0):
        found = tracks(kind, sensors={"eye": camera}, assumed_range_m=assumed)
        assert not any(row["has_range"] for row in found)
        assert {row["north_m"] for row in found} == {None}
        assert {row["covariance_00_m2"] for row in found} == {None}
        spread.append(found[-1]["azimuth_variance_rad2"])
    assert abs(spread[0] / spread[1] - 1.0) > 0.01


SIDE = {**crooked.ROLLING, "name": "side", "north_m": crooked.ROLLING["north_m"] + 12.0}


@covers("association", "jpda_exact_detections", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_who_belongs_to_whom_is_decided_as_said(kind):
    """Two targets 12 m apart: whoever weighs both detections is less sure than who takes one."""
    coarse = {**RADAR, "range_resolution_m": 10.0}

    def spread(**keys):
        found = tracks(kind, sensors={"radar": coarse}, targets=[crooked.ROLLING, SIDE], **keys)
        return np.array([row["covariance_00_m2"] for row in found if row["time_s"] == 1.0])

    one, all_of_them = spread(association="gnn"), spread(association="jpda")
    assert all_of_them.min() > 2.0 * one.max()
    assert spread(association="nearest").max() < 2.0 * one.max()
    rough = spread(association="jpda", jpda_exact_detections=1)
    assert rough.max() < 0.5 * all_of_them.min()  # propagation is too sure of itself here


@covers("late", "lag_s", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_a_late_look_is_left_out_or_worked_on_again(kind):
    """The camera's message takes 1.5 s: a radar's look has come since."""
    sensors = {"radar": RADAR, "eye": {**SEES_ALL, "latency_s": 1.5, "offset_s": 0.2}}

    def updated_by(**keys):
        names = [row["contributors"] for row in tracks(kind, sensors=sensors, **keys)]
        return {name for joined in names for name in joined.split("+")}

    assert updated_by(late="drop") == updated_by(late="rerun", lag_s=0.5) == {"radar"}
    assert updated_by(late="one_step", lag_s=0.5) == {"radar"}
    for late in ("one_step", "rerun"):
        assert updated_by(late=late, lag_s=2.0) == {"radar", "eye"}


@covers("alpha", "beta", "kappa", of=("tracking.ukf",))
def test_sigma_points_are_spread_as_said():
    def states(**keys):
        near = {**crooked.ROLLING, "east_m": -300.0, "north_m": -150.0, "up_m": 90.0}
        return [row["north_m"] for row in tracks("tracking.ukf", targets=[near], **keys)]

    usual = states()
    for change in ({"alpha": 0.8}, {"kappa": 3.0}, {"beta": 6.0}):
        assert states(**change) != usual


TURNING = {**crooked.ROLLING, "legs": [{"kind": "turn", "rate_deg_s": 6.0}]}


def turning(**keys):
    return tracks("tracking.imm", targets=[TURNING], duration_s=10, **keys)


@covers("models", of=("tracking.imm",))
def test_models_are_those_that_are_named():
    found = turning(models=["velocity", "turn"])[-1]
    assert found["probability_velocity"] + found["probability_turn"] == pytest.approx(1.0)
    assert found["probability_acceleration"] is None
    assert found["turn_rate_rad_s"] == pytest.approx(math.radians(6.0), rel=0.5)
    found = turning(models=["velocity", "acceleration"])[-1]
    assert found["probability_turn"] is None and found["acceleration_north_m_s2"] is not None


@covers("transition_rates_per_s", of=("tracking.imm",))
def test_a_model_that_is_never_entered_fades_away():
    # Before a look at most exp(-rate x 1 s) of it is left, 5e-5; at 5 per second 0.007, which
    # one look that favours turns by three makes 0.02.
    two = ["velocity", "turn"]
    never = turning(models=two, transition_rates_per_s=[[0.0, 0.0], [10.0, 0.0]])[-1]
    often = turning(models=two, transition_rates_per_s=[[0.0, 10.0], [0.0, 0.0]])[-1]
    assert never["probability_turn"] < 0.01 < 0.99 < often["probability_turn"]


@covers("start_turn_deg_s", "turn_rate_intensity_deg2_s3", "turn_acceleration_intensity_m2_s3",
        "start_acceleration_m_s2", "jerk_intensity_m2_s5", of=("tracking.imm",))  # fmt: skip
def test_what_a_model_may_do_shows_in_what_it_estimates():
    stiff = {"start_turn_deg_s": 0.01, "turn_rate_intensity_deg2_s3": 1e-6}
    slow = turning(**stiff)[-1]["turn_rate_rad_s"]
    assert abs(slow) < math.radians(0.5)
    for loose in ({"start_turn_deg_s": 6.0}, {"turn_rate_intensity_deg2_s3": 10.0}):
        assert turning(**{**stiff, **loose})[-1]["turn_rate_rad_s"] > 2.0 * abs(slow)
    calm, rough = (
        turning(turn_acceleration_intensity_m2_s3=q)[-1]["covariance_33_m2_s2"]
        for q in (0.01, 100.0)
    )
    assert rough > calm
    stiff = {"models": ["velocity", "acceleration"], "start_acceleration_m_s2": 0.001,
             "jerk_intensity_m2_s5": 1e-9}  # fmt: skip
    name = "acceleration_north_m_s2"
    still = abs(turning(**stiff)[-1][name])
    for loose in ({"start_acceleration_m_s2": 10.0}, {"jerk_intensity_m2_s5": 30.0}):
        assert abs(turning(**{**stiff, **loose})[-1][name]) > 10.0 * still


def test_a_track_with_a_range_is_where_the_target_is():
    """In north, east, down at the origin that the row tells, by pymap3d."""
    import pymap3d

    row = tracks(duration_s=6)[-1]
    origin = row["origin_lat_deg"], row["origin_lon_deg"], row["origin_alt_m"]
    own = crooked.geodetic(crooked.position(crooked.OWNSHIP))
    np.testing.assert_allclose(origin[0], own[0], atol=1e-9)
    np.testing.assert_allclose(origin[2], own[2], atol=1e-3)
    target = crooked.position(crooked.ROLLING, row["state_s"])
    known = np.array(pymap3d.ecef2ned(*target, *origin))
    found = np.array([row["north_m"], row["east_m"], row["down_m"]])
    deviation = [math.sqrt(row[f"covariance_{i}{i}_m2"]) for i in range(3)]
    assert (np.abs(found - known) < 4.0 * np.array(deviation)).all()
    here = crooked.geodetic(crooked.position(crooked.OWNSHIP, row["state_s"]))
    away = known - np.array(pymap3d.geodetic2ned(*here, *origin))
    assert row["azimuth_rad"] == pytest.approx(math.atan2(away[1], away[0]) % math.tau, abs=0.01)
    assert row["elevation_rad"] == pytest.approx(
        math.atan2(-away[2], math.hypot(away[0], away[1])), abs=0.01
    )


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"confirm_m": 4, "confirm_n": 3}, "confirm_n"),
        ({"type": "tracking.imm", "models": ["turn", "turn"]}, "twice"),
        ({"type": "tracking.imm", "transition_rates_per_s": [[0.0]]}, "rows"),
        (
            {
                "type": "tracking.imm",
                "models": ["velocity", "turn"],
                "transition_rates_per_s": [[0, -1], [1, 0]],
            },
            "negative",
        ),
    ],
)
def test_what_cannot_be_is_refused(keys, said):
    from dsa_des.errors import SceneError

    with pytest.raises(SceneError, match=said):
        tracks(**{"kind": keys.pop("type", "tracking.ekf"), **keys})


@pytest.mark.parametrize("kind", TRACKERS)
def test_who_follows_is_one_track_on_both_sides_of_astern(kind, monkeypatch):
    """Azimuths near 180 deg, of one sign and of the other, are of one place: with boxes, too."""
    level = {"heading_deg": 217.0, "speed_mps": 70.0}
    own = {"lat_deg": -41.3, "lon_deg": 170.0, "alt_m": 2400.0, **level}
    astern = math.radians(37.0)
    behind = {**level, "name": "behind", "east_m": 1500 * math.sin(astern),
              "north_m": 1500 * math.cos(astern), "up_m": 0.0}  # fmt: skip
    radar = {
        "type": "radar.range_boundary", "scan_rate_hz": 4, "range_km": 20.0, "errors": "stated",
        "quantised": False, "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5,
        "range_error_m": 10.0, "azimuth_deg": [-180, 180],
    }  # fmt: skip
    scene = chain({"radar": radar}, ownship=own, targets=[behind], duration_s=6, fusion=PASS,
                  tracker={"type": kind})  # fmt: skip
    found = run(scene)
    assert {math.copysign(1, row["azimuth_rad"]) for row in rows(found)} == {-1.0, 1.0}
    told = rows(found, "state_tracks")
    monkeypatch.setattr("components.tracking.gating._FEW_PAIRS", 0)
    assert rows(run(scene), "state_tracks") == told
    assert {row["track"] for row in told} == {1}
    assert {row["track_status"] for row in told} == {"tentative", "confirmed"}


def test_jpda_lives_with_looks_whose_detections_fall_just_beside_every_gate():
    """A gate that nine of ten miss: near enough to be compared, and too far."""
    scene = chain(
        {"radar": RADAR}, targets=[crooked.ROLLING], duration_s=6, fusion=PASS,
        tracker={"type": "tracking.ekf", "association": "jpda", "gate_probability": 0.1,
                 "start_gate_probability": 0.1},
        navigation={"attitude_noise_deg": [1.5, 1.5, 1.5]},
    )  # fmt: skip
    found = rows(run(scene), "state_tracks")
    assert len({row["track"] for row in found}) > 1


@pytest.mark.parametrize(
    ("key", "quantity"),
    [
        ("azimuth_resolution_deg", "azimuth"),
        ("elevation_resolution_deg", "elevation"),
        ("range_resolution_m", "range"),
    ],
)
def test_what_is_measured_exactly_is_refused_before_the_run(key, quantity):
    from dsa_des.errors import SceneError

    with pytest.raises(SceneError, match=f"radar measures its {quantity} exactly.*radar.{key}"):
        tracks(sensors={"radar": {**RADAR, key: 0.0}})


def test_a_range_rate_that_is_exact_is_no_part_of_a_track():
    with_rate = tracks(sensors={"radar": {**RADAR, "measures_range_rate": True}})
    assert with_rate == tracks()


def test_a_covariance_beyond_what_can_be_computed_is_one_clear_error():
    from dsa_des.errors import BlockFailure

    camera = {**SEES_ALL, "azimuth_pixels": 3600, "elevation_pixels": 1800}
    huge = {"start_speed_m_s": 1e12, "delete_above_m": 1e12}
    with pytest.raises(BlockFailure, match=r"covariance of track \d has become singular"):
        tracks("tracking.ukf", sensors={"radar": RADAR, "eye": {**camera, "scan_rate_hz": 5}},
               **huge)  # fmt: skip


def test_more_sensors_than_a_mask_has_bits_are_refused():
    from dsa_des.errors import SceneError

    with pytest.raises(SceneError, match="at most 62 sensors, and 63 lead to it"):
        tracks(sensors={f"radar{i}": RADAR for i in range(63)}, duration_s=1)
