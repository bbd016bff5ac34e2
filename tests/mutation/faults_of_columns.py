"""Faults of recorded columns: a column that holds another one's values, or a wrong count."""

from fault import in_file

_GROUP = "columns"
_MEASURED = "wiring/test_measured_angles.py"
_TRACKED = "wiring/test_fused_and_tracked_positions.py"
_NOISE = "wiring/test_noise_passes_the_fusion.py"
_QUEUE = ("wiring/test_ages_and_queues.py", "engine/test_shared_processors.py")

FAULTS = [
    *in_file(
        _GROUP, "components/sensor/sensor.py", (_MEASURED, "wiring/test_line_of_sight.py"),
        ("true-azimuth-is-measured", "true_azimuth_rad=p,", "true_azimuth_rad=azimuth,"),
        ("true-elevation-is-measured", "true_elevation_rad=q,", "true_elevation_rad=elevation,"),
        ("true-range-is-measured", "true_range_m=r,", "true_range_m=range_m,"),
        ("measured-azimuth-is-true", "            azimuth_rad=azimuth,",
         "            azimuth_rad=p,"),
        ("elevation-is-azimuth-s", "            elevation_rad=elevation,",
         "            elevation_rad=azimuth,"),
    ),
    *in_file(
        _GROUP, "components/sensor/grid.py", (_MEASURED, "wiring/test_line_of_sight.py"),
        ("cameras-measure-range", "if self._range_step is None:", "if False:"),
    ),
    *in_file(
        _GROUP, "components/sensor/skip_counts.py",
        ("wiring/test_reach.py", "test_culling.py", "sensor_effects/test_lost_targets.py"),
        ("culled-are-absent", "skipped[CULLED] = culled", "skipped[CULLED] = 0 * culled"),
        ("evaluated-is-all-there", "return of[EVALUATE], skipped",
         "return of[EVALUATE] + skipped[\"range\"], skipped"),
        ("reasons-swapped", "skipped = {name: of[code] for name, code in SKIP_REASONS.items()}",
         'skipped = {name: of[code] for name, code in SKIP_REASONS.items()}\n'
         '    skipped["range"], skipped["off"] = skipped["off"], skipped["range"]'),
        ("absent-with-culled", 'skipped["absent"] + (left_out - culled)',
         'skipped["absent"] + left_out'),
    ),
    *in_file(
        _GROUP, "components/messages/detections.py",
        (_NOISE, _TRACKED, "wiring/test_radars_together.py"),
        ("detected-is-an-offset", "value=lambda message: np.diff(message.offsets)",
         "value=lambda message: message.offsets[1:]"),
    ),
    *in_file(
        _GROUP, "components/messages/fused.py", (_TRACKED, "wiring/test_radars_together.py"),
        ("range-source-is-angle-source",
         "value=lambda message: Text(message.range_source, message.sensors)",
         "value=lambda message: Text(message.angle_source, message.sensors)"),
    ),
    *in_file(
        _GROUP, "components/messages/contributors.py",
        (_TRACKED, "wiring/test_radars_together.py"),
        ("sensors-by-number-reversed",
         "[name for i, name in enumerate(sensors) if mask >> i & 1]",
         "[name for i, name in enumerate(reversed(sensors)) if mask >> i & 1]"),
    ),
    *in_file(
        _GROUP, "components/messages/detections.py",
        ("sensor_effects/test_declaration_delay.py", "sensor_effects/test_camera_false_alarms.py",
         "radar/test_false_alarm_counts.py"),
        ("no-alarm-declares", "np.ones(len(self.target), dtype=bool), **extras}",
         "self.target >= 0, **extras}"),
        ("all-declare", '{"declared": np.ones(len(self.target), dtype=bool), **extras}',
         '{**extras, "declared": np.ones(len(self.target), dtype=bool)}'),
    ),
    *in_file(
        _GROUP, "components/fusion/fusion_block.py", (_TRACKED, "wiring/test_radars_together.py"),
        ("contributors-overwritten", "contributors[found[name]] |= 1 << index",
         "contributors[found[name]] = 1 << index"),
        ("range-source-unsaid", "range_source[found[name]] = index",
         "range_source[found[name]] = -1"),
    ),
    *in_file(
        _GROUP, "components/fusion/false_alarms.py", _NOISE,
        ("alarm-s-source-is-the-first", '("angle_source", index),', '("angle_source", 0),'),
        ("alarm-s-elevation-is-azimuth",
         'columns[column].append(getattr(new.message, column)[false])\n            columns[f"true',
         'columns[column].append(new.message.azimuth_rad[false])\n            columns[f"true'),
    ),
    *in_file(
        _GROUP, "components/messages/false_detections.py",
        (_NOISE, "wiring/test_radar_detection_keys.py"),
        ("alarms-have-true-ranges", "true_range_m=joined(detections.true_range_m, np.nan),",
         "true_range_m=joined(detections.true_range_m, range_m),"),
        ("alarms-are-the-first-target", "target=joined(detections.target, FALSE_TARGET),",
         "target=joined(detections.target, 0),"),
        ("alarms-at-the-horizon", "elevation_rad=joined(detections.elevation_rad, elevation_rad),",
         "elevation_rad=joined(detections.elevation_rad, 0.0),"),
    ),
    *in_file(
        _GROUP, "components/tracking/stub.py",
        (_TRACKED, "wiring/test_each_plane_has_its_own_report.py"),
        ("track-s-azimuth-is-elevation", 'azimuth_rad=pool["azimuth_rad"][entry],',
         'azimuth_rad=pool["elevation_rad"][entry],'),
        ("updated-by-the-first", 'contributors=pool["contributors"][entry],',
         'contributors=pool["contributors"][0 * entry],'),
    ),
    *in_file(
        _GROUP, "components/radar/swerling.py",
        ("wiring/test_radar_detection_keys.py", "radar/test_swerling_block.py"),
        ("pd-is-snr", '{"snr_db": snr_db, "detection_probability": pd}',
         '{"snr_db": snr_db, "detection_probability": snr}'),
        ("confidence-is-snr", "confidence[chosen] = snr_db[chosen] - self._reference(model)",
         "confidence[chosen] = snr_db[chosen]"),
    ),
    *in_file(
        _GROUP, "components/radar/threshold_radar.py",
        ("wiring/test_calibrated_radars.py", "wiring/test_ground_clutter_in_ned.py"),
        ("snr-less-clutter", 'Look(echo & (margin >= 0.0), margin, {"snr_db": snr_db}',
         'Look(echo & (margin >= 0.0), margin, {"snr_db": margin}'),
    ),
    *in_file(
        _GROUP, "components/optical/camera.py",
        ("wiring/test_camera_keys.py", "wiring/test_camera_signature.py"),
        ("pixels-are-the-signature", 'Look(margin >= 0.0, margin, {"pixels": pixels}',
         'Look(margin >= 0.0, margin, {"pixels": signature}'),
        ("confidence-is-the-signature", 'Look(margin >= 0.0, margin, {"pixels": pixels}',
         'Look(margin >= 0.0, signature, {"pixels": pixels}'),
    ),
    *in_file(
        _GROUP, "components/sensor/declaration_rule.py", "sensor_effects/test_declaration_delay.py",
        ("range-of-the-first-cell", "self._first_range_m[target[new]] = cells.range_m[first]",
         "self._first_range_m[target[new]] = cells.range_m[0 * first]"),
    ),
    *in_file(
        _GROUP, "components/messages/steering.py", "wiring/test_turning_away.py",
        ("manoeuvres-not-recorded", 'row_table = "manoeuvres"', 'row_table = "turns"'),
    ),
    *in_file(
        _GROUP, "components/avoidance/turn_away.py", "wiring/test_turning_away.py",
        ("turn-recorded-as-rate",
         "Manoeuvres(np.array(ticks, dtype=np.int64), np.array(turns), rate)",
         "Manoeuvres(np.array(ticks, dtype=np.int64), rate, np.array(turns))"),
    ),
    *in_file(
        _GROUP, "dsa_des/running/processors.py", _QUEUE,
        ("entered-is-started", '"entered_s": self.entered / self.ticks_per_s',
         '"entered_s": self.started / self.ticks_per_s'),
        ("started-in-ticks", "np.where(worked, self.started / self.ticks_per_s, np.nan)",
         "np.where(worked, self.started, np.nan)"),
        ("dropped-is-done", '_OUTCOMES = ("done", "dropped", "skipped")',
         '_OUTCOMES = ("done", "skipped", "dropped")'),
    ),
    *in_file(
        _GROUP, "components/embedding/result.py",
        ("wiring/test_each_plane_has_its_own_report.py", "wiring/test_host_plane_keys.py"),
        ("host-is-told-elevation-first",
         "return self.azimuth_rad, self.elevation_rad, self.range_m",
         "return self.elevation_rad, self.azimuth_rad, self.range_m"),
        ("host-s-confidence-of-another", "confidence = {s: m[target] for s, m in margins.items()",
         "confidence = {s: m[min(m)] for s, m in margins.items()"),
    ),
    *in_file(
        _GROUP, "components/traffic/source.py", ("traffic/test_closest_approach.py",
                                                  "traffic/test_censored_approaches.py"),
        ("closest-time-is-range", '"time_s": time_s,\n                        "range_m": range_m,',
         '"time_s": range_m,\n                        "range_m": range_m,'),
    ),
]  # fmt: skip
