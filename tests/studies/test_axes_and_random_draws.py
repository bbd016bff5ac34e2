"""Axes say which values a study takes, draws are functions of (seed, key, replica)."""

from fractions import Fraction
from pathlib import Path
from statistics import NormalDist, mean, stdev

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies.axes import beat_period_s, flatten_axes, parse_axis
from dsa_des.studies.draws import parse_draw, replica_seed, round_for_exact_clock
from dsa_des.studies.study_digest import record_of
from dsa_des.studies.study_file import read_study


def test_ranges_lists_and_logarithmic_ranges(configs: Path) -> None:
    scene = load_scene(configs / "first_light.toml")
    tables = {
        "blocks": {"radar": {"scan_rate_hz": [0.5, 1, 2]}},
        "blocks.ir.offset_s": {"from": 0, "to": 0.3, "step": 0.1},
        "blocks.radar.range_km": {"from": 1, "to": 100, "steps": 3, "log": True},
        "swap": {"transform": ["geometry.flat_earth", "geometry.ellipsoid"]},
        "blocks.eo.scan_rate_hz": ["30000/1001"],
    }
    axes = {key: parse_axis(key, spec, scene) for key, spec in flatten_axes(tables).items()}
    assert axes["blocks.radar.scan_rate_hz"].labels == (0.5, 1, 2)
    assert axes["blocks.ir.offset_s"].labels == (0, 0.1, 0.2, 0.3)  # no 0.30000000000000004
    assert axes["blocks.radar.range_km"].labels == (1, 10.0, 100)
    assert axes["swap.transform"].swaps[0] == (("transform", "geometry.flat_earth"),)
    assert axes["blocks.eo.scan_rate_hz"].labels == (30000 / 1001,)
    assert axes["blocks.eo.scan_rate_hz"].sets[0][0][1] == "30000/1001"


def test_a_phase_axis_covers_one_beat(configs: Path) -> None:
    scene = load_scene(configs / "first_light.toml")  # radar 5 Hz, ir 2 Hz
    axis = parse_axis("blocks.ir.offset_s", {"beat_with": "radar", "steps": 4}, scene)
    assert axis.labels == (0, 0.25, 0.5, 0.75)


@settings(derandomize=True, max_examples=60)
@given(st.fractions(Fraction(1, 50), 50), st.fractions(Fraction(1, 50), 50))
def test_after_a_beat_both_clocks_are_in_step_again(one: Fraction, other: Fraction) -> None:
    beat = beat_period_s(one, other)
    assert (beat / one).denominator == 1 and (beat / other).denominator == 1
    counts = int(beat / one), int(beat / other)
    from math import gcd

    assert gcd(*counts) == 1  # and not earlier


def test_files_are_found_and_named(tmp_path: Path, configs: Path) -> None:
    scene = load_scene(configs / "replay_daa.toml")
    for name in ("b.daa", "a.daa", "c.txt"):
        (tmp_path / name).touch()
    axis = parse_axis("blocks.traffic.file", {"files": f"{tmp_path}/*.daa"}, scene)
    assert axis.labels == ("a.daa", "b.daa") and axis.files
    assert axis.sets[0][0][1] == str(tmp_path / "a.daa")


def test_draws_have_their_distributions() -> None:
    count = 2000
    uniform = parse_draw("blocks.a.x_m", {"uniform": [2, 4]})
    values = [float(uniform.value(1, k, count)) for k in range(count)]
    assert 2 <= min(values) < 2.01 and 3.99 < max(values) < 4
    normal = parse_draw("blocks.a.x_m", {"normal": [10, 3]})
    values = [float(normal.value(1, k, count)) for k in range(count)]
    assert mean(values) == pytest.approx(10, abs=0.25)
    assert stdev(values) == pytest.approx(3, rel=0.06)
    inside = sum(abs(v - 10) < 3 for v in values) / count
    assert inside == pytest.approx(2 * NormalDist().cdf(1) - 1, abs=0.04)
    choice = parse_draw("blocks.a.kind", {"choice": ["x", "y", "z"]})
    chosen = [choice.value(1, k, count) for k in range(count)]
    assert all(abs(chosen.count(v) - count / 3) < 100 for v in "xyz")


def test_a_latin_hypercube_has_one_draw_in_every_stratum() -> None:
    draw = parse_draw("blocks.a.x_m", {"latin_hypercube": [0, 50]})
    values = [float(draw.value(7, k, 50)) for k in range(50)]
    assert sorted(int(v) for v in values) == list(range(50))
    assert values != sorted(values)
    other = parse_draw("blocks.a.y_m", {"latin_hypercube": [0, 50]})
    assert [float(other.value(7, k, 50)) for k in range(50)] != values


def test_a_draw_knows_nothing_but_its_own_key() -> None:
    one = parse_draw("blocks.a.x_m", {"uniform": [0, 1]})
    assert one.value(1, 5, 10) == one.value(1, 5, 10_000)
    assert one.value(1, 5, 10) != one.value(2, 5, 10)
    assert one.value(1, 5, 10) != one.value(1, 6, 10)
    assert replica_seed(1, 5) != replica_seed(1, 6)


def test_drawn_times_and_rates_keep_clocks_exact() -> None:
    assert round_for_exact_clock("blocks.a.offset_s", 0.1234567891234) == Fraction(123456789, 10**9)
    assert round_for_exact_clock("blocks.a.scan_rate_hz", 4.98765) == Fraction(4988, 1000)
    assert round_for_exact_clock("blocks.a.rate_deg_s", 1.23456789012) == 1.23456789012


def test_all_cells_share_seeds_and_draws(small: Path) -> None:
    study = read_study("study.toml")
    assert len(study.cells) == 2
    assert study.labels(1) == {"radar.scan_rate_hz": 5}
    assert study.replica(3).changes.keys() == {draw.key for draw in study.draws}
    assert study.replica(3).seed == replica_seed(study.seed, 3)
    runs = [
        (cell, k)
        for chunk in study.chunks(0, [0, 1])
        for cell, start, end in chunk.runs
        for k in range(start, end)
    ]
    assert runs == [(cell, k) for cell in (0, 1) for k in range(24)]
    assert [len(chunk) for chunk in study.chunks(0, [0, 1])] == [8] * 6


@pytest.mark.parametrize("quote", ["", '"'])
def test_an_axis_whose_name_holds_dots_and_brackets_can_be_changed(
    configs: Path, quote: str
) -> None:
    name = configs / "studies/latency_and_loss.toml"
    study = read_study(name, sets=[f"axes.{quote}wires[4].drop_probability{quote}=[0, 0.3]"])
    assert [axis.key for axis in study.axes] == [
        "blocks.radar.latency_s",
        "wires[4].drop_probability",
    ]
    assert study.axes[1].labels == (0, 0.3)
    added = read_study(name, sets=["axes.wires[4].jitter_s=[0, 0.01]"])
    assert added.axes[2].key == "wires[4].jitter_s"


def test_axes_of_what_a_scene_counts_are_named_in_words(configs: Path, tmp_path: Path) -> None:
    (tmp_path / "chains.toml").write_text(
        f'scene = "{configs / "first_light.toml"}"\nmetrics = ["first_detection"]\n'
        'axes."wires[1].delay_s" = [0, 1]\naxes.blocks.radar.scan_rate_hz = [1, 2]\n'
        'axes."blocks.traffic.intruders[crossing].speed_mps" = [50, 60]\n'
        'axes."blocks.traffic.intruders[0].speed_mps" = [50, 60]\n'
        'axes."loss"={values=["none"], set."wires[4].drop_probability" = [0]}\n'
    )
    wires = read_scene_file(configs / "first_light.toml").data["wires"]
    begins, ends = (end.strip() for end in wires[1].split("->"))
    record = record_of(read_study(tmp_path / "chains.toml"))
    assert {axis.column: axis.words for axis in record.axes} == {
        "wires[1].delay_s": f"wire from {begins} to {ends}:.delay_s",
        "radar.scan_rate_hz": "",
        "traffic.intruders[crossing].speed_mps": "traffic.intruder crossing.speed_mps",
        "traffic.intruders[0].speed_mps": "traffic.intruder head_on.speed_mps",
        "loss": "",
    }
    # A wire that is a table, in the shipped study.
    shipped = record_of(read_study(configs / "studies/latency_and_loss.toml"))
    assert shipped.axes[1].words == "wire from radar to fusion:.drop_probability"


STUDY = """
scene = "first_light"
replicas = 1
metrics = ["first_detection"]
compare = {{ axis = "{key}", baseline = {baseline} }}
axes.{key} = {values}
"""


def baseline(folder: Path, key: str, values: str, wanted: str) -> object:
    path = folder / "study.toml"
    path.write_text(STUDY.format(key=key, values=values, baseline=wanted))
    return read_study(path).baseline


@pytest.mark.parametrize(
    ("key", "values", "wanted", "label"),
    [
        ("blocks.radar.enabled", "[true, false]", "false", "false"),
        ("blocks.radar.scan_rate_hz", "['7/2', 1]", "'7/2'", 3.5),
        ("blocks.radar.azimuth_deg", "[[-110, 110], [-60, 60]]", "[-60, 60]", "[-60, 60]"),
        ("blocks.radar.scan_rate_hz", "[2, 1]", "1.0", 1),
    ],
)
def test_it_is_found(tmp_path: Path, key: str, values: str, wanted: str, label: object) -> None:
    assert baseline(tmp_path, key, values, wanted) == (key.removeprefix("blocks."), label)


def test_a_flag_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="is no value of that axis; allowed: 2, 1"):
        baseline(tmp_path, "blocks.radar.scan_rate_hz", "[2, 1]", "true")
