"""Requirements and maps: the cheapest value by hand, wrong tables, a study end to end."""

from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.results import figures
from dsa_des.results.record import NUMBER, Requirement, Result
from dsa_des.results.statistics import Estimate
from dsa_des.results.summary import Line, cheapest_values, one_sided_confidence
from dsa_des.studies.study_file import read_study

ROOT = Path(__file__).parents[2]
RESULT = Result("risk", NUMBER, "")


def lines(*highs: float) -> list[Line]:
    """A result at ranges 1, 2, ...: its interval reaches from 0.4 below to 0.2 above."""
    return [
        Line((float(k), "x"), RESULT, Estimate(high - 0.2, high - 0.6, high, 9, False), 0, None)
        for k, high in enumerate(highs, start=1)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("highs", "value", "estimated", "uneven"),
    [
        ((0.9, 0.6, 0.5, 0.3), 3.0, 2.0, False),
        ((0.9, 0.6, 0.5, 0.51), None, 2.0, True),
        ((0.4, 0.8, 0.5, 0.3), 3.0, 3.0, True),
        ((0.1, 0.1, 0.1, 0.1), 1.0, 1.0, False),
        ((0.9, 0.9, 0.9, 0.9), None, None, False),
    ],
)
def test_the_cheapest_and_all_dearer_ones_keep_their_intervals_within_the_limit(
    highs, value, estimated, uneven
) -> None:
    (found,) = cheapest_values(Requirement("risk", "range", 0.5), ["range", "name"], lines(*highs))
    assert (found.value, found.estimated, found.uneven) == (value, estimated, uneven)
    assert found.at == ("x",)
    assert found.line.at[0] == (value or 4.0)  # what the dearest comes to where none will do
    # The other end of the axis is the cheap one: the same intervals in the other order.
    turned = cheapest_values(
        Requirement("risk", "range", 0.5, cheap_last=True), ["range", "name"], lines(*highs[::-1])
    )[0]
    assert turned.value == (None if value is None else 5.0 - value)
    # At least: the lower end counts.
    least = cheapest_values(Requirement("risk", "range", -0.1, below=False), ["range", "name"],
                    lines(0.2, 0.4, 0.6, 0.7))[0]  # fmt: skip
    assert least.value == 3.0 and least.estimated == 1.0


def test_an_interval_of_too_few_values_meets_nothing() -> None:
    some = lines(0.4, 0.4, 0.4)
    some[1] = replace(some[1], estimate=replace(some[1].estimate, few=True))
    (found,) = cheapest_values(Requirement("risk", "range", 0.5), ["range", "name"], some)
    assert (found.value, found.estimated) == (3.0, 1.0)


def test_one_end_of_an_interval_is_surer_than_both() -> None:
    assert one_sided_confidence(0.95) == pytest.approx(0.975)


STUDY = """\
scene = "SCENE"
replicas = 12
metrics = ["detection_share"]
[set]
duration_s = 10
[axes]
blocks.radar.scan_rate_hz = [1, 2]
blocks.eo.scan_rate_hz = [1, 3]
[[figures]]
kind = "map"
metric = "detection_share.radar"
limit = [0.2, 0.9]
[[requirements]]
metric = "detection_share.radar"
axis = "blocks.radar.scan_rate_hz"
least = 0.001
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("least = 0.001", "", "needs one limit"),
        ("least = 0.001", "least = 1\nmost = 2", "needs one limit"),
        ("least = 0.001", "least = nan", "must be a finite number"),
        ("least = 0.001", 'least = 1\ncheaper = "low"', "'first' or 'last'"),
        ("least = 0.001", "least = 1\nmots = 2", "did you mean 'most'"),
        ('axis = "blocks.radar.scan_rate_hz"', 'axis = "blocks.radar.range"', "no such axis"),
        ('axis = "blocks.radar.scan_rate_hz"', "", r"axis: is required by \[requirements\[0\]\]"),
        ('"detection_share.radar"\naxis', '"detection_shape.radar"\naxis', "did you mean"),
        ("limit = [0.2, 0.9]", 'limit = "low"', "must be a valid number"),
        ("[[requirements]]", "[requirements]", "must be a list of tables"),
        ("blocks.eo.scan_rate_hz = [1, 3]", "", "a map needs two axes"),
    ],
)
def test_what_is_wrong_is_said(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = STUDY.replace("SCENE", str(ROOT / "configs" / "first_light.toml"))
    (tmp_path / "s.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(SceneError, match=said):
        read_study(tmp_path / "s.toml")


def test_a_study_draws_its_map_and_tells_the_cheapest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn, draw = [], figures.draw_contour_map
    monkeypatch.setattr(
        figures, "draw_contour_map", lambda *given: drawn.append(given) or draw(*given)
    )
    text = STUDY.replace("SCENE", str(ROOT / "configs" / "first_light.toml"))
    across, up = "blocks.eo.scan_rate_hz", "blocks.radar.scan_rate_hz"
    text = text.replace('kind = "map"\n', f'kind = "map"\nx = "{across}"\ny = "{up}"\n')
    # The same once more, with the other end of the axis as the cheap one.
    text += text[text.index("[[requirements]]") :] + 'cheaper = "last"\n'
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    words = ["study", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--workers", "1"]
    done = CliRunner().invoke(main, words, catch_exceptions=False)
    assert done.exit_code == 0 and "cheapest that meets a limit, 97.5 % sure" in done.output
    assert (tmp_path / "out" / "figure-01-map.png").stat().st_size > 5000
    found = pq.read_table(tmp_path / "out" / "requirements.parquet").to_pylist()
    assert [row["others"] for row in found] == [f"eo.scan_rate_hz = {k}" for k in (1, 3)] * 2
    (map_,) = drawn
    assert map_[3:6] == ("detection_share.radar", "eo.scan_rate_hz", "radar.scan_rate_hz")
    assert (list(map_[6]), map_[8]) == ([0.2, 0.9], 0.95)
    summary = pq.read_table(tmp_path / "out" / "summary.parquet").to_pylist()
    for number, (row, eo) in enumerate(zip(found, (1.0, 3.0) * 2, strict=True)):
        mine = [r for r in summary if r["result"] == "detection_share.radar"]
        low = {r["radar.scan_rate_hz"]: r["low"] for r in mine if r["eo.scan_rate_hz"] == eo}
        for r in mine:
            if r["few"] and r["eo.scan_rate_hz"] == eo:
                low[r["radar.scan_rate_hz"]] = -1.0
        dear, cheap = (2.0, 1.0) if number < 2 else (1.0, 2.0)
        best = None if low[dear] < 0.001 else dear if low[cheap] < 0.001 else cheap
        assert row["cheapest"] == (best and f"{best:g}")
        assert row["confidence"] == pytest.approx(0.975)
        (told,) = (r for r in mine if r["eo.scan_rate_hz"] == eo
                   and r["radar.scan_rate_hz"] == (best or dear))  # fmt: skip
        for name in ("value", "low", "high"):
            assert row[name] == told[name]
