"""Splitting by stages: no bias, intervals that hold, and a set whose copies know their family."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import dsa_des
from components.encounters.splitting import (
    draw_copy_counts,
    expected_copy_counts,
    least_miss_in_nmac_sizes,
    split_set,
)
from components.formats.set_file import read_set
from components.metrics.risk import risk_ratio
from tests.encounters.test_set_file import call
from tests.encounters.test_studies_of_encounters import made

LEVELS, COPIES = np.array([8.0, 2.0]), np.array([0.3, 1.0, 3.5])


def test_copies_by_hand() -> None:
    found = expected_copy_counts(np.array([9.0, 8.0, 7.9, 2.0, 0.0]), LEVELS, COPIES)
    assert found.tolist() == [0.3, 0.3, 1.0, 1.0, 3.5]
    for levels, copies, said in (
        ([2.0, 8.0], COPIES, "falling"), ([8.0], COPIES, "1 levels need 2"),
        (LEVELS, [0.0, 1, 2], "above 0"), ([], [1.0], "falling"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            expected_copy_counts(np.zeros(2), np.array(levels), np.array(copies))


def test_the_expected_number_is_that_and_an_encounter_s_own() -> None:
    numbers, expected = np.arange(40_000), np.tile([0.3, 1.0, 2.75, 3.0], 10_000)
    many = draw_copy_counts(numbers, expected, 5)
    for k, r in enumerate((0.3, 1.0, 2.75, 3.0)):
        error = np.sqrt(max((r % 1) * (1 - r % 1), 0.0) / 10_000)
        assert abs(many[k::4].mean() - r) <= 4 * error
    # A function of number and seed: others in the batch change nothing.
    assert (draw_copy_counts(numbers[7:9], expected[7:9], 5) == many[7:9]).all()
    assert (draw_copy_counts(numbers, expected, 6) != many).any()


def airspace(random, count):
    """Encounters with a score; who is near is more often hit, and avoidance fails less often."""
    score = random.exponential(6.0, count)
    w = random.choice([1.0, 3.0], count)
    n = random.random(count) < np.clip(1.2 - score, 0.0, 1.0)
    fails = 0.5 * random.random(count) * (score < 4)  # of this encounter, whatever the noise
    return score, w, n, fails


def test_split_sets_agree_with_plain_ones_and_know_how_wrong_they_are() -> None:
    """The same truth from as many runs, over many sets: no bias, 95 % held, and narrower."""
    truth_of = np.random.default_rng(1)
    score, w, n, fails = airspace(truth_of, 1_000_000)
    truth = (w * fails).sum() / (w * n).sum()
    random = np.random.default_rng(2)
    ratios, held, widths, plain_widths, rounds = [], 0, [], [], 200
    for seed in range(rounds):
        score, w, n, fails = airspace(random, 1500)
        expected = expected_copy_counts(score, np.array([4.0]), np.array([0.15, 2.5]))
        many = draw_copy_counts(np.arange(1500), expected, seed)
        place = np.repeat(np.arange(1500), many)
        m = random.random(len(place)) < fails[place]  # each copy has random numbers of its own
        found = risk_ratio(n[place], m, (w / expected)[place], cluster=place)
        ratios.append(found.ratio)
        held += found.interval[0] <= truth <= found.interval[1]
        widths.append(found.standard_error)
        plain = risk_ratio(n, random.random(1500) < fails, w)
        plain_widths.append(plain.standard_error)
        if seed < 20:  # both estimates of one set, within their intervals
            apart = abs(found.ratio - plain.ratio)
            assert apart < 4 * np.hypot(found.standard_error, plain.standard_error)
    assert abs(np.mean(ratios) / truth - 1) < 0.02
    assert 0.925 <= held / rounds <= 0.975
    assert np.mean(widths) < 0.93 * np.mean(plain_widths)


def test_a_set_is_split_and_flown_and_its_families_are_the_units(tmp_path: Path) -> None:
    file, scene = made(tmp_path, 12)
    out = tmp_path / "split.parquet"
    done = call("split", file, "--levels", "40,8", "--copies", "0.5,1,3", "--out", out)
    assert done.exit_code == 0 and "copies of" in done.stdout
    whole, some = read_set(file), read_set(out)
    near = np.array([least_miss_in_nmac_sizes(whole, place) for place in range(12)])
    by_hand = np.select([near < 8, near < 40], [3.0, 1.0], 0.5)
    many = np.bincount(some.extra["family"].astype(int), minlength=12)
    assert (many[near < 8] == 3).all() and (many[(near >= 8) & (near < 40)] == 1).all()
    assert (many[near >= 40] <= 1).all()
    for place, family in enumerate(some.extra["family"].astype(int)):
        assert some.weights[place] == pytest.approx(whole.weights[family] / by_hand[family])
        for a in (0, 1):
            mine, theirs = some.path(2 * place + a), whole.path(2 * family + a)
            assert all((x == y).all() for x, y in zip(mine, theirs, strict=True))
    # A set that is split again keeps its first families.
    again = split_set(some, np.full(len(some), 1.6), 0)
    assert len(some) < len(again) < 2 * len(some)
    weight_of = dict(zip(some.extra["family"].tolist(), some.weights / 1.6, strict=True))
    assert again.weights.tolist() == [weight_of[f] for f in again.extra["family"].tolist()]
    study = f'scene = "{scene}"\nreplicas = 3\nmetrics = ["encounter_weight"]\n'
    study += f'[set]\nblocks.traffic.file = "{out}"\n'
    study += "[draws]\nblocks.traffic.encounter = { sequence = [0, 1] }\n"
    (tmp_path / "s.toml").write_text(study, encoding="utf-8")
    dsa_des.study(tmp_path / "s.toml", out=tmp_path / "out", workers=1)
    table = pq.read_table(tmp_path / "out" / "parts").to_pydict()
    assert table["encounter_family"] == some.extra["family"][:3].tolist()
    # Scores of a study's folder: the least of an encounter's runs.
    folder = tmp_path / "out"
    done = call("split", out, "--levels", "2", "--copies", "1,2", "--scores", folder, "--score",
                "encounter_weight", "--out", tmp_path / "t.parquet")  # fmt: skip
    assert done.exit_code == 2 and "encounter 3: encounter_weight is missing" in done.stderr


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    file, _ = made(tmp_path, 2)
    for words, said in (
        (("--levels", "8,x", "--copies", "1,2,3"), "--levels 8,x: must be numbers"),
        (("--levels", "8", "--copies", "1"), "1 levels need 2"),
        (("--levels", "8", "--copies", "1,2", "--score", "s"), "belong together"),
    ):
        done = call("split", file, *words, "--out", tmp_path / "o.parquet")
        assert done.exit_code == 2 and said in done.stderr, said
