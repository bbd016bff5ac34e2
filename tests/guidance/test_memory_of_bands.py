"""Bands and resolutions over time: by hand on made-up lines, and as the reference recorded them."""

import csv
import math

import numpy as np
import pytest

from components.alert_configuration.conf_file import default_values_and_units, read_conf
from components.alerting.alert_tables import TABLE_UNITS, remove_hysteresis
from components.alerting.encounter import read_encounter
from components.alerting.levels import AlertPairs, alert_levels
from components.guidance.bands import Resolution, guidance_of_many
from components.guidance.intervals import Band
from components.guidance.memory import BandMemory, GuidanceMemory, ResolutionMemory
from components.guidance.recovery import Recovery
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from tests.alerting.reference_data import reference_file

VALUES = {
    **default_values_and_units()[0], "hysteresis_time": 5.0, "persistence_time": 3.0,
    "alerting_m": 2,
    "alerting_n": 3, "bands_persistence": False, "persistence_preferred_vs": 2.0,
    "corrective_region": "MID",
}  # fmt: skip
FREE = [Band(-10.0, 10.0, "NONE")]
OUT = Recovery(4.0, (900.0, 100.0), 2)


def red(low, high, region="MID"):
    return [Band(-10.0, low, "NONE"), Band(low, high, region), Band(high, 10.0, "NONE")]


def shown(memory, *lines, own=0.0, start=0.0, recovery=None):
    return [
        memory.step(start + number, line, own, recovery) for number, line in enumerate(lines)
    ]  # fmt: skip


def test_two_of_three_lines_make_a_band():
    """The first line counts at once; later ones when they are the second of the last three."""
    memory = BandMemory(VALUES, cyclic=False)
    found = shown(memory, FREE, red(2, 5), red(2, 5), FREE, FREE)
    assert found == [FREE, FREE, red(2, 5), red(2, 5), FREE]
    assert shown(BandMemory(VALUES, cyclic=False), red(2, 5), FREE)[0] == red(2, 5)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ({"alerting_m": 3, "alerting_n": 3}, [FREE, FREE, FREE, red(2, 5)]),
        ({"alerting_m": 1, "alerting_n": 3}, [FREE, red(2, 5), red(2, 5), red(2, 5)]),
        # No rule, or one that cannot be: each line counts.
        ({"alerting_m": 0}, [FREE, red(2, 5), red(2, 5), red(2, 5)]),
        ({"alerting_m": 4}, [FREE, red(2, 5), red(2, 5), red(2, 5)]),
        ({"hysteresis_time": 0.0}, [FREE, red(2, 5), red(2, 5), red(2, 5)]),
    ],
)
def test_so_many_of_the_last_lines_make_a_band(values, wanted):
    memory = BandMemory({**VALUES, **values}, cyclic=False)
    assert shown(memory, FREE, red(2, 5), red(2, 5), red(2, 5)) == wanted


@pytest.mark.parametrize(
    ("values", "stays"),
    [({}, True), ({"persistence_time": 0.0}, False), ({"bands_persistence": False}, False),
     ({"hysteresis_time": 0.0}, False)],
)  # fmt: skip
def test_a_band_persists_where_all_three_keys_say_so(values, stays):
    asked = {**VALUES, "alerting_m": 0, "bands_persistence": True, **values}
    found = shown(BandMemory(asked, cyclic=False), red(-2, 5), FREE)
    assert found == [red(-2, 5), red(-2, 5) if stays else FREE]


def test_lines_are_remembered_up_to_the_time_itself():
    for later_s, wanted in ((5.0, FREE), (5.1, red(2, 5)), (-1.0, red(2, 5))):
        memory = BandMemory(VALUES, cyclic=False)
        memory.step(10.0, FREE, 0.0, None)
        assert memory.step(10.0 + later_s, red(2, 5), 0.0, None) == wanted


def test_a_way_out_counts_where_there_is_time_for_one():
    line = [Band(-10.0, 4.0, "NEAR"), Band(4.0, 10.0, "NONE")]
    for time_s, region in ((4.0, "RECOVERY"), (0.0, "RECOVERY"), (-1.0, "NONE")):
        memory = BandMemory({**VALUES, "alerting_m": 1}, cyclic=False)
        found = memory.step(0.0, line, 0.0, OUT._replace(time_s=time_s))
        assert found == [line[0], Band(4.0, 10.0, region)]


def test_overlapping_lines_count_place_by_place():
    memory = BandMemory(VALUES, cyclic=False)
    found = shown(memory, FREE, red(1, 5), red(3, 7, "NEAR"))
    assert found[-1] == red(3, 5)  # MID and NEAR there: the second largest is MID


def test_a_pause_forgets_the_lines():
    memory = BandMemory(VALUES, cyclic=False)
    assert memory.step(0.0, red(2, 5), 0.0, None) == red(2, 5)
    assert memory.step(5.1, FREE, 0.0, None) == FREE
    assert memory.step(5.1, red(2, 5), 0.0, None) == red(2, 5)  # time stands still


def test_what_is_remembered_as_recovery_is_free_when_none_is_needed():
    memory = BandMemory({**VALUES, "alerting_m": 1}, cyclic=False)
    way = [Band(-10.0, 4.0, "NEAR"), Band(4.0, 10.0, "RECOVERY")]
    assert memory.step(0.0, way, 0.0, OUT) == way
    assert memory.step(1.0, red(-10, 4, "NEAR")[1:], 0.0, None)[-1] == Band(4.0, 10.0, "NONE")


def test_a_band_around_the_own_value_persists():
    """For 3 s after it rose; the band that is not around the own value goes at once."""
    values = {**VALUES, "alerting_m": 0, "bands_persistence": True}
    memory = BandMemory(values, cyclic=False)
    found = shown(memory, red(-2, 5), FREE, FREE, FREE)
    assert found == [red(-2, 5)] * 3 + [FREE]
    assert shown(BandMemory(values, cyclic=False), red(2, 5), FREE)[1] == FREE


def test_a_band_of_directions_persists_across_north():
    values = {**VALUES, "alerting_m": 0, "bands_persistence": True}
    turn = 2 * math.pi
    line = [Band(0.0, 0.5, "MID"), Band(0.5, 6.0, "NONE"), Band(6.0, turn, "MID")]
    found = shown(BandMemory(values, cyclic=True), line, [Band(0.0, turn, "NONE")], own=6.2)
    assert found == [line, line]


def test_a_way_out_is_kept_while_it_is_near_or_young():
    memory = ResolutionMemory(VALUES, "vs")

    def step(now_s, low, high, line=None):
        found = Resolution(low, high, high <= -low)
        return memory.step(now_s, found, line or red(low, high), 0.0, None)

    assert step(0.0, -4.0, 6.0)[:2] == (-4.0, 6.0)
    assert step(1.0, -2.0, 5.0)[:2] == (-4.0, 6.0)  # nearer ways, but the old ones are young
    assert step(2.0, -5.0, 5.0)[:2] == (-5.0, 6.0)  # the old way down has become red
    assert step(3.5, -3.5, 3.0)[:2] == (-5.0, 3.0)  # the way up is old, and 3 away
    assert step(6.0, -3.5, 3.0)[:2] == (-5.0, 3.0)  # old too, but within 2


def test_the_preferred_side_changes_late():
    memory = ResolutionMemory({**VALUES, "persistence_preferred_vs": 0.5}, "vs")
    sides = []
    for now_s, low, high in [(0, -4, 3), (2, -4, 5), (4, -4, 5)]:
        found = Resolution(float(low), float(high), high <= -low)
        sides.append(memory.step(float(now_s), found, red(low, high), 0.0, None).prefers_high)
    assert sides == [True, True, False]


def test_a_side_without_a_way_is_not_preferred():
    memory = ResolutionMemory(VALUES, "vs")
    nan, sides = math.nan, []
    ways = [(-4, 3), (-4, nan), (nan, 3), (-4, nan), (nan, nan), (-4, 3), (-3, 4)]
    for now_s, (low, high) in enumerate(ways):
        found = Resolution(float(low), float(high), False)
        sides.append(memory.step(float(now_s), found, red(-4, 3), 0.0, None).prefers_high)
    assert sides == [True, False, True, False, False, True, True]


@pytest.mark.parametrize(
    ("recovery", "wanted"),
    # The way up was found with a larger cylinder: it stays, and stays preferred.
    [(None, (-1.0, 3.0, False)), (OUT, (-1.0, 5.0, True))],
)
def test_what_a_smaller_cylinder_gave_is_not_preferred(recovery, wanted):
    """After 3.5 s the way down is nearer by the 2 m/s that count."""
    memory = ResolutionMemory(VALUES, "vs")
    bands = [Band(-10.0, -5.0, "NONE"), Band(-5.0, -3.0, "MID"), Band(-3.0, -1.0, "NONE"),
             Band(-1.0, 3.0, "MID"), Band(3.0, 10.0, "NONE")]  # fmt: skip
    first = memory.step(0.0, Resolution(-6.0, 5.0, True), red(-6, 5), 0.0, None)
    assert first == (-6.0, 5.0, True)
    later = memory.step(3.5, Resolution(-1.0, 3.0, False), bands, 0.0, recovery)
    assert later == wanted


@pytest.fixture(scope="module")
def flown():
    configuration = read_conf(reference_file("alerting/do365b.conf"))
    path = reference_file("nrc_intercepts/NRC_Intercept3.daa")
    return configuration, read_encounter(path, configuration)


def remembered(flown, rows):
    """What is shown by (time, kind), of a run over some rows from an empty memory."""
    configuration, encounter = flown
    relative = [part[rows] for part in encounter.relative]
    times, present = encounter.time_s[rows], encounter.present[rows]
    alerts = alert_levels(configuration, times, present, AlertPairs(relative))
    zero = np.zeros(len(rows))
    own = State(zero, zero, *encounter.own_state[:, rows])
    other = State(*(mine - part[:, 0] for mine, part in zip(own, relative, strict=True)))
    intruder = GuidedIntruders(
        other, configuration.alerters[0], alerts.early_level[:, 0], present[:, 0]
    )
    found = {}
    for kind in TABLE_UNITS:
        memory = GuidanceMemory(configuration, kind)
        guided = guidance_of_many(kind, configuration, own, [intruder])
        for now_s, one in zip(times.tolist(), guided, strict=True):
            found[round(now_s, 3), kind] = memory.step(now_s, one)
    return found


def table(name):
    with reference_file(f"alerting/{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("name", "rows", "count"),
    [
        ("_rows290-359", range(290, 360), 280),
        ("_rows1375-1434", range(1375, 1435), 240),
        ("_hysteresis", range(1484), 240),
    ],
)
def test_remembered_bands_and_resolutions(flown, name, rows, count):
    found = remembered(flown, np.array(rows))
    wanted = {}
    for line in table(f"NRC_Intercept3{name}_bands"):
        key = round(float(line["time_s"]), 3), line["kind"]
        wanted.setdefault(key, []).append((line["region"], float(line["low"]), float(line["up"])))
    assert len(wanted) == count
    other_lists = other_ways = 0
    for key, lines in wanted.items():
        unit = TABLE_UNITS[key[1]]
        got = [(b.region, b.low / unit, b.high / unit) for b in found[key].bands]
        alike = [g[0] for g in got] == [w[0] for w in lines] and np.allclose(
            [g[1:] for g in got], [w[1:] for w in lines], rtol=0, atol=1e-8
        )
        other_lists += not alike
    for line in table(f"NRC_Intercept3{name}_info"):
        key = round(float(line["time_s"]), 3), line["kind"]
        way, unit = found[key].resolution, TABLE_UNITS[line["kind"]]
        if not line["resolution_low"]:
            other_ways += way is not None
            continue
        want = [float(line[f"resolution_{side}"]) for side in ("low", "up")]
        got = [way.low / unit, way.high / unit] if way else [math.nan, math.nan]
        same_side = way is not None and str(way.prefers_high).lower() == line["preferred_up"]
        other_ways += not (same_side and np.allclose(got, want, rtol=0, atol=1e-8))
    assert (other_lists, other_ways) == (0, 0)


def test_without_hysteresis_nothing_is_remembered(flown):
    values = remove_hysteresis(read_conf(reference_file("alerting/do365b.conf")))
    memory = BandMemory(values, cyclic=False)
    assert shown(memory, red(-2, 5), FREE, own=0.0) == [red(-2, 5), FREE]
