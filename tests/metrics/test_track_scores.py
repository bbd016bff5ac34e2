"""Scores of tracks, against enumeration, tables written by hand and Stone Soup."""

import itertools
import math
from datetime import datetime, timedelta

import numpy as np
import pytest
from scipy.stats import chi2

from components.metrics.track_scores import (
    ReportedTracks,
    TrackTally,
    count_breaks_and_swaps,
    innovation_results,
    ospa_and_gospa,
)
from dsa_des.results.statistics import chi_square_bounds


def enumerated(distance, cutoff, order):
    """OSPA^p · max(m, n) and GOSPA^p as minima over everything that may be."""
    tracks, truths = distance.shape
    ospa, gospa = np.inf, np.inf
    for many in range(min(tracks, truths) + 1):
        for rows in itertools.combinations(range(tracks), many):
            for columns in itertools.permutations(range(truths), many):
                near = sum(min(distance[r, c], cutoff) ** order
                           for r, c in zip(rows, columns, strict=True))  # fmt: skip
                left = tracks + truths - 2 * many
                gospa = min(gospa, near + 0.5 * cutoff**order * left)
                if many == min(tracks, truths):
                    ospa = min(ospa, near + cutoff**order * abs(tracks - truths))
    return (ospa / max(tracks, truths)) ** (1 / order), gospa ** (1 / order)


@pytest.mark.parametrize("order", [1.0, 2.0, 3.0])
def test_distances_of_sets_are_the_least_of_all_assignments(order):
    rng = np.random.default_rng(8)
    for tracks, truths in [(1, 1), (2, 3), (3, 2), (3, 3), (0, 2), (2, 0), (1, 4)]:
        distance = rng.uniform(0, 150, (tracks, truths))
        found = ospa_and_gospa(distance, 100.0, order)
        ospa, gospa = enumerated(distance, 100.0, order)
        assert found.ospa_m == pytest.approx(ospa)
        assert found.gospa_m == pytest.approx(gospa)
        parts = found.localisation_m, found.missed_m, found.false_m
        assert sum(part**order for part in parts) == pytest.approx(gospa**order)
    nothing = ospa_and_gospa(np.empty((0, 0)), 100.0)
    assert nothing.ospa_m == nothing.gospa_m == 0.0


def test_bounds_are_quantiles_of_chi_square():
    np.testing.assert_allclose(chi_square_bounds(6), chi2.ppf([0.025, 0.975], 6))


def test_the_last_nees_of_a_stretch_is_that_of_its_end_and_not_of_its_start():
    tally = TrackTally(100.0, 2.0, 1.0)
    tally.paired_s, tally.nees = [5.0, 5.0, 9.0, 10.0, 10.0, 11.0], [1.0, 3.0, 7.0, 20.0, 30.0, 9.0]
    ends = [(0.0, 5.0), (5.0, 10.0), (5.0, 9.5), (10.0, 15.0), (11.0, 15.0)]
    assert [tally.mean_nees_at_last_instant(*each) for each in ends[:4]] == [2.0, 25.0, 7.0, 9.0]
    assert math.isnan(tally.mean_nees_at_last_instant(*ends[4]))


def test_identities_break_and_swap():
    assert count_breaks_and_swaps({0: [1, 1, 3, 3], 1: [2, 2]}) == (1.0, 0.0)
    assert count_breaks_and_swaps({0: [1, 2, 2], 1: [2, 1, 1]}) == (0.0, 2.0)


LIMIT = 100.0


def told(time_s, tracks, true, since_s=0.0):
    """Tracks as they are told: number → (north, east, down), at rest, with unit covariance.

    What was reported `since_s` ago has been compared before, and was 7 m farther north.
    """
    state = np.zeros((6, len(tracks)))
    for k, place in enumerate(tracks.values()):
        state[:3, k] = place
    before = state + np.array([7.0, 0, 0, 0, 0, 0])[:, np.newaxis] * (since_s > 0.0)
    return ReportedTracks(
        time_s, np.array(list(tracks), dtype=np.int64), state - true, before - true,
        np.repeat(np.eye(6)[np.newaxis], len(tracks), axis=0),
        np.full(len(tracks), since_s == 0.0), np.zeros(len(tracks)),
    )  # fmt: skip


def tallied(steps, targets=2, velocity=(0.0, 0.0, 0.0), step_s=1.0, since_s=()):
    """Steps of (tracks, targets that are there), a second apart, told some time before."""
    tally = TrackTally(LIMIT, 2.0, step_s)
    for k, (tracks, places) in enumerate(steps):
        true = np.zeros((targets, 6, len(tracks)))
        for target, place in places.items():
            true[target, :3] = np.array(place, dtype=float)[:, np.newaxis]
            true[target, 3:] = np.array(velocity)[:, np.newaxis]
        before_s = since_s[k] if since_s else 0.0
        present = np.array(sorted(places), dtype=np.int64)
        tally.add(told(k + 1.0, tracks, true, before_s), present)
    return tally


FAR = (5000.0, 0.0, 0.0)


def test_scores_of_a_small_run_by_hand():
    here, there = (0.0, 0.0, 0.0), (1000.0, 0.0, 0.0)
    steps = [
        ({}, {0: here, 1: there}),
        ({1: (3.0, 0.0, 0.0)}, {0: here, 1: there}),
        ({1: (0.0, 4.0, 0.0), 2: (0.0, 50.0, 0.0), 9: FAR}, {0: here, 1: there}),
        ({1: (0.0, 0.0, 5.0), 3: (1000.0, 12.0, 0.0)}, {0: here, 1: there}),
        ({3: (1000.0, 0.0, 0.0), 4: (0.0, 0.0, 0.0)}, {0: here, 1: there}),
    ]
    tally = tallied(steps, velocity=(1.0, 2.0, 3.0), step_s=0.5)
    got = tally.results(["a", "b"], {"a": 0.5}, {"a": 0.0, "b": 0.0}, 5.0)
    # Target 0 has a track at four of its five instants, target 1 at two.
    assert got["track_completeness"] == 6 / 10
    # Track 2 is one too many at one instant; track 9 has no target.
    assert got["track_ambiguity"] == pytest.approx(7 / 6)
    assert got["track_spuriousness"] == 1 / 8
    errors = [3.0, 4.0, 5.0, 12.0, 0.0, 0.0]
    assert got["track_positional_accuracy_m"] == pytest.approx((sum(errors) + 50.0) / 7)
    assert got["track_velocity_accuracy_m_s"] == pytest.approx(math.sqrt(14.0))
    assert got["track_velocity_error_m_s"] == pytest.approx(math.sqrt(14.0))
    by_axis = [got[f"track_{axis}_error_m_s"] for axis in ("north", "east", "down")]
    assert by_axis == pytest.approx([1.0, 2.0, 3.0])
    assert got["track_position_error_m"] == pytest.approx(math.sqrt(np.mean(np.square(errors))))
    assert got["track_north_error_m"] == pytest.approx(math.sqrt(9 / 6))
    assert got["track_east_error_m"] == pytest.approx(math.sqrt((16 + 144) / 6))
    assert got["track_down_error_m"] == pytest.approx(math.sqrt(25 / 6))
    assert got["track_nees_mean"] == pytest.approx(np.mean(np.square(errors)) + 14.0)
    # Track 1 holds target 0 for three of five instants, track 3 target 1 for two of five.
    assert got["track_longest_share"] == 5 / 10
    assert (got["track_broken"], got["track_swapped"]) == (1.0, 0.0)
    assert got["track_number_changes_per_s"] == 1 / (6 * 0.5)
    assert got["track_false_per_hour"] == pytest.approx(3600 / 5)
    # Confirmed between the first and the second comparison, and the third and fourth.
    assert got["track_confirmation_s"] == pytest.approx(1.0 - 0.5)
    assert got["track_confirmation_from_coverage_s"] == pytest.approx((1.0 + 3.0) / 2)
    assert got["track_confirmed_share"] == 1.0


def test_instants_without_a_track_count_and_reports_that_stand_are_new_once():
    """A track for two of eight instants, told once; nobody ever reports the other target."""
    here, other = (0.0, 0.0, 0.0), (1000.0, 0.0, 0.0)
    places = {0: here, 1: other}
    steps = [({}, places)] * 3 + [({1: (3.0, 0, 0)}, places)] * 2 + [({}, places)] * 3
    tally = tallied(steps, since_s=(0, 0, 0, 0.0, 1.0, 0, 0, 0))
    got = tally.results(["a", "b"], {}, {}, 8.0)
    assert got["track_completeness"] == got["track_longest_share"] == 2 / 16
    assert got["track_gospa_missed_m"] == pytest.approx(
        (6 * math.sqrt(LIMIT**2) + 2 * math.sqrt(LIMIT**2 / 2)) / 8
    )
    with_one = math.sqrt((3.0**2 + LIMIT**2) / 2)
    assert got["track_ospa_m"] == pytest.approx((6 * LIMIT + 2 * with_one) / 8)
    # Of what was reported before nothing rests on its covariance again.
    assert got["track_nees_mean"] == got["track_position_error_m"] ** 2 == 9.0
    assert got["track_positional_accuracy_m"] == 3.0 and len(tally.nees) == 1


def test_who_is_covered_and_gets_no_track_counts():
    steps = [({1: (3.0, 0.0, 0.0)}, {0: (0.0, 0.0, 0.0), 1: FAR})]
    got = tallied(steps).results(["a", "b"], {}, {"a": 0.0, "b": 0.2}, 1.0)
    assert got["track_confirmed_share"] == 0.5 and math.isnan(got["track_confirmation_s"])
    assert got["track_longest_share"] == 0.5
    nothing = tallied([({}, {})]).results(["a", "b"], {}, {"b": 0.2}, 1.0)
    assert math.isnan(nothing["track_confirmed_share"])
    assert nothing["track_false_per_hour"] == nothing["track_ospa_m"] == 0.0


def test_a_track_between_two_targets_is_one_track():
    """Each of two tracks is near both targets: neither target has one too many."""
    places = {0: (0.0, 0.0, 0.0), 1: (20.0, 0.0, 0.0)}
    got = tallied([({1: (19.0, 0, 0), 2: (1.0, 0, 0)}, places)]).results(["a", "b"], {}, {}, 1.0)
    assert got["track_ambiguity"] == got["track_completeness"] == 1.0
    assert got["track_positional_accuracy_m"] == 1.0
    one = tallied([({1: (12.0, 0, 0)}, places)]).results(["a", "b"], {}, {}, 1.0)
    assert one["track_completeness"] == 0.5 and one["track_positional_accuracy_m"] == 8.0


def test_innovations_are_within_their_own_bounds():
    """Of 2 and 3 quantities: 95 % of chi-square lie in 0.0506 to 7.378 and 0.2158 to 9.348."""
    nis = np.array([0.05, 0.051, 7.37, 7.38, 0.215, 0.216, 9.34, 9.35, 0.06, 0.3])
    freedom = np.array([2, 2, 2, 2, 3, 3, 3, 3, 2, 3])
    got = innovation_results(nis, freedom)
    assert got["track_nis_inside"] == 6 / 10
    assert got["track_nis_per_freedom"] == pytest.approx(nis.sum() / 25)
    none = innovation_results(np.empty(0), np.empty(0, dtype=np.int64))
    assert all(math.isnan(value) for value in none.values())


def drawn():
    """Twelve instants of three targets that come and go, and five tracks, some false."""
    rng = np.random.default_rng(5)
    steps = []
    for k in range(12):
        places = {t: (2000.0 * t, 30.0 * k, 0.0) for t in range(3) if (k + t) % 5}
        tracks = {}
        for number, target in ((1, 0), (2, 1), (3, 2), (4, 1)):
            if rng.uniform() < 0.75 and target in places:
                tracks[number] = tuple(np.array(places[target]) + rng.normal(0, 40, 3))
        if k % 3 == 1:
            tracks[7] = tuple(np.array(FAR) + rng.normal(0, 40, 3))
        steps.append((tracks, places))
    return steps


def associated(tracks, places):
    """Pairs of track and target by trying all, then who is left with the nearest target."""
    apart = {(n, t): math.dist(tracks[n], places[t]) for n in tracks for t in places}
    best, pairs = math.inf, []
    numbers, targets = list(tracks), list(places)
    many = min(len(numbers), len(targets))
    for chosen in itertools.permutations(numbers, many):
        for others in itertools.combinations(targets, many):
            cost = sum(min(apart[n, t], LIMIT) for n, t in zip(chosen, others, strict=True))
            if cost < best - 1e-9:
                best, pairs = cost, list(zip(chosen, others, strict=True))
    pairs = [(n, t) for n, t in pairs if apart[n, t] < LIMIT]
    for n in numbers:
        near = min(targets, key=lambda t, n=n: apart[n, t], default=None)
        if near is not None and n not in {p[0] for p in pairs} and apart[n, near] < LIMIT:
            pairs.append((n, near))
    return pairs


def test_siap_and_ospa_are_those_of_stone_soup():
    pytest.importorskip("stonesoup", reason="needs the extra stonesoup")
    from stonesoup.measures import Euclidean
    from stonesoup.metricgenerator.manager import SimpleManager
    from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
    from stonesoup.metricgenerator.tracktotruthmetrics import SIAPMetrics
    from stonesoup.types.association import AssociationSet, TimeRangeAssociation
    from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
    from stonesoup.types.state import State
    from stonesoup.types.time import TimeRange
    from stonesoup.types.track import Track

    steps = drawn()
    start, paths, tracks = datetime(2000, 1, 1), {}, {}
    associations = []
    for k, (numbered, places) in enumerate(steps):
        when = start + timedelta(seconds=k + 1)
        for target, place in places.items():
            path = paths.setdefault(target, GroundTruthPath())
            path.append(GroundTruthState([*place, 0, 0, 0], timestamp=when))
        for number, place in numbered.items():
            track = tracks.setdefault(number, Track())
            track.append(State([*place, 0, 0, 0], timestamp=when))
        for number, target in associated(numbered, places):
            associations.append(
                TimeRangeAssociation(
                    {tracks[number], paths[target]}, TimeRange(when, when + timedelta(seconds=0.1))
                )
            )

    class Given:
        def associate_tracks(self, tracks, truths):
            return AssociationSet(set(associations))

    siap = SIAPMetrics(Euclidean((0, 1, 2)), Euclidean((3, 4, 5)))
    ospa = OSPAMetric(p=2, c=LIMIT, measure=Euclidean((0, 1, 2)))
    gospa = GOSPAMetric(p=2, c=LIMIT, measure=Euclidean((0, 1, 2)))
    manager = SimpleManager([siap, ospa, gospa], associator=Given())
    manager.add_data(set(paths.values()), set(tracks.values()))
    theirs = manager.generate_metrics()
    got = tallied(steps, 3).results(["a", "b", "c"], {}, {}, 12.0)
    for name, title in {
        "track_completeness": "SIAP Completeness",
        "track_ambiguity": "SIAP Ambiguity",
        "track_spuriousness": "SIAP Spuriousness",
        "track_positional_accuracy_m": "SIAP Position Accuracy",
        "track_velocity_accuracy_m_s": "SIAP Velocity Accuracy",
    }.items():
        assert got[name] == pytest.approx(theirs[title].value), name
    assert got["track_ambiguity"] > 1.0 and 0.0 < got["track_spuriousness"] < 1.0
    by_time = {m.timestamp: m.value for m in theirs["OSPA distances"].value}
    parts = {m.timestamp: m.value for m in theirs["GOSPA Metrics"].value}
    mine = []
    for k, (numbered, places) in enumerate(steps):
        when = start + timedelta(seconds=k + 1)
        apart = np.array([[math.dist(a, b) for b in places.values()] for a in numbered.values()])
        found = ospa_and_gospa(apart.reshape(len(numbered), len(places)), LIMIT)
        mine.append(found.ospa_m)
        assert found.ospa_m == pytest.approx(by_time[when])
        assert found.gospa_m == pytest.approx(parts[when]["distance"])
        assert found.localisation_m**2 == pytest.approx(parts[when]["localisation"])
        assert found.missed_m**2 == pytest.approx(parts[when]["missed"])
        assert found.false_m**2 == pytest.approx(parts[when]["false"])
    assert got["track_ospa_m"] == pytest.approx(np.mean(mine))
