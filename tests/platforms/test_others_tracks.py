"""Tracks that one platform sends to another: their frame, their sureness, and whose they are."""

import numpy as np
import pyarrow.compute as pc
import pymap3d
import pytest
from click.testing import CliRunner
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des
from components.alerting.others_tracks import OthersTracks
from components.estimation.motion import ConstantVelocity
from components.messages.columns import ORIGIN
from components.messages.state_tracks import COVARIANCE
from dsa_des import SceneError
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.cli import main
from dsa_des.running.simulation import Simulation

RADAR = "configs/platforms/ground_radar.toml"
BOTH = "configs/platforms/ground_radar_and_camera.toml"
# In the south, 40 km from the site, where axes differ by a third of a degree.
OWN = {"lat_deg": -33.9, "lon_deg": 151.2, "alt_m": 900, "heading_deg": 217, "speed_mps": 60}
SITE = {"name": "site", "lat_deg": -33.65, "lon_deg": 151.52, "alt_m": 120}
OTHER = {"name": "other", "east_m": -1500, "north_m": -3500, "up_m": 60, "heading_deg": 60,
         "speed_mps": 70}  # fmt: skip


def scene_of(path, duration_s=30, seed=1, **changes):
    """Return a shipped scene in the south."""
    tables = dsa_des.load_scene(path).resolved()
    tables |= {"duration_s": duration_s, "seed": seed}
    tables["blocks"]["traffic"] |= {"ownship": OWN, "sites": [SITE], "intruders": [OTHER]}
    tables["blocks"]["radar"]["range_km"] = 90
    for name, values in changes.items():
        if name == "sections":
            tables |= values
        else:
            tables["blocks"].setdefault(name, {}).update(values)
    return tables


def linked(tables, **how):
    """Return them with the link as told."""
    for wire in tables["wires"]:
        if isinstance(wire, dict) and wire["from"].partition(".")[0] == "tracker":
            wire.update(how)
    return tables


def undecided(tables):
    """Return them without what decides."""
    for name in ("alerting", "avoidance"):
        del tables["blocks"][name]
    ends = ("alerting", "avoidance")
    tables["wires"] = [
        wire for wire in tables["wires"] if not any(end in str(wire) for end in ends)
    ]
    return tables


def load(tables):
    return dsa_des.load_scene(tables)


def axes(lat, lon):
    """Return north, east, down of a place in the Earth's axes, as columns."""
    zero = np.array(pymap3d.enu2ecef(0, 0, 0, lat, lon, 0))
    ways = [(0, 1, 0), (1, 0, 0), (0, 0, -1)]
    return np.stack([np.array(pymap3d.enu2ecef(*w, lat, lon, 0)) - zero for w in ways], axis=1)


def one_track(state, covariance):
    where = [SITE["lat_deg"], SITE["lon_deg"], SITE["alt_m"]]
    return KeyedTable(
        replica=np.zeros(1, dtype=np.int64),
        state=np.array(state)[:, np.newaxis],
        covariance=np.array([[covariance[i, j]] for i, j in COVARIANCE]),
        origin=np.array(where, dtype=float)[:, np.newaxis],
    )


def of_own(turn, ahead_s):
    """Return the state in the site's frame that is the ownship's after a time, and its velocity."""
    own = OWN["lat_deg"], OWN["lon_deg"], OWN["alt_m"]
    site = SITE["lat_deg"], SITE["lon_deg"], SITE["alt_m"]
    east, north, up = pymap3d.geodetic2enu(*own, *site)
    heading = np.radians(OWN["heading_deg"])
    velocity = OWN["speed_mps"] * np.array([np.cos(heading), np.sin(heading), 0.02])
    in_frame = turn.T @ velocity
    return np.concatenate([np.array([north, east, -up]) - ahead_s * in_frame, in_frame]), velocity


@covers("acceleration_intensity_m2_s3", "own_gate_probability", of=("alerting.daidalus",))
def test_a_track_after_the_link_is_as_sure_as_the_closed_form():
    """P + τ(B + Bᵀ) + τ²C + q τ³/3, turned into the axes of the receiver, and its navigation."""
    tau, q, noise = 7.5, 3.0, (4.0, 6.0, 11.0)
    root = np.random.default_rng(3).normal(size=(6, 6)) * ([60.0] * 3 + [3.0] * 3)
    p = root.T @ root
    turn = axes(OWN["lat_deg"], OWN["lon_deg"]).T @ axes(SITE["lat_deg"], SITE["lon_deg"])
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) > 0.3
    state, velocity = of_own(turn, tau)
    a, b, c, one = p[:3, :3], p[:3, 3:], p[3:, 3:], np.eye(3)
    place = turn @ (a + tau * (b + b.T) + tau**2 * c + q * tau**3 / 3 * one) @ turn.T
    place += np.diag(noise) ** 2
    speed = turn @ (c + q * tau * one) @ turn.T
    expected = [
        np.sqrt(np.linalg.eigvalsh(place[:2, :2])[-1]), np.sqrt(place[2, 2]),
        np.sqrt(np.linalg.eigvalsh(speed[:2, :2])[-1]), np.sqrt(speed[2, 2]),
    ]  # fmt: skip
    lat, lon, alt = OWN["lat_deg"], OWN["lon_deg"], OWN["alt_m"]
    own = np.array([[np.radians(lat)], [np.radians(lon)], [alt]])
    for probability, shift, is_own in (
        (0.9999, 0.0, True), (0.9999, 4000.0, False), (0.0, 0.0, False),
    ):  # fmt: skip
        others = OthersTracks(frozenset(), probability, ConstantVelocity(q), noise)
        moved = state + np.array([shift, 0, 0, 0, 0, 0])
        found, deviations = others.own_tracks_and_deviations(
            one_track(moved, p), np.array([tau]), own, velocity[:, np.newaxis], np.zeros(1, int)
        )
        assert found.tolist() == [is_own]
        assert np.concatenate(deviations) == pytest.approx(expected, rel=1e-9)


def test_of_two_at_ones_own_place_the_nearer_is_oneself():
    turn = axes(OWN["lat_deg"], OWN["lon_deg"]).T @ axes(SITE["lat_deg"], SITE["lon_deg"])
    state, velocity = of_own(turn, 0.0)
    p = np.diag([1e4] * 3 + [25.0] * 3)
    beside = state + np.array([80.0, 0, 0, 0, 0, 0])
    tracks = KeyedTable.concatenate([one_track(beside, p), one_track(state, p)])
    own = np.array(
        [[np.radians(OWN["lat_deg"])] * 2, [np.radians(OWN["lon_deg"])] * 2, [900.0] * 2]
    )
    others = OthersTracks(frozenset(), 0.9999, ConstantVelocity(4.0), (0.0, 0.0, 0.0))
    both = np.stack([velocity] * 2, axis=1)
    found, _ = others.own_tracks_and_deviations(tracks, np.zeros(2), own, both, np.zeros(2, int))
    assert found.tolist() == [False, True]


def judged(tables):
    """Return the alerts by what they are of."""
    alerts = tables_of(load(tables))[1]["alerts"].to_pylist()
    return {target: [row for row in alerts if row["target"] == target]
            for target in {row["target"] for row in alerts}}  # fmt: skip


def test_what_the_site_sees_of_the_aircraft_itself_is_no_intruder():
    """Without the gate its own track is a collision all the time."""
    alerts = judged(scene_of(RADAR))
    assert set(alerts) == {"other"} and len(alerts["other"]) > 20
    alerts = judged(scene_of(RADAR, alerting={"own_gate_probability": 0.0}))
    assert set(alerts) == {"other", None}
    assert min(row["level"] for row in alerts[None][5:]) == 3


def of_block(table, name):
    return table.filter(pc.equal(table["block"].cast("string"), name))


def test_a_link_without_loss_and_latency_is_a_fusion_on_site():
    there = {}
    for platform in ("ownship", "site"):
        tables = scene_of(RADAR, tracks={"type": "fusion.covariance_intersection",
                                         "platform": platform})  # fmt: skip
        undecided(tables)["wires"].append("tracker -> tracks")
        fused = of_block(tables_of(load(tables))[1]["state_tracks"], "tracks")
        told = [name for name in fused.column_names if name != "platform"]
        there[platform] = fused.select(told)
    assert len(there["site"]) > 40
    assert there["site"].equals(there["ownship"])


def errors_of(tables):
    """Return the normalised error squared of each report of the fused track of the other one."""
    recorded = tables_of(load(tables))[1]
    truth = {}
    for row in recorded["truth"].to_pylist():
        truth.setdefault(row["target"], []).append(row)
    result = []
    path = truth["other"]
    times = [row["time_s"] for row in path]
    geodetic = [[row[k] for row in path] for k in ("lat_deg", "lon_deg", "alt_m")]
    speeds = [[row[f"velocity_{k}_m_s"] for row in path] for k in ("north", "east", "down")]
    for row in of_block(recorded["state_tracks"], "tracks").to_pylist():
        if row["track_status"] != "confirmed" or not row["has_range"]:
            continue
        at = [float(np.interp(row["state_s"], times, k)) for k in (*geodetic, *speeds)]
        origin = [row[name] for name in ORIGIN]
        east, north, up = pymap3d.geodetic2enu(*at[:3], *origin)
        velocity = axes(*origin[:2]).T @ axes(*at[:2]) @ np.array(at[3:])
        true = np.concatenate([[north, east, -up], velocity])
        names = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
        apart = np.array([row[name] for name in names]) - true
        if np.linalg.norm(apart[:3]) > 2000.0:
            continue  # the ownship's own
        p = np.empty((6, 6))
        for (i, j), name in COVARIANCE.items():
            p[i, j] = p[j, i] = row[name]
        both = "+" in (row["contributors"] or "")
        result.append((row["state_s"], apart @ np.linalg.solve(p, apart), both))
    return result


QUIET = {"acceleration_intensity_m2_s3": 1.2e-5}


def test_fused_tracks_are_as_wrong_as_they_say():
    """The banked aircraft's camera and the site's radar, 40 km away, over a link that comes late.

    Of independent sensors and flights without noise, information adds up: chi-square with 6.
    """
    errors = {}
    for seed in range(30):
        tables = scene_of(
            BOTH, 40, seed, tracks={"rule": "independent", **QUIET}, eo_tracker=QUIET,
            eo={"range_km": 8},
            sections={"navigation": {"position_noise_m": [3, 3, 5],
                                     "attitude_noise_deg": [0.02] * 3}},
        )  # fmt: skip
        tables["blocks"]["traffic"]["ownship"] = OWN | {"roll_deg": 20}
        mine = linked(undecided(tables), jitter_s=0.3)
        mine["blocks"]["tracker"] = {"type": "tracking.ekf", **QUIET}
        at_end = [e for e in errors_of(mine) if e[2]][-1]
        errors[seed] = at_end[1]
    values = np.array(list(errors.values()))
    # 99.9 % of chi-square with 180, by Wilson and Hilferty
    spread = 3.29 * np.sqrt(2 / 9 / 180)
    low, high = (6 * (1 - 2 / 9 / 180 + s) ** 3 for s in (-spread, spread))
    assert low <= values.mean() <= high


@pytest.mark.parametrize("path", [RADAR, BOTH])
def test_the_same_bytes_in_any_window_and_beside_other_runs(path):
    scene = load(linked(scene_of(path, 20), jitter_s=0.4))
    same_in_any_window(scene)
    same_as_alone(replicas_of(scene, {}, {"blocks.traffic.intruders[0].east_m": -1700.0}))


def camera(tables):
    return tables["blocks"]["tracks"].pop("platform")


def forgotten(tables):
    del tables["blocks"]["alerting"]["platform"]
    for name in ("alerting", "avoidance"):
        tables["blocks"][name].pop("platform", None)


def two_gates(tables):
    tables["wires"].append("gate_air -> radar")


def detections(tables):
    tables["wires"].append("eo -> fusion")


def misspelt(tables):
    tables["blocks"]["transform"]["platform"] = "sight"


@covers("[blocks].platform")
@pytest.mark.parametrize(
    ("path", "mistake", "said"),
    [
        (BOTH, camera, "blocks.tracks: is carried by 'ownship', as eo_tracker feeds it, and "
         "tracker on 'site' feeds it too: which of them it is on, its table must say"),
        (RADAR, forgotten, "avoidance is on 'site', which stands and is not steered"),
        (BOTH, two_gates, "has 2 writers, and takes one: gate.targets, gate_air.targets"),
        (BOTH, detections, "a block looks from one place"),
        (RADAR, misspelt, "there is no such aircraft or place; did you mean 'site'?"),
    ],
)  # fmt: skip
def test_the_likeliest_mistakes_are_said(path, mistake, said):
    tables = scene_of(path)
    mistake(tables)
    with pytest.raises(SceneError) as refused:
        Simulation(load(tables))
    assert said in str(refused.value)
    assert len(refused.value.problems) == 1


def test_an_alert_of_who_turns_in_is_later_by_the_link_s_latency(tmp_path):
    """At 55 m/s the two come 110 m nearer in 2 s; to a steady flight latency is nothing."""
    pandas = pytest.importorskip("pandas")
    from docs.make.platforms.link_latency import rows

    call = ["study", "link_latency", "--set", "replicas=8", "--workers", "1", "--quiet"]
    done = CliRunner().invoke(main, [*call, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    cells = [
        line.strip("| ").split(" | ")
        for line in rows([pandas.read_parquet(tmp_path / "out" / "parts")])[2:]
    ]
    nearer = {(float(c[0]), c[1]): [float(c[k].split()[0]) for k in (3, 5)] for c in cells}
    assert nearer[0.0, "0 %"] == [0.0, 0.0]
    assert nearer[2.0, "0 %"] == [pytest.approx(0.0, abs=110.0), pytest.approx(109.0, abs=15.0)]
    assert nearer[1.0, "0 %"][1] == pytest.approx(nearer[2.0, "0 %"][1] / 2.0, abs=10.0)
