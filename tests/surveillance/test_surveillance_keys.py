"""Keys of cooperative sensors, one by one, in crooked flight."""

import crooked
import numpy as np
import pytest
from covering import covers
from wired import chain, rows, run, sensor

import dsa_des
from components.surveillance.stated_errors import LATE
from dsa_des.running.simulation import Simulation

KINDS = ("surveillance.ads_b", "surveillance.active")
EXACT = {
    "surveillance.ads_b": {"reception": "certain", "position_errors": "none", "compact": False},
    "surveillance.active": {
        "replies": "certain", "measurement": "exact", "far_every": 1, "elevation_deg": [-90, 90],
    },
}  # fmt: skip
TARGETS = [{**target, "mode_s": True, "ads_b": {}} for target in crooked.TARGETS]
BOTH = {target["name"] for target in TARGETS}
REFUSED = {
    "errors": "stated", "quantised": False, "biases": "fixed", "azimuth_error_deg": 1.0,
    "azimuth_bias_deg": 1.0, "azimuth_correlation_time_s": 1.0, "azimuth_resolution_deg": 1.0,
    "elevation_error_deg": 1.0, "elevation_bias_deg": 1.0, "elevation_correlation_time_s": 1.0,
    "elevation_resolution_deg": 1.0, "mount_azimuth_deg": 1.0, "mount_elevation_deg": 1.0,
    "mount_roll_deg": 1.0, "misalignment_deg": [1.0, 0.0, 0.0],
}  # fmt: skip


def scene(kind, duration_s=3, **keys):
    one = {"type": kind, "scan_rate_hz": 1, **EXACT[kind], **keys}
    return chain({"sensor": one}, targets=TARGETS, duration_s=duration_s)


def seen(kind, scan=2, **keys):
    """Names reported at a scan; at the first one nothing was broadcast yet."""
    return {row["target"] for row in rows(run(scene(kind, **keys)), scan=scan)}


@covers(*REFUSED, of=KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_not_measured_cannot_be_stated(kind):
    """All such keys in one report."""
    with pytest.raises(dsa_des.SceneError) as caught:
        dsa_des.load_scene(scene(kind, **REFUSED))
    for key in REFUSED:
        assert f"blocks.sensor.{key}" in {problem.key for problem in caught.value.problems}


@covers("leaves_out", of=KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_who_is_served_is_left_out_by_its_address(kind):
    """A transponder of Mode C alone has none: its replies stay."""
    name, other = sorted(BOTH)
    assert seen(kind, leaves_out=[name]) == {other} and seen(kind, leaves_out=[*BOTH]) == set()
    with pytest.raises(dsa_des.SceneError, match=f"leaves_out: there is no 'x{name}'; did you"):
        Simulation(dsa_des.load_scene(scene(kind, leaves_out=[f"x{name}"])))
    if kind == "surveillance.active":
        tables = scene(kind, leaves_out=[name])
        for one in tables["blocks"]["traffic"]["intruders"]:
            one |= {"mode_s": False, "mode_c": True}
            del one["ads_b"]
        assert {row["target"] for row in rows(run(tables), scan=2)} == BOTH


@covers("enabled", "range_km", "azimuth_deg", "elevation_deg", of=KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_reach(kind):
    assert seen(kind) == BOTH and seen(kind, enabled=False) == set()
    ways = {target["name"]: crooked.body(target, 2.0) for target in TARGETS}
    (near, near_m), (_, far_m) = sorted(
        ((name, float(np.linalg.norm(way))) for name, way in ways.items()), key=lambda row: row[1]
    )
    assert seen(kind, range_km=(near_m + far_m) / 2000.0) == {near}
    for name, way in ways.items():
        azimuth, elevation = np.degrees(crooked.angles(way))
        assert seen(kind, azimuth_deg=[azimuth - 1.0, azimuth + 1.0]) == {name}
        assert seen(kind, elevation_deg=[elevation - 1.0, elevation + 1.0]) == {name}


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", "jitter_s", of=KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_clocks(kind):
    def times(**keys):
        return [row["time_s"] for row in rows(run(scene(kind, 1, **keys)), "scans")]

    np.testing.assert_allclose(times(scan_rate_hz=8), np.arange(8) / 8, atol=1e-9)
    late = times(scan_rate_hz=8, offset_s=0.3)
    np.testing.assert_allclose(late, 0.3 + np.arange(6) / 8, atol=1e-9)
    fast = times(scan_rate_hz=8, rate_error_ppm=250_000)
    np.testing.assert_allclose(fast, np.arange(10) / 10, atol=1e-9)
    found = np.array(times(scan_rate_hz=100, jitter_s=0.001))
    shift = found - np.arange(len(found)) / 100
    assert len(found) > 98 and np.std(shift[1:]) == pytest.approx(0.001, rel=0.3)


@covers("declare_m", "declare_n", "declare_by", "declare_speed_m_s", "declare_rate_deg_s",
        of=KINDS)  # fmt: skip
@pytest.mark.parametrize("kind", KINDS)
def test_declaration(kind):
    def declared(**keys):
        found = rows(run(scene(kind, 5, **keys)), target=TARGETS[0]["name"])
        return [row["declared"] for row in found if row["scan"]][:4]

    assert declared(declare_m=2, declare_n=2)[2:] == [True, True]
    assert declared(declare_m=9, declare_n=9) == [False] * 4
    places = {"declare_m": 2, "declare_n": 2, "declare_by": "place"}
    assert declared(**places)[2:] == [True, True]
    for key in ("declare_speed_m_s", "declare_rate_deg_s"):
        assert declared(**{**places, key: 0.0}) == [False] * 4
        by_target = {**places, "declare_by": "target", key: 0.0}
        assert declared(**by_target)[2:] == [True, True]


def fleet(kind, craft, *, place_m=(-6000.0, -8000.0), duration_s=60, **keys):
    """Reports of one aircraft, at rest as the ownship is, to which nothing else happens."""
    still = {"heading_deg": 217.0, "speed_mps": 0.0}
    own = {"lat_deg": -42.0, "lon_deg": 179.99, "alt_m": 1200.0, **still}
    other = {"name": "kea", "east_m": place_m[0], "north_m": place_m[1], "up_m": 307.0, **still}
    one = {"type": kind, "scan_rate_hz": 1, **EXACT[kind], **keys}
    return rows(run(chain({"sensor": one}, ownship=own, targets=[{**other, **craft}],
                          duration_s=duration_s)))  # fmt: skip


@covers("replies", "mode_s_in_1_s", "mode_c_in_1_s", of=("surveillance.active",))
def test_answers():
    """Each key by its own transponder; counts of 600 scans within four deviations."""
    in_1_s = {"mode_s_in_1_s": 0.3, "mode_c_in_1_s": 0.6}
    for craft, p in (({"mode_s": True}, 0.3), ({"mode_c": True}, 0.6)):
        count = {}
        for replies, confidence in (("rounds", p), ("certain", 1.0)):
            found = fleet("surveillance.active", craft, duration_s=600, replies=replies, **in_1_s)
            assert {row["confidence"] for row in found} == {confidence}
            count[replies] = len(found)
        assert count["certain"] == 600
        assert abs(count["rounds"] - 600 * p) < 4.0 * np.sqrt(600 * p * (1.0 - p))


@covers("near_s", "far_every", of=("surveillance.active",))
def test_who_is_asked():
    """Who does not come nearer is asked at one scan in so many; who does, at all within near_s."""
    for every in (1, 3):
        found = fleet("surveillance.active", {"mode_s": True}, far_every=every)
        scans = np.array([row["scan"] for row in found])
        assert {*np.diff(scans[scans > 2 * every])} == {every}
    # Head-on at 90 m/s from 10.0 km: 111 s to go.
    closing = {"mode_s": True, "heading_deg": 37.0, "speed_mps": 90.0}
    for near_s, first in ((30.0, 82), (70.0, 42)):
        found = fleet("surveillance.active", closing, far_every=7, near_s=near_s, duration_s=100)
        scans = np.array([row["scan"] for row in found])
        every = scans[:-1][(np.diff(scans) == 1) & (scans[:-1] > 14)]
        assert abs(every.min() - first) <= 7 and every.max() == 98
        assert {*np.diff(scans[(scans > 14) & (scans < first - 7)])} == {7}


@covers("measurement", "mode_s_step_ft", of=("surveillance.active",))
def test_measurements():
    for step_ft in (25, 100):
        keys = {"measurement": "do_365", "mode_s_step_ft": step_ft}
        seen = {
            place: fleet("surveillance.active", {"mode_s": True}, duration_s=2,
                         place_m=(-500.0 * place, -6000.0), **keys)[0]
            for place in range(3)
        }  # fmt: skip
        for row in seen.values():
            steps = row["reported_alt_m"] / 0.3048 / step_ft
            assert steps == pytest.approx(round(steps), abs=1e-6)
            # Delays of transponders alone are 38 m; the rest is of 15.24 m.
            assert abs(row["range_m"] - row["true_range_m"] - 38.1) < 4.0 * 15.24
    exact = fleet("surveillance.active", {"mode_s": True}, duration_s=2)[0]
    assert exact["range_m"] == pytest.approx(exact["true_range_m"], abs=1e-6)
    assert exact["reported_alt_m"] % (25 * 0.3048) > 0.5


@covers("reception", of=("surveillance.ads_b",))
def test_reception():
    """At 30 km little comes by the law of DO-365, nearly all by the fitted one; at 50 km none."""
    count = {
        (law, east_m): len({row["reported_s"] for row in fleet(
            "surveillance.ads_b", {"ads_b": {}}, reception=law, place_m=(east_m, 0.0),
            scan_rate_hz=5, duration_s=120)})
        for law in ("certain", "do_365", "fitted") for east_m in (30e3, 50e3)
    }  # fmt: skip
    assert count["certain", 30e3] == count["certain", 50e3] == pytest.approx(240, abs=5)
    p = 1.0 - 0.05 ** (1.0 / 14.0)
    assert abs(count["do_365", 30e3] - 240 * p) < 4.0 * np.sqrt(240 * p * (1.0 - p))
    assert count["do_365", 50e3] == 0
    assert count["do_365", 30e3] < count["fitted", 50e3] < count["certain", 50e3]


@covers("aircraft_around", "airports_around", of=("surveillance.ads_b",))
def test_traffic_around_garbles_messages():
    """At 100 nmi fewer messages come through amid more aircraft, and the law says how many."""
    x = 185_200.0 / (290.0 * 1852.0)

    def received(aircraft, airports):
        found = fleet("surveillance.ads_b", {"ads_b": {}}, place_m=(185_200.0, 0.0), scan_rate_hz=5,
                      duration_s=300, aircraft_around=aircraft, airports_around=airports,
                      reception="fitted")  # fmt: skip
        return len({row["reported_s"] for row in found})

    for aircraft, airports, factors in (
        (50, 50, (-1.80, 11.96, -23.27, 20.30)),
        (95, 50, (-2.754, 15.3035, -30.173, 24.701)),
        (250, 50, (-6.04, 26.82, -53.95, 39.86)),
        (95, 40, (-4.371, 24.4585, -51.526, 40.351)),
    ):
        sums = 1.0 + sum(factor * x**n for n, factor in enumerate(factors, 1))
        p = np.clip(np.exp(-3.0 * x**2) * sums, 0.0, 1.0)
        count = received(aircraft, airports)
        assert abs(count - 600 * p) < 4.0 * np.sqrt(600 * p * (1.0 - p)) + 5.0


@covers("position_errors", "compact", of=("surveillance.ads_b",))
def test_errors_of_broadcasts():
    """At rest, what changes from message to message are new errors and the rounding."""

    def north_m(errors, compact):
        found = fleet("surveillance.ads_b", {"ads_b": {"nacp": 8}}, position_errors=errors,
                      compact=compact)  # fmt: skip
        return 111_111.0 * np.array([row["reported_lat_deg"] for row in found])

    assert np.ptp(north_m("none", False)) < 1e-6
    # Even and odd messages have grids of their own, both of about 5 m.
    assert 0.0 < np.ptp(north_m("none", True)) < 5.2
    sigma = 92.6 / 2.4477
    assert np.std(north_m("white", False)) == pytest.approx(sigma, rel=0.37)
    steps = np.diff(north_m("gauss_markov", False))
    one_second = sigma * np.sqrt(2.0 * (1.0 - np.exp(-1.0 / 300.0)))
    assert np.std(steps) == pytest.approx(one_second, rel=0.5)


@covers("velocity_age_s", of=("surveillance.ads_b",))
def test_velocities_are_no_older_than_the_scene_says():
    """Where one message in ten comes through, an older velocity goes with more positions."""
    shares = {}
    for age_s in (0.5, 4.0):
        found = fleet("surveillance.ads_b", {"ads_b": {}}, reception="do_365", duration_s=300,
                      place_m=(30e3, 0.0), velocity_age_s=age_s)  # fmt: skip
        ages = [row["time_s"] - row["velocity_s"] for row in found if row["velocity_s"] is not None]
        assert min(ages) >= 0.0 and max(ages) < age_s
        shares[age_s] = len(ages) / len(found)
    assert max(ages) > 2.0 and shares[0.5] < 0.6 * shares[4.0]


EQUIPAGE = {
    "mode_s": True, "mode_c": True, "icao_address": "4840D6",
    **{f"ads_b.{key}": value for key, value in {
        "nacp": 9, "nacv": 2, "nic": 7, "gva": 2, "latency_s": 0.0, "compensated_s": 0.0,
        "silent_after_s": 9.0, "spoofed_north_m": 1.0, "spoofed_east_m": 1.0,
        "spoofed_up_m": 1.0}.items()},
}  # fmt: skip


@covers(*EQUIPAGE, of=("traffic.host.planes",))
@pytest.mark.parametrize("key", EQUIPAGE)
def test_planes_of_a_host_have_no_equipage(key):
    """Without it there is no error; where a host's aircraft are between its calls nobody knows."""
    first, _, inner = key.partition(".")
    for craft in ({}, {first: {inner: EQUIPAGE[key]} if inner else EQUIPAGE[key]}):
        loaded = chain({"sensor": sensor("radar.range_boundary")})
        plane = {"name": "one", **craft}
        loaded["blocks"]["traffic"] = {"type": "traffic.host", "planes": [plane]}
        if not craft:
            dsa_des.load_scene(loaded)
            continue
        with pytest.raises(dsa_des.SceneError, match="where aircraft are between the host's") as e:
            dsa_des.load_scene(loaded)
        assert [problem.key for problem in e.value.problems] == [
            f"blocks.traffic.planes[0].{first}"
        ]


@pytest.mark.parametrize("kind", KINDS)
def test_range_rates_are_offered_by_whoever_reports_them(kind):
    """An aircraft broadcasts its velocity; a transponder's reply has none."""
    offer = Simulation(dsa_des.load_scene(scene(kind))).components["sensor"].offer("detections")
    found = rows(run(scene(kind)), scan=2)
    rates = [row["range_rate_m_s"] for row in found]
    assert rates and offer.measures_range_rate is (kind == "surveillance.ads_b")
    assert {rate is not None for rate in rates} == {offer.measures_range_rate}
    for row in found if offer.measures_range_rate else ():
        target = next(one for one in TARGETS if one["name"] == row["target"])
        near, far = (np.linalg.norm(crooked.body(target, 2.0 + off_s)) for off_s in (-0.01, 0.01))
        assert row["range_rate_m_s"] == pytest.approx((far - near) / 0.02, abs=0.01)


def test_what_an_interrogator_offers_is_what_its_answers_have():
    """A range and a bearing whose errors differ from answer to answer; exact ones have none."""
    for measurement in ("exact", "do_365"):
        found = scene("surveillance.active", measurement=measurement)
        block = Simulation(dsa_des.load_scene(found))
        offer = block.components["sensor"].offer("detections")
        variances = offer.azimuth_variance_rad2, offer.elevation_variance_rad2
        assert (*variances, offer.range_variance_m2) == (None, None, None)
        assert offer.unstated_across_m2 == 0.0 and not offer.measures_range_rate
        assert offer.tells is (measurement != "exact")
        assert set(offer.lasting) == (set() if measurement == "exact" else {"range", "elevation"})
        assert bool(offer.told_errors) is (measurement != "exact")
    # Far ones are asked every fifth time.
    found = scene("surveillance.active", far_every=5)
    offer = Simulation(dsa_des.load_scene(found)).components["sensor"].offer("detections")
    assert offer.promises == ((np.inf, 5.0),)


@pytest.mark.parametrize(
    ("late_s", "is_offered"), [((0.0, 0.0), False), ((0.0, 0.4), True), ((0.4, 0.4), True)]
)
def test_a_receiver_offers_that_positions_are_late_where_one_aircraft_s_may_be(late_s, is_offered):
    targets = [
        {**target, "ads_b": {"latency_s": late, "compensated_s": 0.0}}
        for target, late in zip(crooked.TARGETS, late_s, strict=True)
    ]
    one = {"type": "surveillance.ads_b", "scan_rate_hz": 1, **EXACT["surveillance.ads_b"]}
    made = Simulation(dsa_des.load_scene(chain({"sensor": one}, targets=targets)))
    offer = made.components["sensor"].offer("detections")
    assert (LATE in offer.told_errors) is is_offered
    assert made.components["sensor"].grid_step_by_quantity["range_rate"] == 0.0
    variances = offer.azimuth_variance_rad2, offer.elevation_variance_rad2
    assert (*variances, offer.range_variance_m2, offer.range_rate_variance_m2_s2) == (None,) * 4
    assert offer.unstated_across_m2 == 0.0 and offer.tells
