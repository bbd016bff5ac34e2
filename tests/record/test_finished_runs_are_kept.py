"""A run that is finished is not lost because a figure or a summary of it fails."""

import contextlib
import json

import pytest
from click.testing import CliRunner

import dsa_des
from components.display import plan
from components.display.report import DetectAndSenseReport
from components.display.summary import FusedSummary, SensorSummary
from components.traffic.source import TrafficSource
from dsa_des.cli import main
from dsa_des.record.sinks import ObserverSink

TABLES = {"detections", "fused", "scans", "tracks", "truth"}


def run(configs, out, *options):
    scene = str(configs / "first_light.toml")
    arguments = ["run", scene, "--duration", "20", "--out", str(out), *options]
    return CliRunner().invoke(main, arguments, catch_exceptions=False)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "out of memory"),
        (ValueError("no such colour"), "ValueError: no such colour"),
    ],
)
def test_a_figure_that_fails_leaves_the_run(configs, tmp_path, monkeypatch, error, said):
    def fail(*_):
        raise error

    monkeypatch.setattr(plan, "draw_plan", fail)
    result = run(configs, tmp_path / "kept", "--quiet")
    assert result.exit_code == 0
    assert result.stderr.startswith("note: drawing failed: ")
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert set(dsa_des.read_run(tmp_path / "kept").tables) == TABLES
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]


def test_a_figure_that_cannot_be_written_leaves_the_run(configs, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(plan, "draw_plan", fail)
    result = run(configs, tmp_path / "kept", "--quiet")
    assert result.exit_code == 1
    assert result.stderr == (
        f"error: {tmp_path / 'kept'}: figures cannot be written: No space left on device; the run "
        "itself is complete\n"
    )
    assert set(dsa_des.read_run(tmp_path / "kept").tables) == TABLES


def test_the_run_is_complete_before_a_figure_is_begun(configs, tmp_path, monkeypatch):
    """A process that is killed while it draws has lost nothing but the figures."""
    seen = {}

    def draw(self, simulation, folder, summary):
        seen["tables"] = set(dsa_des.read_run(folder).tables)
        seen["folder"] = folder
        raise KeyboardInterrupt

    monkeypatch.setattr(DetectAndSenseReport, "draw", draw)
    with contextlib.suppress(KeyboardInterrupt):
        run(configs, tmp_path / "kept", "--quiet")
    assert seen == {"tables": TABLES, "folder": tmp_path / "kept"}
    assert set(dsa_des.read_run(tmp_path / "kept").tables) == TABLES


@pytest.mark.parametrize("method", ["update", "result"])
def test_an_observer_that_fails_leaves_the_run_and_the_others(
    configs, tmp_path, monkeypatch, method
):
    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(FusedSummary, method, fail)
    result = run(configs, tmp_path / "kept", "--json")
    assert result.exit_code == 0
    assert "the summary FusedSummary failed: out of memory" in result.stderr
    summary = json.loads(result.stdout)
    assert summary["sensors"]["eo"]["scans"] == 399
    assert "fused" not in summary
    info = dsa_des.read_run(tmp_path / "kept").info
    assert info["notes"] == ["the summary FusedSummary failed: out of memory"]
    assert info["summary"]["sensors"] == summary["sensors"]


def test_a_block_whose_report_fails_leaves_the_run(configs, tmp_path, monkeypatch):
    def fail(*_):
        raise MemoryError("Unable to allocate 7.3 GiB")

    monkeypatch.setattr(TrafficSource, "report", fail)
    result = run(configs, tmp_path / "kept")
    assert result.exit_code == 0
    assert "Unable to allocate 7.3 GiB (" in result.stderr
    assert "; the run itself is complete" in result.stderr
    assert (tmp_path / "kept" / "plan.png").exists()


def test_an_observer_sink_without_a_list_of_notes_raises(monkeypatch):
    def fail(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(SensorSummary, "update", fail)
    with pytest.raises(ZeroDivisionError):
        ObserverSink([SensorSummary([])]).write("scans", {})
