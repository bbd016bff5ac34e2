"""Turns of a study: every run of every model once, members kept whole, times by the turn."""

from collections import Counter
from pathlib import Path

import pytest

from dsa_des.answers.alternatives import Alternative, add_model_axis
from dsa_des.answers.models_in_turns import TurnTimes, split_into_batches
from dsa_des.studies.study_file import read_study

CONFIGS = Path(__file__).parents[2] / "configs"
LIST = """
title = "small"
scene = "first_light"
replicas = {replicas}
runs_per_chunk = {chunk}
metrics = ["first_detection"]
over = [{over}]
[axes]
blocks.radar.scan_rate_hz = [1, 2]
"blocks.traffic.intruders[0].north_m" = [8000, 8100, 8200, 8300, 8400, 8500, 8600]
"""


def study_of(folder, replicas, chunk, over=""):
    path = folder / "study.toml"
    path.write_text(LIST.format(replicas=replicas, chunk=chunk, over=over))
    return add_model_axis(read_study(path), [Alternative("other", (("title", "another"),))])


@pytest.mark.parametrize(
    ("replicas", "chunk", "many", "over", "turns"),
    [
        (40, 5, None, "", 8),
        (40, 1, None, "", 16),
        (40, 100, None, "", 5),
        (40, 100, 3, "", 3),
        (2, 100, None, "", 2),
        (1, 100, None, "'traffic.intruders[0].north_m'", 5),
        (3, 2, 100, "'traffic.intruders[0].north_m'", 7),
    ],
)
def test_all_runs_are_in_one_turn(tmp_path, replicas, chunk, many, over, turns):
    study = study_of(tmp_path, replicas, chunk, over)
    batches = split_into_batches(study, many)
    assert len(batches) == turns
    runs = Counter((cell, k) for batch in batches for cell, start, end in batch
                   for k in range(start, end))  # fmt: skip
    assert runs == Counter({(cell, k): 1 for cell in range(14) for k in range(replicas)})
    sizes = [sum(end - start for _, start, end in batch) for batch in batches]
    assert max(sizes) - min(sizes) <= 2 * max(7, replicas)


def test_members_of_a_sample_are_kept_whole(tmp_path):
    """Both scan rates meet an encounter in the same turn."""
    study = study_of(tmp_path, 2, 4, "'traffic.intruders[0].north_m'")
    for batch in split_into_batches(study):
        cells = {cell for cell, _, _ in batch}
        assert {cell + 7 if cell < 7 else cell - 7 for cell in cells} == cells


def test_a_time_is_taken_by_that_of_the_same_turn():
    """A machine that is half as fast in the second turn changes nothing."""
    times = TurnTimes()
    for turn, slow in enumerate((1.0, 2.0, 1.0)):
        for model, cpu_s in enumerate((1.0, 0.5, 3.0)):
            times.cpu_s[turn, model], times.runs[turn, model] = slow * cpu_s, 10
    assert times.relative_cpu_and_spread(1) == (0.5, 0.0)
    assert times.relative_cpu_and_spread(2) == pytest.approx((3.0, 0.0))
    assert times.run_cpu_ms_and_spread(0)[0] == 100.0
    del times.cpu_s[1, 0]  # interrupted: that turn has nothing to be held against
    assert times.relative_cpu_and_spread(1) == (0.5, 0.0)
