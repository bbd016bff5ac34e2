"""`dsa-des cost STUDY --answer RESULT` from the outside, against studies run one by one."""

import csv
import json
import math
import shlex

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from scipy import stats

from dsa_des.cli import main
from dsa_des.commands import cost_answer
from dsa_des.record.drawing import collect_drawn_figures

STUDY = """
title = "A head-on intruder, seen by a radar"
scene = "first_light"
replicas = 12
seed = 3
runs_per_chunk = 6
metrics = [{ metric = "declaration", m = 3, n = 5, sensors = ["radar"], target = "head_on" }]
[set]
duration_s = 80
blocks.eo.enabled = false
blocks.ir.enabled = false
blocks.radar.false_alarm_probability = 1e-6
[draws]
blocks.radar.offset_s = { uniform = [0, 0.2] }
"""
RANGE = "declaration_range_m.radar"


def call(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "mine.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def made(study, tmp_path_factory):
    out = tmp_path_factory.mktemp("cost") / "out"
    with collect_drawn_figures() as figures:
        done = call(
            "cost", study, "--answer", RANGE, "--answer", "declared.radar", "--block", "radar",
            "--vary", "blocks.radar.scan_rate_hz=[2, 5]",
            "--vary", "swap.transform=geometry.flat_earth", "--vary", "swap.radar=radar.threshold",
            "--budget", "400m", "--repeats", "2", "--workers", "1", "--out", out,
        )  # fmt: skip
    assert done.exit_code == 0, done.output
    return done, out, pq.read_table(out / "answer.parquet").to_pylist(), figures["answer"]


def values_of(folder, name=RANGE):
    rows = [row for part in sorted((folder / "parts").glob("*")) for row in
            pq.read_table(part).to_pylist()]  # fmt: skip
    return np.array([row[name] for row in sorted(rows, key=lambda row: row["replica"])], float)


@pytest.mark.parametrize(
    ("model", "change"),
    [
        ("radar detection: threshold", ["--swap", "radar=radar.threshold"]),
        ("radar.scan_rate_hz = 2", ["--set", "set.blocks.radar.scan_rate_hz=2"]),
        ("transform = geometry.flat_earth", ["--swap", "transform=geometry.flat_earth"]),
    ],
)
def test_a_change_is_the_paired_difference_of_two_studies(study, made, tmp_path, model, change):
    """Each run by itself with `dsa-des study`; their differences by Student's t, by hand."""
    sides = []
    for name, words in (("own", []), ("other", change)):
        folder = tmp_path / name
        done = call("study", study, *words, "--workers", "1", "--no-figures", "--quiet", "--out",
                    folder)  # fmt: skip
        assert done.exit_code == 0, done.output
        sides.append(values_of(folder))
    own, other = sides
    both = ~np.isnan(own) & ~np.isnan(other)
    (row,) = [row for row in made[2] if (row["model"], row["result"]) == (model, RANGE)]
    assert row["pairs"] == both.sum() and row["runs"] == 12
    assert row["lost"] == (np.isnan(other) & ~np.isnan(own)).sum()
    assert row["gained"] == (np.isnan(own) & ~np.isnan(other)).sum()
    assert row["differing"] == 12 - (own == other).sum() - (np.isnan(own) & np.isnan(other)).sum()
    comparisons = 2 * len({row["model"] for row in made[2]})
    by_hand = stats.ttest_rel(other[both], own[both]).confidence_interval(1 - 0.05 / comparisons)
    assert (row["low"], row["high"]) == pytest.approx(by_hand, rel=1e-6)


def test_changes_agree_with_two_independent_long_runs(study, made, tmp_path):
    """Other seeds on either side, five times as many runs: nothing is paired, all is plain."""
    sides = []
    for seed, change in ((101, []), (202, ["--set", "set.blocks.radar.scan_rate_hz=2"])):
        folder = tmp_path / str(seed)
        done = call("study", study, *change, "--seed", seed, "--replicas", "60", "--workers", "1",
                    "--no-figures", "--quiet", "--out", folder)  # fmt: skip
        assert done.exit_code == 0, done.output
        values = values_of(folder)
        sides.append(values[~np.isnan(values)])
    own, other = sides
    change = other.mean() - own.mean()
    error = math.hypot(stats.sem(own), stats.sem(other))
    (row,) = [row for row in made[2]
              if (row["model"], row["result"]) == ("radar.scan_rate_hz = 2", RANGE)]  # fmt: skip
    half = 3.3 * error
    assert row["low"] <= change + half and change - half <= row["high"]
    paired = (row["high"] - row["low"]) / 2 / stats.t.ppf(1 - 0.05 / 24, row["pairs"] - 1)
    assert abs(change - row["change"]) < 4 * math.hypot(error, paired)


def test_it_is_printed_what_the_files_hold(made):
    done, out, rows, _ = made
    assert sorted(path.name for path in out.iterdir()) == [
        "answer.csv", "answer.parquet", "answer.png", "run.json", "study", "turns.json",
    ]  # fmt: skip
    told = done.stdout
    assert f"{RANGE}, m: each model in place of the scene's own" in told
    assert "The scene as it is: radar detection: exact, radar.scan_rate_hz = 5." in told
    assert "Note: radar, rcs: changes nothing here, no target has an rcs_table." in told
    # What is listed and is a rung too is run once.
    assert "Note: radar = radar.threshold is radar detection: threshold." in told
    said = json.loads((out / "run.json").read_text())["cost"]
    flat = " ".join(told.split())
    for sentence in [line for lines in said["sentences"].values() for line in lines]:
        assert " ".join(sentence.split()) in flat
    with (out / "answer.csv").open() as file:
        again = list(csv.DictReader(file))
    assert [row["model"] for row in again] == [row["model"] for row in rows]
    assert [row["change"] for row in again] == [
        "" if row["change"] is None else repr(row["change"]) for row in rows]  # fmt: skip
    assert all(row["cpu_of_own"] > 0.0 for row in rows)


def test_the_figure_has_every_change_with_its_interval_against_its_cost(made):
    """Points and bars are those of the table, the limit is a band, and who leaves it is named."""
    rows, figure = made[2], made[3]
    for axes, name in zip(figure.axes, (RANGE, "declared.radar"), strict=True):
        assert axes.get_title() == name
        known = [row for row in rows if row["result"] == name and row["high"] is not None]
        mine = {row["model"]: row for row in known}
        bars = [bar.get_segments() for bar in axes.collections]
        spans = {(x0, y0, y1) for some in bars for (x0, y0), (x1, y1) in some if x0 == x1}
        assert spans == {(row["cpu_of_own"], row["low"], row["high"]) for row in mine.values()}
        named = {text.get_text() for text in axes.texts} - {"as it is", ""}
        assert named <= mine.keys()
        assert named >= {n for n, row in mine.items() if row["front"] or row["verdict"] == "beyond"}
    limit = figure.axes[0].patches[0].get_extents().transformed(figure.axes[0].transData.inverted())
    assert (limit.y0, limit.y1) == pytest.approx((-400.0, 400.0))


def test_what_is_foreseen_stands_first_and_each_turn_is_told(made):
    lines = made[0].stderr.splitlines()
    assert lines[0] == (
        "6 models and the scene as it is, 12 runs each, in 2 turns; the scene as it is goes first"
    )
    assert lines[1].startswith("about ") and "with 1 process, if each model costs" in lines[1]
    assert lines[2].startswith("1 of 2 turns: ") and " of 12 may be taken" in lines[2]


def test_its_runs_are_a_study_of_their_own(made):
    done = call("study", "show", made[1] / "study", "--no-figures")
    assert done.exit_code == 0 and "less the same at model = as it is" in done.stdout


def test_models_are_compared_at_every_value_of_the_study_s_own_axes(study, tmp_path):
    done = call(
        "cost", study, "--answer", RANGE, "--block", "radar", "--set",
        "axes.blocks.radar.scan_rate_hz=[2, 5]", "--set", "replicas=3", "--repeats", "1",
        "--workers", "1", "--json", "--out", tmp_path / "out",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)
    places = {(row["model"], row["where"]) for row in rows}
    assert len(rows) == len(places) == 2 * len({row["model"] for row in rows})
    assert {where for _, where in places} == {"radar.scan_rate_hz = 2", "radar.scan_rate_hz = 5"}
    assert all(row["few"] and row["verdict"] == "open" for row in rows)  # of three runs


def test_any_number_of_workers_gives_the_same(study, tmp_path):
    answers = []
    for workers in (1, 2):
        out = tmp_path / str(workers)
        done = call("cost", study, "--answer", RANGE, "--block", "radar", "--repeats", "2", "--set",
                    "replicas=4", "--workers", workers, "--json", "--out", out)  # fmt: skip
        assert done.exit_code == 0, done.output
        rows = json.loads(done.stdout)
        answers.append([{k: v for k, v in row.items() if not k.startswith(("cpu", "front"))}
                        for row in rows])  # fmt: skip
        answers.append({path.name: path.read_bytes()
                        for path in sorted((out / "study" / "parts").iterdir())})  # fmt: skip
    assert answers[:2] == answers[2:]


def test_ctrl_c_keeps_the_turns_that_are_finished(study, made, tmp_path, monkeypatch):
    told = cost_answer.AnswerOfStudy.finished_turns_text

    def interrupted(self):
        if self.turn_times.runs and max(turn for turn, _ in self.turn_times.runs) == 1:
            monkeypatch.setattr(cost_answer.AnswerOfStudy, "finished_turns_text", told)
            raise KeyboardInterrupt
        return told(self)

    monkeypatch.setattr(cost_answer.AnswerOfStudy, "finished_turns_text", interrupted)
    out = tmp_path / "out"
    done = call("cost", study, "--answer", RANGE, "--block", "radar", "--repeats", "4",
                "--workers", "1", "--out", out)  # fmt: skip
    assert done.exit_code == 130, done.output
    assert "stopped: interrupted after 2 of 4 turns; what is finished is kept" in done.stderr
    rows = pq.read_table(out / "answer.parquet").to_pylist()
    assert {row["runs"] for row in rows} == {6}
    kept = {path: path.stat().st_mtime_ns for path in (out / "study" / "parts").iterdir()
            if path.name < "part-002"}  # fmt: skip
    again = shlex.split(done.stderr.splitlines()[-1])
    assert again[:3] == ["dsa-des", "cost", "--resume"] and again[-2:] == ["--", str(study)]
    refused = CliRunner().invoke(main, [*again[1:-2], "--repeats", "3", *again[-2:]])
    assert refused.exit_code == 2 and "was begun in 4 turns" in refused.stderr
    refused = CliRunner().invoke(main, ["cost", *again[3:]])
    assert refused.exit_code == 2 and "is not empty; --resume continues" in refused.stderr
    turns = (out / "turns.json").read_bytes()
    (out / "turns.json").write_bytes(turns[:-9])
    refused = CliRunner().invoke(main, again[1:])
    assert refused.exit_code == 2 and "turns.json: is damaged" in refused.stderr
    (out / "turns.json").write_bytes(turns)
    done = call(*again[1:-2], "--no-figures", *again[-2:])
    assert done.exit_code == 0, done.output
    assert kept == {path: path.stat().st_mtime_ns for path in kept}
    for row in pq.read_table(out / "answer.parquet").to_pylist():
        (whole,) = [r for r in made[2] if (r["model"], r["result"]) == (row["model"], RANGE)]
        assert (row["runs"], row["change"]) == (12, whole["change"])


def test_a_model_whose_runs_all_fail_is_named_with_its_reason(study, tmp_path):
    """It is set up well and breaks in flight; the others go on."""
    (tmp_path / "late.py").write_text(
        "from components.line_of_sight.transform import FlatEarth\n"
        "class Late(FlatEarth):\n"
        "    'Breaks when it runs.'\n"
        "    lockstep = True\n"
        "    def run(self, wake):\n"
        "        raise ValueError('it broke')\n"
    )
    done = call("cost", study, "--answer", RANGE, "--block", "radar", "--set", "replicas=2",
                "--vary", f"swap.transform={tmp_path}/late.py:Late", "--repeats", "1", "--workers",
                "1", "--json", "--out", tmp_path / "out")  # fmt: skip
    assert done.exit_code == 0, done.output
    (row,) = [row for row in json.loads(done.stdout) if "late.py" in row["model"]]
    assert row["verdict"] == "nothing to compare" and "it broke" in row["reason"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--answer", "declaration_rang_m.radar"],
         "--answer declaration_rang_m.radar: there is no such result; did you mean "
         "'declaration_range_m.radar'?"),
        (["--set", "replicas=1"],
         "one run cannot tell by how much others would differ: --set replicas=2 or more"),
        (["--block", "radr"], "--block radr: the scene has no such block; did you mean 'radar'?"),
        (["--block", "gate"], "--block gate: declares no ladder; --vary swap.gate=TYPE names"),
        (["--vary", "blocks.radr.scan_rate_hz=2"], "the scene has no block 'radr'"),
        (["--vary", "swap.transform=geometry.flat_erth"], "did you mean 'geometry.flat_earth'?"),
        (["--vary", "blocks.radar.offset_s=0.1"],
         "--vary blocks.radar.offset_s=0.1: the study's draw blocks.radar.offset_s sets it"),
        (["--vary", "scan_rate"], "--vary = 'scan_rate': must have the form KEY=VALUE"),
        (["--budget", "5s"], "--budget 5s: declaration_range_m.radar is in m"),
        (["--all"], "--all: does not go with --answer"),
        (["--against", "exact"], "--against: does not go with --answer"),
        (["--workers", "0"], "--workers is 0: it must be 1 or more"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked(study, tmp_path, words, message):
    done = CliRunner().invoke(
        main, ["cost", str(study), "--answer", RANGE, "--out", str(tmp_path / "out"), *words]
    )
    assert done.exit_code == 2, done.output
    assert message in " ".join(done.stderr.split()), done.stderr
    assert not (tmp_path / "out").exists()


def test_options_of_answers_want_an_answer(tmp_path):
    for words in (["--vary", "seed=[1, 2]"], ["--workers", "2"], ["--resume"]):
        done = CliRunner().invoke(main, ["cost", "first_light", *words])
        assert done.exit_code == 2
        assert f"{' '.join(words)}: goes with --answer RESULT of a study" in done.stderr
    done = CliRunner().invoke(main, ["cost", "first_light", "--answer", RANGE])
    assert done.exit_code == 2 and "is a scene, not a study" in done.stderr
    done = CliRunner().invoke(main, ["cost", "--answer", RANGE])
    assert done.exit_code == 2 and "give a STUDY" in done.stderr


def test_a_study_whose_own_runs_all_fail_has_nothing_to_compare_with(study, tmp_path):
    (tmp_path / "broken.py").write_text(
        "from components.line_of_sight.transform import FlatEarth\n"
        "class Broken(FlatEarth):\n"
        "    'Breaks when it runs.'\n"
        "    lockstep = True\n"
        "    def run(self, wake):\n"
        "        raise ValueError('it broke')\n"
    )
    done = CliRunner().invoke(
        main, ["cost", str(study), "--answer", RANGE, "--block", "radar", "--workers", "1",
               "--swap", f"transform={tmp_path}/broken.py:Broken", "--set", "replicas=2",
               "--out", str(tmp_path / "out")])  # fmt: skip
    assert done.exit_code == 2, done.output
    assert "no run of the scene as it is has a result" in done.stderr
    assert "it broke" in done.stderr


def test_a_target_that_a_model_never_declares_is_counted(study, tmp_path):
    """A boundary within the run's nearest range: no run declares it, and none is dropped."""
    done = call(
        "cost", study, "--answer", RANGE, "--block", "radar", "--vary",
        "blocks.radar.range_km=[5, 0.5]", "--repeats", "1", "--workers", "1", "--out",
        tmp_path / "out",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    rows = pq.read_table(tmp_path / "out" / "answer.parquet").to_pylist()
    (never,) = [row for row in rows if row["model"] == "radar.range_km = 0.5"]
    assert never["lost"] + never["neither"] == 12 and never["pairs"] == 0
    assert never["verdict"] != "within" and math.isnan(never["change"] or math.nan)
