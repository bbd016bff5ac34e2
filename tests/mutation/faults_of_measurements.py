"""Faults of measured values: what their errors are drawn by, follow from, and are stated as."""

from fault import in_file

_GROUP = "measurements"
_VALUES = "wiring/test_measured_values.py"
_ERRORS = (
    "wiring/test_errors_of_measurement.py::test_the_error_of_one_quantity_tells_nothing_of_another"
)
_NOISE_IS = "wiring/test_what_noise_is_drawn_of.py"
_IN_CELL = "wiring/test_noise_lies_in_its_cell.py"
_VARIANCES = "wiring/test_variances_of_detections.py"
_CARRIED = "wiring/test_what_fusion_carries.py"
_ALIKE = "wiring/test_false_alarms_look_like_targets.py"

FAULTS = [
    *in_file(
        _GROUP, "components/optical/frame_false_alarms.py", _ALIKE,
        ("alarms-just-at-the-threshold", "signature - found.threshold,", "0.0 * signature,"),
        ("alarms-of-no-pixels", 'else {"pixels": signal["pixels"]}', "else {}"),
        ("alarms-of-cameras-last", "joined if marked else in_measured_order(joined)", "joined"),
        ("alarms-of-one-contrast", "contrasts[which.astype(np.int64)]",
         "contrasts[0 * which.astype(np.int64)]"),
    ),
    *in_file(
        _GROUP, "components/optical/detection.py", _ALIKE,
        ("noise-of-cameras-half-as-wide", 'deviation = float(positive("noise", noise))',
         'deviation = 0.5 * float(positive("noise", noise))'),
    ),
    *in_file(
        _GROUP, "components/optical/detector.py", "wiring/test_calibrated_cameras.py",
        ("calibrated-at-a-tenth-less", "threshold = signature - above * noise",
         "threshold = 0.9 * signature - above * noise"),
        ("calibrated-in-clear-air", "contrast = contrast * visibility_transmission",
         "contrast = contrast + 0.0 * visibility_transmission"),
        ("calibrated-from-behind", "[math.pi - aspect_rad]", "[aspect_rad]"),
        ("noise-by-a-lower-rate", "deviations_exceeded(false_alarms / places)",
         "deviations_exceeded(0.5 * false_alarms / places)"),
    ),
    *in_file(
        _GROUP, "components/optical/camera.py", "wiring/test_calibrated_cameras.py",
        ("samples-without-noise", "signature + noise * self._noise",
         "signature + 0.0 * self._noise"),
        ("cameras-of-the-usual-blur", "spot = noise_equivalent_pixels(self.p.blur_pixels)",
         "spot = noise_equivalent_pixels(0.5)"),
        ("the-faint-are-seen", "(margin >= 0.0) & (signature >", "(margin >= 0.0) | (signature >"),
    ),
    *in_file(
        _GROUP, "components/messages/false_detections.py", _ALIKE,
        ("targets-in-their-order", "np.lexsort((*measured, row))", "np.argsort(row)"),
    ),
    *in_file(
        _GROUP, "components/radar/false_alarm_effects.py", _ALIKE,
        ("alarms-of-radars-last", "return in_measured_order(detections)",
         "return detections"),
    ),
    *in_file(
        _GROUP, "components/radar/measured_strength.py", _ALIKE,
        ("errors-by-the-mean-echo", "signal[found] = snr", "signal[found] *= 1.0"),
        ("confidence-of-the-mean-echo", "confidence[found] = snr_db[found] -",
         "confidence[found] = extras[\"snr_db\"][found] -"),
    ),
    *in_file(
        _GROUP, "components/sensor/declaration_by_place.py",
        ("sensor_effects/test_declaration_delay.py::test_places_are_remembered_across_windows",
         "wiring/test_what_is_remembered_across_windows.py", _ALIKE),
        ("places-forgotten", "if self._memory is not None:", "if False:"),
        ("places-of-one-scan-fewer", "- self.n + 1", "- self.n + 2"),
        ("places-declared-by-any", "declared = company >= self.m", "declared = company >= 1"),
        ("places-in-body-axes", "        if own:\n            turned",
         "        if False:\n            turned"),
        ("places-at-any-speed", "~(np.abs(places.range_m[one] - places.range_m[other]) > gate_m)",
         "np.ones(len(one), dtype=bool)"),
        ("places-a-scan-apart", "wanted = places.scan[asked] - lag",
         "wanted = places.scan[asked] - 1"),
    ),
    *in_file(
        _GROUP, "components/sensor/measurement_errors.py", (_IN_CELL, _VARIANCES),
        ("places-of-noise-by-one-draw", "uniform(keys[noise], scan[noise], number)",
         "uniform(keys[noise], scan[noise], 0)"),
        ("cell-of-noise-by-its-edge", "np.rint(true[name][noise] / width)",
         "np.floor(true[name][noise] / width)"),
        ("false-alarms-off-the-grid",
         "return self._stated(self._valid(where), of_signal, signal)",
         "return self._stated(dict(where), of_signal, signal)"),
    ),
    *in_file(
        _GROUP, "components/sensor/measurement_errors.py",
        "lockstep/test_errors_in_lock_step.py",
        ("errors-of-the-first-replica", "cells.instant_ns[found], cells.replica[found]",
         "cells.instant_ns[found], np.zeros_like(cells.replica[found])"),
    ),
    *in_file(
        _GROUP, "components/sensor/quantity_error.py", (_VALUES, _ERRORS),
        ("lasting-errors-alike", 'stream(f"lasting error of {name}")', 'stream("lasting error")'),
        ("errors-alike", 'stream(f"error of {name}")', 'stream("error")'),
        ("biases-alike", 'stream(f"bias of {name}")', 'stream("bias")'),
        ("stated-error-is-the-signal-s", "_OWN, _OF_SIGNAL = 0, 1", "_OWN, _OF_SIGNAL = 0, 0"),
        ("drawn-bias-stated-as-fixed", "(3.0 if drawn_bias else 1.0)",
         "(1.0 if drawn_bias else 1.0)"),
    ),
    *in_file(
        _GROUP, "components/radar/signal_errors.py", _VALUES,
        ("errors-by-stated-pulses", "ratio = p.pulses_summed * snr", "ratio = p.pulses * snr"),
        ("doppler-by-stated-dwell", "dwell_s = p.stated_dwell_s if look is None else look.dwell_s",
         "dwell_s = p.stated_dwell_s"),
        ("doppler-one-way", "wavelength_m / (2.0 * dwell_s)", "wavelength_m / dwell_s"),
    ),
    *in_file(
        _GROUP, "components/radar/radar_block.py", _VARIANCES,
        ("noise-only-recedes", "off = 2.0 * uniform - 1.0", "off = uniform"),
        ("noise-of-a-still-ownship", "off * FASTEST_M_S - nearer_m_s", "off * FASTEST_M_S"),
    ),
    *in_file(
        _GROUP, "components/radar/swerling.py", _IN_CELL,
        ("ground-taken-for-the-target",
         "if clutter is not None or self._cued_detector(cells) is not None:", "if False:"),
    ),
    *in_file(
        _GROUP, "components/radar/fading.py",
        "wiring/test_fluctuation_that_lasts.py::test_echoes_of_targets_with_models_of_their_own_"
        "scintillate_as_if_alone",
        ("aspect-of-whoever-comes-first",
         "x, y, z = unit_vector(azimuth[chosen], elevation[chosen])",
         "x, y, z = (v[: len(azimuth[chosen])] for v in unit_vector(azimuth, elevation))"),
    ),
    *in_file(
        _GROUP, "components/fusion/carried.py", "wiring/test_fused_and_tracked_positions.py",
        ("carried-away-from-the-ownship-s-way", "away * seen - step)", "away * seen + step)"),
    ),
    *in_file(
        _GROUP, "components/radar/clutter_alarms.py", "wiring/test_clutter_false_alarms.py",
        ("ground-counted-with-its-noise", "extra = (pfa - of_noise) / (1.0 - of_noise)",
         "extra = pfa"),
        ("cells-of-the-ground-mixed-up", "np.divmod(beam, self._cells.elevation)",
         "np.divmod(beam, self._cells.azimuth)"),
        ("ground-below-the-threshold",
         "np.maximum(beyond + self._crossing.threshold - 1.0, FAINTEST)",
         "np.maximum(beyond - 1.0, FAINTEST)"),
        ("ground-as-strong-as-noise", "* (1.0 + cnr)\n        snr", "\n        snr"),
        ("ground-where-it-is-believed", "self._block.axes.pointing(*self._beams)",
         "self._block.axes.to_body(*self._beams)"),
        ("ground-in-the-ownship-s-axes", "self._block.axes.pointing(*self._beams)", "self._beams"),
        ("ground-that-always-fluctuates",
         'clutter=self._block.context.sections["terrain"].clutter_mean',
         'clutter="fluctuating"'),
        ("axes-before-they-are-built", "self._beams = azimuth, elevation",
         "self._beams = azimuth, elevation\n        self._body"),
    ),
    *in_file(
        _GROUP, "components/radar/measured_strength.py", "wiring/test_false_alarms_of_radars.py",
        ("strength-of-one-pulse", "pulses=crossing.pulses,", "pulses=1,"),
        ("strength-of-another-model", 'model=f"swerling{model}"', 'model="swerling2"'),
        ("strength-by-half-its-decibels", '10.0 ** (0.1 * extras["snr_db"][found])',
         '10.0 ** (0.05 * extras["snr_db"][found])'),
    ),
    *in_file(
        _GROUP, "components/messages/looks.py", "wiring/test_looks.py",
        ("looks-by-the-horizon", '"true_elevation_rad": cells.body_elevation_rad',
         '"true_elevation_rad": cells.elevation_rad'),
    ),
    *in_file(
        _GROUP, "components/sensor/mounting.py", _VARIANCES,
        ("variances-by-the-true-mounting",
         "            elevation_variance_rad2,\n            self.believed_rad",
         "            elevation_variance_rad2,\n            self.true_rad"),
    ),
    *in_file(
        _GROUP, "components/optical/camera.py", _VALUES,
        ("height-by-the-width-of-a-pixel", "self.pixel_elevation_rad**2 * variance",
         "self.pixel_azimuth_rad**2 * variance"),
        ("false-alarms-without-weight", "(self._weight * contrast)", "contrast"),
    ),
    *in_file(
        _GROUP, "components/radar/resolution_effects.py",
        "wiring/test_resolution_cells.py::test_astern_the_last_cell_is_the_first_one",
        ("two-cells-astern", "np.where(place[0] == -astern, astern, place[0])", "place[0]"),
    ),
    *in_file(
        _GROUP, "components/sensor/look.py",
        ("wiring/test_fluctuation_that_lasts.py::test_an_echo_fades_between_two_publications_of_"
         "where_its_target_is",
         _VALUES + "::test_range_rate_of_a_late_picture_is_that_of_its_own_instant"),
        ("fades-of-the-picture", "self._own(self.scan_ticks[self.row])",
         "self._own(self._targets.tick[self.message_rows][self.row])"),
        ("rates-of-when-the-picture-came",
         "state = targets.tick if targets.state_tick is None else targets.state_tick",
         "state = targets.tick"),
    ),
    *in_file(
        _GROUP, "components/traffic/wind_effect.py", "wiring/test_wind.py",
        ("roll-fixed-where-pitch-is", "np.where(keep[2], state.roll_rad, roll)",
         "np.where(keep[1], state.roll_rad, roll)"),
        ("fixed-after-it-was-steered", "np.asarray(time_s) < flight.parts[0][0]",
         "np.asarray(time_s) >= flight.parts[0][0]"),
        ("speed-of-another-flight", "flight = self._targets[int(columns[place])]",
         "flight = self._targets[place]"),
        ("fixed-of-another-flight", "self._fixed[:, np.newaxis, columns]",
         "self._fixed[:, np.newaxis, : len(columns)]"),
    ),
    *in_file(
        _GROUP, "components/line_of_sight/earth_effects.py",
        "wiring/test_what_the_earth_hides.py",
        ("mountains-by-straight-rays",
         "offset_m=terrain.raster_offset_m, refraction=terrain.refraction",
         'offset_m=terrain.raster_offset_m, refraction="none"'),
    ),
    *in_file(
        _GROUP, "components/line_of_sight/transform.py", "wiring/test_what_the_earth_hides.py",
        ("hidden-by-the-limb-alone", "[hides(own, other, present) for hides in self._hiding]",
         "[hides(own, other, present) for hides in self._hiding[:1]]"),
    ),
    *in_file(
        _GROUP, "components/operator/stochastic.py", "wiring/test_operator.py",
        ("coordinates-every-time", "if mind.has_acted:\n", "if False:\n"),
        ("never-waits", "tick >= mind.free_from", "tick >= 0"),
        ("has-acted-for-good",
         "since=None, acts_at=None, has_acted=False", "since=None, acts_at=None"),
    ),
    *in_file(
        _GROUP, "components/fusion/carried.py", _CARRIED,
        ("carried-by-the-opposite-rate", "reach + other.range_rate_m_s[theirs[moved]]",
         "reach - other.range_rate_m_s[theirs[moved]]"),
        ("carried-without-its-rate", "* ticks[moved] / self._ticks_per_s", "* ticks[moved] * 0.0"),
    ),
    *in_file(
        _GROUP, "components/fusion/fusion_block.py", _CARRIED,
        ("rate-of-the-coarsest",
         "for name in reversed(best_angles)\n            if offers[name].measures_range_rate",
         "for name in best_angles\n            if offers[name].measures_range_rate"),
    ),
    *in_file(
        _GROUP, "components/fusion/gated.py", _CARRIED,
        ("target-of-the-worst-sensor", "for name in reversed(order):", "for name in order:"),
    ),
    *in_file(
        _GROUP, "components/fusion/gate_match.py", _CARRIED,
        ("nothing-measured-later", 'anchor_ticks + gate_ticks, side="right"',
         'anchor_ticks, side="right"'),
    ),
    *in_file(
        _GROUP, "components/fusion/false_alarms.py", _CARRIED,
        ("poses-of-other-entries", "poses(new.message)[:, false]",
         "poses(new.message)[:, : len(false)]"),
        ("false-alarms-made-when-they-come", "new.message.measured_ticks()[false]",
         "np.repeat(new.tick, np.diff(new.message.offsets))[false]"),
    ),
    *in_file(
        _GROUP, "components/optical/background.py", "wiring/test_what_the_earth_hides.py",
        ("dip-of-straight-rays", "terrain.height_m or 0.0, terrain.refraction",
         'terrain.height_m or 0.0, "none"'),
        ("dip-of-the-sea", 'cells.of_row("own_alt_m") - surface_m, refraction',
         'cells.of_row("own_alt_m"), refraction'),
    ),
    *in_file(
        _GROUP, "components/radar/swerling.py", "wiring/test_picked_models_are_used.py",
        ("proof-forgets-filter", ' and self.p.moving_target_filter == "none"', ""),
    ),
    *in_file(
        _GROUP, "components/radar/fading.py", "wiring/test_fluctuation_that_lasts.py::"
        "test_an_echo_scintillates_as_the_target_is_seen_from_farther_below",
        ("aspect-bearing-only", " cells.elevation_rad,", " 0.0 * cells.elevation_rad,"),
    ),
    *in_file(
        _GROUP, "components/fusion/pass_through.py", "wiring/test_time_of_measurement.py",
        ("swept-scan-a-look", "if message.ticks_after is not None:", "if False:"),
    ),
    *in_file(
        _GROUP, "components/traffic/wind_effect.py",
        "wiring/test_wind.py::test_a_replayed_ownship_turns_into_the_wind_where_it_is_steered",
        ("part-of-steered", "for start_s, part in flight.parts:", "for start_s, part in ():"),
    ),
    *in_file(
        _GROUP, "components/line_of_sight/transform.py",
        "wiring/test_what_the_earth_hides.py::test_the_limb_and_a_ridge_hide_side_by_side",
        ("one-kind-only", "[hides(own, other, present) for hides in self._hiding]",
         "[self._hiding[-1](own, other, present)]"),
        ("other-kind-only", "[hides(own, other, present) for hides in self._hiding]",
         "[self._hiding[0](own, other, present)]"),
        ("heading-by-straight-ray", "other.yaw_rad - seen.azimuth_rad",
         "other.yaw_rad - self._line_of_sight.from_ownship(own, other).azimuth_rad",
         "the air bends rays upward, not sideways"),
    ),
    *in_file(
        _GROUP, "components/operator/stochastic.py", "wiring/test_operator.py::"
        "test_what_is_drawn_is_by_the_decision_not_by_how_often_an_alert_was_seen",
        ("draws-of-no-decision", "mind = mind._replace(since=since)",
         "mind = mind._replace(since=since, decisions=mind.decisions + 1)"),
    ),
    *in_file(
        _GROUP, "components/terrain/rays.py",
        "wiring/test_what_the_earth_hides.py::test_a_steep_ray_is_bent_less_over_a_ridge",
        ("arch-of-flat", " * np.clip(level, 0.0, 1.0) / (8.0", " / (8.0"),
    ),
    *in_file(
        _GROUP, "components/radar/clutter_alarms.py", "wiring/test_clutter_false_alarms.py",
        ("ground-by-the-believed-attitude", "float(targets.own_attitude[",
         "float((targets.believed or {})["),
        ("ground-alarm-beam-axis", "(number + self._draws.uniform(key, scan, draw)) * size",
         "(number + 0.5) * size"),
    ),
    *in_file(
        _GROUP, "components/sensor/declaration_by_place.py", _NOISE_IS,
        ("gate-without-range-error", "gate_m = speed_m_s * apart_s + GATE_DEVIATIONS",
         "gate_m = speed_m_s * apart_s + 0.0"),
        ("gate-without-angle-error", "gate_rad += GATE_DEVIATIONS", "gate_rad += 0.0"),
        ("azimuth-error-high-up", "detections.azimuth_variance_rad2 * level**2",
         "detections.azimuth_variance_rad2"),
    ),
    *in_file(
        _GROUP, "components/optical/frame_false_alarms.py", _NOISE_IS,
        ("highest-is-lowest", "highest_elevation_rad=reach.elevation_rad[1]",
         "highest_elevation_rad=-reach.elevation_rad[0]"),
        ("strength-by-azimuth", "(_AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST)",
         "(_AZIMUTH, _ELEVATION, _AZIMUTH, _CONTRAST)"),
        ("elevation-by-azimuth", "(_AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST)",
         "(_AZIMUTH, _AZIMUTH, _STRENGTH, _CONTRAST)"),
    ),
    *in_file(
        _GROUP, "components/messages/false_detections.py", _NOISE_IS,
        ("targets-first-in-a-pixel", "np.lexsort((*measured, row))",
         "np.lexsort((*measured[1:], row))"),
    ),
    *in_file(
        _GROUP, "components/radar/measured_strength.py", _NOISE_IS,
        ("strength-beyond-nothing", "threshold=crossing.threshold / heard[some]",
         "threshold=0.0 * heard[some]"),
        ("strength-of-another-target", "np.log10(np.maximum(snr, FAINTEST))",
         "np.log10(np.maximum(snr[::-1], FAINTEST))"),
    ),
    *in_file(
        _GROUP, "components/sensor/declaration_by_place.py", "sensor_effects/"
        "test_declaration_delay.py::test_places_are_remembered_across_windows",
        ("a-scan-too-few", "- self.n + 1", "- self.n + 2"),
    ),
    *in_file(
        _GROUP, "components/radar/clutter_alarms.py", _NOISE_IS,
        ("ground-as-often-as-noise-again", "of_noise = self._crossing.false_alarm_probability",
         "of_noise = 0.0"),
        ("ground-comes-last", "return in_measured_order(joined)", "return joined"),
    ),
]  # fmt: skip
