"""Sampled tracks against the exact distributions of their model, by enumeration of its states."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.special import chdtrc

from components.encounters.model_file import read_model
from components.encounters.sampling import EncounterDraws, SampledTracks, TrackSampler
from tests.encounters.model_text import Slow, marginals, next_chances, slow_reading, small_model
from tests.encounters.reference_data import reference_file

#: One draw of chance below this would come once in 10,000 tests; seeds are fixed.
UNLIKELY = 1e-4
MODELS = ["models/paramotor_v1.txt", "models/uncor_1200code_v1.txt"]


def model_file(name: str, folder: Path) -> Path:
    if name != "small":
        return reference_file(name)
    path = folder / "small.txt"
    path.write_text(small_model(), encoding="utf-8")
    return path


def sampled(path: Path, count: int, seconds: int, seed: int = 5) -> tuple[Slow, SampledTracks]:
    model = read_model(path)
    sampler = TrackSampler(model, EncounterDraws(seed, "tracks"))
    return slow_reading(path.read_text(encoding="utf-8")), sampler.sample(range(count), seconds)


def bins_of(slow: Slow, place: int, values: np.ndarray) -> np.ndarray:
    edges = slow.edges[place]
    if edges is None:
        return values.astype(int) - 1
    return np.searchsorted(edges, values, side="right") - 1


def chance_of(seen: np.ndarray, expected: np.ndarray) -> float:
    """Return how likely a chi-square as large is; cells that expect less than 5 are one."""
    assert seen[expected == 0.0].sum() == 0
    few = expected < 5.0
    seen = np.append(seen[~few], seen[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    seen, expected = seen[expected > 0.0], expected[expected > 0.0]
    if len(seen) < 2:
        return 1.0
    return float(chdtrc(len(seen) - 1, ((seen - expected) ** 2 / expected).sum()))


@pytest.mark.parametrize("name", MODELS)
def test_initial_states_follow_the_exact_marginals(name: str, tmp_path: Path) -> None:
    slow, tracks = sampled(model_file(name, tmp_path), 20_000, 0)
    for place, exact in enumerate(marginals(slow)):
        bins = bins_of(slow, place, tracks.initial[place])
        seen = np.bincount(bins, minlength=len(exact))
        assert chance_of(seen, exact * len(bins)) > UNLIKELY, slow.labels[place]
        if name != "small":  # the published models' parents are all tied to each other
            counts = slow.tables[place].sum(axis=0)
            assert exact == pytest.approx(counts / counts.sum(), abs=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_values_are_uniform_in_their_bins_and_exactly_zero_around_zero(
    name: str, tmp_path: Path
) -> None:
    slow, tracks = sampled(model_file(name, tmp_path), 20_000, 0)
    for place, edges in enumerate(slow.edges):
        if edges is None:
            continue
        values = tracks.initial[place]
        bins = bins_of(slow, place, values)
        for k, (low, high) in enumerate(pairwise(edges)):
            mine = values[bins == k]
            if low < 0.0 < high:
                assert (mine == 0.0).all()
            elif len(mine) > 300:
                seen = np.histogram(mine, 10, (low, high))[0]
                assert chance_of(seen, np.full(10, len(mine) / 10)) > UNLIKELY


@pytest.mark.parametrize("name", MODELS)
def test_every_second_follows_the_networks_columns(name: str, tmp_path: Path) -> None:
    path = model_file(name, tmp_path)
    slow, tracks = sampled(path, 1500, 30)
    model = read_model(path)
    states = []
    for place in range(len(slow.labels)):
        if place in model.dynamic_indices:
            values = tracks.changing[:, model.dynamic_indices.index(place)]
            states.append(bins_of(slow, place, values))
        else:
            bins = bins_of(slow, place, tracks.initial[place])
            states.append(np.broadcast_to(bins, (31, len(bins))))
    steps = np.array(states)
    before, after = steps[:, :-1].reshape(len(states), -1), steps[:, 1:].reshape(len(states), -1)
    seen: dict[tuple[int, ...], Counter] = {}
    for old, new in zip(
        before.T.tolist(), after[list(model.dynamic_indices)].T.tolist(), strict=True
    ):
        seen.setdefault(tuple(old), Counter())[tuple(new)] += 1
    order = [slow.labels.index(slow.now[p].removesuffix("(t+1)")) for p in slow.later_tables]
    assert order == list(model.dynamic_indices)
    total, expected_total, likely = 0, 0.0, []
    for state, found in sorted(seen.items(), key=lambda item: -item[1].total())[:60]:
        exact = next_chances(slow, state)
        assert set(found) <= set(exact)
        many = found.total()
        counts = np.array([found[choice] for choice in exact])
        likely.append(chance_of(counts, np.array(list(exact.values())) * many))
        stays = tuple(state[p] for p in model.dynamic_indices)
        total, expected_total = total + found[stays], expected_total + many * exact.get(stays, 0.0)
    assert min(likely) > UNLIKELY / len(likely)
    # Taken together they are uniform, or nearly so where cells are few.
    assert 0.3 < np.mean(likely) < 0.8
    assert total == pytest.approx(expected_total, rel=0.01)


def test_the_chain_forgets_its_start_as_the_exact_one_does(tmp_path: Path) -> None:
    """Parents are those of the present second: after 12 s the joint distribution is the chain's."""
    path = model_file("small", tmp_path)
    slow, tracks = sampled(path, 30_000, 12)
    model = read_model(path)
    static = [p for p in range(6) if p not in model.dynamic_indices]
    bins = [bins_of(slow, p, tracks.initial[p]) for p in range(6)]
    start = Counter(zip(*(b.tolist() for b in bins), strict=True))
    chances = dict(start)
    steps = {state: next_chances(slow, state) for state in np.ndindex(*slow.sizes)}
    for _ in range(12):
        later: dict[tuple[int, ...], float] = {}
        for state, weight in chances.items():
            for choice, chance in steps[state].items():
                new = list(state)
                for p, value in zip(model.dynamic_indices, choice, strict=True):
                    new[p] = value
                later[tuple(new)] = later.get(tuple(new), 0.0) + weight * chance
        chances = later
    ends = list(bins)
    for k, p in enumerate(model.dynamic_indices):
        ends[p] = bins_of(slow, p, tracks.changing[12, k])
    found = Counter(zip(*(b.tolist() for b in ends), strict=True))
    assert set(found) <= set(chances)
    seen = np.array([found[state] for state in chances])
    assert chance_of(seen, np.array(list(chances.values()))) > UNLIKELY
    # It has moved: the first state's distribution would be refused.
    dynamic = [tuple(state[p] for p in model.dynamic_indices) for state in chances]
    assert len(set(dynamic)) > 10 and static


@pytest.mark.parametrize("name", MODELS)
def test_values_hold_unless_they_are_drawn_anew_at_their_rate(name: str, tmp_path: Path) -> None:
    path = model_file(name, tmp_path)
    slow, tracks = sampled(path, 4000, 20)
    model = read_model(path)
    for k, place in enumerate(model.dynamic_indices):
        values = tracks.changing[:, k]
        bins = bins_of(slow, place, values)
        edges = slow.edges[place]
        same = bins[1:] == bins[:-1]
        around = np.array([a < 0.0 < b for a, b in pairwise(edges)])
        telling = same & ~around[bins[1:]]
        new = (values[1:] != values[:-1]) & telling
        many, rate = telling.sum(), slow.rates[place]
        assert abs(new.sum() - rate * many) < 4.0 * np.sqrt(rate * (1 - rate) * many) + 1e-9
        drawn = values[1:][new]
        inside = bins[1:][new]
        low, high = np.array(edges)[inside], np.array(edges)[inside + 1]
        seen = np.histogram((drawn - low) / (high - low), 10, (0, 1))[0]
        assert chance_of(seen, np.full(10, len(drawn) / 10)) > UNLIKELY


def test_a_track_is_the_same_alone_in_any_batch_and_as_part_of_a_longer_one(tmp_path: Path) -> None:
    model = read_model(model_file("small", tmp_path))
    sampler = TrackSampler(model, EncounterDraws(3, "tracks"))
    alone = sampler.sample([77_123], 40)
    batch = sampler.sample([5, 77_123, 1, 77_124], 60, [0, 0, 2, 0])
    assert np.array_equal(alone.initial[:, 0], batch.initial[:, 1])
    assert np.array_equal(alone.changing[..., 0], batch.changing[:41, :, 1])
    again = sampler.sample([77_123], 40, 1)
    other = TrackSampler(model, EncounterDraws(4, "tracks")).sample([77_123], 40)
    assert not np.array_equal(alone.changing, again.changing)
    assert not np.array_equal(alone.changing, other.changing)


@pytest.mark.parametrize(
    "check",
    [
        test_initial_states_follow_the_exact_marginals,
        test_values_are_uniform_in_their_bins_and_exactly_zero_around_zero,
        test_every_second_follows_the_networks_columns,
        test_values_hold_unless_they_are_drawn_anew_at_their_rate,
    ],
)
def test_a_small_model_of_our_own_is_sampled_as_well(check, tmp_path: Path) -> None:
    check("small", tmp_path)
