"""Options that commands share, further commands, completion, and one line for each slip."""

import json
import signal
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner, Result
from covering import covers

from dsa_des.cli import main
from dsa_des.commands import grouping

SMALL = ("--set", "axes.blocks.radar.scan_rate_hz=[1,2]", "--set", "set.duration_s=5")


def call(*words: object) -> Result:
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("run", "a.toml"), "a.toml: extends: there is no file first_lihgt; "
         "did you mean the shipped 'first_light'?"),
        (("run", "b.toml"), 'b.toml: blocks.raddar.type: needs a type, for example '
         'type = "radar.swerling"; or did you mean the block \'radar\'?'),
        (("run", "first_light", "--swap", "radar=my_sensor.Fmcw"), "command line: --swap radar = "
         "'my_sensor.Fmcw': unknown block type; did you mean 'my_sensor:Fmcw' (module:Class)?"),
        (("run", "first_light", "--set", "seed=1", "--set", "seed=2"),
         "command line: seed = '2': --set gives it twice"),
        (("study", "radar_scan_rate", "--replicas", "2", "--set", "replicas=3"),
         "command line: replicas = '2': --set gives it twice"),
        (("components", "radr"), "radr: there is no such block type, kind of blocks or table of "
         "scenes; did you mean 'radar'?"),
        (("components", "radar.swerling", "scanrate"),
         "radar.swerling: has no key 'scanrate'; did you mean 'scan_rate_hz'?"),
    ],
)  # fmt: skip
def test_a_slip_is_one_line_with_the_nearest_name(words, says):
    Path("a.toml").write_text('extends = "first_lihgt"')
    Path("b.toml").write_text('extends = "first_light"\n[blocks.raddar]\nscan_rate_hz = 2')
    done = call(*words)
    assert (done.exit_code, done.stdout, done.stderr) == (2, "", f"error: {says}\n")


@pytest.mark.parametrize(
    ("command", "name", "says"),
    [
        ("run", "radar_scan_rate", "is a study, not a scene: dsa-des study takes it"),
        ("study", "first_light", "is a scene, not a study: dsa-des run takes it, "
         "dsa-des compare runs it often"),
        ("run", "noncooperative", "is a case, not a scene: dsa-des evidence takes it"),
        ("study", "noncooperative", "is a case, not a study: dsa-des evidence takes it"),
        ("evidence", "first_light", "is no case: dsa-des run takes it"),
    ],
)  # fmt: skip
def test_what_another_command_takes_says_which(command, name, says):
    done = call(command, name, *(("--out", "pack") if command == "evidence" else ()))
    assert done.exit_code == 2 and done.stderr.endswith(f"{name}.toml: {says}\n")


def test_a_study_takes_the_options_of_a_run():
    words = ("study", "radar_scan_rate", *SMALL, "--workers", "1", "--no-figures", "--json")
    done = call(*words, "--replicas", "2", "--seed", "3", "--swap", "radar=radar.threshold")
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["runs"] == 4 and told["failed"] == 0
    record = json.loads(Path(told["folder"], "study.json").read_text())
    assert "radar.threshold" in json.dumps(record) and '"seed": 3' in json.dumps(record)
    again = json.loads(call("study", "show", told["folder"], "--json", "--no-figures").stdout)
    assert again == told


def test_further_commands_of_study_have_their_own_help():
    assert "--replicas" in call("study", "--help").stdout
    for name in ("show", "report"):
        text = call("study", name, "--help").stdout
        assert f"study {name} [OPTIONS] FOLDER" in text and "--replicas" not in text
        assert f"  {name} " in call("study", "--help").stdout


def test_a_comparison_changes_all_that_is_compared():
    words = "compare first_light --swap fusion=fusion.gated --replicas 2 --set duration_s=4"
    only = ("--workers", "1", "--metric", "age_of_information_mean_s")
    first, same, other = (
        call(*words.split(), *only, "--seed", seed, "--out", f"s{k}").stdout.partition("wrote")[0]
        for k, seed in enumerate((5, 5, 6))
    )
    assert first == same != other
    refused = call("compare", "s0", "s1", "--seed", "3")
    assert refused.exit_code == 2 and "s0: is a folder of finished runs" in refused.stderr


def test_a_kind_of_blocks_and_one_key():
    listed = call("components", "radar").stdout
    assert "radar.swerling" in listed and "optical.eo" not in listed
    row = call("components", "radar.swerling", "scan_rate_hz").stdout.splitlines()[1]
    assert row.startswith("  scan_rate_hz") and "Hz" in row and "required" in row
    inner = call("components", "radar.swerling", "calibrate").stdout
    assert "calibrate.rcs_dbsm" in inner and "power_w" not in inner


@pytest.mark.parametrize(
    ("words", "incomplete", "found"),
    [
        (["run"], "first_li", ["first_light"]),
        (["study"], "sh", ["show"]),
        (["study"], "radar_scan", ["radar_scan_rate"]),
        (["evidence"], "noncoop", ["noncooperative"]),
        (["run", "first_light", "--set"], "blocks.radar.scan_r", ["blocks.radar.scan_rate_hz="]),
        (["run", "first_light", "--swap"], "rad", ["radar="]),
        (["run", "first_light", "--swap"], "radar=radar.th", ["radar=radar.threshold"]),
        (["components"], "radar.th", ["radar.threshold"]),
        (["components", "radar.swerling"], "scan_r", ["scan_rate_hz"]),
    ],
)
def test_a_shell_completes(words, incomplete, found):
    shell = ShellComplete(main, {}, "dsa-des", "_DSA_DES_COMPLETE")
    assert [item.value for item in shell.get_completions(words, incomplete)] == found


def test_a_file_is_left_to_the_shell():
    shell = ShellComplete(main, {}, "dsa-des", "_DSA_DES_COMPLETE")
    (item,) = shell.get_completions(["run"], "./mine")
    assert item.type == "file"


@covers("[blocks].acknowledged")
def test_what_a_scene_acknowledges_is_not_said(tmp_path):
    noted = 'extends = "first_light"\nduration_s = 2\n[blocks.radar]\nacknowledged = {}\n'
    for text, lines in (('["gas att"]', 1), ("[]", 2), ('["false_alarm", "gas"]', 0)):
        Path("noted.toml").write_text(noted.format(text))
        done = call("check", "noted.toml")
        assert done.exit_code == 0 and len(done.stderr.splitlines()) == lines
        assert all(line.startswith("note: blocks.radar: ") for line in done.stderr.splitlines())
    assert call("run", "first_light", "--duration", "1", "--no-figures").stderr == ""


GAP = """time,id,lat,lon,alt
0,OWN,-41.0,174,900
30,OWN,-41.0,174.0166667,900
60,OWN,-41.0,174.0333333,900
90,OWN,-41.0,174.05,900
0,MOA,-41.0,174.05,900
20,MOA,-41.0,174.04,900
70,MOA,-41.0,174.01,900
90,MOA,-41.0,174.00,900
"""


def test_what_a_file_gives_to_note_can_be_acknowledged_wherever_it_lies():
    Path("flights").mkdir()
    Path("flights/two.csv").write_text(GAP)
    scene = 'extends = "replay_daa"\nduration_s = 90\n[blocks.traffic]\ntype = "traffic.file"\n'
    scene += 'file = "two.csv"\nlongest_gap_s = 30\nownship = "OWN"\nacknowledged = {}\n'
    for text, lines in ((["MOA: no sample"], 0), (["OWN: no sample", "sample", ""], 1)):
        Path("flights/gap.toml").write_text(scene.format(text))
        done = call("check", "flights/gap.toml")
        assert done.exit_code == 0 and len(done.stderr.splitlines()) == lines, done.stderr


def test_a_key_that_a_change_of_type_dropped_can_be_acknowledged():
    scene = 'extends = "first_light"\n[blocks.radar]\ntype = "radar.range_boundary"\n'
    for text, lines in (("[]", 1), ('["antenna_gain_db"]', 0)):
        Path("other.toml").write_text(f"{scene}range_km = 4\nacknowledged = {text}\n")
        said = [x for x in call("check", "other.toml").stderr.splitlines() if "antenna_gain" in x]
        assert len(said) == lines


OWN = """
import numpy as np
from components.sensor import Look, Sensor, SensorParameters

def helper(x):
    return x["nothing"]

class Counting(Sensor):
    Parameters = SensorParameters
    measures_range = True
    calls = 0
    def look(self, cells):
        self.calls += 1
        return Look(np.full(cells.range_m.shape, self.calls % 2 == 0), cells.range_m)

class Honest(Counting):
    def look(self, cells):
        return Look(cells.draws(self.stream("x")) < 0.5, cells.range_m)

class Broken(Counting):
    def look(self, cells):
        helper({})

class Endless(Counting):
    def look(self, cells):
        import signal
        left_s, again_s = signal.getitimer(signal.ITIMER_REAL)
        assert 0.0 < left_s <= 50.0 and again_s == 1.0
        signal.setitimer(signal.ITIMER_REAL, 0.01, again_s)  # what is left passes here
        while True:
            try:
                while True:
                    pass
            except ValueError:
                pass
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = f"own_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(OWN)
    monkeypatch.syspath_prepend(str(tmp_path))
    return name


def test_a_block_that_counts_its_calls_is_found_by_check(own):
    done = call("check", "first_light", "--swap", f"radar={own}:Counting")
    assert done.exit_code == 2
    (line,) = [text for text in done.stderr.splitlines() if text.startswith("error: ")]
    assert "blocks.radar.type: gives other results" in line and "table detections" in line
    assert call("check", "first_light", "--swap", f"radar={own}:Honest").exit_code == 0


def test_a_block_that_never_returns_ends_a_check_with_one_line(own, monkeypatch):
    monkeypatch.setattr(grouping, "_DEADLINE_S", 50.0)
    done = call("check", "first_light", "--swap", f"radar={own}:Endless")
    assert done.exit_code == 2
    (line,) = [text for text in done.stderr.splitlines() if text.startswith("error: ")]
    assert line.startswith(f"error: radar ({own}:Endless) failed at t = 0.000 s")
    assert "has not returned within 50 s" in line and "in look" in line


@pytest.mark.parametrize("command", ["run", "cost", "check"])
def test_a_mistake_in_ones_own_block_names_file_line_and_function(own, command, tmp_path):
    words = (command, "first_light", "--swap", f"radar={own}:Broken", "--duration", "2")
    done = call(*words)
    assert done.exit_code == 1
    where = f"KeyError: 'nothing' ({tmp_path / own}.py, line 6, in helper)"
    assert done.stderr.splitlines()[-1].endswith(where) and "Traceback" not in done.stderr
    more = call(*words, "--traceback")
    assert more.stderr.splitlines()[-1].endswith(where)
    assert "Traceback" in more.stderr and "in look" in more.stderr


def test_a_type_without_a_ladder_is_named(own):
    done = call("cost", "first_light", "--swap", f"radar={own}:Honest", "--block", "radar")
    assert f"error: radar: {own}:Honest declares no ladder" in done.stderr


def test_nothing_is_interrupted_after_a_deadline_that_was_met():
    before = signal.getsignal(signal.SIGALRM)
    with grouping._interrupt_after(60.0):
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 60.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is before
