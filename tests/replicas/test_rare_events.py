"""Rare events by splitting, held against closed forms."""

import math
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from wired import head_on_loop

from components.metrics.flown_flights import FlownMetric
from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.files.toml_files import to_toml
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.splitting import (
    FlownRuns,
    find_levels,
    parent_indices_of_branches,
    run_repetitions,
)
from dsa_des.results.statistics import estimate_rare_probability
from dsa_des.studies.chunk import run_chunk
from dsa_des.studies.study_file import read_study
from dsa_des.time.randomness import Streams

S = 10**9
#: A run turns away at a whole second with this probability if it has not before; who has not at
#: second 20 meets with the event. Its time to go is 20 s less the second, until it turns.
STAYS, LAST = 0.6, 20
CANDIDATES = np.array([*range(LAST, -1, -1)], dtype=float)
RARE = STAYS**LAST


def chain(runs, of, levels, weights=None):
    """When runs reach some times to go, s."""
    number, second = np.arange(len(runs)).repeat(LAST), np.tile(np.arange(LAST), len(runs))
    stream = Streams([run.seed for run in runs]).stream("pilot", "turn").of_runs(number, second * S)
    u = stream.uniform(np.zeros(len(number), np.uint64), second).reshape(-1, LAST)
    turned = np.where((u >= STAYS).any(axis=1), (u >= STAYS).argmax(axis=1), LAST)
    # At second t it is known whether it turned before t; a branch draws anew a little later.
    at_s = [np.where(LAST - level <= turned, LAST - level - 0.5, np.nan) for level in levels]
    ones = np.ones(len(runs)) if weights is None else weights(runs)
    return FlownRuns(np.array(at_s), ones, [None] * len(runs))


def roots(repetition, count=50):
    return [Replica(1000 * repetition + k) for k in range(count)]


def test_levels_are_reached_by_a_fifth_of_the_runs_of_a_stage():
    levels = find_levels(roots(0, 400), 5, CANDIDATES, chain)
    assert levels[-1] == 0.0
    steps = -np.diff([LAST, *levels])
    # 0.6^3 = 0.216 is the least power that is a fifth.
    assert set(steps[:-1]) <= {2, 3} and steps.mean() > 2.4


def test_levels_of_separation_lead_to_the_event_where_the_last_step_is_the_steepest():
    """All 20 s are within 9 % of the event: of 3.7e-5 in one step no pilot has a run."""

    def last_step(runs, of, levels):
        to_go_s = np.floor(8.0 * LAST * np.log2(levels) + 1e-9)
        return chain(runs, of, np.minimum(to_go_s, LAST).tolist())

    levels = find_levels(roots(0, 400), 5, FlownMetric.scores["separation"], last_step)
    assert levels == tuple(2.0 ** (np.arange(4, -1, -1) / 32.0))


def of_many(repetitions):
    """The estimates of some repetitions of a probability of 3.7e-5."""
    levels = (*range(LAST - 3, -1, -3), 0.0)
    found = run_repetitions(
        [roots(n) for n in range(repetitions)], [*range(repetitions)], levels, chain
    )
    assert {one.flown for one in found if one.probability} == {50 * len(levels)}
    return np.array([one.probability for one in found])


def test_a_rare_probability_is_found_without_bias():
    """A plain study of as many runs would see the event once."""
    p = of_many(40)
    error = p.std(ddof=1) / math.sqrt(len(p))
    assert abs(p.mean() - RARE) < 3.0 * error
    assert error < 0.25 * RARE


def test_intervals_cover():
    found = [
        estimate_rare_probability(some, np.zeros(10), 0.95)
        for some in of_many(2000).reshape(-1, 10)
    ]
    covered = [one.low <= RARE <= one.high for one in found]
    # Three standard errors of a binomial share of so many intervals.
    assert abs(np.mean(covered) - 0.95) <= 3.0 * math.sqrt(0.95 * 0.05 / len(found))


@pytest.mark.parametrize("comes", [True, False])
def test_a_repetition_s_share_is_the_product_of_its_stages(comes: bool) -> None:
    """Of four runs the first comes within the level, and then three branches of it or none."""

    def flown(runs, of, levels):
        reached = np.full((1, len(runs)), np.nan)
        some = slice(0, 1) if levels == [7.0] else slice(0, 3 if comes else 0)
        reached[0, some] = 2.5
        return FlownRuns(reached, np.ones(len(runs)), [None] * len(runs))

    (found,) = run_repetitions([roots(0, 4)], [5], (7.0, 0.0), flown)
    assert found.flown == 8 and found.error is None
    # One branch more at the last stage stands for a quarter of a quarter.
    expected = (3 / 16, 3 / 64) if comes else (0.0, 1 / 16)
    assert (found.probability, found.unseen) == pytest.approx(expected)


def test_repetitions_are_what_each_is_alone():
    levels = (14.0, 7.0, 0.0)
    together = run_repetitions([roots(n) for n in range(5)], [*range(5)], levels, chain)
    alone = [run_repetitions([roots(n)], [n], levels, chain)[0] for n in range(5)]
    assert together == alone


def test_weights_of_the_first_runs_count():
    """Runs of odd seeds never turn before second 10, weigh 1/9 each, and are half of all."""

    def flown(runs, of, levels):
        said = chain(
            runs, of, levels, lambda some: np.array([1.0 + 8.0 * (r.seed % 2 == 0) for r in some])
        )
        odd = np.array([run.seed % 2 == 1 for run in runs])
        return FlownRuns(np.where(odd, np.nan, said.reached_s), said.weights, said.errors)

    found = run_repetitions([roots(n) for n in range(60)], [*range(60)], (17.0, 14.0, 11.0), flown)
    p = np.array([one.probability for one in found])
    assert abs(p.mean() - 0.9 * STAYS**9) < 3.0 * p.std(ddof=1) / math.sqrt(len(p))


def test_a_collapsed_repetition_is_none_that_is_dropped():
    # A stage of a probability of 0.6^14 that hardly any of 50 runs passes.
    found = run_repetitions([roots(n) for n in range(60)], [*range(60)], (14.0, 0.0), chain)
    collapsed = [one for one in found if one.probability == 0.0]
    assert 20 < len(collapsed) < 60
    assert all(
        one.error is None and one.flown in (50, 100) and one.unseen > 0.0 for one in collapsed
    )


def test_the_interval_where_no_repetition_came_to_it():
    """3.69 events are seen at least once with 97.5 %: so many times what one would have added."""
    nothing = estimate_rare_probability(np.zeros(10), np.full(10, 2e-6), 0.95)
    assert (nothing.value, nothing.low) == (0.0, 0.0)
    assert nothing.high == pytest.approx(-math.log(0.025) * 2e-6 / 10)
    assert estimate_rare_probability(np.zeros(10), np.full(10, 5.0), 0.95).high == 1.0


def test_the_interval_of_a_skewed_mean_is_that_of_its_logarithm():
    values = np.array([1e-6, 2e-6, 4e-6])
    found = estimate_rare_probability(values, np.zeros(3), 0.95)
    half = 4.302652729911275 * values.std(ddof=1) / math.sqrt(3) / values.mean()
    np.testing.assert_allclose([found.low, found.high], values.mean() * np.exp([-half, half]))


def test_a_score_that_never_rises_is_said():
    def stuck(runs, of, levels):
        at = np.where(np.array(levels)[:, np.newaxis] >= 12.0, 3.0, np.nan)
        return FlownRuns(at.repeat(len(runs), axis=1), np.ones(len(runs)), [None] * len(runs))

    with pytest.raises(
        ValueError, match=r"the score never rises: of 50 runs of the pilot.* of 12 "
    ):
        find_levels(roots(0), 1, CANDIDATES, stuck)


def test_a_run_that_fails_fails_its_repetition_alone():
    def failing(runs, of, levels):
        said = chain(runs, of, levels)
        errors = ["radar failed" if run.seed == 1003 else None for run in runs]
        return FlownRuns(said.reached_s, said.weights, errors)

    found = run_repetitions([roots(n) for n in range(3)], [0, 1, 2], (14.0, 0.0), failing)
    assert [one.error for one in found] == [None, "radar failed", None]
    with pytest.raises(ValueError, match="of the pilot of splitting: radar failed"):
        find_levels(roots(1), 1, CANDIDATES, failing)


def test_branches_come_from_each_run_as_often_as_it_weighs():
    weights = np.array([1.0, 2.0, 5.0, 2.0])
    often = np.zeros(4)
    for k in range(1000):
        chosen = np.bincount(parent_indices_of_branches(weights, 7, (k + 0.5) / 1000), minlength=4)
        assert (np.abs(chosen - 0.7 * weights) < 1.0).all()
        often += chosen
    np.testing.assert_allclose(often / 1000, 0.7 * weights, rtol=2e-3)


#: A radar sees an aircraft that comes head-on from 3 km on; every second a track is told, or lost.
#: Only a turn that is told at one of the first 21 tracks keeps clear of an NMAC.
def late(loses):
    lossy = {"drop_probability": loses}
    return head_on_loop({"range_km": 3}, lossy, north_m=3300, duration_s=36)


def study_of(folder, loses=0.5, **keys):
    """A study of it by splitting, ready to run; the wire loses such a share of the messages."""
    (folder / "late.toml").write_text(to_toml(late(loses)))
    tables = {
        "scene": str(folder / "late.toml"), "metrics": ["well_clear"], "replicas": 4,
        "splitting": {"event": "nmac", "runs": 10, "levels": [24, 20]},
    } | keys  # fmt: skip
    (folder / "study.toml").write_text(to_toml(tables))
    return read_study(folder / "study.toml")


def rows_of(study):
    parts = [run_chunk(study, chunk).content for chunk in study.chunks(0, study.cells)]
    return [row for part in parts for row in pq.read_table(pa.BufferReader(part)).to_pylist()]


def test_repetitions_of_a_study_are_the_same_in_any_chunk(tmp_path):
    rows = rows_of(study_of(tmp_path))
    assert [row["replica"] for row in rows] == [0, 1, 2, 3]
    assert {row["nmac.levels"] for row in rows} == {"24, 20"}
    assert {row["nmac.collapsed"] for row in rows} <= {0.0, 1.0}
    assert all((row["nmac"] == 0.0) == row["nmac.collapsed"] and not row["error"] for row in rows)
    for chunk in (1, 3):
        other = rows_of(study_of(tmp_path, runs_per_chunk=chunk))
        assert [{**row, "command": 0} for row in other] == [{**row, "command": 0} for row in rows]


def test_the_pilot_is_found_once_and_again_the_same(tmp_path):
    table = {"splitting": {"event": "nmac", "runs": 40}, "replicas": 2, "runs_per_chunk": 1}
    study = study_of(tmp_path, **table)
    first, second = rows_of(study)
    levels = [float(text) for text in first["nmac.levels"].split(", ")]
    assert first["nmac.levels"] == second["nmac.levels"]
    assert levels[0] < 28.0 and levels == sorted(levels, reverse=True) and levels[-1] > 5.0


def test_a_probability_of_half_a_millionth_in_a_closed_loop(tmp_path):
    levels = [*range(26, 7, -2)]
    table = {"event": "nmac", "runs": 40, "levels": levels}
    rows = rows_of(study_of(tmp_path, splitting=table, replicas=12))
    found = estimate_rare_probability(
        *(np.array([row[n] for row in rows]) for n in ("nmac", "nmac.unseen")), 0.95
    )
    assert found.low < 0.5**21 < found.high
    assert found.high < 5.0 * found.low


def test_distances_part_runs_that_may_still_turn(tmp_path):
    """Where a third of the runs come near without a turn they find what the closed form says."""
    table = {"event": "nmac", "score": "separation", "runs": 60, "levels": [10]}
    rows = rows_of(study_of(tmp_path, 0.93, splitting=table, replicas=8))
    found = estimate_rare_probability(
        *(np.array([row[n] for row in rows]) for n in ("nmac", "nmac.unseen")), 0.95
    )
    assert found.low < 0.93**21 < found.high < 2.0 * found.low


@pytest.mark.parametrize(
    ("loses", "table", "said"),
    [
        # Every run turns in time, whatever is drawn.
        (0, {}, ["study.toml: none of its 4 runs gave a result; the first: the score never rises: "
         "of 10 runs of the pilot"]),
        # Nobody ever turns: the event is sure, and no stage is needed.
        (1, {}, ["nmac 1 1 to 1", "nmac.collapsed 0.00"]),
        # Who has come to 1,200 m was told to turn long before: distances show it too late.
        (0.5, {"score": "separation"}, ["none of its 4 runs gave a result", "a score of 8 none "
         "comes nearer to the event, whatever is drawn from then on; take another splitting.score, "
         "more"]),
        # A level that nobody reaches: all have collapsed, and that is no probability of 0.
        (0.5, {"levels": [24, 0.1]}, ["nmac 0.000 0.000 to 0.", "nmac.collapsed 1.00"]),
        # One that all begin within is passed.
        (1, {"levels": [100, 24]}, ["nmac 1 1 to 1", "nmac.runs 30"]),
    ],
)  # fmt: skip
def test_odd_stages_are_told_on_one_page(loses, table, said, tmp_path):
    study_of(tmp_path, loses, splitting={"event": "nmac", "runs": 10} | table)
    out = ["--out", str(tmp_path / "out"), "--workers", "1", "--no-figures"]
    done = CliRunner().invoke(main, ["study", str(tmp_path / "study.toml"), *out])
    failed = "none of its" in said[0]
    shown = re.sub(r"\s+", " ", done.stderr if failed else done.stdout)
    assert done.exit_code == (2 if failed else 0) and [s for s in said if s not in shown] == []
    assert not (failed and done.stdout)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"splitting": {"event": "nmca"}}, "splitting.event = 'nmca': is no event that well_clear "
         "has a score of; did you mean 'nmac'?"),
        ({"splitting": {"event": "nmac", "score": "tau"}}, "splitting.score = 'tau': is no score; "
         "allowed: separation, time_to_go"),
        ({"splitting": {"event": "nmac", "levels": [3, 5]}}, "splitting.levels = [3, 5]: must "
         "fall, from far to near, for example [20, 12]"),
        ({"splitting": {"event": "nmac", "score": "separation", "levels": [3, 0.5]}},
         "splitting.levels = [3.0, 0.5]: must all be above 1, which is the event itself"),
        ({"replicas": 1}, "replicas = 1: are the repetitions of splitting: its interval needs 2"),
        ({"over": []}, "over: does not go with splitting"),
        ({"metrics": ["well_clear", "closest_approach"]},
         "metrics: splitting is for one event: leave the one metric that gives it"),
        ({"metrics": ["closest_approach"]}, "splitting.event = 'nmac': the metric "
         "closest_approach does not know how near a run comes"),
        ({"metrics": [{"metric": "well_clear", "tau_s": 35}],
          "splitting": {"event": "well_clear_lost"}}, "is no event that well_clear has a score of"),
        ({"scene": str(Path("configs/first_light.toml").resolve())},
         "splitting: the scene has no closed loop: nothing that is drawn changes a flight"),
    ],
)  # fmt: skip
def test_what_makes_splitting_impossible_is_said_before_the_first_run(keys, said, tmp_path):
    with pytest.raises(SceneError, match=re.escape(said)):
        study_of(tmp_path, **keys)


def test_a_block_that_cannot_be_flown_again_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("components.turning_away.TurnAway.needs_host", "is a host's")
    with pytest.raises(SceneError, match="splitting: the block avoidance waits for a host program"):
        study_of(tmp_path)
