"""``dsa-des study report``: one page that holds all and loads nothing."""

import html
import json
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dsa_des.cli import main
from dsa_des.results.folder import StudyFolder
from dsa_des.results.report import PAGE_HEAD, report_jinja_environment

ROOT = Path(__file__).parents[2]
STUDY = """\
scene = "SCENE"
title = "Ranges <b>& phases</b>"
replicas = 3
metrics = ["first_detection"]
compare = { axis = "blocks.radar.scan_rate_hz", baseline = 1 }
[set]
duration_s = 10
[axes]
blocks.radar.scan_rate_hz = [1, 5]
[draws]
blocks.radar.offset_s = { uniform = [0, 0.2] }
[[figures]]
metric = "detected.radar"
axis = "blocks.radar.scan_rate_hz"
"""


def call(*words: object) -> Result:
    return CliRunner().invoke(main, ["study", *(str(w) for w in words)], catch_exceptions=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("report")
    scene = ROOT / "configs" / "first_light.toml"
    (home / "s.toml").write_text(STUDY.replace("SCENE", str(scene)), encoding="utf-8")
    done = call(home / "s.toml", "--out", home / "out", "--workers", 1, "--quiet")
    assert done.exit_code == 0, done.output
    return home / "out"


def test_the_page_holds_what_was_asked_and_what_came_of_it(folder: Path) -> None:
    done = call("report", folder)
    assert done.exit_code == 0 and "report.html" in done.stdout
    page = (folder / "report.html").read_text(encoding="utf-8")
    for said in (
        "The question", "Radar scan rate (Hz)", "blocks.radar.offset_s", "first_light.toml",
        "dsa-des explain", "detected.radar", "Paired differences", "data:image/png;base64,",
        "shares by Wilson", "Detected, radar",
        "6 done", "SHA-256", "part-000-000000.parquet", "dsa-des run", "numpy",
    ):  # fmt: skip
        assert said in page, said
    # A title is text, and nothing comes from elsewhere.
    assert "Ranges &lt;b&gt;&amp; phases&lt;/b&gt;" in page and "<b>" not in page
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", page)
    # The question and the answer come first, and every entry of the contents leads somewhere.
    places = [page.index(f'<h2 id="{name}"') for name in ("question", "answer", "models")]
    assert places == sorted(places)
    for name in re.findall(r'href="#(\w+)"', page):
        assert page.count(f'id="{name}"') == 1
    again = folder / "report.html"
    first = again.read_bytes()
    call("report", folder)
    assert again.read_bytes() == first


def test_a_program_that_reads_it_aloud_finds_its_way(folder: Path) -> None:
    """Landmarks around everything, heads with words, wide tables that a keyboard moves."""
    call("report", folder)
    page = (folder / "report.html").read_text(encoding="utf-8")
    body = page.partition("<body>")[2].partition("</body>")[0]
    outside = re.sub(r"<(header|nav|main)>.*?</\1>", "", body, flags=re.DOTALL)
    assert re.sub(r"<[^>]*>|\s", "", outside) == ""
    assert [page.count(mark) for mark in ("<main>", "<h1>", "<nav>")] == [1, 1, 1]
    heads = re.findall(r"<th[^>]*>(.*?)</th>", page)
    assert len(heads) > 20 and all(heads)
    # A row of heads has one over each column, and no heading stands over nothing.
    assert not [one for one in re.findall(r"<tr>.*?</tr>", page) if "<th" in one and "<td" in one]
    assert not re.search(r"</h[23]>\s*(<p>\s*</p>\s*)*(<h2|</main>)", page)
    wide = re.findall(r"<div class='wide'[^>]*>", page)
    assert wide and all("tabindex='0'" in one for one in wide)
    assert all('alt="' in one for one in re.findall(r"<img[^>]*>", page))


def test_it_can_stand_elsewhere_and_says_what_is_no_study(folder: Path, tmp_path: Path) -> None:
    assert call("report", folder, "--out", tmp_path / "page.html", "--no-figures").exit_code == 0
    assert (tmp_path / "page.html").stat().st_size > 3000
    done = call("report", tmp_path)
    assert done.exit_code == 2 and "is not the folder of a study" in done.stderr


def test_it_tells_the_models_their_errors_and_what_is_left_out(folder: Path) -> None:
    call("report", folder, "--no-figures")
    page = (folder / "report.html").read_text(encoding="utf-8")
    for said in (
        "Exact line of sight on the WGS-84 ellipsoid.", "the reference", "Left out, and why",
        "[terrain] refraction is &#x27;none&#x27;", "--measure", "In the first cell",
        "every default written out", "scan_rate_hz = 1", "when the study was begun",
    ):  # fmt: skip
        assert said in page, said
    assert call("report", folder, "--no-figures", "--measure").exit_code == 0
    measured = (folder / "report.html").read_text(encoding="utf-8")
    assert "its own error, measured at" in measured and "earth: ellipsoid" in measured
    # What is kept there is checked: damaged, it is as if it were not there.
    (folder / "errors.json").write_text('{"rows": [1]}', encoding="utf-8")
    (folder / "explained.json").unlink()
    call("report", folder, "--no-figures")
    bare = (folder / "report.html").read_text(encoding="utf-8")
    assert "Measured over" not in bare and "kept neither" in bare


def test_a_strangers_words_are_text(folder: Path) -> None:
    call("report", folder, "--no-figures", "--measure")
    errors = json.loads((folder / "errors.json").read_text(encoding="utf-8"))
    errors["notes"] = ["<img src=x onerror=alert(1)>"]
    (folder / "errors.json").write_text(json.dumps(errors), encoding="utf-8")
    (folder / "explained.json").write_text(
        '{"versions": {"<script>": "1"}, "scene": "</pre><script>", "scenes": []}', encoding="utf-8"
    )
    call("report", folder, "--no-figures")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page and "&lt;script&gt;" in page and "<img src=x" not in page


def test_the_page_s_command_repeats_what_was_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --replicas, --seed, --set and --swap of the command line, from any folder."""
    scene = ROOT / "configs" / "first_light.toml"
    plain = (
        STUDY.replace("SCENE", str(scene)).replace("[draws]", "[draws.none]").partition("[draws")
    )
    (tmp_path / "my study.toml").write_text(plain[0], encoding="utf-8")
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path)
    done = call("my study.toml", "--out", "out", "--workers", 1, "--quiet", "--no-figures",
                "--replicas", 2, "--seed", 7, "--swap", "radar=radar.range_boundary",
                "--set", "set.blocks.radar.range_km=5.5", "--set", "set.duration_s=3")  # fmt: skip
    assert done.exit_code == 0, done.output
    call("report", "out", "--no-figures")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    commands = html.unescape(page.partition("To repeat it</h2><pre>")[2].partition("</pre>")[0])
    program, *words = shlex.split(commands.splitlines()[0])
    assert program == "dsa-des" and words[0] == "study"
    monkeypatch.chdir(tmp_path / "other")
    again = call(*words[1:], "--out", "again", "--workers", 1, "--quiet", "--no-figures")
    assert again.exit_code == 0, again.output
    parts = [sorted((home / "parts").glob("*.parquet")) for home in
             (tmp_path / "out", tmp_path / "other" / "again")]  # fmt: skip
    assert len(parts[0]) == len(parts[1]) > 0
    for one, other in zip(*parts, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_run_of_linked_types_is_repeated_by_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = ROOT / "configs" / "first_light.toml"
    Path("s.toml").write_text(f"""\
scene = "{scene}"
metrics = ["first_detection"]
[set]
duration_s = 2
[axes.radar]
values = ["a", "b"]
set.swap.radar = ["radar.range_boundary", "radar.range_boundary"]
set.blocks.radar.range_km = [3, 20]
""", encoding="utf-8")  # fmt: skip
    done = call("s.toml", "--out", "out", "--workers", 1, "--quiet", "--no-figures")
    assert done.exit_code == 0, done.output
    record = StudyFolder(Path("out")).record
    command = record.command({"seed": 1, "cell": 1})
    assert "--swap radar=radar.range_boundary --set duration_s=2" in command
    words = shlex.split(command)[1:]
    run = CliRunner().invoke(main, [*words, "--no-figures", "--out", "run"])
    assert run.exit_code == 0, run.output


def test_a_type_is_no_value_of_a_key(tmp_path: Path) -> None:
    scene = ROOT / "configs" / "first_light.toml"
    text = (
        f'scene = "{scene}"\nmetrics = ["first_detection"]\n[set]\nswap.tracker = "tracking.ekf"\n'
    )
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    done = call(tmp_path / "s.toml", "--out", tmp_path / "out")
    assert done.exit_code == 2 and not (tmp_path / "out").exists()
    assert "types are changed in [swap]: tracker = ..." in done.stderr


def test_errors_of_models_are_measured_on_request_only(tmp_path: Path) -> None:
    """A study of many runs measures none by itself, and one of few says which it is at."""
    scene = ROOT / "configs" / "first_light.toml"
    text = f'scene = "{scene}"\nreplicas = 120\nmetrics = ["first_detection"]\n'
    text += "[set]\nduration_s = 0.2\n"
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    words = (tmp_path / "s.toml", "--workers", 1, "--set", "figures=[]", "--out")
    assert call(*words, tmp_path / "many").exit_code == 0
    assert not (tmp_path / "many" / "errors.json").exists()
    assert call(*words, tmp_path / "few", "--replicas", 1, "--measure").exit_code == 0
    rows = json.loads((tmp_path / "few" / "errors.json").read_text(encoding="utf-8"))["rows"]
    assert {"earth", "detection"} <= {row["ladder"] for row in rows}


def test_columns_in_which_nothing_stands_are_left_out():
    page = report_jinja_environment().from_string(PAGE_HEAD + "{{ table(heads, rows) }}").render(
        title="t", heads=("a", "b", "", "d"), rows=[("1", "", "x", ""), ("2", "", "", "")]
    )  # fmt: skip
    assert page.count("<th") == 1 and "<td></td></tr>" in page and ">b<" not in page
    assert "<td>1</td><td>x</td></tr>" in page
