"""Output that cannot be written is one line and exit code 1, and nothing half-written is left."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from dsa_des import read_run
from tests import warm_process

CODE = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
{start}
"""
MAIN = "from dsa_des.cli import main; main()"
COMPARISON = "from components.thesis.silhouette_comparison import main; sys.exit(main())"


def limited(limit: int, *words: object, start: str = MAIN) -> subprocess.CompletedProcess[str]:
    """Call the program where no file may become longer than a limit, as on a full disk."""
    code = CODE.format(limit=limit, start=start)
    return warm_process.run(["-B", "-c", code, *words], timeout=300)


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        (0, ["run", "{scene}", "--duration", "1", "--out", "o"]),  # not even a lock
        (1000, ["run", "{scene}", "--duration", "20", "--out", "o"]),
        (100_000, ["run", "{scene}", "--set", "blocks.radar.scan_rate_hz=1000"]),  # while it runs
        (2000, ["cost", "{scene}", "--block", "transform", "--repeats", "1", "--duration", "1"]),
        (2000, ["graph", "{scene}", "--png", "--out", "o.png"]),
        (2000, ["reproduce", "fig-3.11", "--out", "a/b"]),
    ],
)
def test_a_full_disk(
    limit: int, words: list[str], tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = configs / "first_light.toml"
    done = limited(limit, *(word.format(scene=scene) for word in words))
    assert done.returncode == (1 if limit else 2), done.stderr
    # What blocks warn of, and how long it takes, was said before.
    said = [
        line
        for line in done.stderr.splitlines()
        if not re.match(r"note: |\d+ notes?: |about \d", line)
    ]
    assert len(said) == 1 and said[0].startswith("error: "), done.stderr
    assert "cannot be written: File too large" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_run_whose_figures_do_not_fit_is_kept(
    tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = limited(
        60_000, "run", configs / "first_light.toml", "--duration", "20", "--quiet", "--out", "o"
    )
    assert done.returncode == 1
    assert done.stderr == (
        "error: o: figures cannot be written: File too large; the run itself is complete\n"
    )
    assert read_run("o").detections.num_rows > 0
    assert not list(Path("o").glob("*.png"))


def test_an_earlier_run_stays_when_its_replacement_does_not_fit(
    tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("run", configs / "first_light.toml", "--duration", "1", "--quiet", "--out", "o")
    assert limited(1 << 30, *words).returncode == 0
    before = {path.name: path.read_bytes() for path in Path("o").iterdir()}
    assert limited(1000, *words).returncode == 1
    assert {path.name: path.read_bytes() for path in Path("o").iterdir()} == before
    assert os.listdir() == ["o"]


def test_the_comparison_of_silhouettes_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [f"{az},{el},10" for az in range(0, 360, 90) for el in (-90, 0, 90)]
    Path("areas.csv").write_text("\n".join(["az_deg,el_deg,area_m2", *lines]) + "\n")
    words = ("--areas", "4,20,40", "--reference", "areas.csv", "--step-deg", "90", "--out", "o")
    done = limited(500, *words, start=COMPARISON)
    assert done.returncode == 1, done.stderr
    assert done.stderr == "error: o: the results cannot be written: File too large\n"
    assert os.listdir() == ["areas.csv"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no such device")
@pytest.mark.parametrize(
    "words",
    [["--help"], ["explain", "{scene}"], ["check", "{scene}"], ["run", "{scene}", "--duration=1"]],
    ids=lambda words: words[0],
)
def test_our_own_output_on_a_full_disk(
    words: list[str], tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = configs / "first_light.toml"
    with open("/dev/full", "w") as full:
        started = ["-m", "dsa_des", *(word.format(scene=scene) for word in words)]
        done = warm_process.run(started, stdout=full)
    assert done.returncode == 1
    said = [
        line
        for line in done.stderr.splitlines()
        if not re.match(r"note: |\d+ notes?: |about \d", line)
    ]
    assert said == ["error: the output cannot be written: No space left on device"]
