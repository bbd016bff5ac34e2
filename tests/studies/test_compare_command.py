"""``dsa-des compare`` says what is wrong before it runs anything, and keeps every figure."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from dsa_des.commands import compare as comparison


def compare(*words: str, code: int) -> str:
    result = CliRunner().invoke(main, ["compare", *words, "--workers", "1"])
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


def test_a_misspelt_result_is_named_before_anything_runs(small: Path) -> None:
    name = ("--metric", "first_detection_time_s.rader", "--replicas", "2")
    swap = compare("small.toml", "--swap", "transform=geometry.ellipsoid", *name, code=2)
    assert "did you mean 'first_detection_time_s.radar'?" in swap
    assert "there is no such result" in compare("small.toml", "study.toml", *name, code=2)
    assert not Path("studies").exists()


def test_a_folder_that_is_there_is_left_alone(small: Path) -> None:
    words = ("small.toml", "small.toml", "--out")
    assert "a new folder is needed" in compare(*words, "study.toml", code=2)
    assert "a new folder is needed" in compare(*words, ".", code=2)


def test_each_of_several_comparisons_has_its_figure(small: Path) -> None:
    text = Path("small.toml").read_text()
    for name, speed in (("a", 60), ("b", 70), ("c", 80)):
        Path(f"{name}.toml").write_text(text.replace("speed_mps = 60", f"speed_mps = {speed}"))
    metric = ("--metric", "first_detection_range_m.ir", "--replicas", "2", "--out", "out")
    compare("a.toml", "b.toml", "c.toml", *metric, code=0)
    found = sorted(path.name for path in Path("out").glob("*.png"))
    assert found == [f"scatter-{k}-first_detection_range_m.ir.png" for k in (2, 3)]


def first_words(*words: str) -> str:
    """What a comparison says before its tables, in one line."""
    with pytest.MonkeyPatch.context() as patch:  # a figure for each result takes long
        patch.setattr(comparison, "draw_scatter", lambda drawn, *_: drawn.write(b""))
        found = compare(*words, code=0)
    return found.partition("What changed from ")[2].partition(" less ")[0]


def changed(name: str, *pairs: tuple[str, str]) -> None:
    text = Path("small.toml").read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    Path(name).write_text(text)


def test_a_comparison_begins_with_who_sees_what_later_or_no_longer(small: Path) -> None:
    changed("b.toml", ("reach_km = 4.8", "reach_km = 4.6"), ("reach_km = 9", "reach_km = 0.1"))
    text = first_words("small.toml", "b.toml", "--replicas", "4")
    assert text.startswith("small.toml to b.toml: ")
    assert re.search("ir: [^:]*no longer sees any target in 4 of 4 runs", text)
    # 200 m at 110 m/s, on a grid of 5 Hz with one scan in ten without a detection.
    later = re.search(
        r"radar: .*?sees a target later in (\d) of 4 runs \(mean \+([\d.]+) s\)", text
    )
    assert later is not None and later[1] == "4"
    assert 1.4 < float(later[2]) < 2.6
    back = first_words("b.toml", "small.toml", "--replicas", "4")
    assert re.search("ir: [^:]*now sees a target in 4 of 4 runs", back)
    assert "radar: " in back and "sees a target earlier in 4 of 4 runs (mean -" in back


def test_a_comparison_of_equals_says_that_nothing_changed(small: Path) -> None:
    changed("b.toml")
    text = first_words("small.toml", "b.toml", "--replicas", "2")
    assert "as before: " in text and "changed:" not in text.replace("What changed", "")


def test_a_sensor_that_only_one_scene_has_is_named(small: Path) -> None:
    changed("b.toml", ('"gate -> radar", "gate -> ir", "radar -> fusion",\n         "ir -> fusion"',
                       '"gate -> radar", "radar -> fusion"'),
            ('[blocks.ir]\ntype = "fragile:Fragile"\nscan_rate_hz = 2\nreach_km = 9\n',
             ""))  # fmt: skip
    text = compare("small.toml", "b.toml", "--replicas", "2", code=0)
    assert "only small.toml has" in text and "detected.ir" in text


def test_a_compared_study_tells_each_value_against_the_baseline(small: Path) -> None:
    Path("axis.toml").write_text("""
scene = "small.toml"
replicas = 3
metrics = ["first_detection"]
compare = { axis = "blocks.ir.reach_km", baseline = 9 }
[axes]
blocks.ir.reach_km = [0.1, 9]
""")
    result = CliRunner().invoke(main, ["study", "axis.toml", "--workers", "1", "--out", "out"])
    assert result.exit_code == 0, result.output
    text = compare("out", code=0)
    assert text.startswith("What changed from ir.reach_km = 9 to ir.reach_km = 0.1: ")
    assert "ir: no longer sees any target in 3 of 3 runs" in text
    assert "as before: radar" in text
