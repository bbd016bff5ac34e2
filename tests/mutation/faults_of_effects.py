"""Faults of effects: wrong verdicts, bounds too small, planned but not called, called twice."""

from fault import in_file

_GROUP = "effects"
_SHARED = "engine/test_tolerances_are_shared.py"
_PLAN = (
    "test_planning_changes_nothing.py::"
    "test_simulating_everything_beside_what_a_scene_calls_for_gives_the_same_bytes"
)
_RADAR_EFFECTS = "radar/test_radar_effects.py::test_the_reason_is_in_the_scene"
_HOOKS = "engine/test_hooks_of_effects.py"
_WEATHER = "wiring/test_weather_on_radar.py"
_BOUNDS = "accuracy/test_what_a_tolerance_leaves_out.py"
_PD = "accuracy/test_auto_models.py::test_auto_pd_says_why_and_contradicts_a_named_method"

FAULTS = [
    *in_file(
        _GROUP, "dsa_des/running/effect_plan.py", _SHARED,
        ("tolerance-never-spent",
         "            for quantity, bound in verdict.bound.items():\n"
         "                left[quantity] -= bound\n            parts",
         "            parts"),
        ("over-the-tolerance", "if all(bound <= left[quantity] for",
         "if all(bound <= 2.0 * left[quantity] for"),
        ("unbounded-is-left-out", "if verdict.simulated and verdict.bound and all(",
         "if verdict.simulated and all("),
        ("left-out-spends-nothing", "if item.verdict.simulated and not item.built:",
         "if item.verdict.simulated and item.built:"),
        ("everything-keeps-tolerances", "allowed = {} if everything else _within(",
         "allowed = _within("),
    ),
    *in_file(
        _GROUP, "dsa_des/running/effect_plan.py", (_SHARED, _PLAN),
        ("everything-is-not", "elif everything and not built and effect.neutral:",
         "elif False and not built and effect.neutral:"),
    ),
    *in_file(
        _GROUP, "dsa_des/running/assembly.py", (_HOOKS, _BOUNDS),
        ("planned-but-not-built",
         "for item, effect in built.items()\n            }",
         "for item, effect in list(built.items())[1:]\n            }"),
        ("tolerance-not-passed-on", "component.context.tolerance = unspent(found, tolerance)",
         "component.context.tolerance = dict(tolerance)"),
    ),
    *in_file(
        _GROUP, "components/radar/weather_effects.py", (_WEATHER, _RADAR_EFFECTS),
        ("fog-not-called-for", "return Verdict(water > 0, because,",
         "return Verdict(water > 5, because,"),
        ("rain-not-called-for", "return Verdict(rate > 0, because,",
         "return Verdict(rate > 100, because,"),
        ("gas-not-called-for", 'return Verdict(True, "[weather] gas is true", self.bound(block))',
         'return Verdict(False, "[weather] gas is true", self.bound(block))'),
        ("weather-that-does-nothing", "return two_way_transmission(loss_db)",
         "return two_way_transmission(0.0 * loss_db)"),
    ),
    *in_file(
        _GROUP, "components/radar/weather_effects.py", _BOUNDS,
        ("bound-of-one-way", "most_db = 2.0 * worst_one_way_db(table, reach_m)",
         "most_db = worst_one_way_db(table, reach_m) / 4.0"),
        ("bound-without-steepness", "influence = steepness * most_db * math.log(10.0) / 10.0",
         "influence = 0.01 * most_db * math.log(10.0) / 10.0"),
    ),
    *in_file(
        _GROUP, "components/radar/radar_block.py", (_WEATHER, _RADAR_EFFECTS),
        ("factors-not-fetched", 'self.snr_factors = self.built("SNR")',
         'self.snr_factors = self.built("SNR")[1:]'),
    ),
    *in_file(
        _GROUP, "components/radar/threshold_radar.py",
        (_WEATHER, "wiring/test_ground_clutter_in_ned.py", "wiring/test_aspect_tables.py"),
        ("factors-not-called", "for factor in self.snr_factors:", "for factor in ():"),
        ("only-the-first-factor", "for factor in self.snr_factors:",
         "for factor in self.snr_factors[:1]:"),
        ("clutter-not-fetched", 'self.echoes = self.built("clutter")', 'self.echoes = []'),
        ("aspect-not-fetched", '(self.mean_rcs_m2,) = self.built("mean RCS") or [constant_rcs_m2]',
         '(self.mean_rcs_m2,) = [constant_rcs_m2]'),
    ),
    *in_file(
        _GROUP, "components/radar/swerling.py",
        ("wiring/test_radar_detection_keys.py", "radar/test_ground_clutter_effect.py"),
        ("steady-whatever-the-model", '(self._models,) = self.built("RCS") or [steady]',
         "(self._models,) = [steady]"),
        ("table-for-the-exact", '(self._method,) = self.built("method of Pd") or ["table"]',
         '(self._method,) = ["albersheim"]'),
        ("clutter-not-in-pd", "if not (mean.any() or diffuse.any()):", "if True:"),
    ),
    *in_file(
        _GROUP, "components/radar/rcs_effects.py",
        ("radar/test_swerling_block.py", _RADAR_EFFECTS, "wiring/test_calibrated_radars.py",
         "wiring/test_aspect_tables.py"),
        ("fluctuation-not-called-for", 'return Verdict(block.p.swerling not in (0, 5), ',
         'return Verdict(block.p.swerling in (0, 5), '),
        ("steady-targets-outvote", "if craft.swerling % 5]", "if craft.swerling == 1]"),
        ("aspect-switch-upside-down", "if not block.p.aspect_rcs:", "if block.p.aspect_rcs:"),
    ),
    *in_file(
        _GROUP, "components/radar/range_effects.py",
        ("radar/test_radar_effects.py::"
         "test_no_echo_in_the_blind_range_and_the_same_one_beyond", _RADAR_EFFECTS,
         "wiring/test_radar_detection_keys.py"),
        ("blind-far-away", "np.where(cells.range_m < nearest_m, 0.0, 1.0)",
         "np.where(cells.range_m > nearest_m, 0.0, 1.0)"),
        ("never-blind", "nearest = block.p.minimum_range_m\n", "nearest = None\n"),
    ),
    *in_file(
        _GROUP, "components/radar/clutter_effects.py", "wiring/test_ground_clutter_in_ned.py",
        ("clutter-not-called-for", 'return Verdict(True, f"[terrain]',
         'return Verdict(terrain.height_m < -500, f"[terrain]'),
    ),
    *in_file(
        _GROUP, "components/radar/beam_effects.py", "wiring/test_beams_on_mounted_radars.py",
        ("beam-stands-still", 'return Verdict.of_flag(block.p, "beam_sweep")',
         'return Verdict(False, "beam_sweep is false")'),
    ),
    *in_file(
        _GROUP, "components/radar/false_alarm_effects.py",
        ("wiring/test_false_alarms_of_radars.py", "wiring/test_radar_detection_keys.py"),
        ("alarms-of-a-radar-that-is-off", "if parameters.false_alarms and not parameters.enabled:",
         "if False:", "a radar that is off sends nothing, alarms neither"),
        ("no-alarms", 'return Verdict.of_flag(parameters, "false_alarms")',
         'return Verdict(False, "false_alarms is false")'),
    ),
    *in_file(
        _GROUP, "components/optical/camera.py",
        ("wiring/test_camera_keys.py", "wiring/test_camera_signature.py"),
        ("plume-not-fetched", 'self._areas = self.built("area")', "self._areas = []"),
        ("visibility-not-fetched", 'self._contrast_factors = self.built("contrast")',
         "self._contrast_factors = []"),
        ("motion-not-fetched", 'self._signatures = self.built("signature")',
         "self._signatures = []"),
        ("visibility-instead-of-contrast", "contrast = contrast * factor(cells)",
         "contrast = factor(cells)"),
        ("plume-instead-of-area", "area = area + added(cells)", "area = added(cells)"),
    ),
    *in_file(
        _GROUP, "components/optical/camera.py",
        ("wiring/test_cameras_that_look_no_farther.py",),
        ("looks-half-as-far", "nearer_m = min(self.reach.range_max_m, farthest_m)",
         "nearer_m = min(self.reach.range_max_m, 0.5 * farthest_m)"),
    ),
    *in_file(
        _GROUP, "components/optical/detector.py",
        ("wiring/test_cameras_that_look_no_farther.py", "sensor_effects/test_camera_effects.py"),
        ("farthest-by-the-front-alone", '        + roster.column(f"{areas}.side_m2")\n', ""),
        ("farthest-by-the-least", "float(np.max(area * roster.column(contrast)))",
         "float(np.min(area * roster.column(contrast)))"),
        ("farthest-without-the-back", 'ends.append(roster.column("ir.back_m2"))', "pass"),
        ("farthest-without-contrast", "np.max(area * roster.column(contrast))", "np.max(area)"),
        ("farthest-at-threshold-one", "gain / (pixel * faintest)", "gain / pixel"),
        ("farthest-despite-plumes", "        or adding\n", ""),
        ("farthest-despite-tables",
         'or camera.p.silhouette in ("aspect_table", "sampled_table", "mesh")',
         'or camera.p.silhouette in ("sampled_table", "mesh")'),
    ),
    *in_file(
        _GROUP, "components/optical/dynamic_signature.py",
        ("wiring/test_camera_signature.py", "wiring/test_what_is_remembered_across_windows.py"),
        ("motion-not-called-for", 'return Verdict(weight > 0, f"dynamic_weight',
         'return Verdict(weight > 1e9, f"dynamic_weight'),
        ("motion-forgets-the-last-scan",
         "angles[:, earlier], tick[earlier] = ", "_, tick[earlier] = "),
    ),
    *in_file(
        _GROUP, "components/optical/plume.py", "wiring/test_camera_keys.py",
        ("plume-of-the-first-engine", "if PLUME_SHARE_OF_BACK[engine] > 0.0:",
         "if PLUME_SHARE_OF_BACK[engine] > 0.5:"),
    ),
    *in_file(
        _GROUP, "components/optical/weather_effects.py", "wiring/test_camera_keys.py",
        ("fog-leaves-cameras-clear", '("fog_water_g_m3", weather.fog_water_g_m3),', ""),
    ),
    *in_file(
        _GROUP, "components/optical/frame_false_alarms.py", "wiring/test_camera_keys.py",
        ("frames-without-alarms", "return Verdict(rate > 0, f", "return Verdict(rate > 0.5, f"),
    ),
    *in_file(
        _GROUP, "components/sensor/sensor.py",
        ("sensor_effects/test_declaration_delay.py", "wiring/test_measured_angles.py",
         "wiring/test_navigation_keys.py"),
        ("judges-not-called", "for judge in self._judgements:", "for judge in ():"),
        ("reports-not-called", "for report in self._reporting:", "for report in ():"),
    ),
    *in_file(
        _GROUP, "components/sensor/measuring.py",
        ("wiring/test_measured_angles.py", "sensor_effects/test_sensor_mounting.py"),
        ("measured-in-body-axes", "azimuth, elevation = self.axes(azimuth_rad, elevation_rad)",
         "azimuth, elevation = azimuth_rad, elevation_rad"),
        ("reported-in-sensor-axes", "return *self.axes.to_body(*angles), ", "return *angles, "),
        ("mounting-not-fetched", "return mounted[0] if mounted else _BODY_AXES",
         "return _BODY_AXES"),
    ),
    *in_file(
        _GROUP, "components/sensor/mounting.py",
        ("sensor_effects/test_sensor_mounting.py", "wiring/test_measured_angles.py",
         "wiring/test_reach.py"),
        ("roll-alone-is-no-mounting", '"mount_roll_deg": p.mount_roll_deg,',
         '"mount_roll_deg": 0.0 * p.mount_roll_deg,'),
        ("misalignment-not-called-for", "if any(p.misalignment_deg):", "if False:"),
    ),
    *in_file(
        _GROUP, "components/sensor/declaration_rule.py",
        ("sensor_effects/test_declaration_delay.py",
         "wiring/test_what_is_remembered_across_windows.py"),
        ("m-is-n", "Declarations(block.p.declare_m or 1, block.p.declare_n or 1)",
         "Declarations(block.p.declare_n or 1, block.p.declare_n or 1)"),
        ("last-declaration-for-first", "new = self._first_tick[target] < 0",
         "new = self._first_tick[target] < 1 << 60"),
    ),
    *in_file(
        _GROUP, "components/navigation/effects.py", "wiring/test_navigation_keys.py",
        ("bias-alone-is-no-error", "        if any(values)\n",
         '        if any(values) and "bias" not in key\n'),
    ),
    *in_file(
        _GROUP, "components/radar/detection_rung.py",
        (_BOUNDS, "radar/test_detection_rungs.py", _PD),
        ("table-errs-by-nothing", "TABLE_ERROR = 1e-6", "TABLE_ERROR = 1e-3"),
        ("closed-form-for-many-pulses",
         "return block.p.pulses_summed == 1 and _models(block) <= {1, 2}",
         "return _models(block) <= {1, 2}"),
    ),
    *in_file(
        _GROUP, "components/line_of_sight/transform.py",
        "wiring/test_picked_models_are_used.py",
        ("picked-attitude-not-used", "LineOfSight(self.rung.earth, self.rung.attitude)",
         'LineOfSight(self.rung.earth, "exact")'),
        ("picked-earth-not-used", "LineOfSight(self.rung.earth, self.rung.attitude)",
         'LineOfSight("ellipsoid", self.rung.attitude)'),
    ),
    *in_file(
        _GROUP, "components/messages/reach.py",
        ("wiring/test_reach.py", "wiring/test_a_sensor_that_is_off_keeps_none.py",
         "test_culling.py"),
        ("sensor-that-is-off-looks", "elif request.enabled:", "elif True:"),
        ("nearest-reach-counts", "max(look.range_m for look in looks)",
         "min(look.range_m for look in looks if look.range_m > 0 or len(looks) == 1)"),
        ("in-range-is-out", "seen &= range_m > self.range_max_m",
         "seen &= range_m > 0.9 * self.range_max_m"),
        ("absent-targets-are-seen", "reason[~present] = ABSENT", "pass"),
    ),
    *in_file(
        _GROUP, "dsa_des/running/timing_effects.py",
        ("wiring/test_wires_and_processors.py", "cli/test_explain_command.py"),
        ("lossless", "return everything or LOSS.verdict(wire).simulated or",
         "return everything or"),
        ("never-late", " or WIRE_JITTER.verdict(wire).simulated", ""),
    ),
]  # fmt: skip
