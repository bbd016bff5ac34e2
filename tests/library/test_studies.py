"""Studies in Python: the parts of the command line, and classes that workers cannot import."""

import subprocess
import sys
import textwrap

import pytest
from click.testing import CliRunner

import dsa_des
from dsa_des.cli import main

AXES = {"blocks.radar.scan_rate_hz": [1, 2]}
DRAWS = {"blocks.radar.offset_s": {"uniform": [0, 1]}}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """One study, run by the command line and from Python."""
    home = tmp_path_factory.mktemp("studies")
    scene = dsa_des.load_scene("first_light")
    (home / "study.toml").write_text(
        f"scene = '{scene.path}'\n"
        "replicas = 6\nseed = 3\nmetrics = ['first_detection']\n"
        "swap.radar = 'radar.threshold'\nset.duration_s = 20\n"
        "axes.blocks.radar.scan_rate_hz = [1, 2]\n"
        "draws.blocks.radar.offset_s = { uniform = [0, 1] }\n"
        "compare = { axis = 'blocks.radar.scan_rate_hz', baseline = 1 }\n"
    )
    words = ["study", str(home / "study.toml"), "--out", str(home / "cli"), "--workers", "1"]
    done = CliRunner().invoke(main, [*words, "--quiet"])
    assert done.exit_code == 0, done.output
    result = dsa_des.study(
        scene.swap(radar="radar.threshold").set({"duration_s": 20}),
        axes=AXES,
        draws=DRAWS,
        metrics=["first_detection"],
        replicas=6,
        seed=3,
        workers=1,
        out=home / "python",
        compare={"axis": "blocks.radar.scan_rate_hz", "baseline": 1},
    )
    return home, result


def test_parts_and_tables_are_the_bytes_of_the_command_line(both):
    home, result = both
    for name in ("parts", "."):
        here, there = (sorted((home / f / name).glob("*.parquet")) for f in ("python", "cli"))
        assert [p.name for p in here] == [p.name for p in there] != []
        assert [p.read_bytes() for p in here] == [p.read_bytes() for p in there]
    assert result.path == home / "python"


def test_a_result_is_tables_and_figures(both):
    _, result = both
    assert result.runs.num_rows == 12
    assert set(result.summary["result"].to_pylist()) >= {"detected.radar"}
    assert result.differences is not None and result.differences.num_rows
    assert len(repr(result).splitlines()) <= 10
    printed = str(result).splitlines()  # as `dsa-des study` has it
    assert any("detected.radar" in line.split() for line in printed)
    assert all(line == line.rstrip() and line.isprintable() for line in printed)
    with pytest.raises(dsa_des.UsageError, match="no figure"):
        result.figure("nix")


def test_a_study_is_not_mixed_with_another_and_can_be_continued(both, short):
    home, _ = both
    keys = {"metrics": ["first_detection"], "workers": 1, "out": home / "python"}
    with pytest.raises(dsa_des.UsageError, match="holds a study already"):
        dsa_des.study(short, **keys)
    with pytest.raises(dsa_des.UsageError, match="holds another study"):
        dsa_des.study(short, resume=True, **keys)


def test_own_classes_of_blocks_and_metrics(short, own):
    short = short.set({"blocks.traffic.intruders[0].north_m": 2000})
    metrics = [own.Rows, {"metric": "first_detection"}]
    axes = {"swap.radar": ["radar.threshold", own.OwnRadar]}
    result = dsa_des.study(short, axes=axes, metrics=metrics, replicas=2)
    assert result.runs["error"].null_count == 4
    values = result.summary.to_pylist()
    rows = [row["value"] for row in values if row["result"] == "rows"]
    assert len(rows) == 2 and rows[0] == rows[1] > 0  # the same radar by two names
    reference = dsa_des.study(short.swap(radar=own.OwnRadar), metrics=[own.Rows], replicas=2)
    assert reference.summary["value"].to_pylist() == rows[1:]


@pytest.mark.parametrize("where", ["scene", "axes", "metrics"])
def test_a_class_that_workers_cannot_import_is_one_error(short, own, where):
    scene = short.swap(radar=own.OwnRadar) if where == "scene" else short
    axes = {"swap.radar": ["radar.threshold", own.OwnRadar]} if where == "axes" else {}
    metrics = [own.Rows] if where == "metrics" else ["first_detection"]
    with pytest.raises(dsa_des.UsageError, match="other processes cannot import made_by_hand:"):
        dsa_des.study(scene, axes=axes, metrics=metrics, replicas=2, workers=2)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"metrics": ["first_detektion"]}, "did you mean 'first_detection'?"),
        ({"metrics": ["first_detection"], "replicas": 0}, "study: replicas = 0"),
        ({"metrics": ["first_detection"], "replicaz": 3}, "unknown key of a study"),
        ({"metrics": ["first_detection"], "set": {}}, "study: set: is no keyword"),
        ({"metrics": ["first_detection"], "axes": {"blocks.radar.nix": [1]}}, "nix"),
        ({"metrics": [int]}, "is not a dsa_des.studies.metric.Metric"),
        ({"metrics": [None]}, "NoneType"),
    ],
)
def test_what_is_wrong_is_one_error(short, keys, said):
    with pytest.raises(dsa_des.SceneError) as error:
        dsa_des.study(short, **keys)
    assert said in str(error.value)


@pytest.mark.parametrize("workers", [0, -1, 1.5, True, "2", 10**6])
def test_workers_are_a_number(short, workers):
    with pytest.raises(dsa_des.UsageError, match="workers is"):
        dsa_des.study(short, metrics=["first_detection"], workers=workers)


def test_progress_is_a_callback_and_nothing_is_printed(short, capfd):
    seen: list[int] = []
    dsa_des.study(
        short,
        metrics=["first_detection"],
        replicas=3,
        workers=1,
        progress=lambda progress: seen.append(progress.runs),
    )
    assert seen[-1] == 3
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_script_without_a_guard_may_have_workers(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent(
            """
            import dsa_des
            print("begun")
            scene = dsa_des.load_scene("first_light").set({"duration_s": 5})
            keys = dict(metrics=["first_detection"], replicas=4)
            one = dsa_des.study(scene, workers=1, **keys)
            two = dsa_des.study(scene, workers=2, **keys)
            assert two.runs.equals(one.runs) and two.runs["error"].null_count == 4
            """
        )
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "begun\n", "")


def test_a_study_file_gives_the_bytes_of_the_command_line(both):
    home, _ = both
    result = dsa_des.study(home / "study.toml", workers=1, out=home / "file")
    assert result.runs.num_rows == 12
    for name in ("parts", "."):
        here, there = (sorted((home / f / name).glob("*.parquet")) for f in ("file", "cli"))
        assert [p.read_bytes() for p in here] == [p.read_bytes() for p in there] != []
    assert (home / "file" / "study.json").read_bytes() == (home / "cli" / "study.json").read_bytes()


def test_a_shipped_study_is_found_by_its_name_and_changed_by_sets():
    small = ["replicas=2", "set.duration_s=5", "axes.blocks.radar.scan_rate_hz=[1, 5]"]
    result = dsa_des.study("radar_scan_rate", sets=small, workers=1)
    assert result.runs.num_rows == 4
    by_keyword = dsa_des.study("radar_scan_rate", sets=small[1:], replicas=2, workers=1)
    assert str(by_keyword.runs) == str(result.runs)
    other = dsa_des.study("radar_scan_rate", sets=small[1:], replicas=2, seed=7, workers=1)
    assert str(other.runs) != str(result.runs)


@pytest.mark.parametrize(
    ("source", "more", "says"),
    [
        ("first_light", {}, "first_light.toml: is a scene, not a study"),
        ({"blocks": {}}, {}, "study: metrics: is missing"),
        ("radar_scan_rate", {"replicas": 0}, "replicas = 0: must be greater than or equal to 1"),
        ("radar_scan_rate", {"titel": "x"}, "titel: unknown key of a study; did you mean 'title'"),
        ("radar_scan_ratte", {}, "did you mean the shipped 'radar_scan_rate'"),
        ("first_light", {"metrics": ["first_detection"], "sets": ["seed=1"]}, "study: sets"),
    ],
)
def test_what_is_neither_a_study_nor_a_scene_with_metrics_is_said(source, more, says):
    with pytest.raises(dsa_des.SceneError, match=says):
        dsa_des.study(source, **more)


def test_tables_become_data_frames(both, short):
    pytest.importorskip("pandas")
    _, result = both
    summary = result.summary.to_pandas()
    assert list(summary.columns) == result.summary.column_names
    assert len(summary) == result.summary.num_rows > 0
    run = dsa_des.run(short)
    detections = run.detections.to_pandas()
    assert len(detections) == run.detections.num_rows > 0
    assert detections["time_s"].is_monotonic_increasing
    assert detections["range_m"].dtype == float
