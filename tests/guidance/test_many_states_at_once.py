"""Bands of many states at once are those of each state by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from components.alert_configuration.conf_file import read_conf
from components.guidance.bands import GuidedIntruder, guidance, guidance_of_many
from components.guidance.intervals import clear_intervals
from components.guidance.regions import GuidedIntruders, has_neighbouring_clear_values
from components.guidance.situation import State
from tests.alerting.conf_text import CONF

COUNT = 60


def draw(random, near_m, up_m=None):
    east, north = random.uniform(-near_m, near_m, (2, COUNT))
    up = random.uniform(300.0, 3000.0, COUNT) if up_m is None else up_m
    track, speed = random.uniform(0.0, 2 * np.pi, COUNT), random.uniform(5.0, 130.0, COUNT)
    climb = random.normal(0.0, 4.0, COUNT) * (random.random(COUNT) < 0.6)
    return State(east, north, up, speed * np.sin(track), speed * np.cos(track), climb)


@pytest.mark.parametrize("kind", ["hdir", "hs", "vs", "alt"])
def test_each_state_is_as_alone(kind, tmp_path):
    path = tmp_path / "two.conf"
    path.write_text(CONF, encoding="utf-8")
    configuration = read_conf(path)
    random = np.random.default_rng(217)
    own = draw(random, 0.0)
    first = draw(random, 7000.0, own.up_m + random.normal(0.0, 90.0, COUNT))
    second = draw(random, 3000.0, own.up_m + random.normal(0.0, 200.0, COUNT))
    early = random.integers(0, 3, COUNT)
    there = random.random(COUNT) < 0.7
    last = configuration.alerters[-1]
    together = guidance_of_many(
        kind,
        configuration,
        own,
        [
            GuidedIntruders(first, configuration.alerters[0], early),
            GuidedIntruders(second, last, np.zeros(COUNT, dtype=np.int64), there),
        ],
    )
    for row, found in enumerate(together):
        intruders = [
            GuidedIntruder(first.rows(row), configuration.alerters[0], int(early[row])),
            GuidedIntruder(second.rows(row), last),
        ]
        alone = guidance(kind, configuration, own.rows(row), intruders[: 1 + there[row]])
        assert found == alone
    assert 5 < sum(len(found.bands) > 1 for found in together) < COUNT
    assert any(found.recovery is not None for found in together)


def test_whether_any_way_is_clear_goes_by_each_ones_own_limits():
    """As the intervals of each say, of values some of which lie beyond limits of their own."""
    random = np.random.default_rng(3)
    values = np.tile(np.arange(8.0), (COUNT, 1))
    least, most = random.uniform(0.0, 4.0, COUNT), random.uniform(3.0, 7.0, COUNT)
    clear = random.random((COUNT, 8)) < 0.5
    kind = SimpleNamespace(values=values, least=least, most=most, cyclic=False)
    rows = zip(values, clear, least, most, strict=True)
    alone = [bool(clear_intervals(*row, cyclic=False)) for row in rows]
    assert has_neighbouring_clear_values(kind, clear).tolist() == alone
    assert 5 < sum(alone) < COUNT - 5
