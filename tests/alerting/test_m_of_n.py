"""Alert levels behind a filter, against the rule in plain loops."""

import numpy as np
import pytest
from covering import covers
from wired import rows, run

import dsa_des
from components.alerting.m_of_n import MOfNAlerts, MOfNParameters
from components.messages.alerts import AlertLevels
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.block.wake import Wake
from dsa_des.errors import SceneError

KIND = ("alerting.m_of_n",)


def scene(**keys):
    """Levels of noisy lines of sight, which flicker, and the same filtered."""
    found = dsa_des.load_scene("alerting/first_light", duration_s=60, seed=3).resolved()
    found["blocks"]["alerting"]["hysteresis"] = False
    found["blocks"]["filter"] = {"type": "alerting.m_of_n", **keys}
    found["wires"] = [*found["wires"], "alerting -> filter"]
    return found


def by_target(found, block):
    each = {}
    for row in rows(found, "alerts", block=block):
        each.setdefault(row["target"], []).append((row["time_s"], row["level"]))
    return each


def plain(levels, m, n, hold_s, forget_s):
    """One target's filtered levels."""
    found, last, queue, shown, rose = [], None, [], 0, None
    for time_s, raw in levels:
        if last is None or time_s - last > forget_s:
            queue, shown, rose = [raw] * m + [-1] * (n - m), -1, None
        queue = [*queue[1:], raw]
        counts = sorted(queue)[-m]
        held = shown > 0 and counts < shown and rose is not None and time_s - rose < hold_s
        if not held:
            if counts > 0 and counts > shown:
                rose = time_s
            shown = max(counts, 0)
        found.append((time_s, shown))
        last = time_s
    return found


@covers("m", "n", "hold_s", "forget_s", of=KIND)
@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"m": 1, "n": 1, "hold_s": 0.0},
        {"m": 3, "n": 4},
        {"m": 2, "n": 7},
        {"hold_s": 11.0},
        {"hold_s": 2.5, "forget_s": 0.5},
    ],
)
def test_levels_are_those_of_the_rule(keys):
    found = run(scene(**keys))
    raw, filtered = by_target(found, "alerting"), by_target(found, "filter")
    rule = {"m": 2, "n": 4, "hold_s": 4.0, "forget_s": 5.0, **keys}
    assert filtered == {target: plain(levels, **rule) for target, levels in raw.items()}
    assert sum(level > 0 for levels in raw.values() for _, level in levels) > 5


def test_every_key_changes_what_passes():
    default = by_target(run(scene()), "filter")
    for keys in ({"m": 1}, {"n": 2}, {"hold_s": 9.0}, {"forget_s": 0.5}):
        assert by_target(run(scene(**keys)), "filter") != default, keys


def test_more_than_there_are_is_refused():
    with pytest.raises(SceneError, match=r"m = 5: it must be at most n, 4"):
        dsa_des.load_scene(scene(m=5))


def test_each_run_has_its_own_last_levels():
    """Windows that hold instants of two runs with other levels, as runs in lock step give them."""
    random = np.random.default_rng(7)
    raw = random.integers(0, 4, size=(2, 12))
    block = object.__new__(MOfNAlerts)
    block.p = MOfNParameters(hold_s=1.5)
    block.setup()
    shown = [[], []]
    for window in np.split(np.arange(12), 4):
        tick, run = np.tile(window, 2), np.repeat([0, 1], len(window))
        alerts = AlertLevels(
            tick=tick, run=run, offsets=np.arange(len(tick) + 1), target=np.zeros(len(tick), int),
            level=raw[:, window].ravel(), times={}, time_to_closest_s=np.zeros(len(tick)),
            closest_horizontal_m=np.zeros(len(tick)), closest_vertical_m=np.zeros(len(tick)),
            numbers={}, deviations={}, relative={}, own_motion={}, roster=None,
        )  # fmt: skip
        held = {"alerts": (alerts, np.arange(len(tick)))}
        found = block.run(Wake(RunTicks(run, tick), np.full(len(tick), -1), 1, held, {}))
        for number in (0, 1):
            shown[number] += found.level[run == number].tolist()
    alone = [
        [level for _, level in plain(list(enumerate(levels)), 2, 4, 1.5, 5.0)]
        for levels in raw.tolist()
    ]
    assert shown == alone and alone[0] != alone[1]
