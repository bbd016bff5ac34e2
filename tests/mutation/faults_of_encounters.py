"""Faults of encounters: models sampled wrongly, weights that undo something else, wrong ratios."""

from fault import in_file

_GROUP = "encounters"
_SAMPLING = "encounters/test_sampling.py"
_PAIRING = "encounters/test_pairing.py"
_RISK = "encounters/test_risk.py"
_ENDING = ("wiring/test_runs_that_end_early.py", "lockstep/test_runs_that_end_early.py")

FAULTS = [
    *in_file(
        _GROUP, "components/encounters/sampling.py", _SAMPLING,
        ("parents-of-time-0", "now[step.before] = now[step.place]", "pass"),
        ("bin-1-where-nothing-was-counted", "np.where(empty, 0.0, np.where(chance",
         "np.where(empty, 2.0, np.where(chance"),
        ("new-value-from-the-whole-draw", "(left[anew] / self._rate)", "left[anew]"),
    ),
    *in_file(
        _GROUP, "components/encounters/ending.py", _ENDING,
        ("one-that-has-passed-is-enough", "over = passed.all(axis=1)", "over = passed.any(axis=1)"),
        ("growing-anew-in-every-window", "np.maximum(since[starts], self._since[numbers])",
         "since[starts]"),
        ("gone-is-not-passed", "(now_m > last_m) | (~states.present & seen)", "now_m > last_m"),
    ),
    *in_file(
        _GROUP, "dsa_des/running/node.py", _ENDING,
        ("rows-after-the-end", "kept = ends.before(ticks)", "kept = ends.before(ticks) | True"),
    ),
    *in_file(
        _GROUP, "dsa_des/running/rewind.py", _ENDING,
        ("an-end-is-not-undone", "self._things.append(ends)", "self._ends = ends"),
    ),
    *in_file(
        _GROUP, "dsa_des/record/recording.py", _ENDING,
        ("what-was-looked-ahead-is-recorded", "kept = self._ends.before(ticks)",
         "kept = self._ends.before(ticks) | True"),
    ),
    *in_file(
        _GROUP, "components/encounters/bayes_network.py", _SAMPLING,
        ("last-parent-fastest", "for parent in parents:", "for parent in reversed(parents):"),
    ),
    *in_file(
        _GROUP, "components/encounters/model.py", _SAMPLING,
        ("bin-around-zero-uniform", "np.where(self._around_zero, 0.0, np.diff(self.edges))",
         "np.diff(self.edges)"),
    ),
    *in_file(
        _GROUP, "components/encounters/pair_densities.py", _PAIRING,
        ("modulus-for-parameter", "ellipe(4.0 * first * second / largest)",
         "ellipe(np.sqrt(4.0 * first * second / largest))"),
    ),
    *in_file(
        _GROUP, "components/encounters/pairing.py", _PAIRING,
        ("weight-without-the-vertical-chance", "/ q / chance", "/ q"),
        ("miss-on-the-other-side", "(horizontal * east / relative, -horizontal * north / relative)",
         "(-horizontal * east / relative, horizontal * north / relative)"),
        ("range-of-the-start-as-height", "< rules.start_vertical_ft)", "< rules.start_range_ft)"),
    ),
    *in_file(
        _GROUP, "dsa_des/studies/ratio.py", _RISK,
        ("denominator-taken-as-known", "residual = y - ratio * x",
         "residual = y - above / total * each"),
        ("ratio-without-weights", "ratio = above / below", "ratio = math.fsum(m) / math.fsum(n)"),
    ),
    *in_file(
        _GROUP, "dsa_des/studies/summary.py", "studies/test_ratios.py",
        ("copies-count-as-encounters", "together = cluster if len(np.unique(cluster)) < len(used)",
         "together = cluster if not len(used)"),
        ("classes-of-all-runs", "rows = rows[self.column(of.only[0])[rows] == of.only[1]]", "pass"),
        ("ratios-compared-unpaired", "((each[1] - each[0]) ** 2).sum()", "(each**2).sum()"),
    ),
    *in_file(
        _GROUP, "dsa_des/studies/cheapest.py", "studies/test_requirements.py",
        ("estimate-for-interval", "requirement.met(line.estimate.low, line.estimate.high)",
         "requirement.met(line.estimate.value, line.estimate.value)"),
        ("cheap-end-mixed-up", "some if requirement.cheap_last else some[::-1]",
         "some[::-1] if requirement.cheap_last else some"),
    ),
    *in_file(
        _GROUP, "dsa_des/studies/requirements.py", "studies/test_requirements.py",
        ("lower-end-below-the-limit", "return high <= self.limit if",
         "return low <= self.limit if"),
    ),
    *in_file(
        _GROUP, "components/encounters/splitting.py", "encounters/test_splitting.py",
        ("copies-keep-their-weight", "(found.weights / expected)[places]", "found.weights[places]"),
        ("never-one-more-by-chance", "(uniform < expected % 1.0)", "(uniform < 0.0)"),
        ("farther-is-nearer", "(scores[:, np.newaxis] < levels)",
         "(scores[:, np.newaxis] > levels)"),
    ),
    *in_file(
        _GROUP, "components/encounters/risk_metric.py", "wiring/test_risk_ratio_metric.py",
        ("intruder-s-bearing-from-north", "(closing - course[0]) % 360.0", "closing % 360.0"),
        ("bearing-to-where-it-goes", "math.atan2(own[1] - other[1], own[0] - other[0])",
         "math.atan2(other[1] - own[1], other[0] - own[0])"),
    ),
    *in_file(
        _GROUP, "components/encounters/generate_command.py", "encounters/test_set_file.py",
        ("share-taken-for-density", "StepDensity(edges, parts / wide)",
         "StepDensity(edges, parts)"),
    ),
    *in_file(
        _GROUP, "components/encounters/track_tables.py", "encounters/test_track_tables.py",
        ("track-east-for-north", "return time_s, north, east, alt_ft * FOOT_M",
         "return time_s, east, north, alt_ft * FOOT_M"),
    ),
    *in_file(
        _GROUP, "components/encounters/encounter_traffic.py",
        "wiring/test_encounter_traffic_keys.py",
        ("own-flight-of-the-encounter", "self.own = ScriptedTrajectory(",
         "ScriptedTrajectory("),
    ),
    *in_file(
        _GROUP, "components/encounters/splitting.py", ("encounters/test_what_splits_a_set.py",),
        ("heights-by-the-radius", "np.abs(apart[2]) / _NMAC.vertical_m",
         "np.abs(apart[2]) / _NMAC.horizontal_m"),
        ("copies-at-the-origin", "found.reference_deg,\n        {n", "(0.0, 0.0),\n        {n"),
    ),
    *in_file(
        _GROUP, "components/encounters/split_command.py",
        ("encounters/test_what_splits_a_set.py",),
        ("one-lot-for-all-seeds", "split_set(found, expected, seed)",
         "split_set(found, expected, 0)"),
        ("last-score-counts", "min(v, least.get(n, math.inf))", "v"),
    ),
    *in_file(
        _GROUP, "components/encounters/encounter_traffic.py",
        ("encounters/test_what_splits_a_set.py",),
        ("weight-of-the-first-is-told", "float(self.found.weights[self.place])",
         "float(self.found.weights[0])"),
    ),
    *in_file(
        _GROUP, "components/encounters/encounter_traffic.py",
        ("wiring/test_encounter_traffic_keys.py",),
        ("own-model-for-both", "intruder = parameters.intruder_file or parameters.file",
         "intruder = parameters.file"),
    ),
    *in_file(
        _GROUP, "components/encounters/risk_table.py", ("encounters/test_risk_command.py",),
        ("classes-of-single-rows", "(n, m, w, labels, together, **options)",
         "(n, m, w, labels, None, **options)"),
    ),
    *in_file(
        _GROUP, "components/encounters/convert_command.py",
        ("encounters/test_convert_and_show.py::test_paired_tracks_become_a_set",),
        ("weights-in-the-table-s-order", "weights = np.array([known[n] for n in found.numbers.tol",
         "weights = weight[: len(found)] + 0.0 * np.array([known[n] for n in found.numbers.tol"),
    ),
    *in_file(
        _GROUP, "components/encounters/any_format.py",
        ("encounters/test_convert_and_show.py::test_paired_tracks_become_a_set",),
        ("a-set-stays-where-it-was", "return found if at is None else",
         "return found if True else"),
    ),
    *in_file(
        _GROUP, "components/encounters/generate_command.py",
        ("wiring/test_encounter_traffic_keys.py",),
        ("intruder-of-the-ownship-s-model", "PairSampler(own, intruder, seed, rules)",
         "PairSampler(own, own, seed, rules)"),
    ),
    *in_file(
        _GROUP, "components/encounters/encounter_traffic.py",
        ("wiring/test_encounter_traffic_keys.py",),
        ("place-told-as-number", '"number": int(self.found.numbers[self.place])',
         '"number": self.place'),
    ),
]  # fmt: skip
