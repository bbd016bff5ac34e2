"""`dsa-des cost` from the outside, and its errors against independent calculations."""

import gc
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import mpmath
import numpy as np
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner

from components.line_of_sight.transform import EARTH
from components.radar.detection.ladder import DETECTION
from dsa_des.block.ladder import Unavailable
from dsa_des.cli import main
from dsa_des.commands import cost
from dsa_des.commands.cost import ladders_to_run_and_notes
from dsa_des.costs import replay
from dsa_des.costs.climb import measure_rungs
from dsa_des.costs.replay import RungRun, run_rung
from dsa_des.costs.variants import Choice, Variants

SCENE = Path(__file__).parents[2] / "configs" / "first_light.toml"
SHORT = (str(SCENE), "--duration", "60", "--repeats", "1")


def call(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def variants():
    return Variants(str(SCENE), duration_s=40)


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    out = tmp_path_factory.mktemp("cost") / "out"
    done = call(
        "cost", *SHORT, "--block", "transform", "--budget", "0.1mrad", "--json", "--out", out
    )
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout), out


def test_who_waits_is_told_what_is_measured(monkeypatch, capsys):
    now_s = iter([0.0, 1.0, 11.0, 12.0, 22.0])
    monkeypatch.setattr(cost.time, "monotonic", lambda: next(now_s))
    progress = cost.CostProgress(silent=False)
    for step in ("a", "b", "c", "d"):
        progress.print_if_due(step)  # standard error is no terminal: a line every ten seconds
    assert capsys.readouterr() == ("", "b\nd\n")
    monkeypatch.setattr(cost.time, "monotonic", lambda: 0.0)
    monkeypatch.setattr(cost.sys.stderr, "isatty", lambda: True, raising=False)
    cost.CostProgress(silent=True).print_if_due("nothing")
    cost.CostProgress(silent=False).print_if_due("at once")
    assert capsys.readouterr() == ("", "at once\n")


def test_ladders_are_printed_as_they_come_and_ctrl_c_keeps_them(tmp_path, monkeypatch):
    """The second ladder is interrupted: the first is printed, written and kept."""
    begun = []

    def interrupted(variants, name, ladder, **options):
        begun.append(ladder.name)
        if len(begun) == 2:
            raise KeyboardInterrupt
        return measure_rungs(variants, name, ladder, **options)

    monkeypatch.setattr(cost, "measure_rungs", interrupted)
    out = tmp_path / "out"
    done = call("cost", str(SCENE), "--duration", "4", "--repeats", "1", "--block", "transform",
                "--out", out)  # fmt: skip
    assert done.exit_code == 130, done.output
    # What is foreseen stands first; the table before the word that it was stopped.
    first, foreseen = done.stderr.splitlines()[0], done.stdout
    assert re.match(r"about \d+ s: 5 runs of .* s and \d+ s of timing, if each model", first)
    assert "transform, earth: errors in direction" in foreseen and "flat_earth" in foreseen
    assert "stopped: interrupted; 1 of 2 ladders are kept" in done.stderr
    found = {row["ladder"] for row in pq.read_table(out / "cost.parquet").to_pylist()}
    assert found == {"earth"} and (out / "cost.png").exists()


def test_ctrl_c_before_the_first_ladder_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(
        cost, "measure_rungs", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt)
    )
    out = tmp_path / "out"
    done = call("cost", str(SCENE), "--duration", "4", "--block", "radar", "--out", out)
    assert done.exit_code == 130 and done.stdout == ""
    assert not list(tmp_path.iterdir())


def test_the_scene_itself_is_run_once_for_all_ladders(tmp_path, monkeypatch):
    """Ladders of five and two rungs, of which one each is the scene's: five other runs."""
    runs = []
    own = replay.Simulation.run
    monkeypatch.setattr(replay.Simulation, "run", lambda self: runs.append(1) or own(self))
    short = ("--duration", "2", "--repeats", "1", "--json", "--out", tmp_path / "out")
    done = call("cost", str(SCENE), *short, "--block", "transform")
    assert done.exit_code == 0, done.output
    assert len(runs) == 1 + 4 + 1


def test_rows_and_files(rows):
    found, out = rows
    assert [r["rung"] for r in found] == [
        "flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid", "small_angle",
        "exact"]  # fmt: skip
    for row in found:
        assert row["block"] == "transform" and row["error_unit"] == "mrad"
        assert row["cpu_us_per_target_scan"] > 0.0
        assert row["error_p95"] <= row["error_max"]
    earth = {r["rung"]: r for r in found[:5]}
    assert {r["reference"] for r in found[:5]} == {"ellipsoid"}
    assert earth["ellipsoid"]["in_scene"] and earth["ellipsoid"]["pareto"]
    assert not earth["geodesic"]["pareto"]  # dearer than the exact one, and wrong
    assert earth["ellipsoid"]["inside_budget"] and earth["ellipsoid"]["cheapest_inside"]
    assert not earth["flat_earth"]["inside_budget"]
    assert (out / "cost.png").read_bytes().startswith(b"\x89PNG")
    table = pq.read_table(out / "cost.parquet").to_pylist()
    assert [r["rung"] for r in table] == [r["rung"] for r in found]
    assert table[0]["errors_range_p95"] == found[0]["errors"]["range"]["p95"]


def test_the_reference_shows_its_own_error(rows):
    for row in rows[0]:
        if row["rung"] == row["reference"]:
            assert row["error_is"] == "own" and row["error_note"].startswith("measured")
            # Rounding: 1e-9 mrad is 4 m on the way to the moon.
            assert 0.0 < row["error_max"] < 1e-9


def test_geometry_errors_are_those_of_an_independent_library(variants):
    costs = {c.rung: c for c in measure_rungs(variants, "transform", EARTH, repeats=1)}
    run = run_rung(variants.scene, "transform")
    azimuth, elevation, distance = [], [], []
    flat = []
    for wake in run.wakes:
        s = wake["states"]
        own = [v[:, np.newaxis] for v in (s.own_lat_deg, s.own_lon_deg, s.own_alt_m)]
        az, el, rng = pymap3d.geodetic2aer(s.lat_deg, s.lon_deg, s.alt_m, *own)
        azimuth.append(np.radians(az))
        elevation.append(np.radians(el))
        distance.append(rng)
        east = (s.lon_deg - own[1]) * 111_195.0 * np.cos(np.radians(own[0]))
        north, up = (s.lat_deg - own[0]) * 111_195.0, s.alt_m - own[2]
        flat.append((np.arctan2(east, north), np.arctan2(up, np.hypot(east, north)),
                     np.sqrt(east**2 + north**2 + up**2)))  # fmt: skip
    errors = costs["flat_earth"].errors
    # The ownship flies level to the north, so its body axes are those of its horizon.
    bearing = np.abs(np.remainder(flat[0][0] - azimuth[0] + np.pi, 2 * np.pi) - np.pi) * 1e3
    climb_ = np.abs(flat[0][1] - elevation[0]) * 1e3
    apart = np.abs(flat[0][2] - distance[0])
    for name, mine in (("azimuth", bearing), ("elevation", climb_), ("range", apart)):
        assert errors[name].mean == pytest.approx(float(mine.mean()), rel=0.01)
        assert errors[name].p95 == pytest.approx(float(np.percentile(mine, 95)), rel=0.01)
        assert errors[name].maximum == pytest.approx(float(mine.max()), rel=0.01)


def test_detection_errors_are_those_of_an_independent_calculation(variants):
    costs = {c.rung: c for c in measure_rungs(variants, "radar", DETECTION, repeats=1)}
    threshold_run = run_rung(
        variants.with_rungs([Choice("radar", DETECTION, DETECTION.rung("threshold"))]), "radar"
    )
    block = threshold_run.fresh_block()
    worst = []
    for wake in threshold_run.wakes:
        targets, rows = wake.held("targets")
        cells, _ = block.cells(targets, rows, wake)
        snr = block.snr(cells)
        pd = np.array([float(mpmath.mpf("0.05") ** (1 / (1 + mpmath.mpf(float(x))))) for x in snr])
        says = np.where(10 * np.log10(snr) >= block.threshold_db, 1.0, 0.0)
        worst.append(np.abs(says - pd))
    worst = np.concatenate(worst)
    error = costs["threshold"].first_quantity_error
    assert error.mean == pytest.approx(float(worst.mean()), rel=0.01)
    assert error.p95 == pytest.approx(float(np.percentile(worst, 95)), rel=0.01)
    assert costs["exact"].first_quantity_error.maximum < 1e-14
    assert 0 < costs["table"].first_quantity_error.maximum < 1e-6
    assert costs["gram_charlier"].first_quantity_error.maximum < 0.03


def test_a_rung_changes_its_block_only(variants):
    choice = Choice("radar", DETECTION, DETECTION.rung("threshold"))
    changed = variants.with_rungs([choice]).resolved()["blocks"]
    stated = variants.scene.resolved()["blocks"]
    assert changed.pop("radar")["type"] == "radar.threshold"
    assert stated.pop("radar")["type"] == "radar.swerling"
    assert changed == stated


def test_what_a_scene_cannot_have_is_said(tmp_path):
    short = ("--duration", "4", "--repeats", "1")
    done = call("cost", SCENE, *short, "--block", "eo", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    said = " ".join(done.output.split())
    assert "not available: eo.silhouette_table of target" in said
    boundary = Variants(
        str(SCENE), swaps=["radar=radar.range_boundary"], sets=["blocks.radar.range_km=5"]
    )
    with pytest.raises(Unavailable, match="wavelength_m"):
        measure_rungs(boundary, "radar", DETECTION, repeats=1)


@pytest.mark.parametrize(("band", "type_name"), [("eo", "optical.eo"), ("ir", "optical.ir")])
def test_a_projection_stands_on_the_ladder_of_its_band(band, type_name):
    variants = Variants(
        str(SCENE), swaps=["ir=optical.projection"], sets=[f"blocks.ir.band={band}"]
    )
    ((_, ladder),) = ladders_to_run_and_notes(variants, "ir", None)[0]
    assert ladder.rung(ladder.reference).type_name == type_name
    best = variants.with_rungs([Choice("ir", ladder, ladder.rung(ladder.reference))])
    assert best.blocks["ir"].type_name == type_name
    same = variants.with_rungs([Choice("ir", ladder, ladder.rung("projection"))])
    assert same.blocks["ir"].parameters == variants.scene.blocks["ir"].parameters


def test_accuracy_of_the_scene_is_the_budget_and_chooses_no_rung():
    loose = Variants(
        str(SCENE), sets=["accuracy.angle_deg=0.1", "accuracy.range_m=100"], duration_s=20
    )
    costs = {c.rung: c for c in measure_rungs(loose, "transform", EARTH, repeats=1)}
    assert costs["flat_earth"].inside_budget  # 0.1 deg is 1.7 mrad
    assert costs["ellipsoid"].first_quantity_error.maximum < 1e-9
    cheapest = [c for c in costs.values() if c.cheapest_inside]
    assert len(cheapest) == 1 and cheapest[0].inside_budget


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((SCENE, "--block", "radr"), "did you mean 'radar'"),
        ((SCENE, "--against", "elipsoid"), "did you mean 'ellipsoid'"),
        ((SCENE, "--budget", "3furlongs"), "unknown unit furlongs"),
        ((SCENE, "--block", "gate"), "declares no ladder"),
        ((), "SCENE is missing"),
        (("--map", "geometrie"), "did you mean 'geometry'"),
        (("--map", "geometry", "--block", "eo"), "leave out --block"),
        ((SCENE, "--map", "geometry"), "--map draws no scene: leave out"),
    ],
)
def test_wrong_calls_are_refused_and_leave_nothing(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = call("cost", *arguments)
    assert done.exit_code == 2
    assert said in done.stderr and "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_the_chain_is_combined_of_what_is_on_the_fronts(tmp_path):
    out = tmp_path / "out"
    done = call("cost", str(SCENE), "--duration", "10", "--repeats", "1", "--block", "transform",
                "--all", "--json", "--out", out)  # fmt: skip
    assert done.exit_code == 0, done.output
    chain = [r for r in json.loads(done.stdout) if r["ladder"] == "chain"]
    best = [r for r in chain if r["rung"] == "transform ellipsoid, transform exact"]
    assert len(best) == 1 and best[0]["error_p95"] == 0.0
    assert any(r["pareto"] for r in chain)
    assert not math.isnan(chain[0]["cpu_us_per_target_scan"])
    assert (out / "chain.png").exists() and (out / "chain.parquet").exists()


@pytest.mark.parametrize("collects", [True, False])
@pytest.mark.parametrize("fails", [False, True])
def test_garbage_is_collected_after_a_timed_pass_as_before_it(collects, fails, monkeypatch):
    seen = []

    def run(wake):
        seen.append((wake, gc.isenabled()))
        if fails:
            raise RuntimeError("the block fails")

    timed = RungRun(None, "radar", ["first", "second"], {}, 0.0, 0.0)
    monkeypatch.setattr(timed, "fresh_block", lambda: SimpleNamespace(run=run))
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        if fails:
            with pytest.raises(RuntimeError, match="the block fails"):
                timed.time_one_pass_s()
        else:
            assert timed.time_one_pass_s() >= 0.0
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
    assert seen == [("first", False), ("second", False)][: 1 if fails else 2]
