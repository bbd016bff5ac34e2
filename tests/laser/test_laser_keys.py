"""Each key of a scanning laser and of wires, against the equation by hand."""

import math

import numpy as np
import pytest
from covering import covers
from scipy.optimize import brentq
from scipy.special import ndtr
from wired import chain, rows, run, sensor

import dsa_des

RANGE_M, AREA_M2, REFLECTIVITY = 700.0, 0.02, 0.3
BASE = {
    "pattern": "scanned", "azimuth_deg": [-20, 20], "elevation_deg": [-10, 10], "range_km": 1.2,
    "azimuth_shots": 60, "elevation_shots": 30, "scan_rate_hz": 1, "divergence_mrad": 12.0,
    "peak_power_w": 1e5, "aperture_mm": 60.0, "efficiency": 0.4, "pulse_ns": 6.0,
    "noise_equivalent_power_w": 1.9e-9, "false_alarm_probability": 1e-6, "hits_needed": 1,
}  # fmt: skip
OWN = {"lat_deg": -41.3, "lon_deg": 3.0, "alt_m": 900.0, "heading_deg": 217.0}
# A chord of the Earth: level with the ownship as it sees it.
AHEAD = {
    "name": "a", "east_m": RANGE_M * math.sin(math.radians(217.0)),
    "north_m": RANGE_M * math.cos(math.radians(217.0)), "up_m": 0.0,
    "laser": {"area_m2": AREA_M2, "reflectivity": REFLECTIVITY},
}  # fmt: skip


def looked(**keys):
    """The look of one such laser at the target, with its probability."""
    sections = {"weather": keys.pop("weather")} if "weather" in keys else {}
    block = sensor("laser.scanning", **{**BASE, **keys})
    (row,) = rows(run(chain({"laser": block}, ownship=OWN, targets=[AHEAD], **sections)), "looks")
    return row["detection_probability"]


def by_hand(extinction_per_m=0.0, **keys):
    """The same from the equation, for whole and broken numbers of shots."""
    p = {**BASE, **keys}
    beam_rad = 1e-3 * p["divergence_mrad"]
    share = min(1.0, AREA_M2 / (math.pi / 4.0 * (beam_rad * RANGE_M) ** 2))
    echo_w = p["peak_power_w"] * p["efficiency"] * share * REFLECTIVITY
    echo_w *= (0.5e-3 * p["aperture_mm"] / RANGE_M) ** 2 * math.exp(-2 * extinction_per_m * RANGE_M)
    level = {1e-6: 4.753424309, 1e-3: 3.090232306}[p["false_alarm_probability"]]
    one = float(ndtr(echo_w / p["noise_equivalent_power_w"] - level))
    if p["pattern"] == "one_shot":
        return one if p["hits_needed"] == 1 else 0.0
    shot_sr = math.radians(40.0) / p["azimuth_shots"] * math.radians(20.0) / p["elevation_shots"]
    mean = max(AREA_M2 / RANGE_M**2, math.pi / 4.0 * beam_rad**2) / shot_sr

    def enough(count):
        return sum(math.comb(count, k) * one**k * (1 - one) ** (count - k)
                   for k in range(p["hits_needed"], count + 1))  # fmt: skip

    whole = math.floor(mean)
    return (1.0 - mean % 1.0) * enough(whole) + mean % 1.0 * enough(whole + 1)


@covers(
    "azimuth_shots", "elevation_shots", "divergence_mrad", "peak_power_w", "aperture_mm",
    "efficiency", "noise_equivalent_power_w", "false_alarm_probability", "hits_needed", "pattern",
    of=("laser.scanning",),
)  # fmt: skip
@pytest.mark.parametrize(
    "keys",
    [
        {}, {"azimuth_shots": 150}, {"elevation_shots": 95}, {"divergence_mrad": 9.0},
        {"peak_power_w": 1.2e5}, {"aperture_mm": 55.0}, {"efficiency": 0.3},
        {"noise_equivalent_power_w": 3e-9}, {"false_alarm_probability": 1e-3},
        {"azimuth_shots": 150, "elevation_shots": 95, "hits_needed": 2}, {"pattern": "one_shot"},
    ],
    ids=str,
)  # fmt: skip
def test_the_probability_is_the_equation_s(keys):
    expected = by_hand(**keys)
    assert 0.01 < expected < 0.995
    assert looked(**keys) == pytest.approx(expected, rel=1e-4)


@covers("wavelength_um", of=("laser.scanning",))
@pytest.mark.parametrize(("wavelength_um", "exponent"), [(0.9, 0.16 * 4 + 0.34), (1.55, 0.98)])
def test_haze_takes_by_the_wavelength(wavelength_um, exponent):
    haze = 3.912 / 4000.0 * (wavelength_um / 0.55) ** -exponent
    keys = {"wavelength_um": wavelength_um, "weather": {"visibility_km": 4.0}}
    assert looked(**keys) == pytest.approx(by_hand(extinction_per_m=haze), rel=1e-4)


def test_rain_takes_its_own_and_haze_what_is_left_of_the_visibility():
    """Rain by itself says how much it takes, whatever the wavelength; Kim's exponent is haze's."""
    alone = looked(weather={"rain_rate_mm_h": 1.0})
    rain = brentq(lambda per_m: by_hand(extinction_per_m=per_m) - alone, 0.0, 5e-3)
    assert rain > 1e-4
    total = 3.912 / 5000.0
    left = total - rain
    visible_km = 3.912 / left / 1000.0
    haze = left * (1.55 / 0.55) ** -(1.3 if visible_km > 6.0 else 0.16 * visible_km + 0.34)
    both = looked(weather={"rain_rate_mm_h": 1.0, "visibility_km": 5.0})
    assert both == pytest.approx(by_hand(extinction_per_m=rain + haze), rel=1e-3)
    assert both < 0.98 * min(alone, by_hand(extinction_per_m=haze))


@covers("pulse_ns", "errors", "beam_sweep", of=("laser.scanning",))
def test_errors_by_signal_are_of_the_pulse_and_the_beam():
    keys = {**BASE, "errors": "signal", "peak_power_w": 1e6, "quantised": False}
    for pulse_ns in (6.0, 20.0):
        block = sensor("laser.scanning", **{**keys, "pulse_ns": pulse_ns, "azimuth_shots": 600})
        (row,) = rows(run(chain({"laser": block}, ownship=OWN, targets=[AHEAD])))
        amplitude = 10.0 ** (row["snr_db"] / 20.0)
        expected = 0.5 * 0.299792458 * pulse_ns / math.sqrt(2.0) / amplitude
        assert math.sqrt(row["range_variance_m2"]) == pytest.approx(expected, rel=1e-6)
        assert row["azimuth_variance_rad2"] == pytest.approx(12e-3**2 / 12.0)
    swept = {**block, "beam_sweep": True}
    (row,) = rows(run(chain({"laser": swept}, ownship=OWN, targets=[AHEAD], duration_s=1)))
    middle_s = 0.5 + row["azimuth_rad"] / math.radians(40.0)
    assert row["illuminated_s"] == pytest.approx(middle_s, abs=1e-6)


WIRE = {
    "name": "line", "diameter_mm": 7.0, "sag_m": 9.0, "reflectivity": 0.35, "piece_m": 60.0,
    "rcs_dbsm": -13.0,
    "posts": [
        {"east_m": -90.0, "north_m": 400.0, "up_m": 6.0},
        {"east_m": 30.0, "north_m": 520.0, "up_m": -4.0},
    ],
}  # fmt: skip


@covers(
    *(f"wires.{key}" for key in
      ("name", "diameter_mm", "sag_m", "reflectivity", "piece_m", "rcs_dbsm", "posts.east_m",
       "posts.north_m", "posts.up_m")),
    of=("traffic.scripted",),
)  # fmt: skip
def test_a_wire_is_met_in_pieces_where_it_hangs():
    own = {**OWN, "heading_deg": 0.0}
    scene = chain(
        {"laser": sensor("laser.scanning"), "radar": sensor("radar.threshold")},
        ownship=own, targets=[], record={"truth": False},
    )  # fmt: skip
    scene["blocks"]["traffic"]["wires"] = [WIRE]
    done = run(scene)
    seen = {row["target"]: row for row in rows(done, block="laser")}
    assert sorted(seen) == ["line-1", "line-2", "line-3"]
    posts = np.array([[post[f"{axis}_m"] for axis in ("east", "north", "up")]
                      for post in WIRE["posts"]])  # fmt: skip
    # A flat catenary is a parabola to a hundredth of its sag.
    part = np.linspace(0.0, 1.0, 4)
    points = posts[0] + part[:, np.newaxis] * (posts[1] - posts[0])
    points[:, 2] -= 4.0 * 9.0 * part * (1.0 - part)
    for number in (1, 2, 3):
        row, middle = seen[f"line-{number}"], 0.5 * (points[number - 1] + points[number])
        found = row["range_m"] * np.array(
            [math.cos(row["elevation_rad"]) * math.sin(row["azimuth_rad"]),
             math.cos(row["elevation_rad"]) * math.cos(row["azimuth_rad"]),
             math.sin(row["elevation_rad"])]
        )  # fmt: skip
        np.testing.assert_allclose(found, middle, atol=0.1)
    for piece in dsa_des.load_scene(scene).blocks["traffic"].parameters.targets(None):
        assert (piece.laser.wire_diameter_mm, piece.laser.reflectivity) == (7.0, 0.35)
        assert piece.rcs_dbsm == -13.0 and piece.eo.side_m2 == piece.ir.back_m2 == 0.0
