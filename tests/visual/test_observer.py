"""An observer who looks out, in scenes: against closed forms, whatever the frame and the window."""

import math

import numpy as np
import pytest
from covering import covers
from wired import chain, rows, run

import dsa_des
from components.visual.acquisition import integrated_acquisition_rate, search_round_look_probability
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.simulation import Simulation

AREA_M2 = 12.0
OWN = {"lat_deg": -41.3, "lon_deg": 3.0, "alt_m": 900.0, "heading_deg": 217.0, "speed_mps": 60.0}
FROM_M, CLOSING_MPS = 6000.0, 150.0


def met(name="a", bearing_deg=0.0, range_m=FROM_M, **keys):
    """A sphere that comes straight on, at a bearing off the nose and the ownship's altitude."""
    toward = math.radians(217.0 + bearing_deg)
    body = {"front_m2": AREA_M2, "side_m2": 0.0, "horizontal_m2": 0.0}
    return {
        "name": name, "east_m": range_m * math.sin(toward), "north_m": range_m * math.cos(toward),
        "up_m": -(range_m**2) / 2 / 6.37e6, "heading_deg": 37.0, "speed_mps": 90.0, "eo": body,
        **keys,
    }  # fmt: skip


def scene(pilot=None, targets=None, duration_s=35, own=None, **sections):
    eyes = {"type": "visual.acquisition", "scan_rate_hz": 1, **(pilot or {})}
    targets = [met()] if targets is None else targets
    return chain({"eyes": eyes}, ownship={**OWN, **(own or {})}, targets=targets,
                 duration_s=duration_s, **sections)  # fmt: skip


def opportunity(done):
    """The integral of the rate up to each scan, by the recorded probabilities."""
    looks = (row["detection_probability"] for row in rows(done, "looks"))
    p = np.array([probability for probability in looks if probability is not None])
    return np.cumsum(-np.log1p(-p))


@covers("beta_per_sr_s", "search", of=("visual.acquisition",))
@pytest.mark.parametrize("haze_km", [None, 8.0])
@pytest.mark.parametrize("rate_hz", [0.2, 1, 4])
def test_what_happens_between_scans_adds_up_to_the_closed_form(haze_km, rate_hz):
    weather = {"weather": {"visibility_km": haze_km}} if haze_km else {}
    pilot = {"scan_rate_hz": rate_hz, "beta_per_sr_s": 9000.0, "smallest_arcmin": 0.0}
    done = run(scene(pilot, **weather))
    times = np.arange(int(35 * rate_hz)) / rate_hz
    extinction = 3.912 / (1000.0 * haze_km) if haze_km else 0.0
    expected = [
        integrated_acquisition_rate(AREA_M2, CLOSING_MPS, from_m=FROM_M,
        to_m=FROM_M - CLOSING_MPS * t,
                            beta_per_sr_s=9000.0, extinction_per_m=extinction)
        for t in times
    ]  # fmt: skip
    np.testing.assert_allclose(opportunity(done)[1:], expected[1:], rtol=1e-3)


@covers("between_scans", of=("visual.acquisition",))
def test_as_at_the_scan_is_the_rate_there_times_the_period():
    pilot = {"between_scans": "as_at_scan", "scan_rate_hz": 0.5, "smallest_arcmin": 0.0}
    (first, *_), later = rows(run(scene(pilot)), "looks"), rows(run(scene(pilot)), "looks")[10]
    for row, range_m in ((first, FROM_M), (later, FROM_M - 20.0 * CLOSING_MPS)):
        rate = 17_000.0 * AREA_M2 / range_m**2
        assert row["detection_probability"] == pytest.approx(-math.expm1(-2.0 * rate), rel=4e-3)


def share_seen(pilot, before_s, targets=1500):
    """The share of aircraft that are seen so long before they would be met, and its deviation."""
    end_s = FROM_M / CLOSING_MPS - before_s
    many = [met(f"t{i}") for i in range(targets)]
    done = run(scene({"scan_rate_hz": 0.5, **pilot}, many, duration_s=end_s + 0.5,
                     record={"looks": False, "truth": False}))  # fmt: skip
    return len({row["target"] for row in rows(done)}) / targets, 0.5 / math.sqrt(targets)


def test_as_many_are_seen_as_the_probability_says():
    found, deviation = share_seen({"smallest_arcmin": 0.0}, before_s=12.0)
    expected = -math.expm1(
        -integrated_acquisition_rate(AREA_M2, CLOSING_MPS, from_m=FROM_M, to_m=12.0 * CLOSING_MPS)
    )
    assert 0.3 < expected < 0.7
    assert abs(found - expected) < 2.6 * deviation


@covers("round_s", "smallest_arcmin", of=("visual.acquisition",))
@pytest.mark.parametrize("round_s", [36.0, 50.0])
def test_a_search_that_comes_round_sees_the_share_of_a_round(round_s):
    # A disc of 12 m² is 3.909 m across: seen under 4' from 3359 m on, 22.4 s before.
    pilot = {"search": "round", "round_s": round_s, "smallest_arcmin": 4.0}
    found, deviation = share_seen(pilot, before_s=8.0)
    shows_m = math.sqrt(AREA_M2 * 4.0 / math.pi) / math.radians(4.0 / 60.0)
    expected = search_round_look_probability(
        CLOSING_MPS, from_m=shows_m, to_m=8.0 * CLOSING_MPS, round_s=round_s
    )
    assert 0.2 < expected < 0.5
    assert abs(found - expected) < 2.6 * deviation


@covers("looking", "left_looking", of=("visual.acquisition",))
def test_glances_scale_the_search_and_spells_are_all_or_nothing_of_a_run():
    pilot = {"smallest_arcmin": 0.0, "left_looking": 0.4}
    whole = opportunity(run(scene({"smallest_arcmin": 0.0})))
    np.testing.assert_allclose(opportunity(run(scene(pilot))), 0.4 * whole, rtol=1e-9)
    spells = dsa_des.load_scene(scene({**pilot, "looking": "spells"}, duration_s=30))
    runs = 300
    together = tables_of(
        [replica_scene(spells, Replica(k, {})) for k in range(runs)], make_lockstep_simulation
    )
    seen = len(set(together["detections"]["replica"].to_pylist()))
    expected = 0.4 * -math.expm1(-whole[29])
    assert abs(seen / runs - expected) < 2.6 * math.sqrt(expected * (1 - expected) / runs)


def test_who_sits_left_and_who_sits_right_attend_each_for_themselves():
    # One of two who look out through half of all runs sees the aircraft in three of four.
    pilot = {"beta_per_sr_s": 1e9, "left_looking": 0.5, "right_looking": 0.5, "looking": "spells"}
    spells = dsa_des.load_scene(scene(pilot, duration_s=3))
    runs = 240
    together = tables_of(
        [replica_scene(spells, Replica(k, {})) for k in range(runs)], make_lockstep_simulation
    )
    seen = len(set(together["detections"]["replica"].to_pylist()))
    assert abs(seen / runs - 0.75) < 2.6 * math.sqrt(0.75 * 0.25 / runs)


@pytest.mark.parametrize(("between", "share"), [("integral", 0.5), ("as_at_scan", 0.75)])
def test_a_search_that_is_half_way_round_has_met_half(between, share):
    """As at the scan, the first one counts as a whole period: three of four are over by then."""
    pilot = {"search": "round", "round_s": 40.0, "smallest_arcmin": 0.0, "scan_rate_hz": "1/10",
             "between_scans": between}  # fmt: skip
    count = 300
    targets = [met(f"t{k}", range_m=9000.0) for k in range(count)]
    found = rows(run(scene(pilot, targets, duration_s=21)))
    seen = [sum(row["time_s"] == time_s for row in found) / count for time_s in (0.0, 10.0, 20.0)]
    for part, wanted in zip(seen, (share - 0.5, share - 0.25, share), strict=True):
        assert abs(part - wanted) <= 2.6 * math.sqrt(wanted * (1.0 - wanted) / count), seen


def test_who_looks_out_in_a_run_sees_all_who_come():
    pilot = {"beta_per_sr_s": 1e9, "left_looking": 0.5, "looking": "spells"}
    both = scene(pilot, [met("a"), met("b", bearing_deg=-20.0)], duration_s=3)
    spells = dsa_des.load_scene(both)
    found = tables_of(
        [replica_scene(spells, Replica(k, {})) for k in range(40)], make_lockstep_simulation
    )
    seen = found["detections"].to_pylist()
    first, second = ({row["replica"] for row in seen if row["target"] == name} for name in "ab")
    assert first == second and 8 < len(first) < 32


def test_a_search_in_glances_comes_round_so_much_later():
    pilot = {"search": "round", "round_s": 30.0, "smallest_arcmin": 4.0, "left_looking": 0.5}
    found, deviation = share_seen(pilot, before_s=8.0, targets=600)
    shows_m = math.sqrt(AREA_M2 * 4.0 / math.pi) / math.radians(4.0 / 60.0)
    expected = search_round_look_probability(
        CLOSING_MPS, from_m=shows_m, to_m=8.0 * CLOSING_MPS, round_s=60.0
    )
    assert 0.15 < expected < 0.3
    assert abs(found - expected) < 2.6 * deviation


def test_nobody_is_sought_before_he_appears():
    late = met("late", start_time_s=4.5)
    looks = rows(run(scene({"smallest_arcmin": 0.0}, [late], duration_s=7)), "looks")
    first, second = [row["detection_probability"] for row in looks if row["time_s"] in (5.0, 6.0)]
    # Half a second before the scan at 5 s, then a whole one; nearer by little.
    assert math.log1p(-first) / math.log1p(-second) == pytest.approx(0.5, abs=0.03)


def test_who_flies_away_is_seen_until_he_is_too_small():
    # 12 m² are under 4' from 3359 m on, (3359 - 2000) / 150 = 9.06 s after the start.
    # Edge-on its wings show nothing; but how far is looked goes by the largest side.
    body = {"front_m2": AREA_M2, "side_m2": 0.0, "horizontal_m2": 90.0}
    away = met("away", range_m=2000.0, heading_deg=217.0, speed_mps=210.0, eo=body)
    pilot = {"beta_per_sr_s": 1e9, "smallest_arcmin": 4.0}
    scans = {row["scan"] for row in rows(run(scene(pilot, [away], duration_s=20)))}
    assert scans == set(range(min(scans), 10)) and min(scans) <= 1


@covers("right_looking", "azimuth_deg", "elevation_deg", of=("visual.acquisition",))
def test_each_seat_has_its_side_in_axes_that_bank_with_the_aircraft():
    own = {"roll_deg": 20.0, "speed_mps": 0.0}
    around = [
        met(f"b{b}", bearing_deg=b, range_m=2000.0, speed_mps=0.0)
        for b in (-170, -105, -95, -80, 0, 80, 95, 105, 170)
    ]
    wide = {"elevation_deg": [-40.0, 40.0], "beta_per_sr_s": 1e9}

    def names(**pilot):
        done = run(scene({**wide, **pilot}, around, duration_s=3, own=own))
        return {row["target"] for row in rows(done)}

    left = {"b-105", "b-95", "b-80", "b0", "b80"}
    assert names() == left
    right = {f"b{-int(name[1:])}" for name in left}
    assert names(left_looking=0.0, right_looking=1.0) == right
    assert names(right_looking=1.0) == left | right
    # Banked by 20 deg to the right, who is abeam on the right stands 20 deg above the wing.
    assert names(elevation_deg=[-15.0, 15.0]) == {"b0"}
    assert names(elevation_deg=[0.1, 40.0]) == {"b80"}
    assert names(azimuth_deg=[-90.0, 20.0]) == {"b-80", "b0"}


def test_who_enters_the_field_between_scans_counts_from_there_on():
    # Passes 577 m to the right, in a field that begins at 30 deg: from 1000 m before abeam on.
    aside = met(bearing_deg=0.0, range_m=3000.0)
    across = math.radians(217.0 + 90.0)
    aside["east_m"] += 577.35 * math.sin(across)
    aside["north_m"] += 577.35 * math.cos(across)
    pilot = {"azimuth_deg": [30.0, 90.0], "smallest_arcmin": 0.0}
    fine, coarse = (
        opportunity(run(scene({**pilot, "scan_rate_hz": rate}, [aside], duration_s=16.1)))
        for rate in (50, 1)
    )
    # In view from t = (3000 - 1000) / 150 = 13.33 s on: 1 Hz sees it at 14, 15 and 16 s.
    assert len(coarse) == 3
    np.testing.assert_allclose(coarse, fine[[33, 83, 133]], rtol=1e-6)


@covers("judges_range", "range_error_m", "range_bias_m", "range_correlation_time_s",
        of=("visual.acquisition",))  # fmt: skip
def test_a_range_is_judged_where_the_scene_says_so():
    sure = {"beta_per_sr_s": 1e9, "smallest_arcmin": 0.0}
    done = run(scene(sure, duration_s=5))
    assert {row["range_m"] for row in rows(done)} == {None}
    judged = {**sure, "judges_range": True, "errors": "stated", "range_error_m": 300.0,
              "range_bias_m": -400.0, "biases": "fixed", "quantised": False}  # fmt: skip
    many = [met(f"t{i}") for i in range(400)]
    found = rows(run(scene(judged, many, duration_s=8)))
    error = np.array([row["range_m"] - row["true_range_m"] for row in found])
    assert abs(error.mean() + 400.0) < 2.6 * 300.0 / math.sqrt(len(error))
    assert abs(error.std() / 300.0 - 1.0) < 2.6 / math.sqrt(2 * len(error))
    assert found[0]["range_variance_m2"] == pytest.approx(300.0**2 + 400.0**2)
    lasting = rows(run(scene({**judged, "range_correlation_time_s": 1e6}, duration_s=8)))
    error = [row["range_m"] - row["true_range_m"] for row in lasting]
    assert np.ptp(error) < 5.0


@covers("declare_by", "declare_speed_m_s", "declare_rate_deg_s", of=("visual.acquisition",))
def test_a_declared_place_moves_no_faster_than_the_scene_says():
    """It closes in by 150 m/s and turns by 0.72 deg/s at first."""
    aside = met(bearing_deg=20.0, range_m=4000.0)
    pilot = {
        "beta_per_sr_s": 1e12, "smallest_arcmin": 0.0, "between_scans": "as_at_scan",
        "judges_range": True, "declare_m": 2, "declare_n": 2, "declare_by": "place",
    }  # fmt: skip

    def declared(**keys):
        found = rows(run(scene({**pilot, **keys}, [aside], duration_s=2)))
        return [row["declared"] for row in found]

    assert declared() == [False, True]
    assert declared(declare_speed_m_s=130.0) == [False, False]
    assert declared(declare_rate_deg_s=0.7) == [False, False]
    assert declared(declare_by="target", declare_speed_m_s=130.0) == [False, True]


def tables_of(scene, runner=Simulation, **options):
    sink = MemorySink()
    runner(scene, recorder=Recorder([sink]), **options).run()
    return sink.tables()


def test_who_is_seen_stays_seen_and_darkness_hides_all():
    seen = {row["scan"] for row in rows(run(scene({"beta_per_sr_s": 1e5})))}
    assert seen == set(range(min(seen), 35)) and min(seen) > 0
    assert not rows(run(scene({"beta_per_sr_s": 1e9}, weather={"night": True})))


def test_who_comes_over_the_limb_between_scans_counts_from_there_on():
    """130 km away and climbing from the sea, it comes into view about 5 s after the start."""
    low = -(130_000.0**2) / 2 / 6.37e6 - 900.0
    far = met(range_m=130_000.0, up_m=low, climb_mps=9.0)
    pilot = {"smallest_arcmin": 0.0, "beta_per_sr_s": 1e9}
    fine, coarse = (
        opportunity(run(scene({**pilot, "scan_rate_hz": rate}, [far], duration_s=9.1,
                              terrain={"horizon": True})))
        for rate in (50, 1)
    )  # fmt: skip
    whole, begun = coarse[1] - coarse[0], coarse[0]
    assert 3 <= len(coarse) <= 7 and 0.1 * whole < begun < 0.9 * whole
    np.testing.assert_allclose(coarse, fine[-5 - 50 * np.arange(len(coarse))[::-1]], rtol=1e-3)


def test_a_search_faster_than_scans_is_no_more_than_certain():
    pilot = {"search": "round", "round_s": 1.0, "scan_rate_hz": 0.5, "smallest_arcmin": 0.0,
             "right_looking": 1.0}  # fmt: skip
    looks = rows(run(scene(pilot, duration_s=7)), "looks")
    assert [row["detection_probability"] for row in looks[1:]] == [1.0] * (len(looks) - 1)


def test_confidence_is_the_size_over_the_smallest_that_is_seen():
    for row in rows(run(scene({"beta_per_sr_s": 1e9, "smallest_arcmin": 4.0}))):
        size = math.sqrt(AREA_M2 * 4.0 / math.pi) / row["true_range_m"]
        assert row["confidence"] == pytest.approx(size / math.radians(4.0 / 60.0) - 1.0, rel=1e-3)


def test_who_shows_two_sides_is_looked_for_as_far_as_both_show():
    """Seen from in front and aside at once, it is larger than its largest side."""
    body = {"front_m2": 12.0, "side_m2": 12.0, "horizontal_m2": 12.0}
    slanting = met(heading_deg=37.0 + 45.0, eo=body)
    pilot = {"beta_per_sr_s": 1e12, "smallest_arcmin": 4.0}
    first = rows(run(scene(pilot, [slanting], duration_s=40)))[0]
    size = (1.0 + first["confidence"]) * math.radians(4.0 / 60.0) * first["true_range_m"]
    assert math.pi / 4.0 * size**2 > 1.2 * 12.0
    assert 0.0 <= first["confidence"] < 0.06


def test_wrong_seats_are_refused_in_one_line():
    for pilot, words in (
        ({"right_looking": 1.0, "azimuth_deg": [10, 90]}, r"azimuth_deg is \[10, 90\]: .* ahead"),
        ({"beta_per_sr_s": 0}, "beta_per_sr_s"),
    ):  # fmt: skip
        with pytest.raises(dsa_des.SceneError, match=words):
            dsa_des.load_scene(scene(pilot))
