"""Nothing finished is lost or doubled when workers or the study itself are killed for real."""

import os
import resource
import shlex
import signal
import subprocess
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from dsa_des.commands.study import run_study_into_folder, write_and_print_finished_study
from dsa_des.errors import UsageError
from dsa_des.results.folder import NotWritten, StudyFolder
from dsa_des.results.statistics import wilson_interval
from dsa_des.studies.executors import Dask, run_and_write
from dsa_des.studies.runner import Stopped, run_study
from dsa_des.studies.study_digest import study_json_text
from dsa_des.studies.study_file import read_study
from tests import warm_process
from tests.support.waiting import wait_for


@pytest.fixture(autouse=True)
def _no_figures(small: Path) -> None:
    """Without figures a process starts and ends much sooner."""
    text = Path("study.toml").read_text()
    Path("study.toml").write_text(text[: text.index("[[figures]]")])


def contents(folder: Path) -> dict[str, bytes]:
    """Everything in a study's folder, by name."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def undisturbed(name: str = "alone", repeat: str = "") -> dict[str, bytes]:
    study = read_study("study.toml")
    study.repeat = repeat
    write_and_print_finished_study(
        study, run_study_into_folder(study, Path(name), 1, False), quiet=True
    )
    return contents(Path(name))


def dsa_des(*words: str) -> warm_process.Process:
    code = "from dsa_des.cli import main; main()"
    return warm_process.start(["-c", code, *words], stdout=subprocess.DEVNULL)


def flawed(flaw: str) -> None:
    """Let the radar of the first replicas have a flaw."""
    text = Path("study.toml").read_text()
    Path("study.toml").write_text(f'{text}\n[set]\nblocks.radar.flaw = "{flaw}"\n')


@pytest.fixture
def released(small: Path) -> Path:
    """A file for which the second half of the runs waits: until it is there no study ends."""
    file = small / "released"
    text = Path("study.toml").read_text()
    text = text.replace("blocks.radar.scan_rate_hz = [1, 5]",
                        f'blocks.ir.flaw = ["none", "wait for {file}"]')  # fmt: skip
    Path("study.toml").write_text(text)
    return file


def test_a_killed_study_continues_to_the_same_bytes(released: Path) -> None:
    released.touch()
    whole = undisturbed(repeat=f"dsa-des study {Path('study.toml').resolve()}")
    released.unlink()
    process = dsa_des("study", "study.toml", "--workers", "2", "--out", "killed", "--quiet")
    parts = Path("killed/parts")
    wait_for(lambda: len(list(parts.glob("*.parquet"))) >= 2)
    assert process.poll() is None  # at work until it is killed
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    before = {path.name: path.stat().st_mtime_ns for path in parts.glob("*.parquet")}
    assert 2 <= len(before) < len([name for name in whole if name.startswith("parts/")])
    released.touch()
    (parts / ".dsa_des-0123456789ab").write_bytes(b"half a par")  # as a kill leaves it
    (parts / ".part-000-000005.parquet.1").write_bytes(b"half a par")  # of an earlier version
    again = dsa_des("study", "study.toml", "--workers", "2", "--out", "killed", "--resume")
    again.communicate()
    assert again.returncode == 0
    assert contents(Path("killed")) == whole
    after = {path.name: path.stat().st_mtime_ns for path in parts.glob("*.parquet")}
    assert before.items() <= after.items()  # what was finished is not run again


def test_a_killed_worker_changes_nothing(small: Path) -> None:
    flag = small / "died"
    flawed(f"die once {flag}")
    flag.touch()
    whole = undisturbed()
    flag.unlink()
    study = read_study("study.toml")
    write_and_print_finished_study(
        study, run_study_into_folder(study, Path("pool"), 2, False), quiet=True
    )
    assert flag.exists()
    assert contents(Path("pool")) == whole


def test_a_poisoned_run_does_not_stop_the_study(small: Path) -> None:
    text = Path("study.toml").read_text()
    extra = '"blocks.ir.flaw" = { choice = ["none", "none", "none", "raise"] }\n"blocks.traffic'
    Path("study.toml").write_text(text.replace('"blocks.traffic', extra))
    study = read_study("study.toml")
    folder = run_study_into_folder(study, Path("poisoned"), 1, False)
    rows = folder.results().to_pylist()
    bad = [row for row in rows if row["error"]]
    assert len(rows) == 48 and 0 < len(bad) < 24
    for row in bad:
        assert "ir (fragile:Fragile) failed at t = 0.000 s" in row["error"]
        assert row["first_detection_range_m.radar"] is None
    words = shlex.split(bad[0]["command"])
    assert words[:2] == ["dsa-des", "run"]
    again = dsa_des(*words[1:], "--out", "again")
    _, stderr = again.communicate()
    assert again.returncode == 1 and "poisoned" in stderr
    assert all(row["command"] is None for row in rows if not row["error"])


def test_a_full_disk_leaves_a_resumable_folder(small: Path) -> None:
    whole = undisturbed()
    limit = len(whole["parts/part-000-000003.parquet"]) - 1  # the parts differ in size
    code = (
        "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}));"
        "from dsa_des.cli import main; main()"
    )
    words = ["study", "study.toml", "--workers", "1", "--out", "full", "--quiet"]
    process = warm_process.run(["-B", "-c", code, *words])
    assert process.returncode == 1, process.stderr
    assert "results cannot be written: File too large" in process.stderr
    assert "--resume" in process.stderr and "Traceback" not in process.stderr
    done = sorted(path.name for path in Path("full/parts").iterdir())
    assert all(name.endswith(".parquet") and not name.startswith(".") for name in done)
    study = read_study("study.toml")
    write_and_print_finished_study(
        study, run_study_into_folder(study, Path("full"), 1, True), quiet=True
    )
    assert contents(Path("full")) == whole
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != limit


def test_ctrl_c_leaves_a_resumable_folder(released: Path) -> None:
    released.touch()
    whole = undisturbed()
    released.unlink()
    process = dsa_des("study", "study.toml", "--workers", "2", "--out", "stopped", "--quiet")
    parts = Path("stopped/parts")
    wait_for(lambda: list(parts.glob("*.parquet")))
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate()
    assert process.returncode == 130
    assert "continue with" in stderr and "Traceback" not in stderr
    released.touch()
    study = read_study("study.toml")
    write_and_print_finished_study(
        study, run_study_into_folder(study, Path("stopped"), 1, True), quiet=True
    )
    assert contents(Path("stopped")) == whole


def test_a_part_that_cannot_be_read_is_run_again(small: Path) -> None:
    whole = undisturbed()
    (Path("alone/parts") / "part-000-000002.parquet").write_bytes(b"torn")
    study = read_study("study.toml")
    write_and_print_finished_study(
        study, run_study_into_folder(study, Path("alone"), 1, True), quiet=True
    )
    assert contents(Path("alone")) == whole


def test_no_results_of_another_study_are_mixed_in(small: Path) -> None:
    undisturbed()
    text = Path("study.toml").read_text().replace("seed = 3", "seed = 4")
    Path("study.toml").write_text(text)
    folder = StudyFolder(Path("alone"))
    with pytest.raises(Exception, match="another study"):
        folder.open(study_json_text(read_study("study.toml")), resume=True)


@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_gives_the_same_bytes_also_when_a_worker_dies(small: Path) -> None:
    distributed = pytest.importorskip("distributed")
    flag = small / "died"
    flawed(f"die once {flag}")
    flag.touch()
    whole = undisturbed()
    flag.unlink()
    study = read_study("study.toml")
    folder = StudyFolder(Path("dask"))
    folder.open(study_json_text(study), resume=False)
    old = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = str(small)
    try:
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster:
            executor = Dask(cluster.scheduler_address)
            run_study(study, folder, executor)
            executor.close()
    finally:
        os.environ.pop("PYTHONPATH")
        if old is not None:
            os.environ["PYTHONPATH"] = old
    assert flag.exists()
    write_and_print_finished_study(study, folder, quiet=True)
    assert contents(Path("dask")) == whole


def test_an_error_of_the_disk_is_told_as_such(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = read_study("study.toml")
    folder = StudyFolder(Path("broken"))
    folder.open(study_json_text(study), resume=False)

    def full(path: object, content: bytes, **how: bool) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("dsa_des.results.folder.write_file", full)
    from dsa_des.studies.executors import Serial

    with pytest.raises(Stopped, match="No space left"):
        run_study(study, folder, Serial())
    assert not list(folder.parts.iterdir())


def test_who_does_not_find_the_study_writes_nothing(small: Path) -> None:
    study = read_study("study.toml")
    folder = StudyFolder(Path("o"))
    folder.open(study_json_text(study), resume=False)
    other, gone = replace(folder.parts_destination, study_sha256="0"), Path("moved").resolve()
    for parts, why in (
        (other, "holds another study"),
        (replace(other, folder=gone), rf"{gone}: is not the folder of a study.*by this name"),
    ):
        with pytest.raises(NotWritten, match=why):
            run_and_write(study, parts, list(study.chunks(0, [0])))
    assert not list(folder.parts.iterdir()) and not gone.exists()


def test_all_runs_open_in_one_line(small: Path) -> None:
    undisturbed()
    table = pq.read_table("alone/parts")
    assert table.num_rows == 48 and "radar.scan_rate_hz" in table.column_names


def test_a_cell_stops_when_its_interval_is_narrow_enough(small: Path) -> None:
    text = Path("study.toml").read_text()
    stop = 'stop_when = {metric = "detected.radar", half_width = 0.2, batch = 6}\n[axes]'
    Path("study.toml").write_text(text.replace("[axes]", stop))
    study = read_study("study.toml")
    rows = run_study_into_folder(study, Path("stops"), 1, False).results().to_pylist()
    for cell in (0, 1):
        mine = [row["detected.radar"] for row in rows if row["cell"] == cell]
        assert len(mine) in (6, 12, 18, 24)
        assert half_width(mine) <= 0.2 or len(mine) == 24
        assert len(mine) == 6 or half_width(mine[:-6]) > 0.2
    resumed = run_study_into_folder(study, Path("stops"), 1, True).results().to_pylist()
    assert resumed == rows


def half_width(values: list[float]) -> float:
    low, high = wilson_interval(sum(values), len(values), 0.95)
    return (high - low) / 2


def test_a_damaged_part_is_named_and_written_anew(small: Path) -> None:
    whole = undisturbed("whole")
    part = Path("whole/parts/part-000-000001.parquet")
    part.write_bytes(part.read_bytes()[:100])
    with pytest.raises(UsageError, match=r"part-000-000001\.parquet; --resume writes"):
        StudyFolder(Path("whole")).results()
    run_study_into_folder(read_study("study.toml"), Path("whole"), 1, True)
    assert part.read_bytes() == whole["parts/part-000-000001.parquet"]
