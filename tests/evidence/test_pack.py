"""The pack of a small case: its numbers by hand, the same again, and what a change changes."""

import hashlib
import json
import math
import re
from pathlib import Path
from shutil import copytree

import numpy as np
import pyarrow.parquet as pq
import pytest

from dsa_des.block.shipped_files import example_folders
from dsa_des.evidence.case import read_case
from dsa_des.scene.examples import find_input_file
from tests.evidence.small_case import Made, made

#: Keys that name an item of a list.
_NAMES = ("name", "key", "study", "file", "requirement")


def rows(pack: Made, study: str) -> dict:
    return pq.read_table(pack.folder / "studies" / study / "parts").to_pandas()


def tree(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def changed(one: object, other: object, at: str = "") -> set[str]:
    """Places at which two pieces of evidence differ, items of lists by their names."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = {*one, *other}
        return set().union(*(changed(one.get(k), other.get(k), f"{at}/{k}") for k in keys))
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = list(zip(one, other, strict=True))
        if pairs and isinstance(one[0], dict):
            pairs_by = {str(next((a[k] for k in _NAMES if k in a), n)): (a, b)
                        for n, (a, b) in enumerate(pairs)}  # fmt: skip
            return set().union(*(changed(a, b, f"{at}/{n}") for n, (a, b) in pairs_by.items()))
    return set() if one == other else {at}


def test_the_numbers_are_those_of_the_runs(pack):
    assert pack.code == 0, pack.output
    runs = rows(pack, "assessed")
    weight, lost = runs["encounter_weight"], runs["well_clear_lost_mitigated"]
    without = runs["well_clear_lost_nominal"]
    ratio = (weight * lost).sum() / (weight * without).sum()
    found, turns = pack.evidence["requirements"]
    assert found["value"] == pytest.approx(ratio, rel=1e-9)
    assert found["induced"] + found["unresolved"] == pytest.approx(ratio, rel=1e-9)
    assert (found["nominal_events"], found["mitigated_events"]) == (without.sum(), lost.sum())
    assert 0.0 < lost.sum() < without.sum() < len(runs) == 24
    told = runs["manoeuvred"]
    assert turns["value"] == pytest.approx(told.mean()) and 0.0 < told.mean() < 1.0
    kept = 1.0 - without
    (share,) = pack.evidence["also"]
    needless = (weight * kept * told).sum() / (weight * kept).sum()
    assert share["value"] == pytest.approx(needless, abs=1e-12)
    (slow,) = pack.evidence["beside"]
    runs = rows(pack, "slow")
    assert slow["results"][1]["value"] == pytest.approx(runs["manoeuvred"].mean())


def test_the_running_estimate_is_that_of_the_first_encounters(pack):
    runs, evidence = rows(pack, "assessed"), pack.evidence
    found = evidence["convergence"]["estimates"][0]
    w, m, n = (runs[c].to_numpy() for c in ("encounter_weight", "well_clear_lost_mitigated",
                                            "well_clear_lost_nominal"))  # fmt: skip
    estimates = {k: (w[:k] * m[:k]).sum() / (w[:k] * n[:k]).sum() for k in found["encounters"]}
    assert found["value"] == pytest.approx(list(estimates.values()))
    last = [value for k, value in estimates.items() if k >= 18]
    assert found["rule_counts_from"] == 18 and found["encounters"][-1] == 24
    assert found["moved"] == pytest.approx(max(abs(v - last[-1]) for v in last)) and len(last) == 7
    assert found["may_move"] == pytest.approx(last[-1])


def test_the_sensitivity_is_paired_on_the_same_encounters(pack):
    runs = rows(pack, "sensitivity")
    as_stated = runs[runs["changed"] == "as stated"]
    changes = [c for c in pack.evidence["sensitivity"] if c["result"] == "manoeuvred"]
    assert [c["key"] for c in changes][:2] == ["blocks.avoidance.range_km"] * 2
    for one in changes:
        mine = runs[runs["changed"] == f"{one['key']} = {one['value']}"]
        assert list(mine["encounter"]) == list(as_stated["encounter"])
        apart = mine["manoeuvred"].mean() - as_stated["manoeuvred"].mean()
        assert one["difference"] == pytest.approx(apart, abs=1e-12)
        # Bonett and Price: one more that gained and one more that lost, of six pairs; t of 5.
        pairs = [*(mine["manoeuvred"].to_numpy() - as_stated["manoeuvred"].to_numpy()), 1.0, -1.0]
        half = 2.570582 * np.std(pairs) / math.sqrt(len(pairs))
        ends = np.mean(pairs) - half, np.mean(pairs) + half
        assert (one["low"], one["high"]) == pytest.approx(ends, abs=1e-6)
    assert {c["as_stated"] for c in changes} == {"1.2", "300.0"}


def test_every_file_that_is_read_has_its_digest(case, pack):
    shipped = ("avoidance/airspace.toml", "encounters/light_aircraft.parquet")
    files = {name: case.parent / name for name in ("case.toml", "scene.toml", "slow.toml",
                                                   "study.toml")}  # fmt: skip
    for name in shipped:
        (files[name],) = [
            folder / name for folder in example_folders() if (folder / name).is_file()
        ]
    digests = {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}
    assert {row["file"]: row["sha256"] for row in pack.evidence["inputs"]} == digests


def test_every_stated_parameter_has_its_source(pack):
    found = {row["key"]: row for row in pack.evidence["parameters"]}
    assert found["radar.range_km"]["source"] == "a sheet"
    assert found["radar.range_cell_m"]["source"] == "another sheet"
    assert found["radar.range_km"]["written_in"].endswith("scene.toml")
    assert found["radar.scan_rate_hz"]["written_in"] == "avoidance/airspace.toml"
    assert found["radar.range_error_m"]["source"] is None
    assert found["wires.avoidance.manoeuvres -> traffic.manoeuvres"]["value"].startswith(
        "delay_s = 1"
    )
    assert all(row["source"] for row in found.values() if row["written_in"] != "default")


def test_the_page_holds_what_was_asked_and_loads_nothing(pack):
    page = (pack.folder / "evidence.html").read_text(encoding="utf-8")
    line = pack.evidence["verdict"]["line"]
    assert line in page and line in pack.output
    assert page.index(line) < page.index("<h2")
    for text in (
        "Little is lost.",
        "another sheet",
        "it is fine",
        "7b",
        "1e-12 m + 1e-13 of the range",
    ):
        assert text in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    # A program that reads it aloud finds its way: everything stands in a landmark.
    body = page.partition("<body>")[2].partition("</body>")[0]
    outside = re.sub(r"<(header|nav|main|style)>.*?</\1>", "", body, flags=re.DOTALL)
    assert re.sub(r"<[^>]*>|\s", "", outside) == "" and page.count("<main>") == 1
    # No heading stands over nothing: this system has no description.
    assert not re.search(r"</h[23]>\s*(<p>\s*</p>\s*)*(<h2|</main>)", page)
    assert not [one for one in re.findall(r"<tr>.*?</tr>", page) if "<th" in one and "<td" in one]


def test_a_second_run_and_one_from_the_pack_itself_give_the_same_bytes(case, pack, tmp_path):
    again = made(case, tmp_path / "again")
    assert tree(again.folder) == tree(pack.folder)
    inputs = copytree(pack.folder / "inputs", tmp_path / "elsewhere")
    (file,) = inputs.rglob("case.toml")
    elsewhere = made(file, tmp_path / "third")
    apart = changed(pack.evidence, elsewhere.evidence)
    assert apart <= {"/command"}


def test_a_changed_limit_changes_its_line_alone(case, pack, tmp_path):
    copytree(pack.folder, tmp_path / "pack")
    value = pack.evidence["requirements"][1]["value"]
    other = made(case, tmp_path / "pack", "--resume", "--set", f"requirements[1].least={value}")
    assert other.code == 0
    apart = changed(pack.evidence, other.evidence)
    sensitivity = {f"/sensitivity/blocks.{k}/in_limits" for k in
                   ("avoidance.range_km", "radar.declare_speed_m_s")}  # fmt: skip
    mine = {f"/requirements/turns/{k}" for k in ("limit", "verdict")}
    assert mine <= apart <= {*mine, *sensitivity, "/verdict/line", "/verdict/passes",
                             "/command"}  # fmt: skip
    assert other.evidence["requirements"][1]["verdict"] == "not shown"
    assert other.output.startswith("Does not pass: turns")


def test_a_changed_parameter_leaves_what_stands_beside_the_system(case, pack, tmp_path):
    other = made(case, tmp_path / "pack", "--set", "set.blocks.avoidance.turn_deg=20")
    one, two = pack.evidence, other.evidence
    assert one["beside"] == two["beside"]
    apart = {key for key in one if one[key] != two[key]}
    assert "parameters" in apart
    assert apart <= {"parameters", "requirements", "also", "convergence", "sensitivity", "results",
                     "verdict", "command", "sample"}  # fmt: skip
    assert changed(one["parameters"], two["parameters"]) == {
        "/avoidance.turn_deg/value", "/avoidance.turn_deg/written_in"}  # fmt: skip


def test_what_is_of_the_system_changes_with_it(case):
    def turns(*sets):
        studies = read_case(case, sets).studies
        return [studies[name].scene(0).resolved()["blocks"]["avoidance"]["turn_deg"]
                for name in ("assessed", "slow")]  # fmt: skip

    change = "set.blocks.avoidance.turn_deg=20"
    assert turns(change)[0] == 20 != turns(change)[1]
    assert turns(change, "beside[0].of_system=true") == [20, 20]
    # The shipped case: its tracks are the system's own, the pilot aboard has no radar.
    shipped = find_input_file("noncooperative", "case")
    found = read_case(shipped, ["set.blocks.radar.range_km=3"]).studies
    ranges = {name: study.scene(0).resolved()["blocks"].get("radar", {}).get("range_km")
              for name, study in found.items()}  # fmt: skip
    assert ranges.pop("pilot-aboard") is None and set(ranges.values()) == {3}


def test_a_rule_of_the_limit_allows_a_share_of_the_limit(case, pack, tmp_path):
    copytree(pack.folder, tmp_path / "pack")
    sets = ("--set", "convergence.of=limit", "--set", "convergence.share=0.5")
    other = made(case, tmp_path / "pack", "--resume", *sets)
    allowed = [one["may_move"] for one in other.evidence["requirements"]]
    assert allowed == pytest.approx([0.5 * 2, 0.5 * 0.01])


def test_an_estimate_that_still_moves_gives_no_verdict(case, pack, tmp_path):
    copytree(pack.folder, tmp_path / "pack")
    moved = pack.evidence["requirements"][0]["moved"]
    assert moved > 0.0
    other = made(case, tmp_path / "pack", "--resume", "--set", "convergence.share=1e-4")
    assert other.code == 1
    assert other.evidence["verdict"]["passes"] is None
    line = other.evidence["verdict"]["line"]
    assert line.startswith("No verdict: lost has not converged") and "Passes" not in line
    assert np.isclose(other.evidence["requirements"][0]["moved"], moved)
    assert json.dumps(other.evidence["requirements"][0]["verdict"]) == '"not converged"'
