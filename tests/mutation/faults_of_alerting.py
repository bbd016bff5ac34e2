"""Faults of alerting and guidance: whose state, which margin, what is remembered."""

from fault import in_file

_GROUP = "alerting"
_ESTIMATES = "wiring/test_alerts_of_estimates.py"
_EFFECTS = "alerting/test_conf_effects.py"
_MEMORY = "guidance/test_memory_of_bands.py"
_AVOIDANCE = "wiring/test_avoidance_by_bands.py"
_WHOM = "wiring/test_whom_operators_answer.py"
_REST_ON = "wiring/test_what_alerts_rest_on.py"

FAULTS = [
    *in_file(
        _GROUP,
        "components/alerting/estimated_flights.py",
        (_ESTIMATES,),
        ("tentative-tracks-count", "(CONFIRMED, COASTED)", "(CONFIRMED, COASTED, 0)"),
        (
            "estimates-are-not-carried-on",
            "told.state[:3] + told.state[3:] * ahead_s",
            "told.state[:3]",
        ),
        (
            "tracks-of-another-run",
            "last >= np.searchsorted(self._came, begins)",
            "last >= 0",
        ),
        (
            "tracks-as-they-came",
            "np.lexsort((self._told.number[entry], instant))",
            "np.arange(len(entry))",
        ),
        (
            "rows-keep-others-tracks",
            "self._told.take(_each(self._begin, self._count)[1])",
            "self._told.take(np.arange(self._count.sum()))",
        ),
        ("down-for-up", "east, north, -down,", "east, north, down,"),
        ("sinking-for-climbing", "            -v_down,", "            v_down,"),
        ("covariance-is-not-carried-on", "ahead_s**2 * of(i + 3, j + 3)", "0.0 * of(i + 3, j + 3)"),
        ("deviation-of-the-height-of-north", "root(later(2, 2))", "root(later(0, 0))"),
    ),
    *in_file(
        _GROUP,
        "components/alerting/track_memory.py",
        (_ESTIMATES,),
        ("runs-share-a-memory", "run * _MOST_TRACKS + number", "0 * _MOST_TRACKS + number"),
        (
            "tracks-are-never-forgotten",
            "np.flatnonzero(away_s <= self._rule.hysteresis_s)",
            "np.arange(len(away_s))",
        ),
        (
            "tracks-of-others-are-forgotten",
            "np.where(runs[last] == of, times_s[last] - self._seen_s, 0.0)",
            "np.where(runs[last] == of, times_s[last] - self._seen_s, np.inf)",
        ),
        (
            "new-tracks-push-old-ones-aside",
            "memory.put(old, self._memory)",
            "memory.put(np.arange(len(old)), self._memory)",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/encounter.py",
        (_EFFECTS,),
        (
            "wind-the-other-way",
            'np.stack([own["ve"], own["vn"]]) - through_air',
            'through_air - np.stack([own["ve"], own["vn"]])',
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/spread.py",
        (_EFFECTS,),
        (
            "spread-to-one-side",
            "(low < spread) & (high > -spread)",
            "(low < spread) & (high > 0.0)",
        ),
        ("one-edge-of-a-cell", "(unsafe[:, :-1] | unsafe[:, 1:])", "unsafe[:, :-1]"),
    ),
    *in_file(
        _GROUP,
        "components/guidance/steps.py",
        (_EFFECTS,),
        (
            "limit-above-as-below",
            "most = np.minimum(most, own_value + above)",
            "most = np.minimum(most, own_value + below)",
        ),
    ),
    *in_file(
        _GROUP,
        "components/guidance/band_memory.py",
        (_MEMORY,),
        ("one-line-fewer", "sorted(queues[1])[-self._m]", "sorted(queues[1])[-self._m + 1]"),
        ("persists-without-end", "< self._persistence_s:", "< 1e9:"),
        ("recovery-is-never-over", "if recovery is None:", "if False:"),
        ("not-across-north", "first.high + FULL_TURN, first.region)", "first.high, first.region)"),
    ),
    *in_file(
        _GROUP,
        "components/guidance/resolution_memory.py",
        (_MEMORY,),
        ("kept-for-ever", "young = now_s - self._since_s <", "young = 0 * now_s <"),
        ("sides-change-at-once", "elif now_s - self._since_s <", "elif 2 * self._persistence_s <"),
    ),
    *in_file(
        _GROUP,
        "components/avoidance/daidalus.py",
        (_AVOIDANCE,),
        (
            "always-faster",
            "beyond = change + math.copysign(self.p.beyond_mps, change)",
            "beyond = abs(change) + self.p.beyond_mps",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/daidalus.py",
        (_REST_ON,),
        (
            "deviations-of-another-track",
            "{name: np.ravel(part)[place] for name, part in told.items()}",
            "{name: np.ravel(part)[row] for name, part in told.items()}",
        ),
        (
            "states-by-their-place",
            "{name: part[place] for name, part in zip(_RELATIVE, relative, strict=True)}",
            "{name: part[: len(place)] for name, part in zip(_RELATIVE, relative, strict=True)}",
        ),
        ("margins-by-speed", "np.hypot(*relative[:2]))", "np.hypot(*relative[3:5]))"),
        (
            "deviations-are-not-told",
            "told = {} if flights.deviations is None else flights.deviations._asdict()",
            "told = {}",
        ),
        (
            "own-velocity-of-seconds-ago",
            "own = self._own.states(ticks, begins, 0.0 if estimated else self.p.fit_s)",
            "own = self._own.states(ticks, begins, self.p.fit_s)",
        ),
        (
            "own-course-mirrored",
            "zero.ravel(), alt_m, *velocity)",
            "zero.ravel(), alt_m, velocity[1], velocity[0], velocity[2])",
        ),
        (
            "own-altitude-lost",
            "(np.nan_to_num(own[name])[scan] for name in _OWN_MOTION)",
            '((name != "alt_m") * np.nan_to_num(own[name])[scan] for name in _OWN_MOTION)',
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/estimated_flights.py",
        (_REST_ON,),
        (
            "velocity-along-the-frame",
            "there, here = ned_axes(lat_deg, lon_deg), ned_axes(told.origin[0], told.origin[1])",
            "there = here = ned_axes(told.origin[0], told.origin[1])",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alert_configuration/margins.py",
        (_REST_ON,),
        (
            "score-of-climbs-for-heights",
            'configuration["v_pos_z_score"] * deviations.height_m',
            'configuration["v_vel_z_score"] * deviations.height_m',
        ),
        (
            "least-score-far-away-and-near",
            'configuration["h_vel_z_score_min"], configuration["h_vel_z_score_max"]',
            'configuration["h_vel_z_score_max"], configuration["h_vel_z_score_min"]',
        ),
        (
            "always-far-away",
            "np.minimum(away / distance_m, 1.0) if distance_m > 0.0 else 1.0",
            "1.0",
        ),
    ),
    *in_file(
        _GROUP,
        "components/guidance/way_out.py",
        (_REST_ON,),
        ("bands-without-margins", "if alerts.deviations:", "if False:"),
    ),
    *in_file(
        _GROUP,
        "components/alert_configuration/conf_alerters.py",
        (_REST_ON,),
        (
            "traffic-for-resolution",
            "TcasAdvisory(bool(self._value(begin + which.lower(), kind, False, shown)))",
            "TcasAdvisory(not self._value(begin + which.lower(), kind, False, shown))",
        ),
    ),
    *in_file(
        _GROUP,
        "components/guidance/way_out.py",
        (_WHOM,),
        (
            "bands-of-the-first-instant",
            "State(zero, zero, *own[:, alike])",
            "State(zero, zero, *own[:, alike[:1].repeat(len(alike))])",
        ),
    ),
    *in_file(
        _GROUP,
        "components/avoidance/daidalus.py",
        (_WHOM,),
        ("climbs-as-it-likes", 'conf["vertical_rate"] or _VERTICAL_RATE_MPS', "_VERTICAL_RATE_MPS"),
        ("speeds-as-it-likes", 'conf["horizontal_accel"] or _ACCELERATION_MPS2', "2.0"),
        (
            "sinks-as-it-speeds",
            'conf["vertical_accel"] or _VERT',
            'conf["horizontal_accel"] or _VERT',
        ),
    ),
    *in_file(
        _GROUP,
        "components/operator/stochastic.py",
        (_WHOM,),
        (
            "pauses-are-means",
            "pause_s(highest, self._draw(mind, self._pause, 0))",
            "mean_pause_s(highest)",
        ),
        (
            "share-of-climbs",
            "self._draw(mind, self._steering, 0) < self.p.turn_share",
            "self._draw(mind, self._steering, 0) >= self.p.turn_share",
        ),
        ("any-share-turns", "self.p.turn_share >= 0.5, None", "self.p.turn_share > 0.0, None"),
        (
            "no-other-way",
            "(True, False) if 0.0 < self.p.turn_share < 1.0 else (True,)",
            "(True,)",
        ),
    ),
    *in_file(
        _GROUP,
        "components/operator/console.py",
        (_WHOM,),
        ("level-of-the-first", "_Alert(int(level[place]),", "_Alert(int(level[0]),"),
        (
            "alert-of-anybody",
            "self._alerts.get(decision.target)",
            "next(iter(self._alerts.values()), None)",
        ),
        (
            "alerts-to-come",
            'np.searchsorted(arrived.tick, until, side="right")',
            "len(arrived.tick)",
        ),
        ("always-the-first-target", "code.get(d.target, -1)", "0 if d.target else -1"),
    ),
    *in_file(
        _GROUP,
        "components/alerting/daidalus.py",
        (_REST_ON,),
        (
            "times-of-the-first-level",
            'f"time_to_level_{k}_s": times_s[:, k - 1].copy()',
            'f"time_to_level_{k}_s": times_s[:, 0].copy()',
        ),
        (
            "late-sights-by-the-pose-of-now",
            "self._own.pose_of(sights.measured_tick, came, _begins(came, wake), new)",
            "self._own.pose_of(came, came, _begins(came, wake), new)",
        ),
        (
            "late-sights-are-of-now",
            "sights.tick, arrived.tick, row, sights.measured_tick[new])",
            "sights.tick, arrived.tick, row, arrived.tick[row])",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/guidance_block.py",
        (_REST_ON,),
        (
            "bands-of-the-first-instants",
            "ticks = wake.ticks[np.array(rows, dtype=np.int64)]",
            "ticks = wake.ticks[: len(rows)]",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/encounter.py",
        ("alerting/test_bounds_of_files.py",),
        ("other-instants-count", "times == own_s[:, np.newaxis]", "times >= own_s[:, np.newaxis]"),
        ("bounds-of-the-ownship", "find(*mine) + find(*theirs)", "find(*mine) + 0 * find(*theirs)"),
        (
            "velocity-as-wrong-as-position",
            'both(_longest, "v_ew_std", "v_ns_std", "v_en_std")',
            'both(_longest, "s_ew_std", "s_ns_std", "s_en_std")',
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/bands_over_time.py",
        ("alerting/test_bands_of_several_aircraft.py",),
        (
            "bands-by-the-first-one-s-level",
            "alerts.early_level[:, target]",
            "alerts.early_level[:, 0]",
        ),
        ("bands-never-early", "alerts.early_level[:, target]", "0 * alerts.early_level[:, target]"),
        ("bands-of-a-file-without-margins", "early, there, bounds)", "early, there, None)"),
        (
            "bands-of-who-is-gone",
            "encounter.present[:, target] & (encounter.alerter",
            "(encounter.alerter",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/spread.py",
        ("alerting/test_bands_of_several_aircraft.py",),
        (
            "spread-never-early",
            "(early, level.early_alerting_time_s),",
            "(early, level.alerting_time_s),",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/daidalus.py",
        (_REST_ON,),
        ("held-tracks-count-again", "new &= sights.updated  # others", "new &= True  # others"),
    ),
    *in_file(
        _GROUP,
        "components/alerting/followed_tracks.py",
        (_REST_ON,),
        ("target-of-its-height", "np.linalg.norm(away, axis=2)", "np.abs(away[..., 2])"),
    ),
]
