"""Where commands may write: said before anything runs, and nothing of anybody's is lost."""

import json
import os
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dsa_des.cli import main
from dsa_des.files.output_file import PREFIX
from dsa_des.running import recorded_run as run_module


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def everything_in(folder: Path) -> dict[str, bytes | str]:
    """Every file, folder and link below a folder, with what it holds."""
    return {
        str(path.relative_to(folder)): "link"
        if path.is_symlink()
        else "folder"
        if path.is_dir()
        else path.read_bytes()
        if path.is_file()
        else "pipe"
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def first_light(configs: Path) -> Path:
    return configs / "first_light.toml"


@pytest.fixture
def places(tmp_path: Path, first_light: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with an earlier run and all kinds of places in it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(run_module, "load_reports", list)  # figures take long
    (tmp_path / "home").mkdir()
    for name in ("run", "home/work"):
        assert call("run", first_light, "--duration", 1, "--quiet", "--out", name).exit_code == 0
    shutil.copytree(tmp_path / "run", tmp_path / "with notes")
    (tmp_path / "with notes" / "notes.txt").write_text("years of work")
    shutil.copytree(tmp_path / "run", tmp_path / "edited")
    scene = tmp_path / "edited" / "scene.toml"
    scene.write_text(scene.read_text().replace("seed", "Seed"))
    (tmp_path / "no run").mkdir()
    (tmp_path / "no run" / "run.json").write_text("{}")
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe")
    for link, end in (("link", "run"), ("dangling", "nowhere"), ("loop", "loop")):
        (tmp_path / link).symlink_to(end)
    return tmp_path


BAD = {
    ".": "is the working directory",
    "run/..": "is the working directory",
    "..": "holds the working directory",
    "/": "holds the working directory",
    "~": "is your home folder",
    "~nobody of that name/x": "no home folder",
    "": "is empty",
    "with notes": "something other than a run: notes.txt",
    "edited": "something other than a run: scene.toml",
    "no run": "something other than a run: run.json",
    "link": "is a symbolic link",
    "link/": "is a symbolic link",
    "dangling": "is a symbolic link",
    "loop": "is a symbolic link",
    "loop/x": "Too many levels of symbolic links",
    "file": "is a file",
    "file/x": "Not a directory",
    "a" * 300: "File name too long",
    "new/" + "a" * 300: "File name too long",
    "/proc": "is a mount point",
    "a\0b": "NUL",
}


@pytest.mark.parametrize("command", ["run", "cost", "map", "reproduce"])
def test_bad_places_are_refused_before_anything_runs(
    command: str, places: Path, first_light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words: list[object] = {
        "run": ["run", first_light],
        "cost": ["cost", first_light, "--block", "transform"],
        "map": ["cost", "--map", "geometry"],
        "reproduce": ["reproduce", "table-4.1"],
    }[command]
    for place in (
        "dsa_des.running.simulation.Simulation.run",
        "dsa_des.commands.cost.measure_rungs",
        "components.line_of_sight.error_map.draw_error_map",
        "components.thesis.reproduce.make_items",
    ):
        monkeypatch.setattr(place, lambda *args, **kwargs: pytest.fail("it ran"))
    before = everything_in(places)
    for out, message in BAD.items():
        result = call(*words, "--out", out)
        assert result.exit_code == 2, (out, result.output)
        assert message in result.stderr and result.stderr.startswith("error: --out"), out
        assert len(result.stderr.splitlines()) == 1 and result.stdout == "", out
    assert everything_in(places) == before


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a file system without folders")
@pytest.mark.parametrize(
    "words",
    [
        ("run", "first_light"),
        ("study", "radar_scan_rate"),
        ("compare", "first_light", "--swap", "tracker=tracking.ekf"),
        ("cost", "first_light"),
        ("reproduce", "table-4.1"),
    ],
)
def test_a_file_system_that_takes_no_folder_is_said_to_take_none(words: tuple[str, ...]) -> None:
    done = call(*words, "--out", "/proc/x/y")
    assert (done.exit_code, done.output) == (
        2, "error: --out /proc/x/y: cannot be written: no folder can be made in /proc\n"
    )  # fmt: skip


def test_nothing_of_an_earlier_run_is_touched_from_inside_it(
    places: Path, first_light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = everything_in(places)
    monkeypatch.chdir(places / "run")
    for out in (".", "..", "../run", places / "run"):
        assert call("run", first_light, "--duration", 1, "--out", out).exit_code == 2
    assert everything_in(places) == before


def test_a_run_replaces_an_earlier_one_whole(places: Path, first_light: Path) -> None:
    assert call("run", first_light, "--duration", 2, "--quiet", "--out", "run/").exit_code == 0
    info = json.loads((places / "run" / "run.json").read_text())
    assert info["duration_s"] == 2
    names = {path.name for path in (places / "run").iterdir()}
    assert set(info["files"]) | {"run.json"} == names
    assert not list(places.glob(".*"))


def test_two_runs_at_once_both_stay_and_say_where(
    tmp_path: Path, first_light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_module, "load_reports", list)
    real, inner = run_module.to_toml, []

    def another_one_meanwhile(data: object) -> str:
        if not inner:
            inner.append(True)
            inner.append(call("run", first_light, "--duration", 1, "--seed", 2, "--json").stdout)
        return real(data)

    monkeypatch.setattr(run_module, "to_toml", another_one_meanwhile)
    outer = call("run", first_light, "--duration", 1, "--seed", 1, "--json").stdout
    for seed, out in ((1, json.loads(outer)["out"]), (2, json.loads(inner[1])["out"])):
        assert json.loads((tmp_path / out / "run.json").read_text())["seed"] == seed
    assert sorted(p.name for p in Path("runs").iterdir()) == ["first_light-001", "first_light-002"]


@pytest.mark.parametrize("what", ["the unfinished folder", "all folders"])
def test_a_folder_that_is_removed_in_mid_run_is_one_error(
    what: str, tmp_path: Path, first_light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def remove(self: object) -> None:
        for folder in Path("a/b").glob(f"{PREFIX}*") if what != "all folders" else [Path("a")]:
            shutil.rmtree(folder)

    monkeypatch.setattr("dsa_des.record.sinks.ObserverSink.close", remove)
    result = call("run", first_light, "--duration", 1, "--quiet", "--out", "a/b/run")
    assert result.exit_code == 1
    assert result.stderr.splitlines() == [
        "error: a/b/run: the results cannot be written: No such file or directory"
    ]
    assert everything_in(tmp_path) == {}


@pytest.mark.parametrize("command", ["compare", "compare --swap"])
def test_compare_makes_its_folder_first_and_removes_it_if_nothing_came(
    command: str, places: Path, first_light: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = [first_light, first_light] if command == "compare" else [first_light]
    words += ["--swap", "radar=radar.threshold"] if command != "compare" else []
    before = everything_in(places)
    for out in (".", "link", "dangling", "loop", "file", "file/x", "a" * 300, "", "run"):
        result = call("compare", *words, "--out", out, "--workers", 1, "--replicas", 2)
        assert result.exit_code == 2, (out, result.output)
        assert result.stderr.startswith("error: ") and len(result.stderr.splitlines()) == 1, out
    assert everything_in(places) == before

    def interrupted(*args: object, **kwargs: object) -> None:
        assert [path.name for path in Path("studies").iterdir()] == ["compare-001"]
        raise KeyboardInterrupt

    monkeypatch.setattr("dsa_des.commands.compare.run_study_into_folder", interrupted)
    assert call("compare", *words, "--workers", 1, "--replicas", 2).exit_code == 130
    assert everything_in(places) == before


def test_graph_replaces_links_and_no_devices(places: Path, first_light: Path) -> None:
    (places / "precious").write_text("work")
    (places / "graph.png").symlink_to("precious")
    (places / "dangling.png").symlink_to("nowhere")
    for name in ("graph.png", "dangling.png"):
        assert call("graph", first_light, "--png", "--out", name).exit_code == 0
        assert not (places / name).is_symlink()
        assert (places / name).read_bytes().startswith(b"\x89PNG")
    assert (places / "precious").read_text() == "work" and not (places / "nowhere").exists()
    os.mkfifo(places / "pipe.png")
    (places / "run.png").mkdir()
    for link, end in (("link.png", "run.png"), ("loop.png", "loop.png")):
        (places / link).symlink_to(end)
    before = everything_in(places)
    ending = ("pipe.png", "run.png", "link.png", "no/x.png", "a" * 300 + ".png", "loop.png")
    for name in (*ending, "pipe", "run", ""):
        result = call("graph", first_light, "--png", "--out", name)
        assert result.exit_code == 2, (name, result.output)
        assert len(result.stderr.splitlines()) == 1
    assert everything_in(places) == before


def test_pages_and_rows_are_checked_beforehand(
    places: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("components.thesis.reproduce.make_items", lambda *a: pytest.fail("it ran"))
    monkeypatch.setattr(
        "components.benchmark.run_benchmark.measure_in_new_process",
        lambda *a: pytest.fail("it ran"),
    )
    before = everything_in(places)
    for name in ("run", "pipe", "loop", "no/x", "a" * 300, ""):
        for words in (["reproduce", "--page", name], ["benchmark", "--quick", "--json", name]):
            result = call(*words)
            assert result.exit_code == 2 and len(result.stderr.splitlines()) == 1, result.output
    assert everything_in(places) == before
