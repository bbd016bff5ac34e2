"""Faults of how tracks are scored, drawn and handed to Stone Soup: frames, signs, who counts."""

from fault import in_file

_GROUP = "scored tracks"
_HAND = "tracking/test_scores_by_other_means.py"
_COVER = "wiring/test_track_innovations_and_coverage.py"
_SOUP = "stone_soup/test_recorded_run.py"
_BLOCK = "wiring/test_stone_soup_tracker.py"
_LEFT = "self.owned.add(int(told.number[track]))\n            self._acc"

FAULTS = [
    *in_file(
        _GROUP, "components/metrics/track_tally.py", (_HAND,),
        ("left-over-counts-nowhere", _LEFT,
         _LEFT.replace("self._", "continue\n            self._")),
        ("left-over-is-false", _LEFT, "self._acc"),
        ("confirmed-at-the-comparison", "max(float(told.confirmed_s[track]), self.before_s)",
         "told.time_s"),
        ("axes-swapped", "square[:, i]\n", "square[:, (i + 1) % 3]\n"),
        ("velocity-by-position", "square[:, 3 + i]", "square[:, i]"),
        ("longest-of-tracked-only", "sum(self.steps_present.values())",
         "sum(len(own) for own in self.numbers.values())"),
        ("coverage-from-detection", "_delay(since, covered_s)", "_delay(since, detected_s)"),
        ("changes-per-step", "self.tracked * self.step_s", "self.tracked"),
        ("bounds-of-six", "low, high = chi_square_bounds(many)",
         "low, high = chi_square_bounds(6)"),
        ("spurious-by-targets", "_ratio(self.spurious, self.tracks)",
         "_ratio(self.spurious, self.present)"),
    ),
    *in_file(
        _GROUP, "components/metrics/coverage.py", (_COVER,),
        ("coverage-without-attitude", "ned_to_body_unchecked(north, east, down, *attitude)",
         "(north, east, down)"),
        ("coverage-without-range", "reach.decide(*angles, distance, there)",
         "reach.decide(*angles, 0.0 * distance, there)"),
        ("last-of-the-grid", "first = int(np.argmax(inside))",
         "first = int(np.flatnonzero(inside)[-1])"),
        ("entry-on-the-grid", "self._entry(target, grid[first - 1], grid[first])",
         "float(grid[first])"),
    ),
    *in_file(
        _GROUP, "components/tracking/hard_update.py", (_COVER,),
        ("innovation-after-the-last", 'before["nis"] + innovation_squared(',
         '0.0 * before["nis"] + innovation_squared('),
        ("freedom-of-the-last", 'before["freedom"] + size', "size"),
    ),
    *in_file(
        _GROUP, "components/tracking/step.py", (_COVER,),
        ("innovations-pile-up", "again = dt_s == 0.0", "again = dt_s >= 0.0"),
    ),
    *in_file(
        _GROUP, "components/stone_soup/objects.py", (_SOUP, _BLOCK),
        ("bearing-clockwise", "Bearing(-azimuth)", "Bearing(azimuth)"),
        ("elevation-down", "Elevation(elevation)", "Elevation(-elevation)"),
        ("variances-of-the-other-angle", "rows = [1, 0]", "rows = [0, 1]"),
        ("offset-not-turned", "np.stack([east, north, -down])", "np.stack([north, east, -down])"),
        ("sensor-unturned", "\"rotation_offset\": self.orientation(i),",
         "\"rotation_offset\": 0.0 * self.orientation(i),"),
        ("state-down", "ned[1], ned[0], -ned[2]", "ned[1], ned[0], ned[2]"),
    ),
    *in_file(
        _GROUP, "components/stone_soup/rotation.py", (_SOUP,),
        ("soup-rolls-the-other-way", "roll = np.arctan2(turned[1, 2], turned[2, 2])",
         "roll = np.arctan2(-turned[1, 2], turned[2, 2])"),
        ("yaw-from-north", "yaw = np.arctan2(turned[0, 1], turned[0, 0])",
         "yaw = np.arctan2(turned[0, 0], turned[0, 1])"),
    ),
    *in_file(
        _GROUP, "components/export/stone_soup_run.py", (_SOUP,),
        ("looks-in-vain-left-out",
         "found.setdefault((when, name not in ranged, name), [])\n    val",
         "pass\n    val"),
        ("cameras-first", "found.setdefault((when, name not in ranged, name), []).append(i)",
         "found.setdefault((when, name in ranged, name), []).append(i)"),
        ("velocity-of-the-own-horizon", "axes in (along_north, along_east, along_up)",
         "axes in (along_east, along_north, along_up)"),
        ("target-in-the-metadata", '"scan": int(columns["scan"][i])}',
         '"scan": int(columns["scan"][i]), "target": 1}'),
    ),
    *in_file(
        _GROUP, "components/stone_soup/followed.py", (_BLOCK,),
        ("axes-not-turned", "order = (north, east, up)", "order = (east, north, up)"),
        ("up-is-down", "np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0])", "np.ones(6)"),
        ("always-confirmed", "CONFIRMED if _measurements(last) else COASTED", "CONFIRMED"),
    ),
    *in_file(
        _GROUP, "components/tracking/stone_soup.py", (_BLOCK,),
        ("late-looks-go-on", "if tick < self._newest:", "if tick < -1:"),
        ("name-of-the-target", '[{"sensor": name} for name in names]',
         '[{"sensor": name, "target": 0} for name in names]'),
        ("origin-of-every-look", "if self._origin is None:", "if True:"),
    ),
    *in_file(
        _GROUP, "components/stone_soup/library.py", (_BLOCK,),
        ("order-by-address", "Base.__hash__ = place", "Base.__hash__ = before"),
        ("draws-of-everybody", "np.random.set_state(self._draws)  # noqa: NPY002\n        random",
         "random"),
        ("draws-not-put-back", "np.random.set_state(theirs)  # noqa: NPY002", "pass"),
    ),
    *in_file(
        _GROUP, "components/display/drawn_tracks.py", ("display/test_tracks_figure.py",),
        ("farthest-target", "nearest: IntArray = apart.argmin(axis=0)",
         "nearest: IntArray = apart.argmax(axis=0)"),
        ("false-if-ever-far", "not bool((near < NEAR_M).any())", "bool((near >= NEAR_M).any())",
         ),
    ),
    *in_file(
        _GROUP, "dsa_des/studies/series_figure.py", ("studies/test_series_figure.py",),
        ("bounds-of-one-run", "chi_square_bounds(freedom * n, confidence)) / n",
         "chi_square_bounds(freedom, confidence))"),
        ("order-of-names", "sorted(found.items(), key=lambda item: item[1])",
         "sorted(found.items())"),
    ),
    *in_file(
        _GROUP, "components/metrics/tracking.py", "wiring/test_tracking_metric.py",
        ("truth-of-when-tracks-are-told", 'truth.at(columns["state_s"][every], origin)',
         'truth.at(columns["time_s"][every], origin)'),
        ("innovations-of-the-start",
         ' & (columns["state_s"][rows] >= self.p.from_s)', ""),
        ("first-detections-of-all-replicas", 'np.asarray(columns["replica"]) == replica',
         'np.asarray(columns["replica"]) >= 0'),
        ("tracks-of-the-first-replica", "np.flatnonzero((replica == number) & told)",
         "np.flatnonzero((replica == 0) & told)"),
    ),
    *in_file(
        _GROUP, "components/tracking/scans.py", "wiring/test_range_rates_in_tracks.py",
        ("rates-of-whoever-tells-them", "(used & (self.contributors & ~rates_of == 0))", "used"),
    ),
    *in_file(
        _GROUP, "components/tracking/without_range.py", "wiring/test_tracks_without_range.py",
        ("range-of-another-track", "values[pair[blind]] for", "values[pair[0 * blind]] for"),
    ),
    *in_file(
        _GROUP, "components/tracking/one_step.py", "tracking/test_late_looks.py",
        ("tracks-in-another-order", "np.lexsort((whole.number, whole.replica))",
         "np.lexsort((-whole.number, whole.replica))"),
    ),
    *in_file(
        _GROUP, "components/tracking/gated_pairs.py", "wiring/test_tracker_keys.py",
        ("rivals-of-confirmed-tracks", "held[entry[near & settled[track]]] = True",
         "held[entry[near & ~settled[track]]] = True"),
    ),
    *in_file(
        _GROUP, "components/tracking/gated_pairs.py", "wiring/test_range_rates_in_tracks.py",
        ("rates-open-every-gate", "_picked(scans.variance, rows, cells),",
         "_picked(scans.variance, rows, cells) + 1e6 * (len(rows) > 3),"),
    ),
    *in_file(
        _GROUP, "components/tracking/gated_pairs.py", "wiring/test_tracks_without_range.py",
        ("first-range-with-another-variance",
         "(scans.measured[2][cells], scans.variance[2][cells])",
         "(scans.measured[2][cells], scans.variance[2][cells] * 0.0 + 1.0)"),
    ),
    *in_file(
        _GROUP, "components/tracking/one_step.py", "tracking/test_late_looks.py",
        ("updated-by-a-late-look-and-older-for-it",
         "np.maximum(now.updated_tick, seen.updated_tick)", "seen.updated_tick"),
    ),
    *in_file(
        _GROUP, "components/tracking/one_step.py", "wiring/test_late_looks_in_one_step.py",
        ("not-of-the-instant-of-another-look", "& (before.tick <= tick[", "& (before.tick < tick["),
        ("models-as-before-the-late-look",
         "weights=_weights_now(weights, then.weights, seen.weights, now.weights)",
         "weights=now.weights"),
    ),
    *in_file(
        _GROUP, "components/tracking/without_range.py", "wiring/test_tracks_without_range.py",
        ("directions-from-the-first-ownship", "selected(place.position_m, which)",
         "selected(place.position_m, which * 0)"),
        ("ranged-tracks-in-polar-too", "blind = (~part.ranged[track]).nonzero()[0]",
         "blind = (~part.ranged[track] | True).nonzero()[0]"),
    ),
    *in_file(
        _GROUP, "components/metrics/tracking.py", "wiring/test_tracking_metric.py",
        ("targets-there-at-the-start", "truth.at(instants[told], np.zeros",
         "truth.at(instants[told] * 0, np.zeros"),
    ),
    *in_file(
        _GROUP, "components/export/stone_soup_run.py", (_SOUP,),
        ("swept-looks-as-the-scan-begins", 'np.where(np.isfinite(lit), lit, columns["time_s"])',
         'columns["time_s"]'),
        ("variances-of-the-look-s-first", "variances[:, rows_of], says)",
         "variances[:, [rows_of[0]] * len(rows_of)] if rows_of else variances[:, rows_of], says)"),
    ),
]  # fmt: skip
