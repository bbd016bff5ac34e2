"""Rain echoes beside the target: as strong as published, from the beam's volume, through filters.

Expected values are plain arithmetic of this file: Z = 200 R^1.6, Rayleigh scatter, the volume of a
Gaussian beam and an integral over its height. The ownship banks, south of the equator.
"""

import math
from types import SimpleNamespace

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, RADARS, covers
from scipy.integrate import quad
from wired import chain, first_look, noise_crosses, run, sensor

import dsa_des
from components.atmosphere.rain_echo import fall_speed_m_s, rain_velocity_deviation_m_s
from components.radar.rain import RainEcho
from dsa_des.errors import SceneError
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

RATE_MM_H, FREQUENCY_HZ, PFA = 25.0, 9.4e9, 1e-6
AZIMUTH_DEG, ELEVATION_DEG, DEPTH_M = 6.0, 4.0, 90.0
LIGHT_M_S = 299_792_458.0
BEAM = {
    "azimuth_beamwidth_deg": AZIMUTH_DEG, "elevation_beamwidth_deg": ELEVATION_DEG,
    "range_cell_m": DEPTH_M, "frequency_hz": FREQUENCY_HZ,
}  # fmt: skip
RCS_DBSM, BOUNDARY_DBSM = 5.0, 40.0
TARGETS = [{**target, "rcs_dbsm": RCS_DBSM} for target in crooked.TARGETS]
KEYS = {
    "radar.threshold": {**BEAM, "power_w": 100.0},
    "radar.swerling": {**BEAM, "power_w": 1e5, "swerling": 1},
    "radar.range_boundary": {**BEAM, "range_km": 40.0, "boundary_rcs_dbsm": BOUNDARY_DBSM},
}
NAMES = [target["name"] for target in TARGETS]


def looked(kind: str, weather: dict | None = None, **keys) -> dict:
    """The first look at each target; without rain's own loss where only its echo is asked for."""
    terrain = {"terrain": keys.pop("terrain")} if "terrain" in keys else {}
    scene = chain({"radar": sensor(kind, **{**KEYS[kind], **keys})}, targets=TARGETS,
                  weather={"rain_rate_mm_h": RATE_MM_H, "rain_top_m": 9000.0, **(weather or {})},
                  **terrain)  # fmt: skip
    if kind != "radar.swerling":
        return first_look(scene, "radar")
    # It seldom detects what the rain hides.
    looks = run({**scene, "record": {"looks": True}})["looks"].to_pylist()
    return {row["target"]: row for row in looks if row["scan"] == 0}


def reflectivity_per_m() -> float:
    z_m3 = 200.0 * RATE_MM_H**1.6 * 1e-18
    return math.pi**5 * 0.93 * z_m3 / (LIGHT_M_S / FREQUENCY_HZ) ** 4


def rain_m2(name: str, top_m: float = 9000.0, bottom_m: float = -math.inf) -> float:
    """Rain in the beam that looks at a target: two-way gain over height by quadrature."""
    north, east, down = crooked.ned(next(t for t in TARGETS if t["name"] == name))
    range_m = math.sqrt(north**2 + east**2 + down**2)
    level = math.hypot(north, east)
    alt_m = crooked.OWNSHIP["alt_m"] - down + level**2 / (2.0 * 6.371e6)
    a = 8.0 * math.log(2.0)

    def gain(height_m: float) -> float:
        off = (height_m - alt_m) / level / math.radians(ELEVATION_DEG)
        return math.exp(-a * off * off)

    reach = 4.0 * level * math.radians(ELEVATION_DEG)
    low, high = max(bottom_m, alt_m - reach), min(top_m, alt_m + reach)
    upwards = quad(gain, low, high, limit=200)[0] / level if high > low else 0.0
    across = math.radians(AZIMUTH_DEG) * math.sqrt(math.pi / a)
    return reflectivity_per_m() * range_m**2 * DEPTH_M * across * upwards


def needed(pd: float = 0.9) -> float:
    return math.log(PFA) / math.log(pd) - 1.0


def noise_like(kind: str, row: dict, clear: dict) -> float:
    """What the report says of rain's power over noise at the receiver."""
    if kind == "radar.swerling":  # Pd = Pfa^(1 / (1 + S / (1 + C)))
        over = math.log(PFA) / math.log(row["detection_probability"]) - 1.0
        return 10.0 ** (0.1 * row["snr_db"]) / over - 1.0
    if kind == "radar.threshold":
        return 10.0 ** (0.1 * (row["snr_db"] - -250.0 - row["confidence"])) - 1.0
    # A boundary: its target's echo over noise and rain, by the look through the same air.
    return 10.0 ** (0.1 * (clear["confidence"] - row["confidence"])) - 1.0


@covers("range_cell_m", of=LINK_BUDGETS)
@pytest.mark.parametrize("top_m", [9000.0, 2450.0, 1850.0])
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_rain_in_the_cell_is_noise_beside_the_target(kind, top_m):
    """C over S is the rain's cross-section over the target's: range and losses are the same."""
    found = looked(kind, {"rain_top_m": top_m})
    for name in NAMES:
        row = found[name]
        share = rain_m2(name, top_m) / 10.0 ** (0.1 * RCS_DBSM)
        expected = share * 10.0 ** (0.1 * row["snr_db"])
        measured = noise_like(kind, row, row)
        assert measured == pytest.approx(expected, rel=2e-3, abs=1e-3)


def test_the_ground_ends_the_rain():
    bottom_m = 1880.0
    found = looked("radar.threshold", terrain={"height_m": bottom_m, "clutter_gamma_db": -100.0})
    row = found["diving"]
    share = rain_m2("diving", bottom_m=bottom_m) / 10.0 ** (0.1 * RCS_DBSM)
    expected = share * 10.0 ** (0.1 * row["snr_db"])
    assert noise_like("radar.threshold", row, row) == pytest.approx(expected, rel=2e-3)


@covers("frequency_hz", "boundary_rcs_dbsm", of=("radar.range_boundary",))
@covers("azimuth_beamwidth_deg", "elevation_beamwidth_deg", "range_cell_m",
        of=("radar.range_boundary",))  # fmt: skip
def test_a_boundary_obeys_rain_where_its_carrier_is_known():
    """Its target's echo loses what the rain takes on the way, and stands beside the rain."""
    kind = "radar.range_boundary"
    found = looked(kind)
    heard = looked("radar.threshold")
    dry = first_look(
        chain({"radar": sensor("radar.threshold", **KEYS["radar.threshold"])}, targets=TARGETS),
        "radar",
    )
    for name in NAMES:
        range_m = float(math.sqrt(sum(part**2 for part in crooked.ned(
            next(t for t in TARGETS if t["name"] == name)))))  # fmt: skip
        through = 10.0 ** (0.1 * (heard[name]["snr_db"] - dry[name]["snr_db"]))
        noise = (range_m / 40_000.0) ** 4
        beside = through * needed() * rain_m2(name) / 10.0 ** (0.1 * BOUNDARY_DBSM)
        expected_db = 10.0 * math.log10(through / (noise + beside))
        assert found[name]["confidence"] == pytest.approx(expected_db, abs=0.01)
        wider = looked(kind, azimuth_beamwidth_deg=12.0, range_cell_m=45.0)
        assert wider[name]["confidence"] == pytest.approx(expected_db, abs=0.01)
        deeper = looked(kind, elevation_beamwidth_deg=8.0)[name]["confidence"]
        assert deeper < expected_db - 1.5


def said_of(kind: str, **keys) -> str:
    scene = chain({"radar": sensor(kind, **keys)}, weather={"rain_rate_mm_h": 5.0})
    return " ".join(notes_of_scene(Simulation(dsa_des.load_scene(scene))))


def test_check_says_where_rain_has_no_echo():
    no_effect = (
        "[weather] rain_rate_mm_h: no effect on this radar, whose frequency_hz is not given: its "
        "boundary lies where range_km says, in any weather"
    )
    assert no_effect in said_of("radar.range_boundary", range_km=9.0)
    for keys in ({"enabled": False}, {"frequency_hz": 9e9}):
        assert "no effect on this radar" not in said_of(
            "radar.range_boundary", range_km=9.0, **keys)  # fmt: skip
    keys = {key: value for key, value in BEAM.items() if key != "range_cell_m"}
    assert "range_resolution_m is 0 and range_cell_m is not given" in said_of(
        "radar.threshold", **keys)  # fmt: skip
    assert "no longer small against the" in said_of(
        "radar.threshold", **{**BEAM, "frequency_hz": 94e9})  # fmt: skip
    assert "rain" not in said_of("radar.threshold", **BEAM)


@covers("polarisation", "rain_rejection_db", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
def test_a_circular_wave_hears_less_of_the_rain_by_what_it_rejects(kind):
    linear = looked(kind)
    clear = looked(kind, polarisation="circular", rain_rejection_db=40.0)
    for rejection_db in (10.0, 20.0):
        found = looked(kind, polarisation="circular", rain_rejection_db=rejection_db)
        for name in NAMES:
            share = noise_like(kind, found[name], clear[name])
            whole = noise_like(kind, linear[name], clear[name])
            left = 10.0 ** (-0.1 * rejection_db)
            if kind == "radar.range_boundary":  # measured from what 40 dB leave
                share, whole, left = share + 1.0, whole + 1.0, 1.0
                assert share < whole
            else:
                assert share == pytest.approx(left * whole, rel=1e-6)


@covers("sidelobe_level_db", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
def test_sidelobes_hear_ground_and_rain_all_around(kind):
    """A ring 2 pi R dR of ground, and a shell of rain from the ground to its top."""
    ground_m, gamma_db, level_db = 1400.0, -12.0, -20.0
    terrain = {"height_m": ground_m, "clutter_gamma_db": gamma_db}
    keys = {"terrain": terrain, "weather": {"rain_top_m": 2600.0}}
    without, found = looked(kind, **keys), looked(kind, **keys, sidelobe_level_db=level_db)
    for name in NAMES:
        north, east, down = crooked.ned(next(t for t in TARGETS if t["name"] == name))
        range_m = math.sqrt(north**2 + east**2 + down**2)
        own_m = crooked.OWNSHIP["alt_m"]
        ring = 10.0 ** (0.1 * gamma_db) * (own_m - ground_m) / range_m
        ring *= 2.0 * math.pi * range_m * DEPTH_M
        shell = reflectivity_per_m() * 2.0 * math.pi * range_m * DEPTH_M * (2600.0 - ground_m)
        more_m2 = 10.0 ** (0.2 * level_db) * (ring + shell)
        if kind == "radar.range_boundary":
            loss = 10.0 ** (-0.1 * found[name]["confidence"]) - 10.0 ** (
                -0.1 * without[name]["confidence"])  # fmt: skip
            expected = needed() * more_m2 / 10.0 ** (0.1 * BOUNDARY_DBSM)
        else:
            loss = noise_like(kind, found[name], {}) - noise_like(kind, without[name], {})
            expected = more_m2 / 10.0 ** (0.1 * RCS_DBSM) * 10.0 ** (0.1 * found[name]["snr_db"])
        assert loss == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("wind_mps", [0.0, 30.0])
def test_a_canceller_takes_out_rain_by_where_the_wind_blows_it(wind_mps):
    """One canceller leaves 1 - rho cos(turn) of the rain, rho by its spread."""
    prf_hz, wind_from_deg = 20_000.0, 70.0
    filtered = {"moving_target_filter": "single_canceller", "prf_hz": prf_hz,
                "clutter_lock": False, "improvement_limit_db": 150.0}  # fmt: skip
    weather = {"wind_mps": wind_mps, "wind_from_deg": wind_from_deg}
    found = looked("radar.threshold", weather, **filtered)
    plain = looked("radar.threshold", weather)
    per_m_s = 2.0 * FREQUENCY_HZ / LIGHT_M_S / prf_hz
    # Flights keep their tracks over the ground, whatever the wind.
    heading = math.radians(crooked.OWNSHIP["heading_deg"])
    speed, climb = crooked.OWNSHIP["speed_mps"], crooked.OWNSHIP["climb_mps"]
    own = speed * math.cos(heading), speed * math.sin(heading), -climb
    towards = math.radians(wind_from_deg + 180.0)
    fall = 2.6 * (200.0 * RATE_MM_H**1.6) ** 0.107
    rain = wind_mps * math.cos(towards), wind_mps * math.sin(towards), fall
    past = [a - b for a, b in zip(rain, own, strict=True)]
    for name in NAMES:
        sight = crooked.ned(next(t for t in TARGETS if t["name"] == name))
        range_m = math.sqrt(sum(part**2 for part in sight))
        sight = [part / range_m for part in sight]
        rate = sum(a * b for a, b in zip(past, sight, strict=True))
        across = math.sqrt(sum(part**2 for part in past) - rate**2)
        level = math.hypot(sight[0], sight[1])
        shear = 0.42 * 4e-3 * range_m * math.radians(ELEVATION_DEG) * level
        platform = across * math.radians(AZIMUTH_DEG) / math.sqrt(16.0 * math.log(2.0))
        spread = math.sqrt(shear**2 + 1.0 + sight[2] ** 2 + platform**2)
        rho = math.exp(-2.0 * (math.pi * spread * per_m_s) ** 2)
        left = 1.0 - rho * math.cos(2.0 * math.pi * rate * per_m_s)
        before = noise_like("radar.threshold", plain[name], {})
        after = noise_like("radar.threshold", found[name], {})
        assert after == pytest.approx(left * before, rel=5e-3)


def test_rain_spreads_by_how_fast_it_passes_the_radar_across_its_sight():
    """0.30 of speed past the rain, beamwidth and sine of the angle, beside the rain's own."""
    wind_mps, from_deg, own_m_s = 17.0, 290.0, (31.0, -52.0, 4.0)
    scene = chain({"radar": sensor("radar.threshold", **KEYS["radar.threshold"])}, targets=TARGETS,
                  weather={"rain_rate_mm_h": RATE_MM_H, "wind_mps": wind_mps,
                           "wind_from_deg": from_deg})  # fmt: skip
    rain = RainEcho(Simulation(dsa_des.load_scene(scene)).components["radar"])
    azimuth, elevation = np.radians([12.0, 75.0, -160.0]), np.radians([3.0, -8.0, 20.0])
    range_m = np.array([900.0, 4000.0, 2500.0])
    cells = SimpleNamespace(range_m=range_m, azimuth_rad=azimuth, elevation_rad=elevation)
    mean, spread = rain.range_rate_mean_and_spread(cells, own_m_s, np.zeros(3))
    towards = math.radians(from_deg + 180.0)
    fall_m_s = fall_speed_m_s(RATE_MM_H)
    past = np.subtract([wind_mps * math.cos(towards), wind_mps * math.sin(towards), fall_m_s],
                       own_m_s)  # fmt: skip
    level = np.cos(elevation)
    sight = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)])
    np.testing.assert_allclose(mean, past @ sight, rtol=1e-12)
    across = np.linalg.norm(np.cross(past, sight.T), axis=1)
    gaussian = math.radians(AZIMUTH_DEG) / math.sqrt(16.0 * math.log(2.0))
    own = rain_velocity_deviation_m_s(range_m, elevation, math.radians(ELEVATION_DEG))
    np.testing.assert_allclose(spread, np.hypot(own, gaussian * across), rtol=0.01)


def test_rain_s_own_rates_spread_by_turbulence_fall_and_at_most_6_m_s_of_shear():
    """Nathanson, "Radar design principles", chapter 6."""
    assert rain_velocity_deviation_m_s(0.0, 0.0, 0.05) == pytest.approx(1.0)
    assert rain_velocity_deviation_m_s(0.0, math.radians(90.0), 0.05) == pytest.approx(
        math.sqrt(2.0)
    )
    assert rain_velocity_deviation_m_s(9e5, 0.0, 0.05) == pytest.approx(math.sqrt(37.0))


@covers("beam_shape_loss", "beam_spacing", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
@pytest.mark.parametrize(
    ("sweep", "spacing", "azimuth_deg"),
    [(False, 1.0, (-150, 150)), (False, 0.5, (-150, 150)), (True, 1.0, (-150, 150)),
     (False, 1.0, (40, 36))],
)  # fmt: skip
def test_a_target_between_beams_loses_what_the_beam_s_shape_takes(
    kind, sweep, spacing, azimuth_deg
):
    """12 dB per beamwidth squared each way, off the nearest of columns and bars; 1.67 dB swept."""
    keys = {**KEYS[kind], "azimuth_deg": azimuth_deg, "elevation_deg": [-60, 60],
            "beam_sweep": sweep, "beam_spacing": spacing}  # fmt: skip
    looks = [
        first_look(chain({"radar": sensor(kind, **keys, beam_shape_loss=lossy)},
                         targets=TARGETS, duration_s=2), "radar")
        for lossy in (False, True)
    ]  # fmt: skip
    for name in NAMES:
        plain, lossy = (found[name] for found in looks)
        off = []
        for angle, low, width, beam in (
            (
                plain["azimuth_rad"],
                azimuth_deg[0],
                (azimuth_deg[1] - azimuth_deg[0]) % 360,
                AZIMUTH_DEG,
            ),
            (plain["elevation_rad"], -60.0, 120.0, ELEVATION_DEG),
        ):
            count = math.ceil(width / (beam * spacing) - 1e-9)
            centres = [low + (number + 0.5) * width / count for number in range(count)]
            apart = [math.remainder(math.degrees(angle) - centre, 360.0) for centre in centres]
            off.append(min(map(abs, apart)) / beam)
        # One way 3 dB at half a beamwidth; both ways four times 3 dB times the square of twice it.
        dip_db = [-10.0 * math.log10(0.25) * (2.0 * part) ** 2 for part in off]
        if sweep:
            share = quad(lambda x: 0.25 ** (4.0 * x * x), -0.5, 0.5)[0]
            dip_db[0] = -10.0 * math.log10(share)
        assert plain["snr_db"] - lossy["snr_db"] == pytest.approx(sum(dip_db), abs=1e-6)
        assert sum(dip_db) > 0.05


def test_a_loss_of_shape_wants_a_beam():
    scene = chain({"radar": sensor("radar.threshold", beam_shape_loss=True)})
    with pytest.raises(SceneError, match="beam_shape_loss is true and azimuth_beamwidth_deg"):
        dsa_des.load_scene(scene)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"antenna_gain_db": 31.0}, False),  # 30,000 / 24 deg2 are 30.97 dB
        ({"antenna_gain_db": 27.9}, True),
        ({"antenna_gain_db": 34.1}, True),
        ({"antenna_gain_db": 33.9}, False),
    ],
)
def test_gain_and_beam_that_contradict_each_other_are_said(keys, said):
    scene = chain({"radar": sensor("radar.threshold", **{**BEAM, **keys})})
    found = notes_of_scene(Simulation(dsa_des.load_scene(scene)))
    assert any("antenna_gain_db is" in line and "6 x 4 deg" in line for line in found) is said


def test_rain_makes_false_alarms_where_the_threshold_stays():
    """Each cell crosses it with Pfa^(1 / (1 + C)), C by the radar equation; alike in 99.9 %."""
    pfa, power_w, scans = 1e-4, 3.0, 40
    keys = {**BEAM, "power_w": power_w, "antenna_gain_db": 30.0, "bandwidth_hz": 1e5,
            "azimuth_deg": [-15, 15], "elevation_deg": [-8, 8], "range_km": 3.9,
            "minimum_range_m": 300.0, "clutter_threshold": "noise", "scan_rate_hz": 20,
            **noise_crosses("radar.threshold", pfa)}  # fmt: skip
    scene = chain({"radar": sensor("radar.threshold", **keys)}, duration_s=scans / 20,
                  targets=[{**TARGETS[0], "north_m": 50_000.0}],
                  weather={"rain_rate_mm_h": 1.0, "rain_top_m": 20_000.0})  # fmt: skip
    found = len(run(scene)["detections"])
    wave = LIGHT_M_S / FREQUENCY_HZ
    eta = math.pi**5 * 0.93 * 200e-18 / wave**4
    solid = math.pi * math.radians(AZIMUTH_DEG) * math.radians(ELEVATION_DEG) / (8 * math.log(2))
    noise_w = 1.380649e-23 * 290.0 * 1e5
    expected = 0.0
    for number in range(40):  # 3.6 km in cells of 90 m
        range_m = 300.0 + (number + 0.5) * 90.0
        rain = eta * solid * range_m**2 * DEPTH_M
        lost = 10.0 ** (-0.2 * 0.0133 * range_m / 1000.0)  # P.838-3 at 1 mm/h
        cnr = power_w * 1e6 * wave**2 * rain * lost / ((4 * math.pi) ** 3 * range_m**4 * noise_w)
        expected += 5 * 4 * pfa ** (1.0 / (1.0 + cnr))
    assert expected > 20.0 * pfa * 800
    assert found == pytest.approx(scans * expected, abs=3.3 * math.sqrt(scans * expected))
