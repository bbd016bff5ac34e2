"""Pressure altitudes in air that is not the standard's: reported, corrected, estimated, noted."""

from statistics import NormalDist

import numpy as np
import pytest
from covering import covers
from same_runs import tables_of
from scipy.stats import chi2

import dsa_des

#: Of [weather]: 20 hPa below the standard are 168 m at sea level and less above.
LOW = {"qnh_hpa": 993.25}
WARM = {"temperature_offset_c": 20}
#: The same air as rows of a sounding.
SOUNDING = {"temperature_profile_c": [[0, 35], [3000, 15.5]]}
ADS_B = {"type": "surveillance.ads_b", "reception": "certain", "position_errors": "none",
         "compact": False}  # fmt: skip
ACTIVE = {"type": "surveillance.active", "replies": "certain", "measurement": "exact",
          "elevation_deg": [-60, 60]}  # fmt: skip


def scene(sensor, weather, more=None, top=None, **keys):
    """Return a sensor that hears of an aircraft 300 m above the ownship at 900 m."""
    of = {"mode_s": True, "ads_b": {"nacp": 9, "nacv": 2}}
    tables = {
        "title": "heights", "duration_s": 5, "seed": 4, "weather": weather,
        "wires": ["traffic -> transform -> gate", "gate -> sensor"],
        "blocks": {
            "traffic": {
                "type": "traffic.scripted",
                "ownship": {"lat_deg": 52, "lon_deg": 4, "alt_m": 900, "heading_deg": 0,
                            "speed_mps": 60},
                "intruders": [{"name": "a", "lat_deg": 52.027, "lon_deg": 4.0073, "alt_m": 1200,
                               "heading_deg": 180, "speed_mps": 70, **of}],
            },
            "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"},
            "sensor": {"scan_rate_hz": 1, **sensor, **keys},
        },
    }  # fmt: skip
    tables["blocks"] |= more or {}
    return dsa_des.load_scene({**tables, **(top or {})})


def heights(sensor, weather, **keys):
    """Return the reported altitudes, and the heights above the ownship at which it is seen."""
    simulation, tables = tables_of(scene(sensor, weather, **keys))
    seen = tables["detections"]
    columns = [seen[name].to_numpy() for name in ("range_m", "elevation_rad")]
    said = next(t["reported_alt_m"].to_numpy() for t in tables.values()
                if "reported_alt_m" in t.column_names)  # fmt: skip
    range_m, elevation_rad = columns
    # The Earth falls away below the line of sight.
    rise = range_m * np.sin(elevation_rad) + (range_m * np.cos(elevation_rad)) ** 2 / 2 / 6.37e6
    return simulation, said, rise


def altimeter_m(height_m, qnh_hpa=1013.25, temperature_offset_c=0.0):
    """Return by hand what an altimeter reads below 11 km: linear in height."""
    share = (qnh_hpa / 1013.25) ** 0.190263
    warmth = 288.15 / (288.15 + temperature_offset_c)
    return 288.15 / 0.0065 * (1 - share) + share * warmth * height_m


@covers("qnh_hpa", "temperature_offset_c", "temperature_profile_c", of=("[weather]",))
@covers("geoid_undulation_m", of=("[terrain]",))
@pytest.mark.parametrize("geoid_m", [0, -32])
@pytest.mark.parametrize("weather", [LOW, WARM, {**LOW, **SOUNDING}, {"qnh_hpa": 1030}])
@pytest.mark.parametrize("sensor", [ADS_B, ACTIVE], ids=["ads_b", "active"])
def test_transponders_report_pressure_altitudes_that_are_taken_for_heights(
    sensor, weather, geoid_m
):
    top = {"terrain": {"geoid_undulation_m": geoid_m}}
    simulation, said, rise = heights(sensor, weather, top=top)
    by_hand = {**weather, **WARM} if "temperature_profile_c" in weather else weather
    by_hand = {key: by_hand[key] for key in by_hand if "profile" not in key}
    altitude = altimeter_m(1200 - geoid_m, **by_hand)
    assert said == pytest.approx(altitude, abs=0.05)
    assert rise == pytest.approx(altitude - 900, abs=1)
    assert "heights is 'reported'" in simulation.components["sensor"].warnings()[-1]


@covers("heights", of=("surveillance.ads_b", "surveillance.active"))
@pytest.mark.parametrize("weather", [LOW, WARM])
@pytest.mark.parametrize("sensor", [ADS_B, ACTIVE], ids=["ads_b", "active"])
def test_the_own_altimeter_takes_off_what_is_common(sensor, weather):
    simulation, said, rise = heights(sensor, weather, heights="by_own_altimeter")
    assert said == pytest.approx(altimeter_m(1200, **weather), abs=0.05)
    assert rise == pytest.approx(altimeter_m(1200, **weather) - altimeter_m(900, **weather), abs=1)
    warm = [
        "heights is 'by_own_altimeter': 300 m above the ownship -19 m are left, and nobody is told"
    ]
    assert simulation.components["sensor"].warnings() == (warm if weather == WARM else [])


def test_the_standard_atmosphere_says_and_changes_nothing():
    simulation, said, _ = heights(ADS_B, {})
    assert said == pytest.approx(1200, abs=1e-9)
    assert simulation.components["sensor"].warnings() == []
    _, one = tables_of(scene(ADS_B, {}))
    _, other = tables_of(scene(ADS_B, {}, heights="by_own_altimeter"))
    assert one["detections"].equals(other["detections"])


def crowd(gva, **sensor):
    """Return the reports of a hundred aircraft at 1200 m, in wrong air, after some seconds."""
    crafts = [
        {"name": f"c{k}", "lat_deg": 52.02 + 1e-3 * k, "lon_deg": 4.0, "alt_m": 1200,
         "heading_deg": 90, "speed_mps": 70, "ads_b": {"nacp": 9, "gva": gva} if gva else {}}
        for k in range(100)
    ]  # fmt: skip
    own = {"lat_deg": 52, "lon_deg": 4, "alt_m": 900, "heading_deg": 0, "speed_mps": 60}
    traffic = {"type": "traffic.scripted", "ownship": own, "intruders": crafts}
    of = {"type": "surveillance.ads_b", "reception": "certain", "heights": "geometric", **sensor}
    simulation, tables = tables_of(scene(of, {**LOW, **WARM}, {"traffic": traffic}))
    rows = tables["detections"].to_pydict()
    last = np.array(rows["time_s"]) == max(rows["time_s"], default=0)
    return simulation, {n: np.array(v)[last] for n, v in rows.items()}


@covers("heights", "pressure_deviation_m", of=("surveillance.ads_b",))
@covers("intruders.ads_b.gva", of=("traffic.scripted",))
def test_the_geometric_heights_that_are_sent_beside_know_no_weather():
    exact = {"position_errors": "none", "compact": False}
    simulation, rows = crowd(2, **exact)
    assert len(rows["target"]) == 100
    assert rows["reported_alt_m"] == pytest.approx(altimeter_m(1200, **LOW, **WARM), abs=0.05)
    assert rows["reported_height_m"] == pytest.approx(1200, abs=1e-6)
    assert simulation.components["sensor"].warnings() == []
    # Both are in steps of 25 ft, of which the height is the sum.
    _, rows = crowd(2, position_errors="none")
    assert (np.round(rows["reported_height_m"] / 7.62, 6) % 1 == 0).all()
    assert np.abs(rows["reported_height_m"] - 1200).max() < 7.63
    stated_m2 = rows["elevation_variance_rad2"] * rows["range_m"] ** 2
    assert stated_m2[50:] == pytest.approx(2 * 7.62**2 / 12, rel=0.05)
    # With errors, 95 % within 45 or 150 m, and as large as is stated.
    for gva, within_m in ((1, 150), (2, 45)):
        _, rows = crowd(gva)
        off_m = rows["reported_height_m"] - 1200
        deviation = np.hypot(within_m / 1.96, np.sqrt(2 / 12) * 7.62)
        low, high = chi2.ppf([0.001, 0.999], 100)
        assert low < (off_m**2).sum() / deviation**2 < high
        level = rows["range_m"] * np.cos(rows["elevation_rad"])
        stated_m2 = rows["elevation_variance_rad2"] * level**2
        assert low < (off_m**2 / stated_m2).sum() < high
    # Who sends none is not placed.
    simulation, rows = crowd(None)
    assert len(rows["target"]) == 0
    (counts,) = [n for what, n in simulation.components["sensor"].failure_counts().items()
                 if "no altitude that it takes" in what]  # fmt: skip
    assert counts[0].sum() > 300


RADAR = {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 15, "errors": "stated",
         "azimuth_error_deg": 0.3, "elevation_error_deg": 0.3, "range_error_m": 15,
         "azimuth_resolution_deg": 0.1, "elevation_resolution_deg": 0.1,
         "range_resolution_m": 5}  # fmt: skip


@covers("pressure_deviation_m", of=("surveillance.ads_b", "surveillance.active"))
@pytest.mark.parametrize("sensor", ["ads_b", "active"])
def test_a_tracker_with_a_radar_estimates_what_pressure_altitudes_are_off_by(sensor):
    of = {"ads_b": {**ADS_B, "position_errors": "gauss_markov", "compact": True},
          "active": {**ACTIVE, "measurement": "do_365"}}[sensor]  # fmt: skip
    more = {"radar": RADAR, "fusion": {"type": "fusion.pass_through"},
            "tracker": {"type": "tracking.ekf"}}  # fmt: skip

    def late_errors(qnh_hpa, seed=0, **keys):
        """Return errors of the height and what is stated of them, while it is still far away."""
        top = {"wires": ["traffic -> transform -> gate", "gate -> radar -> fusion",
                         "gate -> sensor -> fusion -> tracker"],
               "duration_s": 13, "seed": seed}  # fmt: skip
        _, tables = tables_of(scene(of, {"qnh_hpa": qnh_hpa}, more, top, **keys))
        tracks = tables["state_tracks"].to_pandas()
        late = tracks[(tracks.track_status == "confirmed") & (tracks.time_s > 11)]
        fall_m = (late.north_m**2 + late.east_m**2) / 2 / 6.37e6
        high_m = late.origin_alt_m - late.down_m + fall_m - 1200
        return high_m.iloc[-1], late.covariance_22_m2.iloc[-1]

    # As the pressure is, on days whose pressure altitudes are off by 150 m (one sigma).
    days = [NormalDist(1013.25, 150 / 8.3).inv_cdf((k + 0.5) / 12) for k in range(12)]
    found = [late_errors(qnh, k, pressure_deviation_m=150) for k, qnh in enumerate(days)]
    squares = sum(high_m**2 / variance for high_m, variance in found)
    low, high = chi2.ppf([0.001, 0.999], len(days))
    assert low < squares < high
    # At 993 hPa, untold, tracks are off by 165 m (and that altimeter's error) and sure of it.
    high_m, variance = late_errors(LOW["qnh_hpa"])
    assert 100 < high_m < 250 and high_m**2 / variance > 10


@covers("heights", of=("traffic.file", "traffic.csv", "traffic.daa_file"))
@pytest.mark.parametrize("weather", [LOW, {**LOW, **WARM}])
def test_recorded_pressure_altitudes_are_flown_where_the_air_has_them(tmp_path, weather):
    """A transponder then reports what was recorded, and alert levels are those of one kind."""
    rows = [f"{k},{name},{52 + sign * 6e-4 * k + at:.5f},4.0,{alt}" for k in range(20)
            for name, sign, at, alt in (("own", 1, 0, 900), ("a", -1, 0.12, 1000))]  # fmt: skip
    for name in ("t.csv", "t.daa"):
        units = "\ns,none,deg,deg,m" if name == "t.daa" else ""
        header = "time,id,lat,lon," + ("alt" if units else "baroaltitude")
        (tmp_path / name).write_text("\n".join([header + units, *rows]))

    def of(name, air, kind="file", **keys):
        file = {"type": f"traffic.{kind}", "file": str(tmp_path / name), **keys,
                "intruder": {"mode_s": True, "ads_b": {"nacp": 9, "nacv": 2}}}  # fmt: skip
        alerting = {"type": "alerting.daidalus", "scan_rate_hz": 1, "conf": "alerting/do365b.conf"}
        more = {"traffic": file, "alerting": alerting}
        wires = ["traffic -> transform -> gate -> sensor", "traffic -> alerting"]
        return tables_of(scene(ADS_B, air, more, {"wires": wires, "duration_s": 19}))

    def levels(tables):
        return tables["alerts"].select(["time_s", "target", "level"]).to_pydict()

    simulation, plain = of("t.csv", weather)
    (said,) = [one for one in simulation.components["traffic"].warnings() if "baroalt" in one]
    assert "are flown as heights, off by" in said and "heights = 'pressure'" in said
    assert len(set(levels(plain)["level"])) > 1
    assert levels(plain) == levels(of("t.csv", {})[1])
    for name, kind in (("t.csv", "file"), ("t.daa", "daa_file")):
        simulation, tables = of(name, weather, kind, heights="pressure")
        assert not any("baroalt" in one for one in simulation.components["traffic"].warnings())
        assert levels(tables) == levels(plain)
        reports = next(t for t in tables.values() if "reported_alt_m" in t.column_names)
        assert reports["reported_alt_m"].to_numpy() == pytest.approx(1000.0, abs=0.01)
        truth = tables["truth"].to_pandas()
        flown_m = truth[truth.target == "a"].alt_m.to_numpy()
        assert altimeter_m(flown_m, **weather) == pytest.approx(1000.0, abs=0.01)
