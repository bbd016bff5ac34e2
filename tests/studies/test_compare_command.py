"""``dsa-des compare`` says what is wrong before it runs anything, and keeps every figure."""

from pathlib import Path

from click.testing import CliRunner

from dsa_des.cli import main


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
