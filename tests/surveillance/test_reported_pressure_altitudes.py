"""Pressure altitudes in air that is not the standard's: reported, corrected, estimated, noted."""

import numpy as np
import pytest
from covering import covers
from same_runs import tables_of

import dsa_des

#: Of [weather]: 20 hPa below the standard are 168 m at sea level and less above.
LOW = {"qnh_hpa": 993.25}
WARM = {"temperature_offset_c": 20}
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


@covers("qnh_hpa", "temperature_offset_c", of=("[weather]",))
@pytest.mark.parametrize("weather", [LOW, WARM, {**LOW, **WARM}, {"qnh_hpa": 1030}])
@pytest.mark.parametrize("sensor", [ADS_B, ACTIVE], ids=["ads_b", "active"])
def test_transponders_report_pressure_altitudes_that_are_taken_for_heights(sensor, weather):
    simulation, said, rise = heights(sensor, weather)
    altitude = altimeter_m(1200, **weather)
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
    assert simulation.components["sensor"].warnings() == []


def test_the_standard_atmosphere_says_and_changes_nothing():
    simulation, said, _ = heights(ADS_B, {})
    assert said == pytest.approx(1200, abs=1e-9)
    assert simulation.components["sensor"].warnings() == []
    _, one = tables_of(scene(ADS_B, {}))
    _, other = tables_of(scene(ADS_B, {}, heights="by_own_altimeter"))
    assert one["detections"].equals(other["detections"])


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

    def errors(**keys):
        found = []
        for seed in range(3):
            top = {"wires": ["traffic -> transform -> gate", "gate -> radar -> fusion",
                             "gate -> sensor -> fusion -> tracker"],
                   "duration_s": 30, "seed": seed}  # fmt: skip
            _, tables = tables_of(scene(of, LOW, more, top, **keys))
            tracks = tables["state_tracks"].to_pandas()
            late = tracks[(tracks.track_status == "confirmed") & (tracks.time_s > 15)]
            fall_m = (late.north_m**2 + late.east_m**2) / 2 / 6.37e6
            high_m = late.origin_alt_m - late.down_m + fall_m - 1200
            found.append((high_m, high_m**2 / late.covariance_22_m2))
        return [np.concatenate(part) for part in zip(*found, strict=True)]

    off_m, squares = errors()
    assert off_m.max() > 100
    assert squares.mean() > 10  # tracks are sure of what is not so
    estimated_m, squares = errors(pressure_deviation_m=150)
    assert abs(estimated_m).max() < 60
    assert 0.1 < squares.mean() < 2.5
