"""The simulated fused share of two sensors against exact rational counts."""

import math
from bisect import bisect_left
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from components.metrics.fused_share import coincidence_share
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.replicas import run_replicas
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.studies.metric import Group, needed_columns
from dsa_des.studies.study import MetricSpec

PAIRS = [
    # rates (Hz), offsets (s), gate (s) of sensors a and b
    ("5", "2", "0", "0", "0"),
    ("5", "2", "0", "1/20", "0"),
    ("10", "30", "0", "0", "0"),
    ("10", "30", "1/60", "0", "0"),
    ("30", "25", "0", "0", "1/200"),
    ("5", "2", "0", "3/100", "1/25"),
    ("5", "3", "0", "0", "1/30"),
    ("5", "3", "1/30", "0", "1/15"),
    ("7", "3", "0", "1/42", "1/42"),
    ("7", "3", "0", "1/42", "1/50"),
    ("20", "2", "1/20", "1/10", "0"),
    ("30000/1001", "30", "0", "0", "1/1000"),
    ("30000/1001", "10", "0", "0", "1/300"),
    ("1", "1", "0", "1/2", "1/2"),
    ("1", "1", "0", "1/2", "49/100"),
    ("4", "6", "0", "1/24", "1/24"),
    ("9", "4", "0", "0", "1/36"),
    ("9", "4", "1/72", "0", "1/72"),
    ("8", "3", "0", "1/7", "1/100"),
    ("2", "5", "0", "1/10", "1/10"),
]


def partners(own: list[Fraction], other: list[Fraction], before: Fraction, after: Fraction) -> int:
    """Count instants that have one of the others near them, one by one, in whole numbers."""
    unit = math.lcm(*(t.denominator for t in (*own, *other, before, after)))
    early, late = int(before * unit), int(after * unit)
    theirs = sorted(int(t * unit) for t in other)
    count = 0
    for t in (int(t * unit) for t in own):
        place = bisect_left(theirs, t - early)
        count += place < len(theirs) and theirs[place] <= t + late
    return count


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: " ".join(pair))
def test_simulation_and_rational_counts_agree(pair: tuple[str, ...], small: Path) -> None:
    f1, f2, o1, o2, gate = map(Fraction, pair)
    beat = Fraction(math.lcm(f1.denominator, f2.denominator), math.gcd(f1.numerator, f2.numerator))
    whole = beat <= 3  # the beat of 30 Hz and 29.97 Hz is half a minute
    duration = (2 * beat if whole else Fraction(6)) + max(o1, o2) + 1 / min(f1, f2)
    scene = scene_of_pair(pair, duration)
    metric = MetricSpec("fused_share").build(scene)
    recorded = run_replicas(scene, [Replica(1)], wanted=needed_columns([metric]))
    group = Group(scene, [Replica(1)], recorded, needed_columns([metric]))  # type: ignore[arg-type]
    found = metric.measure(group)
    expected = metric.analytic_answers(scene)
    ours, theirs = (_scans(f, o, duration) for f, o in ((f1, o1), (f2, o2)))
    for name, own, other, rate in (
        ("radar_with_ir", ours, theirs, f1),
        ("ir_with_radar", theirs, ours, f2),
    ):
        step = Fraction(1, 2 * scene.ticks_per_s)
        after = min(gate, 1 / rate - step)
        count = partners(own, other, gate, after)
        key = f"fused_share.{name}"
        assert found[f"{key}.trials"][0] == len(own)
        assert found[key][0] == pytest.approx(count / len(own), abs=1e-12)  # exact, edges and all
        if whole:  # in the long run; scans at both ends of the run may lack their partner
            assert abs(expected[key] - count / len(own)) <= 3 / len(own)


def scene_of_pair(pair: tuple[str, ...], duration: Fraction) -> Scene:
    f1, f2, o1, o2, gate = pair
    text = Path("small.toml").read_text().replace("duration_s = 6", f'duration_s = "{duration}"')
    text = text.replace("scan_rate_hz = 5\n", f'scan_rate_hz = "{f1}"\noffset_s = "{o1}"\n')
    text = text.replace("scan_rate_hz = 2\n", f'scan_rate_hz = "{f2}"\noffset_s = "{o2}"\n')
    text = text.replace('"fusion.pick_best"', f'"fusion.pick_best"\ncoincidence_s = "{gate}"')
    text = text.replace("fragile:Fragile", "radar.range_boundary").replace("reach_km", "range_km")
    text = text.replace("4.8", "9").replace("speed_mps = 60", "speed_mps = 50").replace("180", "0")
    Path("pair.toml").write_text(text)
    return load_scene("pair.toml")


def _scans(rate: Fraction, offset: Fraction, duration: Fraction) -> list[Fraction]:
    return [offset + k / rate for k in range(math.ceil((duration - offset) * rate))]


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: " ".join(pair))
def test_the_formula_counts_a_whole_beat(pair: tuple[str, ...]) -> None:
    f1, f2, o1, o2, gate = map(Fraction, pair)
    beat = Fraction(math.lcm(f1.denominator, f2.denominator), math.gcd(f1.numerator, f2.numerator))
    own = [o2 + k / f2 for k in range(int(beat * f2))]
    reach = math.ceil(gate * f1) + math.ceil(abs(o1 - o2) * f1) + 2
    other = [o1 + k / f1 for k in range(-reach, int(beat * f1) + reach)]
    for before, after in ((gate, gate), (gate, Fraction(0)), (Fraction(0), gate)):
        share = coincidence_share(
            f2, f1, offset_s=o2, other_offset_s=o1, before_s=before, after_s=after
        )
        assert share == Fraction(partners(own, other, before, after), len(own))


def test_beats_of_clocks_that_begin_apart_are_counted() -> None:
    for pair in (("5", "3", "1/30", "0", "1/15"), ("7", "3", "0", "1/42", "1/50"),
                 ("20", "2", "1/20", "1/10", "0"), ("5", "2", "0", "3/100", "1/25")):  # fmt: skip
        test_the_formula_counts_a_whole_beat(pair)


def test_a_scan_waits_for_a_partner_no_longer_than_to_the_next(small: Path) -> None:
    """Of ten scans that with the other sensor's and the one after; not the one before."""
    metric = MetricSpec("fused_share").build(scene := scene_of_pair(
        ("10", "1", "0", "0", "1/10"), Fraction(6)
    ))  # fmt: skip
    assert metric.analytic_answers(scene) == {
        "fused_share.radar_with_ir": 0.2, "fused_share.ir_with_radar": 1.0
    }  # fmt: skip


def test_the_thesis_case() -> None:
    # 5 Hz and 2 Hz meet once a second: every second scan of the slower sensor (section 4.5).
    assert coincidence_share(Fraction(2), Fraction(5)) == Fraction(1, 2)
    assert coincidence_share(Fraction(5), Fraction(2)) == Fraction(1, 5)


def test_random_phases_average_to_twice_the_gate() -> None:
    gate, f1, f2 = Fraction(1, 30), Fraction(5), Fraction(3)
    shares = [
        coincidence_share(f2, f1, offset_s=Fraction(k, 1000), before_s=gate, after_s=gate)
        for k in range(1000)
    ]
    assert float(np.mean([float(s) for s in shares])) == pytest.approx(float(2 * gate * f1), 0.01)


def with_late_radar(scene_file: str, delay_s: str) -> Scene:
    text = Path(scene_file).read_text()
    late = f'{{ from = "radar", to = "fusion", delay_s = {delay_s} }}'
    assert '"radar -> fusion"' in text
    Path("late.toml").write_text(text.replace('"radar -> fusion"', late))
    return load_scene("late.toml")


def shares_of(scene: Scene) -> dict[str, float]:
    metric = MetricSpec("fused_share").build(scene)
    recorded = run_replicas(scene, [Replica(1)], wanted=needed_columns([metric]))
    group = Group(scene, [Replica(1)], recorded, needed_columns([metric]))  # type: ignore[arg-type]
    return {name: float(values[0]) for name, values in metric.measure(group).items()}


def test_a_fused_row_rests_on_what_had_arrived_by_then(small: Path) -> None:
    """The radar sees at 0, 1 and 2 s and is heard 0.6 s later, each time just as the IR sees."""
    scene_of_pair(("1", "1", "0", "3/5", "0"), Fraction(3))
    found = shares_of(with_late_radar("pair.toml", "0.6"))
    for name in ("fused_share.radar_with_ir", "fused_share.ir_with_radar"):
        assert (found[name], found[f"{name}.trials"]) == (1.0, 3.0)
