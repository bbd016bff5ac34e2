"""Faults of lock step: one replica's memory, instant or draw taken for another's."""

from fault import in_file

_GROUP = "lock step"
_TOGETHER = "lockstep/test_what_runs_together.py"
_MEMORIES = "lockstep/test_memories_of_replicas.py"
_ENDS = "lockstep/test_runs_that_end_early.py"
_ENDED = "wiring/test_runs_that_end_early.py"

FAULTS = [
    *in_file(
        _GROUP,
        "components/tracking/cues.py",
        (_TOGETHER,),
        ("replicas-share-their-silence", "of = replica[rows]", "of = 0 * replica[rows]"),
    ),
    *in_file(
        _GROUP,
        "components/track_fusion/covariance_intersection.py",
        (_TOGETHER,),
        (
            "newest-of-any-replica",
            "newest[replica])",
            "newest.max())",
        ),
        (
            "tracks-of-others-are-let-go",
            "LocalTracks.joined([self._local.take(others), local])",
            "local",
        ),
    ),
    *in_file(
        _GROUP,
        "components/sensor/declaration_rule.py",
        (_TOGETHER,),
        (
            "looks-of-another-replica",
            "cells.replica * len(self._names) + cells.target",
            "0 * cells.replica + cells.target",
        ),
    ),
    *in_file(
        _GROUP,
        "components/sensor/declaration_by_place.py",
        (_TOGETHER,),
        (
            "places-of-one-replica-are-kept",
            "known.scan > self._last_scans(detections, known) - self.n + 1",
            "known.scan > int(detections.scan[-1]) - self.n + 1",
        ),
    ),
    *in_file(
        _GROUP,
        "components/optical/dynamic_signature.py",
        (_TOGETHER,),
        (
            "motion-from-another-replica",
            "self._angles[:, of], self._tick[of]",
            "self._angles[:, 0 * of], self._tick[0 * of]",
        ),
    ),
    *in_file(
        _GROUP,
        "components/traffic/row_flights.py",
        ("lockstep/test_split_blocks.py", _TOGETHER),
        (
            "flights-of-the-first-replica",
            "target = replica * self._width + column",
            "target = 0 * replica + column",
        ),
        (
            "rate-of-the-first-replica",
            "self._rates_hz[replica]",
            "self._rates_hz[0 * replica]",
        ),
    ),
    *in_file(
        _GROUP,
        "components/traffic/source.py",
        (_TOGETHER,),
        (
            "terrain-below-the-first-ownship-only",
            "self._check_terrain(FlightOf(flown.own, number))",
            "self._check_terrain(FlightOf(flown.own, 0))",
        ),
    ),
    *in_file(
        _GROUP,
        "components/radar/beam_effects.py",
        (_TOGETHER,),
        ("lit-on-the-common-line", "(ticks % span if span else ticks)", "ticks"),
    ),
    *in_file(
        _GROUP,
        "components/navigation/effects.py",
        (_TOGETHER,),
        (
            "noise-of-the-common-line",
            "nanosecond_of(own, block",
            "nanosecond_of(states.tick, block",
        ),
        ("noise-of-the-first-seed", "stream.of_rows(replica)", "stream.of_rows(0 * replica)"),
    ),
    *in_file(
        _GROUP,
        "dsa_des/running/nodes.py",
        (_ENDED,),
        ("sensors-run-at-the-end", "depths(scene.graph, ending)", "depths(scene.graph)"),
    ),
    *in_file(
        _GROUP,
        "dsa_des/running/node.py",
        (_ENDED, _ENDS),
        (
            "scan-by-scan-at-the-end",
            "if ends.early and ends.passed(tick, tick + 1):",
            "if ends.early and ends.passed(tick - 1, tick):",
        ),
        (
            "all-that-is-under-way-comes",
            "scans[kept], ends.cut(end)",
            "scans[kept], end",
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/replicas/channel.py",
        (_ENDS,),
        (
            "what-is-under-way-comes-to-replicas",
            "kept = self._ends.before(found[0])\n        if kept.all():",
            "kept = self._ends.before(found[0])\n        if len(kept):",
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/record/recording.py",
        (_ENDS,),
        (
            "rows-counted-past-the-end",
            "self.rows[table] += count",
            "self.rows[table] += len(ticks)",
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/replicas/replicas.py",
        (_ENDED,),
        ("all-ended-early", "n in ended,\n            shared", "bool(ended),\n            shared"),
    ),
    *in_file(
        _GROUP,
        "dsa_des/replicas/drawn_columns.py",
        ("studies/test_drawn_columns.py",),
        (
            "differing-by-the-last",
            "any(v != column.values[0] for v in column.values)",
            "column.values[-1] != column.values[0]",
        ),
        (
            "two-names-of-one-key",
            ") < len(columns):\n            return None",
            ") < 0:\n            return None",
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/studies/metric.py",
        (_ENDED,),
        (
            "second-batch-as-the-first",
            '"replica": columns["replica"] + start if start else',
            '"replica": columns["replica"] if start else',
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/arrays/sorted_union.py",
        ("engine/test_places_in_order.py",),
        (
            "a-guess-is-not-checked",
            "if guess is not None and bool(np.array_equal(values[guess], asked)):",
            "if guess is not None:",
        ),
        (
            "guessed-among-equal-values",
            "len(asked) < _WORTH_A_GUESS or not bool((values[1:] > values[:-1]).all()):",
            "len(asked) < _WORTH_A_GUESS:",
        ),
    ),
    *in_file(
        _GROUP,
        "components/metrics/encounter.py",
        (_ENDED,),
        (
            "ended-early-as-the-first",
            "to_the_end and group.ended_early[number]",
            "to_the_end and group.ended_early[0]",
        ),
        (
            "until-the-end-of-the-first",
            "until_s = float(group.duration_s[number])",
            "until_s = float(group.duration_s[0])",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/followed_tracks.py",
        (_TOGETHER,),
        (
            "tracks-of-runs-without-a-scan-go",
            "kept = (of_scan[ends][there] != run) | (",
            "kept = (of_scan[ends][there] == run) & (",
        ),
        (
            "tracks-of-this-run-have-passed",
            "kept & (run >= of_scan[-1])",
            "kept & (run > of_scan[-1])",
        ),
    ),
    *in_file(
        _GROUP,
        "components/sensor/declaration_by_place.py",
        (_TOGETHER,),
        (
            "the-latest-of-all-replicas-are-asked",
            "np.flatnonzero(order >= len(self._memory))",
            "np.arange(len(self._memory), len(known))",
        ),
    ),
    *in_file(
        _GROUP,
        "components/encounters/ending.py",
        (_ENDED, _ENDS),
        (
            "who-was-there-is-forgotten",
            "there[starts] = np.maximum(there[starts], before)",
            "pass",
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/replicas/channel.py",
        ("lockstep/test_what_inputs_hold.py",),
        (
            "the-first-tells-for-all",
            "return self._ends.running(np.unique(replica)) == self._ends.running(every)",
            "return True",
        ),
        (
            "the-very-start-is-not-kept",
            "np.searchsorted(arrivals, ticks[-1] - ticks[-1] % self._span))",
            'np.searchsorted(arrivals, ticks[-1] - ticks[-1] % self._span, side="right"))',
        ),
        (
            "the-oldest-goes-unremembered",
            "elif len(self._passed) > _MOST_PASSED:\n                    self._remember()",
            "elif len(self._passed) > _MOST_PASSED:\n"
            "                    self._passed = self._passed[1:]",
        ),
    ),
    *in_file(
        _GROUP,
        "components/sensor/declaration_by_place.py",
        (_MEMORIES,),
        (
            "places-go-by-another-replica",
            "np.where(split_scans(last)[0] == split_scans(known.scan)[0], last, known.scan)",
            "last",
        ),
    ),
    *in_file(
        _GROUP,
        "components/alerting/track_memory.py",
        (_MEMORIES,),
        ("tracks-go-by-the-first-run", "times_s[last] - self._seen_s", "times_s[0] - self._seen_s"),
    ),
    *in_file(
        _GROUP,
        "components/alerting/followed_tracks.py",
        (_MEMORIES,),
        (
            "named-by-the-look-before",
            'np.searchsorted(self._true_came, ticks, side="right") - 1, 0)',
            'np.searchsorted(self._true_came, ticks, side="left") - 1, 0)',
        ),
    ),
    *in_file(
        _GROUP,
        "dsa_des/replicas/lockstep.py",
        (_MEMORIES,),
        (
            "reports-of-the-first-end",
            "int(self.ends.ticks[number]), self.scene",
            "int(self.ends.ticks[0]), self.scene",
        ),
    ),
]
