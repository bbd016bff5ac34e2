"""What is wrong with a study is said before anything runs, all of it, with the nearest name."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.studies.study_file import read_study


def refused(*words: str) -> str:
    result = CliRunner().invoke(main, ["study", *words])
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    assert not Path("studies").exists()
    return " ".join(result.output.split())


def changed(old: str, new: str) -> None:
    text = Path("study.toml").read_text()
    assert old in text
    Path("study.toml").write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "blocks.radar.scan_rate_hz = [1, 5]",
            "blocks.radar.scan_rate = [1, 5]",
            "study.toml: blocks.radar.scan_rate: unknown parameter of fragile:Fragile; "
            "did you mean 'scan_rate_hz'?",
        ),
        (
            "blocks.radar.scan_rate_hz = [1, 5]",
            "blocks.rader.scan_rate_hz = [1, 5]",
            "the scene has no block 'rader'; did you mean 'radar'?",
        ),
        ("[1, 5]", "[]", "axes.blocks.radar.scan_rate_hz: is empty"),
        ("[1, 5]", "{ from = 5, to = 1, step = 1 }", "the range from 5 to 1 is empty"),
        ("[1, 5]", "{ from = 1, to = 5 }", "a range needs from, to, and either step or steps"),
        ("[1, 5]", "{ from = 0, to = 5, steps = 3, log = true }", "must start above 0"),
        ("[1, 5]", "[1, 1]", "holds 1 more than once"),
        ("[1, 5]", "[1, -5]", "blocks.radar.scan_rate_hz = -5: must be greater than 0"),
        ("replicas = 24", "replicas = 0", "replicas = 0: must be greater than or equal to 1"),
        ("replicas = 24", "replicas = true", "replicas = True: must be a number"),
        ("replicas = 24", "replicas = 2.5", "replicas = 2.5: must be a whole number"),
        ("replicas = 24", "replcas = 24", "unknown key of a study; did you mean 'replicas'?"),
        ('"first_detection", ', '"first_detecton", ', "did you mean 'first_detection'?"),
        ('"small.toml"', '"smal.toml"', "did you mean"),
        ("uniform = [0, 0.2]", "uniform = [0.2, 0]", "the range [0.2, 0.0] is empty"),
        ("uniform = [0, 0.2]", "unifrom = [0, 0.2]", "must be one of {uniform = [low, high]}"),
        ('metric = "first_detection_range_m.radar"', 'metric = "first_detection_range_m.rada"',
         "did you mean 'first_detection_range_m.radar'?"),
        ('title = "small study"', 'stop_when = {metric = "nothing", half_width = 1}',
         "stop_when.metric = 'nothing': no metric of the study gives it"),
        ("[axes]", '[axes]\nswap.radra = ["radar.threshold"]', "did you mean 'radar'?"),
        ("[axes]", '[axes]\nblocks.traffic.file = {files = "nowhere/*.daa"}', "no file matches"),
        ("uniform = [0, 0.2]", "uniform = [0, nan]", "uniform = [0, nan]: must be finite"),
        ("uniform = [0, 0.2]", "uniform = [-inf, 0]", "uniform = [-inf, 0]: must be finite"),
        ("uniform = [0, 0.2]", "uniform = [-0.2, 0.3]",
         "study.toml: draws.blocks.radar.offset_s = -0.1"),
        ("uniform = [0, 0.2]", 'choice = [0.1, "x"]', "offset_s = 'x': must be a number"),
        ("blocks.radar.offset_s = {", "blocks.radar.ofset_s = {", "did you mean 'offset_s'?"),
        ("blocks.radar.offset_s = { uniform = [0, 0.2]",
         "blocks.radar.scan_rate_hz = { choice = [2]",
         "is set by the axis blocks.radar.scan_rate_hz"),
        ("[axes]", '[axes]\nboth = {values = [1, 2], set."blocks.radar.scan_rate_hz" = [1, 2]}',
         "sets blocks.radar.scan_rate_hz, which the axis both sets as well"),
        ("[1, 5]", '{ from = 1, to = 5, steps = 3, log = "yes" }', "log = 'yes': must be true"),
        ('title = "small study"', 'stop_when = {metric = "track_breaks", half_width = nan}',
         "stop_when.half_width = nan: must be a finite number"),
        ('"first_detection", ', '{ metric = "first_detection", target = "on" }, ',
         "metrics[0] = 'first_detection': target: there is no 'on'; did you mean 'one'?"),
        ("[[figures]]", '[[figures]]\nkind = "pie"', "figures[0].kind = 'pie'"),
        ("[[figures]]", '[[figures]]\nkind = ["axis"]', "figures[0].kind = ['axis']"),
        ("[[figures]]", '[[figures]]\nkind = "heat"', "needs two axes; the study has 1"),
        ('[[figures]]\nmetric = "first_detection_range_m.radar"',
         '[[figures]]\nkind = "run"\ncell = 2\nreplica = 23',
         "figures[0].cell = 2: must be the number of a cell of this study: 0 to 1"),
        ('[[figures]]\nmetric = "first_detection_range_m.radar"',
         '[[figures]]\nkind = "run"\ncell = 1\nreplica = "x"',
         "figures[0].replica = 'x': must be a whole number"),
    ],
)  # fmt: skip
def test_one_problem_is_named(small: Path, old: str, new: str, message: str) -> None:
    changed(old, new)
    assert message in refused("study.toml")


def test_a_metric_needs_its_port(small: Path) -> None:
    scene = Path("small.toml").read_text()
    scene = scene.replace(', "radar -> fusion"', "").replace(',\n         "ir -> fusion", '
                                                             '"fusion -> tracker"', "")  # fmt: skip
    cut = scene.index("[blocks.fusion]")
    Path("small.toml").write_text(scene[:cut])
    output = refused("study.toml")
    assert "metrics[1] = 'fused_share': needs a block whose output records 'fused'" in output
    assert "this scene's blocks record detections, looks, scans, truth" in output
    assert "metrics[3] = 'track_updates'" in output  # all problems at once


def test_a_swap_that_takes_a_metrics_port_away_is_noticed(small: Path) -> None:
    changed("[axes]", '[axes]\nswap.fusion = ["fusion.pick_best", "fusion.none"]')
    assert "unknown block type" in refused("study.toml")


def test_all_problems_come_at_once(small: Path) -> None:
    changed("[1, 5]", "[]")
    changed("uniform = [0, 0.2]", "uniform = [0]")
    output = refused("study.toml")
    assert "2 problems" in output and "is empty" in output and "uniform takes two" in output


def test_a_key_of_the_scene_that_the_command_line_gives_the_study_is_one_problem(
    small: Path,
) -> None:
    output = refused("study.toml", "--set", "blocks.radar.enabled=false")
    assert output.strip() == (
        "error: command line: blocks.radar.enabled: is a key of the study's scene: "
        "set.blocks.radar.enabled"
    )


def test_problems_of_all_kinds_come_in_one_report(small: Path) -> None:
    changed("[1, 5]", "[1, -5]")  # of the scene
    changed("replicas = 24", "replicas = 0")  # of the study
    changed('"first_detection", ', '"first_detecton", ')  # of a metric's name
    changed('"well_clear"', '{ metric = "well_clear", sensors = ["rader"] }')  # against the scene
    changed("uniform = [0, 0.2]", "uniform = [-2, -1]")  # of a draw
    output = refused("study.toml")
    assert "5 problems" in output
    for key in ("blocks.radar.scan_rate_hz = -5", "replicas = 0", "metrics[0]", "metrics[2]",
                "draws.blocks.radar.offset_s = -"):  # fmt: skip
        assert f"study.toml: {key}" in output


def test_what_a_scene_lacks_hides_nothing_else(small: Path) -> None:
    changed("[axes]", '[set]\nduraton_s = 3\n[swap]\nfusion = "fusion.pick_bst"\n[axes]')
    changed("[1, 5]", "{ from = 5, to = 1, step = 1 }")
    output = refused("study.toml")
    assert "3 problems" in output and "did you mean 'duration_s'?" in output


def test_a_scheduler_that_does_not_answer(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("dsa_des.studies.executors._CONNECT_TIMEOUT_S", 0.3)
    words = ("study.toml", "--executor", "dask", "--scheduler", "tcp://127.0.0.1:9")
    assert "--scheduler tcp://127.0.0.1:9: no Dask scheduler answers there" in refused(*words)


def test_an_address_of_no_scheduler(small: Path) -> None:
    pytest.importorskip("distributed")
    words = ("study.toml", "--executor", "dask", "--scheduler", "nowhere")
    assert "--scheduler nowhere: must be an address such as" in refused(*words)


def test_dask_must_be_there(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    words = ("study.toml", "--executor", "dask", "--scheduler", "tcp://127.0.0.1:9")
    assert "pip install 'dsa-des[dask]'" in refused(*words)
    said = refused("study.toml", "--executor", "dask")
    assert "needs --scheduler" in said and "`dask scheduler`" in said and "`dask worker" in said


def test_folders_that_hold_something_else(small: Path) -> None:
    Path("full").mkdir()
    Path("full/precious.txt").write_text("mine")
    assert "holds something other than a study" in refused("study.toml", "--out", "full")
    assert "is not the folder of a study" in refused("show", "full")
    Path("full/study.json").write_text("{")
    assert "full/study.json: is damaged" in refused("show", "full")
    assert "full/study.json: is damaged" in refused("study.toml", "--out", "full", "--resume")
    assert "--out study.toml: is a file" in refused("study.toml", "--out", "study.toml")
    assert "give a STUDY" in refused()
    assert "there is no studies/study-NNN to continue" in refused("study.toml", "--resume")
    assert "must be 1 or more" in refused("study.toml", "--workers", "0")


def test_one_damaged_encounter_of_many_stops_no_study(tmp_path: Path, configs: Path) -> None:
    good = (configs / "encounters" / "crossing.daa").read_text()
    (tmp_path / "a.daa").write_text("damaged")
    study = configs / "studies" / "folder_by_scan_rate.toml"
    files = f'axes.blocks.traffic.file.files="{tmp_path}/*.daa"'
    with pytest.raises(SceneError, match=r"a\.daa"):
        read_study(study, sets=[files])
    (tmp_path / "b.daa").write_text(good)
    assert len(read_study(study, sets=[files]).axes[0].labels) == 2


def test_what_is_wrong_with_the_scene_is_said_once(small: Path) -> None:
    Path("study.toml").write_text('scene = "small.toml"\nmetrics = ["first_detection"]\n')
    text = Path("small.toml").read_text()
    Path("small.toml").write_text(text.replace("[blocks.radar]", "[blocks.radar]\nofset_s = 1", 1))
    assert refused("study.toml").count("blocks.radar.ofset_s") == 1
