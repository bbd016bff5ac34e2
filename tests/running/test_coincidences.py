"""Which scans of two sensors meet, over hours, and what a fusion with a gate puts together."""

import itertools
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.fusion.pick_best import PickBest, PickBestParameters
from components.messages.detections import Detections, SensorOffer
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.block.component import Context, Producer
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.time.randomness import Streams

BOTH = """
duration_s = {duration_s}
wires = [
  "traffic -> transform -> gate",
  "gate -> radar -> fusion",
  "gate -> ir -> fusion",
  "fusion -> tracker",
]

[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = 52.0, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, speed_mps = 0 }}

[[blocks.traffic.intruders]]
name = "hovering"
extends = "{configs}/aircraft/small_fighter.toml"
east_m = 10
north_m = 900
up_m = 5
heading_deg = 90
speed_mps = 0

[blocks.transform]
type = "geometry.ellipsoid"
[blocks.gate]
type = "gate"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = {radar}
range_km = 10
[blocks.ir]
type = "radar.range_boundary"
scan_rate_hz = {ir}
offset_s = {offset_s}
range_km = 10
[blocks.fusion]
type = "fusion.pick_best"
coincidence_s = {coincidence_s}
[blocks.tracker]
type = "tracking.stub"
"""


def combinations(lab, radar, ir, duration_s, *, offset_s="0", coincidence_s="0", **options):
    path = lab.folder / "scene.toml"
    path.write_text(
        BOTH.format(
            configs=lab.configs,
            duration_s=duration_s,
            radar=radar,
            ir=ir,
            offset_s=offset_s,
            coincidence_s=coincidence_s,
        ),
        encoding="utf-8",
    )
    run = lab.run(path, **options)
    return Counter(run.tables["fused"].column("sensors").to_pylist())


def test_every_second_ir_scan_meets_a_radar_scan_over_ten_hours(lab):
    counts = combinations(lab, 5, 2, 36_000)
    assert counts == {"ir+radar": 36_000, "ir": 36_000, "radar": 180_000 - 36_000}


def test_all_scans_at_10_hz_meet_one_at_30_hz(lab):
    counts = combinations(lab, 10, 30, 600)
    assert counts == {"ir+radar": 6_000, "ir": 12_000}


def test_television_rate_and_25_hz(lab):
    # 30000/1001 and 25 Hz meet every 1001/25 = 40.04 s: at 0, 40.04 and 80.08 s.
    counts = combinations(lab, '"30000/1001"', 25, 100)
    assert counts["ir+radar"] == 3
    assert counts["ir"] == 2500 - 3
    assert counts["radar"] == -(-100 * 30000 // 1001) - 3


def test_an_offset_keeps_clocks_apart_for_ever(lab):
    assert "ir+radar" not in combinations(lab, 5, 5, 600, offset_s="1e-9")


@pytest.mark.parametrize("window", [1, 7])
def test_coincidences_do_not_depend_on_the_window(lab, window):
    options = {"offset_s": "0.03", "coincidence_s": '"1/30"'}
    whole = combinations(lab, 7, 3, 20, **options)
    assert combinations(lab, 7, 3, 20, window=window, **options) == whole


def fuse(clocks, gate_ticks, hits, cuts):
    """Run the fusion over windows; return {(tick, target): contributing sensors}."""
    names = [f"s{i}" for i in range(len(clocks))]
    context = Context(Streams(0), 1)
    context.producers = [Producer(n, "detections", SensorOffer(n == "s0", 0.0)) for n in names]
    fusion = PickBest("fusion", PickBestParameters(coincidence_s=gate_ticks), context)
    fusion.setup()
    found = {}
    for start, end in itertools.pairwise(cuts):
        arrivals = []
        for name, ticks in zip(names, clocks, strict=True):
            inside = np.array([t for t in ticks if start <= t < end], dtype=np.int64)
            if len(inside):
                seen = detections(name, inside, hits)
                arrivals.append(Arrivals(name, seen.instants, seen))
        if not arrivals:
            continue
        instants = np.unique(np.concatenate([new.tick for new in arrivals]))
        wake = Wake(
            RunTicks.of_run(0, instants),
            np.full(len(instants), -1),
            1,
            {},
            {"detections": arrivals},
        )
        message = fusion.run(wake)
        rows = np.repeat(message.tick, np.diff(message.offsets))
        for i, (tick, target) in enumerate(zip(rows, message.target, strict=True)):
            bits = int(message.contributors[i])
            who = {name: bits >> k & 1 for k, name in enumerate(message.sensors)}
            found[int(tick), int(target)] = (
                sorted(name for name in names if who[name]),
                float(message.range_m[i]),
            )
    return found


def detections(name, ticks, hits):
    entries = [[t for t in range(3) if (name, int(tick), t) in hits] for tick in ticks]
    counts = [len(entry) for entry in entries]
    target = np.array([t for entry in entries for t in entry], dtype=np.int64)
    # The range tells which look it came from.
    value = np.repeat(ticks, counts) + target / 10
    nan = np.full(len(target), np.nan)
    return Detections(
        tick=ticks,
        scan=np.arange(len(ticks)),
        evaluated=np.full(len(ticks), 3),
        skipped={},
        offsets=np.concatenate(([0], np.cumsum(counts))),
        target=target,
        azimuth_rad=value,
        elevation_rad=value,
        range_m=value if name == "s0" else nan,
        confidence=value,
        true_azimuth_rad=value,
        true_elevation_rad=value,
        true_range_m=value,
        extras={},
        roster=_Three(),
    )


class _Three:
    """A roster of three, as far as fusion looks at it."""

    names = ("a", "b", "c")

    def __len__(self):
        return 3


def fuse_slowly(clocks, gate_ticks, hits):
    """The same in plain Python: for each look, who saw the target at most a gate ago."""
    found = {}
    for i, ticks in enumerate(clocks):
        for tick in ticks:
            for target in range(3):
                if (f"s{i}", tick, target) not in hits:
                    continue
                who, range_m = [], float("nan")
                for j, others in enumerate(clocks):
                    seen = [
                        t
                        for t in others
                        if tick - gate_ticks <= t <= tick and (f"s{j}", t, target) in hits
                    ]
                    if seen:
                        who.append(f"s{j}")
                        if j == 0:
                            range_m = seen[-1] + target / 10
                found[tick, target] = (who, range_m)
    return found


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    periods=st.lists(st.integers(1, 9), min_size=1, max_size=3),
    offsets=st.lists(st.integers(0, 7), min_size=3, max_size=3),
    gate_ticks=st.integers(0, 12),
    cuts=st.lists(st.integers(1, 39), max_size=4),
    chance=st.floats(0.2, 1.0),
    seed=st.integers(0, 999),
)
def test_gated_fusion_equals_a_slow_search(periods, offsets, gate_ticks, cuts, chance, seed):
    clocks = [list(range(o, 40, p)) for o, p in zip(offsets, periods, strict=False)]
    random = np.random.default_rng(seed)
    hits = {
        (f"s{i}", tick, target)
        for i, ticks in enumerate(clocks)
        for tick in ticks
        for target in range(3)
        if random.random() < chance
    }
    expected = fuse_slowly(clocks, gate_ticks, hits)
    for windows in ([0, 40], [0, *sorted(set(cuts)), 40], list(range(41))):
        found = fuse(clocks, gate_ticks, hits, windows)
        assert found.keys() == expected.keys()
        for key, (who, range_m) in expected.items():
            assert found[key][0] == who
            assert found[key][1] == pytest.approx(range_m, nan_ok=True)
