"""`dsa-des run` from the outside: what it prints, writes, and refuses."""

import json
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

import dsa_des
from dsa_des.cli import main


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def first_light(tmp_path_factory: pytest.TempPathFactory, configs: Path) -> tuple[Path, dict]:
    out = tmp_path_factory.mktemp("runs") / "first_light"
    result = call("run", configs / "first_light.toml", "--out", out, "--json")
    assert result.exit_code == 0, result.output
    return out, json.loads(result.stdout)


def test_json_summary_has_the_promised_shape(first_light: tuple[Path, dict]) -> None:
    out, summary = first_light
    assert set(summary["sensors"]) == {"radar", "eo", "ir"}
    radar = summary["sensors"]["radar"]
    assert radar["scans"] == 600  # 5 Hz x 120 s
    assert summary["sensors"]["eo"]["scans"] == 2399  # from 0.05 s: the one at 120 s is not run
    assert summary["sensors"]["ir"]["scans"] == 240
    assert set(radar["first_detection"]) == {"time_s", "range_m", "target", "at"}
    assert set(radar["last_detection"]) == {"time_s", "range_m", "target"}
    assert radar["evaluated"] >= radar["detections"] > 0
    assert sum(summary["fused"].values()) == pq.ParquetFile(out / "fused.parquet").metadata.num_rows
    assert set(summary["targets"]) == {"head_on", "crossing"}
    # 60 m aside and 30 m above, closing along the meridian: they pass at hypot(60, 30) m, and
    # the tangent plane has let the intruder sink by a few metres at most.
    assert summary["targets"]["head_on"]["closest_approach"]["range_m"] == pytest.approx(67, abs=8)
    assert summary["simulated_s"] == 120
    assert summary["out"] == str(out)


def test_run_folder_is_complete_and_readable(first_light: tuple[Path, dict]) -> None:
    out, summary = first_light
    names = {path.name for path in out.iterdir()}
    assert names == {
        "scene.toml",
        "run.json",
        "detections.parquet",
        "fused.parquet",
        "scans.parquet",
        "tracks.parquet",
        "truth.parquet",
        "plan.png",
        "timeline.png",
    }
    assert list(out.parent.iterdir()) == [out], "temporary folders were left behind"
    run = dsa_des.read_run(out)
    promised = {"block", "scan", "tick", "time_s", "target", "azimuth_rad", "elevation_rad"}
    assert promised | {"range_m", "confidence"} <= set(run.detections.column_names)
    assert {"block", "scan", "tick", "time_s", "evaluated", "detected"} <= set(
        run.scans.column_names
    )
    assert run.scans.num_rows == 600 + 2399 + 240
    detected = run.scans["detected"].to_numpy().sum()
    assert (
        detected
        == run.detections.num_rows
        == sum(sensor["detections"] for sensor in summary["sensors"].values())
    )
    eo = [row for row in run.detections.to_pylist() if row["block"] == "eo"]
    assert eo and all(row["range_m"] is None for row in eo)
    assert all(row["true_range_m"] > 0 for row in eo)


def test_resolved_scene_runs_again_to_the_same_bytes(
    first_light: tuple[Path, dict], tmp_path: Path
) -> None:
    out, _ = first_light
    again = tmp_path / "again"
    assert call("run", out / "scene.toml", "--out", again, "--quiet").exit_code == 0
    for path in out.glob("*.parquet"):
        assert path.read_bytes() == (again / path.name).read_bytes(), path.name
    assert (out / "scene.toml").read_bytes() == (again / "scene.toml").read_bytes()
    first, second = (json.loads((f / "run.json").read_text()) for f in (out, again))
    assert first.pop("timings") and second.pop("timings")
    assert first == second


def test_quiet_prints_nothing_and_a_plain_run_prints_a_table(tmp_path: Path, configs: Path) -> None:
    scene = configs / "first_light.toml"
    words = ("run", scene, "--duration", 5, "--no-figures", "--out", tmp_path / "a")
    quiet = call(*words, "--quiet")
    assert (quiet.exit_code, quiet.output) == (0, "")
    plain = call(*words)  # replaces a run
    for word in ("radar", "eo", "ir", "head_on", "crossing"):
        assert word in plain.output


def test_seed_and_set_change_what_they_should(tmp_path: Path, configs: Path) -> None:
    def counts(name: str, *options: object) -> dict:
        result = call(
            "run", configs / "first_light.toml", "--duration", 30, "--json", "--no-figures",
            "--out", tmp_path / name, *options,
        )  # fmt: skip
        return json.loads(result.stdout)["sensors"]

    base = counts("base")
    other_seed = counts("seed", "--seed", 7)
    slower = counts("set", "--set", "blocks.radar.scan_rate_hz=1")
    assert other_seed["radar"]["detections"] != base["radar"]["detections"]
    assert other_seed["eo"] == base["eo"]  # nothing random in it
    assert slower["radar"]["scans"] == 30
    assert slower["eo"] == base["eo"]


def test_default_folders_are_numbered(
    tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        call("run", configs / "first_light.toml", "--duration", 1, "--quiet", "--no-figures")
    assert sorted(p.name for p in (tmp_path / "runs").iterdir()) == [
        "first_light-001",
        "first_light-002",
    ]


BAD = [
    (["--set", "blocks.radar.scan_rat_hz=2"], ["blocks.radar.scan_rat_hz", "'scan_rate_hz'"]),
    (["--set", "blocks.radar.scan_rate_hz=-2"], ["blocks.radar.scan_rate_hz = -2", "greater"]),
    (["--set", "blocks.radar.scan_rate_hz=fast"], ["scan_rate_hz = 'fast'", "30000/1001"]),
    (["--set", "blocks.radar.power_w=nan"], ["blocks.radar.power_w", "finite"]),
    (["--set", "blocks.rader.power_w=2"], ["'rader'", "did you mean 'radar'"]),
    (["--set", "blocks.radar"], ["--set", "KEY=VALUE"]),
    (["--swap", "radar=radar.swirling"], ["--swap radar", "'radar.swerling'"]),
    (["--swap", "radar=nomodule:Radar"], ["no module 'nomodule'"]),
    (["--swap", "radar=gate"], ["radar -> fusion", "does not fit"]),
    (["--swap", "rdr=radar.swerling"], ["did you mean 'radar'"]),
    (["--duration", "-1"], ["duration_s", "greater than 0"]),
    (["--duration", "soon"], ["duration_s", "'soon'"]),
    (["--seed", "-4"], ["seed", "-4"]),
]


@pytest.mark.parametrize(("options", "expected"), BAD, ids=lambda v: " ".join(v)[:40])
def test_bad_calls_say_what_is_wrong_and_leave_nothing(
    options: list[str], expected: list[str], tmp_path: Path, configs: Path
) -> None:
    result = call("run", configs / "first_light.toml", "--out", tmp_path / "out", *options)
    assert result.exit_code == 2
    assert result.stdout == ""
    for text in expected:
        assert text in result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_all_problems_come_at_once(tmp_path: Path, configs: Path) -> None:
    options = [option for bad, _ in BAD[:2] for option in bad] + ["--seed", "-1"]
    result = call("check", configs / "first_light.toml", *options)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: 3 problems:") or "2 problems" in result.stderr


def test_out_is_not_overwritten_unless_it_is_a_run(tmp_path: Path, configs: Path) -> None:
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "chapter1.tex").write_text("text")
    result = call("run", configs / "first_light.toml", "--out", precious)
    assert result.exit_code == 2
    assert "something other than a run" in result.stderr
    assert [p.name for p in precious.iterdir()] == ["chapter1.tex"]


def test_failing_block_leaves_no_folder_and_exits_1(
    tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_radar.py").write_text(
        "from components.sensor import Sensor\n"
        "class Broken(Sensor):\n"
        "    def look(self, cells):\n"
        "        raise KeyError('calibration')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    result = call(
        "run", configs / "first_light.toml", "--swap", "radar=broken_radar:Broken",
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 1
    assert "radar (broken_radar:Broken) failed at t = 0.000 s, scan 0: KeyError" in result.stderr
    assert not (tmp_path / "out").exists()


def test_stranger_component_of_the_docs_runs(
    tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (configs.parent / "docs" / "extending.md").read_text(encoding="utf-8")
    code = next(
        part.split("```")[0] for part in page.split("```python\n") if "class MyRadar(" in part
    )
    (tmp_path / "mymodule.py").write_text(code)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    result = call(
        "run", configs / "first_light.toml", "--swap", "radar=mymodule:MyRadar",
        "--set", "blocks.radar.reach_km=8", "--json", "--no-figures", "--out", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    radar = json.loads(result.stdout)["sensors"]["radar"]
    assert radar["detections"] > 0
    swap = "--set blocks.radar.reach_km=8 --swap radar=mymodule:MyRadar"
    assert result.stderr == f"1 note: dsa-des check {configs / 'first_light.toml'} {swap}\n"
    said = call("check", configs / "first_light.toml", *swap.split()).stderr
    assert said.startswith("note: blocks.radar: the swap dropped ") and "power_w" in said


@pytest.mark.parametrize(
    ("arguments", "absent"),
    [
        (["--help"], ["numpy", "simpy", "pydantic", "networkx", "rich", "pyarrow", "matplotlib"]),
        (
            ["run", "{configs}/first_light.toml", "--duration", "1", "--quiet", "--out", "{out}"],
            ["scipy.stats", "matplotlib.pyplot", "pandas"],
        ),
        (
            [
                "run",
                "{configs}/first_light.toml",
                "--duration",
                "1",
                "--no-figures",
                "--out",
                "{out}",
            ],
            ["scipy.stats", "matplotlib", "pandas"],
        ),
        (
            ["check", "{configs}/first_light.toml"],
            ["scipy.stats", "scipy.optimize", "matplotlib", "pandas", "pyarrow"],
        ),
    ],
    ids=["help", "run", "run without figures", "check"],
)
def test_costly_imports_stay_off_the_path(
    arguments: list[str], absent: list[str], tmp_path: Path, configs: Path
) -> None:
    filled = [a.format(configs=configs, out=tmp_path / "out") for a in arguments]
    # Arrow's readers, for figures, import pandas where it is installed, and do without it where
    # they cannot. Its writers are asked for nothing that does.
    recorded = "--no-figures" in arguments
    (tmp_path / "pandas.py").write_text("" if recorded else "raise ImportError('no pandas')")
    code = (
        "import sys\nfrom dsa_des.cli import main\n"
        f"try: main({filled!r})\nexcept SystemExit as end: assert not end.code\n"
        f"print('LOADED', [m for m in {absent!r} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "LOADED []" in done.stdout, done.stdout[-500:]
