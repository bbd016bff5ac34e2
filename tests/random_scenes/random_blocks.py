"""Random parameters of every block behind the traffic."""

from typing import Any

from dice import Dice

TRANSFORMS = (*["ellipsoid"] * 4, "geodesic", *["local_radii", "flat_earth"] * 2)
SENSORS = (
    "radar.threshold", "radar.threshold", "radar.swerling", "radar.swerling",
    "radar.range_boundary", "optical.eo", "optical.ir", "optical.projection",
    "optical.range_boundary",
)  # fmt: skip
_OASYS = {
    "power_w": 2.5, "antenna_gain_db": 29.5, "integration_gain_db": 7, "noise_figure_db": 6,
}  # fmt: skip


def transform(dice: Dice) -> dict[str, Any]:
    """Return a coordinate transform."""
    table: dict[str, Any] = {"type": f"geometry.{dice.pick(*TRANSFORMS)}"}
    dice.features.add(table["type"])
    if dice.chance(0.2, "transform model auto"):
        table["model"] = "auto"
    dice.maybe(table, "attitude", 0.3, "exact", "small_angle", "auto")
    return table


def clock(dice: Dice, table: dict[str, Any]) -> None:
    """Give a sensor a scan clock, even or odd."""
    table["scan_rate_hz"] = dice.pick(0.25, 1, 1, 2, 4.7, 5, 10, 20, "10/3", "30000/1001")
    if dice.chance(0.5, "clock offset"):
        table["offset_s"] = dice.pick(0.05, 0.1, 0.2, 0.5, 1, "1/3", 30)
    if dice.chance(0.25, "clock rate error"):
        table["rate_error_ppm"] = dice.pick(1000, -50, 100000, "1/7")
    if dice.chance(0.25, "clock jitter"):
        table["jitter_s"] = dice.pick(0.001, 0.01, 0.1, 5)


def common(dice: Dice, table: dict[str, Any]) -> None:
    """Add what all sensors have: field of view, grid, mounting, declaration."""
    if dice.chance(0.3, "narrow field of view"):
        table["azimuth_deg"] = dice.pick([-60, 60], [0, 90], [150, -150], [-110, 110])
    if dice.chance(0.2):
        table["elevation_deg"] = dice.pick([-30, 30], [0, 45], [-90, 0])
    if dice.chance(0.3, "measuring grid"):
        table["azimuth_resolution_deg"] = dice.pick(0.1, 1, 2.5)
        table["elevation_resolution_deg"] = dice.pick(0.1, 1)
    if dice.chance(0.2, "mounting"):
        table["mount_azimuth_deg"] = dice.pick(-45, 90, 180)
        dice.maybe(table, "mount_elevation_deg", 0.5, -30, 10, 90)
        dice.maybe(table, "mount_roll_deg", 0.5, 5, 180)
    if dice.chance(0.15, "misalignment"):
        table["misalignment_deg"] = dice.pick([0.5, -0.2, 0], [0, 0, 3], [10, 10, 10])
    if dice.chance(0.25, "declaration m of n"):
        table["declare_m"], table["declare_n"] = dice.pick((1, 1), (1, 3), (2, 3), (3, 5))
        dice.maybe(table, "declare_by", 0.5, "place", "target")
    if dice.chance(0.03, "sensor switched off"):
        table["enabled"] = False
    if dice.chance(0.25, "stated errors"):
        table |= {"errors": "stated", "azimuth_error_deg": dice.pick(0.3, 9, 120)}
        dice.maybe(table, "azimuth_correlation_time_s", 0.5, 0.001, 2, 100000)
        dice.maybe(table, "azimuth_bias_deg", 0.5, -3, 20)
        dice.maybe(table, "elevation_error_deg", 0.5, 0.2, 70)
        dice.maybe(table, "elevation_bias_deg", 0.5, 0.5)
        dice.maybe(table, "biases", 0.3, "fixed")
        dice.maybe(table, "quantised", 0.3, False)


def radar(dice: Dice, table: dict[str, Any], steered: bool) -> None:
    """Add what radars have."""
    if dice.chance(0.6 if steered else 0.35, "sweeping beam"):
        table["beam_sweep"] = True
        if steered:
            dice.features.add("sweeping beam in a loop")
    dice.maybe(table, "range_resolution_m", 0.3, 10, 76.2)
    dice.maybe(table, "minimum_range_m", 0.15, 10, 500)
    if dice.chance(0.2, "range rate"):
        table["measures_range_rate"] = True
        dice.maybe(table, "range_rate_resolution_m_s", 0.5, 2.5)
    if table.get("errors") == "stated":
        dice.maybe(table, "range_error_m", 0.7, 21, 400)
        dice.maybe(table, "range_bias_m", 0.5, 125)
        if "range_error_m" in table:
            dice.maybe(table, "range_correlation_time_s", 0.5, 0.1, 30)
    dice.maybe(table, "resolution_cells", 0.2, True, False)
    dice.maybe(table, "clutter_threshold", 0.15, "noise")
    dice.maybe(table, "cfar_reference_cells", 0.15, 6, 24)
    if dice.chance(0.2, "moving target filter"):
        table["moving_target_filter"] = dice.pick(
            "single_canceller", "double_canceller", "filter_bank"
        )
        table["prf_hz"] = dice.pick(900, 5000)
        dice.maybe(table, "clutter_lock", 0.3, False)
        dice.maybe(table, "range_rate_folds", 0.3, "measures_range_rate" in table)
    if table["type"] == "radar.range_boundary":
        table["range_km"] = dice.pick(1, 5, 15)
        if "moving_target_filter" in table:
            table["frequency_hz"] = 9.4e9
        return
    dice.maybe(table, "range_km", 0.5, 1, 5, 15)
    table |= _OASYS
    table |= dice.pick({"wavelength_m": 0.00857}, {"frequency_hz": 35e9}, {"frequency_hz": 9.4e9})
    table |= dice.pick(
        {"bandwidth_hz": 500.0}, {"calibrate": {"rcs_dbsm": 1.76, "range_km": 6.91, "pd": 0.9114}}
    )
    dice.maybe(table, "losses_db", 0.2, 0, 3)
    dice.maybe(table, "false_alarm_probability", 0.6, 0.05, 0.001, 1e-6)
    dice.maybe(table, "polarisation", 0.2, "horizontal", "vertical")
    dice.maybe(table, "aspect_rcs", 0.1, False)
    if dice.chance(0.15, "pulses"):
        table["pulses"], table["integration_gain_db"] = dice.pick(5, 10), 0
    if dice.chance(0.2, "radar false alarms"):
        table |= {
            "false_alarms": True, "range_km": dice.pick(2, 5), "range_resolution_m": 500,
            "azimuth_resolution_deg": 10, "elevation_resolution_deg": 10,
            "azimuth_deg": [-60, 60], "elevation_deg": [-10, 10],
            "false_alarm_probability": dice.pick(0.001, 0.01),
        }  # fmt: skip
    if dice.chance(0.2, "errors by the signal"):
        table |= {
            "errors": "signal", "azimuth_beamwidth_deg": 4, "elevation_beamwidth_deg": 6,
            "budget": "free", "range_resolution_m": table.get("range_resolution_m", 30),
        }  # fmt: skip
        if "measures_range_rate" in table:
            table.setdefault("dwell_s", 0.01)
        dice.maybe(table, "angle_measurement", 0.3, "scan")
    if table["type"] == "radar.threshold":
        dice.maybe(table, "threshold_db", 0.3, -3.0, 10.0)
        return
    dice.maybe(table, "swerling", 0.4, 0, 1, 2, 3, 4, 5)
    dice.maybe(table, "detection", 0.3, "exact", "table", "gram_charlier")
    if dice.chance(0.15, "radar model auto"):
        table["model"] = "auto"
    if dice.chance(0.4, "sampled fluctuation"):
        table["fluctuation"] = "sampled"
    if "fluctuation" in table and dice.chance(0.4, "lasting fluctuation"):
        table["fluctuation_correlation_s"] = 0.7
        dice.maybe(table, "scintillation_extent_m", 0.5, 0.5, 8.0)
        if "pulses" not in table and dice.chance(0.5, "time budget"):
            table |= {
                "budget": "dwell", "azimuth_beamwidth_deg": 60, "elevation_beamwidth_deg": 60,
                "prf_hz": 4000, "pulses_per_dwell": 20, "integration_gain_db": 0,
            }  # fmt: skip


def camera(dice: Dice, table: dict[str, Any]) -> None:
    """Add what cameras have."""
    if table["type"] == "optical.range_boundary":
        dice.maybe(table, "range_km", 0.7, 1, 5)
        return
    dice.maybe(table, "range_km", 0.4, 1, 5, 15)
    table |= {"azimuth_pixels": dice.pick(640, 2048), "elevation_pixels": 512}
    table["threshold"] = dice.pick(0.1, 1, 5)
    if dice.chance(0.2, "errors by contrast"):
        table |= {"errors": "signal", "noise_equivalent_contrast": dice.pick(0.02, 0.5)}
    if dice.chance(0.3, "dynamic signature"):
        table["dynamic_weight"] = dice.pick(0.5, 20)
        dice.maybe(table, "rate", 0.5, "exact", "thesis")
    if dice.chance(0.2, "camera false alarms"):
        table["false_alarms_per_frame"] = dice.pick(0.01, 0.5, 1.0)
    if table["type"] == "optical.projection":
        dice.maybe(table, "band", 0.5, "eo", "ir")
        return
    if dice.chance(0.5, "silhouette of its own"):
        kinds = ("thesis", "convex_hull", "sampled_table", "exact", "aspect_table", "mesh")
        table["silhouette"] = kinds[dice.choices(range(6), (4, 3, 2, 2, 2, 0.3))[0]]
        dice.features.add(f"silhouette {table['silhouette']}")
    if table["type"] == "optical.ir":
        if dice.chance(0.2, "plume"):
            table["plume"] = True
        if dice.chance(0.3, "infrared band"):
            table["extinction_band"] = dice.pick("mwir", "lwir")
    elif dice.chance(0.4, "background"):
        table["background"] = dice.pick("auto", "sky", "ground")
        dice.maybe(table, "sky", 0.5, "clear", "partly_cloudy", "overcast")
        if dice.chance(0.5, "sun"):
            table |= {"sun_exclusion_deg": 20, "sun_azimuth_deg": dice.pick(0, 180, -90)}


def sensor(dice: Dice, steered: bool) -> dict[str, Any]:
    """Return a sensor of any type.

    Parameters
    ----------
    dice : Dice
    steered : bool
        Whether the scene has a loop: beams then sweep more often.
    """
    table: dict[str, Any] = {"type": dice.pick(*SENSORS)}
    dice.features.add(table["type"])
    clock(dice, table)
    common(dice, table)
    if table["type"].startswith("radar"):
        radar(dice, table, steered)
    else:
        camera(dice, table)
    return table


_STATED = {
    "errors": "stated", "azimuth_error_deg": 0.3, "elevation_error_deg": 0.4, "range_error_m": 12,
}  # fmt: skip


def cued_radar(dice: Dice) -> dict[str, Any]:
    """Return a radar that looks harder where it is cued, and a tracker can weigh."""
    table: dict[str, Any] = {
        "type": dice.pick("radar.threshold", "radar.swerling"), "scan_rate_hz": dice.pick(1, 3),
        "range_km": 15, "wavelength_m": 0.00857, "bandwidth_hz": 500.0, **_OASYS, **_STATED,
        "cued_dwell_factor": dice.pick(1, 4),
    }  # fmt: skip
    if table["type"] == "radar.threshold":
        dice.maybe(table, "cued_threshold_db", 0.5, 3.0)
        return table
    dice.maybe(table, "cued_pulses", 0.3, 4)
    dice.maybe(table, "cued_false_alarm_probability", 0.3, 0.2)
    if dice.chance(0.3, "beam visits cues first"):
        table |= {"beam_sweep": True, "cued_beam_first": True}
    return table


def spotter(dice: Dice) -> dict[str, Any]:
    """Return a sensor that sees all within its range, and a tracker can weigh."""
    return {"type": "radar.range_boundary", "scan_rate_hz": dice.pick(0.5, 2), "range_km": 15,
            **_STATED}  # fmt: skip


def estimator(dice: Dice) -> dict[str, Any]:
    """Return a tracker that estimates states."""
    table: dict[str, Any] = {"type": dice.pick("tracking.ekf", "tracking.ukf", "tracking.imm")}
    dice.maybe(table, "association", 0.4, "nearest", "jpda")
    dice.maybe(table, "late", 0.4, "one_step", "rerun")
    return table


def cues(dice: Dice) -> dict[str, Any]:
    """Return what tells a tracker's cones."""
    table: dict[str, Any] = {"type": "tracking.cues"}
    dice.maybe(table, "every_s", 0.5, 0, 1)
    dice.maybe(table, "tentative", 0.3, False)
    return table


def fusion(dice: Dice) -> dict[str, Any]:
    """Return a fusion."""
    if dice.chance(0.5, "fusion.pick_best"):
        table: dict[str, Any] = {"type": "fusion.pick_best"}
        dice.maybe(table, "coincidence_s", 0.6, 0, 0.04, 0.5, "1/3")
        return table
    dice.features.add("fusion.gated")
    return {
        "type": "fusion.gated", "time_gate_s": dice.pick(0, 0.1, 0.5),
        "angle_gate_deg": dice.pick(0.5, 2, 20), "range_gate_m": dice.pick(50, 300, 3000),
    }  # fmt: skip


def tracker(dice: Dice) -> dict[str, Any]:
    """Return a tracker."""
    table: dict[str, Any] = {"type": "tracking.stub"}
    if dice.chance(0.4, "tracks are dropped"):
        table["drop_after_s"] = dice.pick(0.3, 1, 10)
    return table


def estimating_tracker(dice: Dice) -> dict[str, Any]:
    """Return a tracker that estimates states."""
    table: dict[str, Any] = {"type": dice.pick("tracking.ekf", "tracking.ukf", "tracking.imm")}
    dice.maybe(table, "association", 0.6, "nearest", "jpda")
    if dice.chance(0.6, "late looks that count"):
        table["late"] = dice.pick("one_step", "rerun")
        dice.maybe(table, "lag_s", 0.5, 0.3, 3)
    dice.maybe(table, "initiation", 0.3, "likelihood_ratio")
    dice.maybe(table, "confirm_m", 0.3, 2)
    dice.maybe(table, "delete_misses", 0.3, 2)
    dice.maybe(table, "false_alarms_per_scan", 0.3, 5)
    return table


def avoidance(dice: Dice) -> dict[str, Any]:
    """Return an avoidance."""
    return {
        "type": "avoidance.turn_away", "range_km": dice.pick(1, 5, 15),
        "turn_deg": dice.pick(2, 20, 90), "rate_deg_s": dice.pick(1, 3, 30),
        "pause_s": dice.pick(0, 0.1, "1/3", 1, 5),
    }  # fmt: skip


def sections(dice: Dice) -> dict[str, Any]:
    """Return tables that belong to no block: weather, terrain, navigation, accuracy."""
    found: dict[str, Any] = {}
    if dice.chance(0.25, "weather"):
        weather: dict[str, Any] = {}
        for feature, values in {
            "gas": {"gas": True, "vapour_density_g_m3": dice.pick(0, 7.5, 30)},
            "rain": {"rain_rate_mm_h": dice.pick(1, 20, 100)},
            "fog": {"fog_water_g_m3": dice.pick(0.05, 1), "fog_top_m": dice.pick(500, 2000)},
            "visibility": {"visibility_km": dice.pick(1, 23)},
            "wind": {"wind_mps": dice.pick(3, 25), "wind_from_deg": dice.pick(0, 217)},
            "night": {"night": dice.pick(True, False)},
        }.items():
            if dice.chance(0.4, feature):
                weather |= values
        found["weather"] = weather
    if dice.chance(0.15, "terrain"):
        found["terrain"] = {"height_m": dice.pick(-10, 50)}
        dice.maybe(found["terrain"], "clutter_gamma_db", 0.5, -20, 0, 20)
        dice.maybe(found["terrain"], "clutter_mean", 0.5, "constant", "fluctuating")
        dice.maybe(found["terrain"], "clutter_motion_m_s", 0.3, 0.4)
    if dice.chance(0.2, "what the Earth hides"):
        terrain = found.setdefault("terrain", {})
        dice.maybe(terrain, "horizon", 0.8, True)
        dice.maybe(terrain, "refraction", 0.5, "four_thirds")
    if dice.chance(0.25, "navigation"):
        navigation: dict[str, Any] = {}
        dice.maybe(navigation, "position_bias_m", 0.5, [5, -3, 2])
        dice.maybe(navigation, "position_noise_m", 0.6, [5, 5, 10])
        dice.maybe(navigation, "attitude_bias_deg", 0.5, [0, 1, 0], [-2, 0, 0.5])
        dice.maybe(navigation, "attitude_noise_deg", 0.6, [0.5, 0.1, 0.1])
        found["navigation"] = navigation
    if dice.chance(0.2, "accuracy"):
        accuracy: dict[str, Any] = {}
        dice.maybe(accuracy, "angle_deg", 0.7, 0.01, 0.5)
        dice.maybe(accuracy, "range_m", 0.7, 1, 100)
        dice.maybe(accuracy, "detection_probability", 0.7, 1e-5, 0.01)
        found["accuracy"] = accuracy
    return found


def closest_approach_passed(dice: Dice) -> dict[str, Any]:
    """Return a block that ends the run when all aircraft have passed."""
    return {
        "type": "encounters.closest_approach_passed", "after_s": dice.pick(0, 0.5, 2, "7/3"),
        "beyond_m": dice.pick(0, 0, 0, 900), "scan_rate_hz": dice.pick(1, 2, "10/3"),
        "offset_s": dice.pick(0, 0, 0.4), "jitter_s": dice.pick(0, 0, 0.05),
    }  # fmt: skip
