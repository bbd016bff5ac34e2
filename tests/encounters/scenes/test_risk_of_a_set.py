"""Risk ratios of a study over a set whose encounters differ in weight, family and class."""

import math
from html.parser import HTMLParser
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import dsa_des
from dsa_des.cli import main
from dsa_des.results.ratio import paired_ratio
from tests.encounters.scenes.test_closed_loop_risk import SCENE

STUDY = """\
scene = "scene.toml"
replicas = 6
runs_per_chunk = 6
metrics = [{ metric = "risk_ratio", horizontal_m = 300, vertical_m = 90 }]
[draws]
blocks.traffic.encounter = { sequence = [0, 1] }
"""
#: Metres away at the start, course of the intruder less the ownship's, weight, family; from far
#: away there is time to turn, from near there is none.
ENCOUNTERS = [
    (4500.0, 180.0, 5.0, 3), (500.0, 180.0, 2.0, 1), (500.0, 90.0, 3.0, 2), (500.0, 90.0, 4.0, 2),
    (4500.0, 90.0, 6.0, 0), (4500.0, 90.0, 7.0, 5),
]  # fmt: skip


def table() -> pa.Table:
    """The ownship at 50 m/s on 217 degrees; each intruder meets it 20 m higher, the last 400 m."""
    rows, own = [], math.radians(217.0)
    for number, (away_m, turned_deg, weight, family) in enumerate(ENCOUNTERS):
        theirs = own + math.radians(turned_deg)
        closing = [50.0 * f(own) - 60.0 * f(theirs) for f in (math.cos, math.sin)]
        meets_s = away_m / math.hypot(*closing)
        for name, heading, speed, north, east, up in (
            ("own", own, 50.0, 0.0, 0.0, 0.0),
            (
                "other",
                theirs,
                60.0,
                closing[0] * meets_s,
                closing[1] * meets_s,
                400.0 if number == 5 else 20.0,
            ),
        ):
            rows.append({
                "encounter": number, "weight": weight, "aircraft": name, "north_m": north,
                "east_m": east, "altitude_m": 2000.0 + up, "speed_mps": speed,
                "heading_rad": heading % (2 * math.pi), "duration_s": 60.0, "time_s": [0.0],
                "climb_mps": [0.0], "turn_rad_s": [0.0], "acceleration_mps2": [0.0],
                "family": family,
            })  # fmt: skip
    return pa.Table.from_pylist(rows)


def test_weights_families_and_classes_count(tmp_path: Path) -> None:
    pq.write_table(table(), tmp_path / "set.parquet")
    for name, text in (("scene", SCENE), ("study", STUDY)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    dsa_des.study(tmp_path / "study.toml", out=tmp_path / "out", workers=1)
    runs = pq.read_table(tmp_path / "out" / "parts").to_pydict()
    assert runs["encounter_family"] == [3, 1, 2, 2, 0, 5]
    assert runs["nmac_nominal"] == [1] * 5 + [0]
    assert runs["nmac_mitigated"] == [0, 1, 1, 1, 0, 0]
    kinds = ["head-on"] * 2 + ["crossing from the left"] * 4
    assert runs["encounter_geometry"] == kinds
    found = {row["result"]: row for row in pq.read_table(tmp_path / "out" / "ratios.parquet")
             .to_pylist()}  # fmt: skip
    whole = found["nmac_risk_ratio"]
    assert whole["ratio"] == pytest.approx(9 / 20)
    assert (whole["encounters"], whole["clusters"]) == (6, 5)
    assert whole["effective_sample_size"] == pytest.approx(27**2 / (25 + 4 + 49 + 36 + 49))
    # By the paired delta method, with the two of a family added up first.
    error = math.sqrt(sum(x * x for x in (5 * 0.45, 2 * 0.55, 7 * 0.55, 6 * 0.45))) / 20
    assert whole["gamma_error"] == pytest.approx(error)
    by_hand = paired_ratio([1, 1, 1, 1, 0], [0, 1, 1, 0, 0], [5, 2, 7, 6, 7])
    assert (whole["gamma_low"], whole["gamma_high"]) == pytest.approx(by_hand.interval)
    assert found["nmac_risk_ratio.head-on"]["ratio"] == pytest.approx(2 / 7)
    left = found["nmac_risk_ratio.crossing_from_the_left"]
    assert left["ratio"] == pytest.approx(7 / 13)
    assert (left["encounters"], left["clusters"]) == (4, 3)
    the_report_says_what_the_tables_hold(tmp_path / "out")


class _Tables(HTMLParser):
    """Every table of a page, as rows of texts."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[list[list[str]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag == "table":
            self.found.append([])
        elif tag == "tr":
            self.found[-1].append([])
        elif tag in ("td", "th"):
            self.found[-1][-1].append("")

    def handle_data(self, data: str) -> None:
        if self.found and self.found[-1] and self.found[-1][-1] and data.strip():
            self.found[-1][-1][-1] += data


def the_report_says_what_the_tables_hold(folder: Path) -> None:
    """Every printed ratio, interval and count, against the flags of the runs that it is of."""
    assert CliRunner().invoke(main, ["study", "report", str(folder)]).exit_code == 0
    tables = _Tables((folder / "report.html").read_text(encoding="utf-8")).found
    runs = pq.read_table(folder / "parts").to_pylist()
    (ratios,) = (t for t in tables if t[0][:3] == ["ratio of events", "unresolved", "induced"])
    assert ratios[0][3:7] == ["gamma", "bootstrap", "effective size", "nominal, mitigated, induced"]
    *_, results = (t for t in tables if t[0][:3] == ["result", "value", "interval"])
    printed = {row[0]: row[1:] for row in results[1:]}
    seen = 0
    for name, unresolved, induced, gamma, bootstrap, size, counts, *_ in ratios[1:]:
        event, _, kind = name.partition("_risk_ratio")
        some = [r for r in runs if not kind
                or r["encounter_geometry"].replace(" ", "_") == kind.lstrip(".")]  # fmt: skip
        n, m, w = ([r[c] for r in some] for c in
                   (f"{event}_nominal", f"{event}_mitigated", "encounter_weight"))  # fmt: skip
        below = sum(a * c for a, c in zip(n, w, strict=True))
        if below == 0.0:
            assert "no encounter" in counts or "there is no" in counts
            continue
        seen += 1
        stays = sum(min(a, b) * c for a, b, c in zip(n, m, w, strict=True)) / below
        new = sum(max(b - a, 0.0) * c for a, b, c in zip(n, m, w, strict=True)) / below
        assert (float(unresolved), float(induced)) == pytest.approx((stays, new), rel=1e-4)
        assert float(printed[name][0]) == pytest.approx(stays + new, rel=1e-4)
        told = [sum(x > 0 for x in n), sum(x > 0 for x in m),
                sum(b > a for a, b in zip(n, m, strict=True))]  # fmt: skip
        assert [int(c) for c in counts.split(", ")] == told
        assert size.endswith(f" of {len(some)}")
        low, high = (float(end) for end in gamma.split(" to "))
        assert low <= stays + new <= high and low < high
        assert printed[name][1] == gamma
        if bootstrap:
            ends = [float(end) for end in bootstrap.removesuffix(" *").split(" to ")]
            assert ends == sorted(ends)
    assert seen >= 4
    flag = printed["nmac_nominal"]
    assert float(flag[0]) == pytest.approx(
        sum(r["nmac_nominal"] for r in runs) / len(runs), rel=1e-4
    )
    low, high = (float(end) for end in flag[1].removesuffix(" *").split(" to "))
    # Wilson's ends solve (p - x)^2 n = z^2 x (1 - x); the spread of the units costs one of them.
    share, z = sum(r["nmac_nominal"] for r in runs) / len(runs), 1.959963984540054
    for end in (low, high):
        half = (share - end) ** 2 * (len(runs) - 1)
        assert half == pytest.approx(z * z * end * (1 - end), rel=2e-3)
