"""The memory of alert levels, against the rules told one target at a time."""

from collections import deque

import numpy as np
import pytest

from components.alerting.memory import AlertMemory, MemoryRule


class Remembering:
    """The memory of some targets, step by step."""

    def __init__(self, rule, count):
        self.rule, targets = rule, np.arange(count)
        self.memory = AlertMemory.new(rule, 0 * targets, targets)

    def step(self, *now):
        self.memory, level = self.memory.next_memory_and_levels(self.rule, *now)
        return level

    def early_levels(self, now_s, present):
        return self.memory.early_levels_for_guidance(self.rule, now_s, present)


def levels(rule, raw, times=None):
    """Return what one target's raw levels (1 to 3) become, without early times."""
    memory = Remembering(rule, 1)
    found = []
    for number, level in enumerate(raw):
        due = np.array([[level == k for k in (1, 2, 3)]])
        now_s = float(number) if times is None else times[number]
        found += memory.step(now_s, np.array([True]), due, due).tolist()
    return found


def test_two_of_four_and_four_seconds():
    rule = MemoryRule(5.0, 4.0, 2, 4)
    assert levels(rule, [0, 0, 2, 2, 0, 0, 0, 0, 0]) == [0, 0, 0, 2, 2, 2, 2, 0, 0]


def test_a_first_level_comes_out_at_once():
    assert levels(MemoryRule(5.0, 4.0, 2, 4), [3]) == [3]


def test_without_memory_every_level_stands_alone():
    raw = [0, 3, 1, 0, 2, 2, 0, 1]
    assert levels(MemoryRule(0.0, 0.0, 0, 0), raw) == raw
    assert levels(MemoryRule(0.0, 4.0, 2, 4), raw) == raw  # no hysteresis, no memory at all


@pytest.mark.parametrize("gap_s", [5.0, 5.1])
def test_a_gap_longer_than_hysteresis_forgets(gap_s):
    times = [0.0, 1.0, 1.0 + gap_s, 2.0 + gap_s]
    found = levels(MemoryRule(5.0, 1.5, 2, 3), [0, 0, 2, 2], times)
    assert found == ([0, 0, 0, 2] if gap_s == 5.0 else [0, 0, 2, 2])


def test_time_that_goes_back_forgets():
    assert levels(MemoryRule(5.0, 4.0, 2, 4), [0, 0, 3], [0.0, 1.0, 0.5])[-1] == 3


def test_the_level_that_is_on_takes_its_early_time():
    """Level 2 is due early only: it stays on where it was out, and does not come on by itself."""
    memory = Remembering(MemoryRule(5.0, 0.0, 0, 0), 2)
    here = np.array([True, True])
    none = np.zeros((2, 3), dtype=bool)
    second = np.array([[False, True, False], [False, False, False]])
    early = np.array([[False, True, False], [False, True, False]])
    assert memory.step(0.0, here, second, early).tolist() == [2, 0]
    assert memory.step(1.0, here, none, early).tolist() == [2, 0]
    assert memory.step(2.0, here, none, none).tolist() == [0, 0]
    assert memory.step(3.0, here, none, early).tolist() == [0, 0]


def test_early_times_count_for_the_level_that_came_on_before_and_for_no_other():
    memory = Remembering(MemoryRule(5.0, 0.0, 0, 0), 3)
    due = np.array([[True, True, False], [False, False, False], [False, False, True]])
    here, none = np.array([True, True, False]), np.zeros((3, 3), dtype=bool)
    memory.step(0.0, here, due, due)
    assert memory.early_levels(0.0, here).tolist() == [0, 0, 0]
    assert memory.step(1.0, here, due, due)[:2].tolist() == [2, 0]
    assert memory.early_levels(1.0, here).tolist() == [2, 0, 0]
    memory.step(2.0, here, none, none)
    assert memory.early_levels(2.0, here).tolist() == [0, 0, 0]


def told(rule, raw, times):
    """Follow the rules for one target, in words; None where it is absent."""
    last_s = rise_s = own_s = None
    output, queue, found = -1, deque(), []
    for now_s, level in zip(times, raw, strict=True):
        if own_s is None or now_s < own_s or now_s - own_s > rule.hysteresis_s:
            last_s = rise_s = None
            output = -1
        own_s = now_s
        if level is None:
            found.append(None)
            continue
        if last_s is None or now_s <= last_s or now_s - last_s > rule.hysteresis_s:
            queue = deque([level] * rule.m + [-1] * (rule.n - rule.m))
            rise_s, output = None, -1
        if rule.m:
            queue.popleft()
            queue.append(level)
        risen = sorted(queue)[-rule.m] if rule.m else level
        kept = rise_s is not None and 0 <= now_s - rise_s < rule.persistence_s
        if not (output > 0 and risen < output and kept):
            if risen > 0 and risen > output:
                rise_s = now_s
            output = max(0, risen)
        last_s = now_s
        found.append(output)
    return found


@pytest.mark.parametrize(
    "rule",
    [
        MemoryRule(3.0, 4.0, 2, 4),
        MemoryRule(1.5, 2.0, 3, 3),
        MemoryRule(6.0, 0.0, 1, 5),
        MemoryRule(4.0, 7.0, 0, 0),
    ],
)
def test_many_targets_at_once_are_as_each_one_told(rule):
    draw = np.random.default_rng(17)
    count, steps = 40, 60
    times = np.cumsum(draw.choice([0.5, 1.0, 2.0, 5.0], steps, p=[0.4, 0.4, 0.15, 0.05]))
    raw = np.repeat(draw.integers(0, 4, (steps // 2, count)), 2, axis=0)
    present = draw.random((steps, count)) < 0.85
    memory = Remembering(rule, count)
    found = []
    for now_s, row, here in zip(times.tolist(), raw, present, strict=True):
        due = row[:, np.newaxis] == np.arange(1, 4)
        found.append(memory.step(now_s, here, due, due))
    for target in range(count):
        mine = [
            int(v) if p else None for v, p in zip(raw[:, target], present[:, target], strict=True)
        ]
        want = told(rule, mine, times.tolist())
        got = [
            int(f[target]) if p else None for f, p in zip(found, present[:, target], strict=True)
        ]
        assert got == want
