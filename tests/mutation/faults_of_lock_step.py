"""Faults of lock step: one replica's memory, instant or draw taken for another's."""

from fault import in_file

_GROUP = "lock step"
_TOGETHER = "lockstep/test_what_runs_together.py"

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
]
